"""Findings about how a run went, whatever its law: limited, lost, or never there."""

from __future__ import annotations

import numpy as np

from podusv_cli.components.estimators.base import mean_squared_innovation
from podusv_cli.core.finding import Sentences, rows_where, times_of, warn_after_run
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording, blocks
from podusv_cli.findings.sea import SENSORS
from podusv_cli.findings.span import counted_rows, steady_rows
from podusv_cli.scenario.model import Scenario

PLACES = {
    "speed": ("speed", "m/s"),
    "drift": ("drift angle", "rad"),
    "yaw_rate": ("yaw rate", "rad/s"),
}
LONG = 0.02  # fraction of the run; shorter saturation is no finding
DOUBTFUL, TIMID, CHANCE = 2.0, 0.1, 1e-3  # NIS, and its probability; podusv's choice
REVERSALS = 3  # of a zig-zag with two overshoots


@warn_after_run(
    "saturated",
    about="actuator",
    meaning=f"the actuator limits the law for over {LONG:.0%} of the run",
    condition=f"limited during more than {LONG:.0%} of the run; of its steady window where the "
    "law's memory does not wind up, as an approach or a turn at the limits is then over for good",
    remedy="switch anti-windup on where it is off, or take smaller gains or a stronger actuator",
)
def warn_of_saturation(scenario: Scenario, log: Recording) -> Sentences:
    """The actuator limits the law for long, where that lasts or leaves something behind."""
    if "saturated" not in log:
        return
    law = scenario.controller
    # A law that knows the loads that act keeps its memory from winding up.
    winds_up = bool(law.slots()) and not law.wants_loads()
    whole = winds_up or log.status != "finished"
    rows, span = (counted_rows, "run") if whole else (steady_rows, "steady window")
    counted = rows(scenario, log)
    limited = counted & rows_where(log, lambda part: part["saturated"] > 0.5)
    share = limited.sum() / max(counted.sum(), 1)
    if share > LONG:
        yield (
            f"the actuator limits the law during {share:.1%} of the {span}, "
            f"{times_of(log, limited)}; {_windup(scenario)}"
        )


def _windup(scenario: Scenario) -> str:
    """What to do about a demand at its limits, as the end of a sentence.

    It depends on whether the law has a memory that winds up.
    """
    law, switching = scenario.controller, _switching(scenario)
    if switching:
        return (
            f"{' and '.join(switching)} can make the demand swing from limit to limit, which "
            "anti-windup does not mend; compare a run without, or take smaller gains"
        )
    if not law.slots():
        return "the law has no memory that could wind up; take smaller gains or a stronger actuator"
    if law.wants_loads():
        return (
            "the law knows the loads that act, so its memory does not wind up; take smaller "
            "gains or a stronger actuator"
        )
    return f"while limited, the law's adaptation and integrators wind up; {law.against_windup}"


def _switching(scenario: Scenario) -> list[str]:
    """What can make a demand swing from limit to limit: delay, noise, a control period."""
    delay, period = scenario.actuator.delay(), scenario.control.period
    return [
        *([f"a command delay of {delay:g} s"] if delay else []),
        *([] if scenario.measurement.is_exact else ["sensors with noise and delay"]),
        *([f"a control period of {period:g} s"] if period else []),
    ]


@warn_after_run(
    "outside-envelope",
    about="vessel",
    meaning="the hull leaves what its numbers hold for",
    condition=f"for over {LONG:.0%} of the run the speed, the drift angle or the yaw rate through "
    "the water exceeds vessel.envelope",
    remedy="ask for less speed or turn, or take a vessel that was measured there",
)
def outside_envelope(scenario: Scenario, log: Recording) -> Sentences:
    """The run is an extrapolation of what was measured, or fitted, of the hull."""
    envelope = scenario.vessel.envelope
    if envelope is None or not len(log["u"]):
        return
    sideways = scenario.controller.asks_sway()  # on purpose, at any drift angle
    remedy = "" if sideways else "ask for less speed or turn, or "
    parts = [envelope.shares(*_through_water(log.part(rows))) for rows in blocks(len(log["u"]))]
    for name, (word, unit) in PLACES.items():
        share, limit = np.concatenate([part[name] for part in parts]), getattr(envelope, name)
        outside = share > 1.0
        if outside.mean() > LONG:
            yield (
                f"the hull's numbers hold for a {word} of up to {limit:g} {unit}, and this run has "
                f"{np.nanmax(share) * limit:.3g} {unit}, beyond the limit "
                f"{times_of(log, outside)}; {remedy}take a vessel that was measured there"
            )


def _through_water(log: Recording) -> tuple[Vector, Vector, Vector]:
    """u, v [m/s] and r [rad/s] of the hull relative to the water around it; each (rows,)."""
    u, v = log["u"], log["v"]
    if "V_c" in log:
        # The current V_c [m/s] runs towards beta_c [rad]; here are its components along u and v.
        u = u - log["V_c"] * np.cos(log["beta_c"] - log["psi"])
        v = v - log["V_c"] * np.sin(log["beta_c"] - log["psi"])
    return u, v, log["r"]


@warn_after_run(
    "inconsistent-filter",
    about="estimator",
    meaning="innovations are not as large as the filter believes",
    condition="over the steady window the mean squared innovation over its variance (NIS) of a "
    f"sensor exceeds {DOUBTFUL:g} or is below {TIMID:g}, 1 is consistent, and is so by chance less "
    f"than once in {1.0 / CHANCE:.0f} runs (chi-squared with as many degrees as values)",
    remedy="give the filter the noise that sensors have, with what waves add to it",
)
def inconsistent_filter(scenario: Scenario, log: Recording) -> Sentences:
    """The estimator's own measure of a sensor's noise says that its number is wrong."""
    late = np.flatnonzero(steady_rows(scenario, log))
    if "nis_sum" not in log or not late.size:
        return
    from scipy.special import chdtr, chdtrc  # slow to import

    # Both are sums since the start: the window's share is last less first.
    squares, counts = (
        np.ptp(log[name][late[[0, -1]]], axis=0) for name in ("nis_sum", "nis_count")
    )
    for sensor, places in SENSORS.items():
        square, count = squares[places].sum(), counts[places].sum()
        nis = mean_squared_innovation(squares[places], counts[places])
        told = (
            f"innovations of the {sensor} are {np.sqrt(nis):.2g} times what it believes (NIS "
            f"{nis:.3g} of {count:.0f} values)"
        )
        if nis > DOUBTFUL and chdtrc(count, square) < CHANCE:
            yield (
                f"{told}: noise is larger than its sigma, which has to count waves too, or the "
                "hull moves otherwise than it predicts; give it a larger sigma first, and a larger "
                "q only where the filter knows another hull"
            )
        if nis < TIMID and chdtr(count, square) < CHANCE:
            yield (
                f"{told}, so it takes good measurements for noise; give it the sensor's noise, and "
                "smaller q where it has that"
            )


@warn_after_run(
    "moves-away",
    about="controller",
    meaning="the vessel ends further away than it started",
    condition="the mean distance over the steady window exceeds that at the start by a hull length",
    remedy="check signs and units of the law and of the nominal vessel, or take larger gains",
    needs=("z_e",),
)
def moves_away(scenario: Scenario, log: Recording) -> Sentences:
    """The law does not track: the distance to the target has grown over the run."""
    # A mean over the window, as a vessel that swings may be far off at the last instant alone.
    late = steady_rows(scenario, log)
    if not late.any():
        return
    start, end = float(log["z_e"][0]), float(log["z_e"][late].mean())
    if end > start + scenario.vessel.length:
        yield (
            f"the vessel starts {start:.3g} m from the target and is {end:.3g} m away from it at "
            f"the end (mean over the steady window): {scenario.controller.label} does not track; "
            "check signs and units of the law and of its nominal vessel, and its own limits (U and "
            "N_m), or take larger gains"
        )


@warn_after_run(
    "never-settles",
    about="controller",
    meaning="the vessel is not at its target at the end",
    condition="the mean of |z_e - standoff| over the steady window exceeds metrics.settling_radius",
    remedy="simulate longer where it still comes nearer; else larger gains or integral action",
    needs=("z_e",),
)
def never_settles(scenario: Scenario, log: Recording) -> Sentences:
    """The run ends without having come to its target; `moves-away` says so of a worse one."""
    late = steady_rows(scenario, log)
    # `moves_away` has said worse of this run already.
    if log.status != "finished" or not late.any() or any(moves_away.search(scenario, log)):
        return
    approach, radius = scenario.controller.approach(), scenario.metrics.settling_radius
    standoff = approach.standoff if approach else 0.0
    errors = np.abs(log["z_e"][late] - standoff)
    error = float(errors.mean())
    if not scenario.at_target({"e_steady": error}):
        place = f"its standoff of {standoff:g} m" if standoff else "its target"
        nearing = _arrives(errors, scenario.metrics.steady_fraction, radius)
        remedy = "simulate longer" if nearing else "take larger gains, or add integral action"
        yield (
            f"no table ranks this run: over the steady window the vessel is {error:.3g} m away "
            f"from {place}, more than the settling radius of {radius:g} m; it "
            f"{'still comes' if nearing else 'does not come'} nearer; {remedy}"
        )


def _arrives(errors: Vector, fraction: float, radius: float) -> bool:
    """Whether the vessel reaches the radius [m] in a second run as long, if it goes on like this.

    `errors` (rows,) [m] are those of the last `fraction` of the run.
    """
    # Rounded up: the middle one of an odd number counts in both halves.
    half = -(-len(errors) // 2)
    earlier, later = float(errors[:half].mean()), float(errors[-half:].mean())
    # The fall between the middles of both halves, half the window apart, as a rate per run.
    return (earlier - later) / (0.5 * fraction) > later - radius


def _reversals(part: dict[str, Vector], turned: float) -> str | None:
    """What a zig-zag lacks of its REVERSALS, in words, or None.

    `part` has its signals (n,) since it began, by name; `turned` is the change of heading so far
    [rad].
    """
    count = int((np.diff(np.sign(part["delta_s"])) != 0.0).sum())
    if count >= REVERSALS:
        return None
    return (
        f"the zig-zag reverses {count} times, and its second overshoot needs {REVERSALS}; the "
        f"heading has changed by {np.degrees(turned):.0f} deg in all"
    )


def _turn(part: dict[str, Vector], turned: float) -> str | None:
    """What a turning circle has not come to, or None; `turned` is its change of heading [rad]."""
    degrees = f"the circle turns by {np.degrees(turned):.0f} deg, and its diameter needs 180"
    return degrees if turned < np.pi else None


def _way(part: dict[str, Vector], turned: float) -> str | None:
    """What a stopping trial has not come to, in words, or None.

    `part` has its signals (n,) since it began, by name. `turned` is not used: the three such
    functions are called alike.
    """
    if part["u"][0] <= 0.0:
        return "the hull does not go ahead when it is to stop; give it more speed"
    slowest = float(part["u"].min())
    left = f"the hull still goes ahead at {slowest:.2g} m/s, and its track reach needs 0"
    return left if slowest > 0.0 else None


UNFINISHED = {"zig-zag": _reversals, "turning circle": _turn, "stopping": _way}


@warn_after_run(
    "trial-unfinished",
    about="controller",
    meaning="the trial has not led to all of its numbers",
    condition="a zig-zag reverses fewer than three times, a circle turns by less than 180 deg, or "
    "a hull with thrust astern still goes ahead at the end",
    remedy="simulate longer; a hull that keeps turning the first way is unstable for this trial",
)
def trial_unfinished(scenario: Scenario, log: Recording) -> Sentences:
    """A manoeuvring trial ends before its last number is there, or never reverses."""
    trial = scenario.controller.trial()
    if trial is None:
        return
    under_way = rows_where(log, lambda part: part["time"] >= trial.execute)
    if not under_way.any():
        yield f"the run ends before the trial begins, at {trial.execute:g} s; simulate longer"
        return
    part = {name: log[name][under_way] for name in ("psi", "u", "delta_s") if name in log}
    what = UNFINISHED[trial.manoeuvre](part, float(np.ptp(part["psi"])))
    if what:
        yield what
