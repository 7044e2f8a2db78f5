"""Names, numbers and truths side by side: they mean what they mean alone, or are refused."""

from __future__ import annotations

import math
from typing import Any

import pytest
from test_lane_loops import check, refuses

from podusv_cli.core.kernel import Vector, kernel, shared


@kernel
def counted(x: float, seen: Vector) -> float:
    """A store that decides where the next store goes."""
    seen[0] += 1.0
    return x


@kernel
def powers(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Of numbers that Python computes itself."""
    seen[1] = s[2] ** 3**-1
    seen[2] = math.pow(s[2], 5.0) + s[0] ** 3


@kernel
def truths(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Truths that are compared, added, and the smaller one of two."""
    seen[0] = min(s[0] > 0.0, s[1] > 0.0)
    seen[1] = (s[0] > 0.0) + (s[1] > 0.0)
    if (s[0] > 0.0) == (s[2] > 0.0):
        seen[2] = 5.0
    seen[3] = +abs(int(s[0])) + math.sqrt(abs(int(s[1])))


@kernel
def counted_loop(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """It ends in all runs at once."""
    n = 0
    while n < 6:
        n += 1
        seen[1] += row[n - 1]
        if n == 3:
            break
    seen[0] = n


@kernel
def unused(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Code that is never reached, and a loop that does nothing."""
    if 0.0:
        counted(s[0], seen)
    for _ in range(3):
        pass
    seen[1] = s[1]


@kernel
def place_of_sum(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Python computes the place once, before the value."""
    seen[0] = 1.0
    seen[int(seen[0])] += counted(s[0], seen)


@pytest.mark.parametrize("watch", [powers, truths, counted_loop, unused, place_of_sum])
def test_it_means_the_same_in_every_lane(watch: Any) -> None:
    """As the kernel has it alone."""
    check(watch)


@kernel
def max(a: float, b: float) -> float:
    """A kernel that is called like a builtin."""
    return a + b


@kernel
def own_word(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """It calls the module's own `max`."""
    seen[0] = max(s[0], s[1])


lanes_known = 2.0


@kernel
def own_lanes(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A name that rewritten kernels have for themselves."""
    seen[0] = s[0] * lanes_known


@kernel
def walrus(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """An assignment within an expression."""
    y = 1.0
    if s[0] > 0.0:
        seen[0] = (y := s[1]) * 2.0
    seen[1] = y


@kernel
def count_in_a_place(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A loop whose count is a place of a vector."""
    if s[0] > 0.0:
        for seen[0] in (1.0, 2.0):
            seen[1] += seen[0]


@kernel
def place_first(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Python computes the value first, which changes the place."""
    seen[0] = 1.0
    seen[int(seen[0])] = counted(s[0], seen)


@kernel
def other_kind(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A number that is whole in the second branch alone; a whole number by 0 is 0."""
    n, zero = 3, 0
    if s[0] > 0.0:
        n = 1.5
        seen[0] = n
    else:
        seen[0] = n // zero


@kernel
def no_rounds(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """An inner loop without a round leaves what an earlier round of the outer one has set."""
    for i in range(6):
        if row[i] > s[0] or i == 0:
            for _ in range((i + 1) % 2):
                last = row[i]
            seen[i] = last


@kernel
def by_position(x: float, /, y: float) -> float:
    """Its first argument is given by position only."""
    return x - y


@kernel
def positions(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """It calls that."""
    seen[0] = by_position(s[0], s[1])


@kernel
def identity(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """The same thing, not the same number."""
    if (s[0] > 0.0) is True:
        seen[0] = 1.0


@kernel
def first_run(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """The first run's number would be everybody's."""
    seen[0] = shared(s[0])


@pytest.mark.parametrize(
    ("watch", "says"),
    [
        (own_word, "max stands for something else in kernels side by side"),
        (own_lanes, "lanes_known stands for something else"),
        (walrus, r"y := s\[1\]\): runs side by side cannot do this"),
        (count_in_a_place, "a loop whose count is no variable"),
        (place_first, "a place that is computed beside a kernel that stores"),
        (other_kind, "a whole number where one branch reads it, and a float in the other"),
        (no_rounds, r"last is set in a branch within a loop.*before the loop"),
        (positions, "by_position takes other than plain arguments"),
        (identity, "`is` or `in`; write =="),
        (first_run, "shared is for podusv's own kernels"),
    ],
)
def test_it_is_refused_and_marches_alone(watch: Any, says: str) -> None:
    """With the line, and what to write instead."""
    refuses(watch, says)
