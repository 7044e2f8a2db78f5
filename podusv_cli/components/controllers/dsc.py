"""Dynamic surface control: the same law with a first-order filter of the virtual control.

Source: the paper's reference [26], as the paper describes it. Proved: as for `adaptive_neural`,
with 1/T in place of the shunting model's rate (docs/theory.md). Not proved: any limit of the
actuator, and sampling. Anti-windup: `anti_windup: auxiliary`, outside the proof.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal

from podusv_cli.components.controllers.polar_backstepping import (
    FilteredBackstepping,
    polar_backstepping,
)
from podusv_cli.components.controllers.tracking import Tracking
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel, specialise


# The first-order filter of dynamic surface control. Writes rate[0]; returns beta_u [m/s] and its
# rate.
@kernel
def surge_lag(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any
) -> tuple[float, float]:
    """T_u beta_u' = alpha_u - beta_u."""
    rate[0] = (e.alpha_u - beta[0]) / k.T_u
    return beta[0], rate[0]


# As `surge_lag` for yaw: writes rate[1]; returns beta_r [rad/s] and its rate.
@kernel
def yaw_lag(
    e: Tracking, x: Vector, target: Vector, beta: Vector, rate: Vector, k: Any, tau_u: float
) -> tuple[float, float]:
    """T_r beta_r' = alpha_r - beta_r."""
    rate[1] = (e.alpha_r - beta[1]) / k.T_r
    return beta[1], rate[1]


class DynamicSurface(FilteredBackstepping):
    """Backstepping with a first-order lag of the virtual control, the paper's reference [26]."""

    kind: Literal["dsc"] = "dsc"
    T_u: float = value(0.2, "s", "time constant in surge", gt=0)
    T_r: float = value(0.2, "s", "time constant in yaw", gt=0)
    law: ClassVar[Callable[..., None]] = staticmethod(
        specialise(polar_backstepping, "dsc", surge=surge_lag, yaw=yaw_lag)
    )

    def filter_decay(self, alpha_u: Any, alpha_r: Any) -> tuple[Any, Any]:
        """Rates [1/s] at which both filters forget: 1/T, whatever the virtual control."""
        return alpha_u * 0.0 + 1.0 / self.T_u, alpha_r * 0.0 + 1.0 / self.T_r
