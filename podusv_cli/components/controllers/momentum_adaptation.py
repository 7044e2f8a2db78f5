"""How much more sway answers yaw than told, learnt from the observer of the sway velocity.

A hull with v' = ... - (P + dP) r, told P, makes the observer of the sway velocity miss v by

    e_v = -(dP - dP_hat) phi,   phi = s/(s + omega_v)^2 r

while the loads are constant and dP_hat changes slowly. So dP_hat' = -gamma phi e_v/(phi_0^2 +
phi^2), the normalised gradient, lets the error fall wherever the vessel turns to and fro; in a
steady turn the answer cannot be told from a load, and phi is 0. Source: P. A. Ioannou and J. Sun,
"Robust Adaptive Control" (1996), chapter 4; not checked against the original.
"""

from __future__ import annotations

from typing import Any

from podusv_cli.components.controllers.observer import R_HAT, V_HAT, sway_yaw_rates
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

MORE, PHI, LAG = 7, 8, 9  # positions in the memory
LEARNT = (
    Signal(
        "dP", "m/s", "how much more sway answers yaw than nominal, per yaw rate", r"\Delta\hat P"
    ),
    Signal("phi", "rad", "yaw rate as it is seen in the observed sway", r"\phi"),
    Signal("phi_lag", "rad s", "integral of phi", r"\int\phi"),
)
PHI_0 = 0.02  # rad; a slighter turning to and fro teaches less
MOST = 0.2  # of U, what is learnt at most


@kernel
def answer_force(r: float, memory: Vector, k: Any) -> float:
    """The sway force [N] beyond the told one that comes with the yaw rate r [rad/s]."""
    return float(-k.m22 * memory[MORE] * r)


# x (6) state. Reads memory and changes rate at V_HAT, R_HAT, PHI, LAG and MORE. phi = s/(s +
# omega)^2 r has two states, phi and its integral. What is learnt may only come back at its limit.
# The rate is normalised by phi, so that fast turns do not learn too fast.
@kernel
def adapt(x: Vector, memory: Vector, k: Any, rate: Vector) -> None:
    """Rates of what is learnt, within +-0.2 U; the observer is told the force that is known of."""
    r, phi, omega = x[5], memory[PHI], k.omega_v
    e_v, more = x[4] - memory[V_HAT], memory[MORE]
    v_rate, r_rate = sway_yaw_rates(answer_force(r, memory, k), 0.0, k)
    rate[V_HAT] += v_rate
    rate[R_HAT] += r_rate
    rate[PHI] = r - omega * (2.0 * phi + omega * memory[LAG])
    rate[LAG] = phi
    learns = -k.gamma * phi * e_v / (PHI_0 * PHI_0 + phi * phi)
    stuck = abs(more) >= MOST * k.U and learns * more > 0.0
    rate[MORE] = 0.0 if stuck else learns
