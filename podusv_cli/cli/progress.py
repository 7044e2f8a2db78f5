"""Progress bars on the terminal, shown after a short delay."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING

from podusv_cli.cli.terminal import supports_colours
from podusv_cli.core.escaping import visible

if TYPE_CHECKING:
    from rich.progress import Progress

PATIENCE = 0.7  # s before a bar appears


@contextmanager
def progress_bars(*, wanted: bool) -> Iterator[Callable[[str, float], None] | None]:
    """A function to call with a run's name and the fraction done; a bar a run, on stderr.

    None if stderr is no terminal with colours. If the terminal is lost, the bars stop.
    """
    if not (wanted and supports_colours(sys.stderr)):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    began = time.monotonic()
    # No thread refreshes the bars, since threads do not survive the forks of a comparison.
    bars = Progress(
        TextColumn("{task.description}", markup=False), BarColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
        console=Console(stderr=True), transient=True, auto_refresh=False,
    )  # fmt: skip
    tasks: dict[str, TaskID] = {}
    with ExitStack() as stack:

        def draw(name: str, fraction: float) -> None:
            if not bars.live.is_started and time.monotonic() - began > PATIENCE:
                stack.callback(_stop, bars)
                bars.start()
            if bars.live.is_started:
                if name not in tasks:
                    tasks[name] = bars.add_task(visible(name), total=1.0)
                bars.update(tasks[name], completed=fraction)
                bars.refresh()

        def advance(name: str, fraction: float) -> None:
            with suppress(OSError):
                draw(name, fraction)

        yield advance


def _stop(bars: Progress) -> None:
    with suppress(OSError):
        bars.stop()
