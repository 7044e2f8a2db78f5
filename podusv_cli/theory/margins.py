"""Margins of a loop that is opened at the plant's input: crossovers, phase, gain, delay, peaks.

For q' = A q + B d and loads C q, cutting the loads off the hull leaves A_0 = A - B C and

    L(s) = -C (s - A_0)^-1 B,   S = 1/(1 + L),   T = L/(1 + L)

(Skogestad and Postlethwaite, Multivariable Feedback Control, 2005, chapter 2). Several loops that
are cut together have the eigenvalues of their matrix L(jw) in place of L (characteristic loci;
MacFarlane and Postlethwaite, Int. J. Control 25, 1977).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt

from podusv_cli.core.kernel import Vector

Complex = npt.NDArray[np.complex128]
SLOWEST = 1e-5  # rad/s; slower motion is not looked at
DENSITY = 60  # frequencies a decade
BESIDE = 1.0 + 1e-9  # times an undamped pole, where L is still finite
BATCH = 256  # frequencies solved together
STABLE = 1e-7  # of the largest pole; a real part up to this is zero


@dataclass(frozen=True)
class Cut:
    """A closed loop q' = A q + B d with loads C q, to be cut between these loads and the hull.

    Shapes (n, n), (n, m), (m, n), for m loads that are cut together.
    """

    A: Vector
    B: Vector
    C: Vector

    @property
    def open_matrix(self) -> Vector:
        """A_0, shape (n, n): the loads are what they are, and the hull does not feel them."""
        return self.A - self.B @ self.C

    def response(self, omega: Vector) -> Complex:
        """L(jw) at these frequencies [rad/s], shape (w, m, m)."""
        opened, unit = self.open_matrix, np.eye(len(self.A))
        parts = [
            -self.C @ np.linalg.solve(1j * part[:, None, None] * unit - opened, self.B + 0j)
            for part in np.split(omega, range(BATCH, len(omega), BATCH))
        ]
        return np.concatenate(parts)

    def loci(self, omega: Vector) -> Complex:
        """The eigenvalues of L(jw), smallest magnitude first, shape (w, m)."""
        loci = np.linalg.eigvals(self.response(omega))
        return np.asarray(np.take_along_axis(loci, np.argsort(np.abs(loci), axis=1), axis=1))

    def frequencies(self) -> Vector:
        """Frequencies (w,) [rad/s], rising, up to where L is far below 1.

        Evenly spread over decades, with that of every pole, open and closed, among them.
        """
        sizes = np.abs(np.concatenate([np.linalg.eigvals(m) for m in (self.A, self.open_matrix)]))
        sizes = BESIDE * sizes[sizes > SLOWEST]
        # At high frequency L is about C B/w, so it crosses 1 near |C B|
        slow = max(1e-2 * sizes.min(initial=1.0), SLOWEST)
        fast = 1e2 * max(sizes.max(initial=1.0), float(np.linalg.norm(self.C @ self.B)))
        count = int(DENSITY * math.log10(fast / slow))
        return np.unique(np.append(np.geomspace(slow, fast, count), sizes))


@dataclass(frozen=True)
class Margins:
    """What a loop can take, and the curves that it is read from.

    The loop turns unstable when its phase lags by `phase_margin` [rad] more (or leads, whatever is
    less), when its gain grows by the factor `gain_margin` or falls by `gain_reduction`, when it is
    late by `delay_margin` [s]. Infinite (for the reduction 0) where it never does, NaN where it is
    unstable as it is. `crossovers` [rad/s] are those with |L| = 1. S and T are over `omega`.
    """

    omega: Vector
    S: Vector
    T: Vector
    crossovers: Vector = field(default_factory=lambda: np.zeros(0))
    phase_margin: float = math.nan
    gain_margin: float = math.nan
    gain_reduction: float = math.nan
    delay_margin: float = math.nan
    peak_S: float = math.nan
    peak_T: float = math.nan


def poles(A: Vector) -> Complex:
    """Eigenvalues (n,) [1/s] of A (n, n), the slowest to decay first."""
    eigenvalues = np.linalg.eigvals(A)
    return np.asarray(eigenvalues[np.lexsort((eigenvalues.imag, -eigenvalues.real))], dtype=complex)


def stable(A: Vector) -> bool:
    """Whether no pole of A (n, n) is to the right of the imaginary axis by more than rounding."""
    eigenvalues = np.linalg.eigvals(A)
    return bool(eigenvalues.real.max() <= STABLE * abs(eigenvalues).max())


def margins(cut: Cut) -> Margins:
    """The margins of one loop, m = 1; only S and T where the closed loop is unstable."""
    omega = cut.frequencies()
    L = cut.response(omega)[:, 0, 0]
    S, T = np.abs(1.0 / (1.0 + L)), np.abs(L / (1.0 + L))
    if not stable(cut.A):
        return Margins(omega, S, T)
    crossed, angles = _crossings(cut, omega)
    gains = _gains(cut, omega, L)
    return Margins(
        omega,
        S,
        T,
        crossovers=crossed,
        phase_margin=float(np.abs(angles).min(initial=math.inf)),
        gain_margin=min((gain for gain in gains if gain > 1.0), default=math.inf),
        gain_reduction=max((gain for gain in gains if gain < 1.0), default=0.0),
        delay_margin=_delay(crossed, angles),
        peak_S=max(1.0, _peak(cut, omega, S, lambda L: 1.0 / abs(1.0 + L))),  # 1 is S at infinity
        peak_T=_peak(cut, omega, T, lambda L: abs(L / (1.0 + L))),
    )


def delay_margin(cut: Cut) -> float:
    """The shortest delay [s] in all loops that are cut together that makes them unstable."""
    return _delay(*_crossings(cut, cut.frequencies())) if stable(cut.A) else math.nan


def _delay(crossed: Vector, angles: Vector) -> float:
    """Shortest delay [s] that takes a crossing to -1; infinite without one.

    `crossed` (n,) [rad/s], `angles` (n,) [rad] from -1. A lead is a lag of a turn less.
    """
    return float((np.mod(angles, 2.0 * math.pi) / crossed).min(initial=math.inf))


def _crossings(cut: Cut, omega: Vector) -> tuple[Vector, Vector]:
    """Where a locus has magnitude 1 (n,) [rad/s], and its angle there from -1 (n,), in (-pi, pi].

    `omega` (w,) [rad/s] are frequencies between which it is looked for.
    """

    def size(w: float, i: int) -> float:
        """The logarithm of the magnitude of locus number i at w [rad/s], which is 0 there."""
        return float(np.log(np.abs(cut.loci(np.array([w]))[0, i])))

    sizes, roots = np.log(np.abs(cut.loci(omega))), list[tuple[float, int]]()
    for i, values in enumerate(sizes.T):
        roots += ((root, i) for root in _roots(partial(size, i=i), omega, values))
    loci = [cut.loci(np.array([root]))[0, i] for root, i in sorted(roots)]
    return np.array([root for root, _ in sorted(roots)]), np.angle(-np.array(loci, dtype=complex))


def _gains(cut: Cut, omega: Vector, L: Complex) -> list[float]:
    """Factors of the gain with which a pole lies on the imaginary axis, at 0 as well.

    L (n,) is the loop's response at `omega` (n,) [rad/s].
    """
    # With a gain of -1/L the response passes through -1; L is real at these w, and at 0
    at = _roots(lambda w: float(cut.response(np.array([w]))[0, 0, 0].imag), omega, L.imag)
    values = [complex(cut.response(np.array([w]))[0, 0, 0]).real for w in at]
    # With a pole at 0 the response has no end there
    if abs(np.linalg.eigvals(cut.open_matrix)).min() > SLOWEST:
        values.append(complex(cut.response(np.zeros(1))[0, 0, 0]).real)
    return [-1.0 / value for value in values if value < 0.0]


def _roots(f: Callable[[float], float], omega: Vector, values: Vector) -> list[float]:
    """Zeros of f [rad/s] between frequencies `omega` (n,) at which `values` (n,) change sign."""
    from scipy.optimize import brentq  # slow to import

    changes = np.flatnonzero(np.diff(values > 0.0))
    return [float(brentq(f, omega[i], omega[i + 1], rtol=1e-12)) for i in changes]


def _peak(cut: Cut, omega: Vector, values: Vector, of: Callable[[complex], float]) -> float:
    """The largest value of `of` (a function of L) over all frequencies.

    `values` (n,) are those at `omega` (n,) [rad/s]; beside the largest it is looked for in between.
    """
    from scipy.optimize import minimize_scalar  # slow to import

    at = int(np.argmax(values))
    ends = omega[max(at - 1, 0)], omega[min(at + 1, len(omega) - 1)]
    minimum = minimize_scalar(
        lambda w: -of(complex(cut.response(np.array([w]))[0, 0, 0])), bounds=ends, method="bounded"
    )
    # The search need not look at this frequency itself, and may end lower
    return max(float(values[at]), -float(minimum.fun))
