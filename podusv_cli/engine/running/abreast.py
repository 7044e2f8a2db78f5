"""Runs side by side that stop where they are asked to, and go on from there with the same bits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any

import numpy as np
import numpy.typing as npt

from podusv_cli.components.paths.base import TARGET
from podusv_cli.core.kernel import LANES, Vector
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.running.batch_threads import BatchRun
from podusv_cli.engine.running.lanes import MARCHING, Lanes, room, shared_constants
from podusv_cli.engine.running.simulate import March
from podusv_cli.engine.running.stepped import CHANGING, Unchanged
from podusv_cli.engine.step.lane_march import REACHED
from podusv_cli.engine.step.layout import SIGNATURES, Vectors

NOTHING: frozenset[str] = frozenset()


def in_lanes(
    part: str, kernel: Any, names: tuple[str, ...], shared: Set[str], vectors: Mapping[str, Vector]
) -> Callable[[float], None]:
    """A kernel, called as this part of the loop, for all lanes at a time [s].

    `vectors` are its arguments by name, a number of every lane one by the other; those that are
    left out it may not read.
    """
    from podusv_cli.engine.machine import compile  # only what marches side by side needs it

    routine = compile.routine(compile.lane_adapter(part, kernel, names, frozenset(shared)))
    given = [vectors.get(name, room(LANES)) for name in SIGNATURES[part][1:]]
    pointers = [vector.ctypes.data_as(signatures.LANE_VECTOR) for vector in given]
    return lambda t: routine(t, *pointers)


class Abreast:
    """The march of at most `LANES` runs, some instants at a time; no log is kept.

    What is written into `law_table` acts from the next instant on. `look(x, target, signals)` is a
    kernel that writes `size` numbers about the state, as a law is given it, and the target. Arrays
    have a column a run. `alive` says which runs have finite numbers so far.
    """

    def __init__(
        self, plan: Plan, runs: Sequence[BatchRun], advance: Callable[[Lanes, float], March],
        look: Any, size: int,
    ) -> None:  # fmt: skip
        """Nothing is marched yet; the plan is that of runs like these."""
        layout, grid = plan.layout, plan.grid
        self.places = [run.position for run in runs]
        self.grid, self.reached, self.alive = grid, 0, np.ones(len(runs), bool)
        self._lanes = Lanes.of([run.vectors for run in runs], layout)
        self._march = advance(self._lanes, grid.step)
        c, target = Vectors(*self._lanes.vectors), room(len(TARGET) * LANES)
        view = room(size * LANES)
        given = c.s[layout.estimate * LANES :]
        _, path, names = plan.functions[0]
        shared = shared_constants(plan)["path"]
        vectors = {"x": given, "place": c.s[layout.place * LANES :], "k": c.path,
                   "table": c.path_table, "target": target}  # fmt: skip
        self._aim = in_lanes("path", path, names, shared, vectors)
        self._look = in_lanes("law", look, (), NOTHING, vectors | {"signals": view})
        self.law_table, self._seen, self._view = map(self._by_run, (c.law_table, c.seen, view))
        changing = [getattr(c, name) for name in CHANGING]
        self._unchanged = Unchanged([*changing, self._lanes.under_way])

    def _by_run(self, vector: Vector) -> Vector:
        return vector.reshape(-1, LANES)[:, : len(self.places)]

    def advance(self, count: int) -> None:
        """March over so many instants, or to the end; over the last with the step before it."""
        last = min(self.reached + count, self.grid.steps)
        self.reached = self._march(self.reached, last + (last == self.grid.steps))
        self.alive = self._marching()

    def _marching(self) -> npt.NDArray[np.bool_]:
        return np.equal(self._lanes.under_way[REACHED : REACHED + len(self.places)], MARCHING)

    @property
    def over(self) -> bool:
        """Whether the last instant is reached, or a run has numbers that are not finite."""
        return self.reached > self.grid.steps or not self.alive.all()

    @property
    def time(self) -> float:
        """The time of the next instant [s], or of the last."""
        return min(self.reached, self.grid.steps) * self.grid.step

    def view(self) -> Vector:
        """What `look` writes at the next instant; a run that has ended repeats another one."""
        self._aim(self.time)
        self._look(self.time)
        return self._view

    def seen(self) -> Vector:
        """What the probes gather of runs that end at the next instant, or have ended before."""
        with self._unchanged:
            if self.reached <= self.grid.steps:
                self._march(self.reached, self.reached + 1, self.reached)
            if self._marching().all():
                return self._seen.copy()
            self._lanes.endings(self.reached, self.grid.steps + 1)
            return np.array([run.seen for run in self._lanes.runs]).T
