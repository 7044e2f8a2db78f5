"""A measurement for tests of estimators, and a vessel that moves while it is measured."""

from typing import Any, Literal

import numpy as np
from conftest import NONLINEAR, Constant, adrift, run

from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.estimators.base import ESTIMATE, Estimator
from podusv_cli.components.measurements.base import FRESH, Measurement
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, bundle, kernel
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal

STATE = ("x", "y", "psi", "u", "v", "r")
MEASURED = tuple(Signal(f"{name}_m", "", "measured") for name in STATE)
ESTIMATED = tuple(part.name for part in ESTIMATE)


class Taken(Measurement):
    """Everything at one rate, with white noise and one wave; nothing within an outage."""

    kind: Literal["taken"] = "taken"
    every: int = value(1, "", "steps between two deliveries")
    velocities: bool = value(False, "", "whether u, v, r are measured")
    sigma_p: float = value(0.0, "m", "noise of x and y")
    sigma_psi: float = value(0.0, "rad", "noise of psi")
    sigma_nu: float = value(0.0, "m/s or rad/s", "noise of u, v, r")
    swell: float = value(0.0, "m and rad", "amplitude of a wave in x, y, psi")
    omega: float = value(6.0, "rad/s", "its frequency")
    gone: float = value(1e9, "s", "when an outage begins")
    back: float = value(1e9, "s", "when it ends")
    turns: float = value(0.0, "", "whole turns that are added to psi as measured")

    def measured(self) -> tuple[bool, ...]:
        return (True,) * 3 + (self.velocities,) * 3

    @property
    def signals(self) -> tuple[Signal, ...]:
        return MEASURED if self.velocities else MEASURED[:3]

    def table_for(self, step: float, steps: int) -> Vector:
        sigma = [self.sigma_p] * 2 + [self.sigma_psi] + [self.sigma_nu] * 3
        noise = np.random.default_rng(1).normal(size=(steps + 1, 6)) * sigma
        wave = self.swell * np.sin(self.omega * step * np.arange(steps + 1))
        noise[:, :3] += np.outer(wave, [1.0, 0.7, 0.3])
        noise[:, 2] += 2.0 * np.pi * self.turns
        return noise.ravel()

    @staticmethod
    @kernel
    def sense(
        t: float, instant: float, x: Vector, b: Vector, k: Any, table: Vector, seen: Vector
    ) -> None:
        now = int(instant)
        due = now % int(k.every) == 0 and not k.gone < t < k.back
        for i in range(6):
            fresh = due and (i < 3 or k.velocities != 0.0)
            seen[FRESH + i] = 1.0 if fresh else 0.0
            if fresh:
                seen[i] = x[i] + table[6 * now + i]


class Steady(Disturbance):
    """A constant load whose direction over ground does not change."""

    kind: Literal["steady"] = "steady"
    north: float = value(0.6, "N", "force north")
    east: float = value(-0.4, "N", "force east")
    moment: float = value(0.1, "N m", "moment")

    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        cosine, sine = cos_sin(x[2])
        b[0] = cosine * k.north + sine * k.east
        b[1] = cosine * k.east - sine * k.north
        b[2] = k.moment


def sailed(
    estimator: Estimator, measurement: Taken, duration: float, step: float = 0.02, **parts: Any
) -> Recording:
    """A run under a constant demand, which the estimator only watches."""
    compiled = parts.pop("compiled", True)
    moving: dict[str, Any] = {
        "controller": Constant(surge=1.5, yaw=0.3),
        "disturbance": Calm(),
        "start": (0.0, 0.0, 3.0, 0.3, 0.0, 0.1),
        "vessel": NONLINEAR,
    }
    loop = adrift(**moving | parts, measurement=measurement, estimator=estimator)
    return run(loop, duration, step, compiled=compiled)


def errors(out: Recording) -> Vector:
    """Estimate less truth, shape (rows, 6)."""
    pairs = zip(ESTIMATED, STATE, strict=True)
    return np.stack([out[est] - out[true] for est, true in pairs], axis=1)


def delivered(estimator: Estimator, x: Vector, values: Vector) -> tuple[Vector, Vector, Any]:
    """`seen`, state and constants of an estimator that starts at x and is given all `values`."""
    seen = np.concatenate([values, np.ones(12)])
    return seen, estimator.start(x, NONLINEAR), bundle(estimator.constants_with(NONLINEAR))
