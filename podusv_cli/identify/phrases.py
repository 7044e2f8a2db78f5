"""What the logs say of a hull, and what they leave open, in sentences."""

from __future__ import annotations

import math

import numpy as np

from podusv_cli.identify.answer import AXES, Identification, Parameter
from podusv_cli.identify.fit.beside import DEVIATION, LASTING, RATE, SWINGS
from podusv_cli.identify.fit.estimate import OPEN
from podusv_cli.identify.fit.march import COMPASS
from podusv_cli.identify.judge import SHOWN, WHO
from podusv_cli.scenario.identify import WANDER

# The manoeuvre that determines the numbers of an axis.
MANOEUVRES = {
    "X": "straight runs at three speeds would",
    "Y": "turning circles at two speeds or more would",
    "N": "turning circles and zig-zags would",
    "m": "zig-zags, starts and stops would",
}
FINEST = 1.0  # %, since what an interval leaves out is hardly ever less
MOST = 4  # directions that are named
SHARE = 0.3  # of a direction, from which on a number is named


def summary(answer: Identification) -> list[str]:
    """What came out, a sentence each, what matters most first."""
    hull, logs = answer.problem.hull, answer.problem.logs
    seconds = sum(log.duration for log in logs)
    given = f"{len(logs)} {'logs' if len(logs) > 1 else 'log'} of {seconds:.0f} s in all"
    notes = [note for log, _, _ in answer.judged for note in log.notes]
    notes = [*_sensors(answer), *notes]
    if not answer.estimate.settled:
        unsettled = (
            f"{given}: the search did not settle, so the logs count as determining nothing. The "
            "numbers are only the best of several searches: give the vessel numbers nearer to the "
            "boat's, or look for fewer (identify.free)."
        )
        return [unsettled, *_judge_in_words(answer), *notes]
    determined = (
        f"{given}: {answer.determined_count} of {len(hull)} directions of the hull's numbers are "
        f"determined, each to less than {OPEN:g} of what was known before."
    )
    return [*_judge_in_words(answer), *_forces(answer), determined, *notes]


def _sensors(answer: Identification) -> list[str]:
    """Which lasting errors of sensors and which loads were looked for, and what came out."""
    found, problem = {p.name: p for p in answer.parameters}, answer.problem
    lines, compass = [], found.get(COMPASS)
    if LASTING in found:
        size, lasts = found.get(DEVIATION), found[LASTING]
        given = f"{problem.wander:.2g} m as given" if size is None else _with_ends(size, "m")
        lines.append(
            f"Positions have an error that wanders, looked for beside the hull: {given} on each "
            f"axis, forgotten in {_with_ends(lasts, 's')}. noise: {{wander: 0}} looks for none."
        )
    elif WANDER not in problem.wanted.noise:
        lines.append(
            "Third differences of the positions show no error that wanders, so none was looked "
            "for; noise: {wander: 1.0} looks for one of about 1 m."
        )
    if compass:
        degrees = _with_ends(compass, "deg", math.degrees(1.0))
        lines.append(f"The compass shows {degrees} more than the heading.")
    if problem.gusts:
        k = problem.values(answer.estimate.y)
        force, moment = (k[q] / (2.0 * math.sqrt(k[SWINGS] * k[RATE])) for q in ("q_b", "q_b_psi"))
        why = (
            "Loads are taken for those of gusts, as asked for"
            if problem.wanted.gusts
            else "Loads of gusts explain the logs better than loads that wander (gusts: false "
            "takes the latter)"
        )
        lines.append(
            f"{why}: about the means of the logs they have an rms of {force:.2g} N north and east "
            f"and {moment:.2g} N m, at rates up to about {_with_ends(found[RATE], 'rad/s')}."
        )
    return lines


def _with_ends(p: Parameter, unit: str, factor: float = 1.0) -> str:
    """A number with its interval, times a factor that makes its unit this one."""
    return f"{factor * p.value:.2g} {unit} ({factor * p.low:.2g} to {factor * p.high:.2g})"


def _judge_in_words(answer: Identification) -> list[str]:
    """How well the hull predicts the logs that were not fitted."""
    if all(log.role == "fit" for log in answer.problem.wanted.logs):
        return [
            "No log was kept for judging (role: judge), so nothing says how well the hull predicts."
        ]
    judged = [s for s in answer.scores if s.role == "judge" and s.horizon == SHOWN]
    if not judged:
        return [f"No log for judging holds a free run of {SHOWN:g} s: judge with a longer one."]
    errors = [f"{who} {max(s.position for s in judged if s.who == who):.2g} m" for who in WHO]
    return [
        f"Rms error of the position {SHOWN:g} s on, in the worst log that was not fitted: "
        f"{', '.join(errors)}."
    ]


def _forces(answer: Identification) -> list[str]:
    """How well each damping force is known."""
    lines = []
    for axis in AXES:
        own = [f for f in answer.forces if f.force == axis.name]
        known = [f for f in own if f.width <= OPEN]
        if known:
            error = max(0.5 * (f.high - f.low) / abs(f.value) for f in known)
            ends = f"{known[0].at:.2g} to {known[-1].at:.2g} {axis.speed_unit}"
            lines.append(f"{axis.name} is known to {max(100.0 * error, FINEST):.2g} % at {ends}.")
        elif own:
            lines.append(
                f"{axis.name} is not determined by these logs: {MANOEUVRES[axis.name[0]]}."
            )
    if any(f.width <= OPEN for f in answer.forces):
        lines.append(
            "The percentages hold where thrust and form of the model are right and no wind blows: "
            "the filter knows no wind. With logs of an Otter in 2, 4 and 8 m/s of wind X_u is 0.6, "
            "1.2 and 4.6 % off; in 8 m/s Y_v is two thirds off."
        )
    return lines


def open_words(answer: Identification) -> list[str]:
    """Each direction that the logs leave open, by its numbers; what would determine the inertia."""
    ways, hull = answer.directions, answer.problem.hull
    named: dict[str, float] = {}
    for i in range(ways.determined_count, len(hull)):
        shares = ways.basis[:, i]
        own = sorted(hull[j].name for j in np.flatnonzero(np.abs(shares) >= SHARE))
        named.setdefault(", ".join(own), min(float(ways.widths[i]), 1.0))
    lines = [
        f"open ({width:.2g} of the width before): "
        f"{'how ' + names + ' share a force' if ',' in names else names}"
        for names, width in named.items()
    ]
    if len(lines) > MOST:
        lines[MOST:] = [f"and {len(lines) - MOST} more"]
    inertia = any(p.name[0] == "m" and p.width > OPEN for p in answer.parameters)
    return [*lines, *([f"inertia: {MANOEUVRES['m']}"] if inertia else [])]
