"""Stretches of work that an interrupt (Ctrl-C) must not cut in two."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Interrupts wait until the block is over."""
    hold_interrupts(True)
    try:
        yield
    finally:
        hold_interrupts(False)


def hold_interrupts(held: bool) -> None:
    """Let interrupts wait, or let them through; a forked process inherits which."""
    if hasattr(signal, "pthread_sigmask"):  # not on every system
        how = signal.SIG_BLOCK if held else signal.SIG_UNBLOCK
        signal.pthread_sigmask(how, {signal.SIGINT})
