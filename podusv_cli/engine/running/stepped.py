"""A march by steps: it stops where it is asked to, and goes on from there with the same bits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.components.paths.base import TARGET
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.engine.loop.closed_loop import STATE
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.running.simulate import Marcher, recorded
from podusv_cli.engine.running.watch import Ending

# The vectors that a march writes to, beside the log.
CHANGING = ("s", "row", "stages", "sensed", "delay_line", "held", "work", "seen", "under_way")


class Mark(NamedTuple):
    """Where a march is: its next instant, the vectors that change, and the log so far."""

    reached: int
    vectors: tuple[Vector, ...]
    log: Vector


class Unchanged:
    """A context after which vectors have the numbers that they had before it."""

    def __init__(self, vectors: Sequence[Vector]) -> None:
        """These vectors, which stay where they are."""
        self._kept = [(vector, vector.copy()) for vector in vectors]

    def __enter__(self) -> None:
        """Remember the numbers."""
        for vector, numbers in self._kept:
            numbers[:] = vector

    def __exit__(self, *failure: object) -> None:
        """Put them back."""
        for vector, numbers in self._kept:
            vector[:] = numbers


class SteppedMarch:
    """The march of a plan, some instants at a time."""

    def __init__(self, plan: Plan, march: Marcher, *, compiled: bool = True) -> None:
        """Nothing is marched yet; `march` is that of a loop like this. Raises as `simulate`."""
        plan.loop.check_fit(plan.grid.step)
        self.plan, self.grid, self.reached = plan, plan.grid, 0
        self._layout = plan.layout
        self.vectors = plan.vectors(self.grid.rows)
        self._given = self.vectors.s[self._layout.estimate :]
        self._target = np.zeros(len(TARGET))
        self._unchanged = Unchanged([getattr(self.vectors, name) for name in CHANGING])
        self._advance = march(self.vectors, self._layout, self.grid.step)
        self._aim = self._path(plan.functions[0], compiled)

    def to(self, instant: int) -> bool:
        """March over the instants before this one; whether all their numbers are finite."""
        self.reached = self._advance(self.reached, instant)
        return self.reached == instant

    def seen(self) -> Vector:
        """What the probe gathers of the run that ends at the next instant, as it is steered now."""
        if not 0 < self.reached <= self.grid.steps:
            return self.vectors.seen.copy()
        with self._unchanged:
            self._advance(self.reached, self.reached + 1, self.reached)
            return self.vectors.seen.copy()

    @property
    def time(self) -> float:
        """The time of the next instant [s], or of the last."""
        return min(self.reached, self.grid.steps) * self.grid.step

    def state(self) -> Vector:
        """(x, y, psi, u, v, r) at the next instant as a law is given it: true, or estimated.

        An estimate has not yet seen what is measured at this instant.
        """
        return self._given[: len(STATE)].copy()

    def target(self) -> Vector:
        """The target at the next instant, as `TARGET`."""
        self._aim(self.time)
        return self._target.copy()

    def _path(self, part: tuple[Any, ...], compiled: bool) -> Callable[[float], None]:
        """What writes the target at a time [s], as the loop calls it."""
        c, place = self.vectors, self.vectors.s[self._layout.place :]
        shown = np.zeros(len(TARGET))
        vectors = (self._given, place, c.path, c.path_table, self._target, shown)
        if not compiled:
            path = signatures.bind(*part)
            return lambda t: path(t, *vectors)
        from podusv_cli.engine.machine import compile  # a loop in plain Python needs no compiler

        path, pointers = compile.entry(*part), [signatures.pointer(v) for v in vectors]
        return lambda t: path(t, *pointers)

    def mark(self) -> Mark:
        """Where the march is, to come back to it."""
        rows = -(-self.reached // self.grid.log_every)
        log = self.vectors.log[: rows * self._layout.width].copy()
        vectors = tuple(getattr(self.vectors, name).copy() for name in CHANGING)
        return Mark(self.reached, vectors, log)

    def back(self, mark: Mark) -> None:
        """Go on from a mark of this march."""
        self.reached = mark.reached
        self.vectors.log[: len(mark.log)] = mark.log
        for name, vector in zip(CHANGING, mark.vectors, strict=True):
            getattr(self.vectors, name)[:] = vector

    def recording(self) -> Recording:
        """What is logged so far, as of a run that was stopped here."""
        whole = self.reached > self.grid.steps
        ending = Ending(self.reached, "finished" if whole else "interrupted")
        return recorded(self.plan, self.vectors, ending)
