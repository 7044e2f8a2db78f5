"""Runs side by side: the vectors of several runs as one, a run in every lane.

What compiled code for lanes takes and gives, without numba. A number of a vector is `LANES` numbers
in memory, one of every run, so that a register holds them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from podusv_cli.components.measurements.base import KNOWN, OWN
from podusv_cli.core.kernel import LANES, Vector, whole_numbers
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.running.simulate import March
from podusv_cli.engine.running.thread import Ending
from podusv_cli.engine.step.delay_line import COUNT
from podusv_cli.engine.step.lane_march import REACHED, advance_lanes
from podusv_cli.engine.step.layout import STEPS, Layout, Vectors

NUMBER = 8  # bytes
FEWEST = 3  # runs; fewer take no longer alone
WORTH = 20_000_000  # instants of a batch, from which on compiling takes less than it gains
MARCHING = -1.0  # stands for the instants that a lane has reached


def shared_constants(plan: Plan) -> dict[str, frozenset[str]]:
    """By component the constants that all lanes have to share: choices, sizes and positions.

    A kernel branches on them or counts with them, which all lanes have to do alike.
    """
    loop, probe = plan.loop, plan.probe
    shared = {name: part.choices() for name, part in loop.parts.items()}
    shared["probe"] = frozenset(plan.constants["probe"]) - probe.differing
    shared["disturbance"] = shared["disturbance"].union(
        loop.disturbance.constant_of(i, name)
        for i, part in enumerate(loop.disturbance.each())
        for name in whole_numbers(part.kernel_with(loop.vessel))
    )
    for function in plan.functions:
        if function.part != "disturbance":  # whose parts' constants have other names in the sum
            shared[function.owner] |= whole_numbers(function.kernel)
    return {
        owner: frozenset(names & plan.constants[owner].keys()) for owner, names in shared.items()
    }


def marcher(
    plan: Plan, compiling: Callable[[float], None] | None = None
) -> Callable[[Lanes, float], March]:
    """What makes the compiled march of runs like the plan's loop, side by side, with a step [s].

    `compiling` hears the fraction that is compiled. Raises TypeError where a part cannot go another
    way in every lane, LawError for a kernel that would read what is not there.
    """
    from podusv_cli.engine.machine import compile  # only what marches side by side needs it

    every = pieces(plan)
    compile.prepare(every, compiling)
    *adapters, march = map(compile.routine, every)

    def ready(lanes: Lanes, h: float) -> March:
        """A function that marches these runs side by side, with step `h` [s]."""
        vectors = lanes.vectors
        pointers = signatures.pointers(vectors, signatures.LANE_VECTOR)
        sizes = signatures.whole_numbers(lanes.layout)
        given = (
            pointers,
            sizes,
            len(vectors[Vectors._fields.index("seen")]) // LANES,
            signatures.pointer(lanes.under_way),
            signatures.pointer(lanes.ends),
        )

        def over(first: int, last: int, steps: int = lanes.layout.steps) -> int:
            """March from instant `first` up to `last`; the instant that was reached."""
            sizes[STEPS] = steps
            return int(march(*adapters, first, last, h, *given))

        return over

    return ready


def is_compiled(plan: Plan) -> bool:
    """Whether the march of runs like this loop is on the disk, or next to it: half a second."""
    from podusv_cli.engine.machine import object_cache

    return all(object_cache.is_cached(p.name) or p.shipped_bitcode for p in pieces(plan))


def pieces(plan: Plan) -> list[Any]:
    """What is compiled for lanes: the parts, with what is alike in them, and the march.

    Raises TypeError where a part cannot go another way in every lane, LawError for a kernel that
    would read what is not there.
    """
    from podusv_cli.engine.machine import compile

    shared = shared_constants(plan)
    parts = [
        compile.lane_adapter(*function, shared[function.owner].intersection(function.constants))
        for function in plan.functions
    ]
    march = compile.Piece(advance_lanes, signatures.ADVANCE_LANES, compiler=compile.LANES_BY)
    return [*parts, march]


def places(plan: Plan) -> list[tuple[int, list[int]]]:
    """Where the numbers that are alike lie: pairs of a vector's position in `Vectors`, and places.

    Runs with the same numbers there may march side by side.
    """
    loop = plan.loop
    positions = {
        owner: [i for i, name in enumerate(plan.constants[owner]) if name in names]
        for owner, names in shared_constants(plan).items()
    }
    positions |= {
        "disturbance_table": loop.disturbance.shared_places(),
        "measurement_table": loop.measurement.shared_places(),
        "sensed": list(range(KNOWN, OWN)) if loop.measured else [],
        "delay_line": [COUNT],
    }
    return [(Vectors._fields.index(vector), inside) for vector, inside in positions.items()]


def room(count: int) -> Vector:
    """Zeros (count,) that begin at a whole register, as vector loads need."""
    # Up to LANES - 1 numbers in front are left out, until the address is a multiple of a register
    more = np.zeros(count + LANES)
    return more[-(more.ctypes.data // NUMBER) % LANES :][:count]


def _side_by_side(vectors: Sequence[Vector]) -> Vector:
    """One vector of several (n,), a lane each: (n, LANES), flat.

    The lanes that are left repeat the first, so that they compute with sound numbers.
    """
    # Number i of lane l stands at LANES i + l; a shorter vector is filled up with zeros
    together = room(LANES * max(map(len, vectors)))
    for lane in range(LANES):
        vector = vectors[lane if lane < len(vectors) else 0]
        together[lane::LANES][: len(vector)] = vector
    return together


@dataclass(frozen=True, eq=False)
class Lanes:
    """Runs that march side by side. `runs` are their own vectors, which get the result."""

    runs: Sequence[Vectors]
    vectors: list[Vector]
    layout: Layout
    under_way: Vector
    ends: Vector

    @classmethod
    def of(cls, runs: Sequence[Vectors], layout: Layout) -> Lanes:
        """At most LANES runs of one layout side by side, ready for the march."""
        # Where a run that diverges leaves its state, row and metrics, while the others go on
        size = layout.states + layout.columns + len(runs[0].seen)
        under_way = np.zeros(REACHED + LANES)
        under_way[REACHED : REACHED + len(runs)] = MARCHING
        vectors = [_side_by_side(several) for several in zip(*runs, strict=True)]
        return cls(runs, vectors, layout, under_way, np.zeros(LANES * size))

    def endings(self, reached: int, last: int) -> list[Ending]:
        """How each run ended, where the march stopped at the instant `reached`.

        `last` is the instant that it was to stop at. The vectors of every run are filled in.
        """
        return [self._ending(lane, reached, last) for lane in range(len(self.runs))]

    def _ending(self, lane: int, reached: int, last: int) -> Ending:
        """How the run in a lane ended; its state, row and metrics go back to its own vectors.

        `reached` is the instant that the others came to, of those up to `last`. A run that diverged
        stopped earlier, and its numbers of that instant were put aside in `ends`.
        """
        own, ended, n = self.runs[lane], self.under_way[REACHED + lane], self.layout
        together = Vectors(*self.vectors)
        kept = [vector[lane::LANES] for vector in (together.s, together.row, together.seen)]
        if ended != MARCHING:
            ends = self.ends.reshape(LANES, -1)[lane]
            kept = np.split(ends, [n.states, n.states + n.columns])
        for part, vector in zip(kept, (own.s, own.row, own.seen), strict=True):
            vector[: len(part)] = part[: len(vector)]
        if ended != MARCHING:
            return Ending(int(ended), "diverged")
        return Ending(reached, "finished" if reached == last else "interrupted")


class LaneSorter:
    """Sorts the runs of a batch by what they have to have in common to march side by side."""

    def __init__(self, instants: int, wanted: bool | None) -> None:
        """`instants` counts those of all runs together, which tell whether compiling pays.

        `wanted` says whether to march side by side at all; None leaves it to that count.
        """
        self.advance: Callable[[Lanes, float], March] | None = None
        self._instants, self._wanted = instants, wanted
        self._places: list[tuple[int, list[int]]] = []
        self._waiting: dict[tuple[float, ...], list[Any]] = {}
        self._chosen = False

    def choose(self, plan: Plan) -> None:
        """Decide, by the first plan, whether runs march side by side."""
        if not self._chosen:
            self._chosen = True
            with suppress(TypeError):  # `why_alone` tells why
                if self._wanted or (self._wanted is None and self._is_worth(plan)):
                    self._places = places(plan)
                    self.advance = marcher(plan)

    def _is_worth(self, plan: Plan) -> bool:
        """Whether the batch is long enough to compile code for lanes, or has it compiled."""
        return self._instants >= WORTH or is_compiled(plan)

    def sort_in(self, vectors: Vectors, run: Any) -> list[Any]:
        """The runs to start now that this one is ready: a whole register of its kind, or none yet.

        `vectors` are the run's, by whose shared numbers it is sorted. Without lanes it starts
        alone.
        """
        if not self.advance:
            return [run]
        kind = tuple(float(vectors[at][i]) for at, inside in self._places for i in inside)
        waiting = self._waiting.setdefault(kind, [])
        waiting.append(run)
        if len(waiting) < LANES:
            return []
        ready = waiting.copy()
        waiting.clear()
        return ready

    def rest(self) -> list[list[Any]]:
        """The runs that still wait for others; none of them waits any more."""
        ready = [runs for runs in self._waiting.values() if runs]
        self._waiting.clear()
        return ready


def prepare(plan: Plan, instants: int, compiling: Callable[[float], None] | None = None) -> str:
    """Compile the march of runs like this loop, if so many instants in all are worth it.

    Returns why these runs cannot march side by side; "" where they can, or where it is not worth
    it. `compiling` hears the fraction compiled.
    """
    return why_alone(plan, compiling) if instants >= WORTH else ""


def why_alone(plan: Plan, compiling: Callable[[float], None] | None = None) -> str:
    """Why runs like this loop cannot march side by side; "" where they can.

    Compiles the march to find out; `compiling` hears the fraction that is compiled.
    """
    try:
        places(plan)
        marcher(plan, compiling)
    except TypeError as error:
        return str(error)
    return ""
