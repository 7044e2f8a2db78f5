"""The march in blocks, in a thread of its own, while the caller stays awake.

Machine code hears no signal and a law may never return. So one thread computes and the other waits:
for the block, for an interrupt, or until the block has taken more computing than any block should.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from contextvars import copy_context
from queue import Empty, SimpleQueue
from threading import Thread
from typing import NamedTuple

from podusv_cli.core.errors import in_a_line
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Status
from podusv_cli.engine.closed_loop import Plan
from podusv_cli.engine.row_table import Pieces
from podusv_cli.process.interrupts import interrupts_heard, interrupts_held

FIRST_BLOCK = 1  # steps
LONGEST_BLOCK = 0.05  # s; a progress bar waits no longer
PATIENCE = 10.0  # s of computing, not of the clock on the wall, that a block may take
LOOKS = 0.25  # s between two looks at how much it has taken
LAST_CHANCE = 1.0  # s for a block to end after an interrupt


class Ending(NamedTuple):
    """How many instants are good, how the march ended, and why if it was by an error."""

    reached: int
    status: Status
    cause: str = ""


class Pace:
    """How many steps a block may have, by what the one before took; alike marches can share it."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self.steps = FIRST_BLOCK

    def learn(self, steps: int, seconds: float) -> None:
        """So many steps took so long."""
        growth = min(100.0, 0.7 * LONGEST_BLOCK / max(seconds, 1e-9))
        self.steps = max(1, int(steps * growth))


def in_blocks(
    march: Callable[[int, int], int], plan: Plan, under_way: Vector,
    progress: Callable[[float], None] | None, pieces: Pieces | None = None,
    pace: Pace | None = None,
) -> Ending:  # fmt: skip
    """March until the end or trouble; `under_way` is where the march notes its instant.

    A block that never ends is left behind with its thread; what is before that instant is good.
    A block ends where the table of `pieces` is full, and the next begins when it is handed on.
    """
    end, done, pace = plan.steps + 1, 0, pace or Pace()
    with Aside() as aside:
        try:
            with interrupts_heard():
                while done < end:
                    if pieces and done == pieces.border:
                        with interrupts_held():
                            pieces.hand_on(done)
                    goal = min(done + pace.steps, end, pieces.border if pieces else end)
                    began = time.perf_counter()
                    reached = aside.finish(lambda a=done, b=goal: march(a, b))  # type: ignore[misc]
                    if reached < goal:
                        return Ending(reached, "diverged")
                    pace.learn(goal - done, time.perf_counter() - began)
                    done = goal
                    if progress:
                        progress(done / end)
        except KeyboardInterrupt:
            return Ending(max(done, aside.last_word()), "interrupted")
        except TimeoutError:
            return Ending(int(under_way[0]), "diverged", never_returns())
        except Failed as failed:
            return Ending(int(under_way[0]), "diverged", failed.told())
    return Ending(done, "finished")


def never_returns() -> str:
    """What is told of a block or a law that was left behind."""
    return f"it is not over after {PATIENCE:g} s of computing"


class Failed(Exception):
    """What was done aside raised something, its cause."""

    def told(self) -> str:
        """What was raised, where."""
        return in_a_line(self.__cause__ or self)


class Aside:
    """A thread that works while the one that asks waits, awake for interrupts."""

    def __init__(self) -> None:
        """Start the thread; it ends with the block that this is used in."""
        self._orders: SimpleQueue[Callable[[], int] | None] = SimpleQueue()
        self._answers: SimpleQueue[int | BaseException] = SimpleQueue()
        self._busy = False
        # Its own copy: what numpy is told to ignore here it has to ignore there.
        context = copy_context()
        self._thread = Thread(target=context.run, args=(self._work,), daemon=True)
        self._thread.start()

    def __enter__(self) -> Aside:
        """Nothing more to do."""
        return self

    def __exit__(self, *error: object) -> None:
        """Let the thread end once its work is done."""
        self._orders.put(None)

    def finish(self, work: Callable[[], int]) -> int:
        """The work's result. Raises Failed, or TimeoutError where it takes all too long."""
        self._busy = True
        before = self._computed()
        self._orders.put(work)
        while True:
            with suppress(Empty):
                return self._taken(LOOKS)
            if self._computed() - before > PATIENCE:
                raise TimeoutError

    def last_word(self) -> int:
        """The result of what it is at, or 0 where that does not come."""
        with suppress(Empty, Failed):
            return self._taken(LAST_CHANCE) if self._busy else 0
        return 0

    def _taken(self, patience: float) -> int:
        answer = self._answers.get(timeout=patience)
        self._busy = False
        if isinstance(answer, BaseException):
            raise Failed from answer
        return answer

    def _computed(self) -> float:
        """Processor time of the thread, or, where the system does not tell, of the process."""
        clock = getattr(time, "pthread_getcpuclockid", None)
        return time.clock_gettime(clock(self._thread.ident)) if clock else time.process_time()

    def _work(self) -> None:
        while order := self._orders.get():
            answer: int | BaseException
            try:
                answer = order()
            except BaseException as error:  # whatever a law raises, its thread has to answer
                answer = error
            order = None  # or what was worked on, a log perhaps, would live until this thread ends
            self._answers.put(answer)
