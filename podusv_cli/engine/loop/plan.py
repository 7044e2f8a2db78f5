"""A loop on its grid, planned once: what it calls, where everything lies, and what it is named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.pose_law import with_load
from podusv_cli.components.disturbances.base import FLOW, WAVE_MOTION
from podusv_cli.components.paths.base import TARGET, read_at_place
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.core.kernel import call as call_kernel
from podusv_cli.core.recording import Allocate
from podusv_cli.core.signal import TARGET_SIZE, Signal
from podusv_cli.core.steps import whole_steps
from podusv_cli.engine.loop.closed_loop import DEMAND, LOADS, STATE, ClosedLoop, Probe, nothing
from podusv_cli.engine.loop.recent import Recent
from podusv_cli.engine.step.delay_line import delay_line
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import BEFORE, HELD_SIGNALS, Layout, Parts, Vectors

FORCES, SEA = LOADS[:3], LOADS[3:]
SHOWN = tuple(f"{name}, shown" for name in TARGET)  # which no log has
AT_START = (0.0,)  # s


# The component of each function that is no component's only one
OWNERS = {
    "locate": "path",
    "sample": "law",
    "after_saturation": "law",
    "correct": "estimator",
    "follow": "estimator",
}


FOLLOWS = ("states", "row", "layout", "functions")  # from a plan's `outline`


class Function(NamedTuple):
    """What the loop calls as one of its parts, and the names of the constants that it reads."""

    part: str  # a field of `Parts`
    kernel: Any
    constants: tuple[str, ...]

    @property
    def owner(self) -> str:
        """Whose constants these are, as `Plan.constants` and `Vectors` call it."""
        return OWNERS.get(self.part, self.part)


def no_probe(plan: Plan) -> Probe:
    """The probe of a run that nobody sees."""
    return Probe()


@dataclass(frozen=True, eq=False)
class Plan:
    """A loop, a grid, and all that follows from both; made once, and handed down.

    `probe_for` gives the probe of the run. `recall` asks components, and remembers their answers.
    """

    loop: ClosedLoop
    grid: TimeGrid
    probe_for: Callable[[Plan], Probe] = no_probe
    recall: Recent = field(default_factory=Recent)

    @classmethod
    def with_probe(cls, loop: ClosedLoop, grid: TimeGrid, probe: Probe) -> Plan:
        """The plan of a loop with a probe that is there already."""
        return cls(loop, grid, lambda plan: probe)

    def like(self, loop: ClosedLoop) -> Plan:
        """The plan of a loop that differs in numbers only; parts of both are asked once.

        Raises ValueError for a loop of another structure, LawError for parts that do not fit.
        """
        loop.check_fit(self.grid.step)
        plan = Plan(loop, self.grid, lambda plan: self.probe, self.recall)
        # The same objects have the same structure; else the structures themselves are compared
        if plan.outline == self.outline:
            # A frozen value takes no assignment; its cached properties look into this dict first
            vars(plan).update((name, getattr(self, name)) for name in FOLLOWS)
        elif plan.structure != self.structure:
            raise ValueError(
                f"it has another structure than the batch: {_kinds(loop)} with {plan.layout}, "
                f"not {_kinds(self.loop)} with {self.layout}; runs of one batch differ in "
                "numbers only"
            )
        return plan

    @cached_property
    def probe(self) -> Probe:
        """What sees every instant."""
        return self.probe_for(self)

    @cached_property
    def about(self) -> dict[str, Signal]:
        """Every signal that the loop logs, by name. Raises LawError where two have one name."""
        return self.loop.about()

    @property
    def sampled(self) -> bool:
        """Whether old measurements act: with sampled control, with sensors and with a delay."""
        return self.grid.hold_every > 0 or not self.loop.at_once

    @cached_property
    def states(self) -> dict[str, list[str]]:
        """Names of what is integrated, by part in the order of `s`; a vector's once a number."""
        loop = self.loop
        slots = [part.name for part, size in loop.controller.slots() for _ in range(size)]
        return {
            "vessel": [*STATE],
            "actuator": _names(loop.actuator.states),
            "estimator": _names(loop.estimate_signals()),
            "path": _names(loop.path.places),
            "law": slots,
        }

    @cached_property
    def row(self) -> dict[str, list[str]]:
        """Names of what is computed at every instant, by part in the order of the row.

        "shown" has names only for a law that is shown a target with rounded corners.
        """
        loop = self.loop
        return {
            "target": [*TARGET, "z_e", *_names(loop.headings)],
            "law": _names(loop.controller.signals),
            "demand": [*DEMAND, *_names(loop.sway_demand)],
            "forces": [*FORCES],
            "sea": [*SEA, *_names(loop.disturbance.signals)],
            "actuator": _names(loop.actuator.signals_with),
            "measurement": _names(loop.measurement.signals),
            "shown": [*SHOWN] if self.recall(loop.path.fillet_for_law) else [],
        }

    @cached_property
    def names(self) -> list[str]:
        """Names of a logged row's columns: time, states, row."""
        parts = (*self.states.values(), *self.row.values())
        return ["time", *(name for part in parts for name in part)]

    @cached_property
    def layout(self) -> Layout:
        """Sizes and offsets of the loop on this grid. Raises ValueError as `_sample_steps`."""
        loop, grid = self.loop, self.grid
        s, row, flow = _offsets(self.states), _offsets(self.row), self._of_sea(FLOW[0])
        return Layout(
            states=s["end"],
            estimate=s["estimator"] if loop.measured else 0,
            place=s["law" if loop.own_time else "path"],
            memory=s["law"],
            target=TARGET_SIZE if loop.path.heads else len(TARGET),
            shown=row["shown"] if self.row["shown"] else 0,
            signals=row["law"],
            demand=row["demand"],
            tau=row["forces"],
            b=row["sea"],
            flow=row["sea"] + flow if flow and loop.actuator.feels_motion else 0,
            flags=row["actuator"],
            sensed=row["measurement"],
            columns=row["end"],
            steps=grid.steps,
            log_every=grid.log_every,
            hold_every=grid.hold_every,
            sample_every=_sample_steps(loop.controller, grid),
            measured=int(loop.measured),
            update_first=int(grid.update_first),
            follows=int(loop.path.follows or loop.own_time),
            load_of_time=int(loop.disturbance.of_time),
            wants_loads=int(loop.controller.wants_loads()),
            by_delay_line=int(loop.actuator.by_delay_line),
        )

    def _of_sea(self, signal: Signal) -> int:
        """Where a disturbance writes a signal, behind its load; 0 where it does not."""
        own = self.loop.disturbance.signals
        return len(SEA) + own.index(signal) if signal in own else 0

    @cached_property
    def functions(self) -> tuple[Function, ...]:
        """What the loop calls, in the order of `Parts`, in which it takes them."""
        loop, names = self.loop, self.constants
        law, path, seen, estimator = loop.controller, loop.path, loop.measurement, loop.estimator
        kernels = {
            "path": self._target_kernel(),
            "locate": path.locate if path.follows else nothing,
            "disturbance": loop.disturbance.kernel_with(loop.vessel),
            "law": self.law_kernel,
            "sample": law.sample if law.takes_samples() else nothing,
            "actuator": loop.actuator.drive_with(law.commands()),
            "after_saturation": law.after_saturation if law.wants_loads() else nothing,
            "measurement": seen.sense if loop.measured else nothing,
            "correct": estimator.correct if loop.measured else nothing,
            "follow": estimator.follow if loop.measured else nothing,
            "probe": self.probe.watch,
        }
        return tuple(  # what does nothing reads nothing: its code is one for all
            Function(part, inner, () if inner is nothing else tuple(names[OWNERS.get(part, part)]))
            for part, inner in zip(Parts._fields, Parts(**kernels), strict=True)
        )

    @property
    def law_kernel(self) -> Any:
        """What the loop calls as its law: the law, and the loads that it wants fed forward."""
        law, load_at = self.loop.controller, self.loop.load_at
        fed_forward = load_at and law.wants_load_estimate()
        return with_load(law.law, load_at) if fed_forward else law.law

    def _target_kernel(self) -> Any:
        """What writes the target: at the clock's time, or at the law's own."""
        path = self.loop.path
        if self.loop.own_time:
            return read_at_place(path.evaluate)
        return path.evaluate_shown if self.row["shown"] else path.evaluate

    @cached_property
    def outline(self) -> tuple[Any, ...]:
        """Equal outlines mean equal structures, and are compared sooner.

        Parts count by identity, since to compare their fields takes longer; both plans keep theirs
        alive. Of a disturbance, which is often drawn anew, what the structure depends on counts.
        """
        loop, sea = self.loop, self.loop.disturbance
        parts = (loop.path, loop.controller, loop.actuator, loop.measurement, loop.estimator)
        names = [[*constants] for constants in self.constants.values()]
        of_sea = (sea.signals, sea.of_time, sea.kernel_with(loop.vessel))
        return (*map(id, parts), *of_sea, names)

    @property
    def structure(self) -> tuple[Layout, tuple[Function, ...]]:
        """What runs of one batch have in common; they differ in numbers only."""
        return self.layout, self.functions

    @cached_property
    @np.errstate(all="ignore")  # numbers beyond all limits are for the run to tell
    def constants(self) -> dict[str, dict[str, float]]:
        """The constants that the kernels of each part read, by name."""
        loop, recall, step = self.loop, self.recall, self.grid.step
        motion = self._of_sea(WAVE_MOTION[0])
        return {
            "path": self.path_constants,
            "disturbance": recall(loop.disturbance.constants_with, loop.vessel),
            "law": self.law_constants,
            "actuator": recall(loop.actuator.constants_with, loop.controller.commands()),
            "measurement": recall(loop.measurement.constants_with, step, motion),
            "estimator": recall(loop.estimator.constants_with, loop.nominal),
            "vessel": recall(loop.vessel.constants),
            "probe": recall(self.probe.constants_for, loop),
        }

    @property
    def path_constants(self) -> dict[str, float]:
        """The path's constants, for the standoff that this law keeps."""
        approach = self.loop.controller.approach()
        standoff = approach.standoff if approach else 0.0
        constants: dict[str, float] = self.recall(self.loop.path.constants_with, standoff)
        return constants

    @property
    def law_constants(self) -> dict[str, float]:
        """The law's constants, with those of the nominal vessel."""
        constants: dict[str, float] = self.recall(
            self.loop.controller.constants_with, self.loop.nominal
        )
        return constants

    @property
    def path_table(self) -> Vector:
        """The path's table (n,), asked for once."""
        table: Vector = self.recall(self.loop.path.table)
        return table

    @property
    def law_table(self) -> Vector:
        """The law's table (n,), asked for once."""
        table: Vector = self.recall(self.loop.controller.table)
        return table

    @cached_property
    def first_target(self) -> Vector:
        """The target (10,) at t = 0, with places for the distance and a heading.

        Of a path that is followed, for the vessel at its start.
        """
        path = self.loop.path
        if not path.follows:
            return np.asarray(self.recall(path.whole_targets, AT_START)[0])
        x, place = np.array(self.loop.start), np.zeros(len(path.places))
        target = np.zeros(TARGET_SIZE)
        k, table = bundle(self.path_constants), self.path_table
        call_kernel(path.evaluate, t=0.0, x=x, place=place, k=k, table=table, target=target)
        return target

    @cached_property
    @np.errstate(all="ignore")  # a start beyond all numbers is for the run to tell
    def first_memory(self) -> Vector:
        """The law's memory (slots,) at t = 0."""
        loop = self.loop
        return loop.controller.start(np.array(loop.start), self.first_target, loop.nominal)

    @np.errstate(all="ignore")
    def vectors(self, rows: int = 1, allocate: Allocate = np.empty) -> Vectors:
        """The loop's vectors, ready for the march to begin, with room for so many logged rows.

        Each vector is flat, see `Vectors`. `allocate` gives the room for the log. Numbers beyond
        all limits are for the run to tell.
        """
        loop, grid, layout, recall = self.loop, self.grid, self.layout, self.recall
        law, start, estimator = loop.controller, np.array(loop.start), loop.estimator
        sea, end = loop.disturbance, grid.steps * grid.step
        numbers = {part: _numbers(constants) for part, constants in self.constants.items()}
        begun = {
            "vessel": start,
            "actuator": recall(loop.actuator.rest),
            "estimator": estimator.start(start, loop.nominal) if loop.measured else np.zeros(0),
            "path": np.zeros(len(loop.path.places)),
            "law": self.first_memory,
        }
        return Vectors(
            **numbers,
            path_table=self.path_table,
            disturbance_table=recall(sea.table_for, loop.vessel, end),
            law_table=self.law_table.copy(),  # a session writes to it
            actuator_table=recall(loop.actuator.table_with, law.commands()),
            measurement_table=recall(loop.measurement.table_for, grid.step, grid.steps),
            estimator_table=recall(estimator.table),
            s=np.concatenate([begun[part] for part in self.states]),
            row=np.zeros(layout.columns + BEFORE),
            stages=np.zeros(5 * layout.states),
            sensed=loop.measurement.first(start, grid.step),
            delay_line=delay_line(loop.actuator.delay(), grid),
            # The law may read as far into the held state as an estimator's goes; nobody uses what
            # it makes of the numbers behind the first six
            held=np.zeros(HELD_SIGNALS + max(len(law.signals), len(estimator.states))),
            work=np.zeros(law.workspace()),
            seen=self.probe.first(),
            under_way=np.zeros(2),
            log=allocate(rows * layout.width),
        )


def _kinds(loop: ClosedLoop) -> str:
    """The classes of a loop's parts, for messages."""
    parts = (loop.path, loop.disturbance, loop.actuator, loop.controller)
    return ", ".join(type(part).__name__ for part in parts)


def _names(signals: tuple[Signal, ...]) -> list[str]:
    """The names of signals, in order."""
    return [signal.name for signal in signals]


def _offsets(parts: Mapping[str, list[str]]) -> dict[str, int]:
    """Where each part begins, and the `end` of all."""
    return dict(zip((*parts, "end"), accumulate(map(len, parts.values()), initial=0), strict=True))


def _numbers(constants: Mapping[str, float]) -> Vector:
    """Constants as the vector that kernels read; one zero where there are none."""
    return np.array(list(constants.values()) or [0.0])


def _sample_steps(law: Controller, grid: TimeGrid) -> int:
    """How many steps lie between two samples of a law; 0 for one that takes none.

    Raises ValueError for a period that is no whole number of steps, or of the loop's own period.
    """
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
