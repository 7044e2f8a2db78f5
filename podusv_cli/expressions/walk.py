"""One walk over an expression; what names and functions mean is up to each language.

A condition holds, does not hold, or is unknown where a number is: for one run, for each of many, or
for each cell of a study.
"""

from __future__ import annotations

import ast
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from podusv_cli.expressions.reading import literal, refuse

ARITHMETIC: dict[type[ast.operator], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    # By 0 it gives infinity or NaN, where Python's own division raises
    ast.Div: np.divide,
}


class Condition(NamedTuple):
    """Where a condition holds, and where it does not; unknown elsewhere. Truths or arrays."""

    yes: Any
    no: Any

    @classmethod
    def known_everywhere(cls, held: Any) -> Self:
        """A condition that is unknown nowhere."""
        return cls(held, np.logical_not(held))

    @classmethod
    def of(cls, answers: Iterable[bool | None]) -> Self:
        """A condition with these answers; None is unknown."""
        each = list(answers)
        return cls(np.array([a is True for a in each]), np.array([a is False for a in each]))

    def answers(self) -> list[bool | None]:
        """The answers; None where it is unknown."""
        pairs = zip(np.atleast_1d(self.yes), np.atleast_1d(self.no), strict=True)
        return [True if yes else False if no else None for yes, no in pairs]


def all_of(conditions: Collection[Condition]) -> Condition:
    """All of the conditions: no where any is not, yes where all are, else unknown."""
    return Condition(
        reduce(np.logical_and, (condition.yes for condition in conditions)),
        reduce(np.logical_or, (condition.no for condition in conditions)),
    )


class Logic(ABC):
    """Conditions joined by `and` and `not`. Every part is evaluated, so all mistakes are found."""

    @abstractmethod
    def comparison(self, node: ast.Compare) -> Condition:
        """Where all links of a < b <= c hold."""

    @abstractmethod
    def property(self, node: ast.expr) -> Condition:
        """A condition that is no comparison. Raises ExpressionError where the node is none."""

    def condition(self, node: ast.expr) -> Condition:
        """Where a condition holds and where it does not. Raises ExpressionError."""
        match node:
            case ast.Compare():
                return self.comparison(node)
            case ast.UnaryOp(op=ast.Not(), operand=part):
                # `not` exchanges yes and no; what is unknown stays so.
                return Condition(*reversed(self.condition(part)))
            case ast.BoolOp(op=ast.And(), values=parts):
                return all_of([self.condition(part) for part in parts])
            case ast.BoolOp():
                refuse(node, "join conditions with `and` only")
        return self.property(node)


class Walk(Logic):
    """Conditions about quantities that are calculated."""

    signs: ClassVar[Mapping[type[ast.cmpop], Any]]  # of comparisons that the language has

    @abstractmethod
    def quantity(self, node: ast.expr) -> Any:
        """What a name or function stands for. Raises ExpressionError where it has no meaning."""

    @abstractmethod
    def side(self, node: ast.expr) -> Any:
        """One side of a comparison."""

    @abstractmethod
    def link(self, sign: ast.cmpop, left: ast.expr, a: Any, right: ast.expr, b: Any) -> Condition:
        """Whether one side (value `a`) compares with the next (`b`) as `sign` says.

        `left` and `right` are the nodes of the sides, for messages.
        """

    def calculate(self, operation: Callable[..., Any], parts: Sequence[Any]) -> Any:
        """The result of an operation."""
        return operation(*parts)

    def comparison(self, node: ast.Compare) -> Condition:
        """Where all links of a < b <= c hold.

        Raises ExpressionError for a sign that the language lacks.
        """
        if any(type(sign) not in self.signs for sign in node.ops):
            refuse(node, f"compare with {', '.join(SIGNS[sign] for sign in self.signs)}")
        sides = [(side, self.side(side)) for side in (node.left, *node.comparators)]
        links = zip(node.ops, pairwise(sides), strict=True)
        return all_of([self.link(sign, *left, *right) for sign, (left, right) in links])

    def value(self, node: ast.expr) -> Any:
        """What an expression without comparisons comes to: a number, or what `quantity` gives.

        Raises ExpressionError.
        """
        match node:
            case ast.Constant():
                return np.float64(literal(node))
            case ast.UnaryOp(op=ast.USub(), operand=part):
                return self.calculate(operator.neg, [self.value(part)])
            case ast.BinOp(left=left, right=right, op=sign) if type(sign) in ARITHMETIC:
                parts = [self.value(left), self.value(right)]
                return self.calculate(ARITHMETIC[type(sign)], parts)
            case ast.BinOp():
                refuse(node, "calculate with + - * / only")
        return self.quantity(node)


SIGNS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
}
