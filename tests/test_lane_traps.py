"""Python that is easily rewritten wrongly: it means the same in every lane, or is refused."""

from __future__ import annotations

from typing import Any

import pytest
from test_lane_loops import check, refuses

from podusv_cli.core.kernel import Vector, kernel


@kernel
def noted(x: float, seen: Vector) -> float:
    """Half of it; and a store, which shows where and how often it was called."""
    seen[1] += 1.0
    return 0.5 * x


@kernel
def truths(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Truths as numbers."""
    seen[0] = s[0] > 0.0
    seen[2] = 2.0 * (s[0] > 0.0) + int(s[1] > 0.0)
    seen[3] = (s[0] > 0.0) + s[1]
    count = 0
    for i in range(3):
        count += s[i] > 0.0
    seen[4] = count
    seen[5] = not s[0] > 0.0
    both: float = s[0] > 0.0 and s[1] > 0.0
    seen[6] = both


@kernel
def only_where_needed(
    t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector
) -> None:
    """The second part of `and` and `or` is evaluated where the first does not decide."""
    if s[0] > 0.0 and noted(s[1], seen) > 0.0:
        seen[0] = 5.0
    if s[1] > 0.0 or noted(s[2], seen) > 0.2:
        seen[2] = 4.0
    if s[0] and not (s[1] or s[2] > 0.0):
        seen[3] = 3.0
    seen[4] = noted(s[2], seen) if s[2] > 0.0 else 7.0
    seen[5] = noted(row[int(s[0] > 0.0)] if s[1] > 0.0 else 2.0, seen)
    if s[0] > 0.0 and s[1] > 0.0 and row[int(s[2] > 0.0)] > 0.0 and s[2] < 1.0:
        seen[6] = 6.0  # each of the four decides in some lanes
    if s[0] > 0.5 or s[1] > 0.5 or row[int(s[2] > 0.0)] > 1.0 or s[2] < -1.0:
        seen[7] = 5.0


@kernel
def count_of_its_own(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A count that is used in its loops alone may be that of loops in a branch."""
    if s[0] > 0.0:
        for i in range(3):
            seen[1] += row[i]
    for i in range(2):
        seen[2] += s[i]


@pytest.mark.parametrize("watch", [truths, only_where_needed, count_of_its_own])
def test_it_means_the_same_in_every_lane(watch: Any) -> None:
    """As the kernel has it alone."""
    check(watch)


@kernel
def value_of_or(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """The first number that is not 0."""
    seen[0] = s[0] or 5.0


@kernel
def chain(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """The kernel in the middle would be called twice."""
    if -0.2 < noted(s[0], seen) < 0.3:
        seen[0] = 3.0


@kernel
def order(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """The choice reads what the kernel before it stores."""
    seen[0] = noted(s[0], seen) + (seen[1] if s[1] > 0.0 else 1.0)


@kernel
def place(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """The place would be computed twice."""
    seen[int(noted(2.0, seen)) + 2] += 1.0


@kernel
def left_over(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Lanes that do not take the branch have another count."""
    i = 7
    if s[0] > 0.0:
        for i in range(3):
            seen[1] += s[i]
    seen[0] = i


@pytest.mark.parametrize(
    ("watch", "says"),
    [
        (value_of_or, "`and` or `or` of numbers as a value; write"),
        (chain, "a chain of comparisons with a call or an index"),
        (order, "a choice beside a kernel that writes into a vector; write two"),
        (place, "a place that a kernel computes; name it first"),
        (left_over, "not every run has this loop, whose count is read after it"),
    ],
)
def test_it_is_refused_and_marches_alone(watch: Any, says: str) -> None:
    """With the line, and what it is."""
    refuses(watch, says)
