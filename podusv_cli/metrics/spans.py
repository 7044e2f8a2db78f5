"""Over which instants metrics are gathered: to the end of a path that is followed and has one.

That is the one place that decides. A path is over at the first instant at which all of it lies
behind the vessel (`path_time` of legs), and what comes after counts in no metric. A run that does
not come so far is measured as a whole, and so is one without such a path.

The steady window is the last part of the run in time. Of a path that has an end it is the last part
of the way: from the instant on at which the rest of it lies behind the vessel, however long the run
goes on. A vessel that never comes there has the last part of the time.
"""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.metrics.metric import Measured

# What a kernel of an accumulator is told of the steady window
BEFORE, WITHIN, ANEW = 0.0, 1.0, 2.0
# Positions of what is gathered ahead of all metrics where a path has an end
LATE, OVER, AHEAD = range(3)
# Of a place that lies behind the vessel: two columns of s, and from which numbers on
MARK = ("at", "from", "then_at", "then_from")


# t [s]; weight [s] of this instant in an integral; steady: BEFORE, WITHIN or ANEW; s (states) and
# row (columns) of the closed loop; k constants; seen: the accumulator's own numbers, which it
# changes.
@kernel
def all_kernels(
    t: float, weight: float, steady: float, s: Vector, row: Vector, k: Any, seen: Vector
) -> None:
    """Placeholder of all accumulators' kernels."""


# Arguments as those of `all_kernels`.
@kernel
def by_time(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Show every instant to all kernels."""
    all_kernels(t, weight, WITHIN if t >= k.steady_from else BEFORE, s, row, k, seen)


# s (states); `at` and `then_at` are places in it.
@kernel
def is_passed(s: Vector, at: int, least: float, then_at: int, then_least: float) -> bool:
    """Whether a number is larger than another, or as large and the next one large enough."""
    return bool(s[at] > least or (s[at] == least and s[then_at] >= then_least))


# Arguments as those of `all_kernels`. seen begins with LATE and OVER, which say where on the path
# the run is. Until the last part of the way begins, the steady window is that of time; then it
# begins anew, so a vessel that never comes there has the last part of the time. The instant at
# which the path is over counts.
@kernel
def by_path(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Show every instant to all kernels, up to that at which the path is over."""
    if seen[OVER] == 0.0:
        steady = WITHIN if seen[LATE] > 0.0 or t >= k.steady_from else BEFORE
        if seen[LATE] == 0.0 and is_passed(
            s, int(k.late_at), k.late_from, int(k.late_then_at), k.late_then_from
        ):
            seen[LATE], steady = 1.0, ANEW
        all_kernels(t, weight, steady, s, row, k, tail(seen, AHEAD))
        if is_passed(s, int(k.over_at), k.over_from, int(k.over_then_at), k.over_then_from):
            seen[OVER] = 1.0


def _mark(layout: Measured, share: float) -> dict[str, float]:
    """A place of the path as constants of a kernel (`MARK`); none where the path has no end.

    The `share` of the way lies behind it. Raises LawError for what the path does not say in one or
    two of its places.
    """
    names = [signal.name for signal in layout.loop.path.places]
    place = layout.loop.passed_by(share)
    if len(place) > 2 or not place.keys() <= {*names}:
        given, known = ", ".join(place), ", ".join(names) or "none"
        what = f"passed_by({share:g}) returns {given}; at most two are allowed, of its places"
        raise LawError(f"{what} ({known})")
    marks = [(float(layout.plan.place + names.index(name)), x) for name, x in place.items()]
    # A second number that is not given is always reached: anything is above minus infinity
    first, then = (*marks, *[(0.0, -math.inf)] * 2)[:2]
    return dict(zip(MARK, (*first, *then), strict=True)) if marks else {}


def constants(layout: Measured) -> dict[str, float]:
    """The constants of `by_time` or `by_path`: where in time and on the path windows begin."""
    marks = {"late": 1.0 - layout.steady_fraction, "over": 1.0}
    return {"steady_from": layout.steady_from} | {
        f"{name}_{key}": number
        for name, share in marks.items()
        for key, number in _mark(layout, share).items()
    }
