"""The paper's disturbance (52): a mean, a sine and a cosine on every axis."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import OF_SECTION, Component, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import LANES, Vector, kernel, padded_rounds, scratch, whole_lanes
from podusv_cli.core.portable import add_up

WAVES = 6  # a sine and a cosine on every axis


class Wave(NamedTuple):
    """cos cos(rate t) + sin sin(rate t)."""

    rate: float
    cos: float
    sin: float


class Harmonic(Component):
    """mean + sin sin(sin_rate t + sin_phase) + cos cos(cos_rate t + cos_phase) on one axis.

    In N, in yaw N m.
    """

    mean: float = value(0.0, OF_SECTION, "constant part")
    sin: float = value(0.0, OF_SECTION, "amplitude of the sine")
    sin_rate: float = value(0.2, "rad/s", "angular frequency of the sine", ge=0)
    sin_phase: float = value(0.0, "rad", "angle of the sine at t = 0", ge=-1e6, le=1e6)
    cos: float = value(0.0, OF_SECTION, "amplitude of the cosine")
    cos_rate: float = value(0.2, "rad/s", "angular frequency of the cosine", ge=0)
    cos_phase: float = value(0.0, "rad", "angle of the cosine at t = 0", ge=-1e6, le=1e6)

    def waves(self) -> tuple[Wave, ...]:
        """The sine and the cosine, each as a cosine and a sine without phase, in that order.

        By sin(a + b) = sin a cos b + cos a sin b, and likewise for the cosine.
        """
        c, s = cos_sin(self.sin_phase)
        sine = Wave(self.sin_rate, float(self.sin * s), float(self.sin * c))
        c, s = cos_sin(self.cos_phase)
        return sine, Wave(self.cos_rate, float(self.cos * c), float(-self.cos * s))

    def bound(self) -> float:
        """What its magnitude never exceeds, in the unit of the axis.

        A wave of rate 0 is constant, and waves of one rate are one wave. Of two rates it is the sum
        of the amplitudes, which the load reaches only where the rates have no common period.
        """
        sine, cosine = waves = self.waves()
        if sine.rate == cosine.rate:
            waves = (Wave(sine.rate, sine.cos + cosine.cos, sine.sin + cosine.sin),)
        mean = self.mean + add_up(wave.cos for wave in waves if wave.rate == 0.0)
        moving = (math.hypot(wave.sin, wave.cos) for wave in waves if wave.rate > 0.0)
        return add_up((abs(mean), *moving))


# Reads table (3 count) as `HarmonicDisturbance.table` has it: frequencies [rad/s], then factors of
# cosine and of sine; waves i and i + 3 belong to axis i. Writes b (3) [N, N, N m].
@kernel
def harmonic(t: float, k: Any, table: Vector, b: Vector) -> None:
    """Equation (52), scaled."""
    waves, count = scratch(LANES), int(k.waves)
    for i in range(padded_rounds(count, WAVES)):
        cosine, sine = cos_sin(table[i] * t)
        waves[i] = table[count + i] * cosine + table[2 * count + i] * sine
    b[0] = k.scale * (k.b_u_mean + waves[0] + waves[3])
    b[1] = k.scale * (k.b_v_mean + waves[1] + waves[4])
    b[2] = k.scale * (k.b_r_mean + waves[2] + waves[5])


# Reads the heading x[2]. Writes b (3) [N, N, N m] in the body frame.
@kernel
def fixed_to_earth(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
    """The same with the forces to the north and to the east."""
    harmonic(t, k, table, b)
    c, s = cos_sin(x[2])
    b[0], b[1] = c * b[0] + s * b[1], c * b[1] - s * b[0]


class HarmonicDisturbance(Disturbance):
    """Loads of (52); the defaults are its numbers.

    The paper's act along the hull's axes, whatever its heading. With `frame: earth` b_u acts to
    the north and b_v to the east, as wind, waves and currents do.
    """

    kind: Literal["harmonic"] = "harmonic"
    scale: float = value(1.0, "", "factor on all three axes", ge=0)
    b_u: Harmonic = value(
        Harmonic(mean=0.5, sin=0.1, sin_rate=0.2, cos=0.3, cos_rate=0.5), "N", "surge force"
    )
    b_v: Harmonic = value(
        Harmonic(mean=0.5, sin=0.2, sin_rate=0.2, cos=0.1, cos_rate=0.4), "N", "sway force"
    )
    b_r: Harmonic = value(
        Harmonic(mean=0.5, sin=0.1, sin_rate=0.1, cos=0.1, cos_rate=0.2), "N m", "yaw moment"
    )

    frame: Literal["body", "earth"] = value(
        "body", "", "whose axes b_u and b_v have: the hull's, or north and east"
    )

    @property
    def of_time(self) -> bool:  # type: ignore[override]
        """Whether its load depends on time alone: in the hull's axes."""
        return self.frame == "body"

    def kernel_with(self, vessel: Vessel) -> Callable[..., None]:
        """The kernel for the axes that `frame` names, the hull's or the earth's."""
        return self.evaluate if self.frame == "body" else fixed_to_earth

    def constants(self) -> dict[str, float]:
        """The fields' numbers, and the length of the table's rows."""
        return super().constants() | {"waves": float(whole_lanes(WAVES))}

    def table(self) -> Vector:
        """Rates of the waves [rad/s], their cosines, their sines: three rows, one behind another.

        In each the sines of (52) come first, u, v, r, then its cosines. Rows are filled up with
        zeros to whole vector registers.
        """
        axes = (self.b_u.waves(), self.b_v.waves(), self.b_r.waves())
        waves = [sine for sine, _ in axes] + [cosine for _, cosine in axes]
        rows = np.zeros((3, whole_lanes(WAVES)))
        rows[:, :WAVES] = np.array(waves).T + 0.0  # no -0.0
        return rows.ravel()

    def bounds(self) -> tuple[float, float, float]:
        """What |b_u|, |b_v|, |b_r| never exceed [N, N, N m].

        Of a load that is fixed to earth, surge and sway may each get the whole horizontal force, as
        the vessel turns.
        """
        u, v, r = (self.scale * axis.bound() for axis in (self.b_u, self.b_v, self.b_r))
        return (u, v, r) if self.frame == "body" else (math.hypot(u, v), math.hypot(u, v), r)

    evaluate: ClassVar[Callable[..., None]] = staticmethod(harmonic)
