"""From a claim's text to an expression; every misunderstanding is a sentence."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Collection, Mapping
from functools import singledispatchmethod

import numpy as np

from podusv_cli.comparison.checks import CHECKS
from podusv_cli.comparison.conditions import Checked, Compared, Condition, Denied, Joined
from podusv_cli.comparison.expressions import (
    MAPPERS,
    REDUCERS,
    Applied,
    MetricOf,
    Number,
    Rate,
    Reduced,
    SignalOf,
    Term,
)  # fmt: skip
from podusv_cli.core.signal import Signal
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.words import unknown
from podusv_cli.theory.derived import DERIVED

LONGEST = 500  # characters of an expression
LARGEST = 1e300  # of numbers written down
DEEPEST = 60  # brackets, signs and operations in one another
# signals with a value for every node, and those that sum them up
NORMS = {derived.needs[0]: name for name, derived in DERIVED.items() if len(derived.needs) == 1}
SIGNS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==",
}  # fmt: skip
ARITHMETIC: dict[type[ast.operator], Callable[..., object]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: np.divide,
}  # fmt: skip


class ExpressionError(ValueError):
    """An expression that means nothing; the text says what would."""


def parse(
    text: str, runs: Collection[str], signals: Mapping[str, Signal],
    called: Mapping[str, str] | None = None,
) -> Condition:  # fmt: skip
    """The condition that `text` puts about these runs.

    `signals` are those that a run may have, by name. `called` has the runs' labels by the names
    that the text has for them, where these differ.
    Raises ExpressionError.
    """
    return _Reader(runs, signals).condition(_tree(text, called or {}))


def renamed(text: str, called: Mapping[str, str]) -> str:
    """The same expression with the runs' labels; `called` as for `parse`."""
    return (
        text if all(name == label for name, label in called.items()) else _text(_tree(text, called))
    )


def _tree(text: str, called: Mapping[str, str]) -> ast.expr:
    if len(text) > LONGEST:
        raise ExpressionError(f"is longer than {LONGEST} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError(f"cannot read {text!r}; example: a.iae < b.iae") from error
    if _deeper_than(DEEPEST, tree):
        raise ExpressionError(f"is nested more than {DEEPEST} deep")
    for node in ast.walk(tree):
        for name in _runs_in(node):
            name.id = called.get(name.id, name.id)
    return tree


def _deeper_than(limit: int, tree: ast.AST) -> bool:
    level = [tree]
    for _ in range(limit):
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    return bool(level)


def _runs_in(node: ast.AST) -> list[ast.Name]:
    """Names right below this node that stand for runs."""
    beside = [node.value] if isinstance(node, ast.Attribute) else []
    beside += node.args if isinstance(node, ast.Call) else []
    return [part for part in beside if isinstance(part, ast.Name)]


def _known(name: str, names: Collection[str], what: str) -> str:
    if name in names:
        return name
    raise ExpressionError(unknown(f"{what} {name!r}", name, sorted(names)))


class _Reader:
    """Turns Python's syntax tree into conditions and terms; refuses what has no meaning here."""

    def __init__(self, runs: Collection[str], signals: Mapping[str, Signal]) -> None:
        self.runs, self.signals = runs, signals

    @singledispatchmethod
    def condition(self, node: ast.AST) -> Condition:
        """A condition; comparisons, checks, `not`, `and`."""
        raise ExpressionError(f"{_text(node)!r} is no condition: it must compare, or be a check")

    @condition.register
    def _(self, node: ast.Compare) -> Condition:
        sides = [node.left, *node.comparators]
        for sign in node.ops:
            if type(sign) not in SIGNS:
                raise ExpressionError(f"{_text(node)!r}: compare with {', '.join(SIGNS.values())}")
        terms = tuple(self.number(side) for side in sides)
        signs = tuple(SIGNS[type(sign)] for sign in node.ops)
        return Compared(terms, signs, tuple(_text(side) for side in sides))

    @condition.register
    def _(self, node: ast.BoolOp) -> Condition:
        if not isinstance(node.op, ast.And):
            raise ExpressionError(f"{_text(node)!r}: conditions are joined with `and` only")
        return Joined(tuple(self.condition(part) for part in node.values))

    @condition.register
    def _(self, node: ast.UnaryOp) -> Condition:
        if not isinstance(node.op, ast.Not):
            raise ExpressionError(
                f"{_text(node)!r} is no condition: it must compare, or be a check"
            )
        return Denied(self.condition(node.operand))

    @condition.register
    def _(self, node: ast.Call) -> Condition:
        name = _known(_function(node), CHECKS, "check")
        if len(node.args) != 1 or not isinstance(node.args[0], ast.Name):
            raise ExpressionError(f"{_text(node)!r}: a check takes the name of one run")
        return Checked(name, _known(node.args[0].id, self.runs, "run"))

    def number(self, node: ast.AST) -> Term:
        """A term that is a number."""
        term = self.term(node)
        if term.curve:
            names = ", ".join(sorted(REDUCERS))
            raise ExpressionError(f"{_text(node)!r} runs over time: sum it up with one of {names}")
        return term

    @singledispatchmethod
    def term(self, node: ast.AST) -> Term:
        """A number or a curve."""
        raise ExpressionError(
            f"{_text(node)!r} has no meaning here; write run.metric or run.signal"
        )

    @term.register
    def _(self, node: ast.Constant) -> Term:
        if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
            raise ExpressionError(f"{_text(node)!r} is no number")
        if abs(node.value) > LARGEST:
            raise ExpressionError(f"a number is too large, the largest is {LARGEST:g}")
        return Number(float(node.value))

    @term.register
    def _(self, node: ast.Attribute) -> Term:
        if not isinstance(node.value, ast.Name):
            raise ExpressionError(f"{_text(node)!r}: write run.metric or run.signal")
        run = _known(node.value.id, self.runs, "run")
        if node.attr in METRICS:
            return MetricOf(run, node.attr)
        return SignalOf(run, self._over_time(node.attr))

    @term.register
    def _(self, node: ast.UnaryOp) -> Term:
        if not isinstance(node.op, ast.USub):
            raise ExpressionError(f"{_text(node)!r} has no meaning here")
        return Applied(operator.neg, (self.term(node.operand),))

    @term.register
    def _(self, node: ast.BinOp) -> Term:
        if type(node.op) not in ARITHMETIC:
            raise ExpressionError(f"{_text(node)!r}: calculate with + - * / only")
        return Applied(ARITHMETIC[type(node.op)], (self.term(node.left), self.term(node.right)))

    @term.register
    def _(self, node: ast.Call) -> Term:
        name = _known(_function(node), [*REDUCERS, *MAPPERS, "rate"], "function")
        if name in REDUCERS:
            return self._reduced(name, node)
        count, operation = MAPPERS.get(name, (1, None))
        if len(node.args) != count:
            raise ExpressionError(f"{_text(node)!r}: {name} takes {count} argument(s)")
        parts = tuple(self.term(argument) for argument in node.args)
        if operation:
            return Applied(operation, parts)
        return Rate(self._curve(node.args[0]))

    def _over_time(self, name: str) -> str:
        """The name of a signal with one value at each time."""
        if name in NORMS:
            raise ExpressionError(f"{name!r} has a value for every node; take {NORMS[name]}")
        if name in self.signals and self.signals[name].fixed:
            raise ExpressionError(f"{name!r} does not run over time")
        return _known(name, [*self.signals, *METRICS], "signal or metric")

    def _curve(self, node: ast.AST) -> Term:
        term = self.term(node)
        if not term.curve:
            raise ExpressionError(f"{_text(node)!r} is a number, a signal is wanted")
        return term

    def _reduced(self, name: str, node: ast.Call) -> Term:
        if len(node.args) not in (1, 3):
            raise ExpressionError(
                f"{_text(node)!r}: {name} takes a signal, or a signal and two times"
            )
        part = self._curve(node.args[0])
        ends = [self.term(argument) for argument in node.args[1:]]
        if not all(isinstance(end, Number) for end in ends):
            raise ExpressionError(f"{_text(node)!r}: times are plain numbers in s")
        times = [end.number for end in ends if isinstance(end, Number)]
        if times and not 0 <= times[0] < times[1]:
            raise ExpressionError(f"{_text(node)!r}: the first time must lie before the second")
        window = (times[0], times[1]) if times else None
        return Reduced(REDUCERS[name], part, window, _text(node))


def _function(node: ast.Call) -> str:
    if not isinstance(node.func, ast.Name) or node.keywords:
        raise ExpressionError(f"{_text(node)!r}: functions are called by name, without keywords")
    return node.func.id


def _text(node: ast.AST) -> str:
    return ast.unparse(node)
