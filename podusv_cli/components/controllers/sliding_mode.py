"""Sliding modes of the hand point: it resists loads whose bound alone is known.

Source of the first order with a boundary layer: J.-J. E. Slotine and W. Li, "Applied Nonlinear
Control" (1991; not checked against the original), with the reaching law of W. Gao and J. C. Hung,
"Variable structure control of nonlinear systems: a new approach", IEEE Trans. Industrial
Electronics 40 (1993), 45-55. Super-twisting: A. Levant, "Sliding order and sliding accuracy in
sliding mode control", Int. J. Control 58 (1993), 1247-1263. On surface vessels: H. Ashrafiuon,
K. R. Muske, L. C. McNinch and R. A. Soltan, IEEE Trans. Industrial Electronics 55 (2008; not
checked against the original). The surface is podusv's: the velocity that the hand point lacks.

Proved, off the limits: the velocity that the hand point lacks comes into a ball
(docs/laws/sliding_mode.md).
Not proved: super-twisting on two coupled axes, the heading, and pods. Anti-windup: the first order
has no memory; super-twisting learns the less, the more the actuator falls short.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.hand_point import PSI_F, HandController, hand_errors, push
from podusv_cli.components.controllers.velocity_loop import Axis, Loop
from podusv_cli.components.facts import Facts
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

Z_A, Z_B, LAGGED = range(3)  # positions in the memory
TWISTED = (
    Signal("twist_a", "m/s2", "what super-twisting has learnt along the bow", "z_a"),
    Signal("twist_b", "m/s2", "what super-twisting has learnt across the bow", "z_b"),
)
TWISTING = 1.0
ETA0, PHI0 = 0.2, 0.02  # of the model ship [m/s2, m/s]
LATE = 0.35  # of the boundary layer, what eta adds to a velocity within a delay
AUTHORITY = "min(a_F/a0, (hand/hand0) (w_N/w0)^2)"


def authority(facts: Facts) -> float:
    """Acceleration that the actuator gives the hand point, over that of the model ship."""
    return min(facts.a_f, by.reach(facts) * facts.w_f * facts.w_f)


def layer(facts: Facts) -> float:
    """Boundary layer [m/s] that a delay does not turn into a relay."""
    return max(PHI0 * facts.s, ETA0 * authority(facts) * facts.T_r / LATE)


def root(facts: Facts) -> float:
    """eta/phi sqrt(phi), over that of the model ship [1]: how stiff the sliding mode is."""
    return authority(facts) * math.sqrt(PHI0 / layer(facts))


# z [m/s2] is what super-twisting has learnt; the root is rounded off within phi, where it is
# steepest.
@kernel
def reach(s: float, z: float, k: Any) -> float:
    """Acceleration [m/s2] that drives the missing velocity s [m/s] to zero."""
    if k.reaching == TWISTING:
        return float(k.k_v * s + k.lambda_1 * s / math.sqrt(abs(s) + k.phi) + z)
    return float(k.k_v * s + k.eta * min(max(s / k.phi, -1.0), 1.0))


# s [m/s] is the velocity that is missing; in m/s3. It is 0 with any other reaching.
@kernel
def twist(s: float, k: Any) -> float:
    """Rate of z: lambda_2 with the sign of s, rounded off within phi."""
    return float(k.lambda_2 * s / (abs(s) + k.phi)) if k.reaching == TWISTING else 0.0


class SlidingMode(HandController):
    """Pushes the hand point to its wanted velocity with all that the loads can be, and more."""

    kind: Literal["sliding_mode"] = "sliding_mode"
    rules: ClassVar[dict[str, Rule]] = HandController.rules | {
        "eta": by.times(f"A = {AUTHORITY}", authority),
        "phi": Rule(
            "the larger of {:g} U/U0 and eta T_r/0.35", lambda facts, phi: layer(facts) * phi / PHI0
        ),
        "lambda_1": by.times("eta/phi sqrt(phi) over the model ship's", root),
        "lambda_2": by.times("A g_h, A as of eta", lambda facts: authority(facts) * facts.g_h),
    }
    reaching: Literal["boundary_layer", "super_twisting"] = value(
        "boundary_layer",
        "",
        "how the surface is reached: first order with a boundary layer, or "
        "second order, which learns slow loads",
    )
    eta: Ruled = value(0.2, "m/s2", "bound of the loads, as accelerations of the hand point", gt=0)
    phi: Ruled = value(0.02, "m/s", "boundary layer: half its width, or the rounding", gt=0)
    lambda_1: Ruled = value(0.6, "m1/2 s-3/2", "gain of the root (super-twisting)", ge=0)
    lambda_2: Ruled = value(0.08, "m/s3", "bound of the loads' rate (super-twisting)", ge=0)

    def slots(self) -> Slots:
        """The memory: what super-twisting has learnt, and the lagged heading."""
        return each((*TWISTED, PSI_F))

    def wants_loads(self) -> bool:
        """Always, for anti-windup; the first order has nothing that could wind up."""
        return True

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """Within the boundary layer at rest: nu' = -gain nu + z, z' = -(lambda_2/phi) nu.

        For the axes surge and yaw, whose damping the law cancels. Reaching of first order has no z,
        so only the first number of each row is kept.
        """
        key, slope, learning = "eta", self.eta / self.phi, np.zeros((0, 1))
        if self.reaching == "super_twisting":
            key, slope = "lambda_1", self.lambda_1 / math.sqrt(self.phi)
            learning = np.array([[-self.lambda_2 / self.phi, 0.0]])
        count = learning.shape[1]
        return [
            Loop(
                axis.name,
                key,
                axis.damping,
                np.array([axis.damping, 0.0])[:count]
                + np.array([-gain - slope, 1.0])[:count] * axis.told / axis.inertia,
                learning,
            )
            for axis, gain in zip(axes, self.rate_gains(), strict=True)
        ]

    # demand (2) [N, N m], tau (3) [N, N, N m]; changes rate at Z_A and Z_B.
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Learn the less, the more acceleration the actuator falls short of, against eta."""
        a, b = (tau[0] - demand[0]) / k.m11, k.hand * (tau[2] - demand[1]) / k.m33
        rate[Z_A] *= k.eta * k.eta / (k.eta * k.eta + a * a)
        rate[Z_B] *= k.eta * k.eta / (k.eta * k.eta + b * b)

    # x (6), memory and rate (3), target (6); writes tau (2) [N, N m], rate and signals (3).
    @staticmethod
    @kernel
    def law(
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """A plus the reaching law along and across the bow; no load is known."""
        h = hand_errors(x, memory[LAGGED], target, k)
        along = h.A_a + reach(h.s_a, memory[Z_A], k)
        across = h.A_b + reach(h.s_b, memory[Z_B], k)
        push(x, along, across, 0.0, 0.0, 0.0, k, tau)
        rate[Z_A], rate[Z_B], rate[LAGGED] = twist(h.s_a, k), twist(h.s_b, k), h.psi_f_rate
        signals[0], signals[1], signals[2] = h.s_a, h.s_b, h.distance
