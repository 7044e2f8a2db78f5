"""First-order lags, and velocities as the derivative of the filtered pose.

With z the measured values as delivered last, and T_p, T_psi, T_nu the time constants,

    x_est' = (z_x - x_est)/T_p,   y_est' = (z_y - y_est)/T_p,   psi_est' = (z_psi - psi_est)/T_psi
    nu_est' = (z_nu - nu_est)/T_nu

A velocity that is not measured takes the place of z_nu from the rates above: (u, v) from
R(psi_est)^T (x_est', y_est'), r from psi_est'. It is the derivative of the filtered pose, filtered
once more with T_nu. Without this second lag it would jump with every delivery.

What it costs: at a constant speed V the position is V (T_p + P/2) behind, where P is the time
between deliveries; at a constant yaw rate r the heading is r (T_psi + P/2) behind. A measured
velocity is T_nu + P/2 late, one from the pose T_p + T_nu + P/2. While nothing is delivered, the
estimate goes to the last delivered value, and velocities from the pose go to zero.
"""

from __future__ import annotations

from typing import Any, Literal

from podusv_cli.components.estimators.base import POSE_ALONE, Estimator
from podusv_cli.components.measurements.base import KNOWN, VALUE
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap


# seen as the sensors write it (VALUE, KNOWN), state (6) the estimate; `time` [s] is the lag,
# `derived` [m/s or rad/s] what the pose's rates say. Returns m/s2 or rad/s2.
@kernel
def lagging(i: int, derived: float, time: float, seen: Vector, state: Vector) -> float:
    """Rate of velocity i, towards what is measured or else towards what the pose says."""
    goal = seen[VALUE + i] if seen[KNOWN + i] != 0.0 else derived
    return float((goal - state[i]) / time)


class LowPass(Estimator):
    """A lag for each measured value; velocities from the pose where they are not measured."""

    kind: Literal["low_pass"] = "low_pass"
    T_p: float = value(0.3, "s", "time constant of the position", gt=0)
    T_psi: float = value(0.2, "s", "time constant of the heading", gt=0)
    T_nu: float = value(0.3, "s", "time constant of the velocities", gt=0)

    @staticmethod
    @kernel
    def correct() -> None:
        """Nothing jumps."""

    # seen as the sensors write it (VALUE), state (6) the estimate; writes rate (6).
    @staticmethod
    @kernel
    def follow(seen: Vector, state: Vector, k: Any, rate: Vector) -> None:
        """Go towards the values delivered last."""
        north = (seen[VALUE] - state[0]) / k.T_p
        east = (seen[VALUE + 1] - state[1]) / k.T_p
        turning = wrap(seen[VALUE + 2] - state[2]) / k.T_psi
        rate[0], rate[1], rate[2] = north, east, turning
        cosine, sine = cos_sin(state[2])
        rate[3] = lagging(3, cosine * north + sine * east, k.T_nu, seen, state)
        rate[4] = lagging(4, cosine * east - sine * north, k.T_nu, seen, state)
        rate[5] = lagging(5, turning, k.T_nu, seen, state)

    def needs(self) -> tuple[bool, ...]:
        """What has to be measured: the pose."""
        return POSE_ALONE

    def shortest_lag(self) -> float:
        """The smallest of its time constants [s]."""
        return min(self.T_p, self.T_psi, self.T_nu)
