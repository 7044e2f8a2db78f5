"""A progress bar on the terminal for what takes long enough to want one."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

PATIENCE = 0.7  # s before a bar appears


@contextmanager
def progress_bar(label: str, *, wanted: bool) -> Iterator[Callable[[float], None] | None]:
    """A function to call with the fraction done; it draws on stderr where that is a terminal."""
    if not (wanted and sys.stderr.isatty()):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    began = time.monotonic()
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(),
        console=Console(stderr=True), transient=True,
    )  # fmt: skip
    with ExitStack() as stack:

        def advance(fraction: float) -> None:
            if not bar.task_ids and time.monotonic() - began > PATIENCE:
                stack.enter_context(bar)
                bar.add_task(label, total=1.0)
            for task in bar.task_ids:
                bar.update(task, completed=fraction)

        yield advance
