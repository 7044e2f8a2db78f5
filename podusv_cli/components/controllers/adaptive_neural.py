"""The paper's law: adaptive neural backstepping with a neural shunting model, (22) and (31).

Source: the paper. Proved: all errors are ultimately bounded where the gain conditions hold, which
docs/theory.md checks along every run. Not proved: any limit of the actuator, sampling, and the
option `standoff_reference: crab`. Anti-windup: `anti_windup: auxiliary`, outside the proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal

from podusv_cli.components.controllers.polar_backstepping import (
    FilteredBackstepping,
    polar_backstepping,
)
from podusv_cli.components.controllers.tracking import Tracking
from podusv_cli.core.component import Positive, value
from podusv_cli.core.kernel import Vector, kernel, specialise


# alpha and beta [m/s or rad/s], A and B [1/s]; the rate is in the unit of beta a second.
@kernel
def shunting_rate(alpha: float, beta: float, A: float, B: float) -> float:
    """Rate of the shunting model (17) with f = max(alpha, 0), g = max(-alpha, 0) and D = B.

    An absent B (NaN) is the printed B = A + |alpha|, with which the model is the first-order
    filter (41); with a constant B its gain is B/(A + |alpha|) and |beta| stays below B.
    """
    decay = A + abs(alpha)
    return -decay * beta + (decay if math.isnan(B) else B) * alpha


# x, target and beta (2) are as `polar_backstepping` has them. Writes rate[0]; returns beta_u [m/s]
# and its rate.
@kernel
def surge_shunting(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any
) -> tuple[float, float]:
    """(22)."""
    rate[0] = shunting_rate(e.alpha_u, beta[0], k.A_u, k.B_u)
    return beta[0], rate[0]


# As `surge_shunting` for yaw: writes rate[1]; returns beta_r [rad/s] and its rate.
@kernel
def yaw_shunting(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any, tau_u: float
) -> tuple[float, float]:
    """(31)."""
    rate[1] = shunting_rate(e.alpha_r, beta[1], k.A_r, k.B_r)
    return beta[1], rate[1]


class AdaptiveNeural(FilteredBackstepping):
    """Backstepping with shunting filters and a network that learns: the law of Mu et al. (2017).

    `B_u` and `B_r` are adaptive as printed, or numbers.
    """

    kind: Literal["adaptive_neural"] = "adaptive_neural"
    A_u: float = value(5.0, "1/s", "passive decay A_1 of the shunting model in surge", gt=0)
    A_r: float = value(5.0, "1/s", "passive decay A_2 of the shunting model in yaw", gt=0)
    B_u: Literal["adaptive"] | Positive = value(
        "adaptive", "1/s", "bounds B_1 = D_1 in surge: `adaptive` is A + |alpha| as printed"
    )
    B_r: Literal["adaptive"] | Positive = value(
        "adaptive", "1/s", "bounds B_2 = D_2 in yaw: `adaptive` is A + |alpha| as printed"
    )
    law: ClassVar[Callable[..., None]] = staticmethod(
        specialise(polar_backstepping, "adaptive_neural", surge=surge_shunting, yaw=yaw_shunting)
    )

    def filter_decay(self, alpha_u: Any, alpha_r: Any) -> tuple[Any, Any]:
        """A + |alpha| [1/s] of surge and yaw, see (41) and (45); numbers or arrays, as alpha is."""
        return self.A_u + abs(alpha_u), self.A_r + abs(alpha_r)
