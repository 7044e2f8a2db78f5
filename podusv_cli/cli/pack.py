"""`podusv pack`: a finished folder as one archive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli.diff import changes_in_words
from podusv_cli.cli.options import AsJson, Force
from podusv_cli.cli.terminal import echo, echo_entry, echo_json

if TYPE_CHECKING:
    from podusv_cli.workflows.pack import PackedContents

SHOWN = 5  # names of files in a line


def pack(
    folder: Annotated[
        Path, typer.Argument(help="A run, comparison or study, or what another command left.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="The archive.", show_default="FOLDER.zip, here")
    ] = None,
    logs: Annotated[
        bool, typer.Option("--logs/--no-logs", help="With log.h5, which rerun makes anew.")
    ] = True,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Pack a finished folder into one archive, from which it can be made once more elsewhere.

    It has scenario, plug-in files and versions as the folder has them; `podusv unpack` shows them
    first. The same folder gives the same bytes.
    """
    from podusv_cli.workflows import pack as workflow  # heavy imports only when needed

    target = out or Path(f"{folder.resolve().name}.zip")
    done = workflow.pack(folder, target, logs=logs, force=force)
    if as_json:
        echo_json({**done.contents.as_json(), "archive": str(target), "bytes": done.size})
        return
    show(done.contents)
    if done.left_out:
        echo(f"left out, as they are not of the result: {_few(done.left_out)}")
    echo(f"wrote {target}, {in_words(done.size)}", f"elsewhere: podusv unpack {target.name}")


def in_words(size: float) -> str:
    """A size [bytes] such as `3.2 MB`."""
    from podusv_cli.core.quantities import bytes_in_words

    return bytes_in_words(size)


def show(contents: PackedContents) -> None:
    """Print what a packed folder has, and which versions differ here.

    That is kind, code, pages and packages.
    """
    sizes = contents.sizes
    count = f"{len(sizes)} files, {in_words(sum(sizes.values()))}"
    facts = f"{contents.kind}, {contents.status}: {count}"
    lines = {
        "code, which unpacking does not execute: ": _few(contents.code),
        "pages, whose scripts a browser executes: ": _few(contents.pages),
        "not packed, to be made anew: ": _few(contents.lacking),
        "": "; ".join(f"needs {name}: {found}" for name, found in contents.packages.items()),
        "versions, there -> here: ": changes_in_words(contents.differs),
    }
    echo_entry(contents.name, *(what + text for what, text in lines.items() if text), facts=facts)


def _few(names: tuple[str, ...]) -> str:
    """The first `SHOWN` names, and how many more there are."""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
