"""Findings about a path that is followed without a timetable."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np

from podusv_cli.components.paths.base import Path
from podusv_cli.core.errors import SizingError
from podusv_cli.core.finding import Sentences, warn_after_run, warn_before_run
from podusv_cli.core.kernel import Vector
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.recording import Recording
from podusv_cli.findings.sizing import other_numbers
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.reference import median, reference

ROOM = 2.0  # acceptance radii; a shorter leg is left before it is followed
AMPLE = 1.2  # of length over speed: a duration that leaves time to speed up and to turn


def _lengths(path: Path) -> Vector:
    """Length of each leg [m]."""
    return np.asarray(np.hypot(*np.diff(np.array(path.waypoints()), axis=0).T))


@warn_before_run(
    "short-leg",
    about="path.points",
    meaning="a leg is over before the vessel can be on it",
    condition=f"a leg is shorter than {ROOM:g} acceptance radii",
    remedy="take a smaller acceptance radius, or fewer waypoints",
)
def short_leg(case: Case) -> Sentences:
    """The circles of acceptance of a leg's two waypoints overlap."""
    path = case.scenario.path
    if not path.circles():
        return
    # All circles of a path have one radius.
    lengths, radius = _lengths(path), path.circles()[0][2]
    short = np.flatnonzero(lengths < ROOM * radius)
    if short.size:
        leg = short[np.argmin(lengths[short])]
        others = (
            f", and {short.size - 1} more of {len(lengths)} are short" if short.size > 1 else ""
        )
        yield (
            f"leg {leg} is {lengths[leg]:.3g} m long{others}, and the acceptance radius of their "
            f"waypoints is {radius:g} m, so the vessel leaves it before it is on it; take "
            "a smaller path.acceptance, or fewer waypoints"
        )


@warn_before_run(
    "legs-too-long",
    about="simulation.duration",
    meaning="the run ends before the legs can",
    condition="at the path's speed, straight from the start to the waypoints' circles and from one "
    "to the next takes longer than the run",
    remedy="simulate longer, or ask for more speed",
)
def legs_too_long(case: Case) -> Sentences:
    """Even without any turn the last waypoint comes after the end."""
    scenario, circles = case.scenario, np.array(case.scenario.path.circles())
    if not len(circles) or not scenario.controller.aims():
        return
    start, duration = scenario.start, scenario.simulation.duration
    hops = np.hypot(*np.diff(np.vstack([(start.x, start.y), circles[:, :2]]), axis=0).T)
    # The start has no circle.
    radii, speed = np.append(0.0, circles[:, 2]), float(case.reference.speed.max())
    # A leg is over once the vessel is in its circle; overlapping circles leave no way between.
    if np.maximum(hops - radii[:-1] - radii[1:], 0.0).sum() > speed * duration:
        whole = float(hops.sum()) / speed
        yield (
            f"{duration:g} s, and {hops.sum():.4g} m from the start round all waypoints take "
            f"{whole:.3g} s at {speed:.3g} m/s; simulate {math.ceil(AMPLE * whole):g} s, or ask "
            "for more path.speed"
        )


@warn_after_run(
    "never-arrives",
    about="path",
    meaning="legs are left at the end",
    condition="not all legs are done by the end of the run",
    remedy="simulate longer, take a larger acceptance radius, or path.switch: passed",
    needs=("leg", "e_ct", "along_leg"),
)
def never_arrives(scenario: Scenario, log: Recording) -> Sentences:
    """A run that follows its path ends on its way, or round a waypoint that it missed."""
    lengths, leg = _lengths(scenario.path), int(log["leg"][-1])
    if log.status != "finished" or leg >= len(lengths) or not scenario.controller.aims():
        return
    beside = f"{abs(log['e_ct'][-1]):.3g} m beside leg {leg}"
    yield (
        f"{leg} of {len(lengths)} legs are done at the end, {beside}; "
        f"{'; '.join(_unable(scenario)) or _late(log['along_leg'][-1] > lengths[leg])}"
    )


@warn_after_run(
    "station-not-kept",
    about="path",
    meaning="stations are left at the end",
    condition="not all stations have been kept by the end of the run",
    remedy="simulate longer, take larger tolerances, or a law that holds the pose better",
    needs=("station", "z_e", "heading_d"),
)
def station_not_kept(scenario: Scenario, log: Recording) -> Sentences:
    """A run ends on the way to a station, or beside one that it did not keep."""
    count, done = int(scenario.passed_by(1.0).get("station", 0)), int(log["station"][-1])
    if log.status != "finished" or done >= count:
        return
    off = abs(wrap(float(log["psi"][-1] - log["heading_d"][-1])))
    yield (
        f"{done} of {count} stations have been kept at the end, {log['z_e'][-1]:.3g} m and "
        f"{off:.3g} rad beside the target; simulate longer, take larger path.radius and "
        "path.angle, or a law that holds the pose better"
    )


def _late(missed: bool) -> str:
    """What a law that is able to arrive lacks; `missed` where it is past the end of its leg."""
    if missed:
        return (
            "it is past the end of that leg: take a larger path.acceptance, or path.switch: passed"
        )
    return "simulate longer, or ask for more speed"


def _unable(scenario: Scenario) -> list[str]:
    """Why a law cannot arrive, in sentences: its own limits, or the hull's speed.

    Empty if it can.
    """
    facts, law = scenario.facts, scenario.controller
    speed = median(reference(scenario).speed)
    own = [
        f"{name} = {number:g} where hull and actuator make it {rule:.3g}, so {why}: leave it out"
        for name, (number, rule, why) in other_numbers(law, facts).items()
    ]
    with suppress(SizingError):  # an actuator that cannot be asked
        if speed > facts.U:
            own.append(
                f"the hull goes {facts.U:.3g} m/s at full thrust ({facts.F:.3g} N), and the path "
                f"asks for {speed:.3g} m/s: slow it down"
            )
    return own
