"""Wind: its mean, gusts, and the load by Blendermann's formulas."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Literal, Self

import numpy as np
from pydantic import model_validator

from podusv_cli.components.disturbances import spectra
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.disturbances.spectra import GROUP, clear_sums
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin, cos_sin_of_turns
from podusv_cli.core.kernel import Vector, kernel, scratch, widest
from podusv_cli.core.kinematics import direction
from podusv_cli.core.signal import Signal

STREAM = "wind"
LEVER = 0.18  # of the yaw moment, by Blendermann
SPEED = Signal("V_w", "m/s", "wind speed at the height where it acts, with gusts")
FROM = Signal("beta_w", "rad", "direction that the wind comes from", r"\beta_w")


# t [s]; table holds `count` numbers each of frequency [1/s], phase [turns], amplitude [m/s].
# Returns m/s. Partial sums fill the vector registers and fix the order of the additions.
@kernel
def _gust(t: float, count: int, table: Vector) -> float:
    """The sum of all components, by sixteen partial sums, in groups of four."""
    sums = scratch(GROUP)
    widest()
    clear_sums(GROUP, sums)
    for block in range(count // GROUP):
        for j in range(GROUP):
            i = block * GROUP + j
            c, _ = cos_sin_of_turns(table[i] * t + table[count + i])
            sums[j] += table[2 * count + i] * c
    total = 0.0
    for j in range(0, GROUP, 4):
        total += (sums[j] + sums[j + 1]) + (sums[j + 2] + sums[j + 3])
    return total


# u_r and v_r [m/s]; writes b (3) [N, N, N m]. c and s are cosine and sine of gamma.
@kernel
def blendermann(u_r: float, v_r: float, k: Any, b: Vector) -> None:
    """Load of the wind on a hull that moves by (u_r, v_r) through the air.

    X = q C_X A_F, Y = q C_Y A_L, N = q C_N A_L L with q = rho V_r^2/2 and gamma = -atan2(v_r, u_r),
    0 in wind from ahead: C_X = -CD_l cos(gamma)/D, C_Y = CD_t sin(gamma)/D, C_N = (s_L/L -
    0.18 (|gamma| - pi/2)) C_Y, D = 1 - delta/2 (1 - (CD_l A_F/A_L)/CD_t) sin^2(2 gamma). Seen in
    cybergalactic/MSS, blendermann94.m, which has gamma in place of |gamma|: right for wind from one
    side only, as the formula was published; a hull with two equal sides needs |gamma|.
    """
    square = u_r * u_r + v_r * v_r
    b[0] = b[1] = b[2] = 0.0
    if square > 0.0:
        speed = math.sqrt(square)
        c, s = u_r / speed, -v_r / speed
        drag = k.CD_l_bow if c >= 0.0 else k.CD_l_stern
        double = 2.0 * s * c
        share = 1.0 - drag * k.A_F / (k.A_L * k.CD_t)
        pressure = 0.5 * k.density * square / (1.0 - 0.5 * k.delta * share * double * double)
        b[0] = -pressure * drag * c * k.A_F
        b[1] = pressure * k.CD_t * s * k.A_L
        angle = abs(direction(u_r, v_r))
        b[2] = (k.s_L - LEVER * (angle - 0.5 * math.pi) * k.length) * b[1]


# Speed [m/s], cosine and sine of where it comes from; x the state; writes b (3) [N, N, N m]. A wind
# from ahead adds to the hull's own speed through the air.
@kernel
def load_of_wind(speed: float, c_from: float, s_from: float, x: Vector, k: Any, b: Vector) -> None:
    """The load of a wind on a hull that moves."""
    c_psi, s_psi = cos_sin(x[2])
    ahead = c_psi * c_from + s_psi * s_from
    aside = c_psi * s_from - s_psi * c_from
    blendermann(x[3] + speed * ahead, x[4] + speed * aside, k, b)


def logarithmic_shear(drag: float) -> float:
    """C of the logarithmic profile (see `Wind`) over a surface with this drag coefficient."""
    return 2.5 * math.sqrt(drag)


def share_of_wind(at: float, C: float) -> float:
    """What the wind at a height `at` [m] is of that at 10 m: 1 + C ln(at/10), without unit.

    Raises ValueError where the profile has ended above that height.
    """
    share = 1.0 + C * math.log(at / 10.0)
    if share <= 0.0:
        calm = 10.0 * math.exp(-1.0 / C)
        raise ValueError(
            f"at {at:g} m the profile has no wind left, which ends {calm:.3g} m above the sea; "
            "give a larger `at`"
        )
    return share


def _logarithmic(wind: Wind) -> float:
    """C over a surface with this wind's drag."""
    return logarithmic_shear(wind.drag)


def _norsok(wind: Wind) -> float:
    """C of NORSOK N-003, by the mean speed at 10 m."""
    return 0.0573 * math.sqrt(1.0 + 0.15 * wind.speed)


SHEAR = {"none": _logarithmic, "harris": _logarithmic, "norsok": _norsok}  # C, by the gusts


class Wind(Disturbance):
    """Wind from one direction, with gusts: a load on what the vessel has above the water.

    The mean at `at` follows the logarithmic profile U = U10 (1 + C ln(at/10)): C = 2.5 sqrt(drag),
    or with gusts of NORSOK N-003 its own C = 0.0573 sqrt(1 + 0.15 U10) of the hour's mean. Gusts
    are a sum of cosines with the spectrum chosen, the same all over the vessel and along the mean
    wind only. The load is the steady one of the relative wind at every instant.
    """

    kind: Literal["wind"] = "wind"
    speed: float = value(..., "m/s", "mean speed 10 m above the sea", gt=0)
    direction: float = value(
        0.0, "rad", "where the wind comes from: 0 north, pi/2 east", ge=-1e6, le=1e6
    )
    at: float = value(
        10.0, "m", "height at which the wind is taken that acts on the vessel", gt=0, le=1e3
    )
    drag: float = value(
        0.0026,
        "",
        "drag coefficient of the sea's surface, of the profile and the Harris spectrum "
        "(`norsok` has a profile of its own)",
        gt=0,
        le=0.1,
    )
    gusts: Literal["none", "norsok", "harris"] = value(
        "none", "", "spectrum of the gusts: none, NORSOK (Froya), or Harris"
    )
    components: int = value(50, "", "how many cosines make the gusts", ge=1, le=10_000)
    amplitudes: spectra.Amplitudes = value(
        "random",
        "",
        "of the cosines: drawn, so that gusts scatter between seeds as the wind's "
        "do, or those of the spectrum for every seed",
    )
    lowest: float = value(
        1.0 / 600.0, "Hz", "least frequency of a gust; slower changes belong to the mean", gt=0
    )
    highest: float = value(0.5, "Hz", "largest frequency of a gust", gt=0)
    density: float = value(1.225, "kg/m3", "density of the air", gt=0)
    seed: int = value(1, "", "of rates, phases and amplitudes of the gusts", ge=0, lt=2**63)

    @model_validator(mode="after")
    def _blows(self) -> Self:
        """Raises ValueError for limits of frequency in the wrong order, or no wind that high."""
        if self.lowest >= self.highest:
            raise ValueError(
                f"lowest {self.lowest:g} Hz must be below highest {self.highest:g} Hz; 0.0017 and "
                "0.5 are usual"
            )
        # It raises where the profile has no wind left at that height
        share_of_wind(self.at, SHEAR[self.gusts](self))
        return self

    @property
    def mean(self) -> float:
        """The mean speed at the height where it acts [m/s]."""
        return self.speed * share_of_wind(self.at, SHEAR[self.gusts](self))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Speed and direction of the wind, written behind the load."""
        return SPEED, FROM

    def full_scale(self) -> str:
        """Spectra of gusts are those of the open sea."""
        return "" if self.gusts == "none" else "gusts"

    def cosines(self) -> int:
        """How many cosines it sums: the components of the gusts, if there are any."""
        return self.components if self.full_scale() else 0

    def resolving(self, duration: float) -> int:
        """How many cosines the gusts of a run of `duration` [s] need, see `Disturbance.resolving`.

        Bins grow with frequency, and the energy lies low.
        """
        if self.gusts == "none" or self.amplitudes == "deterministic":
            return 0
        edges = self._edges()
        variance = spectra.in_bins(self._density, edges)
        return spectra.resolving(variance, edges, duration)

    def _edges(self) -> Vector:
        """Edges (components + 1,) of the components' bins [Hz]."""
        return spectra.growing_edges(self.lowest, self.highest, self.components)

    def table(self) -> Vector:
        """Rows of rates [1/s], phases [turns] and amplitudes [m/s], filled up to whole groups.

        One behind another (3 lanes,); a single zero without gusts.
        """
        if self.gusts == "none":
            return np.zeros(1)
        edges = self._edges()
        variance = spectra.in_bins(self._density, edges)
        drawn = spectra.cosines(variance, edges, self.seed, STREAM, self.amplitudes)
        rows = np.zeros((3, spectra.whole_groups(self.components)))
        phase = drawn.phase / (2.0 * math.pi)
        rows[:, : self.components] = drawn.rate, phase, drawn.amplitude
        return rows.ravel()

    def _density(self, frequency: Vector) -> Vector:
        """Spectral density of gusts [m2/s] at these frequencies [Hz], (n,)."""
        if self.gusts == "norsok":
            return spectra.norsok(frequency, self.speed, self.at)
        return spectra.harris(frequency, self.speed, self.drag)

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """What the kernel needs: mean wind [m/s], where it comes from, components, windage.

        Raises ValueError for a vessel without windage.
        """
        if vessel.windage is None:
            raise ValueError(NO_WINDAGE)
        c, s = cos_sin(self.direction)
        return vessel.windage.constants() | {
            "length": vessel.length,
            "mean": self.mean,
            "density": self.density,
            "direction": self.direction,
            "c_from": float(c),
            "s_from": float(s),
            "lanes": 0.0 if self.gusts == "none" else float(spectra.whole_groups(self.components)),
        }

    def conflicts(self, vessel: Vessel, step: float) -> Iterator[tuple[str, str]]:
        """Key and message for a vessel without windage, or gusts that the step [s] cannot resolve.

        A cosine takes two steps a period at least.
        """
        if vessel.windage is None:
            yield "kind", NO_WINDAGE
        if self.gusts != "none" and self.highest > 0.5 / step:
            yield (
                "highest",
                f"gusts up to {self.highest:g} Hz are too fast for steps of {step:g} s, which "
                f"resolve {0.5 / step:.4g} Hz at most; give a smaller `highest` or "
                "`simulation.step`",
            )

    # t [s], x (6) state; table as `_gust` has it. Writes b (5): the load [N, N, N m], then speed
    # [m/s] and direction [rad]. With `again`, b has the speed at this t already.
    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector, again: float) -> None:
        """The load, the wind's speed and where it comes from; the speed depends on t alone."""
        speed = b[3] if again > 0.0 else k.mean + _gust(t, int(k.lanes), table)
        load_of_wind(speed, k.c_from, k.s_from, x, k, b)
        b[3], b[4] = speed, k.direction


NO_WINDAGE = (
    "the vessel has no windage, so no wind can act on it; give vessel.windage its areas A_F and "
    "A_L [m2], or take a preset that has them"
)
