"""Findings about the path, and about whether this hull and actuator can follow it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from podusv_cli.components.controllers.base import Approach
from podusv_cli.components.vessels.plant import sway_force
from podusv_cli.core.finding import FindingKind, Sentences, warn_before_run
from podusv_cli.core.kernel import bundle
from podusv_cli.core.signal import PSI_D
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.reference import FASTEST, STANDING, drift, median

OPPOSITE = 1e-6  # rad
RUNAWAY = 1.0  # in target speeds; with faster sway a hull may circle the target
BESIDE = 1e-9  # s; distance from a break at which the target is evaluated on either side
STABLE = 2.785  # step over time constant up to which RK4 is stable
AHEAD = 0.5  # excess surge force, as a fraction of the largest one needed
ROUNDING = 1e-9  # of the largest load: a moment of 1e-13 N m on a straight leg is none
DELIVERED = 0.999  # fraction of the demand that counts as all of it
ROUNDED = 0.99  # of N_m, which has few digits
# What is demanded, in its order: in words, unit, place among the loads.
DEMANDED = (("surge force", "N", 0), ("yaw moment", "N m", 2), ("sway force", "N", 1))
BREAKS = {  # what jumps: offset in TARGET, unit
    "position": (0, "m"),
    "velocity": (2, "m/s"),
    "acceleration": (4, "m/s2"),
}
CONSEQUENCES: dict[str, Callable[[float, Case], str]] = {
    "position": lambda size, case: (
        "the errors jump with it, and Assumption 3 (a smooth path) does not hold"
    ),
    "velocity": lambda size, case: (
        "the virtual controls jump with it, and Assumption 3 (bounded acceleration) does not hold; "
        "set path.fillet, or round the corner"
    ),
    "acceleration": lambda size, case: (
        "position and velocity go on smoothly and Assumption 3 holds; a law that uses the "
        "acceleration (backstepping) steps with it, by up to "
        f"{size * case.scenario.nominal.m11:.2g} N and "
        f"{size * case.scenario.nominal.m33:.2g}/z_e N m"
    ),
}


def path_breaks(case: Case, what: str) -> Sentences:
    """Sentences on where the target's `what` jumps within the run.

    `what` is position, velocity or acceleration.
    """
    offset, unit = BREAKS[what]
    fillet = case.scenario.path.fillet_for_law()
    if fillet and what == "velocity":
        return  # the law sees none
    if fillet and what == "acceleration":
        size = float(fillet.steps().max())
        yield (
            f"in the fillets the acceleration that the law sees jumps by up to {size:.3g} m/s2; "
            f"{CONSEQUENCES[what](size, case)}"
        )
    for at in case.scenario.path.breaks():
        if at.what == what and at.time < case.scenario.simulation.duration:
            beside = BESIDE * max(at.time, 1.0)
            # A moment to either side; relative to the time, as floats are spaced that way.
            before, after = case.scenario.path.targets((at.time - beside, at.time + beside))
            size = float(np.hypot(*(after - before)[offset : offset + 2]))
            meaning = CONSEQUENCES[what](size, case)
            yield f"the target's {what} jumps by {size:.3g} {unit} at {at.time:g} s; {meaning}"


def _path_break(code: str, what: str, remedy: str) -> FindingKind:
    """The finding on a jump of the target's `what`: position, velocity or acceleration."""
    return warn_before_run(
        code,
        about="path",
        meaning=f"the target's {what} jumps",
        condition=f"the {what} differs before and after a break of the path",
        remedy=remedy,
    )(partial(path_breaks, what=what))


path_jump = _path_break("path-jump", "position", "let the parts of the path meet")
path_corner = _path_break("path-corner", "velocity", "set path.fillet, or round the corner")
path_bend = _path_break(
    "path-bend", "acceleration", "none needed: Assumption 3 holds; a smooth path avoids the step"
)


@warn_before_run(
    "opposite-start",
    about="start.psi",
    meaning="rounding decides to which side the vessel turns",
    condition="the start's heading is opposite to the target's course, or to the heading that a "
    f"law of poses wants, to {OPPOSITE:g} rad",
    remedy="start a thousandth of a radian to one side",
)
def opposite_start(case: Case) -> Sentences:
    """Half a turn lies ahead, to either side alike, of a vessel that does not turn yet."""
    start, law = case.scenario.start, case.scenario.controller
    target = case.scenario.path.whole_targets([0.0])[0].tolist()
    _, _, x_dot, y_dot, *_ = target
    what, wanted = "course", math.atan2(y_dot, x_dot)
    if law.wants_heading():
        what, wanted = "heading", target[PSI_D]
    half = abs(abs(math.remainder(start.psi - wanted, 2.0 * math.pi)) - math.pi) < OPPOSITE
    # A target at rest has no course.
    known = law.wants_heading() or math.hypot(x_dot, y_dot) > STANDING
    if half and not start.r and known and law.aims():
        yield (
            f"{start.psi:.6g} rad is opposite to the target's {what}, so rounding decides to which "
            "side the vessel turns, and what follows from that; start a thousandth of a radian to "
            f"one side: {start.psi - 1e-3:.6g}"
        )


@warn_before_run(
    "path-runs-on",
    about="path",
    meaning="the target goes straight on after the last waypoint",
    condition="the run lasts longer than the way through the points",
    remedy="set path.after to stop or loop, or simulate no longer",
)
def path_runs_on(case: Case) -> Sentences:
    """The target leaves the given course before the run ends."""
    end, duration = case.scenario.path.runs_on_from(), case.scenario.simulation.duration
    if end < duration:
        yield (
            f"the target passes its last point at {end:.4g} s and goes straight on until "
            f"{duration:.6g} s; set path.after to stop or loop, or simulate no longer"
        )


@warn_before_run(
    "sway-drift",
    about="path",
    meaning="the sway load drifts the hull faster than the target",
    condition="no heading balances sway damping and mean load at the target's speed",
    remedy="check the sway damping, the load and the speed",
)
def sway_drift(case: Case) -> Sentences:
    """The mean sway load pushes the hull sideways faster than the target moves."""
    seen = case.reference
    lost = np.isnan(seen.nu[:, 1])
    pushes = case.scenario.controller.asks_sway()  # then the hull is held, whatever its heading
    if lost.any() and case.scenario.controller.aims() and not pushes:
        load = float(seen.load[:, 1].mean())
        speed = abs(drift(case.scenario, load))
        shown = f"at {speed:.2g} m/s" if np.isfinite(speed) else "without limit"
        fastest = float(seen.speed[lost].max())
        yield (
            f"the mean sway load of {load:.2g} N pushes the hull sideways {shown}, and during "
            f"{lost.mean():.0%} of the run (target at up to {fastest:.2g} m/s) no heading makes up "
            "for that: it cannot be followed; check the sway damping, the load and the speed"
        )


@warn_before_run(
    "sway-unstable",
    about="controller.k_ze",
    meaning="pointing at the target makes sway grow",
    condition=f"m11 k_ze exceeds the sway damping, and sway grows beyond {RUNAWAY:g} target speed",
    remedy="take a smaller k_ze, or a hull with more sway damping",
)
def sway_unstable(case: Case) -> Sentences:
    """The sway of a hull that points at the target grows: m11 k_ze > d, the linear sway damping.

    It grows beyond `sliding_distance` from the target, until nonlinear damping balances m11 k_ze.
    """
    approach, vessel = case.scenario.controller.approach(), case.scenario.vessel
    if approach is None:
        return
    # Pointing at the target turns the surge momentum into sway at this rate [kg/s].
    drive = vessel.m11 * approach.gain
    damping, limit = _damping(case, drive)
    speed = median(case.reference.speed)
    if drive > damping and limit > RUNAWAY * speed:
        reach = f"up to {limit:.2g} m/s" if limit < FASTEST else "without limit"
        distance = sliding_distance(case, approach, damping)
        yield (
            f"m11 k_ze = {drive:.3g} kg/s exceeds the sway damping {damping:.3g} kg/s: further "
            f"than {distance:.2g} m from the target, sway of a hull that points at it grows, "
            f"{reach}, against the target's {speed:.2g} m/s; take k_ze below "
            f"{damping / vessel.m11:.2g} 1/s, or a hull with more sway damping"
        )


def sliding_distance(case: Case, approach: Approach, damping: float) -> float:
    """Distance [m] from the target beyond which sway grows, for `damping` d [kg/s] < m11 k_ze.

    A hull points at a target of speed U from the constant distance D: psi_e = 0 and u = alpha_u of
    (21). With theta from the line of sight to the target's course,

        theta' = -(U sin theta - v)/D,
        m22 v' = -m11 (k_ze (D - standoff) + U cos theta) (U sin theta - v)/D - d v.

    Linearised at theta = v = 0 the determinant U d/(m22 D) is positive, and the trace is positive
    (growth) for D > (U (m22 - m11) + m11 k_ze standoff)/(m11 k_ze - d).
    """
    vessel, speed = case.scenario.vessel, median(case.reference.speed)
    drive = vessel.m11 * approach.gain
    free = speed * (vessel.m22 - vessel.m11) + drive * approach.standoff
    return max(0.0, free / (drive - damping))


def _damping(case: Case, drive: float) -> tuple[float, float]:
    """Sway damping [kg/s] at the steady sway, and the sway [m/s] where growth stops.

    The growth is by `drive` [kg/s].
    """
    k, sway = bundle(case.scenario.vessel.constants()), case.reference.steady_sway
    u = median(case.reference.speed)
    at_rest, small = sway_force(u, sway, 0.0, k), 1e-4
    damping = (sway_force(u, sway - small, 0.0, k) - sway_force(u, sway + small, 0.0, k)) / (
        2 * small
    )
    # Nonlinear damping overtakes the linear drive at some sway; FASTEST if at none.
    growths = np.geomspace(1e-3, FASTEST, 200)
    side = 1.0 if sway >= 0.0 else -1.0
    held = [
        side * (at_rest - sway_force(u, sway + side * growth, 0.0, k)) > drive * growth
        for growth in growths.tolist()
    ]
    return damping, float(growths[held.index(True)]) if any(held) else FASTEST


@warn_before_run(
    "thrust-short",
    about="actuator",
    meaning="keeping up takes more than the actuator gives",
    condition=f"less than {DELIVERED:.1%} of the force or moment along the path is delivered",
    remedy="raise the actuator's limit, or slow the target down",
)
def thrust_short(case: Case) -> Sentences:
    """Following takes more of a force or of the yaw moment than the actuator delivers."""
    if not case.scenario.controller.aims():
        return
    seen = case.reference
    worst = np.abs(seen.demand).argmax(axis=0)
    actuator, rounding = case.scenario.actuator, ROUNDING * float(np.abs(seen.demand).max())
    for axis, (what, unit, load) in enumerate(DEMANDED[: len(worst)]):
        demand = seen.demand[worst[axis]]
        # The pose does not matter to an actuator.
        x = np.concatenate([np.zeros(3), np.nan_to_num(seen.nu[worst[axis]])])
        needed, got = float(demand[axis]), float(actuator.settled(x, demand)[load])
        if got * np.sign(needed) < DELIVERED * abs(needed) - rounding:
            mean = float(seen.demand[:, axis].mean())
            yield (
                f"keeping up takes a {what} of {needed:.3g} {unit} at "
                f"t = {seen.time[worst[axis]]:.0f} s ({mean:.3g} on average) and the actuator "
                f"gives {got:.3g} {unit}; raise its limit or slow the target down"
            )
    yield from _driven_ahead(case, int(worst[1]))


def _driven_ahead(case: Case, row: int) -> Sentences:
    """A sentence where the largest yaw moment, in this row, comes with too much surge force."""
    seen = case.reference
    # Where no heading can follow, the velocity is unknown and taken as 0.
    x = np.concatenate([np.zeros(3), np.nan_to_num(seen.nu[row])])
    needed, moment, *_ = seen.demand[row].tolist()
    got = float(case.scenario.actuator.settled(x, seen.demand[row])[0])
    if got - needed > AHEAD * float(np.abs(seen.demand[:, 0]).max()):
        yield (
            f"the yaw moment of {moment:.3g} N m at t = {seen.time[row]:.0f} s comes with a surge "
            f"force of {got:.3g} N; the hull runs ahead, since {needed:.3g} N would keep up; let "
            "the pods turn further, or take priority: surge"
        )


@warn_before_run(
    "slow-law",
    about="controller.U",
    meaning="the law's largest speed is below the target's",
    condition="U is below the median speed of the target along the path",
    remedy="take a larger U, or slow the target down",
)
def slow_law(case: Case) -> Sentences:
    """The law asks for less speed than the target has."""
    most, speed = case.scenario.controller.most(), median(case.reference.speed)
    if most.speed < speed:
        # Some laws may exceed U by a small speed near the target.
        nears = f"nears it by {most.creep:g} m/s at most" if most.creep else "never catches up"
        yield (
            f"{most.speed:g} m/s, while the target moves at {speed:.3g} m/s: the law {nears}; take "
            f"a U above {speed:.3g}, or slow the target down"
        )


@warn_before_run(
    "moment-short",
    about="controller.N_m",
    meaning="the law counts on more moment than there is",
    condition=f"less than {ROUNDED:.0%} of N_m is delivered to a hull at rest",
    remedy="give the law the moment that the actuator has",
)
def moment_short(case: Case) -> Sentences:
    """Surge yields to yaw only beyond a moment that the actuator cannot give."""
    moment, actuator = case.scenario.controller.most().moment, case.scenario.actuator
    if math.isfinite(moment):
        # The settled load (surge, sway, yaw) at rest, without surge.
        got = float(actuator.settled(np.zeros(6), np.array([0.0, moment]))[2])
        if got < ROUNDED * moment:
            yield (
                f"{moment:g} N m, and the actuator gives {got:.3g} N m: surge does not yield to "
                f"yaw when the moment runs out; give the law {got:.2g} or less"
            )


@warn_before_run(
    "stiff-actuator",
    about="simulation.step",
    meaning="a pod's lag too short for RK4's step",
    condition=f"the step exceeds {STABLE:g} times the shortest lag",
    remedy="take a shorter step, or a longer lag",
)
def stiff_actuator(case: Case) -> Sentences:
    """An actuator's lag is too short for RK4, which is unstable for steps above 2.78 lags."""
    lag, step = case.scenario.actuator.shortest_lag(), case.scenario.simulation.step
    if step > STABLE * lag:
        yield (
            f"the actuator's lag of {lag:g} s is too short for RK4 with {step:g} s: it would "
            f"not settle on what is commanded; take a step below {STABLE * lag:.2g} s, or a "
            "longer lag"
        )
