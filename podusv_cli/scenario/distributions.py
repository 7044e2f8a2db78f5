"""Distributions of numbers, as a scenario's `sweep` names them.

Each takes u, uniform in (0, 1), to a value by the inverse of its distribution function. The values
have the same bits on every machine.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import model_validator

from podusv_cli.core.component import OF_SECTION, Component, value
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import exponential, logarithm, standard_normal

LEAST = 1e-6  # the share of a distribution that `within` has to leave
LARGEST = 2**53  # whole number: all up to this are exact as floats
HALVINGS = 60  # of (0, 1), until nothing is left between two numbers
LEVELS = 6  # of these, side by side
Interval = tuple[float, float]
Numbers = npt.NDArray[Any]  # floats, whole numbers, or Python objects


class Bounded(Component):
    """A distribution that may be cut off on both sides; what remains keeps its shape."""

    within: Interval | None = value(
        None, OF_SECTION, "two bounds: only what is between them is drawn; none where left out"
    )

    @abstractmethod
    def whole(self, u: Vector) -> Vector:
        """The values (n,) for shares u (n,) in (0, 1), without `within`."""

    def at(self, u: Vector) -> Vector:
        """The values (n,) for shares u (n,) in (0, 1), within the bounds."""
        if self.within is None:
            return self.whole(u)
        low, high = self.shares
        return np.clip(self.whole(low + u * (high - low)), *self.within)

    @cached_property
    def shares(self) -> Interval:
        """Which shares of the whole distribution are below the two bounds."""
        low, high = self.within or (-math.inf, math.inf)
        return self._share_below(low), self._share_below(high)

    @lru_cache(maxsize=256)  # noqa: B019  (a value; a draw asks for it again and again)
    def _share_below(self, x: float) -> float:
        """The share of the whole distribution at or below x, by bisection of (0, 1).

        One call of `whole`, which is slow for single numbers, gives the answers to the next LEVELS
        halvings, whichever way each goes.
        """
        low, high = 0.0, 1.0
        for _ in range(HALVINGS // LEVELS):
            edges = _halving_places(low, high)
            below = self.whole(edges[1:-1]) <= x
            first, last = 0, len(below) + 1
            # Until no float lies between the two ends.
            while last - first > 1 and low < (middle := edges[(first + last) // 2]) < high:
                if below[(first + last) // 2 - 1]:
                    first, low = (first + last) // 2, float(middle)
                else:
                    last, high = (first + last) // 2, float(middle)
        # 1 itself is above every share that is drawn; else the lower end is on the safe side.
        return high if high == 1.0 else low

    @model_validator(mode="after")
    def _leaves_something(self) -> Self:
        """Raises ValueError where `within` excludes nearly all of the distribution."""
        if self.within is not None:
            _check_order("within", self.within)
            left = self.shares[1] - self.shares[0]
            if left < LEAST:
                raise ValueError(
                    f"within: {list(self.within)} excludes all but a share of {left:.1g}; "
                    f"at least {LEAST:g} has to be left"
                )
        return self


class Normal(Bounded):
    """A normal distribution."""

    mean: float = value(0.0, OF_SECTION, "its mean")
    sigma: float = value(..., OF_SECTION, "its standard deviation", gt=0)

    def whole(self, u: Vector) -> Vector:
        """The values (n,) for shares u (n,) in (0, 1), without `within`."""
        return self.mean + self.sigma * standard_normal(u)


class LogNormal(Bounded):
    """A distribution whose logarithm is normal: factors, and numbers that are above 0."""

    median: float = value(1.0, OF_SECTION, "its median", gt=0)
    sigma: float = value(
        ..., "", "the standard deviation of the logarithm: 0.1 is about 10 %", gt=0, le=5
    )

    def whole(self, u: Vector) -> Vector:
        """The values (n,) for shares u (n,) in (0, 1), without `within`."""
        return self.median * exponential(self.sigma * standard_normal(u))


def _halving_places(low: float, high: float) -> Vector:
    """All places that LEVELS halvings can come to, with both ends, in order.

    Shape (2^LEVELS + 1,).
    """
    edges = np.array([low, high])
    for _ in range(LEVELS):
        halves = np.empty(2 * len(edges) - 1)
        halves[::2], halves[1::2] = edges, 0.5 * (edges[:-1] + edges[1:])
        edges = halves
    return edges


def _check_order(name: str, bounds: tuple[float, ...]) -> None:
    """Raises ValueError where the first bound is not below the last, or both are too far apart.

    `name` is the key in messages; the difference has to be finite, as draws are computed with it.
    """
    low, high = bounds[0], bounds[-1]
    if not low < high:
        raise ValueError(f"{name}: {low:.15g} is not below {high:.15g}")
    if not math.isfinite(high - low):
        raise ValueError(f"{name}: {low:g} and {high:g} are too far apart")


def _corners(name: str, corners: tuple[float, ...]) -> None:
    """Raises ValueError unless low <= mode <= high and low < high.

    `name` is the key in messages.
    """
    low, mode, high = corners
    _check_order(name, corners)
    if not low <= mode <= high:
        raise ValueError(f"{name}: write [low, mode, high]; {mode:g} is not between the others")


def _some(name: str, values: tuple[Any, ...]) -> None:
    """Raises ValueError for no values, and for whole numbers that 64 bits do not hold."""
    if not values:
        raise ValueError(f"{name}: is empty; write the values to choose from")
    if any(isinstance(value, int) and abs(value) >= 2**63 for value in values):
        raise ValueError(f"{name}: whole numbers must lie between -2^63 and 2^63; write 1e20")


def _uniform(bounds: Interval, u: Vector) -> Numbers:
    """A number between the bounds for each `u` (n,) in (0, 1), all alike likely."""
    low, high = bounds
    # Rounding may take the sum beyond a bound.
    return np.clip(low + u * (high - low), low, high)


def _rising(name: str, bounds: Interval) -> None:
    """Raises ValueError unless 0 < low < high, as the logarithm needs."""
    _check_order(name, bounds)
    if bounds[0] <= 0.0:
        raise ValueError(f"{name}: {bounds[0]:g} is not above 0")


def _log_uniform(bounds: Interval, u: Vector) -> Numbers:
    """A number between the bounds for each `u` (n,) in (0, 1), uniform in its logarithm.

    Clipped, as the exponential of a logarithm may miss a bound by a rounding.
    """
    low, high = bounds
    ends = logarithm(np.array(bounds))
    return np.clip(exponential(ends[0] + u * (ends[1] - ends[0])), low, high)


def _triangular(corners: tuple[float, float, float], u: Vector) -> Numbers:
    """A triangular number for each `u` (n,) in (0, 1).

    It is the inverse of the distribution function at `u`. `corners` are low, mode and high.
    """
    low, mode, high = corners
    width, rise, fall = high - low, mode - low, high - mode
    # Each branch is a square root: the density rises and falls linearly.
    up, down = low + np.sqrt(u * width * rise), high - np.sqrt((1.0 - u) * width * fall)
    return np.clip(np.where(u * width < rise, up, down), low, high)


def _choice(values: tuple[Any, ...], u: Vector) -> Numbers:
    """One of `values` for each `u` (n,) in (0, 1), all alike likely; an array of objects (n,).

    It is filled and not made of the tuple: numpy would make strings of mixed values.
    """
    chosen = np.empty(len(values), object)
    chosen[:] = values
    return chosen[_place(len(values), u)]


def _integers(bounds: tuple[int, int], u: Vector) -> Numbers:
    """A whole number between the bounds, both included, for each `u` (n,) in (0, 1)."""
    low, high = bounds
    return low + _place(high - low + 1, u)


def _place(count: int, u: Vector) -> npt.NDArray[np.int64]:
    """Which of `count` values each share u (n,) in (0, 1) falls on."""
    return np.minimum((u * count).astype(np.int64), count - 1)


def _whole(name: str, bounds: tuple[int, int]) -> None:
    """Raises ValueError for bounds that a float cannot hold exactly, or in the wrong order."""
    if max(map(abs, bounds)) > LARGEST:
        raise ValueError(f"{name}: whole numbers must lie between -2^53 and 2^53")
    _check_order(name, bounds)


def _angle(word: str, u: Vector) -> Numbers:
    return math.pi * (1.0 - 2.0 * u)


def _at(distribution: Bounded, u: Vector) -> Numbers:
    return distribution.at(u)


def _sound(name: str, content: Any) -> None:
    """Nothing more to check."""


# For every key of `Distribution`: what else has to hold, and the values for u.
WAYS: dict[str, tuple[Callable[[str, Any], None], Callable[[Any, Vector], Numbers]]] = {
    "uniform": (_check_order, _uniform),
    "log_uniform": (_rising, _log_uniform),
    "normal": (_sound, _at),
    "lognormal": (_sound, _at),
    "triangular": (_corners, _triangular),
    "choice": (_some, _choice),
    "integers": (_whole, _integers),
    "angle": (_sound, _angle),
}


class Distribution(Component):
    """A distribution: one of the keys says which."""

    uniform: Interval | None = value(
        None, OF_SECTION, "[low, high]: all between them are equally likely"
    )
    normal: Normal | None = value(None, OF_SECTION, "a normal distribution")
    lognormal: LogNormal | None = value(None, OF_SECTION, "its logarithm is normal; for factors")
    log_uniform: Interval | None = value(
        None,
        OF_SECTION,
        "[low, high]: the logarithm is equally likely everywhere between; for factors",
    )
    triangular: tuple[float, float, float] | None = value(
        None, OF_SECTION, "[low, mode, high]: likeliest at the mode, falling to both sides"
    )
    choice: tuple[bool | int | float | str, ...] | None = value(
        None,
        OF_SECTION,
        "values to choose from; all are equally likely, one that is written twice twice",
    )
    integers: tuple[int, int] | None = value(
        None, OF_SECTION, "[low, high]: whole numbers, both ends included"
    )
    angle: Literal["all"] | None = value(None, "rad", "all: every direction is equally likely")

    @property
    def given_keys(self) -> list[str]:
        """The keys that say how to draw."""
        return [name for name in WAYS if getattr(self, name) is not None]

    def at(self, u: Vector) -> Numbers:
        """The value (n,) for every u (n,) in (0, 1)."""
        (name,) = self.given_keys
        return WAYS[name][1](getattr(self, name), u)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        """Raises ValueError unless exactly one distribution is given, with sound numbers."""
        given = self.given_keys
        if len(given) != 1:
            ways = [n for n in type(self).model_fields if n not in ("keys", "rows")]
            found = f"found {' and '.join(given)}" if given else "found none"
            raise ValueError(f"must have one of {', '.join(ways)}; {found}")
        check, _ = WAYS.get(given[0], (_sound, None))
        check(given[0], getattr(self, given[0]))
        return self
