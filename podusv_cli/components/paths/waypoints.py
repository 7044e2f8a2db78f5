"""A path through given points, smooth or with corners."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.paths.base import Break, Path, Point
from podusv_cli.components.paths.fillet import Fillet, round_corner
from podusv_cli.core.component import value
from podusv_cli.core.interpolation import segment
from podusv_cli.core.kernel import Vector, kernel

ALIGNED = 1e-9  # of the speed; a smaller change of velocity is rounding
FOREVER = 1e300  # s, the period of what never comes again
WIDTH = 9  # numbers in the table for each knot
LOOP = 2.0  # the place of "loop" among the choices of `after`, as kernels know it


# table: `count` times [s], then the four coefficients of north and of east for each stretch. Writes
# target (6), as `circle.on_circle` does. s [s] is the time since the stretch began.
@kernel
def along(t: float, k: Any, table: Vector, target: Vector) -> None:
    """The spline and its derivatives, by Horner's rule."""
    count = int(k.count)
    if k.after == LOOP:
        t -= k.period * math.floor(t / k.period)
    i = segment(t, count, table)
    s = t - table[i]
    for axis in range(2):
        c = count + 8 * i + 4 * axis
        target[axis] = ((table[c] * s + table[c + 1]) * s + table[c + 2]) * s + table[c + 3]
        target[2 + axis] = (3.0 * table[c] * s + 2.0 * table[c + 1]) * s + table[c + 2]
        target[4 + axis] = 6.0 * table[c] * s + 2.0 * table[c + 1]


# Writes target (6), and `shown` (6) with corners rounded.
@kernel
def along_shown(t: float, k: Any, table: Vector, target: Vector, shown: Vector) -> None:
    """The same, and what the law is shown."""
    along(t, k, table, target)
    round_corner(t, k, table, target, shown)


class Waypoints(Path):
    """A natural cubic spline through the points, in the time that chords at `speed` would take.

    Position, velocity and acceleration are continuous, so the speed varies a little in bends. With
    `legs: straight` the target goes along the chords at `speed`, and its velocity jumps at corners.
    After the last point the target goes straight on with the speed it has there, or stops, or goes
    back to the first point and round again.
    """

    kind: Literal["waypoints"] = "waypoints"
    rows_of: ClassVar[dict[str, str]] = {"file": "points"}
    file: str | None = value(
        None, "", "CSV file with one `x,y` [m] a line, beside the scenario; read into `points`"
    )
    points: tuple[Point, ...] = value(
        (), "m", "list of [x, y], at least two, neighbours apart", strict=False
    )
    speed: float = value(0.5, "m/s", "speed along the chords between the points", gt=0)
    legs: Literal["spline", "straight"] = value(
        "spline", "", "between the points: a smooth spline, or straight lines with corners"
    )
    fillet: float = value(
        0.0,
        "s",
        "the law sees each corner of straight legs as a parabola of this duration, half "
        "of it before the corner; log and metrics have the corner. 0: it sees the corner",
        ge=0,
    )
    after: Literal["continue", "stop", "loop"] = value(
        "continue",
        "",
        "after the last point: straight on, a stop, or from there to the first "
        "point and round again",
    )

    @model_validator(mode="after")
    def _check_way(self) -> Self:
        """Raises ValueError for points of which no way can be made, or an unfit fillet."""
        if len(self.points) < 2:
            raise ValueError(f"needs at least two points, has {len(self.points)}")
        # Points too far apart are refused by the sentence below, without numpy's warnings
        with np.errstate(all="ignore"):
            knots = self._knots()
            if np.any(np.diff(knots) <= 0):
                raise ValueError("two neighbouring points are the same")
            if not self._has_numbers(knots):
                raise ValueError(
                    "the times or the course are beyond all numbers; points are too far apart or "
                    "too near, or the speed is too small or too large"
                )
        self._check_fillet(np.diff(knots))
        return self

    def _check_fillet(self, times: Vector) -> None:
        """Raises ValueError for a fillet that does not fit; `times` (legs,) are durations [s]."""
        if self.fillet > 0 and self.legs == "spline":
            raise ValueError("a spline has no corners; write legs: straight, or leave fillet out")
        if self.fillet > times.min():
            leg, least = int(times.argmin()) + 1, times.min()
            raise ValueError(
                f"fillet = {self.fillet:.7g} s is longer than leg {leg} takes ({least:.7g} s), so "
                "two fillets could overlap"
            )
        if self.fillet > 0 and not len(self._corners()[0]):
            raise ValueError("a fillet rounds corners, and this path has none; leave it out")

    def _has_numbers(self, knots: Vector) -> bool:
        """Whether a bound of all numbers on the way to the spline's coefficients is finite.

        `knots` (points,) are the times [s]. Coefficients are places over cubes of steps at most.
        """
        steps, size = np.diff(knots), np.abs(self._course()).max()
        scales = np.maximum(steps, 1.0).max() ** 2 / np.minimum(steps, 1.0).min() ** 3
        return bool(np.isfinite(1e3 * (size + 1.0) * scales))

    def waypoints(self) -> tuple[Point, ...]:
        """The points as they are given."""
        return self.points

    def runs_on_from(self) -> float:
        """When the target passes the last point, if it goes straight on."""
        return float(self._knots()[-1]) if self.after == "continue" else math.inf

    def breaks(self) -> tuple[Break, ...]:
        """The corners, and the stop at the last point; of a loop those of the first round."""
        if self.legs == "spline":
            times = self._knots()[-1:] if self.after == "stop" else np.zeros(0)
        else:
            times, _ = self._corners()
        return tuple(Break(time, "velocity") for time in times.tolist())

    def fillet_for_law(self) -> Fillet | None:
        """The corners; of a loop the first point has one too, from the second round on.

        Its jump at the end of a round is that at the start of the next, so it stands there as well.
        """
        if self.fillet == 0.0:
            return None
        (times, jumps), end = self._corners(), float(self._knots()[-1])
        loop = self.after == "loop"
        if loop and times[-1:] == end:
            times, jumps = np.append(0.0, times), np.vstack([jumps[-1:], jumps])
        return Fillet(self.fillet, end if loop else FOREVER, times, jumps) if len(times) else None

    def _corners(self) -> tuple[Vector, Vector]:
        """Times [s] (corners,) and jumps of the velocity (corners, 2) [m/s].

        Between straight legs and at the last point, where the jump is more than rounding.
        """
        legs, knots = np.diff(self._course(), axis=0), self._knots()
        velocities = legs / np.diff(knots)[:, None]
        after = {"loop": velocities[:1], "stop": np.zeros((1, 2)), "continue": velocities[-1:]}
        jumps = np.diff(np.vstack([velocities, after[self.after]]), axis=0)
        turns = np.abs(jumps).max(axis=1) > ALIGNED * self.speed
        return knots[1:][turns], jumps[turns]

    def _course(self) -> Vector:
        """The points (n, 2) [m] that the spline goes through; a loop ends where it begins."""
        closing = (
            self.points[:1] if self.after == "loop" and self.points[0] != self.points[-1] else ()
        )
        return np.asarray((*self.points, *closing), float)

    def _knots(self) -> Vector:
        """Time [s] at which the target passes each point of `_course` (points,)."""
        chords = np.hypot(*np.diff(self._course(), axis=0).T)
        return np.concatenate([[0.0], np.cumsum(chords)]) / self.speed

    def constants(self) -> dict[str, float]:
        """The speed, what comes after, the number of points, and the time that they take."""
        knots, fillet = self._knots(), self.fillet_for_law()
        own = super().constants() | {"count": float(len(knots)), "period": float(knots[-1])}
        return own | (fillet.constants(WIDTH * len(knots)) if fillet else {})

    def table(self) -> Vector:
        """The knots, eight coefficients a knot: cubic in x and in y, highest power first; corners.

        The last knot's are those of what comes after it: straight on or at rest; on a loop nothing
        reads them. The corners are those that a law sees rounded, if any.
        """
        knots, cubic = self._knots(), self._cubic()
        end = cubic(knots[-1])
        velocity = np.zeros(2) if self.after == "stop" else cubic(knots[-1], 1)
        # In the order of a row: of each axis the cube and the square, 0, then velocity and place
        last = np.concatenate([[0, 0], velocity, end])
        rows = np.vstack(
            [cubic.c.transpose(1, 2, 0).reshape(-1, 8), last[[0, 1, 2, 4, 0, 1, 3, 5]]]
        )
        fillet = self.fillet_for_law()
        return np.concatenate([knots, rows.ravel(), *([fillet.rows()] if fillet else [])])

    def _cubic(self) -> Any:
        """The course through the points: scipy's piecewise cubic polynomials of the time [s]."""
        from scipy.interpolate import CubicSpline, PPoly

        knots, course = self._knots(), self._course()
        if self.legs == "straight":
            slopes = np.diff(course, axis=0) / np.diff(knots)[:, None]
            nothing = np.zeros_like(slopes)
            return PPoly(np.stack([nothing, nothing, slopes, course[:-1]]), knots)
        ends = "periodic" if self.after == "loop" else "natural"
        return CubicSpline(knots, course, bc_type=ends)

    evaluate = staticmethod(along)
    evaluate_shown = staticmethod(along_shown)
