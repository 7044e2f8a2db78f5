"""Plain text in the terminal's width, the same in a pipe."""

from __future__ import annotations

import shutil
import sys
import textwrap

import typer

WIDEST = 100
ENDLESS = 100_000


def echo_entry(name: str, *lines: str, facts: str = "") -> None:
    """An entry: its name (bold on a terminal) and facts, then lines below, indented and wrapped."""
    width = max(20, min(WIDEST, shutil.get_terminal_size().columns))

    def wrapped(text: str, indent: str) -> str:
        return textwrap.fill(
            text, width, initial_indent=indent, subsequent_indent="    ", break_on_hyphens=False
        )

    head = wrapped(f"{name}  {facts}".rstrip(), "")
    typer.echo(head.replace(name, typer.style(name, bold=True), 1))
    for line in filter(None, lines):
        typer.echo(wrapped(line, "    "))


def echo_table(head: list[str], rows: list[list[str]]) -> None:
    """A table: bold head, columns as wide as needed; cells wrap where the terminal is narrow."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in head:
        table.add_column(title, overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    # A pipe has no width: nothing is wrapped there, so that every line is a row.
    Console(width=None if sys.stdout.isatty() else ENDLESS, highlight=False).print(table)
