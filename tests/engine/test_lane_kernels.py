"""Kernels side by side: every lane has what it has alone, number by number."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lane_samples import aligned

from podusv_cli.core.interpolation import segment
from podusv_cli.core.kernel import LANES, Vector, kernel, shared, tail
from podusv_cli.engine.machine import compile
from podusv_cli.engine.machine.signatures import LANE_VECTOR, pointer

SIZE = 6  # numbers of a table that increases
TABLE = np.array([0.5, -1.0, 2.0, 8.0])


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
    """A probe with all of them, and a loop whose count is another one in every lane."""
    seen[0] = first_above(s[0], SIZE, row)
    halvings(10.0 * s[1], tail(seen, 1))
    if s[2] > 0.0:
        newton(s[2], tail(seen, 4))
    for i in range(int(s[0] * s[0]) % 5):
        seen[5] += row[i]


@kernel
def places(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A probe that reads and writes at places of its own in every lane."""
    i = segment(s[0], SIZE, row)
    later = tail(row, i)
    seen[0] = later[0] if i > 2 else later[1] + row[min(i + 1, SIZE - 1)]
    at = int(abs(s[1])) % 3
    part = tail(tail(seen, 1), at)
    part[0] += s[1] + TABLE[at]
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


@kernel
def early(x: float, y: float, seen: Vector) -> float:
    """Both branches may go on, and what follows them leaves, too."""
    if x > 0.0:
        if y > 0.0:
            return 1.0
        seen[1] += 1.0
    else:
        if y > 1.0:
            return 2.0
        seen[2] += 1.0
    if x > y:
        if x > 1.0:
            return x
        seen[3] += 1.0
    seen[4] += 1.0
    return y


@kernel
def returns(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Early returns, and rounds of a loop that end early."""
    seen[0] = early(s[0], s[1], seen)
    for i in range(SIZE):
        if row[i] > s[0]:
            if row[i] > s[1]:
                continue
            if row[i] > s[2]:
                if row[i] > 1.0:
                    break
                seen[5] += row[i]
            seen[6] -= 1.0
        seen[7] += row[i]


@kernel
def noted(x: float, seen: Vector) -> float:
    """Half of it; and a store, which shows where and how often it was called."""
    seen[1] += 1.0
    return 0.5 * x


@kernel
def only_where_needed(
    t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector
) -> None:
    """The second part of `and` and `or` is evaluated where the first does not decide."""
    if s[0] > 0.0 and noted(s[1], seen) > 0.0:
        seen[0] = 5.0
    if s[1] > 0.0 or noted(s[2], seen) > 0.2:
        seen[2] = 4.0
    seen[3] = s[0] or 5.0
    seen[4] = noted(s[2], seen) if s[2] > 0.0 else 7.0
    seen[5] = noted(row[int(s[0] > 0.0)] if s[1] > 0.0 else 2.0, seen)
    if -0.2 < noted(s[0], seen) < 0.3 and s[1] > 0.0 and row[int(s[2] > 0.0)] > 0.0:
        seen[6] = noted(s[0], seen) + (seen[1] if s[1] > 0.0 else 1.0)
    seen[int(noted(2.0, seen)) + 6] += 1.0


@kernel
def whole(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Truths and whole numbers; a lane that divides by zero is not in the branch."""
    seen[0] = min(s[0] > 0.0, s[1] > 0.0) + 2.0 * (s[0] > 0.0)
    seen[1] = +abs(int(s[0])) + math.sqrt(abs(int(s[1])))
    by = int(2.0 * s[2])
    if by != 0:
        seen[2] = 7 // by + 9 % by
    i, zero = 7, 0
    if s[0] > 0.0:
        for i in range(3):
            seen[3] += s[i]
    else:
        seen[5] = i // zero
    seen[6] = i + s[2] ** i


@kernel
def first_run(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """The first run's number would be everybody's."""
    seen[0] = shared(s[0])


KERNELS = (loops, places, returns, only_where_needed, whole)


@pytest.mark.parametrize("watch", KERNELS)
def test_every_lane_has_the_numbers_that_it_has_alone(watch: Any) -> None:
    """NaN and the signs of zeros included."""
    alone = compile.entry("probe", watch, ("nothing",))
    side_by_side = compile.routine(compile.lane_adapter("probe", watch, ("nothing",), frozenset()))
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


def test_a_number_of_one_run_is_not_taken_for_all_of_them() -> None:
    """The kernel marches alone, with the reason, also where that is on the disk already."""
    for _ in range(2):
        compile.routine.cache_clear()
        with pytest.raises(TypeError, match=r"test_lane_kernels.py, line \d+: shared is for"):
            compile.routine(compile.lane_adapter("probe", first_run, ("nothing",), frozenset()))
