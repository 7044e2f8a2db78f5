"""Fisher scoring: numbers under which a filter's innovations are as large as the filter says.

The estimate minimises sum of nu^2/S + log S over all delivered values, which is -2 log of their
likelihood, plus the prior's part. Source: L. Ljung, "System Identification", 2nd ed. 1999, ch. 7
(prediction errors); the slopes of log S have to be counted, or the noises come out wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.reading import Whole

SHIFT = 1e-4  # of a point's coordinate, for slopes
LONGEST = 1.0  # of a coordinate, in one step
ROUNDS = 60
ENOUGH = 0.01  # of a posterior standard deviation: a step that ends the search
OPEN = 0.3  # posterior over prior standard deviation of a direction that logs leave open

# From points to innovations and their variances, a row a value, a column a point.
Innovations = Callable[[Sequence[Vector]], tuple[Vector, Vector]]
Tell = Callable[[int, float], None]


@dataclass(frozen=True)
class Scored:
    """-2 log of the posterior at a point, but a constant; the slopes of what each block adds."""

    value: float
    slopes: Vector
    information: Vector


@dataclass(frozen=True)
class Search:
    """What is searched: `innovations` at points whose prior is normal, with covariance 1.

    `blocks` has the part of the logs that every delivered value belongs to.
    """

    innovations: Innovations
    size: int
    blocks: Whole

    def along(self, basis: Vector) -> Search:
        """The search in the space that the columns of `basis`, orthonormal, span."""

        def innovations(points: Sequence[Vector]) -> tuple[Vector, Vector]:
            return self.innovations([basis @ y for y in points])

        return Search(innovations, basis.shape[1], self.blocks)

    def value(self, y: Vector) -> float:
        """-2 log of the posterior at a point; infinite where the filter breaks down."""
        nu, s = self.innovations([y])
        return _value(nu[:, 0], s[:, 0], y)

    def scored(self, y: Vector) -> Scored:
        """Value, slopes and Fisher's matrix at a point."""
        nus, variances = self.innovations([y, *(y + SHIFT * np.eye(self.size))])
        nu, s = nus[:, :1], variances[:, :1]
        d_nu, d_s = (nus[:, 1:] - nu) / SHIFT, (variances[:, 1:] - s) / SHIFT
        slopes = 2.0 * nu * d_nu / s + d_s * (1.0 - nu * nu / s) / s
        each = np.array([np.bincount(self.blocks, column) for column in slopes.T], float).T
        # Not by BLAS, whose threads wait for each other longer than this takes.
        information = 2.0 * _squares(d_nu / np.sqrt(s)) + _squares(d_s / s)
        return Scored(_value(nu[:, 0], s[:, 0], y), each, information)


def _squares(rows: Vector) -> Vector:
    return np.asarray(np.einsum("ni,nj->ij", rows, rows))


def _value(nu: Vector, s: Vector, y: Vector) -> float:
    if not (np.all(s > 0.0) and np.all(np.isfinite(s)) and np.all(np.isfinite(nu))):
        return np.inf
    return float(np.sum(nu * nu / s + np.log(s)) + y @ y)


@dataclass(frozen=True)
class Estimate:
    """Where -2 log of the posterior is least, and the covariance of its errors."""

    y: Vector
    value: float
    covariance: Vector
    rounds: int
    settled: bool
    interrupted: bool = False


def estimated(search: Search, start: Vector, tell: Tell = lambda i, value: None) -> Estimate:
    """The estimate by Fisher scoring. An interrupt leaves the best so far."""
    y, at, settled, stopped, i = start, search.scored(start), False, False, 0
    try:
        for i in range(1, ROUNDS + 1):
            tell(i, at.value)
            step = _step(at, y)
            while search.value(y + step) >= at.value and np.abs(step).max() > SHIFT:
                step = 0.5 * step
            if np.abs(step).max() > SHIFT:
                y, at = y + step, search.scored(y + step)
            settled = bool(np.all(np.abs(step) < ENOUGH * np.sqrt(np.diag(_by_curvature(at)))))
            if settled:
                break
    except KeyboardInterrupt:
        stopped = True
    return Estimate(y, at.value, covariance(at, y), i, settled, stopped)


def _step(at: Scored, y: Vector) -> Vector:
    gradient = at.slopes.sum(axis=0) + 2.0 * y
    step: Vector = -np.linalg.solve(at.information + 2.0 * np.eye(len(y)), gradient)
    return np.asarray(step * min(1.0, LONGEST / max(np.abs(step).max(), SHIFT)))


def _by_curvature(at: Scored) -> Vector:
    curvature = at.information + 2.0 * np.eye(len(at.information))
    return np.asarray(2.0 * np.linalg.inv(curvature), float)


def covariance(at: Scored, y: Vector) -> Vector:
    """Of the estimate's errors: by the curvature, or where that is wider by how blocks differ.

    The second is White's (Econometrica 50, 1982), with blocks in place of single values: it stays
    right where innovations are not white, as a bootstrap over blocks would.
    """
    curved = _by_curvature(at)
    count = len(at.slopes)
    apart = at.slopes - at.slopes.mean(axis=0)
    spread = apart.T @ apart * (count / max(count - 1, 1)) + 4.0 * np.eye(len(y))
    half = 0.5 * curved
    wide = half @ spread @ half
    factor = np.sqrt(np.maximum(1.0, np.diag(wide) / np.diag(curved)))
    return np.asarray(curved * np.outer(factor, factor))


@dataclass(frozen=True)
class Directions:
    """Orthonormal directions of the hull's numbers, best known first.

    `widths` are posterior over prior standard deviation; those above OPEN are left open by the
    logs.
    """

    basis: Vector
    widths: Vector

    @property
    def known(self) -> int:
        """How many of them the logs tell."""
        return int(np.sum(self.widths <= OPEN))


def directions(covariance: Vector, hull: int) -> Directions:
    """Of the first `hull` coordinates."""
    squares, basis = np.linalg.eigh(covariance[:hull, :hull])
    return Directions(basis, np.sqrt(np.maximum(squares, 0.0)))


def told(
    search: Search, hull: int, tell: Tell = lambda i, value: None
) -> tuple[Estimate, Directions]:
    """The estimate, and what of the first `hull` numbers the logs tell.

    In a direction that they leave open the estimate keeps the prior, its centre and its width.
    """
    free = estimated(search, np.zeros(search.size), tell)
    ways = directions(free.covariance, hull)
    if ways.known == hull or free.interrupted:
        return free, ways
    basis = np.zeros((search.size, search.size - hull + ways.known))
    basis[:hull, : ways.known] = ways.basis[:, : ways.known]
    basis[hull:, ways.known :] = np.eye(search.size - hull)
    inside = estimated(search.along(basis), basis.T @ free.y, tell)
    whole = basis @ inside.covariance @ basis.T
    left = ways.basis[:, ways.known :]
    whole[:hull, :hull] += left @ left.T
    return replace(inside, y=basis @ inside.y, covariance=whole), ways
