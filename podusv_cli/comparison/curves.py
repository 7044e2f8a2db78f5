"""Numbers and signals of runs, as claims compute with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from podusv_cli.core.about import MetricAbout
from podusv_cli.core.kernel import Vector
from podusv_cli.core.spectrum import periodogram

NEAR = 1e-9  # s; times closer than this are the same


class ClaimedRun(Protocol):
    """What claims ask of a run: of one that is over, or, before there are runs, of an example."""

    @property
    def until(self) -> float:
        """The time up to which the run was simulated [s]."""

    @property
    def every(self) -> int:
        """Steps from one logged instant to the next; 1 where every step is logged."""

    @property
    def ending(self) -> str:
        """Why the run did not reach its end, as `diverged at t = 2 s`; empty where it did."""

    def metric(self, name: str) -> float:
        """A metric; NaN where the run has none of this name."""

    def has(self, name: str) -> bool:
        """Whether the run has a signal of this name, logged or derivable."""

    def signal(self, name: str) -> Vector:
        """A signal that it has."""

    def check(self, name: str) -> bool | None:
        """Whether a named property of the run holds; None where that is unknown."""


class CannotTell(Exception):
    """The runs do not give a number; the text says which one, and why."""


@dataclass(frozen=True)
class Curve:
    """A quantity over time, computed from signals of these runs (by label)."""

    time: Vector
    values: Vector
    runs: Mapping[str, ClaimedRun]

    def at(self, times: Vector) -> Vector:
        """The values at `times` (n,) [s], interpolated where the log has others; shape (n,)."""
        if np.array_equal(self.time[: len(times)], times):
            return self.values[: len(times)]
        return np.asarray(np.interp(times, self.time, self.values))


Quantity = float | Curve


def metric(label: str, run: ClaimedRun, about: MetricAbout) -> float:
    """A metric of a run, infinite where its event never happened; `label` names the run.

    Raises CannotTell.
    """
    name, number = about.name, run.metric(about.name)
    if np.isnan(number):
        if about.happens and not run.ending:
            return np.inf
        undefined = f"this run has none ({about.meaning})"
        raise CannotTell(f"{label}.{name}: {f'{label} {run.ending}' if run.ending else undefined}")
    return number


def signal(label: str, run: ClaimedRun, name: str) -> Curve:
    """A signal of a run as a curve, over the times that it was logged at.

    `label` is the run's in claims. Raises CannotTell where the run has no such signal.
    """
    values = run.signal(name) if run.has(name) else np.empty(0)
    if not len(values):
        raise CannotTell(f"{label}.{name}: {label} {run.ending or 'does not log it'}")
    return Curve(run.signal("time")[: len(values)], values, {label: run})


@np.errstate(all="ignore")
def pointwise(operation: Callable[..., Any], parts: Sequence[Quantity]) -> Quantity:
    """An operation on numbers and curves, at the times that all curves cover.

    A number if all `parts` are numbers, else a curve.
    """
    curves = [part for part in parts if isinstance(part, Curve)]
    times = common_times(curves)
    # numpy divides by 0 without an exception, which Python's own floats raise.
    plain = [part.at(times) if isinstance(part, Curve) else np.float64(part) for part in parts]
    result = operation(*plain)
    runs = {label: run for curve in curves for label, run in curve.runs.items()}
    return Curve(times, np.asarray(result), runs) if curves else float(result)


def common_times(curves: Sequence[Curve]) -> Vector:
    """The first curve's times (n,) [s], as far as all curves go."""
    if not curves or not all(len(curve.time) for curve in curves):
        return np.zeros(0)
    times: Vector = curves[0].time
    return np.asarray(times[times <= min(curve.time[-1] for curve in curves)])


@np.errstate(all="ignore")
def rate(curve: Curve) -> Curve:
    """The derivative of a curve by time: central differences, one-sided at the ends.

    Raises CannotTell where not every step is logged.
    """
    for label, run in curve.runs.items():
        if run.every > 1:
            raise _refuse_thinned_log("rate", label, run)
    several = len(curve.values) > 1
    rates = np.gradient(curve.values, curve.time) if several else curve.values * np.nan
    return Curve(curve.time, rates, curve.runs)


@np.errstate(all="ignore")
def reduce_curve(
    name: str, text: str, curve: Curve, settings: Sequence[float], window: Sequence[float]
) -> float:
    """One number for a curve, over the whole run or a window (start and end [s], or empty).

    `settings` are what the reducer takes besides; `text` names the number in messages. Raises
    CannotTell where a run does not cover the window or did not reach its end. Of a thinned log,
    only the last value is known, if it is logged.
    """
    t, y = curve.time, curve.values
    for label, run in curve.runs.items():
        if run.until < window[1] - NEAR if window else run.ending:
            raise CannotTell(f"{text}: {label} {run.ending or f'ends at {run.until:g} s'}")
        last = name == "final" and not window and abs(t[-1] - run.until) <= NEAR
        if run.every > 1 and not last:
            raise _refuse_thinned_log(text, label, run)
    if window:
        inside = (t >= window[0] - NEAR) & (t <= window[1] + NEAR)
        t, y = t[inside], y[inside]
    if not len(y):
        raise CannotTell(f"{text}: nothing is logged in this window")
    return float(REDUCERS[name](t, y, *settings))


def _refuse_thinned_log(text: str, label: str, run: ClaimedRun) -> CannotTell:
    """Why a claim on a signal cannot be judged where not every step is logged."""
    return CannotTell(
        f"{text}: {label} logs only one step in {run.every}, and the signal is unknown in between; "
        "log every step (log.every: 1), or use a metric, which sees every step"
    )


def rms_above(t: Vector, y: Vector, omega: float) -> float:
    """Rms of all harmonics faster than omega [rad/s]; NaN where there is no spectrum."""
    rates, power = periodogram(t, y)
    return float(np.sqrt(np.sum(power[rates > omega]))) if len(rates) else np.nan


@np.errstate(all="ignore")
def decay(t: Vector, y: Vector) -> float:
    """Rate [1/s] at which |y| falls: the slope of the straight line through ln |y|.

    `t` [s] and `y` are (n,). NaN where y is 0 somewhere.
    """
    return (
        # Centred times, so that the fit is well conditioned.
        -float(np.polyfit(t - t.mean(), np.log(abs(y)), 1)[0]) if len(t) > 1 and y.all() else np.nan
    )


# of times [s] and values, and of settings; a single sample has no variation and no integral
REDUCERS: dict[str, Callable[..., Any]] = {
    "max": lambda t, y: np.max(y),
    "min": lambda t, y: np.min(y),
    "mean": lambda t, y: np.trapezoid(y, t) / (t[-1] - t[0]) if len(t) > 1 else y[0],
    "final": lambda t, y: y[-1],
    "variation": lambda t, y: np.sum(np.abs(np.diff(y))) if len(t) > 1 else np.nan,
    "integral": lambda t, y: np.trapezoid(y, t) if len(t) > 1 else np.nan,
    "rms_above": rms_above,
    "decay": decay,
}
# What stands between the signal and the window; nothing for the others.
SETTINGS = {"rms_above": "an angular frequency in rad/s"}
