"""A loop on its grid, planned once: what it calls, where everything lies, and what it is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.disturbances.base import FLOW, WAVE_MOTION
from podusv_cli.components.paths.base import TARGET
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Allocate
from podusv_cli.core.signal import Signal
from podusv_cli.core.steps import whole_steps
from podusv_cli.engine.loop.closed_loop import (
    DEMAND,
    LOADS,
    STATE,
    ClosedLoop,
    Observer,
    nothing,
)
from podusv_cli.engine.loop.recent import Recall, call
from podusv_cli.engine.loop.rounded import law_of_rounded, sample_of_rounded
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import HELD_SIGNALS, Layout, Vectors
from podusv_cli.engine.step.relay import relay

FORCES, SEA = LOADS[:3], LOADS[3:]


class Function(NamedTuple):
    """What the loop calls as one of its parts, and the names of the constants that it reads."""

    part: str  # in `signatures.SIGNATURES`
    kernel: Any
    constants: tuple[str, ...]


def unwatched(plan: Plan) -> Observer:
    """Nobody sees the run."""
    return Observer()


@dataclass(frozen=True, eq=False)
class Plan:
    """A loop, a grid, and all that follows from both; made once, and handed down.

    `probe` gives the observer of the run. `recall` calls methods of components.
    """

    loop: ClosedLoop
    grid: TimeGrid
    probe: Callable[[Plan], Observer] = unwatched
    recall: Recall = call

    @classmethod
    def watched(cls, loop: ClosedLoop, grid: TimeGrid, observer: Observer) -> Plan:
        """With an observer that is there already."""
        return cls(loop, grid, lambda plan: observer)

    @cached_property
    def observer(self) -> Observer:
        """What sees every instant."""
        return self.probe(self)

    @cached_property
    def about(self) -> dict[str, Signal]:
        """Every signal that the loop logs, by name. Raises LawError where two have one name."""
        return self.loop.about()

    @cached_property
    def states(self) -> dict[str, list[str]]:
        """Names of what is integrated, by part in the order of `s`; a vector's once a number."""
        loop = self.loop
        slots = [part.name for part, size in loop.controller.slots() for _ in range(size)]
        return {
            "vessel": [*STATE], "actuator": _names(loop.actuator.states),
            "estimator": _names(loop.estimated()), "path": _names(loop.path.places), "law": slots,
        }  # fmt: skip

    @cached_property
    def row(self) -> dict[str, list[str]]:
        """Names of what is computed at every instant, by part in the order of the row."""
        loop = self.loop
        return {
            "target": [*TARGET, "z_e"], "law": _names(loop.controller.signals), "demand": [*DEMAND],
            "forces": [*FORCES], "sea": [*SEA, *_names(loop.disturbance.signals)],
            "actuator": _names(loop.actuator.signals_with),
            "measurement": _names(loop.measurement.signals),
        }  # fmt: skip

    @cached_property
    def names(self) -> list[str]:
        """Names of a logged row's columns: time, states, row."""
        parts = (*self.states.values(), *self.row.values())
        return ["time", *(name for part in parts for name in part)]

    @cached_property
    def layout(self) -> Layout:
        """Sizes and offsets of the loop on this grid."""
        loop, grid = self.loop, self.grid
        s, row, flow = _offsets(self.states), _offsets(self.row), self._of_sea(FLOW[0])
        return Layout(
            states=s["end"], estimate=s["estimator"] if loop.measured else 0, place=s["path"],
            memory=s["law"], signals=row["law"], demand=row["demand"], tau=row["forces"],
            b=row["sea"], flow=row["sea"] + flow if flow and loop.actuator.feels_motion else 0,
            flags=row["actuator"], sensed=row["measurement"], columns=row["end"],
            steps=grid.steps, log_every=grid.log_every, hold_every=grid.hold_every,
            sample_every=_sample_steps(loop.controller, grid),
            measured=int(loop.measured), update_first=int(grid.update_first),
            follows=int(loop.path.follows), load_of_time=int(loop.disturbance.of_time),
            wants_loads=int(loop.controller.wants_loads()), relayed=int(loop.actuator.is_relayed),
        )  # fmt: skip

    def _of_sea(self, one: Signal) -> int:
        """Where a disturbance writes a signal, behind its load; 0 where it does not."""
        own = self.loop.disturbance.signals
        return len(SEA) + own.index(one) if one in own else 0

    @cached_property
    def functions(self) -> tuple[Function, ...]:
        """What the loop calls, in the order in which it takes them."""
        return tuple(Function(*each) for each in self._functions())

    @property
    def structure(self) -> tuple[Layout, tuple[Function, ...]]:
        """What runs of one batch have in common; they differ in numbers only."""
        return self.layout, self.functions

    def _functions(self) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
        loop, recall = self.loop, self.recall
        law, path, sea, actuator = loop.controller, loop.path, loop.disturbance, loop.actuator
        constants, of_path = tuple(loop.law_constants(recall)), tuple(loop.path_constants(recall))
        rounded = recall(path.fillet_for_law) is not None
        take = sample_of_rounded(law.sample) if rounded and law.takes_samples() else law.sample
        yield "path", path.evaluate, of_path
        yield "locate", *_if(path.follows, lambda: path.locate, of_path)
        loads = tuple(recall(sea.constants_with, loop.vessel))
        yield "disturbance", sea.kernel_with(loop.vessel), loads
        yield "law", law_of_rounded(law.law) if rounded else law.law, constants
        yield "sample", *_if(law.takes_samples(), lambda: take, constants)
        yield "actuator", actuator.drive_with(), tuple(recall(actuator.constants))
        told = law.wants_loads()
        yield "after_saturation", *_if(told, lambda: law.after_saturation, constants)
        yield from self._seeing()
        yield "observer", self.observer.watch, tuple(recall(self.observer.constants_for, loop))

    def _seeing(self) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
        """What `functions` has of measurement and estimator."""
        loop, recall = self.loop, self.recall
        measurement, estimator = loop.measurement, loop.estimator
        sense, correct, follow = (
            (measurement.sense, estimator.correct, estimator.follow)
            if loop.measured
            else (nothing, nothing, nothing)
        )
        yield "measurement", sense, tuple(recall(measurement.constants_with, 1.0, 0))
        constants = tuple(recall(estimator.constants_with, loop.nominal))
        yield "correct", correct, constants
        yield "follow", follow, constants

    @np.errstate(all="ignore")
    def vectors(self, rows: int = 1, allocate: Allocate = np.empty) -> Vectors:
        """The loop's vectors, ready for the march to begin, with room for so many logged rows.

        Numbers beyond all limits are for the run to tell.
        """
        loop, grid, layout, recall = self.loop, self.grid, self.layout, self.recall
        law, path, sea, actuator = loop.controller, loop.path, loop.disturbance, loop.actuator
        measurement, estimator, start = loop.measurement, loop.estimator, np.array(loop.start)
        motion = self._of_sea(WAVE_MOTION[0])

        def numbers(constants: Callable[..., dict[str, float]], *given: Any) -> Vector:
            return _numbers(recall(constants, *given))

        return Vectors(
            path=_numbers(loop.path_constants(recall)), path_table=recall(path.table),
            disturbance=numbers(sea.constants_with, loop.vessel),
            disturbance_table=recall(sea.table_for, loop.vessel, grid.steps * grid.step),
            law=_numbers(loop.law_constants(recall)), law_table=loop.law_table(recall),
            actuator=numbers(actuator.constants), actuator_table=recall(actuator.table),
            measurement=numbers(measurement.constants_with, grid.step, motion),
            measurement_table=recall(measurement.table_for, grid.step, grid.steps),
            estimator=numbers(estimator.constants_with, loop.nominal),
            estimator_table=recall(estimator.table), vessel=numbers(loop.vessel.constants),
            observer=numbers(self.observer.constants_for, loop),
            s=np.concatenate(
                [start, recall(actuator.rest),
                 estimator.start(start, loop.nominal) if loop.measured else np.zeros(0),
                 np.zeros(len(path.places)), loop.first_memory(recall)]
            ),
            row=np.zeros(layout.columns), stages=np.zeros(5 * layout.states),
            sensed=measurement.first(start, grid.step),
            relay=relay(actuator.delay(), grid), held=np.zeros(HELD_SIGNALS + len(law.signals)),
            work=np.zeros(law.workspace()), seen=np.zeros(self.observer.size),
            under_way=np.zeros(2), log=allocate(rows * layout.width),
        )  # fmt: skip


def _names(signals: tuple[Signal, ...]) -> list[str]:
    return [one.name for one in signals]


def _offsets(parts: Mapping[str, list[str]]) -> dict[str, int]:
    """Where each part begins, and the `end` of all."""
    return dict(zip((*parts, "end"), accumulate(map(len, parts.values()), initial=0), strict=True))


def _if(there: bool, kernel: Callable[[], Any], constants: tuple[str, ...]) -> tuple[Any, ...]:
    """A part that some loops have. What does nothing reads nothing: its code is one for all."""
    return (kernel(), constants) if there else (nothing, ())


def _numbers(constants: Mapping[str, float]) -> Vector:
    return np.array(list(constants.values()) or [0.0])


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
