"""Progress on the terminal: bars of runs, shown after a short delay, and one line of a study."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Protocol

import typer

from podusv_cli.cli.terminal import columns, echo, supports_colours
from podusv_cli.core.escaping import visible
from podusv_cli.core.quantities import time_in_words

if TYPE_CHECKING:
    from rich.progress import Progress

    from podusv_cli.studies.making.dispatch import StudyTally

PATIENCE = 0.7  # s before a bar appears
SILENT = 1.0  # s of compiling before a line is printed where no bar can be
PERIOD = 0.2  # s between two numbers of a study's line
ERASED = "\r\x1b[K"


class Bars(Protocol):
    """Bars by name."""

    def __call__(self, name: str, fraction: float, patience: float = PATIENCE) -> None:
        """Draw a bar, but not before the command has run for `patience` [s]."""


@contextmanager
def progress_bars(*, wanted: bool) -> Iterator[Bars | None]:
    """A function to call with a run's name and the fraction done; it draws a bar a run on stderr.

    None where none is `wanted`, or stderr is no terminal with colours. If the terminal is lost, the
    bars stop.
    """
    if not (wanted and supports_colours(sys.stderr)):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    began = time.monotonic()
    # No thread refreshes the bars, since threads do not survive the forks of a comparison.
    bars = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
        console=Console(stderr=True),
        transient=True,
        auto_refresh=False,
    )
    tasks: dict[str, TaskID] = {}
    with ExitStack() as stack:

        def draw(name: str, fraction: float, patience: float) -> None:
            """Move the bar `name` to `fraction`; no bar is drawn before `patience` [s] are over."""
            if not bars.live.is_started and time.monotonic() - began > patience:
                stack.callback(_stop, bars)
                bars.start()
            if bars.live.is_started:
                if name not in tasks:
                    tasks[name] = bars.add_task(visible(name), total=1.0)
                bars.update(tasks[name], completed=fraction)
                bars.refresh()

        def advance(name: str, fraction: float, patience: float = PATIENCE) -> None:
            # A terminal that is lost costs the bar only.
            with suppress(OSError):
                draw(name, fraction, patience)

        yield advance


def _stop(bars: Progress) -> None:
    with suppress(OSError):
        bars.stop()


def compiling(bars: Bars | None, *, wanted: bool = False) -> Callable[[float], None] | None:
    """A function that shows how much of the code is compiled, once for all runs to come.

    A bar at once, where there are `bars`. In a pipe, where it is `wanted`, a line on stderr after a
    while.
    """
    if bars:
        return partial(bars, "compiling, once", patience=0.0)
    return _say_once_after(SILENT, "compiling, once") if wanted else None


def _say_once_after(seconds: float, text: str) -> Callable[[float], None]:
    """A function to call with the fraction done, from 0 to 1.

    It prints `text` once if the work is not done `seconds` after the first call.
    """
    begins: list[float] = []

    def tell(fraction: float) -> None:
        """Note that `fraction` of the work is done; print `text` once if it takes long."""
        begins.append(time.monotonic())
        if fraction < 1.0 and begins[-1] - begins[0] > seconds:
            begins[:] = [math.inf]  # so that `text` is not printed again
            echo(text, err=True)

    return tell


class StudyLine:
    """A line on stderr that shows how far a study is; nothing where stderr is no terminal."""

    def __init__(self, *, wanted: bool) -> None:
        """Nothing is shown yet."""
        self._wanted, self._last = wanted and supports_colours(sys.stderr), 0.0

    def tell(self, tally: StudyTally) -> None:
        """Show runs done, rate, time left and failures so far."""
        if time.monotonic() - self._last > PERIOD:
            self._show(
                f"{tally.made} of {tally.wanted} runs",
                *_left(tally),
                f"{tally.failed} did not finish",
                f"{tally.rate:.3g} a second",
                "Ctrl-C keeps what is done",
            )

    def advance(self, tally: StudyTally, text: str) -> None:
        """Show runs done, time left, and what is said of them."""
        if time.monotonic() - self._last > PERIOD:
            self._show(f"{tally.made} of {tally.wanted} runs", *_left(tally), text)

    def note(self, *lines: str) -> None:
        """Print lines that stay, in place of what is being done now."""
        self._erase()
        echo(*lines, err=True)

    def warn(self, text: str) -> None:
        """Print a warning that stays."""
        self.note(f"warning: {text}")

    def say(self, text: str) -> None:
        """Show what is being done now."""
        self._show(text)

    def _show(self, *parts: str) -> None:
        """Show as many of the parts, from the first on, as the terminal has room for."""
        line = parts[0]
        for part in parts[1:]:
            line = f"{line}, {part}" if len(line) + len(part) + 3 < columns() else line
        self._last = time.monotonic()
        if self._wanted:
            with suppress(OSError):  # the terminal is lost, the study is not
                typer.echo(f"{ERASED}{visible(line)}", nl=False, err=True)

    def __enter__(self) -> StudyLine:
        """The line itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Erase the line."""
        self._erase()

    def _erase(self) -> None:
        """Remove the line, if there is one; a closed pipe is no error here."""
        if self._wanted and self._last:
            with suppress(OSError):
                typer.echo(ERASED, nl=False, err=True)


def _left(tally: StudyTally) -> list[str]:
    """The time that is left, where that can be said."""
    known = tally.made < tally.wanted and math.isfinite(tally.left)
    return [f"{time_in_words(tally.left)} left"] if known else []
