"""A law's fast part: the loop of one velocity, linearised, for what a step or a period can carry.

A loop has the states (e, m): the velocity error e of one axis, and the parts m of the law's memory
that feed back into it. With the plant's own damping d,

    e' = -d e + g . (e, m),   m' = F (e, m).

The rest of the closed loop is slower and left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from podusv_cli.core.kernel import Vector

ALONE = np.zeros((0, 1))  # `memory` of a loop without any
Cause = Literal["adaptation", "derivative", "loop"]


@dataclass(frozen=True)
class Axis:
    """One axis of the hull: true inertia, what the law takes it for, damping at a velocity."""

    name: str
    inertia: float
    told: float
    damping: float  # d [1/s]


@dataclass(frozen=True)
class AdaptedBound:
    """The adaptation (28) of a bound: gains, b_hat at the start, the true inertia.

    `error` names the signal that it learns from, `key` the gain that makes it fast.
    """

    error: str
    key: str
    gamma: float
    sigma: float
    initial: float
    partial: float
    inertia: float


@dataclass(frozen=True)
class Loop:
    """A linearised velocity loop; `key` is the gain that mostly makes it fast, and `cause` why.

    `name` is what messages call it, `bound` an adapted bound that acts on it. A law that is told
    the loads that act has `told`: where a delay makes g . (e, m) act late, m' gains `told` times
    what acts less what is demanded.
    """

    axis: str
    key: str
    damping: float  # d [1/s]
    feedback: Vector  # g, shape (1 + n,)
    memory: Vector  # F, shape (n, 1 + n)
    cause: Cause = "loop"
    name: str = "velocity loop"
    bound: AdaptedBound | None = None
    told: Vector | None = None  # shape (n,)

    @property
    def matrix(self) -> Vector:
        """Rates of (e, m), shape (1 + n, 1 + n)."""
        rows = np.vstack([self.feedback, self.memory])
        rows[0, 0] -= self.damping
        return rows

    @property
    def growth(self) -> float:
        """Largest real part of an eigenvalue [1/s]; above 0 the loop grows."""
        return float(np.linalg.eigvals(self.matrix).real.max())

    @property
    def fastest(self) -> float:
        """Largest eigenvalue's magnitude [1/s]; infinite where a number is."""
        # numpy raises for a matrix of such numbers
        if not np.isfinite(self.matrix).all():
            return np.inf
        return float(np.abs(np.linalg.eigvals(self.matrix)).max())


def pi_loop(axis: Axis, key: str, w: float) -> Loop:
    """The PI loop of an axis, a double pole at -w [rad/s] of a law that knows the inertia.

    `key` is the field that has w; back-calculation has the tracking time 1/w.
    """
    to = axis.told / axis.inertia
    return Loop(
        axis.name,
        key,
        axis.damping,
        to * np.array([-2.0 * w, 1.0]),
        np.array([[-w * w, 0.0]]),
        name="PI loop",
        told=np.array([w / to]),
    )
