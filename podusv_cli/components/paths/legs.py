"""Straight legs between waypoints, followed without a timetable.

Leg k goes from waypoint k to k + 1 in the direction alpha_k = atan2(y_{k+1} - y_k, x_{k+1} - x_k).
The vessel is beside it by the cross-track error

    e_ct = -(x - x_k) sin alpha_k + (y - y_k) cos alpha_k

and the next leg is active once the vessel is within the acceptance radius of waypoint k + 1.
Source: T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion Control" (2011), section
10.3.2; not checked against the original. Laws that track see a target beside them, which moves on
the active leg at the wanted speed, so that they follow legs, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components import rules as by
from podusv_cli.components.paths.base import Path, Point
from podusv_cli.components.paths.waypoints import Waypoints
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel, scratch, tail
from podusv_cli.core.signal import Signal

PLACES = (
    Signal("leg", "1", "legs done, so the number of the active one from 0 on", r"\mathrm{leg}"),
    Signal("e_ct", "m", "cross-track error: the vessel to the right of the active leg"),
    Signal("along_leg", "m", "the vessel along the active leg, from its first waypoint", "s"),
)
LEG, E_CT, ALONG = range(3)  # their positions
PASSED = 1.0  # the place of "passed" among the choices of `switch`


# Reads (x[0], x[1]) and the corners (n, 2) [m] in table. Writes at (5); across is to starboard.
@kernel
def leg_frame(x: Vector, leg: int, table: Vector, at: Vector) -> None:
    """at = direction of a leg (cosine, sine), its length, and the vessel along and across it."""
    a, b = tail(table, 2 * leg), tail(table, 2 * leg + 2)
    north, east = b[0] - a[0], b[1] - a[1]
    length = math.sqrt(north * north + east * east)
    c, s = north / length, east / length
    at[0], at[1], at[2] = c, s, length
    at[3] = (x[0] - a[0]) * c + (x[1] - a[1]) * s
    at[4] = (x[1] - a[1]) * c - (x[0] - a[0]) * s


class Legs(Path):
    """Straight legs through the points, each followed until the next waypoint is near.

    Past the last waypoint the last leg goes on, and metrics end.
    """

    kind: Literal["legs"] = "legs"
    follows: ClassVar[bool] = True
    rows_of: ClassVar[dict[str, str]] = {"file": "points"}
    rules: ClassVar[dict[str, Rule]] = {"acceptance": by.LENGTH}
    places: ClassVar[tuple[Signal, ...]] = PLACES
    file: str | None = value(
        None, "", "CSV file with one `x,y` [m] a line, beside the scenario; read into `points`"
    )
    points: tuple[Point, ...] = value(
        (), "m", "list of [x, y], at least two, neighbours apart", strict=False
    )
    speed: float = value(0.5, "m/s", "wanted speed along the legs", gt=0)
    acceptance: Ruled = value(
        2.0, "m", "distance to a waypoint within which the next leg becomes active", gt=0
    )
    switch: Literal["circle", "passed"] = value(
        "circle",
        "",
        "when the next leg becomes active: within the acceptance radius of its first "
        "waypoint (circle), or also where the vessel is past the end of its leg (passed)",
    )

    @model_validator(mode="after")
    def _check_way(self) -> Self:
        """Raises ValueError for points of which no way can be made."""
        # Raises as `Waypoints` does
        self._traveller()
        return self

    def _traveller(self) -> Waypoints:
        """The path of a target with a timetable on the same legs."""
        return Waypoints(points=self.points, speed=self.speed, legs="straight")

    def waypoints(self) -> tuple[Point, ...]:
        """The points as they are given."""
        return self.points

    def whole_targets(self, times: Iterable[float]) -> Vector:
        """A traveller on the legs, as fast as wanted, round every waypoint without a detour."""
        return self._traveller().whole_targets(times)

    def circles(self) -> tuple[tuple[float, float, float], ...]:
        """Where waypoints count as reached: each but the first, with the acceptance radius [m]."""
        return tuple((x, y, self.acceptance) for x, y in self.points[1:])

    def passed_by(self, share: float) -> dict[str, float]:
        """Legs that are done, and metres along the next one; at the end all legs.

        `share` of the whole length, from 0 to 1, by the names of `places`.
        """
        lengths = np.hypot(*np.diff(self.points, axis=0).T)
        begins = np.concatenate([[0.0], np.cumsum(lengths)])  # m from the first waypoint
        way = share * begins[-1]
        leg = int(np.searchsorted(begins, way, side="right")) - 1
        if share <= 0.0:
            return {"leg": 0.0}  # also where the vessel starts before the first waypoint
        if share >= 1.0 or leg >= len(lengths):
            return {"leg": float(len(lengths))}
        return {"leg": float(leg), "along_leg": float(way - begins[leg])}

    def constants(self) -> dict[str, float]:
        """The fields' numbers, and how many legs there are."""
        return super().constants() | {"legs": float(len(self.points) - 1)}

    def constants_with(self, standoff: float) -> dict[str, float]:
        """The constants, and how far ahead of the vessel on its leg the law sees its target [m]."""
        return self.constants() | {"lead": standoff}

    def table(self) -> Vector:
        """The points [m], north and east in turn: (2 points,)."""
        return np.asarray(self.points, float).ravel()

    # x (6) is what the law sees, s (6) the state; changes place (3): leg, distance across [m] and
    # along [m]. table: corners (n, 2) [m].
    @staticmethod
    @kernel
    def locate(x: Vector, s: Vector, place: Vector, k: Any, table: Vector) -> None:
        """The active leg by what the law sees, and where the vessel is on it in truth."""
        at, last = scratch(5), int(k.legs) - 1
        leg = int(place[LEG])
        if leg <= last:
            leg_frame(x, leg, table, at)
            ahead = at[2] - at[3]
            near = ahead * ahead + at[4] * at[4] < k.acceptance * k.acceptance
            if near or (k.switch == PASSED and ahead < 0.0):
                leg += 1
        leg_frame(s, min(leg, last), table, at)
        place[LEG], place[E_CT], place[ALONG] = leg, at[4], at[3]

    # x (6) as the law sees it, place (3), table: corners (n, 2) [m]; writes target (6). It has no
    # acceleration: a leg is straight.
    @staticmethod
    @kernel
    def evaluate(x: Vector, place: Vector, k: Any, table: Vector, target: Vector) -> None:
        """The point beside the vessel, or ahead of it by the lead, moving at the wanted speed."""
        at = scratch(5)
        leg = min(int(place[LEG]), int(k.legs) - 1)
        leg_frame(x, leg, table, at)
        s = at[3] + k.lead
        target[0], target[1] = table[2 * leg] + s * at[0], table[2 * leg + 1] + s * at[1]
        target[2], target[3] = k.speed * at[0], k.speed * at[1]
        target[4], target[5] = 0.0, 0.0
