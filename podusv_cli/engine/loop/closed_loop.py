"""The closed loop as values: its parts, the layout of its vectors, and their contents."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.measurements.base import KNOWN, OWN, Measurement
from podusv_cli.components.measurements.exact import Exact
from podusv_cli.components.paths.base import Path
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core import signal
from podusv_cli.core.component import Component, describe
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import HEADING, LOOP, SWAY_DEMAND, Signal

STATE = tuple(state.name for state in signal.STATE)
DEMAND = tuple(part.name for part in signal.DEMAND)
LOADS = ("tau_u", "tau_v", "tau_r", "b_u", "b_v", "b_r")


@kernel
def nothing() -> None:
    """Stands for a part that a loop does not have: a kernel takes those arguments that it names."""


def passed_by(path: Path, law: Controller, share: float) -> dict[str, float]:
    """Where this share of a path lies behind the vessel, as the path says it.

    Empty where the path has no end, or nobody follows it.
    """
    return path.passed_by(share) if path.follows and law.aims() else {}


def unmet(law: Controller, path: Path, actuator: Actuator, load_at: int) -> list[tuple[str, str]]:
    """What a law wants of path and actuator that they have not: pairs of the part and a sentence.

    `load_at` is where in the state that it is given there are estimated loads; 0 without. Empty
    where all fits.
    """
    texts = []
    if law.asks_sway() and not actuator.takes_sway:
        text = (
            "surge force and yaw moment alone; take ideal_full, saturated_full, or pods that push "
            "every way with sway_weight above 0"
        )
        texts += [
            ("actuator", f"{law.label} asks for a sway force, and {actuator.label} takes {text}")
        ]
    if law.wants_heading() and not path.heads:
        text = (
            f"{law.label} wants a heading, and {path.label} has none; take poses, stations, hold "
            "or ellipse"
        )
        texts += [("path", text)]
    if law.wants_load_estimate() and not load_at:
        text = (
            f"{law.label} wants an estimated load, and nothing finds one; take passive_observer, "
            "or ekf with bias, behind `measurement: {kind: sensors}`"
        )
        texts += [("estimator", text)]
    if law.keeps_path_time() and (path.follows or path.fillet_for_law()):
        text = f"{law.label} goes along a timetable without rounded corners, and {path.label} is"
        texts += [("path", f"{text} another path; take poses, hold or ellipse")]
    if law.wants_path_speed() and path.rests:
        text = f"{law.label} has a speed of its own, and {path.label} stands still at its poses"
        texts += [("path", f"{text}; leave controller.speed at 0, or take ellipse")]
    if law.keeps_path_time() and not law.slots():
        text = "and has no memory for it; give slots() a signal of one number first"
        texts += [("controller", f"{law.label} keeps the path's time {text}")]
    return texts


@dataclass(frozen=True)
class Probe:
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

    def first(self) -> Vector:
        """What is gathered before the first instant (size,)."""
        return np.zeros(self.size)

    def summary(
        self, seen: Vector, failed: Callable[[str, Exception], None] | None = None
    ) -> dict[str, float]:
        """What these gathered numbers say of a run, by name; `failed` is told what raises."""
        return {}


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
    def parts(self) -> dict[str, Component]:
        """Those that kernels belong to, as `Plan.constants` calls them."""
        return {
            "path": self.path,
            "disturbance": self.disturbance,
            "law": self.controller,
            "actuator": self.actuator,
            "measurement": self.measurement,
            "estimator": self.estimator,
        }

    @property
    def measured(self) -> bool:
        """Whether the law is given an estimate from measurements, and not the state itself."""
        return not self.measurement.is_exact

    @property
    def at_once(self) -> bool:
        """Whether the true state acts on the actuator through the law without delay."""
        return not self.measured and self.actuator.delay() == 0.0

    @property
    def load_at(self) -> int:
        """Where in the state that the law is given there are estimated loads; 0 without."""
        return self.estimator.load_at if self.measured else 0

    @property
    def sway_demand(self) -> tuple[Signal, ...]:
        """The demand behind surge and yaw; none for an actuator that makes no sway force."""
        return (SWAY_DEMAND,) if self.actuator.takes_sway else ()

    @property
    def headings(self) -> tuple[Signal, ...]:
        """The heading that the path asks for, with its rates; none of a path without one."""
        return HEADING if self.path.heads else ()

    @property
    def own_time(self) -> bool:
        """Whether the law says at which time its path is read, see `Controller.keeps_path_time`."""
        return self.controller.keeps_path_time()

    @property
    def has_target(self) -> bool:
        """Whether the distance to the target says how good the law is."""
        return self.controller.aims() and not self.path.goes_beside

    def passed_by(self, share: float) -> dict[str, float]:
        """Where this share of the path lies behind the vessel, see `passed_by`."""
        return passed_by(self.path, self.controller, share)

    def lyapunov(self) -> Any:
        """The law where (46) is its Lyapunov function; None where it sees another target."""
        other = self.path.follows or self.path.fillet_for_law()
        return None if other else self.controller.lyapunov()

    def check_seeing(self) -> None:
        """Raises LawError for a measurement or an estimator that is not what it declares.

        In compiled code it would write beyond its vectors.
        """
        if not self.measured:
            return
        measurement, start = self.measurement, np.array(self.start)
        # Its marks do not depend on the step, so any will do: 1 s
        known, first = measurement.measured(), measurement.first(start, 1.0)
        marks = first[KNOWN:OWN].tolist() == [float(flag) for flag in known]
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
        """Raises LawError for parts that do not fit each other, the vessel or the step [s].

        Scenarios are checked when they are loaded; this is for loops that are put together.
        """
        self.check_seeing()
        parts = {
            "disturbance": self.disturbance.conflicts(self.vessel, step),
            "measurement": self.measurement.conflicts(step),
        }
        texts = [f"{part}.{key}: {text}" for part, faults in parts.items() for key, text in faults]
        wanted = unmet(self.controller, self.path, self.actuator, self.load_at)
        texts += [f"{part}: {text}" for part, text in wanted]
        if lacking := self.estimator.lacking(self.measurement.measured()):
            texts.append(f"estimator: {lacking}")
        if texts:
            raise LawError("; ".join(texts))

    def estimate_signals(self) -> tuple[Signal, ...]:
        """The estimator's states; none where the law is given the state itself."""
        return self.estimator.states if self.measured else ()

    def about(self) -> dict[str, Signal]:
        """Every signal that the loop logs, by name. Raises LawError where two have one name.

        Parts are paired with functions that describe them, since describing looks up their source.
        """
        self.check_seeing()
        law, actuator = self.controller, self.actuator
        own = (partial(describe, actuator), (*actuator.states, *actuator.signals_with))
        path = (partial(describe, self.path), (*self.path.places, *self.headings))
        # Without a target the distance to it says nothing, and is not logged
        common = [logged for logged in LOOP if self.has_target or logged.name != "z_e"]
        loop = (lambda: "the closed loop", [*common, *self.sway_demand])
        others = (
            *((partial(describe, part), signals) for part, signals in self.disturbance.told()),
            (partial(describe, self.measurement), self.measurement.signals),
            (partial(describe, self.estimator), self.estimate_signals()),
        )
        return signal.by_name((loop, path, (partial(describe, law), law.declared()), own, *others))
