"""Input-output linearisation about a hand point, with integral action.

Source: C. Paliotta, E. Lefeber, K. Y. Pettersen, J. Pinto, M. Costa and J. T. de Figueiredo Borges
de Sousa, "Trajectory tracking and path following for underactuated marine vehicles", IEEE Trans.
Control Systems Technology 27 (2019); not checked against the original. Changed here: the approach
speed is limited, the integral acts in the body frame, and the origin may come to the target instead
of the hand point.

Proved: without loads or with constant ones, off the limits, the hand point comes to its target if
the loop settles. Not proved: the heading with `reference: origin`, and any limit. Anti-windup:
back-calculation. docs/laws/hand_position.md has the derivation.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.hand_point import PSI_F, HandController, hand_errors, push
from podusv_cli.components.controllers.velocity_loop import Axis, Loop
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

I_A, I_B, LAGGED = range(3)  # positions in the memory
INTEGRALS = (
    Signal("integral_a", "m/s2", "integral action along the bow (hand_position)", "I_a"),
    Signal("integral_b", "m/s2", "integral action across the bow (hand_position)", "I_b"),
)


class HandPosition(HandController):
    """Moves the hand point as a mass that can be pushed anywhere; its integral finds the loads."""

    kind: Literal["hand_position"] = "hand_position"
    rules: ClassVar[dict[str, Rule]] = HandController.rules | {"k_i": by.HAND_SQUARED}
    k_i: Ruled = value(0.25, "1/s2", "gain of the integral of the missing velocity", ge=0)

    def slots(self) -> Slots:
        """The memory: the integrals and the lagged heading."""
        return each((*INTEGRALS, PSI_F))

    def wants_loads(self) -> bool:
        """Whether it has to know the loads that act: always, for anti-windup."""
        return True

    def velocity_loops(self, axes: tuple[Axis, Axis], nu: Vector) -> list[Loop]:
        """nu' = -gain nu + I, I' = -k_i nu for the axes at rest (nu = 0), with I_b per `hand`.

        The law cancels the damping, which is added here.
        """
        return [
            Loop(
                axis.name,
                "k_v",
                axis.damping,
                np.array([axis.damping, 0.0]) + np.array([-gain, 1.0]) * axis.told / axis.inertia,
                np.array([[-self.k_i, 0.0]]),
            )
            for axis, gain in zip(axes, self.rate_gains(), strict=True)
        ]

    # demand (2), tau (3), rate (3): what the loads fall short of, as accelerations of the hand
    # point.
    @staticmethod
    @kernel
    def after_saturation(demand: Vector, tau: Vector, k: Any, rate: Vector) -> None:
        """Back-calculation with the tracking time k_v/k_i (Astrom and Hagglund; Hanus)."""
        share = k.k_i / k.k_v
        rate[I_A] += share * (tau[0] - demand[0]) / k.m11
        rate[I_B] += share * (k.hand * (tau[2] - demand[1]) / k.m33 + tau[1] / k.m22)

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
        """A + k_v s + I along and across the bow."""
        h = hand_errors(x, memory[LAGGED], target, k)
        along = h.A_a + k.k_v * h.s_a + memory[I_A]
        across = h.A_b + k.k_v * h.s_b + memory[I_B]
        push(x, along, across, 0.0, 0.0, 0.0, k, tau)
        rate[I_A], rate[I_B], rate[LAGGED] = k.k_i * h.s_a, k.k_i * h.s_b, h.psi_f_rate
        signals[0], signals[1], signals[2] = h.s_a, h.s_b, h.distance
