"""Findings about how a run went, whatever its law: limited, lost, never there, or swinging."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.finding import Mask, Sentences, after, rows_where, times_of
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.scenario.model import Scenario

LONG = 0.02  # fraction of the run; shorter saturation is no finding
VISIBLE = 0.01  # hull lengths; a smaller swing is no finding
PERIODS = 3  # fewer of them in the steady window do not show that a swing goes on
PURE = 0.5  # share of a swing's variance at one frequency
DECAY = 0.95  # of the amplitude from one half of the window to the other; less is dying away
NEARING = 0.98  # of the error from one half of the window to the other; more is no approach
FORCED = 0.1  # share of a load's variance at that frequency, which then drives the swing


@after(
    "saturated", about="actuator",
    meaning=f"the actuator limits the law for over {LONG:.0%} of the run",
    condition=f"limited during more than {LONG:.0%} of the run",
    remedy="switch anti-windup on where it is off, or take smaller gains or a stronger actuator",
)  # fmt: skip
def saturated(scenario: Scenario, log: Recording) -> Sentences:
    """The actuator limits the law during a considerable part of the run."""
    if "saturated" not in log:
        return
    limited = rows_where(log, lambda part: part["saturated"] > 0.5)
    fraction = float(limited.mean())
    if fraction > LONG:
        yield (
            f"the actuator limits the law during {fraction:.1%} of the run, "
            f"{times_of(log, limited)}; {_windup(scenario)}"
        )


def _windup(scenario: Scenario) -> str:
    law, switching = scenario.controller, _switching(scenario)
    if switching:
        return (
            f"{' and '.join(switching)} can make the demand swing from limit to limit, which "
            "anti-windup does not mend; compare a run without, or take smaller gains"
        )
    if not law.slots():
        return "the law has no memory that could wind up"
    if law.wants_loads():
        return "the law is told the loads that act, so its memory does not wind up"
    return f"while limited, the law's adaptation and integrators wind up; {law.against_windup}"


def _switching(scenario: Scenario) -> list[str]:
    """What makes a demand swing that is not limited for long otherwise."""
    delay, period = scenario.actuator.delay(), scenario.control.period
    return [
        *([f"a command delay of {delay:g} s"] if delay else []),
        *([] if scenario.measurement.is_exact else ["sensors with noise and delay"]),
        *([f"a control period of {period:g} s"] if period else []),
    ]


@after(
    "moves-away", about="controller", meaning="the vessel ends further away than it started",
    condition="the mean distance over the steady window exceeds that at the start by a hull length",
    remedy="check signs and units of the law and of the nominal vessel",
)  # fmt: skip
def moves_away(scenario: Scenario, log: Recording) -> Sentences:
    """The law does not track: the distance to the target has grown over the run."""
    late = rows_where(log, lambda part: part["time"] >= scenario.steady_from())
    if not late.any() or scenario.controller.trial():
        return
    start, end = float(log["z_e"][0]), float(log["z_e"][late].mean())
    if end > start + scenario.vessel.length:
        yield (
            f"the vessel starts {start:.3g} m from the target and is {end:.3g} m away from it at "
            f"the end (mean over the steady window): {scenario.controller.label} does not track; "
            "check signs and units of the law and of what it is told about the vessel"
        )


@after(
    "never-settles", about="controller", meaning="the vessel is not at its target at the end",
    condition="the mean of |z_e - standoff| over the steady window exceeds metrics.settling_radius",
    remedy="simulate longer where it still comes nearer; else larger gains or integral action",
)  # fmt: skip
def never_settles(scenario: Scenario, log: Recording) -> Sentences:
    """The run ends without having come to its target; `moves-away` says so of a worse one."""
    late = rows_where(log, lambda part: part["time"] >= scenario.steady_from())
    if log.status != "finished" or not late.any() or any(moves_away.search(scenario, log)):
        return
    approach, radius = scenario.controller.approach(), scenario.metrics.settling_radius
    standoff = approach.standoff if approach else 0.0
    errors = np.abs(log["z_e"][late] - standoff)
    error, half = float(errors.mean()), len(errors) // 2
    if not scenario.at_target(error):
        place = f"its standoff of {standoff:g} m" if standoff else "its target"
        nearing = half and errors[half:].mean() < NEARING * errors[:half].mean()
        remedy = "simulate longer" if nearing else "take larger gains, or add integral action"
        yield (
            f"the vessel is {error:.3g} m away from {place} over the steady window, more than the "
            f"settling radius of {radius:g} m, and {'still comes' if nearing else 'does not come'} "
            f"nearer in it, so no table ranks the run; {remedy}, or raise metrics.settling_radius"
        )


@after(
    "limit-cycle", about="controller", meaning="the vessel swings about its target for ever",
    condition=f"{PERIODS} periods or more of a swing above {VISIBLE:.0%} of a hull length in the "
    "steady window, which neither dies away nor follows a load",
    remedy="take smaller gains; see whether a delay, a limit or the hull's sway drives it",
)  # fmt: skip
def limit_cycle(scenario: Scenario, log: Recording) -> Sentences:
    """The distance along or across the target's course swings at one frequency, and goes on.

    A swing of a load, or of the target's motion, at the same frequency explains it.
    """
    late = log["time"] >= scenario.steady_from()
    if log.status != "finished" or late.sum() < 8 * PERIODS or scenario.controller.trial():
        return
    x, y, time = (log[name][late] for name in ("x", "y", "time"))
    along, across = _beside(x - log["x_d"][late], y - log["y_d"][late], _course(log, late))
    name, swing = max((("along", along), ("across", across)), key=lambda part: part[1].std())
    share, at = _peak(swing)
    half = len(swing) // 2
    earlier, size = (0.5 * float(np.ptp(part)) for part in (swing[:half], swing[half:]))
    drives = [log[load][late] for load in ("b_u", "b_v", "b_r")] + [_course(log, late)]
    goes_on = share >= PURE and at >= PERIODS and size >= DECAY * earlier
    visible = size >= VISIBLE * scenario.vessel.length
    if not (goes_on and visible) or any(_share(one, at) > FORCED for one in drives):
        return
    crossings = time[np.flatnonzero(np.diff(np.signbit(swing)))]
    period = 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    yield (
        f"the vessel swings {name} the target's course with an amplitude of {size:.3g} m and "
        f"a period of {period:.3g} s over the whole steady window, and no load has that period: a "
        "limit cycle; take smaller gains, and see whether a delay, a limit or the hull's sway "
        "drives it"
    )


def _course(log: Recording, rows: Mask) -> Vector:
    """The target's course [rad] in these rows, without jumps by a turn; 0 where it stands still."""
    x, y = np.gradient(log["x_d"][rows]), np.gradient(log["y_d"][rows])
    return np.unwrap(np.arctan2(y, x))


def _beside(x: Vector, y: Vector, course: Vector) -> tuple[Vector, Vector]:
    """A distance in the earth's frame as along and across a course, each less its mean."""
    cosine, sine = np.cos(course), np.sin(course)
    along, across = x * cosine + y * sine, y * cosine - x * sine
    return along - along.mean(), across - across.mean()


def _peak(numbers: Vector) -> tuple[float, int]:
    """The share of the variance at the strongest frequency, and that as periods of the window."""
    at = int(np.argmax(_spectrum(numbers)))
    return _share(numbers, at), at


def _share(numbers: Vector, at: int) -> float:
    """The share of the variance within two bins of a frequency; 0 for a constant."""
    power = _spectrum(numbers - numbers.mean())
    whole = float(power.sum())
    return float(power[max(0, at - 2) : at + 3].sum()) / whole if whole > 0.0 else 0.0


def _spectrum(numbers: Vector) -> Vector:
    """The power at whole numbers of periods of the window, seen through a Hann window."""
    return np.abs(np.fft.rfft(numbers * np.hanning(len(numbers)))) ** 2
