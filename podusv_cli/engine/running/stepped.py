"""A run, or the runs of a batch, by steps: they stop where they are asked to.

They go on from there with the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.components.paths.base import TARGET
from podusv_cli.core.kernel import LANES, Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import PSI_D, TARGET_SIZE
from podusv_cli.engine.loop.closed_loop import STATE
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.running.batch import BatchRun
from podusv_cli.engine.running.lanes import MARCHING, Lanes, room, shared_constants
from podusv_cli.engine.running.simulate import March, Marcher, recording_of
from podusv_cli.engine.running.thread import Ending
from podusv_cli.engine.step.lane_march import REACHED
from podusv_cli.engine.step.layout import SIGNATURES, Vectors

NOTHING: frozenset[str] = frozenset()
# The vectors that a march writes to, beside the log.
CHANGING = ("s", "row", "stages", "sensed", "delay_line", "held", "work", "seen", "under_way")


class MarchMark(NamedTuple):
    """Where a march is: its next instant, the vectors that change, and the log so far."""

    reached: int
    vectors: tuple[Vector, ...]
    log: Vector


class Unchanged:
    """A context after which vectors have the numbers that they had before it."""

    def __init__(self, vectors: Sequence[Vector]) -> None:
        """These vectors, which stay where they are, are to be put back."""
        self._kept = [(vector, vector.copy()) for vector in vectors]

    def __enter__(self) -> None:
        """Remember the numbers."""
        for vector, numbers in self._kept:
            numbers[:] = vector

    def __exit__(self, *failure: object) -> None:
        """Put the numbers back, whatever was raised."""
        for vector, numbers in self._kept:
            vector[:] = numbers


class SteppedRun:
    """The march of a plan, some instants at a time."""

    def __init__(self, plan: Plan, march: Marcher, *, compiled: bool = True) -> None:
        """Nothing is marched yet; `march` is that of a loop like this. Raises as `simulate`."""
        plan.loop.check_fit(plan.grid.step)
        self.plan, self.grid, self.reached = plan, plan.grid, 0
        self._layout = plan.layout
        self.vectors = plan.vectors(self.grid.rows)
        self._given = self.vectors.s[self._layout.estimate :]
        self._target = np.zeros(TARGET_SIZE)
        self._unchanged = Unchanged([getattr(self.vectors, name) for name in CHANGING])
        self._advance = march(self.vectors, self._layout, self.grid.step)
        self._aim = self._path(plan.functions[0], compiled)

    def to(self, instant: int) -> bool:
        """March over the instants before this one; whether all their numbers are finite."""
        self.reached = self._advance(self.reached, instant)
        return self.reached == instant

    def gathered_so_far(self) -> Vector:
        """What the probe gathers of the run that ends at the next instant, as it is steered now.

        Shape (probe.size,).
        """
        # Nothing has marched yet, or the last instant has had its half weight already
        if not 0 < self.reached <= self.grid.steps:
            return self.vectors.seen.copy()
        # March over one instant as if it were the last, then put all numbers back
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

    def loads(self) -> Vector:
        """(tau_u, tau_v, tau_r) [N, N, N m] that acted at the end of the step before."""
        first = self._layout.tau
        return self.vectors.row[first : first + 3].copy()

    def target(self) -> Vector:
        """The target (6,) at the next instant, as `TARGET`."""
        self._aim(self.time)
        return self._target[: len(TARGET)].copy()

    def heading(self) -> Vector:
        """The heading (3,) that the path asks for at the next instant, with its rates; or zeros."""
        self._aim(self.time)
        return self._target[PSI_D:].copy()

    def _path(self, part: tuple[Any, ...], compiled: bool) -> Callable[[float], None]:
        """A function that writes the target at a time [s] into `_target`, as the loop calls it.

        `part` is the loop's function of the path; what the law would be shown is thrown away.
        """
        c, place = self.vectors, self.vectors.s[self._layout.place :]
        shown = np.zeros(TARGET_SIZE)
        vectors = (self._given, place, c.path, c.path_table, self._target, shown)
        if not compiled:
            path = signatures.bind(*part)
            return lambda t: path(t, *vectors)
        from podusv_cli.engine.machine import compile  # a loop in plain Python needs no compiler

        path, pointers = compile.entry(*part), [signatures.pointer(v) for v in vectors]
        return lambda t: path(t, *pointers)

    def mark(self) -> MarchMark:
        """Where the march is, to come back to it: copies of what it writes to."""
        rows = -(-self.reached // self.grid.log_every)
        log = self.vectors.log[: rows * self._layout.width].copy()
        vectors = tuple(getattr(self.vectors, name).copy() for name in CHANGING)
        return MarchMark(self.reached, vectors, log)

    def back(self, mark: MarchMark) -> None:
        """Go on from a mark of this march."""
        self.reached = mark.reached
        self.vectors.log[: len(mark.log)] = mark.log
        for name, vector in zip(CHANGING, mark.vectors, strict=True):
            getattr(self.vectors, name)[:] = vector

    def recording(self) -> Recording:
        """What is logged so far, as of a run that was stopped here."""
        whole = self.reached > self.grid.steps
        ending = Ending(self.reached, "finished" if whole else "interrupted")
        return recording_of(self.plan, self.vectors, ending)


def in_lanes(
    part: str, kernel: Any, names: tuple[str, ...], shared: Set[str], vectors: Mapping[str, Vector]
) -> Callable[[float], None]:
    """A kernel, called as this part of the loop, for all lanes at a time [s].

    `names` are those of its constants, `shared` those that are alike in all lanes. `vectors` are
    its arguments by name, a number of every lane one by the other; those that are left out it may
    not read.
    """
    from podusv_cli.engine.machine import compile  # only what marches side by side needs it

    routine = compile.routine(compile.lane_adapter(part, kernel, names, frozenset(shared)))
    given = [vectors.get(name, room(LANES)) for name in SIGNATURES[part][1:]]
    pointers = [vector.ctypes.data_as(signatures.LANE_VECTOR) for vector in given]
    return lambda t: routine(t, *pointers)


class SteppedBatch:
    """The march of at most `LANES` runs, some instants at a time; no log is kept.

    What is written into `law_table` acts from the next instant on. `look(x, target, signals)` is a
    kernel that writes `size` numbers about the state, as a law is given it, and the target. Arrays
    have a column a run. `alive` says which runs have finite numbers so far.
    """

    def __init__(
        self,
        plan: Plan,
        runs: Sequence[BatchRun],
        advance: Callable[[Lanes, float], March],
        look: Any,
        size: int,
    ) -> None:
        """Nothing is marched yet; `plan` is that of runs like these, which `advance` marches.

        `look` writes `size` numbers.
        """
        layout, grid = plan.layout, plan.grid
        self.places = [run.position for run in runs]
        self.grid, self.reached, self.alive = grid, 0, np.ones(len(runs), bool)
        self._lanes = Lanes.of([run.vectors for run in runs], layout)
        self._march = advance(self._lanes, grid.step)
        c, target = Vectors(*self._lanes.vectors), room(TARGET_SIZE * LANES)
        view = room(size * LANES)
        given = c.s[layout.estimate * LANES :]
        _, path, names = plan.functions[0]
        shared = shared_constants(plan)["path"]
        vectors = {
            "x": given,
            "place": c.s[layout.place * LANES :],
            "k": c.path,
            "table": c.path_table,
            "target": target,
        }
        self._aim = in_lanes("path", path, names, shared, vectors)
        # Of all parts the law alone takes state, target and signals
        self._look = in_lanes("law", look, (), NOTHING, vectors | {"signals": view})
        self.law_table, self._seen, self._view = map(self._by_run, (c.law_table, c.seen, view))
        changing = [getattr(c, name) for name in CHANGING]
        self._unchanged = Unchanged([*changing, self._lanes.under_way])

    def _by_run(self, vector: Vector) -> Vector:
        """A view (numbers, runs) of a vector of all lanes, without lanes that have no run."""
        return vector.reshape(-1, LANES)[:, : len(self.places)]

    def advance(self, count: int) -> None:
        """March over so many instants, or to the end; over the last with the step before it.

        Behind the last instant there is no step to wait for, so it is counted in at once.
        """
        last = min(self.reached + count, self.grid.steps)
        self.reached = self._march(self.reached, last + (last == self.grid.steps))
        self.alive = self._marching()

    def _marching(self) -> npt.NDArray[np.bool_]:
        """Which of the runs (runs,) have not ended."""
        return np.equal(self._lanes.under_way[REACHED : REACHED + len(self.places)], MARCHING)

    @property
    def over(self) -> bool:
        """Whether the last instant is reached, or a run has numbers that are not finite."""
        return self.reached > self.grid.steps or not self.alive.all()

    @property
    def time(self) -> float:
        """The time of the next instant [s], or of the last."""
        return min(self.reached, self.grid.steps) * self.grid.step

    def times(self) -> Vector:
        """The time of each run [s]: of its next instant, or of the one that it did not get past."""
        ended = self._lanes.under_way[REACHED : REACHED + len(self.places)]
        return np.where(self.alive, self.time, ended * self.grid.step)

    def view(self) -> Vector:
        """What `look` writes at the next instant, (numbers, runs).

        A run that has ended repeats another one.
        """
        self._aim(self.time)
        self._look(self.time)
        return self._view

    def gathered_so_far(self) -> Vector:
        """What the probes gather of runs that end at the next instant, or have ended before.

        Shape (probe.size, runs).
        """
        with self._unchanged:
            if self.reached <= self.grid.steps:
                self._march(self.reached, self.reached + 1, self.reached)
            if self._marching().all():
                return self._seen.copy()
            self._lanes.endings(self.reached, self.grid.steps + 1)
            return np.array([run.seen for run in self._lanes.runs]).T
