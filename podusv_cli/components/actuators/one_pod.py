"""One pod of a set: its numbers, and its failure."""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.actuators.command import EffectivenessLoss
from podusv_cli.components.actuators.thrust_table import PwmCommand, check_rows, curve_of, of_file
from podusv_cli.core.component import Component, ValuesOf, value
from podusv_cli.core.kernel import Vector

ThrustRow = tuple[float, float]  # n, or a pulse [us]; thrust [N]
STEPS = 40  # of a bent curve, each way
BY_SQUARE = ("T_nn", "T_nn_astern", "n_max", "n_max_astern")  # keys that a table stands for


class Rudder(Component):
    """A rudder in the stream of a propeller, whose force is normal to it."""

    lift: float = value(..., "N s2/rad", "force over n^2 times angle; 0 astern", gt=0)
    stall: float = value(
        0.5, "rad", "angle above which the force does not grow", gt=0, le=0.5 * math.pi
    )


class Pod(Component):
    """One propeller and the pod that turns it, or the rudder behind it.

    `n` counts turns a second, or parts of full speed where the actuator's `counts` says so; units
    with s for it then go without. Thrust goes with |n|n, or is that of a `table`; a dead band of
    `pwm` is left out of n in the former.
    """

    values_of: ClassVar[dict[str, ValuesOf]] = {"table": of_file}
    x: float = value(..., "m", "position ahead of the body origin; negative at the stern")
    y: float = value(0.0, "m", "position to starboard of the body origin")
    mount: float = value(
        0.0,
        "rad",
        "direction in which it pushes at angle 0, from the bow to starboard; 90 deg with "
        "angle_limit 0 is a tunnel thruster",
        ge=-math.pi,
        le=math.pi,
        exclude_if=operator.not_,  # logs from before this key keep their bytes
    )
    T_nn: float | None = value(
        None, "N s2", "thrust over |n|n ahead, at rest; needed without a table", gt=0
    )
    T_nn_astern: float | None = value(
        None, "N s2", "thrust over |n|n astern, at rest; needed without a table", gt=0
    )
    table: tuple[ThrustRow, ...] | None = value(
        None,
        "1",
        "in place of T_nn, T_nn_astern, n_max, n_max_astern: rows of n and thrust [N] of a bollard "
        "test, or the CSV file that has them; podusv docs pod",
        strict=False,
    )
    table_in: Literal["n", "us"] = value(
        "n", "", "what the commands of the table are: n, or pulses of `pwm`"
    )
    table_factor: float = value(1.0, "", "factor on the thrust of the table", gt=0)
    pwm: PwmCommand | None = value(
        None, "", "pulses that command n, of logs and tables in us; with counts: parts"
    )
    T_nV: float = value(0.0, "N s2/m", "change of thrust over |n| times speed", ge=0)
    T_nV_astern: float | None = value(
        None, "N s2/m", "the same with the propeller astern; without it as ahead", ge=0
    )
    n_max: float | None = value(
        None, "1/s", "largest propeller speed ahead; needed without a table", gt=0
    )
    n_max_astern: float | None = value(
        None, "1/s", "largest propeller speed astern; needed without a table", ge=0
    )
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

    @model_validator(mode="after")
    def _thrusting(self) -> Self:
        """Raises ValueError for a pod that has no law of thrust, or two."""
        given = [name for name in BY_SQUARE if getattr(self, name) is not None]
        if self.table is not None:
            self._check_beside_table(given)
            check_rows(self.rows)
        elif lacking := [name for name in BY_SQUARE if name not in given]:
            them = "it" if len(lacking) == 1 else "them"
            raise ValueError(
                f"has no {', '.join(lacking)}; give {them}, or the table of a bollard test"
            )
        return self

    @model_validator(mode="after")
    def _pushing(self) -> Self:
        """Raises ValueError for a rudder that can hold back all that the propeller pushes."""
        if self.rudder and self.T_nn is not None:
            most = min(self.angle_limit, 0.5 * math.pi)
            drag = self.rudder.lift * min(most, self.rudder.stall) * math.sin(most)
            if drag >= self.T_nn:
                raise ValueError(
                    f"has a rudder that at {most:.3g} rad drags {drag:.3g} n^2, and a propeller "
                    f"that pushes {self.T_nn:.3g} n^2; give a smaller lift, stall or angle_limit"
                )
        return self

    def _check_beside_table(self, given: Sequence[str]) -> None:
        """Raise ValueError for keys that do not go with a table; `given` are those `BY_SQUARE`."""
        if given:
            raise ValueError(
                f"has a table and {', '.join(given)}; the table gives thrust and largest n, so "
                "leave them out"
            )
        if self.rudder:
            raise ValueError(
                "has a table and a rudder, whose force goes with n^2; give T_nn and T_nn_astern "
                "in place of the table"
            )
        if self.table_in == "us" and not self.pwm:
            raise ValueError(
                "has a table in us and no pwm; give it, as pwm: {rest: 1500, span: 400}"
            )
        if self.pwm and self.pwm.dead_band:
            raise ValueError(
                "has a table and pwm.dead_band; the dead band of a table is its part without "
                "thrust, so leave pwm.dead_band out"
            )

    @property
    def rows(self) -> Vector:
        """The table's n and thrust [N], n increasing (rows, 2); without a table none."""
        rows = np.array(self.table or np.zeros((0, 2)))
        if self.table_in == "us" and self.pwm:
            # With a span below 0 longer pulses drive astern, so the rows run the other way
            rows = rows[:: int(math.copysign(1.0, self.pwm.span))]
            rows[:, 0] = (rows[:, 0] - self.pwm.rest) / self.pwm.span
        return rows * [1.0, self.table_factor]

    @property
    def most_n(self) -> tuple[float, float]:
        """The largest n ahead and astern."""
        if self.table is not None:
            return float(self.rows[-1, 0]), float(max(-self.rows[0, 0], 0.0))
        return self.n_max or 0.0, self.n_max_astern or 0.0

    @property
    def most_thrust(self) -> tuple[float, float]:
        """The largest thrust at rest [N], ahead and astern."""
        if self.table is not None:
            return float(self.rows[-1, 1]), float(max(-self.rows[0, 1], 0.0))
        ahead, astern = self.most_n
        return (self.T_nn or 0.0) * ahead * ahead, (self.T_nn_astern or 0.0) * astern * astern

    def with_thrust(self, factor: float, dead_band: float, exponent: float) -> Self | None:
        """The pod with thrust times a factor and a bent curve, as `Actuator.with_thrust` has it.

        None for a rudder with a bent curve, since its force goes with n^2.
        """
        # No dead band and the exponent 2 leave the curve's form as it is
        bent = (dead_band, exponent) != (0.0, 2.0)
        if bent and self.rudder:
            return None
        new: dict[str, Any] = {
            name: factor * number
            for name in ("T_nn", "T_nn_astern", "T_nV", "T_nV_astern")
            if (number := getattr(self, name)) is not None
        }
        if self.table is not None:
            new["table_factor"] = factor * self.table_factor
        if self.rudder:
            new["rudder"] = self.rudder.changed({"lift": factor * self.rudder.lift})
        return self.changed(new)._bent(dead_band, exponent) if bent else self.changed(new)

    def _bent(self, dead_band: float, exponent: float) -> Self:
        """With a table of the bent curve, which straight lines miss by 1e-3 of full thrust.

        A dead band of `pwm` goes into the table.
        """
        parts = np.linspace(0.0, 1.0, 1 + STEPS)
        sides = []
        for way, full in zip((1.0, -1.0), self.most_n, strict=True):
            n = way * full * (dead_band + (1.0 - dead_band) * parts)
            # A part s of full n has s^2 of the old thrust, so part^(exponent/2) has the new one
            thrusts = [self._thrust_at_rest(way * full * s) for s in parts ** (0.5 * exponent)]
            sides.append(np.column_stack([n, thrusts]))
        ahead, astern = sides
        rows = np.concatenate([astern[:0:-1], [[0.0, 0.0]], ahead[1:]])
        # The edges of a dead band are rows of their own, without thrust
        if dead_band > 0.0:
            rows = np.concatenate([astern[::-1], [[0.0, 0.0]], ahead])
        rows = rows[np.append(True, np.diff(rows[:, 0]) > 0.0)]  # without n astern rest comes once
        given = dict.fromkeys(BY_SQUARE) | {"table": _short(rows)}
        still = {"pwm": self.pwm.changed({"dead_band": None})} if self.pwm else {}
        return self.changed({**given, **still, "table_in": "n", "table_factor": 1.0})

    def _thrust_at_rest(self, n: float) -> float:
        """Thrust [N] at n, of a vessel that lies still."""
        if self.table is not None:
            return float(np.interp(n, *self.rows.T))
        ahead, astern, stretch, stretch_astern = self._dead_band()
        if n >= 0.0:
            return (self.T_nn or 0.0) * (max(n - ahead, 0.0) * stretch) ** 2
        return -(self.T_nn_astern or 0.0) * (max(-n - astern, 0.0) * stretch_astern) ** 2

    def curves(self) -> list[Vector]:
        """The table ahead and astern as `thrust_curve` has them; without a table none."""
        return [curve_of(self.rows, side) for side in (1.0, -1.0)] if self.table else []

    def lags(self) -> tuple[float, float]:
        """Time constants of the speed and of the angle [s]; that of an angle that is fixed is 0."""
        return self.n_lag, self.angle_lag or 0.0 if self.angle_limit > 0.0 else 0.0

    def _dead_band(self) -> list[float]:
        """Its ends ahead and astern, and how much faster the rest of n goes to full speed."""
        ends = self.pwm.dead_ends() if self.pwm else (0.0, 0.0)
        full = [
            most / (most - end) if most else 1.0
            for most, end in zip(self.most_n, ends, strict=True)
        ]
        return [*ends, *full]

    def numbers(self, places: Sequence[float] = (0.0, 0.0)) -> list[float]:
        """The pod's row in the actuator's table, see `propeller`.

        `places` are where its `curves` begin, counted from the row's own begin. A fixed angle never
        moves, so any rate and lag above 0 do for it.
        """
        astern = self.T_nV if self.T_nV_astern is None else self.T_nV_astern
        return [
            self.x,
            self.y,
            self.T_nn or 0.0,
            self.T_nn_astern or 0.0,
            self.T_nV,
            astern,
            *self.most_n,
            self.angle_limit,
            self.n_rate,
            self.angle_rate or 1.0,
            self.n_lag,
            self.angle_lag or 1.0,
            self.power_nnn or 0.0,
            self.rudder.lift if self.rudder else 0.0,
            self.rudder.stall if self.rudder else 0.0,
            *self._dead_band(),
            *places,
            self.mount,
        ]

    def pushes(self) -> list[tuple[float, float, float]]:
        """Surge and sway force and yaw moment of 1 N in the directions that it can push."""
        turned = [self.mount] + ([self.mount + 0.5 * math.pi] if self.angle_limit > 0.0 else [])
        ways = [(_round(math.cos(at)), _round(math.sin(at))) for at in turned]
        return [(X, Y, self.x * Y - self.y * X) for X, Y in ways]


def _short(rows: Vector) -> tuple[ThrustRow, ...]:
    """Rows (rows, 2) of a table with as many digits as a reader can use."""
    return tuple((float(f"{n:.9g}"), float(f"{T:.6g}")) for n, T in rows.tolist())


def _round(part: float) -> float:
    """A cosine or sine without what a right angle in floating point leaves of 0."""
    return round(part, 12)


class PodFailure(EffectivenessLoss):
    """A pod's loss of thrust at a time."""

    pod: int = value(..., "", "the pod that fails, from 0", ge=0)
