"""The ultimate bound of the paper's section 5, (46)-(49), and that of the sway speed, (50)-(51).

Both are computed as printed and corrected; the sway bound's correction is the vessel's own damping.

V' <= -2 lambda V + Delta, so that V ends below Delta / (2 lambda); docs/theory.md derives both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import add_up
from podusv_cli.core.recording import Recording
from podusv_cli.engine.running.replay import Replayed

SWEEPS = 12  # over all pairs of an eigenvalue's rotations; the last do nothing
TRIES = 400  # values of lambda that are tried for the lowest bound


@dataclass(frozen=True)
class Pair:
    """A quantity of surge and yaw."""

    u: float
    r: float


@dataclass(frozen=True)
class Observed:
    """Largest values over a part of a run, of quantities that depend on the run."""

    b: Pair  # |b_u| [N], |b_r| [N m]: bounds of the disturbance
    W: Pair  # |W* - W(0)| [m/s2], [rad/s2]
    alpha_dot: Pair  # the paper's X_1 [m/s2] and X_2 [rad/s2]: |alpha'|
    drift: Pair  # |alpha' + (A + |alpha| - B) alpha|, which drives the filter errors
    epsilon: Pair  # |epsilon| [m/s2], [rad/s2]: residual of f with the ideal weights
    rest: Pair  # [N], [N m]: all other loads in the error equations of u_e, r_e


@dataclass(frozen=True)
class GainCondition:
    """A gain and the limit that it must exceed; NaN where a form has no such condition."""

    name: str
    value: float
    limit: float
    printed_limit: float
    why: str

    @property
    def holds(self) -> bool:
        """Whether the gain exceeds its limit; true without a limit."""
        return not self.value <= self.limit

    @property
    def holds_printed(self) -> bool:
        """Whether the gain exceeds the limit as printed in the paper."""
        return not self.value <= self.printed_limit


@dataclass(frozen=True)
class Bound:
    """lambda [1/s], Delta, and V's bound `value` = Delta / (2 lambda); NaN without observations.

    lambda is the least of `candidates` [1/s], named after their errors; Delta is the sum of
    `terms`. The bound is infinite where lambda is not positive.
    """

    lambda_: float
    Delta: float
    value: float
    candidates: dict[str, float]
    terms: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class UltimateBound:
    """The bound and the conditions on the gains, corrected and as printed."""

    corrected: Bound
    printed: Bound
    conditions: tuple[GainCondition, ...]


def least_eigenvalue(form: Vector) -> float:
    """The least eigenvalue of a finite symmetric matrix (n, n), n small.

    By Jacobi's rotations (Golub and Van Loan, "Matrix Computations", 4th ed., 8.5): LAPACK's last
    bits depend on the processor.
    """
    a, n = np.array(form), len(form)
    pairs = [(p, q) for p in range(n) for q in range(p + 1, n)]
    for p, q in SWEEPS * pairs:
        if a[p, q] != 0.0:
            # t is the tangent of the rotation, of at most 45 deg, that makes a[p, q] zero
            slope = float(a[q, q] - a[p, p]) / (2.0 * float(a[p, q]))
            t = math.copysign(1.0 / (abs(slope) + math.sqrt(slope * slope + 1.0)), slope)
            c = 1.0 / math.sqrt(t * t + 1.0)
            a[[p, q]] = c * a[[p, q]] + t * c * np.array([-a[q], a[p]])
            a[:, [p, q]] = c * a[:, [p, q]] + t * c * np.array([-a[:, q], a[:, p]]).T
    return float(a.diagonal().min())


@dataclass(frozen=True)
class _Axis:
    """Gains of one axis: surge (z_e, u_e, y_u, ...) or yaw (psi_e, r_e, y_r, ...)."""

    k: float
    gain: float  # k_ue - 1/2 or k_re - 1/2
    mass: float
    A: float
    cross: float  # 0, or 1 with the printed sign, which doubles the cross term

    def slowest(self) -> float:
        """The largest lambda [1/s] for -k e^2 - gain w^2 - A y^2 + |e y| + 2 cross |e w|.

        It is the least eigenvalue of that form over the squares' weights 1, mass, 1 in 2 V. NaN
        where a number is not finite.
        """
        form = np.array([[self.k, self.cross, 0.5], [self.cross, self.gain, 0.0], [0.5, 0.0, 0.0]])
        form[2, 2] = self.A if math.isfinite(self.A) else 0.0
        size = 3 if math.isfinite(self.A) else 2  # without a filter there is no y
        scale = np.sqrt([1.0, self.mass, 1.0])
        scaled = (form / np.outer(scale, scale))[:size, :size]
        return least_eigenvalue(scaled) if np.isfinite(scaled).all() else math.nan

    def limit(self) -> float:
        """The value that k must exceed for a positive lambda; infinite where none is enough."""
        from_cross = self.cross**2 / self.gain if self.gain > 0 else math.inf * self.cross
        return 1.0 / (4.0 * self.A) + (from_cross if self.cross else 0.0)

    def room(self, rate: Vector) -> Vector:
        """sigma_y (n,), the part of 2 A that remains for the filter's drift.

        `rate` (n,) [1/s] is the decay that is wanted.
        """
        if math.isinf(self.A):
            return np.full_like(rate, math.inf)
        spare = self.k - rate - self.cross**2 / (self.gain - rate * self.mass)
        return np.asarray(2.0 * (self.A - rate - 1.0 / (4.0 * spare)))


def ultimate_bound(
    law: PolarBackstepping, vessel: Vessel, observed: Observed | None = None
) -> UltimateBound:
    """lambda, Delta and the bound of (47)-(49) in both forms; `vessel` gives m11 and m33.

    Without `observed` only lambda and the conditions are known. lambda is then the largest for any
    choice of sigma_yu, sigma_yr in (47).
    """
    cross = 0.0 if law.coupling == "corrected" else 1.0
    A = law.filter_decay(0.0, 0.0)
    axes = (
        _Axis(law.k_ze, law.k_ue - 0.5, vessel.m11, A[0], cross),
        _Axis(law.k_psie, law.k_re - 0.5, vessel.m33, A[1], cross),
    )
    return UltimateBound(
        _corrected_bound(law, axes, observed),
        _printed_bound(law, axes, observed),
        _conditions(law, axes),
    )


Axes = tuple[_Axis, _Axis]


def _corrected_bound(law: PolarBackstepping, axes: Axes, observed: Observed | None) -> Bound:
    """The bound of the corrected proof: rate lambda [1/s], Delta, and what they come from.

    Without observations it has the rate only. `axes` are surge and yaw.
    """
    surge, yaw = axes
    candidates = {
        "z_e, y_u": surge.slowest(),
        "psi_e, y_r": yaw.slowest(),
        "u_e": surge.gain / surge.mass,
        "r_e": yaw.gain / yaw.mass,
        "W_u": law.Gamma_u * law.sigma_u / 2.0,
        "W_r": law.Gamma_r * law.sigma_r / 2.0,
        "b_u": law.gamma_u * law.sigma_bu / 2.0,
        "b_r": law.gamma_r * law.sigma_br / 2.0,
    }
    if observed is None:
        return Bound(_least(candidates), math.nan, math.nan, candidates)
    # A smaller lambda leaves the filters more room, which makes Delta smaller: the best is sought
    rates = np.arange(1, TRIES) / TRIES * _least(candidates)
    rooms = (surge.room(rates), yaw.room(rates))
    terms = _terms(law, observed, "rest", observed.rest)
    return _best(candidates, terms, rates, rooms, observed.drift)


def _printed_bound(law: PolarBackstepping, axes: Axes, observed: Observed | None) -> Bound:
    """The bound as the paper prints it, with the arguments of `_corrected_bound`.

    It leaves out inertia and adaptation gains in the rates, and the cross terms of the filters.
    """
    surge, yaw = axes
    candidates = {
        "z_e": surge.k,
        "psi_e": yaw.k,
        "u_e": surge.gain,
        "r_e": yaw.gain,
        "W_u": law.sigma_u / 2.0,
        "W_r": law.sigma_r / 2.0,
        "b_u": law.sigma_bu / 2.0,
        "b_r": law.sigma_br / 2.0,
        "y_u": surge.A,
        "y_r": yaw.A,
    }
    if observed is None:
        return Bound(_least(candidates), math.nan, math.nan, candidates)
    rates = np.arange(1, TRIES) / TRIES * _least(candidates)
    # At the largest lambda itself a filter may have no room left, so it is not among the rates
    rooms = (2.0 * (surge.A - rates), 2.0 * (yaw.A - rates))
    terms = _terms(law, observed, "epsilon", observed.epsilon)
    return _best(candidates, terms, rates, rooms, observed.alpha_dot)


def _terms(law: PolarBackstepping, observed: Observed, left: str, over: Pair) -> dict[str, float]:
    """The terms of Delta that are independent of lambda, by name.

    What is left `over` [N, N m or m/s2, rad/s2], and its name `left`, differ between the forms.
    """
    return {
        "W_u": law.sigma_u * _half_square(observed.W.u),
        "W_r": law.sigma_r * _half_square(observed.W.r),
        "b_u": law.sigma_bu * _half_square(observed.b.u - law.b_hat_u0),
        "b_r": law.sigma_br * _half_square(observed.b.r - law.b_hat_r0),
        "lemma": law.partial * (observed.b.u + observed.b.r),
        f"{left}_u": _half_square(over.u),
        f"{left}_r": _half_square(over.r),
    }


def _best(
    candidates: dict[str, float],
    terms: dict[str, float],
    rates: Vector,
    rooms: tuple[Vector, Vector],
    drift: Pair,
) -> Bound:
    """The lowest bound over lambda, which fixes sigma_yu and sigma_yr of (47).

    `rates` (n,) [1/s] are the values of lambda that are tried, `rooms` what each leaves of 2 A in
    surge and yaw, (n,) each; `drift` drives the filters' errors.
    """
    largest = _least(candidates)
    if largest <= 0.0:
        return Bound(largest, math.nan, math.inf, candidates, terms)
    y_u, y_r = _half_square(drift.u) / rooms[0], _half_square(drift.r) / rooms[1]
    Delta = add_up(terms.values()) + y_u + y_r
    bounds = Delta / (2.0 * rates)
    best = int(np.argmin(bounds))
    terms = terms | {"y_u": float(y_u[best]), "y_r": float(y_r[best])}
    rate, total, value = float(rates[best]), float(Delta[best]), float(bounds[best])
    return Bound(rate, total, value, candidates, terms)


def _least(candidates: dict[str, float]) -> float:
    """The least of the candidates for lambda [1/s]; NaN where one is."""
    return float(np.min([*candidates.values()]))  # NaN where one is, unlike Python's min


def _half_square(x: float) -> float:
    """x^2/2; infinite where that is beyond all numbers."""
    return x * x / 2.0  # x**2 would raise on overflow


def _conditions(law: PolarBackstepping, axes: Axes) -> tuple[GainCondition, ...]:
    """What gains must exceed, by the corrected proof and by the printed one; axes: surge, yaw."""
    surge, yaw = axes
    why = "must outweigh -z_e y_u cos psi_e and -psi_e y_r, which the paper's V' leaves out"
    if surge.cross:
        why += ", and the cross terms that the printed sign doubles"
    half = "1/2 of it compensates the network's error (47)"
    leak = "without leakage the estimate is not bounded (48)"
    leakage = (
        "Gamma_u",
        "sigma_u",
        "Gamma_r",
        "sigma_r",
        "gamma_u",
        "sigma_bu",
        "gamma_r",
        "sigma_br",
    )
    return (
        GainCondition("k_ze", law.k_ze, surge.limit(), 0.0, why),
        GainCondition("k_psie", law.k_psie, yaw.limit(), 0.0, why),
        GainCondition("k_ue", law.k_ue, 0.5, 0.5, half),
        GainCondition("k_re", law.k_re, 0.5, 0.5, half),
        *(GainCondition(name, getattr(law, name), 0.0, 0.0, leak) for name in leakage),
    )


@dataclass(frozen=True)
class SwayBound:
    """gamma_v [N] of (51) and the sway speed [m/s] above which V_v falls."""

    gamma_v: float
    value: float
    printed_gamma_v: float
    printed: float


def sway_push(vessel: Vessel, log: Recording, now: Replayed) -> tuple[Vector, Vector]:
    """The sway force at every row of a log (rows,) [N]: without damping, and that printed in (51).

    The latter is m11 |u| |r| + |b_v|; `now` has rates and signals at the rows.

    The first is |m22 v' - (Y_v + Y_vv |v|) v|, with cross terms and the actuator's sway force. For
    the paper's vessel it never exceeds the second.
    """
    v = log["v"]
    damping = (vessel.Y_v + vessel.Y_vv * np.abs(v)) * v
    printed = vessel.m11 * np.abs(log["u"] * log["r"]) + np.abs(now.signals["b_v"])
    return np.abs(vessel.m22 * now.rates["v"] - damping), printed


def sway_bound(vessel: Vessel, push: float, printed_push: float) -> SwayBound:
    """The sway speed at which damping equals the push; infinite without positive damping.

    `push` and `printed_push` [N] are the largest sway forces of `sway_push` in a part of a run.
    """
    d22, d_vv = -vessel.Y_v, -vessel.Y_vv
    value = math.inf
    if d22 > 0.0 and d_vv >= 0.0:
        # The root of d_vv v^2 + d22 v = push, in the form that holds for d_vv = 0 as well
        value = 2.0 * push / (d22 + math.sqrt(d22 * d22 + 4.0 * d_vv * push))
    elif d22 == 0.0 and d_vv > 0.0:
        value = math.sqrt(push / d_vv)
    printed = printed_push / d22 if d22 > 0.0 else math.inf
    return SwayBound(push, value, printed_push, printed)
