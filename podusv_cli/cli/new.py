"""`podusv new`: a part of one's own to start from."""

from __future__ import annotations

from typing import Annotated

import typer

from podusv_cli.cli.completion import parts
from podusv_cli.cli.terminal import echo


def new(
    what: Annotated[
        str,
        typer.Argument(
            metavar="WHAT",
            help="law, path, disturbance, measurement, estimator, metric, figure, vessel or paper.",
            autocompletion=parts,
        ),
    ],
    name: Annotated[str, typer.Argument(help="What it is called, like my_law.")],
) -> None:
    """Write a small working law, path, metric, ... of your own, with its test and a scenario.

    The files NAME.py, test_NAME.py and NAME.yaml appear in the current folder, for a vessel
    NAME.yaml and NAME_line.yaml, for a paper a folder NAME; none is replaced.
    """
    from podusv_cli.workflows import new as workflow  # heavy imports only when needed

    written = workflow.new(what, name)
    *others, last = map(str, written.files)
    echo(f"wrote {', '.join(others)} and {last}")
    for word, command in zip(("next", "then"), written.commands, strict=False):
        echo(f"{word}: {command}")
    if len(written.commands) > 1:
        echo("the test needs pytest: pip install pytest")
    echo(f"edit {written.files[0]}")
