"""What the logs say of a hull, and what they leave open, in sentences."""

from __future__ import annotations

import numpy as np

from podusv_cli.identify.answer import Answer
from podusv_cli.identify.estimate import OPEN

# The manoeuvre that tells the numbers of an axis.
TELLING = {
    "X": "straight runs at three speeds tell the surge damping",
    "Y": "turning circles at two speeds tell the sway damping",
    "N": "turning circles and zig-zags tell the yaw damping",
    "m": "zig-zags, and starts and stops, tell the inertia",
    "t": "thrust is known where one mass is",
}
FAR = 3.0  # prior standard deviations, beyond which a number contradicts what was known
MOST = 4  # directions that are named
SHARE = 0.3  # of a direction, from which on a number is named


def summary(answer: Answer) -> list[str]:
    """What came out, a sentence each."""
    hull, known = answer.problem.hull, answer.directions.known
    logs = answer.problem.logs
    lines = [
        f"{len(logs)} logs of {sum(log.duration for log in logs):.0f} s in all tell {known} of "
        f"{len(hull)} directions of the hull's numbers (each to less than {OPEN:g} of what was "
        "known before)."
    ]
    for axis, unit in (("X", "m/s"), ("Y", "m/s"), ("N", "rad/s")):
        own = [f for f in answer.forces if f.force.startswith(axis)]
        told = [f for f in own if f.width <= OPEN]
        if told:
            error = max(0.5 * (f.high - f.low) / abs(f.value) for f in told)
            ends = f"{min(f.at for f in told):.3g} to {max(f.at for f in told):.3g} {unit}"
            lines.append(f"{own[0].force} is known to {100.0 * error:.2g} % at {ends}.")
        elif own:
            lines.append(
                f"{own[0].force} is not told by these logs: it is known little better than before."
            )
    if not answer.estimate.settled:
        lines.append("The search had not settled when it ended; the numbers may still move.")
    lines += [note for log, _, _ in answer.judged for note in log.notes]
    if not answer.judged:
        lines.append(
            "No log was kept for judging (role: judge): how well it foretells is not known."
        )
    return lines


def open_words(answer: Answer) -> list[str]:
    """Each direction that the logs leave open, by its numbers; the manoeuvres that would tell."""
    ways, hull = answer.directions, answer.problem.hull
    lines, axes = [], set()
    for i in range(ways.known, len(hull)):
        shares = ways.basis[:, i]
        named = [j for j in np.argsort(-np.abs(shares)) if abs(shares[j]) >= SHARE]
        axes |= {hull[j].name[0] for j in named}
        names = ", ".join(hull[j].name for j in named)
        what = "how these share a force" if len(named) > 1 else "this number"
        lines.append(f"{what} is open ({ways.widths[i]:.2g} of the prior's width): {names}")
    if len(lines) > MOST:
        lines[MOST:] = [f"and so are {len(lines) - MOST} more directions"]
    return [*lines, *(TELLING[axis] for axis in sorted(axes))]


def far_words(answer: Answer) -> list[str]:
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
