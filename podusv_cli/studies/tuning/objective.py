"""Objectives and inequalities of a search: statistics of a law's runs over all draws.

median(iae) + 0.1 * quantile(tv_tau_u, 0.95)      what is to be small
failures <= 0.05                                  what has to hold

A failed run counts as the worst, and so does a number that nobody knows: as infinite where more is
worse, and as minus infinite where less is.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.expressions.margins import SIGNS
from podusv_cli.expressions.reading import (
    function,
    known_name,
    literal,
    number,
    refuse,
    syntax_tree,
)
from podusv_cli.expressions.walk import ARITHMETIC, Condition
from podusv_cli.metrics.metric import Metric
from podusv_cli.studies.counting import statistics
from podusv_cli.studies.counting.expressions import OfRuns
from podusv_cli.studies.counting.runs import Mask
from podusv_cli.studies.counting.samples import FAILURES, MEDIAN, QUANTILE, Wording, part_of

EXAMPLE, INEQUALITY = "median(iae)", "failures <= 0.05"
STATISTICS = (MEDIAN, QUANTILE)
RUNS = Wording("run", "iae", "iae")
INVENTED = 1000  # runs on which an expression is tried
UPWARD = (ast.Gt, ast.GtE)
SCALING = (ast.Mult, ast.Div)  # a negative part turns round what the other means
FALLING = (ast.Sub, ast.Div)  # the more of the second part, the less of the whole


class Outcomes(NamedTuple):
    """The runs of one law with the same gains: metrics by name, and which runs failed."""

    metrics: Mapping[str, Vector]
    failed: Mask


class Inequality(NamedTuple):
    """A statistic that has to stay on one side of a number."""

    text: str
    tree: ast.expr
    upward: bool
    bound: float


@dataclass
class OfGains(OfRuns):
    """A number of each run, from metrics by their names alone; failed runs are the worst."""

    runs: Outcomes = field(kw_only=True)
    names: list[str] = field(default_factory=list)  # of the metrics that were met

    def quantity(self, node: ast.expr) -> Vector:
        """The values (draws,) of a metric that is written by its name alone.

        Raises ExpressionError.
        """
        if not isinstance(node, ast.Name):
            refuse(node, "write metrics by their names alone, as in median(iae)")
        name = known_name(node.id, self.metrics, "metric")
        self.names.append(name)
        values = self.runs.metrics.get(name, np.full(self.runs.failed.shape, np.nan))
        return self.countable(name, values, self.runs.failed)

    def property(self, node: ast.expr) -> Condition:
        """There are none."""
        refuse(node, "no condition here; write a number, as in median(iae)")


def parse_objective(text: str, metrics: Mapping[str, Metric]) -> ast.expr:
    """The tree of an objective, which must depend on a run's numbers. Raises ExpressionError."""
    tree = syntax_tree(text, EXAMPLE)
    if not _names(tree, metrics):
        refuse(tree, f"is a number, whatever the gains are; example: {EXAMPLE}")
    return tree


def parse_inequality(text: str, metrics: Mapping[str, Metric]) -> Inequality:
    """An inequality (`text`) that compares one statistic of the draws with a number.

    Raises ExpressionError for anything else.
    """
    tree = syntax_tree(text, INEQUALITY)
    match tree:
        case ast.Compare(left=left, ops=[sign], comparators=[right]) if type(sign) in SIGNS:
            bound = number(right)
            if not _names(left, metrics):
                refuse(left, f"is no statistic of the draws; example: {INEQUALITY}")
            return Inequality(text, left, isinstance(sign, UPWARD), bound)
    refuse(tree, f"compare one statistic with one number by <, <=, > or >=, as in {INEQUALITY}")


def metrics_in(tree: ast.expr, metrics: Mapping[str, Metric]) -> list[str]:
    """The metrics that an expression is about, each once."""
    return [name for name in dict.fromkeys(_names(tree, metrics)) if name != FAILURES]


def _names(tree: ast.expr, metrics: Mapping[str, Metric]) -> list[str]:
    """The names that an expression is about, found by evaluating it on invented runs.

    These are many and all differ, so that a spread of theirs is not zero. Raises ExpressionError,
    also where the expression is never finite.
    """
    numbers = np.random.default_rng(0).uniform(1.0, 2.0, (len(metrics), INVENTED))
    walk = OfGains(
        metrics, runs=Outcomes(dict(zip(metrics, numbers, strict=True)), np.zeros(INVENTED, bool))
    )
    with np.errstate(all="ignore"):
        reached = _evaluate(tree, walk, math.inf)
    if not math.isfinite(reached) and FAILURES not in walk.names:  # here, no run failed
        refuse(tree, f"is no finite number, whatever the runs are; example: {EXAMPLE}")
    return walk.names


def evaluate(
    tree: ast.expr, runs: Outcomes, metrics: Mapping[str, Metric], worst: float = math.inf
) -> float:
    """The value of an objective over `runs`; infinite where it is the worst or not known.

    `worst` stands for a failed run's number: minus infinity where less is worse.
    """
    with np.errstate(all="ignore"):
        reached = float(_evaluate(tree, OfGains(metrics, runs=runs), worst))
    return reached if math.isfinite(reached) else math.inf


def excess(inequality: Inequality, runs: Outcomes, metrics: Mapping[str, Metric]) -> float:
    """By how much an inequality does not hold, relative to its bound; 0 or less where it holds.

    Relative to 1 where the bound is 0; infinite where the statistic is.
    """
    reached = evaluate(inequality.tree, runs, metrics, -math.inf if inequality.upward else math.inf)
    # The worst is +inf here whichever side is good, so it counts as an excess in both cases.
    over = (
        inequality.bound - reached
        if inequality.upward and math.isfinite(reached)
        else reached - inequality.bound
    )
    return over / (abs(inequality.bound) or 1.0)


def _evaluate(node: ast.expr, walk: OfGains, worst: float) -> Any:
    """The value of an expression; `worst` is what stands for a failed run, inf or -inf.

    The sign of `worst` follows the operators, so that a failure never improves the whole: in a - b,
    the worst of b is its smallest value. `walk` notes the metrics that are named. Raises
    ExpressionError for what is no statistic.
    """
    match node:
        case ast.Constant():
            return np.float64(literal(node))
        case ast.UnaryOp(op=ast.USub(), operand=part):
            return -_evaluate(part, walk, -worst)
        case ast.BinOp(left=left, right=right, op=sign) if type(sign) in ARITHMETIC:
            first = -worst if isinstance(sign, SCALING) and _is_negative(right) else worst
            second = -worst if isinstance(sign, SCALING) and _is_negative(left) else worst
            second = -second if isinstance(sign, FALLING) else second
            parts = _evaluate(left, walk, first), _evaluate(right, walk, second)
            # Over an infinite number the whole would be 0, which may be better than all others
            failed = isinstance(sign, ast.Div) and math.isinf(parts[1])
            return worst if failed else ARITHMETIC[type(sign)](*parts)
        case ast.BinOp():
            refuse(node, "calculate with + - * / only")
        case ast.Name(id=name) if name == FAILURES:
            walk.names.append(FAILURES)
            return np.float64(np.mean(walk.runs.failed))
        case ast.Call():
            return _quantile(node, walk, worst)
    refuse(node, f"no statistic of all draws; write median(...), quantile(..., 0.95) or {FAILURES}")


def _is_negative(node: ast.expr) -> bool:
    """Whether a factor has a minus; statistics count as positive."""
    return isinstance(node, ast.UnaryOp)


def _quantile(call: ast.Call, walk: OfGains, worst: float) -> Any:
    """The value of `quantile(...)` or `median(...)` over the draws."""
    share = share_of(call)
    # Only the estimate is used, so any level will do.
    return statistics.quantile(numbers_of(call, walk, worst), share, 0.5).estimate


def numbers_of(call: ast.Call, walk: OfGains, worst: float = math.inf) -> Vector:
    """What a statistic is of: a number of each run (draws,).

    `worst` stands where a run failed or its number is not known.
    """
    values = np.broadcast_to(walk.side(call.args[0]), walk.runs.failed.shape)
    return np.where(walk.runs.failed | np.isnan(values), worst, values)


def share_of(call: ast.Call) -> float:
    """Which quantile a statistic is, from 0 to 1 (a median is 0.5). Raises ExpressionError."""
    known_name(function(call), STATISTICS, "statistic")
    return part_of(call, RUNS)[1]
