"""Line of sight that learns the crab angle, so that it stays on the path in a cross load.

Source of `adaptive`, ALOS: T. I. Fossen, "An adaptive line-of-sight (ALOS) guidance law for path
following of aircraft and marine craft", IEEE Trans. Control Systems Technology 31 (2023),
2887-2894. Of `integral`, ILOS: E. Borhaug, A. Pavlov and K. Y. Pettersen, "Integral LOS control for
path following of underactuated marine surface vessels in the presence of constant ocean currents",
IEEE CDC (2008), 4984-4991. The speed that follows the target, and the autopilot with observed
loads, are podusv's.

Proved, for a heading that is exact and a constant crab angle: the cross-track error tends to 0. Not
proved: the autopilot together with the guidance, and any limit. Anti-windup: the observer is told
the loads that act; what is learnt grows slowly far from the line. Equations: docs/laws/alos.md.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

from podusv_cli.components import rules as by
from podusv_cli.components.controllers.base import Most, Slots, each
from podusv_cli.components.controllers.guidance import (
    STEERED,
    LineOfSight,
    course_frame,
    line_of_sight,
    wanted_speed,
)
from podusv_cli.components.controllers.observer import B_R, B_U, ObservingController, observe
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.components.vessels.plant import surge_force, yaw_moment
from podusv_cli.core.component import Rule, Ruled, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.kinematics import wrap
from podusv_cli.core.signal import Signal

CRAB, OFFSET = 6, 7  # positions in the memory
LEARNT = (
    Signal("crab", "rad", "learnt crab angle", r"\hat\beta"),
    Signal("offset", "m", "what the integral adds to the cross-track error", r"\sigma y_i"),
)
ADAPTIVE, INTEGRAL, PUBLISHED = 0.0, 1.0, 2.0  # places among the choices of `learns`


# across, offset [m], crab [rad]; returns rad/s and m/s. The rate of the angle goes to zero far from
# the line, where the line of sight is steep whatever the crab angle. At its limit it may only come
# back.
@kernel
def learning(across: float, crab: float, offset: float, k: Any) -> tuple[float, float]:
    """Rates of crab angle and offset; one is always 0.

    The angle stays within +-crab_m, but for the published law.
    """
    shifted = across + offset
    squared = k.lookahead * k.lookahead + shifted * shifted
    if k.learns == INTEGRAL:
        return 0.0, k.sigma * k.lookahead * across / squared
    if k.learns == PUBLISHED:
        return k.gamma * k.lookahead * across / math.sqrt(squared), 0.0
    rate = k.gamma * k.lookahead * k.lookahead * across / squared
    stuck = abs(crab) >= k.crab_m and rate * crab > 0.0
    return (0.0 if stuck else rate), 0.0


class Alos(LineOfSight, ObservingController):
    """Line of sight less a learnt crab angle, at a speed that follows the target."""

    kind: Literal["alos"] = "alos"
    signals: ClassVar[tuple[Signal, ...]] = STEERED
    rules: ClassVar[dict[str, Rule]] = {
        **LineOfSight.rules,
        **by.OBSERVER,
        "gamma": by.YAW_PER_REACH,
        "sigma": by.YAW_REACH,
        "k_u": by.SURGE,
        "k_psi": by.YAW,
        "k_r": by.YAW,
        "N_m": by.MOMENT,
    }
    lookahead: Ruled = value(0.7, "m", "distance ahead on the path that the bow aims at", gt=0)
    U: Ruled = value(1.1, "m/s", "largest wanted surge velocity", gt=0)
    learns: Literal["adaptive", "integral", "published"] = value(
        "adaptive",
        "",
        "how the crab angle is found: adapted as an angle (after ALOS, Fossen "
        "2023, but slower far from the line), by an integral of the cross-track error (ILOS, "
        "Borhaug et al. 2008), or by ALOS as published, whose lookahead does not grow",
    )
    gamma: Ruled = value(0.2, "rad/(m s)", "gain of the adapted angle", ge=0)
    crab_m: float = value(0.5, "rad", "largest adapted angle", gt=0)
    sigma: Ruled = value(0.1, "m/s", "gain of the integral", ge=0)
    k_u: Ruled = value(1.0, "1/s", "gain of the surge velocity", gt=0)
    k_psi: Ruled = value(1.2, "1/s", "gain of the heading", gt=0)
    k_r: Ruled = value(1.3, "1/s", "gain of the yaw rate", gt=0)

    N_m: Ruled = value(2.5, "N m", "moment beyond which surge yields to yaw", gt=0)

    def most(self) -> Most:
        """The speed U [m/s] and the moment N_m [N m] that the law keeps within."""
        return Most(self.U, moment=self.N_m)

    def slots(self) -> Slots:
        """The memory: the observer's, then crab angle and offset."""
        return (*super().slots(), *each(LEARNT))

    def steering(self) -> tuple[str, float]:
        """Key and gain [1/s] with which it turns the hull."""
        return "k_psi", self.k_psi

    def axis_gains(self, axes: tuple[Axis, Axis]) -> tuple[tuple[str, float, float], ...]:
        """Key, gain and observer's bandwidth: the yaw rate's gain with that of the heading."""
        return ("k_u", self.k_u, self.omega_u), ("k_r", self.k_r + self.k_psi, self.omega_r)

    # x (6), memory and rate (8), target (6); writes tau (2) [N, N m], rate and signals (4). Yaw
    # comes first, since surge yields where its moment is large, or the bow is off. The loads that
    # the observer finds are taken off. `yaw` [rad/s2] is the yaw acceleration that is asked for.
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
        """Heading to the line of sight less the crab angle; speed along the course."""
        at = course_frame(x, target, k)
        u, v, r = x[3], x[4], x[5]
        crab, offset = memory[CRAB], memory[OFFSET]
        crab_rate, offset_rate = learning(at.across, crab, offset, k)
        behind = 0.0 if k.learns == PUBLISHED else max(at.along, 0.0)
        sight, sight_rate = line_of_sight(at, behind, offset, offset_rate, k)
        psi_r = wrap(at.course - crab + sight)
        psi_e = wrap(psi_r - x[2])
        turn = at.turn - crab_rate + sight_rate
        r_d = turn + k.k_psi * psi_e
        yaw = k.k_psi * (turn - r) + k.k_r * (r_d - r)
        tau[1] = k.m33 * yaw - yaw_moment(u, v, r, k) - memory[B_R]

        cos_e, _ = cos_sin(psi_e)
        u_d = wanted_speed(x, at, k) * max(cos_e, 0.0) * k.N_m / max(abs(tau[1]), k.N_m)
        tau[0] = k.m11 * k.k_u * (u_d - u) - surge_force(u, v, r, k) - memory[B_U]
        signals[0], signals[1], signals[2], signals[3] = at.along, at.across, psi_r, u_d
        observe(x, memory, tau, k, rate)
        rate[CRAB], rate[OFFSET] = crab_rate, offset_rate
