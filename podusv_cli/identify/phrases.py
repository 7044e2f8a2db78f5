"""What the logs say of a hull, and what they leave open, in sentences."""

from __future__ import annotations

import numpy as np

from podusv_cli.identify.answer import AXES, Identification
from podusv_cli.identify.fit.estimate import OPEN
from podusv_cli.identify.fit.march import DELAY, THRUST
from podusv_cli.identify.judge import WHO

# The manoeuvre that determines the numbers of an axis.
MANOEUVRES = {
    "X": "straight runs at three speeds would",
    "Y": "turning circles at two speeds or more would",
    "N": "turning circles and zig-zags would",
    "m": "zig-zags, starts and stops would",
}
SHOWN = 30.0  # s after the start of a free run
WORSE = 1.2  # times the prior's error: what is no accident of one log
FAR = 3.0  # prior standard deviations, beyond which a number contradicts what was known
FINEST = 1.0  # %, since what an interval leaves out is hardly ever less
MOST = 4  # directions that are named
SHARE = 0.3  # of a direction, from which on a number is named


def summary(answer: Identification) -> list[str]:
    """What came out, a sentence each, what matters most first."""
    hull, logs = answer.problem.hull, answer.problem.logs
    lines = [*_judge_in_words(answer), *_forces(answer)]
    seconds = sum(log.duration for log in logs)
    lines.append(
        f"{len(logs)} {'logs' if len(logs) > 1 else 'log'} of {seconds:.0f} s in all: "
        f"{answer.directions.determined_count} of {len(hull)} directions of the hull's numbers are "
        f"determined, each to less than {OPEN:g} of what was known before."
    )
    if not answer.estimate.settled:
        lines.append(
            "The search did not settle, so the numbers are only the best of several tries: give "
            "the vessel numbers nearer to the boat's, or look for fewer (identify.free)."
        )
    return [*lines, *(note for log, _, _ in answer.judged for note in log.notes)]


def _judge_in_words(answer: Identification) -> list[str]:
    """How well the hull predicts the logs that were not fitted."""
    if all(log.role == "fit" for log in answer.problem.wanted.logs):
        return ["No log was kept for judging (role: judge): how well it predicts is not known."]
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
            "The percentages hold if thrust and form of the model are right, and in calm air: the "
            "filter knows no wind. With logs of an Otter in 2, 4 and 8 m/s of wind X_u comes 0.6, "
            "1.2 and 4.6 % off, and in 8 m/s Y_v by two thirds."
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


def worse_words(answer: Identification) -> list[str]:
    """A sentence for each log that was not fitted and that the prior predicts better."""
    by = {(s.log, s.horizon, s.who): s for s in answer.scores if s.role == "judge"}
    names = dict.fromkeys(
        log
        for (log, horizon, who), s in by.items()
        if who == WHO[0] and s.position > WORSE * by[log, horizon, WHO[1]].position
    )
    return [
        f"{name}: the vessel as it was given predicts this log better than the one from the logs; "
        "do not take that one before you know why (the logs determine too little, or disagree)"
        for name in names
    ]


def thrust_words(answer: Identification) -> list[str]:
    """A sentence where thrust was looked for, since a hull has no place for it."""
    return [
        f"thrust is {p.value:.4g} ({p.low:.4g} to {p.high:.4g}) times what the actuator's numbers "
        "give. The hull holds with that thrust alone: multiply the actuator's thrust (of pods "
        f"T_nn, T_nn_astern, T_nV) by {p.value:.4g} wherever this hull is used, or a draw of "
        "posterior.csv: draws of another thrust are scaled so that they move as under their own."
        for p in answer.parameters
        if p.name == THRUST
    ]


def early_words(answer: Identification) -> list[str]:
    """A sentence where commands act before the log says that they were given, for certain.

    A command that is held from row to row, and in truth goes on changing, is half a row late there.
    """
    return [
        f"delay is {p.value:.2g} s ({p.low:.2g} to {p.high:.2g}): the boat moves before its "
        "commands. Half the distance of rows comes from commands that change between the rows of a "
        "log, and the fit takes that out; more is a clock that is off. Log commands more often, or "
        "log what the actuator did: with rows of five lags inertia came out 3 % off, outside its "
        "interval, and with rows of two lags within 0.6 %."
        for p in answer.parameters
        if p.name == DELAY and p.high < 0.0
    ]


def far_words(answer: Identification) -> list[str]:
    """A sentence where numbers end far from what was known before: the vessel is another one."""
    far = [
        f"{p.name} {p.value:.4g} (before {p.prior:.4g})"
        for p, y in zip(answer.parameters, answer.estimate.y, strict=True)
        if abs(y) > FAR and p.name in {number.name for number in answer.problem.hull}
    ]
    if not far:
        return []
    return [
        f"{len(far)} numbers are more than {FAR:g} standard deviations from what was known before: "
        f"{', '.join(far)}. Is the vessel's preset of another size, or the thrust in another unit? "
        "With a prior so far off the intervals are too narrow; give the vessel numbers nearer to "
        "these."
    ]
