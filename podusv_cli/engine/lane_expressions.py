# ruff: noqa: D102  the methods are named after the nodes that they rewrite
"""Expressions of a kernel rewritten for lanes, see `lane_kernels`."""

from __future__ import annotations

import ast
import copy
from collections.abc import Collection
from typing import Any

import numpy as np

from podusv_cli.core import kernel
from podusv_cli.engine.lane_source import NotForLanes, has_source
from podusv_cli.engine.lane_syntax import call, found, name_of, set_to

ON = "lanes_on"  # the lanes that a kernel is called in


def takes_mask(called: Any, plain: Collection[Any]) -> bool:
    """Whether this is a kernel that takes the lanes in which it acts as its first argument."""
    return kernel.is_kernel(called) and called not in plain and has_source(called)


class Expressions:
    """One kernel's source while it is rewritten; its statements are `lane_kernels`' work."""

    def __init__(
        self, node: ast.FunctionDef, scope: dict[str, Any], plain: Collection[Any]
    ) -> None:
        """Of a kernel that sees these globals."""
        self.node, self.scope, self.plain = node, scope, plain
        self.known = {argument.arg for argument in node.args.args}  # variables that are set
        self.branch: ast.If | None = None  # the outermost one that is under way
        self.loops = 0  # that are under way
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
        write = getattr(self, f"of_{type(node).__name__}", self.of_parts)
        return ast.copy_location(write(node), node)

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

    def of_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        word = "lanes_and" if isinstance(node.op, ast.And) else "lanes_or"
        first, *others = map(self.expression, node.values)
        for other in others:
            first = call(word, first, other)
        return first

    def of_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        if isinstance(node.op, ast.Not):
            return call("lanes_not", self.expression(node.operand))
        return self.of_parts(node)

    def of_Compare(self, node: ast.Compare) -> ast.expr:
        places = [node.left, *node.comparators]
        made: ast.expr | None = None
        for left, sign, right in zip(places, node.ops, places[1:], strict=False):
            pair = ast.Compare(self.expression(left), [sign], [self.expression(right)])
            made = pair if made is None else call("lanes_and", made, pair)
        assert made is not None
        return made

    def of_IfExp(self, node: ast.IfExp) -> ast.expr:
        if self.cheap(node.body) and self.cheap(node.orelse):
            return call("lanes_pick", *map(self.expression, (node.test, node.body, node.orelse)))
        name = self.fresh("choice")
        body, orelse = (ast.copy_location(set_to(name, v), node) for v in (node.body, node.orelse))
        self.before += self.statement(ast.copy_location(ast.If(node.test, [body], [orelse]), node))
        return name_of(name)

    def of_Call(self, node: ast.Call) -> ast.expr:
        if node.keywords:
            raise NotForLanes(f"line {node.lineno}: arguments by name are not for lanes")
        arguments = list(map(self.expression, node.args))
        local = isinstance(node.func, ast.Name) and node.func.id in self.known
        called = None if local else found(node.func, self.scope)
        if takes_mask(called, self.plain):
            arguments.insert(0, name_of(self.mask))
        if isinstance(node.func, ast.Attribute) and called in (np.ceil, np.floor):
            return call(f"lanes_{node.func.attr}", *arguments)
        return ast.Call(node.func, arguments, [])
