# ruff: noqa: D102  the methods are named after the nodes that they rewrite
"""Expressions of a kernel rewritten for lanes, see `lane_kernels`."""

from __future__ import annotations

import ast
import copy
from collections.abc import Collection
from functools import cache, partial, reduce
from typing import Any

import numpy as np

from podusv_cli.core import kernel
from podusv_cli.engine.machine.lane_source import has_source, refused, source
from podusv_cli.engine.machine.lane_syntax import call, found, name_of, set_to

EXTREMES = ("min", "max")
SIGNS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
ON = "lanes_on"  # the lanes that a kernel is called in


def takes_mask(called: Any, plain: Collection[Any]) -> bool:
    """Whether this is a kernel that takes the lanes in which it acts as its first argument."""
    return kernel.is_kernel(called) and called not in plain and has_source(called)


def is_truth(node: ast.expr) -> bool:
    """Whether an expression is true or false, and no number, as it is written."""
    if isinstance(node, ast.BoolOp):
        return all(map(is_truth, node.values))
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.Not)
    written_out = isinstance(node, ast.Constant) and isinstance(node.value, bool)
    return written_out or isinstance(node, ast.Compare)


def is_written_out(node: ast.expr) -> bool:
    """Whether an expression has no names, so that Python itself computes it."""
    return not any(isinstance(part, ast.Name) for part in ast.walk(node))


@cache
def stores(called: Any) -> bool:
    """Whether a kernel, or one that it calls, writes into a vector."""
    if not (kernel.is_kernel(called) and has_source(called)):
        return False
    node, scope = source(called), called.__globals__
    return any(
        (isinstance(part, ast.Subscript) and isinstance(part.ctx, ast.Store))
        or (isinstance(part, ast.Call) and stores(found(part.func, scope)))
        for part in ast.walk(node)
    )


class Expressions:
    """One kernel's source while it is rewritten; its statements are `lane_kernels`' work."""

    def __init__(
        self, node: ast.FunctionDef, scope: dict[str, Any], plain: Collection[Any]
    ) -> None:
        """Of a kernel that sees these globals."""
        self.node, self.scope, self.plain = node, scope, plain
        self.known = {argument.arg for argument in node.args.args}  # variables that are set
        self.apart = False  # whether it may act in some of the lanes only
        self.loops: list[ast.For | ast.While] = []  # that are under way
        self.going: list[str] = []  # and the lanes that each of them is under way in
        self.count = 0
        self.before: list[ast.stmt] = []  # what has to run before the statement under way
        self.mask = ON

    def fresh(self, word: str) -> str:
        """A name of its own."""
        self.count += 1
        return f"lanes_{word}_{self.count}"

    def statement(self, node: ast.stmt) -> list[ast.stmt]:
        """What one statement becomes."""
        raise NotImplementedError

    def cheap(self, value: ast.expr) -> bool:
        """Whether an expression may be evaluated where it is not needed."""
        return not any(isinstance(part, (ast.Call, ast.Subscript)) for part in ast.walk(value))

    def expression(self, node: ast.expr) -> ast.expr:
        """What an expression becomes."""
        write: Any = getattr(self, f"of_{type(node).__name__}", None)
        if write is None:
            raise refused(node, f"{ast.unparse(node)}: runs side by side cannot do this")
        made: ast.expr = ast.copy_location(write(node), node)
        return made

    def of_parts(self, node: ast.expr) -> ast.expr:
        """An expression whose parts become what they become."""
        made = copy.copy(node)
        for name, part in ast.iter_fields(node):
            if isinstance(part, ast.expr):
                setattr(made, name, self.expression(part))
            elif isinstance(part, list):
                new = [self.expression(p) if isinstance(p, ast.expr) else p for p in part]
                setattr(made, name, new)
        return made

    of_Attribute = of_Constant = of_Name = of_Tuple = of_parts

    def of_Subscript(self, node: ast.Subscript) -> ast.expr:
        if self.is_fixed(node.slice):
            return self.of_parts(node)
        place = self.expression(node.value), self.expression(node.slice)
        return call("lanes_load", name_of(self.mask), *place)

    def is_fixed(self, index: ast.expr) -> bool:
        """Whether an index is a number that is written out, or a module's."""
        if isinstance(index, ast.Name):
            return index.id not in self.known and isinstance(self.scope.get(index.id), int)
        return isinstance(index, ast.Constant)

    def truth(self, node: ast.expr) -> ast.expr:
        """An expression of which only the truth counts."""
        return self.combined(node) if isinstance(node, ast.BoolOp) else self.expression(node)

    def of_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        if not all(map(is_truth, node.values)):
            raise refused(node, "`and` or `or` of numbers as a value; write it with if and else")
        return self.combined(node)

    def combined(self, node: ast.BoolOp) -> ast.expr:
        """`and` or `or` of truths."""
        first_look_up = next((i for i, v in enumerate(node.values) if i and self.looks_up(v)), 0)
        if first_look_up:
            return self.expression(ast.copy_location(self.short(node, first_look_up), node))
        word = "lanes_and" if isinstance(node.op, ast.And) else "lanes_or"
        first, *rest = map(self.truth, node.values)
        for other in rest:
            first = call(word, first, other)
        return first

    def looks_up(self, node: ast.expr) -> bool:
        """Whether an expression calls a kernel, or reads a place that not every lane may know."""
        return self.calls_kernel(node) or any(
            isinstance(part, ast.Subscript) and not self.is_fixed(part.slice)
            for part in ast.walk(node)
        )

    def called(self, node: ast.AST) -> Any:
        """The global that is called, or None."""
        if not isinstance(node, ast.Call):
            return None
        local = isinstance(node.func, ast.Name) and node.func.id in self.known
        return None if local else found(node.func, self.scope)

    def calls_kernel(self, node: ast.AST) -> bool:
        """Whether an expression calls a kernel that acts in some of the lanes."""
        return any(takes_mask(self.called(part), self.plain) for part in ast.walk(node))

    def check_order(self, node: ast.expr) -> None:
        """Refuse a choice beside a kernel that stores; the choice would be computed first.

        The choice may be an argument of that kernel.
        """
        storing = [set(ast.walk(part)) for part in ast.walk(node) if stores(self.called(part))]
        inner = [part for part in ast.walk(node) if part is not node and self.goes_first(part)]
        if any(part not in within for part in inner for within in storing):
            raise refused(
                node, "a choice beside a kernel that writes into a vector; write two statements"
            )

    def goes_first(self, node: ast.AST) -> bool:
        """Whether a part of an expression is computed before the statement."""
        if isinstance(node, ast.IfExp):
            return not (self.cheap(node.body) and self.cheap(node.orelse))
        return isinstance(node, ast.BoolOp) and any(map(self.looks_up, node.values[1:]))

    def short(self, node: ast.BoolOp, count: int) -> ast.expr:
        """A choice that evaluates all but `count` values in the lanes that need them."""
        first, rest = (
            values[0] if len(values) == 1 else ast.BoolOp(node.op, values)
            for values in (node.values[:count], node.values[count:])
        )
        if isinstance(node.op, ast.And):
            return ast.IfExp(first, rest, ast.Constant(False))
        return ast.IfExp(first, ast.Constant(True), rest)

    def is_ours(self) -> bool:
        """Whether the kernel is podusv's own."""
        return str(self.scope.get("__name__")).startswith("podusv_cli.")

    def of_BinOp(self, node: ast.BinOp) -> ast.expr:
        if isinstance(node.op, ast.Pow) and not is_written_out(node):
            return call("lanes_power", self.expression(node.left), self.expression(node.right))
        return self.of_parts(node)

    def of_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        if isinstance(node.op, ast.Not):
            return call("lanes_not", self.truth(node.operand))
        return self.of_parts(node)

    def of_Compare(self, node: ast.Compare) -> ast.expr:
        if not all(isinstance(sign, SIGNS) for sign in node.ops):
            raise refused(node, "`is` or `in`; write ==")
        if len(node.ops) > 1 and any(map(self.looks_up, node.comparators)):
            raise refused(node, "a chain of comparisons with a call or an index; name it first")
        places = [node.left, *node.comparators]
        made: ast.expr | None = None
        for left, sign, right in zip(places, node.ops, places[1:], strict=False):
            pair = ast.Compare(self.expression(left), [sign], [self.expression(right)])
            made = pair if made is None else call("lanes_and", made, pair)
        assert made is not None
        return made

    def of_IfExp(self, node: ast.IfExp) -> ast.expr:
        if self.cheap(node.body) and self.cheap(node.orelse):
            chosen = self.truth(node.test), *map(self.expression, (node.body, node.orelse))
            return call("lanes_pick", *chosen)
        name = self.fresh("choice")
        body, orelse = (ast.copy_location(set_to(name, v), node) for v in (node.body, node.orelse))
        self.before += self.statement(ast.copy_location(ast.If(node.test, [body], [orelse]), node))
        return name_of(name)

    def of_Call(self, node: ast.Call) -> ast.expr:
        if node.keywords:
            raise refused(node, "arguments by name; give them by position")
        called = self.called(node)
        if called is kernel.shared and not self.is_ours():
            raise refused(
                node,
                "shared is for podusv's own kernels, whose runs are sorted by "
                "that number; write int(k.count) of a constant",
            )
        local = isinstance(node.func, ast.Name) and node.func.id in self.known
        name = node.func.id if isinstance(node.func, ast.Name) and not local else ""
        write = self.truth if name == "bool" else self.expression
        arguments = list(map(write, node.args))
        if name in EXTREMES:
            return reduce(partial(call, name), arguments)
        if name == "bool":
            return call("lanes_not", call("lanes_not", *arguments))
        if takes_mask(called, self.plain):
            arguments.insert(0, name_of(self.mask))
        if isinstance(node.func, ast.Attribute) and called in (np.ceil, np.floor):
            return call(f"lanes_{node.func.attr}", *arguments)
        return ast.Call(node.func, arguments, [])
