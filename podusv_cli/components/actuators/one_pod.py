"""One pod of a set: its numbers, and its failure."""

from __future__ import annotations

import math
from typing import Self

from pydantic import model_validator

from podusv_cli.components.actuators.command import EffectivenessLoss
from podusv_cli.core.component import Component, value


class Rudder(Component):
    """A rudder in the stream of a propeller, whose force is normal to it."""

    lift: float = value(..., "N s2/rad", "force over n^2 times angle; 0 astern", gt=0)
    stall: float = value(
        0.5, "rad", "angle above which the force does not grow", gt=0, le=0.5 * math.pi
    )


class Pod(Component):
    """One propeller and the pod that turns it, or the rudder behind it.

    `n` counts turns a second, or parts of full speed where the actuator's `counts` says so; units
    with s for it then go without.
    """

    x: float = value(..., "m", "position ahead of the body origin; negative at the stern")
    y: float = value(0.0, "m", "position to starboard of the body origin")
    T_nn: float = value(..., "N s2", "thrust over |n|n ahead, at rest", gt=0)
    T_nn_astern: float = value(..., "N s2", "thrust over |n|n astern, at rest", gt=0)
    T_nV: float = value(0.0, "N s2/m", "change of thrust over |n| times speed", ge=0)
    T_nV_astern: float | None = value(
        None, "N s2/m", "the same with the propeller astern; without it as ahead", ge=0
    )
    n_max: float = value(..., "1/s", "largest propeller speed ahead", gt=0)
    n_max_astern: float = value(..., "1/s", "largest propeller speed astern", ge=0)
    n_rate: float = value(..., "1/s2", "fastest change of the propeller's speed", gt=0)
    n_lag: float = value(..., "s", "time constant of the propeller's speed", gt=0)
    angle_limit: float = value(
        math.radians(35.0),
        "rad",
        "largest angle, both ways; 0 for a fixed propeller",
        ge=0,
        le=0.5 * math.pi,
    )
    angle_rate: float | None = value(
        None, "rad/s", "fastest change of the angle; needed unless the propeller is fixed", gt=0
    )
    angle_lag: float | None = value(
        None, "s", "time constant of the angle; needed unless the propeller is fixed", gt=0
    )
    rudder: Rudder | None = value(
        None, "", "a rudder at x, y, whose angle has the limits above; the propeller stays straight"
    )
    power_nnn: float | None = value(
        None, "W s3", "power over |n|^3; without it neither power nor energy is logged", ge=0
    )

    @model_validator(mode="after")
    def _turning(self) -> Self:
        """Raises ValueError for a pod that turns and says not how fast."""
        if self.rudder and self.angle_limit == 0.0:
            raise ValueError("has a rudder that cannot turn; give it an angle_limit above 0")
        missing = [name for name in ("angle_rate", "angle_lag") if getattr(self, name) is None]
        if missing and self.angle_limit > 0.0:
            raise ValueError(
                f"turns by up to {self.angle_limit:.3g} rad and has no {' and no '.join(missing)}; "
                "give it, or angle_limit: 0 for a fixed propeller"
            )
        return self

    def lags(self) -> tuple[float, float]:
        """Time constants of the speed and of the angle [s]; that of an angle that is fixed is 0."""
        return self.n_lag, self.angle_lag or 0.0 if self.angle_limit > 0.0 else 0.0

    def numbers(self) -> list[float]:
        """The pod's row in the actuator's table, see `propeller`.

        A fixed angle never moves, so any rate and lag above 0 do for it.
        """
        astern = self.T_nV if self.T_nV_astern is None else self.T_nV_astern
        return [
            self.x,
            self.y,
            self.T_nn,
            self.T_nn_astern,
            self.T_nV,
            astern,
            self.n_max,
            self.n_max_astern,
            self.angle_limit,
            self.n_rate,
            self.angle_rate or 1.0,
            self.n_lag,
            self.angle_lag or 1.0,
            self.power_nnn or 0.0,
            self.rudder.lift if self.rudder else 0.0,
            self.rudder.stall if self.rudder else 0.0,
        ]


class PodFailure(EffectivenessLoss):
    """A pod's loss of thrust at a time."""

    pod: int = value(..., "", "the pod that fails, from 0", ge=0)
