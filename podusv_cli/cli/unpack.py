"""`podusv unpack`: what an archive has, and its folder."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from podusv_cli.cli.options import AsJson
from podusv_cli.cli.pack import show
from podusv_cli.cli.terminal import echo, echo_json


def unpack(
    archive: Annotated[Path, typer.Argument(help="What `podusv pack` wrote.")],
    out: Annotated[
        Path | None, typer.Option(help="The folder.", show_default="as it was called, here")
    ] = None,
    look: Annotated[
        bool, typer.Option("--list", help="Show what it has, and write nothing.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Show what an archive has, code above all, then write its folder; execute nothing.

    An archive with links, with names that lead elsewhere, or that would become far too large is
    refused whole. Files that exist are not replaced.
    """
    from podusv_cli.cli.progress import progress_bars
    from podusv_cli.workflows import pack as workflow  # heavy imports only when needed

    with workflow.open_packed(archive) as packed:
        contents = packed.contents
        target = None if look else out or Path(contents.name)
        if not as_json:
            show(contents)
            sys.stdout.flush()  # before anything is written
        if target:
            with progress_bars(wanted=not as_json) as bars:
                packed.unpack(target, *([partial(bars, f"writing {target}")] if bars else ()))
    if as_json:
        echo_json({**contents.as_json(), "folder": target and str(target)})
    elif target:
        echo(f"wrote {target}")
        if command := contents.repeat(target):
            first = "read the code, then: " if contents.code else "next: "
            echo(first + command)
