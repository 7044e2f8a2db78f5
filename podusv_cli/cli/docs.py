"""`podusv docs`: the pages that come with podusv, on the terminal."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from podusv_cli.cli import completion
from podusv_cli.cli.terminal import WIDEST, columns, echo, echo_entry, supports_colours

SHOWN = 12  # results of a search


def docs(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PAGE or WORD]...",
            help="A page (studies), or words to look for; without any, all pages are listed.",
            show_default=False,
            autocompletion=completion.pages,
        ),
    ] = None,
) -> None:
    """Show the pages that come with podusv, or find those that have a word.

    In a pipe a page is Markdown.
    """
    from podusv_cli.workflows import docs as workflow

    wanted = " ".join(words or ())
    if not wanted:
        for caption, pages in workflow.contents().items():
            echo(f"{caption}:")
            for name, title in pages.items():
                echo(f"  {name:<22} {title}")
        echo("read one: podusv docs NAME; find a word: podusv docs WORD")
    elif workflow.is_page(wanted):
        _show(wanted)
    else:
        _list(wanted)


def _list(wanted: str) -> None:
    """Print the sections that have the words, `SHOWN` of them at most."""
    from podusv_cli.workflows.docs import search

    hits = search(wanted)
    for section, line in hits[:SHOWN]:
        echo_entry(f"podusv docs {section.page}", line, facts=section.title)
    if len(hits) > SHOWN:
        echo(f"and {len(hits) - SHOWN} more places")


def _show(page: str) -> None:
    """Print a page: rendered on a terminal, as Markdown in a pipe; `page` is its name."""
    from podusv_cli.workflows import docs as workflow

    if not sys.stdout.isatty():
        typer.echo(workflow.page(page), nl=False)
        return
    from rich.console import Console
    from rich.markdown import Markdown

    console = Console(width=min(WIDEST, columns()), no_color=not supports_colours(sys.stdout))
    console.print(Markdown(workflow.readable(page), hyperlinks=False, code_theme="bw"))
