"""The march in a thread of its own, watched by the thread that started it.

Compiled code sees no signal, and a law may never return. The watching thread reports progress, sets
the march's stop flag on an interrupt, and abandons a march that hangs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from contextvars import copy_context
from functools import partial
from queue import Empty, SimpleQueue
from threading import Thread, get_ident
from typing import Literal, NamedTuple

import numpy as np

from podusv_cli.core.errors import in_a_line
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.step.layout import STOP
from podusv_cli.process.interrupts import interrupts_enabled

Bell = SimpleQueue[None]  # rung by every thread that ends; a batch waits for it
GLANCE = 0.05  # s between two looks at a march
PATIENCE = 10.0  # s of processor time that a step may take
LAST_CHANCE = 1.0  # s for a march to end after its stop flag is set


MarchStatus = Literal["finished", "diverged", "crashed", "hung", "interrupted"]


class Ending(NamedTuple):
    """How many instants are good, how the march ended, and the error that ended it, if any."""

    reached: int
    status: MarchStatus
    cause: str = ""


class Work:
    """A function that runs in a thread of its own; `result` or `error` is set when it is over.

    `under_way` is the vector of that name in `Vectors`. The thread rings `bell` when it ends.
    """

    def __init__(
        self, function: Callable[[], int], under_way: Vector | None = None, bell: Bell | None = None
    ) -> None:
        """`function` returns the instant that it reached; nothing runs before `start`.

        Without `under_way` progress is unknown, without `bell` it has one of its own.
        """
        self.started = self.over = False
        self.result: int | None = None
        self.error: BaseException | None = None
        self._function, self._bell = function, bell or SimpleQueue()
        self._under_way = np.zeros(1 + STOP) if under_way is None else under_way
        self._clock: Callable[[], float] = lambda: 0.0  # the thread's processor time
        self._last_change = (-1.0, 0.0)  # the instant under way, and the time when it was new

    def start(self) -> None:
        """Start a thread, which ignores the floating-point errors that this one ignores."""
        self.started = True
        # Python waits for any thread but a daemon before it ends, and a march may hang
        Thread(target=copy_context().run, args=(self._run,), daemon=True).start()

    def wait(self, seconds: float = GLANCE) -> None:
        """Wait until the bell rings, but not longer than this."""
        with suppress(Empty):
            # In the main thread a wait without an end would not see Ctrl-C
            self._bell.get(timeout=seconds)

    def hangs(self) -> bool:
        """Whether it has computed for `PATIENCE` at one instant. To be called again and again.

        By the thread's own processor time: a busy machine makes nothing hang.
        """
        instant, used = float(self._under_way[0]), 0.0
        with suppress(OSError):  # the thread has ended
            used = self._clock()
        if instant != self._last_change[0]:
            self._last_change = (instant, used)
        return not self.over and used - self._last_change[1] > PATIENCE

    def finish(self, progress: Callable[[int], None] | None = None) -> None:
        """Start, and wait until it is over or hangs; `progress` hears of the end, however near."""
        self.start()
        ended = False
        while not ended:
            self.wait()
            ended = self.over or self.hangs()
            if progress:
                progress(self.good_instant_count)

    def stop(self) -> None:
        """Tell the march to stop at the next instant."""
        self._under_way[STOP] = 1.0

    def stop_and_count(self) -> int:
        """Stop the march, wait a moment until it has, and return how many instants are good."""
        self.stop()
        end = time.monotonic() + LAST_CHANCE
        while self.started and not self.over and time.monotonic() < end:
            self.wait()
        return self.good_instant_count

    @property
    def good_instant_count(self) -> int:
        """The number of good instants: all before the one that is under way."""
        return int(self._under_way[0]) if self.result is None else self.result

    def ending(self, last: int) -> Ending:
        """How a march up to the instant `last` ended; one that hangs is abandoned."""
        if self.result is None:
            self.stop()  # should the law return one day
            return Ending(
                self.good_instant_count, "crashed" if self.error else "hung", self.fault()
            )
        return Ending(self.result, "finished" if self.result == last else "diverged")

    def end_interrupted(self, last: int) -> Ending:
        """How a march ended that an interrupt is to stop: by itself where it is over already."""
        return self.ending(last) if self.over else Ending(self.stop_and_count(), "interrupted")

    def fault(self) -> str:
        """What is wrong with a function that has no result."""
        if not self.error:
            return f"it is not over after {PATIENCE:g} s of computing"
        return in_a_line(self.error)

    def _run(self) -> None:
        """Call the function in its thread; its result or error stays with the work."""
        # Looked up by the thread itself, since the system crashes if the thread has ended.
        look_up = getattr(time, "pthread_getcpuclockid", None)
        read = getattr(time, "clock_gettime", None)  # macOS has this one alone, Windows neither
        self._clock = partial(read, look_up(get_ident())) if look_up and read else time.process_time
        try:
            self.result = self._function()
        except BaseException as error:  # a law may raise anything
            self.error = error
        # Before the bell rings: whoever it wakes looks at this
        self.over = True
        self._bell.put(None)


def march(
    advance: Callable[[], int],
    last: int,
    under_way: Vector,
    progress: Callable[[int], None] | None = None,
) -> Ending:
    """March up to the instant `last`, excluded. To be called while interrupts are held.

    `under_way` (2 or more,) has the instant that was reached, and the flag that stops the march;
    `progress` hears the instant.
    """
    work = Work(advance, under_way)
    try:
        with interrupts_enabled():
            work.finish(progress)
        return work.ending(last)
    except KeyboardInterrupt:
        return work.end_interrupted(last)
    except BaseException:  # of `progress`; nobody will use what the march goes on to compute
        work.stop()
        raise


def march_together(works: Sequence[Work], lasts: Sequence[int]) -> list[Ending]:
    """March with several at once, each up to its instant in `lasts`, excluded.

    To be called while interrupts are held; one ends all marches.
    """
    try:
        with interrupts_enabled():
            for work in works:
                work.start()
            for work in works:
                while not (work.over or work.hangs()):
                    work.wait()
        return [work.ending(last) for work, last in zip(works, lasts, strict=True)]
    except KeyboardInterrupt:
        over = [work.over for work in works]  # before the others are told to stop
        for work in works:
            work.stop()
        return [
            work.ending(last) if was_over else Ending(work.stop_and_count(), "interrupted")
            for work, last, was_over in zip(works, lasts, over, strict=True)
        ]
