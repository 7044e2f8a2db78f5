"""Active disturbance rejection: exact linearisation about a hand point with observed loads.

The motion of the hand point is linearised with the nominal vessel, and what that vessel does not
explain is rejected with the extended state observer. Source: J. Han, "From PID to active
disturbance rejection control", IEEE Trans. Industrial Electronics 56 (2009), 900-906; the hand
point as in `hand_position`.

Proved: with known loads, off the limits and behind a pure moment, the hand point comes to its
target. Not proved: the heading with `reference: origin`, any limit, and pods, where an offset
stays. Anti-windup: the observer knows the loads that act. Derivation:
docs/laws/hand_position.md.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Slots, each
from podusv_cli.components.controllers.hand_point import PSI_F, HandController, hand_errors, push
from podusv_cli.components.controllers.observer import B_R, B_U, B_V, ObservingController, observe
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.core.component import Rule
from podusv_cli.core.kernel import Vector, kernel

LAGGED = 6  # position in the memory, behind the observer


class Adrc(HandController, ObservingController):
    """Moves the hand point as a mass that can be pushed anywhere; an observer finds the loads."""

    kind: Literal["adrc"] = "adrc"
    rules: ClassVar[dict[str, Rule]] = HandController.rules | by.OBSERVER

    def slots(self) -> Slots:
        """The memory: the observer's, and the lagged heading."""
        return super().slots() + each((PSI_F,))

    def axis_gains(self, axes: tuple[Axis, Axis]) -> tuple[tuple[str, float, float], ...]:
        """Key, gain [1/s] and observer's bandwidth [rad/s] of surge and yaw, for a hull at rest."""
        surge, yaw = self.rate_gains()
        return ("k_v", surge, self.omega_u), ("k_v", yaw, self.omega_r)

    # x (6), memory and rate (7), target (6); writes tau (2) [N, N m], rate and signals (3). The
    # loads are taken off in `push`, and the observer is told the demand that follows.
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
        """A + k_v s along and across the bow, less the observed loads."""
        h = hand_errors(x, memory[LAGGED], target, k)
        along, across = h.A_a + k.k_v * h.s_a, h.A_b + k.k_v * h.s_b
        push(x, along, across, memory[B_U], memory[B_V], memory[B_R], k, tau)
        observe(x, memory, tau, k, rate)
        rate[LAGGED] = h.psi_f_rate
        signals[0], signals[1], signals[2] = h.s_a, h.s_b, h.distance
