"""Waves: the motion that sensors see, and the load by which they drive the vessel off.

On the phase omega t - k (x cos beta + y sin beta) + eps of every component the vessel's own
position acts, with k = omega^2/g of deep water: so a vessel under way meets the waves at their
encounter frequency.

First-order motion. At the surface, water moves on circles of the wave's amplitude a: by
a sin(phase) in the direction beta in which the wave travels. A hull much shorter than the wave
goes with it. A longer one feels the mean over its length L and beam B, and turns with the slope
of its sway along the hull, -a k cos(gamma) sin(gamma) cos(phase), gamma = beta - psi. With
stations that count as a bell of the same second moment as a box, L^2/12, mean and slope both
get the factor e^-q, q = k^2 (L^2 cos^2 gamma + B^2 sin^2 gamma)/24. The factor here is
(1 + q/2)^-2, the same for long waves and quicker; in head sea with waves as long as the hull it
is 0.30, the mean over a box 0, over a parabolic waterline 0.30. This is motion in long waves:
no resonance, no heave, roll or pitch, no first-order load. The motion is added to what sensors
see, and the vessel's state goes on without it.

Its velocity. Sensors of velocity see the rate of what sensors of position see, in the axes of the
hull that yaws with the waves: R(psi + psi_w)^T (R(psi) (u, v) + (x_w, y_w)') and r + psi_w'. What
this adds to (u, v, r) is (u_w, v_w, r_w). The rates are those of the sums, component by component:
a phase runs with omega_e = omega - k (u cos gamma + v sin gamma), and gamma with -r, by which the
factor changes as (1 + q/2)^-2 (-q'/(1 + q/2)), q' = k^2 (L^2 - B^2) r cos gamma sin gamma/12.

Second-order drift. Radiation stress rho g a^2/4 presses with incoming and reflected waves (a
and R a) from one side, with what passes from the other; as no energy is lost, the difference is
rho g (R a)^2/2 a metre (Maruo 1960). A hull is taken as a box: ends of width B against waves
from ahead or astern, sides of length L against the rest, so that X = c_u cos(gamma)
|cos(gamma)| a^2 with c_u = rho g R_u^2 B/2, and Y likewise with L. Newman's approximation of
the products of two waves makes the load c |sum of a R |cos(gamma)| e^(i phase)|^2, which changes
slowly, with c = rho g B/2 or rho g L/2. By default every component has its own R, by
`reflection.py`: hulls reflect hardly any of the waves that are much longer than they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from podusv_cli.components.disturbances import spectra
from podusv_cli.components.disturbances.base import WAVE_MOTION, Disturbance
from podusv_cli.components.disturbances.reflection import (
    BOW_AND_STERN,
    SIDES,
    ReflectionCurve,
    interpolate_shares,
)
from podusv_cli.components.disturbances.torsethaugen import HIGHEST, LONGEST, peaks, torsethaugen
from podusv_cli.components.disturbances.wave_kernels import TURN, long_crested, short_crested
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import Rule, value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

STREAM = "waves"
FEWEST, MOST, ENOUGH = 100, 10_000, 2.0  # components; times those that `resolving` asks for
COMPONENTS = Rule(
    "{:g}, doubled until there are twice as many as let the height of the run scatter between "
    "seeds as a sea's (podusv docs sea)",
    lambda facts, default: math.nan,  # `Waves.by_default` knows the spectrum
)
if TYPE_CHECKING:
    Count = int  # once the waves are `sized`
else:
    Count = Annotated[int, Field(ge=1, le=MOST)] | None  # null: by the rule
BINS = 100  # in which the energy between the cut-offs is added up
BOTH = 0.95  # of the energy of two peaks that the cut-offs must leave
LEAST = 0.01  # of the spectrum's energy that the cut-offs must leave
Share = Literal["curve"] | Annotated[float, Field(ge=0, le=1)]
ELEVATION = Signal("zeta", "m", "elevation of the sea where the vessel is", r"\zeta")


def _shares(chosen: Share, curve: ReflectionCurve, size: Vector) -> Vector:
    """The reflected share (components,) of each component; `size` (components,) as the curve's."""
    return (
        interpolate_shares(curve, size) if chosen == "curve" else np.full(len(size), float(chosen))
    )


class Waves(Disturbance):
    """Irregular waves as a sum of cosines: motion for the sensors, and slow drift as a load.

    Motion is that of the water, filtered over the hull; drift comes from the share of each wave
    that the hull reflects. Long waves, no resonance, no heave, roll, pitch.
    """

    adds_up: ClassVar[bool] = True  # swell and a wind sea
    rules: ClassVar[dict[str, Rule]] = {"components": COMPONENTS}
    kind: Literal["waves"] = "waves"
    height: float = value(..., "m", "significant wave height Hs", ge=1e-6, le=1e3)
    period: float = value(..., "s", "period of the waves, see `period_is`", ge=1e-3, le=1e4)
    period_is: spectra.Period = value(
        "peak",
        "",
        "which period: of the spectrum's peak, or mean (T1) or zero-crossing (Tz) of the "
        "waves between `lowest` and `highest`",
    )
    direction: float = value(
        0.0, "rad", "where the waves come from: 0 north, pi/2 east", ge=-1e6, le=1e6
    )
    spectrum: Literal["jonswap", "ittc", "torsethaugen"] = value(
        "jonswap",
        "",
        "JONSWAP, the ITTC's modified Pierson-Moskowitz spectrum, or Torsethaugen's "
        "of a wind sea and a swell at full scale",
    )
    gamma: float = value(3.3, "", "peakedness of the JONSWAP spectrum", ge=1, le=7)
    spreading: int = value(
        0, "", "n of the directions' density cos^2n; 0: all waves in one direction", ge=0, le=50
    )
    components: Count = value(
        FEWEST, "", "how many cosines; one is a regular wave of exactly this period"
    )
    amplitudes: spectra.Amplitudes = value(
        "random",
        "",
        "of the components: drawn, so that the height scatters between seeds as a "
        "sea's does, or those of the spectrum for every seed",
    )
    lowest: float = value(
        0.5, "", "least frequency of a component, in terms of the peak's", gt=0, le=1e3
    )
    highest: float = value(
        4.0, "", "largest frequency of a component, in terms of the peak's", gt=0, le=1e3
    )
    motion: float = value(1.0, "", "factor on first-order motion; 0: none", ge=0)
    reflection_u: Share = value(
        "curve",
        "",
        "share of a wave's amplitude that bow and stern reflect; `curve`: by the "
        "length of each wave, as strip theory has it for two ships",
    )
    reflection_v: Share = value(
        "curve", "", "share of a wave's amplitude that the sides reflect, likewise"
    )
    drift_arm: float = value(0.0, "m", "where the drift force in sway acts, ahead of the origin")
    seed: int = value(1, "", "of rates, phases, amplitudes and directions", ge=0, lt=2**63)

    @model_validator(mode="after")
    def _has_waves(self) -> Self:
        """Raises ValueError for limits of frequency that leave out much of the energy."""
        if self.lowest >= self.highest:
            raise ValueError(
                f"lowest {self.lowest:g} must be below highest {self.highest:g}, both in terms of "
                "the peak's frequency"
            )
        if self.spectrum == "torsethaugen":
            self._suits_torsethaugen()
        kept = self._share_between_cutoffs()
        if not kept >= LEAST:
            raise ValueError(
                f"between lowest {self.lowest:g} and highest {self.highest:g} the spectrum has "
                f"{100 * kept:.1f} % of its energy, and must have {100 * LEAST:g} % or more; 0.5 "
                "and 4 keep nearly all"
            )
        return self

    def _suits_torsethaugen(self) -> None:
        """Raises ValueError outside the spectrum's range, and where a peak is cut off."""
        if self.period_is != "peak":
            raise ValueError("period_is must be peak for the torsethaugen spectrum")
        if not (self.height <= HIGHEST and self.period < LONGEST):
            raise ValueError(
                f"the torsethaugen spectrum holds up to {HIGHEST:g} m and below {LONGEST:g} s, "
                f"found {self.height:g} m and {self.period:g} s"
            )
        kept = self._share_between_cutoffs()
        if kept < BOTH:
            ratio = self.period / peaks(self.height, self.period)[1].period
            # A cut-off so far beyond the second peak leaves nearly all of its energy
            bound = f"lowest {0.6 * ratio:.2g}" if ratio < 1.0 else f"highest {3.0 * ratio:.2g}"
            raise ValueError(
                f"the second peak has {ratio:.3g} of the first one's frequency, and between lowest "
                f"{self.lowest:g} and highest {self.highest:g} the spectrum has "
                f"{100.0 * kept:.0f} % of its energy; take {bound}"
            )

    @property
    def signals(self) -> tuple[Signal, ...]:
        """First-order motion, its velocity, and the elevation."""
        return (*WAVE_MOTION, ELEVATION)

    @property
    def peak(self) -> float:
        """The peak's angular frequency [rad/s]."""
        gamma = self.gamma if self.spectrum == "jonswap" else 1.0
        to_peak = spectra.peak_period(gamma, self.period_is, self.lowest, self.highest)
        return TURN / (self.period * to_peak)

    def sea(self) -> tuple[float, float]:
        """Significant height [m] and the peak's angular frequency [rad/s]."""
        return self.height, self.peak

    def full_scale(self) -> str:
        """Torsethaugen's spectrum is one of the open sea."""
        return "spectrum" if self.spectrum == "torsethaugen" else ""

    def cosines(self) -> int:
        """How many cosines it sums: one for each component."""
        return self.components

    def by_default(self, name: str, facts: Any) -> int:
        """Components for the run's duration (in `facts`), by `COMPONENTS`: FEWEST times 2^n.

        So studies that draw height or period have few different numbers.
        """
        few = self.model_copy(update={name: FEWEST})
        wanted = ENOUGH * few.resolving(facts.duration)
        doublings = math.ceil(math.log2(max(wanted, FEWEST) / FEWEST))
        return min(FEWEST << doublings, MOST)

    def resolving(self, duration: float) -> int:
        """How many components resolve a run of `duration` [s]: 0.9 for each period of the peak.

        With the default cut-offs; 0 where the number of components does not matter.
        """
        if self.amplitudes == "deterministic" or self.components == 1:
            return 0
        return spectra.resolving(self._variance(), self._edges() / TURN, duration)

    @property
    def _band(self) -> tuple[float, float]:
        """The cut-offs [rad/s]."""
        return self.lowest * self.peak, self.highest * self.peak

    def _density(self, rate: Vector) -> Vector:
        """Density [m2 s] of the elevation at `rate` [rad/s], both (n,), by the spectrum chosen."""
        return DENSITY[self.spectrum](self, rate)

    def _share_between_cutoffs(self) -> float:
        """The share of the spectrum's energy that the cut-offs leave."""
        edges = spectra.even_edges(*self._band, BINS)
        return math.fsum(spectra.in_bins(self._density, edges)) / (self.height / 4.0) ** 2

    def _edges(self) -> Vector:
        """Edges (components + 1,) of the components' bins [rad/s]."""
        return spectra.sea_edges(self._density, *self._band, self.components)

    def _variance(self) -> Vector:
        """The variance of the elevation in each bin (components,) [m2]."""
        return spectra.in_bins(self._density, self._edges())

    def _rates(self, drawn: Vector) -> Vector:
        """Rates of the components [rad/s]: as drawn; a regular wave has exactly the peak's."""
        return np.array([self.peak]) if self.components == 1 else drawn

    def table_for(self, vessel: Vessel, duration: float) -> Vector:
        """Eight rows of a number per component, one behind another: (8 * components,).

        Rate [1/s], phase [turns], wave number [rad/m], amplitude [m], cosine and sine of the
        direction it goes to, reflected shares of bow and stern and of the sides. Zeros fill each
        row up to whole groups.
        """
        count, stream = self.components, (self.seed, STREAM)
        drawn = spectra.cosines(self._variance(), self._edges(), *stream, self.amplitudes)
        rate = self._rates(drawn.rate)
        away = spectra.directions(self.spreading, count, *stream)
        # Not numpy's cosine, whose last bits depend on the processor
        c, s = np.transpose([cos_sin(self._travel + angle) for angle in away.tolist()])
        number = rate * rate / spectra.GRAVITY
        ends = _shares(self.reflection_u, BOW_AND_STERN, number * vessel.length)
        sides = _shares(self.reflection_v, SIDES, number * vessel.beam)
        rows = np.zeros((8, spectra.whole_groups(count)))
        rows[:, :count] = (
            rate / TURN,
            drawn.phase / TURN,
            number,
            drawn.amplitude,
            c,
            s,
            ends,
            sides,
        )
        return rows.ravel()

    @property
    def _travel(self) -> float:
        """Where the waves go, opposite to where they come from [rad]."""
        return self.direction + math.pi

    def constants_with(self, vessel: Vessel) -> dict[str, float]:
        """What the kernel needs: sizes, direction, the hull's lengths, drift coefficients.

        `long2` and `wide2` [m2] are L^2/48 and B^2/48, by which k^2 makes the q/2 of the module's
        text; `drift_u` and `drift_v` [N/m2] are rho g B/2 and rho g L/2.
        """
        pressure = 0.5 * spectra.WATER * spectra.GRAVITY
        c_beta, s_beta = cos_sin(self._travel)
        return {
            "lanes": float(spectra.whole_groups(self.components)),
            "motion": self.motion,
            "c_beta": float(c_beta),
            "s_beta": float(s_beta),
            "long2": vessel.length**2 / 48.0,
            "wide2": vessel.beam**2 / 48.0,
            "drift_u": pressure * vessel.beam,
            "drift_v": pressure * vessel.length,
            "drift_arm": self.drift_arm,
        }

    def kernel_with(self, vessel: Vessel) -> Callable[..., None]:
        """One for waves in one direction, and a slower one for waves in many."""
        return short_crested if self.spreading else self.evaluate

    def conflicts(self, vessel: Vessel, step: float) -> Iterator[tuple[str, str]]:
        """Key and message for a cut-off that the step [s] cannot resolve."""
        most = math.pi / step  # rad/s, two steps a wave
        if self.highest * self.peak > most:
            yield (
                "highest",
                f"waves up to {self.highest * self.peak:.4g} rad/s ({self.highest:g} times the "
                f"peak's {self.peak:.4g}) are too fast for steps of {step:g} s, which resolve "
                f"{most:.4g} rad/s at most; give a smaller `highest` or `simulation.step`",
            )

    # Arguments and outputs as those of `long_crested`.
    @staticmethod
    @kernel
    def evaluate(
        t: float,
        x: Vector,
        k: Any,
        table: Vector,
        b: Vector,
        again: float = 0.0,
        stage: float = 0.0,
    ) -> None:
        """Of long-crested waves; see `kernel_with`."""
        long_crested(t, x, k, table, b, again, stage)


def _jonswap(sea: Waves, rate: Vector) -> Vector:
    """Density [m2 s] of the elevation at `rate` [rad/s], both (n,), by JONSWAP."""
    return spectra.jonswap(rate, sea.height, sea.peak, sea.gamma)


def _ittc(sea: Waves, rate: Vector) -> Vector:
    """Density [m2 s] of the elevation at `rate` [rad/s], both (n,), by the ITTC's spectrum."""
    return spectra.jonswap(rate, sea.height, sea.peak, 1.0)


def _torsethaugen(sea: Waves, rate: Vector) -> Vector:
    """Density [m2 s] of the elevation at `rate` [rad/s], both (n,), by Torsethaugen."""
    return torsethaugen(rate, sea.height, sea.peak)


DENSITY = {"jonswap": _jonswap, "ittc": _ittc, "torsethaugen": _torsethaugen}
