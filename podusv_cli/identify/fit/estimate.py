"""Fisher scoring: numbers under which a filter's innovations are as large as the filter says.

The estimate minimises sum of nu^2/S + log S over all delivered values, which is -2 log of their
likelihood, plus the prior's part. Source: L. Ljung, "System Identification", 2nd ed. 1999, ch. 7
(prediction errors); the slopes of log S have to be counted, or the noises come out wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.reading import Whole

# Of a point's coordinate, for slopes: of the hull's numbers, and of all else. Where sway changes
# its sign the filter's slopes of |v| r and |r| v do, so that -2 log of the posterior has steps of
# 0.1 to 0.5 that are a hundredth of a current's prior wide. Slopes within such a step lead nowhere:
# with 1e-4 the search in such a log took 60 rounds or more. Wider ones make no error: whatever they
# are, their products with innovations of the true hull have the mean 0.
SHIFTS = (3e-3, 0.03)
TINY = 1e-4  # of a coordinate: a step that needs no shortening
LONGEST = 1.0  # of a coordinate, in one step
ROUNDS = 100
# Tried side by side: parts of the curvature, and of the prior's on all but hull numbers. A walk
# that is 0 in truth is hardly known, and -2 log of the posterior bends several times more over it
# than Fisher's matrix says: undamped, it jumps over the least value round after round, and what
# damps it with all else keeps the hull where it is.
DAMPINGS = (
    *((0.0, 0.0), (0.0, 3.0), (0.0, 30.0), (0.01, 0.0)),
    *((0.1, 10.0), (1.0, 0.0), (30.0, 0.0), (1e3, 0.0)),
)
STARTS, NEARER = 5, 0.5  # searches at most, and how far from the better start others begin
SETTLED = 0.5  # of -2 log of the posterior: two searches that differ by less came to the same
# Standard deviations between their hulls, at most. If -2 log of the posterior were a parabola two
# points within SETTLED of its least would be 1.4 apart at most.
NEAR = 2.0
ENOUGH = 0.02  # of -2 log of the posterior: what a step has to gain, or the search ends
# Posterior over prior standard deviation of a direction: above OPEN the logs do not determine it,
# above SILENT they say next to nothing of it, and it stays as it was.
OPEN, SILENT = 0.3, 0.8

BREAKS = (
    "the filter along the logs leaves the finite numbers; check units and signs of the columns, "
    "give a vessel nearer to the boat's size, or a shorter identify.step"
)

# From points to innovations and their variances, a row a value, a column a point.
Innovations = Callable[[Sequence[Vector]], tuple[Vector, Vector]]
Tell = Callable[[int, float], None]


@dataclass(frozen=True)
class Scored:
    """-2 log of the posterior at a point, but a constant; slopes and Fisher's matrix of each block.

    Fisher's matrix has two parts: `by_values`, what is known by the values that the filter expects,
    and `by_sizes`, by how far it expects to be off.
    """

    value: float
    slopes: Vector
    by_values: Vector
    by_sizes: Vector

    def curvature(self) -> Vector:
        """Fisher's matrix of all blocks and the prior."""
        whole = (self.by_values + self.by_sizes).sum(axis=0)
        return np.asarray(whole + 2.0 * np.eye(len(whole)))


@dataclass(frozen=True)
class HullSearch:
    """What is searched: `innovations` at points whose prior is normal, with covariance 1.

    `blocks` has the part of the logs that every delivered value belongs to. The first `hull`
    coordinates are numbers of a hull. The first search begins at `first`, the second at `second`,
    where these are given.
    """

    innovations: Innovations
    size: int
    blocks: Whole
    hull: int = 0
    first: Vector | None = None
    second: Vector | None = None

    def values(self, points: Sequence[Vector]) -> list[float]:
        """-2 log of the posterior at points; infinite where the filter breaks down."""
        with np.errstate(all="ignore"):
            nu, s = self.innovations(points)
        return [_value(nu[:, i], s[:, i], y) for i, y in enumerate(points)]

    def score(self, y: Vector) -> Scored:
        """Value, slopes and Fisher's matrix at a point."""
        with np.errstate(all="ignore"):
            return self._score(y)

    def _score(self, y: Vector) -> Scored:
        """The same, where numbers that are not finite may come up."""
        own, other = SHIFTS
        shifts = np.where(np.arange(self.size) < self.hull, own, other)
        nus, variances = self.innovations([y, *(y + np.diag(shifts))])
        value = _value(nus[:, 0], variances[:, 0], y)
        slopes, by_values, by_sizes = [], [], []
        for nu, s in zip(self._split(nus), self._split(variances), strict=True):
            d_nu, d_s = (nu[:, 1:] - nu[:, :1]) / shifts, (s[:, 1:] - s[:, :1]) / shifts
            nu, s = nu[:, :1], s[:, :1]
            slopes.append((2.0 * nu * d_nu / s + d_s * (1.0 - nu * nu / s) / s).sum(axis=0))
            by_values.append(2.0 * _squares(d_nu / np.sqrt(s)))
            by_sizes.append(_squares(d_s / s))
        return Scored(value, np.array(slopes), np.array(by_values), np.array(by_sizes))

    def _split(self, rows: Vector) -> list[Vector]:
        """Rows by block; a block's come one after the other."""
        return np.split(rows, np.flatnonzero(np.diff(self.blocks)) + 1)


def _squares(rows: Vector) -> Vector:
    return np.asarray(np.einsum("ni,nj->ij", rows, rows))


def _value(nu: Vector, s: Vector, y: Vector) -> float:
    if not (np.all(s > 0.0) and np.all(np.isfinite(s)) and np.all(np.isfinite(nu))):
        return np.inf
    return float(np.sum(nu * nu / s + np.log(s)) + y @ y)


@dataclass(frozen=True)
class HullEstimate:
    """Where -2 log of the posterior is least, and the covariance of its errors."""

    y: Vector
    value: float
    covariance: Vector
    rounds: int
    settled: bool = False  # whether two searches have come to it
    interrupted: bool = False
    start: Vector | None = None  # of the search that came to it


def estimate_hull(
    search: HullSearch,
    tell: Tell = lambda i, value: None,
    *,
    starts: int = STARTS,
    begun: Sequence[HullEstimate] = (),
) -> HullEstimate:
    """The best of several searches: from the prior's centre or `first`, `second`, then elsewhere.

    The others begin near the better start. They end when two have come to the same value. `begun`
    are the first ones where they were made before. An interrupt leaves the best so far. Raises
    UsageError where the filter breaks down at the first start.
    """
    first = np.zeros(search.size) if search.first is None else search.first
    found = [*begun] or [_search_from(search, first, tell)]
    starts_at = [first if e.start is None else e.start for e in found]
    if not math.isfinite(found[0].value):
        raise UsageError(f"with the vessel as it is given {BREAKS}")
    rng = np.random.Generator(np.random.PCG64(search.size))
    while len(found) < starts and not (found[-1].interrupted or _agree(found, search.hull)):
        best = int(np.argmin([e.value for e in found]))
        start = starts_at[best] + NEARER * rng.standard_normal(search.size)
        if len(found) == 1 and search.second is not None:
            start = search.second
        try:
            found.append(_search_from(search, start, tell))
            starts_at.append(start)
        except KeyboardInterrupt:  # before its first round
            found[-1] = replace(found[-1], interrupted=True)
    least = min(found, key=lambda e: e.value)
    settled = _agree(found, search.hull) or least.settled
    return replace(least, settled=settled, interrupted=found[-1].interrupted)


def _agree(found: Sequence[HullEstimate], hull: int) -> bool:
    """Whether two searches have come to the least value so far, and to one hull.

    Where all of a motion is taken for noise and loads, any hull has about the same value.
    """
    best, *others = sorted(found, key=lambda e: e.value)
    return any(e.value - best.value <= SETTLED and _apart(best, e, hull) <= NEAR for e in others)


def _apart(one: HullEstimate, other: HullEstimate, hull: int) -> float:
    """How far two hulls are apart, in standard deviations of the first: Mahalanobis's distance."""
    step = (other.y - one.y)[:hull]
    squared = step @ np.linalg.solve(one.covariance[:hull, :hull], step) if hull else 0.0
    return math.sqrt(max(float(squared), 0.0))


def _search_from(search: HullSearch, y: Vector, tell: Tell) -> HullEstimate:
    """Fisher scoring, damped as Marquardt does; each round tries eight dampings side by side."""
    i, stopped, at, start = 0, False, search.score(y), y
    try:
        for i in range(1, ROUNDS + 1):
            tell(i, at.value)
            steps, expected = _steps(at, y, search.hull)
            values = search.values([y + step for step in steps])
            best = int(np.argmin(values))
            if expected <= ENOUGH or not values[best] < at.value:
                break
            y, at = y + steps[best], search.score(y + steps[best])
    except KeyboardInterrupt:
        stopped = True
    with np.errstate(all="ignore"):  # of a start at which the filter breaks down
        spread = covariance(at, search.hull)
    return HullEstimate(y, at.value, spread, i, interrupted=stopped, start=start)


def _steps(at: Scored, y: Vector, hull: int) -> tuple[list[Vector], float]:
    """Steps of growing damping, none longer than LONGEST, and what the first should gain."""
    gradient = at.slopes.sum(axis=0) + 2.0 * y
    curvature = at.curvature()
    beside = np.diag(2.0 * (np.arange(len(y)) >= hull))
    damped = (curvature + a * np.diag(np.diag(curvature)) + b * beside for a, b in DAMPINGS)
    steps = [-np.linalg.solve(matrix, gradient) for matrix in damped]
    short = [step * min(1.0, LONGEST / max(np.abs(step).max(), TINY)) for step in steps]
    return short, float(-0.5 * gradient @ steps[0])


def covariance(at: Scored, hull: int = 0) -> Vector:
    """Of the estimate's errors: by the curvature, or where that is wider by how blocks differ.

    Where innovations are not white the curvature takes the errors for too small. How the slopes of
    blocks differ tells their size, once each is freed of what the fit to it hides: CR2 of R. M.
    Bell and D. F. McCaffrey (Survey Methodology 28, 2002). A few blocks do not tell all directions
    apart, so in no direction the errors are smaller than by the curvature, and in none larger than
    before the logs, where the covariance is 1. NaN where the filter breaks down.
    """
    each = at.by_values + _alone(at.by_sizes, hull)
    whole = each.sum(axis=0) + 2.0 * np.eye(at.slopes.shape[1])
    if not np.all(np.isfinite(whole)):
        return np.full_like(whole, np.nan)
    # In coordinates in which the covariance by the curvature is 1.
    stiffness, axes = np.linalg.eigh(whole)
    stiffness = np.maximum(stiffness, 2.0)  # but for rounding, as the prior's part is
    root = axes * np.sqrt(2.0 / stiffness)
    hidden, basis = np.linalg.eigh(0.5 * root.T @ each @ root)
    left = np.maximum(1.0 - hidden, 2.0 / stiffness[-1])  # at least the prior's part
    freed = np.einsum("bij,bj,bkj,bk->bi", basis, left**-0.5, basis, at.slopes @ root)
    by_blocks = 0.25 * freed.T @ freed + root.T @ root
    return _bound_eigenvalues(root @ _bound_eigenvalues(by_blocks, 1.0, np.inf) @ root.T, 0.0, 1.0)


def _alone(by_sizes: Vector, hull: int) -> Vector:
    """How far the filter expects to be off, of all but the hull's numbers.

    A hull that brakes more makes the filter surer, too, and all the surer on a track that is
    smoother than it expects; that says nothing of how the boat brakes.
    """
    sizes = by_sizes.copy()
    sizes[:, :hull] = sizes[:, :, :hull] = 0.0
    return sizes


def _bound_eigenvalues(matrix: Vector, least: float, most: float) -> Vector:
    """A symmetric matrix with its eigenvalues between two bounds."""
    values, basis = np.linalg.eigh(matrix)
    return np.asarray(basis * np.clip(values, least, most) @ basis.T)


@dataclass(frozen=True)
class Directions:
    """Orthonormal directions of the hull's numbers, best known first.

    `widths` are posterior over prior standard deviation; those above OPEN are left open by the
    logs.
    """

    basis: Vector
    widths: Vector

    @property
    def determined_count(self) -> int:
        """How many of them the logs determine."""
        return int(np.sum(self.widths <= OPEN))


def directions(covariance: Vector, hull: int) -> Directions:
    """Of the first `hull` coordinates. Raises UsageError where the covariance is not finite."""
    if not np.all(np.isfinite(covariance)):
        raise UsageError(f"beside the best numbers that were found {BREAKS}")
    squares, basis = np.linalg.eigh(covariance[:hull, :hull])
    return Directions(basis, np.sqrt(np.maximum(squares, 0.0)))


def prior_kept(
    search: HullSearch, found: HullEstimate, tell: Tell = lambda i, value: None
) -> HullEstimate:
    """The estimate with those directions of the hull as before that the logs say nothing of.

    All else is looked for again beside them, from the prior's centre where the filter breaks down
    at the rest of the estimate. An interrupt leaves the best so far.
    """
    try:
        whole, silent = _silent(search, found.y)
        if found.interrupted or not len(silent):
            return found
        rest, before = np.delete(whole, silent, axis=1), whole[:, silent]

        def innovations(points: Sequence[Vector]) -> tuple[Vector, Vector]:
            return search.innovations([rest @ point for point in points])

        within = HullSearch(innovations, rest.shape[1], search.blocks, search.hull - len(silent))
        start = rest.T @ found.y
        if not math.isfinite(within.values([start])[0]):
            start = np.zeros(within.size)
        again = _search_from(within, start, tell)
    except KeyboardInterrupt:  # before the first round
        return replace(found, interrupted=True)
    covered = rest @ again.covariance @ rest.T + before @ before.T
    rounds = found.rounds + again.rounds
    return replace(
        again, y=rest @ again.y, covariance=covered, rounds=rounds, settled=found.settled
    )


def _silent(search: HullSearch, y: Vector) -> tuple[Vector, Whole]:
    """An orthonormal basis, the hull's directions first, and which of these the logs are silent of.

    They are silent, too, where what they say differs from block to block.
    """
    hull, whole = search.hull, np.eye(search.size)
    ways = directions(covariance(search.score(y), hull), hull)
    whole[:hull, :hull] = ways.basis
    return whole, np.flatnonzero(ways.widths > SILENT)
