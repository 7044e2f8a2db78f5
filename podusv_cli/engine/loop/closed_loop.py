"""The closed loop as values: its parts, the layout of its vectors, and their contents."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.disturbances.base import FLOW, WAVE_MOTION, Disturbance
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.measurements.base import KNOWN, OWN, Measurement
from podusv_cli.components.measurements.exact import Exact
from podusv_cli.components.paths.base import TARGET, Path
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core import signal
from podusv_cli.core.component import describe
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import Vector, bundle, kernel
from podusv_cli.core.kernel import call as call_kernel
from podusv_cli.core.recording import Allocate
from podusv_cli.core.signal import LOOP, Signal
from podusv_cli.core.steps import whole_steps
from podusv_cli.engine.loop.recent import Recall, call
from podusv_cli.engine.loop.rounded import law_of_rounded, sample_of_rounded
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import HELD_SIGNALS, Layout, Vectors
from podusv_cli.engine.step.relay import relay

STATE = tuple(state.name for state in signal.STATE)
DEMAND = ("tau_u_cmd", "tau_r_cmd")
LOADS = ("tau_u", "tau_v", "tau_r", "b_u", "b_v", "b_r")


@kernel
def nothing() -> None:
    """Stands for a part that a loop does not have: a kernel takes those arguments that it names."""


AT_START = (0.0,)  # s


@dataclass(frozen=True)
class Observer:
    """A kernel `watch(t, weight, s, row, k, seen)` that sees every instant of a run.

    It gathers `size` numbers. Runs that march side by side have equal constants but for those named
    in `differing`.
    """

    watch: Callable[..., None] = nothing
    size: int = 1
    differing: frozenset[str] = frozenset()

    def constants_for(self, loop: ClosedLoop) -> dict[str, float]:
        """The kernel's constants in a run of this loop."""
        return {"nothing": 0.0}


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
    measurement: Measurement = field(default_factory=Exact)
    estimator: Estimator = field(default_factory=NoEstimator)

    @property
    def measured(self) -> bool:
        """Whether the law is given an estimate from measurements, and not the state itself."""
        return not self.measurement.is_exact

    @property
    def at_once(self) -> bool:
        """Whether the true state acts on the actuator through the law without delay."""
        return not self.measured and self.actuator.delay() == 0.0

    @property
    def has_target(self) -> bool:
        """Whether the distance to the target says how good the law is."""
        return not (self.path.follows or self.controller.trial())

    def lyapunov(self) -> Any:
        """The law where (46) is its Lyapunov function; None where it sees another target."""
        other = self.path.follows or self.path.fillet_for_law()
        return None if other else self.controller.lyapunov()

    def check_seeing(self) -> None:
        """Raise LawError for a measurement or an estimator that is not what it declares.

        In compiled code it would write beyond its vectors.
        """
        if not self.measured:
            return
        measurement, start = self.measurement, np.array(self.start)
        known, first = measurement.measured(), measurement.first(start, 1.0)
        marks = first[KNOWN:OWN].tolist() == [float(one) for one in known]
        if len(known) != len(STATE) or not marks or len(measurement.signals) != sum(known):
            what = f"{len(measurement.signals)} signals, and measures {sum(known)} of {len(STATE)}"
            raise LawError(
                f"{describe(measurement)}: it declares {what}; `first` has to say the same"
            )
        states, begun = len(self.estimator.states), len(self.estimator.start(start, self.nominal))
        if not begun == states >= len(STATE):
            raise LawError(
                f"{describe(self.estimator)}: it starts with {begun} numbers and declares {states} "
                f"states; both have to be the same, {len(STATE)} or more"
            )

    def check_fit(self, step: float) -> None:
        """Raise LawError for parts that do not fit each other, the vessel or the step [s].

        Scenarios are checked when they are loaded; this is for loops that are put together.
        """
        self.check_seeing()
        parts = {
            "disturbance": self.disturbance.conflicts(self.vessel, step),
            "measurement": self.measurement.conflicts(step),
        }
        told = [f"{part}.{key}: {text}" for part, found in parts.items() for key, text in found]
        if lacking := self.estimator.lacking(self.measurement.measured()):
            told.append(f"estimator: {lacking}")
        if told:
            raise LawError("; ".join(told))

    def estimated(self) -> tuple[Signal, ...]:
        """The estimator's states; none where the law is given the state itself."""
        return self.estimator.states if self.measured else ()

    def first_memory(self, recall: Recall = call) -> Vector:
        """The law's memory at t = 0."""
        target = np.asarray(self.first_target(recall))
        with np.errstate(all="ignore"):  # a start beyond all numbers is for the run to tell
            return self.controller.start(np.array(self.start), target, self.nominal)

    def first_target(self, recall: Recall = call) -> Vector:
        """Where the target is at t = 0."""
        if not self.path.follows:
            return np.asarray(recall(self.path.targets, AT_START)[0])
        x, place, target = (
            np.array(self.start),
            np.zeros(len(self.path.places)),
            np.zeros(len(TARGET)),
        )
        k, table = bundle(self.path_constants()), self.path.table()
        call_kernel(self.path.evaluate, t=0.0, x=x, place=place, k=k, table=table, target=target)
        return target

    def path_constants(self, recall: Recall = call) -> dict[str, float]:
        """The path's constants for this law."""
        approach = self.controller.approach()
        standoff = approach.standoff if approach else 0.0
        constants: dict[str, float] = recall(self.path.constants_with, standoff)
        return constants

    def law_constants(self, recall: Recall = call) -> dict[str, float]:
        """The law's constants, with those of the path's fillet where it has one."""
        own: dict[str, float] = recall(self.controller.constants_with, self.nominal)
        fillet = recall(self.path.fillet_for_law)
        if fillet is None:
            return own
        corners: dict[str, float] = fillet.constants(len(recall(self.controller.table)))
        if taken := sorted(own.keys() & corners):
            raise LawError(
                f"{describe(self.controller)}: path.fillet needs the name {taken[0]!r}, which is a "
                "constant of this law; give it another name"
            )
        return own | corners

    def law_table(self, recall: Recall = call) -> Vector:
        """The law's table, and behind it the corners of the path's fillet."""
        own: Vector = recall(self.controller.table)
        fillet = recall(self.path.fillet_for_law)
        return np.concatenate([own, fillet.rows()]) if fillet else own

    def about(self) -> dict[str, Signal]:
        """Every signal that the loop logs, by name. Raises LawError where two have one name."""
        self.check_seeing()
        law, actuator = self.controller, self.actuator
        own = (partial(describe, actuator), (*actuator.states, *actuator.signals_with))
        path = (partial(describe, self.path), self.path.places)
        common = [one for one in LOOP if self.has_target or one.name != "z_e"]
        loop = (lambda: "the closed loop", common)
        others = (
            *((partial(describe, part), signals) for part, signals in self.disturbance.told()),
            (partial(describe, self.measurement), self.measurement.signals),
            (partial(describe, self.estimator), self.estimated()),
        )
        return signal.by_name((loop, path, (partial(describe, law), law.declared()), own, *others))

    def layout(self, grid: TimeGrid) -> Layout:
        """Sizes and offsets of the loop on this grid."""
        law, actuator = self.controller, self.actuator
        estimate = len(STATE) + len(actuator.states)
        place = estimate + len(self.estimated())
        memory, load = place + len(self.path.places), 3 + len(self.disturbance.signals)
        sizes = [
            len(TARGET) + 1, len(law.signals), len(DEMAND), 3, load, len(actuator.signals_with),
            len(self.measurement.signals),
        ]  # fmt: skip
        signals, demand, tau, b, flags, sensed, columns = np.cumsum(sizes).tolist()
        return Layout(
            states=memory + sum(size for _, size in law.slots()),
            estimate=estimate if self.measured else 0, place=place, memory=memory,
            signals=signals, demand=demand, tau=tau, b=b,
            flow=_flow(self.disturbance, b) if actuator.feels_motion else 0,
            flags=flags, sensed=sensed, columns=columns,
            steps=grid.steps, log_every=grid.log_every, hold_every=grid.hold_every,
            sample_every=_sample_steps(law, grid),
            measured=int(self.measured), update_first=int(grid.update_first),
            follows=int(self.path.follows),
            load_of_time=int(self.disturbance.of_time), wants_loads=int(law.wants_loads()),
            relayed=int(actuator.is_relayed),
        )  # fmt: skip


def _sample_steps(law: Controller, grid: TimeGrid) -> int:
    period = law.sample_period()
    if law.takes_samples() and not period:
        return grid.hold_every or 1
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


def entries(
    loop: ClosedLoop, observer: Observer, recall: Recall = call
) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    """Name, kernel and constants' names of every part, in the order the loop takes them."""
    law, path, disturbance, actuator = loop.controller, loop.path, loop.disturbance, loop.actuator
    constants = tuple(loop.law_constants(recall))
    rounded = recall(path.fillet_for_law) is not None
    steer = law_of_rounded(law.law) if rounded else law.law
    take = sample_of_rounded(law.sample) if rounded and law.takes_samples() else law.sample
    # What does nothing reads no constants: its machine code is the same for every law.
    sample = (take, constants) if law.takes_samples() else (nothing, ())
    told = law.wants_loads()
    after_saturation = (law.after_saturation, constants) if told else (nothing, ())
    yield "path", path.evaluate, tuple(loop.path_constants(recall))
    locate = (path.locate, tuple(loop.path_constants(recall))) if path.follows else (nothing, ())
    yield "locate", *locate
    loads = tuple(recall(disturbance.constants_with, loop.vessel))
    yield "disturbance", disturbance.kernel_with(loop.vessel), loads
    yield "law", steer, constants
    yield "sample", *sample
    yield "actuator", actuator.drive_with(), tuple(recall(actuator.constants))
    yield "after_saturation", *after_saturation
    yield from _seeing(loop, recall)
    yield "observer", observer.watch, tuple(recall(observer.constants_for, loop))


def _seeing(loop: ClosedLoop, recall: Recall) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    """What `entries` has of measurement and estimator."""
    measurement, estimator = loop.measurement, loop.estimator
    sense = measurement.sense if loop.measured else nothing
    correct = estimator.correct if loop.measured else nothing
    follow = estimator.follow if loop.measured else nothing
    yield "measurement", sense, tuple(recall(measurement.constants_with, 1.0, 0))
    constants = tuple(recall(estimator.constants_with, loop.nominal))
    yield "correct", correct, constants
    yield "follow", follow, constants


@np.errstate(all="ignore")
def vectors_of(
    loop: ClosedLoop, layout: Layout, observer: Observer, grid: TimeGrid, rows: int = 1,
    allocate: Allocate = np.empty, recall: Recall = call,
) -> Vectors:  # fmt: skip
    """The loop's vectors, ready for the march to begin, with room for this many logged rows.

    Numbers beyond all limits are for the run to tell.
    """

    def numbers(constants: Callable[..., dict[str, float]], *given: Any) -> Vector:
        return np.array(list(recall(constants, *given).values()) or [0.0])

    law, path, disturbance, actuator = loop.controller, loop.path, loop.disturbance, loop.actuator
    measurement, estimator = loop.measurement, loop.estimator
    start, estimate = np.array(loop.start), np.zeros(0)
    if loop.measured:
        estimate = estimator.start(start, loop.nominal)
    duration, motion = grid.steps * grid.step, _wave_motion(disturbance)
    return Vectors(
        path=np.array(list(loop.path_constants(recall).values()) or [0.0]),
        path_table=recall(path.table),
        disturbance=numbers(disturbance.constants_with, loop.vessel),
        disturbance_table=recall(disturbance.table_for, loop.vessel, duration),
        law=np.array(list(loop.law_constants(recall).values()) or [0.0]),
        law_table=loop.law_table(recall),
        actuator=numbers(actuator.constants), actuator_table=recall(actuator.table),
        measurement=numbers(measurement.constants_with, grid.step, motion),
        measurement_table=recall(measurement.table_for, grid.step, grid.steps),
        estimator=numbers(estimator.constants_with, loop.nominal),
        estimator_table=recall(estimator.table),
        vessel=numbers(loop.vessel.constants),
        observer=numbers(observer.constants_for, loop),
        s=np.concatenate(
            [start, recall(actuator.rest), estimate, np.zeros(len(path.places)),
             loop.first_memory(recall)]
        ),
        row=np.zeros(layout.columns), stages=np.zeros(5 * layout.states),
        sensed=measurement.first(start, grid.step),
        relay=relay(actuator.delay(), grid), held=np.zeros(HELD_SIGNALS + len(law.signals)),
        work=np.zeros(law.workspace()), seen=np.zeros(observer.size), under_way=np.zeros(2),
        log=allocate(rows * layout.width),
    )  # fmt: skip


def _flow(disturbance: Disturbance, b: int) -> int:
    """Where the row has the current, with the load at `b`; 0 where the water is at rest."""
    signals = disturbance.signals
    return b + 3 + signals.index(FLOW[0]) if FLOW[0] in signals else 0


def _wave_motion(disturbance: Disturbance) -> int:
    """Where a disturbance writes the motion in waves that sensors see; 0 where it has none."""
    signals = disturbance.signals
    return 3 + signals.index(WAVE_MOTION[0]) if WAVE_MOTION[0] in signals else 0
