"""Loops and places that differ from lane to lane: every lane has what it has alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from test_lanes import aligned

from podusv_cli.core.interpolation import segment
from podusv_cli.core.kernel import LANES, Vector, kernel, tail
from podusv_cli.engine.machine import compile
from podusv_cli.engine.machine.lane_doors import LANE_VECTOR
from podusv_cli.engine.machine.signatures import pointer

SIZE = 6  # numbers of a table that increases


@kernel
def first_above(limit: float, count: int, table: Vector) -> int:
    """It returns from within a loop, and from within one in a loop."""
    for i in range(count):
        if table[i] > limit:
            return i
        for j in range(i):
            if table[j] + table[i] > 3.0 * limit:
                return -j
    return count


@kernel
def halvings(x: float, out: Vector) -> None:
    """A loop that ends when it is done, with branches that leave it or begin its next round."""
    rounds, total = 0, 0.0
    while x > 1.0 or x < -1.0:
        x *= 0.5
        if x < -4.0:
            continue
        rounds += 1
        if x > 6.0:
            total = -1.0
            break
        total += x
    out[0], out[1], out[2] = rounds, total, x


@kernel
def newton(a: float, out: Vector) -> None:
    """A root by steps that end when they change nothing, or after some."""
    x, before = a, 0.0
    for _ in range(30):
        if x == before:
            break
        before = x
        x = 0.5 * (x + a / x)
    out[0] = x


@kernel
def loops(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """An observer with all of them."""
    seen[0] = first_above(s[0], SIZE, row)
    halvings(10.0 * s[1], tail(seen, 1))
    if s[2] > 0.0:
        newton(s[2], tail(seen, 4))


@kernel
def places(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """An observer that reads and writes at places of its own in every lane."""
    i = segment(s[0], SIZE, row)
    later = tail(row, i)
    seen[0] = later[0] if i > 2 else later[1] + row[min(i + 1, SIZE - 1)]
    at = int(abs(s[1])) % 3
    part = tail(tail(seen, 1), at)
    part[0] += s[1]
    if s[2] > 0.0 and row[(i + at) // 2] > 0.0:
        seen[at + 3] = s[2] // 0.3 + s[2] % 0.3 + s[1] % 0.3
    seen[6] = s[2] - 2.0 * math.floor(s[2] / 2.0) + math.ceil(s[1])
    seen[5] = s[0] ** 3 + abs(s[1]) ** 0.5 + abs(s[1]) ** s[2]
    seen[7] = max(s[0], s[1], s[2]) if bool(i % 2) else float(i)
    seen[8] = (
        1.0
        if math.isinf(s[0]) or not math.isfinite(s[1])
        else math.erf(math.radians(s[1])) + math.log1p(abs(s[1]))
    )


def check(watch: Any) -> None:
    """Every lane has the numbers that it has alone, NaN and the signs of zeros included."""
    alone = compile.entry("observer", watch, ("nothing",))
    side_by_side = compile.lane_entry("observer", watch, ("nothing",), frozenset())
    draws, nothing = np.random.default_rng(8), np.zeros((1, LANES))
    for turn in range(10):
        s, seen = draws.normal(0.0, 1.5, (3, LANES)), draws.normal(0.0, 1.0, (9, LANES))
        if turn == 9:
            s[0, :4], s[1, 4:] = [math.nan, 0.0, -0.0, 1e300], [math.nan, -0.0, 0.0, 3.0]
        row = np.sort(draws.normal(0.5, 1.0, (SIZE, LANES)), axis=0)
        wanted = seen.copy()
        for lane in range(LANES):
            own = [np.ascontiguousarray(part[:, lane]) for part in (s, row, nothing, wanted)]
            alone(2.0, 1.0, *map(pointer, own))
            wanted[:, lane] = own[-1]
        rooms = [aligned(part) for part in (s, row, nothing, seen)]
        side_by_side(2.0, 1.0, *(room.ctypes.data_as(LANE_VECTOR) for room in rooms))
        np.testing.assert_array_equal(rooms[3], wanted.ravel())
        np.testing.assert_array_equal(np.signbit(rooms[3]), np.signbit(wanted.ravel()))


def refuses(watch: Any, says: str) -> None:
    """A kernel is not compiled for runs side by side, for a reason with these words."""
    with pytest.raises(TypeError, match=says):
        compile.lane_entry("observer", watch, ("nothing",), frozenset())


@pytest.mark.parametrize("watch", [loops, places])
def test_loops_and_places_differ_from_lane_to_lane(watch: Any) -> None:
    """As the kernel has it alone, number by number."""
    check(watch)


@kernel
def carried(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A variable that a branch in a loop sets, and that a later round reads."""
    for i in range(3):
        if row[i] > s[0]:
            last = row[i]
        if i == 2:
            seen[0] = last


def test_a_variable_that_would_lose_its_number_is_refused() -> None:
    """It says what to write instead."""
    refuses(carried, r"last is set in a branch within a loop.*before the loop")
