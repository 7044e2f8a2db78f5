"""The expressions of claims: parsed once, checked and evaluated by one walk, never run as Python.

    max(abs(adaptive_neural.tau_u)) == 300
    adaptive_neural.iae < full_backstepping.iae < pid.iae
    mean(adaptive_neural.z_e, 200, 310) / mean(pid.z_e, 200, 310) < 0.5
    finished(adaptive_neural) and not finished(pid)

docs/claims.md describes the language.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from podusv_cli.comparison import curves
from podusv_cli.comparison.curves import REDUCERS, SETTINGS, CannotTell, ClaimedRun, Curve, Quantity
from podusv_cli.core.about import MetricAbout
from podusv_cli.core.derived_signals import derived_with
from podusv_cli.core.kernel import Vector
from podusv_cli.core.past_run import CHECKS
from podusv_cli.core.signal import Signal
from podusv_cli.expressions.margins import SIGNS, around, below
from podusv_cli.expressions.reading import (
    ExpressionError,
    function,
    known_name,
    literal,
    refuse,
    syntax_tree,
)
from podusv_cli.expressions.walk import Condition, Walk
from podusv_cli.metrics.table import METRICS

EXAMPLE = "a.iae < b.iae"
STRICT = (ast.Lt, ast.Gt)  # too close to tell where the difference is within the tolerance
# norms of the weights, which have one value for every node of a network
NORMS = {
    derived.needs[0]: name for name, derived in derived_with(()).items() if len(derived.needs) == 1
}


def parse(
    text: str,
    runs: Collection[str],
    signals: Mapping[str, Signal],
    metrics: Mapping[str, MetricAbout] = METRICS,
) -> ast.expr:
    """The syntax tree of an expression about these runs; `signals` are those that a run may log.

    It is checked by evaluating it for example runs that have all signals and `metrics`. Raises
    ExpressionError.
    """
    tree = syntax_tree(text, EXAMPLE)
    example = _ExampleRun(signals, metrics)
    Evaluation(dict.fromkeys(runs, example), metrics=metrics).holds(tree)
    return tree


@dataclass(frozen=True)
class _ExampleRun:
    """A run that has every metric and signal; to check an expression before there are runs."""

    signals: Mapping[str, Signal]
    metrics: Mapping[str, MetricAbout]
    # No window that a claim names lies beyond its end.
    until = math.inf
    every = 1
    ending = ""

    def metric(self, name: str) -> float:
        return 1.0

    def check(self, name: str) -> bool:
        return True

    def has(self, name: str) -> bool:
        return True

    def signal(self, name: str) -> Vector:
        """Two samples (2,). Raises ExpressionError unless the signal is one number over time."""
        about = self.signals.get(name)
        if about and about.fixed:
            raise ExpressionError(f"{name!r} does not run over time")
        if about and about.axes:
            norm = NORMS.get(name)
            hint = f"; take {norm}" if norm else ", and a claim needs a signal with one value"
            raise ExpressionError(
                f"{name!r} has a value for every {' and '.join(about.axes)}{hint}"
            )
        usable = [s.name for s in self.signals.values() if not (s.fixed or s.axes)]
        known_name(name, [*usable, *self.metrics], "signal or metric")
        # Two that grow: they serve as times, too, and a rate can be taken of them.
        return np.array([0.0, 1.0])


@dataclass
class Evaluation(Walk):
    """One evaluation of an expression, with the evidence that it collects.

    `numbers` are those that were compared, by their text, NaN where missing; `doubts` say why.
    """

    runs: Mapping[str, ClaimedRun]
    tolerance: float = 0.0
    metrics: Mapping[str, MetricAbout] = field(default_factory=lambda: METRICS)
    numbers: dict[str, float] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)
    signs: ClassVar = {**SIGNS, ast.Eq: lambda a, b, margin: abs(a - b) <= around(b, margin)}

    def holds(self, node: ast.expr) -> bool | None:
        """Whether a condition holds; None where that is unknown. Raises ExpressionError."""
        (answer,) = self.condition(node).answers()
        return answer

    def link(
        self, sign: ast.cmpop, left: ast.expr, a: float, right: ast.expr, b: float
    ) -> Condition:
        """Whether one number compares so with the next; unknown where they are too close.

        `left` and `right` are the nodes of the numbers, for a sentence on why it is unknown.
        """
        # Neither event ever happens, so neither of the two times is before the other.
        never = a == b == math.inf
        if math.isnan(a) or math.isnan(b):
            return Condition.of([None])
        if never or (isinstance(sign, STRICT) and self._close(a, b)):
            within = f"differ by no more than the tolerance of {self.tolerance:g}"
            why = "never happen" if never else within
            self.doubts.append(f"{ast.unparse(left)} and {ast.unparse(right)} {why}")
            return Condition.of([None])
        return Condition.known_everywhere(self.signs[type(sign)](a, b, self.tolerance))

    def _close(self, a: float, b: float) -> bool:
        """Whether the tolerance covers the difference of a and b, and allows for any at all."""
        apart = below(a, b, self.tolerance) or below(b, a, self.tolerance)
        return not apart and around(max(abs(a), abs(b)), self.tolerance) > 0.0

    def side(self, node: ast.expr) -> float:
        """The number of one side, kept as evidence; NaN where it is unknown.

        Raises ExpressionError for a signal over time.
        """
        doubts, text = len(self.doubts), ast.unparse(node)
        number: Quantity = self.value(node)
        if isinstance(number, Curve):
            refuse(
                node, f"a signal over time; reduce it to a number with one of {', '.join(REDUCERS)}"
            )
        # Infinity is a number only where an event never happens.
        if not (math.isfinite(number) or self._never(node)):
            if len(self.doubts) == doubts:
                self.doubts.append(f"{text} is not a finite number")
            number = math.nan
        if not isinstance(node, ast.Constant):
            self.numbers[text] = number
        return number

    def _never(self, node: ast.expr) -> bool:
        """Whether the value is the infinite time (or a multiple) of an event that never happens.

        Or an infinite margin, which has no limit.
        """
        match node:
            case ast.BinOp(left=ast.Constant(), right=part, op=ast.Mult()):
                return self._never(part)
            case ast.Attribute(attr=name):
                return (
                    name in self.metrics
                    and (self.metrics[name].happens or self.metrics[name].margin)
                    and self.value(node) == math.inf
                )
        return False

    def property(self, node: ast.expr) -> Condition:
        """The answer of a check of a run, such as `finished(pid)`.

        Also kept as evidence (1 or 0).
        """
        if not isinstance(node, ast.Call):
            refuse(node, f"not a condition; compare numbers, or use one of {', '.join(CHECKS)}")
        name = known_name(function(node), CHECKS, "check")
        if len(node.args) != 1 or not isinstance(node.args[0], ast.Name):
            refuse(node, "a check takes the name of one run")
        label = node.args[0].id
        run, text = self._run(label), ast.unparse(node)
        answer = run.check(name)
        self.numbers[text] = math.nan if answer is None else float(answer)
        if answer is None:
            self.doubts.append(f"{text}: {label} {run.ending}")
        return Condition.of([answer])

    def calculate(self, operation: Callable[..., Any], parts: Sequence[Quantity]) -> Quantity:
        """At the times that all curves cover."""
        return curves.pointwise(operation, parts)

    def quantity(self, node: ast.expr) -> Quantity:
        """What `run.name` stands for: a metric, NaN where unknown, or a signal over time.

        Raises CannotTell for a signal that is not there, ExpressionError for what has no meaning.
        """
        match node:
            case ast.Attribute(value=ast.Name(id=label), attr=name):
                run = self._run(label)
                if name in self.metrics:
                    about = self.metrics[name]
                    return self._or_doubt(lambda: curves.metric(label, run, about))
                return curves.signal(label, run, name)
            case ast.Call():
                return self._call(node)
        refuse(node, "no meaning here; write run.metric or run.signal")

    def _call(self, node: ast.Call) -> Quantity:
        """The value of a function of signals or numbers. Raises ExpressionError."""
        name = known_name(function(node), [*REDUCERS, *OPERATIONS, "rate"], "function")
        if name in REDUCERS:
            return self._or_doubt(lambda: self._reduce(name, node))
        # `rate` is not among them: it takes a curve with its times, never numbers.
        count, operation = OPERATIONS.get(name, (1, None))
        if len(node.args) != count:
            refuse(node, f"{name} takes {count} argument(s)")
        if operation:
            return self.calculate(operation, [self.value(part) for part in node.args])
        return curves.rate(self._curve(node.args[0]))

    def _curve(self, node: ast.expr) -> Curve:
        """The signal that a node stands for. Raises ExpressionError for a number."""
        curve = self.value(node)
        if not isinstance(curve, Curve):
            refuse(node, "a number where a signal is needed")
        return curve

    def _reduce(self, name: str, node: ast.Call) -> float:
        """A number from a signal, over all times or between two [s]; NaN and a doubt where unknown.

        Raises ExpressionError.
        """
        wanted = " and ".join(["a signal", *filter(None, [SETTINGS.get(name)])])
        count = 1 + (name in SETTINGS)
        if len(node.args) not in (count, count + 2):
            refuse(node, f"{name} takes {wanted}, or {wanted} and two times")
        if not all(isinstance(end, ast.Constant) for end in node.args[1:]):
            refuse(node, "the numbers after the signal must be plain numbers, the two times in s")
        curve, numbers = self._curve(node.args[0]), [literal(end) for end in node.args[1:]]
        settings, window = numbers[: count - 1], numbers[count - 1 :]
        if window and not 0 <= window[0] < window[1]:
            refuse(node, "the first time must lie before the second")
        return curves.reduce_curve(name, ast.unparse(node), curve, settings, window)

    def _or_doubt(self, number: Callable[[], float]) -> float:
        """The number, or NaN where it cannot be known, with the reason among the doubts."""
        try:
            return number()
        except CannotTell as doubt:
            self.doubts.append(str(doubt))
            return math.nan

    def _run(self, label: str) -> ClaimedRun:
        return self.runs[known_name(label, self.runs, "run")]


def with_labels(tree: ast.expr, labels: Mapping[str, str]) -> ast.expr:
    """A copy of the expression with labels in place of its own names for runs, by these names."""
    tree = deepcopy(tree)
    for node in ast.walk(tree):
        # of `run.metric` and `check(run)`; a function may have the name of a run
        for name in (*getattr(node, "args", ()), getattr(node, "value", None)):
            if isinstance(name, ast.Name):
                name.id = labels[name.id]
    return tree


OPERATIONS = {"abs": (1, np.abs), "hypot": (2, np.hypot)}  # with their number of arguments
