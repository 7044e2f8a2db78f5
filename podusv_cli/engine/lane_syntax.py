"""Pieces of Python's syntax, for kernels that are rewritten."""

from __future__ import annotations

import ast
import copy
from collections.abc import Mapping
from typing import Any

from podusv_cli.engine.lane_source import NotForLanes


def call(name: str, *arguments: ast.expr) -> ast.Call:
    """`name(arguments)`."""
    return ast.Call(name_of(name), list(arguments), [])


def name_of(name: str) -> ast.Name:
    """A variable that is read."""
    return ast.Name(name, ast.Load())


def set_to(name: str, value: ast.expr) -> ast.Assign:
    """`name = value`."""
    return ast.Assign([ast.Name(name, ast.Store())], value)


def returns(nodes: list[ast.stmt]) -> bool:
    """Whether one of these statements may return."""
    return any(isinstance(part, ast.Return) for node in nodes for part in ast.walk(node))


def ends(nodes: list[ast.stmt]) -> bool:
    """Whether these statements always return."""
    if not nodes:
        return False
    last = nodes[-1]
    return isinstance(last, ast.Return) or (
        isinstance(last, ast.If) and ends(last.body) and ends(last.orelse)
    )


def tailed(nodes: list[ast.stmt]) -> list[ast.stmt]:
    """The same statements with every `return` at the end of a branch."""
    for i, node in enumerate(nodes):
        if isinstance(node, ast.Return):
            return nodes[: i + 1]
        if isinstance(node, ast.If) and returns([node]):
            rest = nodes[i + 1 :]
            branches = [
                tailed(b if ends(b) else [*b, *copy.deepcopy(rest)])
                for b in (node.body, node.orelse)
            ]
            return [*nodes[:i], ast.If(node.test, *branches)]
        if isinstance(node, (ast.For, ast.While)) and returns([node]):
            raise NotForLanes("it returns from within a loop")
    return nodes


def reads(node: ast.AST, name: str) -> int:
    """How often a variable is read there."""
    return sum(
        isinstance(part, ast.Name) and part.id == name and isinstance(part.ctx, ast.Load)
        for part in ast.walk(node)
    )


def found(function: ast.expr, scope: Mapping[str, Any]) -> Any:
    """What is called, where it is a global or an attribute of one; else None."""
    if isinstance(function, ast.Name):
        return scope.get(function.id)
    if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
        return getattr(scope.get(function.value.id), function.attr, None)
    return None
