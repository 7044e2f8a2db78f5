"""Returns from branches within branches: right side by side, and no larger than they are many."""

from __future__ import annotations

import ast
from typing import Any

import pytest
from test_lane_loops import SIZE, check

from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.machine.lane_syntax import OUT_OF_LOOP, Kinds, tailed


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


def test_runs_leave_where_they_leave_alone() -> None:
    """Whatever the others do."""
    check(returns)


@pytest.mark.parametrize(("word", "kinds"), [("return", (ast.Return,)), ("break", OUT_OF_LOOP)])
def test_statements_that_leave_do_not_double_what_follows(word: str, kinds: Kinds) -> None:
    """Every one of them adds the same number of statements."""

    def size(count: int) -> int:
        one = f"if a:\n    if b:\n        {word}\n    c = 1\nd = 2\n"
        made = tailed(ast.parse(one * count).body, kinds, "left")
        return sum(isinstance(part, ast.stmt) for node in made for part in ast.walk(node))

    assert size(12) - size(8) == size(8) - size(4)
