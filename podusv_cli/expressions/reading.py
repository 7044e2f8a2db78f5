"""Reading expressions: a syntax tree within limits, and a message for every mistake in one.

They are parsed by Python, and evaluated by whoever gives them a meaning; never run as Python.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Collection
from typing import NoReturn

from podusv_cli.core.phrases import unknown_word

LONGEST = 500  # characters of an expression
LARGEST = 1e300  # of numbers written down
DEEPEST = 60  # nested brackets, signs and operations
# Numbers that Python reads and scenarios do not write.
FOREIGN = re.compile(r"(?<![\w.])(?:0[xobXOB]\w+|[0-9.]*[0-9](?:\.?[eE][+-]?[0-9]+)?_[0-9_.]*)")


# The functions of each language, by the section of a scenario that it is for.
FUNCTIONS = {
    "claims": (
        "max",
        "min",
        "mean",
        "final",
        "variation",
        "integral",
        "rms_above",
        "decay",
        "abs",
        "hypot",
        "rate",
    ),
    "sweep.claims": ("share", "failures", "quantile", "median"),
}


class ExpressionError(ValueError):
    """An expression that has no meaning; the text says what to write instead."""


def syntax_tree(text: str, example: str) -> ast.expr:
    """The syntax tree of an expression, within limits; `example` is shown in messages.

    Raises ExpressionError.
    """
    if len(text) > LONGEST:
        raise ExpressionError(f"is longer than {LONGEST} characters")
    try:
        with warnings.catch_warnings(action="ignore"):  # Python's, about `1and a.iae < 2`
            tree = ast.parse(text.strip(), mode="eval").body
    # Text that is nested too deep ends Python's parser in one of the last two
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError(f"cannot read {text!r}; example: {example}") from error
    if foreign := FOREIGN.search(text):
        raise ExpressionError(f"{foreign[0]!r} is no number; write it in decimal, without _")
    # Counted level by level, since recursion could exceed Python's own limit.
    level: list[ast.AST] = [tree]
    for _ in range(DEEPEST):
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    if level:
        raise ExpressionError(f"is nested more than {DEEPEST} deep")
    for node in ast.walk(tree):
        match node:
            case ast.BinOp(op=ast.Div(), right=divisor) if _is_zero(divisor):
                refuse(node, "divides by zero, which is no number; leave the division out")
    return tree


def _is_zero(node: ast.expr) -> bool:
    """Whether a node is the number 0, with any sign."""
    match node:
        case ast.UnaryOp(operand=part):
            return _is_zero(part)
        case ast.Constant(value=int() | float() as number):
            return number == 0
    return False


def refuse(node: ast.AST, why: str) -> NoReturn:
    """Refuse a part of an expression, with its text. Raises ExpressionError."""
    raise ExpressionError(f"{ast.unparse(node)!r}: {why}")


def known_name(name: str, names: Collection[str], what: str) -> str:
    """The name, if it is one of `names`; `what` is the word for it in messages.

    Raises ExpressionError, with the language that has the name, or the nearest that is known.
    """
    if name in names:
        return name
    if homes := [home for home, functions in FUNCTIONS.items() if name in functions]:
        allowed = ", ".join(sorted(names))
        raise ExpressionError(
            f"unknown {what} {name!r}; it belongs to {homes[0]} (allowed here: {allowed})"
        )
    raise ExpressionError(unknown_word(f"{what} {name!r}", name, sorted(names), "podusv list"))


def function(node: ast.Call) -> str:
    """The name of the function that is called. Raises ExpressionError."""
    if not isinstance(node.func, ast.Name) or node.keywords:
        refuse(node, "functions are called by name, without keywords")
    return node.func.id


def number(node: ast.expr) -> float:
    """A number as written, with its sign. Raises ExpressionError."""
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=part):
            return -literal(part)
    return literal(node)


def literal(node: ast.expr) -> float:
    """A number as it is written in an expression.

    Raises ExpressionError for another node, and for numbers beyond LARGEST.
    """
    number = getattr(node, "value", None)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        refuse(node, "not a plain number")
    if abs(number) > LARGEST:
        raise ExpressionError(f"a number is too large, the largest is {LARGEST:g}")
    return float(number)
