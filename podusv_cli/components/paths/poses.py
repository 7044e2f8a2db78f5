"""A target with a heading: from pose to pose, as in the four-corner test of dynamic positioning."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.paths.base import Path, Point
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import PSI_D

Pose = tuple[float, float, float]


# table: poses (n, 3); s: the part of the `travel` time [s] that is over; writes target (10):
# position [m] with two rates, the distance, which is not this kernel's, heading [rad] with two
# rates. part, speed, growth are the quintic and its derivatives after time, the same for all
# coordinates.
@kernel
def between_poses(i: int, j: int, s: float, travel: float, table: Vector, target: Vector) -> None:
    """The quintic from pose i to pose j."""
    part = s * s * s * (10.0 + s * (6.0 * s - 15.0))
    speed = 30.0 * s * s * (1.0 + s * (s - 2.0)) / travel
    growth = s * (60.0 + s * (120.0 * s - 180.0)) / (travel * travel)
    for axis in range(2):
        way = table[3 * j + axis] - table[3 * i + axis]
        target[axis] = table[3 * i + axis] + way * part
        target[2 + axis] = way * speed
        target[4 + axis] = way * growth
    way = table[3 * j + 2] - table[3 * i + 2]
    target[PSI_D] = table[3 * i + 2] + way * part
    target[PSI_D + 1] = way * speed
    target[PSI_D + 2] = way * growth


class Poses(Path):
    """Stays at each pose for `dwell`, and goes to the next in `travel`; the last one is kept.

    On the way each coordinate follows 10 s^3 - 15 s^4 + 6 s^5, whose velocity and acceleration
    are 0 at both ends. Headings are taken as they are, not the short way round.
    """

    kind: Literal["poses"] = "poses"
    heads: ClassVar[bool] = True
    rests: ClassVar[bool] = True
    poses: tuple[Pose, ...] = value(
        ..., "m, m, rad", "list of [x, y, psi], at least one", strict=False
    )
    travel: float = value(40.0, "s", "time from one pose to the next", gt=0)
    dwell: float = value(20.0, "s", "time at each pose", ge=0)

    @model_validator(mode="after")
    def _some(self) -> Self:
        """Raises ValueError for a path without a pose."""
        if not self.poses:
            raise ValueError("poses is empty; give at least one [x, y, psi]")
        return self

    def constants(self) -> dict[str, float]:
        """Times of a way and a stay [s], and how many poses there are."""
        return {"travel": self.travel, "dwell": self.dwell, "count": float(len(self.poses))}

    def table(self) -> Vector:
        """The poses [m, m, rad], one behind another: (3 poses,)."""
        return np.array(self.poses, float).ravel()

    def waypoints(self) -> tuple[Point, ...]:
        """Where the poses are [m]."""
        return tuple((x, y) for x, y, _ in self.poses)

    # t [s]; table: poses (count, 3); writes target (10), as `between_poses` does. A period is the
    # stay at pose i, then the way to the next one.
    @staticmethod
    @kernel
    def evaluate(t: float, k: Any, table: Vector, target: Vector) -> None:
        """The quintic between two poses."""
        period, last = k.travel + k.dwell, int(k.count) - 1
        i = min(int(max(t, 0.0) / period), last)
        s = min(max((t - i * period - k.dwell) / k.travel, 0.0), 1.0)
        between_poses(i, min(i + 1, last), s, k.travel, table, target)
