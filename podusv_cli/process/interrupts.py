"""Ctrl-C (SIGINT), SIGTERM and SIGHUP: heard where work can be cut short, held where it cannot."""

from __future__ import annotations

import atexit
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # the last: the terminal is lost
# s; a terminal interrupts a command and its workers, the command its workers again, and people
# press twice: what follows this closely on an interrupt is the same interrupt.
ECHO = 3.0
SIGNALLED = 128  # and the signal's number: 129 for SIGHUP, 130 for SIGINT, 143 for SIGTERM
STDERR = 2
CUT_OFF = b"podusv: interrupted again; what was still being made is lost\n"


class Interrupts:
    """A handler of signals: raises KeyboardInterrupt, at once or when the signals are heard again.

    Whoever interrupts a second time gets the end of the process, whatever it is doing. `number` is
    the signal that came first, 0 as long as there was none. Once `ending` is set the process is
    about to end, and signals, then and during its shutdown, change nothing any more.
    """

    def __init__(self) -> None:
        """Nothing came yet, and nothing is held."""
        self.number = 0
        self.held = False
        self.ending = False
        self._waiting = False
        self._last = -ECHO

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Take in a signal."""
        if self.ending or time.monotonic() - self._last < ECHO:
            return
        if self.number:
            _cut_off(self.number)
        self._last, self.number = time.monotonic(), number
        self._waiting = True
        self.deliver()

    def deliver(self) -> None:
        """Raise KeyboardInterrupt where a signal waits and is not held."""
        if self._waiting and not self.held:
            self._waiting = False
            raise KeyboardInterrupt


def _cut_off(number: int) -> None:
    """End this process and its workers at once; folders in the making are swept by the next run."""
    import multiprocessing  # which not every command needs

    with suppress(OSError):
        os.write(STDERR, CUT_OFF)
    for worker in multiprocessing.active_children():
        worker.kill()
    os._exit(SIGNALLED + number)


@contextmanager
def interrupts_caught() -> Iterator[Interrupts]:
    """These signals go to one `Interrupts`: to the one that is there, or else to a new one."""
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
    """Python puts back the system's handlers, which end the process, after its exit functions."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _install(here: Interrupts) -> dict[signal.Signals, signal.Handlers]:
    """Put the handler in place; what was there. Only a main thread can, only it is interrupted."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in SIGNALS}
    wanted = {n: old for n, old in before.items() if old is not signal.SIG_IGN}  # as under nohup
    for number in wanted:
        signal.signal(number, here)
    return wanted  # type: ignore[return-value]  # any callable that was a handler


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Interrupts wait until the block is over, or for `interrupts_heard` in it."""
    with _holding(True):
        yield


@contextmanager
def interrupts_heard() -> Iterator[None]:
    """Interrupts, also those that wait, raise KeyboardInterrupt in the block."""
    with _holding(False):
        yield


@contextmanager
def _holding(held: bool) -> Iterator[None]:
    with interrupts_caught() as here:
        before, here.held = here.held, held
        try:
            here.deliver()
            yield
        finally:
            here.held = before
            here.deliver()
