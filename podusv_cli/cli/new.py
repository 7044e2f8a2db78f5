"""`podusv new`: a law, path or disturbance of one's own to start from."""

from __future__ import annotations

from typing import Annotated

import typer

from podusv_cli.cli.terminal import echo


def new(
    what: Annotated[str, typer.Argument(metavar="WHAT", help="law, path or disturbance.")],
    name: Annotated[str, typer.Argument(help="What it is called, like my_law.")],
) -> None:
    """Write a small working law, path or disturbance of your own, with its test and a scenario.

    The files NAME.py, test_NAME.py and NAME.yaml appear in the current folder; none is replaced.
    """
    from podusv_cli.workflows import new as workflow  # heavy imports only when needed

    code, test, scenario = workflow.new(what, name)
    echo(f"wrote {code}, {test} and {scenario}")
    echo(f"next: podusv {'compare' if what == 'law' else 'run'} {scenario}")
    echo(f"then: python -m pytest {test}, and edit {code}")
