"""What expressions say about each run: values and conditions, computed for all runs at once.

    dsc.iae < 0.9 * pid.iae and finished(pid)          about the runs of several laws in a draw
    finished and z_e_steady <= 1.5                     about one run: when it is a success

A condition holds, does not hold, or is unknown where a number is. docs/claims.md describes
the language.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from podusv_cli.core.about import MetricAbout
from podusv_cli.core.kernel import Vector
from podusv_cli.expressions.margins import SIGNS, below
from podusv_cli.expressions.reading import function, known_name, refuse, syntax_tree
from podusv_cli.expressions.walk import Condition, Walk
from podusv_cli.studies.counting.runs import Mask, StudyRuns, worst

# A failed run's metric in arithmetic: larger than any number of a run, and the same for all, so
# that both failing gives a ratio of 1 and a difference of 0. What exceeds REAL is infinite.
FAILED, REAL = 1e100, 1e90
FINISHED, SUCCESS = "finished", "success"


@dataclass
class OfRuns(Walk):
    """One walk over an expression about runs; `tolerance` is the margin of its comparisons."""

    metrics: Mapping[str, MetricAbout]
    tolerance: float = 0.0
    both_failed: list[Any] = field(default_factory=list)  # where both sides of a comparison are inf
    close: list[Any] = field(default_factory=list)  # where they differ by the margin or less
    signs: ClassVar = SIGNS

    def link(self, sign: ast.cmpop, left: ast.expr, a: Any, right: ast.expr, b: Any) -> Condition:
        """In which draws `a` and `b` (numbers or arrays (cells, draws)) compare as `sign` says.

        Unknown where one is NaN. `left` and `right` are the nodes of the sides, unused here. Where
        both sides vary, ties are noted in `both_failed` and `close`, which verdicts report.
        """
        if np.ndim(a) and np.ndim(b):
            failed = np.isinf(a) & np.equal(a, b)
            self.both_failed.append(failed)
            wins = below(a, b, self.tolerance) | below(b, a, self.tolerance)
            self.close.append(~wins & ~failed & ~np.isnan(a) & ~np.isnan(b))
        holds, unknown = SIGNS[type(sign)](a, b, self.tolerance), np.isnan(a) | np.isnan(b)
        return Condition(holds & ~unknown, ~holds & ~unknown)

    def side(self, node: ast.expr) -> Any:
        """The value of one side for every run; infinite beyond REAL, where a failure made it so."""
        # Such as 0 / 0 of two metrics: NaN, which is unknown.
        with np.errstate(all="ignore"):
            values = np.asarray(self.value(node))
        return np.where(np.abs(values) > REAL, np.copysign(np.inf, values), values)

    def countable(self, name: str, values: Vector, failed: Mask) -> Vector:
        """A metric that can be calculated with: FAILED, with its sign, in place of infinity.

        `values` and the mask `failed` are (cells, draws), as is the result.
        """
        numbers = worst(self.metrics[name], values, failed)
        return np.where(np.isinf(numbers), np.copysign(FAILED, numbers), numbers)


@dataclass
class OverLaws(OfRuns):
    """Expressions about the runs of all laws in a draw: `law.metric`, `finished(law)`."""

    runs: StudyRuns = field(kw_only=True)
    names: list[str] = field(default_factory=list)  # of the laws that were met in the expression

    def quantity(self, node: ast.expr) -> Vector:
        """The values (cells, draws) of `law.metric`. Raises ExpressionError for anything else."""
        match node:
            case ast.Attribute(value=ast.Name(id=label), attr=name):
                law, name = self.law(label), known_name(name, self.metrics, "metric")
                return self.countable(name, self.runs.metric(law, name), ~self.runs.success(law))
            case ast.Call():
                refuse(node, "no function of numbers here; write law.metric, as in a.iae < b.iae")
        refuse(node, "no meaning here; write law.metric, as in a.iae")

    def property(self, node: ast.expr) -> Condition:
        """In which draws `finished(law)` or `success(law)` holds. Raises ExpressionError."""
        properties: dict[str, Callable[[str], Mask]] = {
            FINISHED: self.runs.finished,
            SUCCESS: self.runs.success,
        }
        if not isinstance(node, ast.Call):
            refuse(node, "not a condition; compare numbers, or write finished(law) or success(law)")
        held = properties[known_name(function(node), properties, "property")]
        return Condition.known_everywhere(held(self.only(node)))

    def only(self, node: ast.Call) -> str:
        """The law that is the only argument of a function. Raises ExpressionError."""
        if len(node.args) != 1 or not isinstance(node.args[0], ast.Name):
            refuse(node, f"{function(node)} takes the name of one law")
        return self.law(node.args[0].id)

    def law(self, label: str) -> str:
        """The law of this name, also added to `names`.

        Raises ExpressionError where there is none.
        """
        self.names.append(known_name(label, self.runs.laws, "law"))
        return label


@dataclass
class OfOneRun(OfRuns):
    """Expressions about a single run: `finished`, and metrics by their names alone."""

    values: Mapping[str, Vector] = field(kw_only=True)
    ended: Mask = field(kw_only=True)

    def quantity(self, node: ast.expr) -> Vector:
        """The values of a metric that is named alone, NaN where a run did not finish."""
        if not isinstance(node, ast.Name):
            refuse(node, "write metrics by their names alone, as in finished and z_e_steady <= 1.5")
        name = known_name(node.id, self.metrics, "metric")
        values = self.values.get(name, np.full(np.shape(self.ended), np.nan))
        return np.where(self.ended, self.countable(name, values, ~self.ended), np.nan)

    def property(self, node: ast.expr) -> Condition:
        """Whether runs finished: `finished` is the only property that stands alone.

        Raises ExpressionError for anything else.
        """
        if not isinstance(node, ast.Name):
            refuse(node, "not a condition; compare metrics with numbers, or write finished alone")
        known_name(node.id, (FINISHED,), "property")
        return Condition.known_everywhere(self.ended)


def parse_success(text: str, metrics: Mapping[str, MetricAbout]) -> ast.expr:
    """The syntax tree of a condition for success. Raises ExpressionError."""
    tree = syntax_tree(text, "finished and z_e_steady <= 1.5")
    judge_success(tree, {}, np.ones(1, bool), metrics)
    return tree


def judge_success(
    tree: ast.expr, values: Mapping[str, Vector], finished: Mask, metrics: Mapping[str, MetricAbout]
) -> Mask:
    """Which runs (cells, draws) of a law are a success; a run is none where that is unknown.

    `tree` is what `parse_success` returns. `values` has each metric of the tree and `finished` says
    which runs reached their end, all (cells, draws).
    """
    held = OfOneRun(metrics, values=values, ended=finished).condition(tree).yes
    return np.broadcast_to(held, np.shape(finished))


def shortfalls(tree: ast.expr, runs: OfOneRun, kept: bool = True) -> Iterator[Vector]:
    """By how much every run misses each comparison of a condition, in their order; (cells, draws).

    0 where it holds, infinite where what has to happen never did, NaN where a number is unknown.
    `kept` is False within a `not`, where the comparison must fail instead.
    """
    match tree:
        case ast.BoolOp(values=parts):
            for part in parts:
                yield from shortfalls(part, runs, kept)
        case ast.UnaryOp(operand=part):
            yield from shortfalls(part, runs, not kept)
        case ast.Compare(left=left, ops=signs, comparators=others):
            sides = [np.broadcast_to(runs.side(s), runs.ended.shape) for s in (left, *others)]
            for sign, (a, b) in zip(signs, pairwise(sides), strict=True):
                # Within a `not` the sides change places.
                smaller, larger = (a, b) if isinstance(sign, (ast.Lt, ast.LtE)) is kept else (b, a)
                with np.errstate(invalid="ignore"):  # of two that never happened
                    yield np.where(smaller <= larger, 0.0, smaller - larger)
