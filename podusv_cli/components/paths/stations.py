"""Poses that are kept one after the other, each until the vessel has been there for a while."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.paths.base import Path, Point
from podusv_cli.components.paths.poses import Pose, Poses, between_poses
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal

PLACES = (
    Signal("station", "1", "stations done, so the number of the one to keep from 0 on"),
    Signal("left_at", "s", "time at which the target left the station before"),
    Signal("there_since", "s", "since when the vessel is within the tolerances; -1: it is not"),
)
STATION, LEFT, SINCE = range(3)  # their positions
AWAY = -1.0  # s, of a vessel that is not there
NEAR = 1e-9  # s; a time this near to the one asked for has come


class Stations(Path):
    """Stays at each pose until the vessel has been there for `keep`, then goes to the next.

    There is within `radius` and `angle` of the pose, as the law sees it, once the target is there.
    On the way, which takes `travel`, each coordinate follows 10 s^3 - 15 s^4 + 6 s^5. Once the last
    station has been kept, metrics end, and the target stays.
    """

    kind: Literal["stations"] = "stations"
    follows: ClassVar[bool] = True
    waits: ClassVar[bool] = True
    heads: ClassVar[bool] = True
    rests: ClassVar[bool] = True
    places: ClassVar[tuple[Signal, ...]] = PLACES
    poses: tuple[Pose, ...] = value(
        ..., "m, m, rad", "list of [x, y, psi], at least one", strict=False
    )
    radius: float = value(0.25, "m", "distance to the pose within which the vessel is there", gt=0)
    angle: float = value(0.1, "rad", "heading error within which the vessel is there", gt=0)
    keep: float = value(10.0, "s", "how long the vessel has to be there without a break", ge=0)
    travel: float = value(40.0, "s", "time from one pose to the next", gt=0)

    @model_validator(mode="after")
    def _check_poses(self) -> Self:
        """Raises ValueError for a path without a pose."""
        # Raises as `Poses` does
        self._traveller()
        return self

    def _traveller(self) -> Poses:
        """The path of a target that leaves each pose by the clock, after `keep` [s]."""
        return Poses(poses=self.poses, travel=self.travel, dwell=self.keep)

    def whole_targets(self, times: Iterable[float]) -> Vector:
        """The target of a vessel that is there when the target is."""
        return self._traveller().whole_targets(times)

    def waypoints(self) -> tuple[Point, ...]:
        """Where the poses are [m]."""
        return self._traveller().waypoints()

    def passed_by(self, share: float) -> dict[str, float]:
        """Stations that are done at a `share` from 0 to 1; so little is added that 3/3 is 3."""
        # NEAR: a whole number of stations may have been rounded to just below it
        return {"station": float(int(np.clip(share, 0.0, 1.0) * len(self.poses) + NEAR))}

    def constants(self) -> dict[str, float]:
        """The fields' numbers, and how many poses there are."""
        return super().constants() | {"count": float(len(self.poses))}

    def table(self) -> Vector:
        """The poses [m, m, rad], one behind another: (3 poses,)."""
        return self._traveller().table()

    # x (6) as the law sees it; changes place (3). While the target is still on its way here, being
    # near does not count.
    @staticmethod
    @kernel
    def locate(t: float, x: Vector, place: Vector, k: Any, table: Vector) -> None:
        """The next station, once the vessel has been at this one for long enough."""
        station = int(place[STATION])
        if station < int(k.count):
            pose = tail(table, 3 * station)
            north, east, turn = x[0] - pose[0], x[1] - pose[1], abs(wrap(x[2] - pose[2]))
            square = north * north + east * east
            on_the_way = station > 0 and t - place[LEFT] < k.travel - NEAR
            if on_the_way or square > k.radius * k.radius or turn > k.angle:
                place[SINCE] = AWAY
            elif place[SINCE] < 0.0:
                place[SINCE] = t
            if place[SINCE] >= 0.0 and t - place[SINCE] >= k.keep - NEAR:
                place[STATION], place[LEFT], place[SINCE] = station + 1.0, t, AWAY

    # target (10) as `Poses` has it.
    @staticmethod
    @kernel
    def evaluate(t: float, place: Vector, k: Any, table: Vector, target: Vector) -> None:
        """The quintic from the station before, begun when the target left that."""
        station, last = int(place[STATION]), int(k.count) - 1
        s = min(max((t - place[LEFT]) / k.travel, 0.0), 1.0)
        between_poses(max(station - 1, 0), min(station, last), s, k.travel, table, target)
