"""Ctrl-C and other signals to end as KeyboardInterrupt, deferred while results are written."""

from __future__ import annotations

import atexit
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from types import FrameType

from podusv_cli.core.system import SIGNALS

# s; signals within this time of the first one count as the same interrupt: a terminal signals a
# command and its workers, the command signals its workers again, and people press twice.
SAME_INTERRUPT = 3.0
SIGNALLED = 128  # and the signal's number: 129 for SIGHUP, 130 for SIGINT, 143 for SIGTERM
STDERR = 2
ENDED = b"podusv: interrupted again; unfinished results are lost\n"


class Interrupts:
    """A signal handler that raises KeyboardInterrupt, at once or when `deferred` ends.

    A second interrupt ends the process at once. `number` is the first signal, 0 before it. With
    `ending` the process is about to exit, and further signals are ignored.
    """

    def __init__(self) -> None:
        """No signal yet."""
        self.number = 0
        self.deferred = False
        self.ending = False
        self._waiting = False
        # Long ago: the clock may start at 0, and the very first signal must count.
        self._last = -SAME_INTERRUPT

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal `number`: raise KeyboardInterrupt, now or later, or end the process."""
        # A signal soon after the last belongs to the same interrupt
        if self.ending or time.monotonic() - self._last < SAME_INTERRUPT:
            return
        if self.number:
            _end_process(self.number)
        self._last, self.number = time.monotonic(), number
        self._waiting = True
        self.deliver()

    def deliver(self) -> None:
        """Raise KeyboardInterrupt if a signal waits and is not deferred."""
        if self._waiting and not self.deferred:
            self._waiting = False
            raise KeyboardInterrupt


def _end_process(number: int) -> None:
    """End this process and its workers at once; the next run deletes their unfinished folders."""
    import multiprocessing  # which not every command needs

    # Not `print`: the signal may have come within one, which cannot be entered twice.
    with suppress(OSError):
        os.write(STDERR, ENDED)
    # `os._exit` runs no cleanup, so nobody else would end them.
    for worker in multiprocessing.active_children():
        worker.kill()
    os._exit(SIGNALLED + number)


@contextmanager
def interrupts_caught() -> Iterator[Interrupts]:
    """Signals go to the `Interrupts` already installed, or else to a new one for this block.

    Nested blocks share one, so that a second interrupt is known as such. At the end the handlers of
    before are back, unless the process is about to exit.
    """
    handlers = (signal.getsignal(number) for number in SIGNALS)
    caught = (handler for handler in handlers if isinstance(handler, Interrupts))
    there = next((handler for handler in caught if not handler.ending), None)
    here = there or Interrupts()
    before = {} if there else _install(here)
    try:
        yield here
    finally:
        if before and here.ending:
            atexit.register(_ignore)
        for number, handler in before.items():
            signal.signal(number, here if here.ending else handler)


def _ignore() -> None:
    """Ignore signals during shutdown, when Python restores handlers that end the process."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _install(here: Interrupts) -> dict[signal.Signals, signal.Handlers]:
    """Install the handler and return the previous ones; in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in SIGNALS}
    wanted = {n: old for n, old in before.items() if old is not signal.SIG_IGN}  # as under nohup
    for number in wanted:
        signal.signal(number, here)
    return wanted  # type: ignore[return-value]  # any callable that was a handler


def interrupts_deferred() -> AbstractContextManager[None]:
    """Interrupts wait for the end of the block, or for `interrupts_enabled` inside it."""
    return _deferring(True)


def interrupts_enabled() -> AbstractContextManager[None]:
    """Interrupts, also waiting ones, raise KeyboardInterrupt in the block."""
    return _deferring(False)


@contextmanager
def _deferring(deferred: bool) -> Iterator[None]:
    """Defer interrupts, or not, inside the block; one that waits is raised at its ends.

    The state of before comes back, so blocks can be nested.
    """
    with interrupts_caught() as here:
        before, here.deferred = here.deferred, deferred
        try:
            here.deliver()
            yield
        finally:
            here.deferred = before
            here.deliver()
