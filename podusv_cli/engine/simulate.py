"""From components to a recording: lay out the loop, march, name the columns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from podusv_cli.actuators.base import Actuator
from podusv_cli.controllers.base import Controller
from podusv_cli.core import signal
from podusv_cli.core.component import called
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.recording import Allocate, Recording, Status
from podusv_cli.core.signal import LOOP, Signal
from podusv_cli.disturbances.base import Disturbance
from podusv_cli.engine import closed_loop, signatures
from podusv_cli.engine.grid import TimeGrid, whole_steps
from podusv_cli.engine.layout import HELD_SIGNALS, Plan, Wires
from podusv_cli.engine.march import Ending, Word, march
from podusv_cli.paths.base import TARGET, Path
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.vessels.vessel import Vessel

STATE = tuple(state.name for state in signal.STATE)
DEMAND = ("tau_u_cmd", "tau_r_cmd")
# What a log says of a run, by how its march ended.
RECORDED: dict[Word, Status] = {
    "finished": "finished", "interrupted": "interrupted",
    "diverged": "diverged", "crashed": "diverged", "hung": "diverged",
}  # fmt: skip
LOADS = ("tau_u", "tau_v", "tau_r", "b_u", "b_v", "b_r")


@kernel
def _see_nothing(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    pass


@kernel
def _no_sample(t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector) -> None:
    pass


@kernel
def _ignore_loads(
    t: float, memory: Vector, demand: Vector, tau: Vector, k: Any, table: Vector, rate: Vector
) -> None:
    pass


@dataclass(frozen=True)
class Observer:
    """A kernel `watch(t, weight, s, row, k, seen)` that sees every instant, and its constants."""

    watch: Callable[..., None] = _see_nothing
    constants: dict[str, float] = field(default_factory=lambda: {"nothing": 0.0})
    size: int = 1


@dataclass(frozen=True)
class ClosedLoop:
    """Everything that moves, as values; `nominal` is the vessel that the law is told about."""

    vessel: Vessel
    nominal: Vessel
    path: Path
    disturbance: Disturbance
    actuator: Actuator
    controller: Controller
    start: tuple[float, float, float, float, float, float]

    def first_memory(self) -> Vector:
        """The law's memory at t = 0."""
        with np.errstate(all="ignore"):  # a start beyond all numbers is for the run to tell
            return self.controller.start(np.array(self.start), self.first_target(), self.nominal)

    def first_target(self) -> Vector:
        """Where the target is at t = 0."""
        return np.asarray(self.path.targets([0.0])[0])

    def about(self) -> dict[str, Signal]:
        """Every signal that the loop logs, by name. Raises LawError where two have one name."""
        law, actuator = self.controller, self.actuator
        own = (partial(called, actuator), (*actuator.states, *actuator.signals))
        loop = (lambda: "the closed loop", LOOP)
        return signal.by_name((loop, (partial(called, law), law.declared()), own))

    def layout(self, grid: TimeGrid) -> Plan:
        """Sizes and offsets of the loop on this grid."""
        law, actuator = self.controller, self.actuator
        memory = 6 + len(actuator.states)
        sizes = [len(TARGET) + 1, len(law.signals), len(DEMAND), 3, 3, len(actuator.signals)]
        signals, demand, tau, b, flags, columns = np.cumsum(sizes).tolist()
        return Plan(
            states=memory + sum(size for _, size in law.slots()), memory=memory,
            signals=signals, demand=demand, tau=tau, b=b, flags=flags, columns=columns,
            steps=grid.steps, log_every=grid.log_every, hold_every=grid.hold_every,
            sample_every=_sample_steps(law.sample_period(), grid),
            update_first=int(grid.update_first),
            load_of_time=int(self.disturbance.of_time), wants_loads=int(law.wants_loads()),
        )  # fmt: skip


def _sample_steps(period: float, grid: TimeGrid) -> int:
    count = whole_steps(period, grid.step)
    if count is None or (period > 0 and count == 0):
        raise ValueError(
            f"the law samples every {period:g} s, no whole number of steps of {grid.step:g} s"
        )
    if grid.hold_every and count % grid.hold_every:
        held = grid.hold_every * grid.step
        raise ValueError(
            f"the law samples every {period:g} s, no whole number of the {held:g} s for which "
            "its measurement is held"
        )
    return count


def simulate(
    loop: ClosedLoop,
    grid: TimeGrid,
    *,
    observer: Observer | None = None,
    compiled: bool = True,
    progress: Callable[[float], None] | None = None,
    allocate: Allocate = np.empty,
) -> Recording:
    """Integrate the closed loop over the grid.

    `progress` is called with the fraction done, about 20 times a second. An interrupt ends the
    march and keeps what was logged. `compiled=False` runs the same kernels as plain Python.
    `allocate` gives the room for the logged rows; the recording's signals are views of it.
    """
    observer, about = observer or Observer(), loop.about()
    plan = loop.layout(grid)
    wires, last = wire(loop, plan, observer, grid.rows, allocate), plan.steps + 1
    advance = partial(marcher(loop, observer, compiled), 0, last, grid.step, wires, plan)
    with np.errstate(all="ignore"), interrupts_deferred():
        ending = march(
            advance, last, wires.under_way,
            progress and (lambda reached: progress(reached / last)),
        )  # fmt: skip
        return replace(_record(loop, grid, wires, plan, ending), about=about)


def entries(loop: ClosedLoop, observer: Observer) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    """Name, kernel and constants' names of every part, in the order the loop takes them."""
    law, path, disturbance, actuator = loop.controller, loop.path, loop.disturbance, loop.actuator
    constants = tuple(law.constants_with(loop.nominal))
    sample = law.sample if law.sample_period() > 0 else _no_sample
    after_saturation = law.after_saturation if law.wants_loads() else _ignore_loads
    yield "path", path.evaluate, tuple(path.constants())
    yield "disturbance", disturbance.evaluate, tuple(disturbance.constants())
    yield "law", law.law, constants
    yield "sample", sample, constants
    yield "actuator", actuator.drive, tuple(actuator.constants())
    yield "after_saturation", after_saturation, constants
    yield "observer", observer.watch, tuple(observer.constants)


def marcher(loop: ClosedLoop, observer: Observer, compiled: bool) -> Callable[..., int]:
    """The march of this loop, `closed_loop.advance` less its functions, compiled if need be."""
    if not compiled:
        doors = [signatures.bind(*part) for part in entries(loop, observer)]
        return lambda *rest: closed_loop.advance_plainly(*doors, *rest)
    from podusv_cli.engine import compile  # a loop in plain Python needs no compiler

    doors = [compile.entry(*part) for part in entries(loop, observer)]
    march = compile.routine(closed_loop.advance, signatures.ADVANCE)

    def compiled_march(first: int, last: int, h: float, wires: Wires, plan: Plan) -> int:
        vectors, sizes = signatures.pointers(wires), signatures.whole_numbers(plan)
        return int(march(*doors, first, last, h, vectors, sizes))

    return compiled_march


def wire(
    loop: ClosedLoop, plan: Plan, observer: Observer, rows: int = 1, allocate: Allocate = np.empty
) -> Wires:
    """The loop's vectors, ready for the march to begin, with room for this many logged rows."""

    def numbers(constants: dict[str, float]) -> Vector:
        return np.array(list(constants.values()) or [0.0])

    law, path, disturbance, actuator = loop.controller, loop.path, loop.disturbance, loop.actuator
    return Wires(
        path=numbers(path.constants()), path_table=path.table(),
        disturbance=numbers(disturbance.constants()), disturbance_table=disturbance.table(),
        law=numbers(law.constants_with(loop.nominal)), law_table=law.table(),
        actuator=numbers(actuator.constants()), actuator_table=actuator.table(),
        vessel=numbers(loop.vessel.constants()), observer=numbers(observer.constants),
        s=np.concatenate([loop.start, actuator.rest(), loop.first_memory()]),
        row=np.zeros(plan.columns), stages=np.zeros(5 * plan.states),
        held=np.zeros(HELD_SIGNALS + len(law.signals)),
        work=np.zeros(law.workspace()), seen=np.zeros(observer.size), under_way=np.zeros(2),
        log=allocate(rows * plan.width),
    )  # fmt: skip


def names(loop: ClosedLoop) -> list[str]:
    """Names of a logged row's columns: time, state, row; a slot of size n has n columns."""
    law, actuator = loop.controller, loop.actuator
    slots = [part for part, size in law.slots() for _ in range(size)]
    states = [part.name for part in (*actuator.states, *slots)]
    own, others = ([part.name for part in owner.signals] for owner in (law, actuator))
    return ["time", *STATE, *states, *TARGET, "z_e", *own, *DEMAND, *LOADS, *others]


def by_name(labels: list[str], table: Vector, about: Mapping[str, Signal]) -> dict[str, Vector]:
    """A table's columns by name; those of a vector together, shape (rows, size)."""
    vectors = {name for name, part in about.items() if part.axes}
    columns: dict[str, list[int]] = {}
    for column, name in enumerate(labels):
        columns.setdefault(name, []).append(column)
    return {
        name: table[:, at[0] : at[-1] + 1] if name in vectors else table[:, at[0]]
        for name, at in columns.items()
    }


def _logged(loop: ClosedLoop, table: Vector) -> dict[str, Vector]:
    """The signals of a recording in a table of logged rows."""
    named = by_name(names(loop), table, loop.about())
    return {name: column for name, column in named.items() if name not in TARGET[2:]}


def _record(
    loop: ClosedLoop, grid: TimeGrid, wires: Wires, plan: Plan, ending: Ending
) -> Recording:
    rows = -(-ending.reached // plan.log_every)
    signals = _logged(loop, wires.log.reshape(-1, plan.width)[:rows])
    status, message = RECORDED[ending.status], ""
    if status == "interrupted":
        message = f"interrupted after t = {max(ending.reached - 1, 0) * grid.step:.6g} s"
    if status == "diverged":
        message = f"diverged {why(ending, loop, grid, wires)}; {_last_words(signals)}"
    fixed = {part.name: array for part, array in loop.controller.fixed_signals().items()}
    return Recording(status, loop.controller.label, signals, fixed, wires.seen.copy(), message)


def why(ending: Ending, loop: ClosedLoop, grid: TimeGrid, wires: Wires) -> str:
    """When and why a march that nobody interrupted did not reach its last instant."""
    at = ending.reached * grid.step
    return f"at t = {at:.6g} s: {ending.cause or _culprit(wires, names(loop), at)}"


def _culprit(wires: Wires, labels: list[str], at: float) -> str:
    now = np.concatenate([[at], wires.s, wires.row])
    named = zip(labels, now, strict=True)
    bad = next((name for name, x in named if not abs(x) <= closed_loop.LARGEST), "?")
    return f"{bad} is not finite"


def _last_words(signals: Mapping[str, Vector]) -> str:
    last = ", ".join(
        f"{name} {signals[name][-1]:.4g}"
        for name in ("time", *STATE, *DEMAND)
        if len(signals[name])
    )
    return f"last logged values: {last or 'none'}"
