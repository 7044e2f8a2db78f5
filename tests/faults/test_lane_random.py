"""Random kernels side by side: each has the bits that it has alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from counts import count
from lane_samples import aligned, bits
from random_kernels import watching

from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import LANES, Vector
from podusv_cli.engine.machine import compile
from podusv_cli.engine.machine.signatures import LANE_VECTOR, pointer

NAMES, ALIKE = ("gain", "mode"), frozenset({"mode"})
WILD = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1e300, -1e300, 1.0, 2.0, -1.0)


def numbers(turn: int) -> list[Vector]:
    """State, row, constants and output of every lane; the last turns have runs that repeat one."""
    draws = np.random.default_rng(turn)
    made = [draws.normal(0.0, 1.5, (size, LANES)) for size in (3, 9, 2, 24)]
    if turn % 2:
        made = [np.where(draws.random(m.shape) < 0.3, draws.choice(WILD, m.shape), m) for m in made]
    made[2][1] = turn % 4  # `mode`, which is the same in all lanes
    if turn >= 6:
        for part in made:
            part[:, 3:] = part[:, :1]
    return made


def agrees(alone: Any, side_by_side: Any, turn: int) -> bool:
    """Whether a kernel writes the same bits in every lane as alone."""
    inputs = numbers(turn)
    wanted = inputs[3].copy()
    for lane in range(LANES):
        own = [np.ascontiguousarray(part[:, lane]) for part in inputs]
        alone(2.0, 1.0, *map(pointer, own))
        wanted[:, lane] = own[3]
    rooms = [aligned(part) for part in inputs]
    side_by_side(2.0, 1.0, *(room.ctypes.data_as(LANE_VECTOR) for room in rooms))
    return bool((bits(rooms[3]) == bits(wanted.ravel())).all())


def outcome(seed: int) -> str:
    """What becomes of the random kernel of this seed side by side."""
    watch = watching(seed)
    try:
        alone = compile.entry("probe", watch, NAMES)
    except LawError:
        return "no kernel"
    side_by_side = compile.routine(compile.lane_adapter("probe", watch, NAMES, ALIKE))
    return "equal" if all(agrees(alone, side_by_side, turn) for turn in range(8)) else "differs"


@pytest.mark.parametrize(
    "seeds",
    [
        range(20),
        *(
            pytest.param(range(first, first + 20), marks=pytest.mark.slow)
            for first in range(20, count(200, 1000), 20)
        ),
    ],
)
def test_random_kernels_have_the_bits_that_they_have_alone(seeds: range) -> None:
    """All of them; a kernel that cannot be compiled at all is none."""
    outcomes = {seed: outcome(seed) for seed in seeds}
    assert [seed for seed, told in outcomes.items() if told == "differs"] == []
    assert [*outcomes.values()].count("no kernel") <= len(seeds) // 10
