"""What every disturbance offers."""

from __future__ import annotations

from typing import Any, ClassVar

from podusv_cli.core.component import Component
from podusv_cli.core.kernel import Vector


class Disturbance(Component):
    """A load on the hull in the body frame.

    `evaluate(t, x, k, table, b)` is a kernel that writes (b_u [N], b_v [N], b_r [N m]) at time
    t [s] and state x = (x, y, psi, u, v, r) into `b`. One that does not look at x says so with
    `of_time`, and is not asked twice for the same t.
    """

    noun: ClassVar[str] = "disturbance"

    of_time: ClassVar[bool] = False

    @staticmethod
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        """Write the load; every disturbance has its own."""
        raise NotImplementedError

    def bounds(self) -> tuple[float, float, float] | None:
        """What |b_u| [N], |b_v| [N], |b_r| [N m] never exceed, at any time and state.

        None where that is unknown. The load need not reach its bounds.
        """
        return None
