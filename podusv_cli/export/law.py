"""The law of a scenario by itself: its code, its numbers, and what goes in and comes out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from ctypes import CFUNCTYPE, POINTER
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.components.controllers.base import Slots
from podusv_cli.components.paths.base import TARGET
from podusv_cli.components.paths.fillet import round_corner
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import HEADING, LOOP, PSI_D, STATE, SWAY_DEMAND, TARGET_SIZE, Signal
from podusv_cli.engine.loop.closed_loop import DEMAND, ClosedLoop, nothing
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.machine.compile import Piece, adapter, routine
from podusv_cli.engine.step import law_alone
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import Layout, Vectors
from podusv_cli.scenario.model import Scenario

# What a part of the loop is called in the object file
PARTS = {
    "path": "podusv_target",
    "law": "podusv_law_rates",
    "sample": "podusv_law_sample",
    "after_saturation": "podusv_law_loads",
}
STEP = "podusv_law_demand"
PROTOTYPE = CFUNCTYPE(
    None,
    *(signatures.PROTOTYPES[part] for part in PARTS),
    signatures.WHOLE,
    signatures.NUMBER,
    POINTER(signatures.VECTOR),
    POINTER(signatures.WHOLE),
)
NOT_SAMPLED = (
    "the law acts continuously in this scenario, and a computer on a boat takes samples; set "
    "control.period to the time between two of them, as --set control.period=0.1 [s]"
)
NO_LOAD = (
    "the law takes the load that an estimator finds, and what is exported has no input for it; "
    "set its `load` to unknown"
)
OWN_TIME = (
    "the law reads its path at a time of its own, and what is exported is told its target; choose "
    "a law of a timetable, as pose_backstepping"
)
NO_LAW = "the controller gives recorded commands to propellers, which is no law; export a law"


class ExportedNumber(NamedTuple):
    """A number that goes in or comes out: its name, unit and meaning."""

    name: str
    unit: str
    meaning: str


def _number(signal: Signal) -> ExportedNumber:
    """A signal as the files of an export name it."""
    return ExportedNumber(signal.name, signal.unit, signal.meaning)


_LOGGED = {signal.name: _number(signal) for signal in LOOP}
_MOTION = (("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s2"))
POSITION_NUMBERS = tuple(
    ExportedNumber(name, unit, f"{what} of the target, {way}")
    for name, ((what, unit), way) in zip(TARGET, product(_MOTION, ("north", "east")), strict=True)
)
STATE_NUMBERS = tuple(map(_number, STATE))
HEADING_NUMBERS = tuple(map(_number, HEADING))
DEMAND_NUMBERS = tuple(_LOGGED[name] for name in DEMAND)
LOAD_NUMBERS = tuple(
    ExportedNumber(name, unit, f"{what} that acted since the sample before")
    for name, unit, what in zip(
        ("tau_u", "tau_v", "tau_r"),
        ("N", "N", "N m"),
        ("surge force", "sway force", "yaw moment"),
        strict=True,
    )
)


def demand_numbers(loop: ClosedLoop) -> tuple[ExportedNumber, ...]:
    """What the loop's law asks for, in the order in which it writes it."""
    sway = (_number(SWAY_DEMAND),) if loop.controller.asks_sway() else ()
    return (*DEMAND_NUMBERS, *sway)


@dataclass(frozen=True, eq=False)
class ExportedLaw:
    """A sampled law as values: a state (x, memory), a row (target, distance, signals, demand, tau).

    Behind the distance is the target's heading, for a law that reads one. `vectors` are at the
    start of the scenario's run, which logs every step.
    """

    scenario: Scenario
    plan: Plan
    layout: Layout
    vectors: Vectors

    @classmethod
    def of(cls, scenario: Scenario) -> ExportedLaw:
        """The law of a scenario with one. Raises UsageError for a law that cannot stand alone."""
        # Samples are read out of the log, which therefore has every step
        every = scenario.log.model_copy(update={"every": 1})
        scenario = scenario.model_copy(update={"log": every})
        plan = scenario.plan()
        if scenario.controller.commands():
            raise UsageError(f"{scenario.name}: {NO_LAW}")
        if not plan.grid.hold_every:
            raise UsageError(f"{scenario.name}: {NOT_SAMPLED}")
        if scenario.controller.wants_load_estimate():
            raise UsageError(f"{scenario.name}: {NO_LOAD}")
        if scenario.controller.keeps_path_time():
            raise UsageError(f"{scenario.name}: {OWN_TIME}")
        whole, signals = plan.layout, len(plan.loop.controller.signals)
        memory, demands = whole.states - whole.memory, len(demand_numbers(plan.loop))
        # The row: target with a place for the distance, signals, demand, loads; then what is shown
        target = TARGET_SIZE if plan.loop.controller.wants_heading() else len(TARGET)
        first = max(target, PSI_D)
        end = first + signals + demands + len(LOAD_NUMBERS)
        layout = Layout(**dict.fromkeys(Layout._fields, 0))._replace(
            states=len(STATE) + memory,
            memory=len(STATE),
            place=len(STATE) + memory,
            target=target,
            signals=first,
            demand=first + signals,
            tau=first + signals + demands,
            columns=end + len(plan.row["shown"]),
            shown=end if whole.shown else 0,
            hold_every=whole.hold_every,
            sample_every=whole.sample_every,
            update_first=whole.update_first,
            wants_loads=whole.wants_loads,
        )
        vectors = plan.vectors()._replace(
            s=np.concatenate([np.zeros(len(STATE)), plan.first_memory]),
            row=np.zeros(layout.columns),
            stages=np.zeros(5 * layout.states),
        )
        return cls(scenario, plan, layout, vectors)

    @property
    def loop(self) -> ClosedLoop:
        """The parts of the scenario's run."""
        return self.plan.loop

    @property
    def grid(self) -> TimeGrid:
        """The instants of the scenario's run."""
        return self.plan.grid

    @property
    def period(self) -> float:
        """Time between two samples [s]."""
        return self.layout.hold_every * self.grid.step

    @cached_property
    def pieces(self) -> Mapping[str, Piece]:
        """The kernels by the name of their C function."""
        parts = {part: (part, inner, names) for part, inner, names in self._entries()}
        adapters = {PARTS[part]: adapter(*parts[part]) for part in PARTS}
        return {**adapters, STEP: Piece(law_alone.demand, PROTOTYPE)}

    def _entries(self) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
        """Part, kernel and names of constants of all that the exported step calls."""
        path, *others = self.plan.functions
        yield from others
        if self.layout.shown:
            yield "path", round_corner, path.constants
        else:  # the row has the target already
            yield "path", nothing, ()

    @property
    def _given_state(self) -> tuple[Signal, ...]:
        """The state that the law is given: the vessel's own, or the estimate."""
        return self.loop.estimate_signals()[: len(STATE)] or STATE

    @property
    def _slots(self) -> Slots:
        """The parts of the law's memory."""
        return self.loop.controller.slots()

    @property
    def limits(self) -> tuple[float, ...]:
        """At which the scenario's actuator cuts each number of the demand [N, N m, N]."""
        return self.loop.actuator.limits()[: len(self.demands)]

    @property
    def targets(self) -> tuple[ExportedNumber, ...]:
        """What the law is given of its target: its motion, and its heading where it reads one."""
        heading = HEADING_NUMBERS if self.loop.controller.wants_heading() else ()
        return (*POSITION_NUMBERS, *heading)

    @property
    def demands(self) -> tuple[ExportedNumber, ...]:
        """What the law asks for: surge force, yaw moment, and sway force where it asks for one."""
        return demand_numbers(self.loop)

    @cached_property
    def signals(self) -> tuple[ExportedNumber, ...]:
        """What the law says beside its demand."""
        return tuple(map(_number, self.loop.controller.signals))

    @cached_property
    def memory(self) -> tuple[ExportedNumber, ...]:
        """Every number that the law remembers, in order."""
        return tuple(
            ExportedNumber(
                number.name if size == 1 else f"{number.name}[{i}]", number.unit, number.meaning
            )
            for number, size in self._slots
            for i in range(size)
        )

    @property
    def columns(self) -> list[str]:
        """What a row of `samples` has."""
        given = (*STATE_NUMBERS, *self.targets, *LOAD_NUMBERS)
        said = (*self.demands, *self.signals, *self.memory)
        return ["time", *(number.name for number in (*given, *said))]

    @property
    def needs_loads(self) -> bool:
        """Whether the law asks for loads that it cannot take from its demand."""
        return self.loop.controller.wants_loads() and not self.loop.actuator.only_cuts

    def as_json(self, platforms: Sequence[str], library: Sequence[str]) -> dict[str, Any]:
        """What law.json says; `library` are functions that the law calls of another library."""
        about = {
            "inputs": (*STATE_NUMBERS, *self.targets, *LOAD_NUMBERS),
            "demand": self.demands,
            "signals": self.signals,
            "memory": self.memory,
        }
        return {
            "format": 1,
            "law": self.loop.controller.label,
            "scenario": self.scenario.name,
            "period": self.period,
            "platforms": list(platforms),
            "library": list(library),
            **{name: [number._asdict() for number in numbers] for name, numbers in about.items()},
        }

    def samples(self, log: Recording) -> Vector:
        """A row for each sample of the run in `log`: time, inputs, demand, signals, memory.

        Shape (samples, columns). The loads of a row are those in the row of the log before: where
        the actuator has no states they do not change between that row and the sample.
        """
        rows = np.arange(0, len(log["time"]), self.layout.hold_every)
        before = np.maximum(rows - 1, 0)
        state = [log[number.name][rows] for number in self._given_state]
        # Before the first sample nothing has acted
        loads = [np.where(rows > 0, log[number.name][before], 0.0) for number in LOAD_NUMBERS]
        said = [log[number.name][rows] for number in (*self.demands, *self.signals)]
        memory = [log[number.name][rows].reshape(len(rows), -1) for number, _ in self._slots]
        time = log["time"][rows]
        return np.column_stack([time, *state, self._targets(log, rows), *loads, *said, *memory])

    def stepper(self) -> Callable[[int, Vector], list[float]]:
        """A function that steps the law in this process as its C files do.

        It takes a sample's number and inputs (inputs,), and returns demand, signals and memory. It
        begins with the memory at t = 0.
        """
        # Copies, as every stepper begins at the start of the run
        c, n = Vectors(*(vector.copy() for vector in self.vectors)), self.layout
        parts = [routine(self.pieces[name]) for name in PARTS.values()]
        step = routine(self.pieces[STEP])
        splits = np.cumsum([len(STATE), len(TARGET), len(self.targets) - len(TARGET)])
        pointers, sizes = signatures.pointers(c), signatures.whole_numbers(n)

        def step_law(sample: int, inputs: Vector) -> list[float]:
            """Demand, signals and memory after sample number `sample`; `inputs` are (inputs,)."""
            state, motion, heading, loads = np.split(inputs, splits)
            c.s[: len(state)], c.row[: len(motion)] = state, motion
            c.row[PSI_D : PSI_D + len(heading)] = heading
            c.row[n.tau : n.tau + len(loads)] = loads
            step(*parts, sample * n.hold_every, self.grid.step, pointers, sizes)
            return [*c.row[n.demand : n.tau], *c.row[n.signals : n.demand], *c.s[n.memory :]]

        return step_law

    def by_itself(self, samples: Vector) -> Vector:
        """These samples (samples, columns) with what comes out of the law by itself."""
        own, step = samples.copy(), self.stepper()
        for sample, (row, given) in enumerate(zip(own, self.inputs(samples), strict=True)):
            row[1 + len(given) :] = step(sample, given)
        return own

    def inputs(self, samples: Vector) -> Vector:
        """What the law is given in each of these samples (samples, columns): (samples, inputs)."""
        return samples[:, 1 : 1 + len(STATE) + len(self.targets) + len(LOAD_NUMBERS)]

    def _targets(self, log: Recording, rows: npt.NDArray[np.int_]) -> Vector:
        """The target (rows, 6 or 9) at these rows of a log; on a followed path where that is."""
        path, out = self.loop.path, np.zeros((len(rows), TARGET_SIZE))
        k, table = bundle(self.plan.path_constants), self.plan.path_table
        for row, target in zip(rows, out, strict=True):
            x = np.array([log[number.name][row] for number in self._given_state])
            place = np.array([log[signal.name][row] for signal in path.places])
            call(
                path.evaluate, t=log["time"][row], x=x, place=place, k=k, table=table, target=target
            )
        return np.delete(out, len(TARGET), axis=1)[:, : len(self.targets)]  # without the distance
