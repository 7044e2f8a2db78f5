"""Printing: lines and tables wrapped to the terminal's width, and whole in a pipe."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO

import typer

from podusv_cli.core.escaping import visible

if TYPE_CHECKING:
    from podusv_cli.core.finding import Finding
    from podusv_cli.process.extras import Failure

WIDEST = 100  # letters; longer lines of prose are hard to read
SPACE = "  "  # between the columns of a table


def echo(*lines: object, err: bool = False) -> None:
    """Print lines, on stderr with `err`; wrapped on a terminal, whole in a pipe.

    Control characters are escaped, as a terminal would obey them.
    """
    shown = [visible(line) for line in lines]
    if (sys.stderr if err else sys.stdout).isatty():
        shown = [fold_line(line, _width()) for line in shown]
    typer.echo("\n".join(shown), err=err)


def echo_path(path: Path) -> None:
    """A path alone, for scripts; byte for byte in a pipe, as `ls` does it."""
    shown = visible(path).encode() if sys.stdout.isatty() else os.fsencode(path)
    typer.echo(shown + b"\n", nl=False)


def echo_json(content: Mapping[str, Any]) -> None:
    """One JSON object."""
    from podusv_cli.core.json_text import encode

    typer.echo(encode(content), nl=False)


def echo_result(done: Any, report: Callable[[], None], *, as_json: bool, quiet: bool) -> None:
    """Print what a command is asked for: its result as JSON, its folder's path, or a report.

    `done` is the result, with `as_json` and `folder`; `report` prints the report.
    """
    if as_json:
        echo_json(done.as_json())
    elif quiet:
        echo_path(done.folder)
    else:
        report()


class Done(Protocol):
    """What every command that makes something gives back."""

    @property
    def folder(self) -> Path:
        """Where it is."""

    @property
    def missing(self) -> Sequence[Failure]:
        """Parts that could not be made, and why."""

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints."""


def show(done: Done, report: Callable[[], None], *, as_json: bool, quiet: bool) -> None:
    """Print what was made as it was asked for, and on stderr what of it is missing.

    `report` prints it for people.
    """
    echo_result(done, report, as_json=as_json, quiet=quiet)
    for part in done.missing:
        echo(part.sentence_with_trace, err=True)


def echo_entry(name: str, *lines: str, facts: str = "") -> None:
    """An entry: its name (bold on a terminal) and facts, then lines below, indented and wrapped."""
    width = _width()
    name, facts, lines = visible(name), visible(facts), tuple(map(visible, lines))

    def wrap_indented(text: str, indent: str) -> str:
        """A paragraph within the terminal's width; its first line begins with `indent`."""
        return textwrap.fill(
            text, width, initial_indent=indent, subsequent_indent="    ", break_on_hyphens=False
        )

    head = wrap_indented(f"{name}  {facts}".rstrip(), "")
    # Made bold after it is wrapped: the codes for it would count as letters.
    typer.echo(
        head.replace(name, typer.style(name, bold=True), 1)
        if supports_colours(sys.stdout)
        else head
    )
    for line in filter(None, lines):
        typer.echo(wrap_indented(line, "    "))


def supports_colours(stream: TextIO) -> bool:
    """Whether a stream is a terminal with colours; NO_COLOR and TERM=dumb switch them off."""
    wanted = os.environ.get("TERM", "") not in ("", "dumb") and not os.environ.get("NO_COLOR")
    return wanted and stream.isatty()


def echo_table(head: list[str], rows: list[list[str]]) -> None:
    """Print a table in columns, whole in a pipe.

    Where the terminal is too narrow for it, it is cut into tables below each other, each with the
    first two columns. Where it is too narrow even for one further column, each row becomes a block.
    """
    head, rows = [*map(visible, head)], [[*map(visible, row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    room = columns() if sys.stdout.isatty() else sys.maxsize
    if sum(widths[:2]) + max(widths[2:], default=0) + 2 * len(SPACE) > room:
        for row in rows:
            cells = [f"{title} {cell}" for title, cell in zip(head[2:], row[2:], strict=True)]
            echo_entry(row[0], ", ".join(cells), facts=f"[{row[1]}]")
        return
    for place, part in enumerate(_parts(widths, room)):
        if place:
            typer.echo("")
        for row in (head, *rows):
            typer.echo(SPACE.join(row[i].ljust(widths[i]) for i in part).rstrip())


def _parts(widths: list[int], room: int) -> Iterator[list[int]]:
    """The numbers of the columns in each partial table: the first two, and as many as fit.

    `widths` are those of the columns, `room` that of the terminal [letters].
    """
    part = [0, 1]
    for i in range(2, len(widths)):
        if sum(widths[j] for j in (*part, i)) + len(SPACE) * len(part) > room:
            yield part
            part = [0, 1]
        part.append(i)
    yield part


def fold_line(text: str, width: int) -> str:
    """A line wrapped at spaces to `width` letters, the rest of it indented by two.

    Paths are not broken.
    """
    return textwrap.fill(
        text, width, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False
    )


def columns() -> int:
    """How wide the terminal is."""
    return shutil.get_terminal_size().columns


def _width() -> int:
    return max(20, min(WIDEST, columns()))


def warn_of_differences(differences: Mapping[str, Mapping[str, Any]]) -> None:
    """Print on stderr in which keys, besides the controller, compared runs differ.

    `differences` has the value of each run, by label, for each key.
    """
    from podusv_cli.comparison.differences import as_text

    if differences:
        echo("warning: the runs differ in more than the controller:", err=True)
    for key, values in as_text(differences).items():
        shown = ", ".join(f"{label} {value}" for label, value in values.items())
        echo(f"  {key}: {shown}", err=True)


def echo_how_to_draw(folder: Path, runs: Sequence[Path]) -> None:
    """Say on stderr how to draw all figures of runs, if the folder has some."""
    if (folder / "figures").is_dir():
        command = shlex.join(["podusv", "plot", *map(str, runs)])
        echo(f"to draw every figure: {command}", err=True)


class Warnings:
    """Prints warnings on stderr, each once; none with `quiet`."""

    def __init__(self, quiet: bool = False) -> None:
        """No warning printed yet."""
        self._quiet = quiet
        self._shown: set[str] = set()

    def __call__(self, finding: object) -> None:
        """Print a warning unless it was printed before."""
        line = str(finding)
        if line not in self._shown and not self._quiet:
            echo(line, err=True)
        self._shown.add(line)

    def all_of(self, findings: Sequence[Finding], together: Sequence[str]) -> None:
        """Print findings; those of one kind about one key as one, if runs go `together`."""
        new = [finding for finding in findings if str(finding) not in self._shown]
        for finding in _group_findings(new, together) if together else new:
            self(finding)


def _group_findings(findings: Sequence[Finding], labels: Sequence[str]) -> Iterator[Finding]:
    """One finding of each kind and key, with all its runs and the sentence of the first.

    A finding that is alone of its kind and key, and those about the scenario, are passed on singly.
    `labels` are those of all runs.
    """
    alike: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        alike.setdefault((finding.code, finding.where), []).append(finding)
    for first, *others in alike.values():
        # A finding without runs is about the scenario.
        if not others or not first.runs:
            yield from (first, *others)
            continue
        runs = tuple(dict.fromkeys(run for finding in (first, *others) for run in finding.runs))
        text = f"in {first.runs[0]}, {first.text}; -v shows it for each"
        everywhere = len(runs) == len(labels) > 2  # two names are as short as "all 2 runs"
        yield replace(first, text=text, runs=(f"all {len(runs)} runs",) if everywhere else runs)
