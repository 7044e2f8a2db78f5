"""Pieces of Python's syntax, for kernels that are rewritten."""

from __future__ import annotations

import ast
import copy
from collections.abc import Mapping
from typing import Any


def call(name: str, *arguments: ast.expr) -> ast.Call:
    """`name(arguments)`."""
    return ast.Call(name_of(name), list(arguments), [])


def name_of(name: str) -> ast.Name:
    """A variable that is read."""
    return ast.Name(name, ast.Load())


def set_to(name: str, value: ast.expr) -> ast.Assign:
    """`name = value`."""
    return ast.Assign([ast.Name(name, ast.Store())], value)


LOOPS = (ast.For, ast.While)
OUT_OF_LOOP = (ast.Break, ast.Continue)
Kinds = tuple[type[ast.stmt], ...]


def leaves(nodes: list[ast.stmt], kinds: Kinds) -> bool:
    """Whether one of these statements may be one of these kinds; `break` is its own loop's."""
    return any(_leaves(node, kinds) for node in nodes)


def _leaves(node: ast.stmt, kinds: Kinds) -> bool:
    if isinstance(node, LOOPS) and kinds == OUT_OF_LOOP:
        return False
    inside = (*getattr(node, "body", []), *getattr(node, "orelse", []))
    return isinstance(node, kinds) or leaves(list(inside), kinds)


def ends(nodes: list[ast.stmt], kinds: Kinds) -> bool:
    """Whether these statements always end in one of these kinds."""
    if not nodes:
        return False
    last = nodes[-1]
    return isinstance(last, kinds) or (
        isinstance(last, ast.If) and ends(last.body, kinds) and ends(last.orelse, kinds)
    )


def tailed(nodes: list[ast.stmt], kinds: Kinds = (ast.Return,)) -> list[ast.stmt]:
    """The same statements with every `return`, or what else leaves, at the end of a branch."""
    for i, node in enumerate(nodes):
        if isinstance(node, kinds):
            return nodes[: i + 1]
        if not _leaves(node, kinds):
            continue
        assert isinstance(node, ast.If)  # loops are not returned from any more, see `lane_loops`
        rest = nodes[i + 1 :]
        branches = [
            tailed(b if ends(b, kinds) else [*b, *copy.deepcopy(rest)], kinds)
            for b in (node.body, node.orelse)
        ]
        made = ast.copy_location(ast.If(node.test, *branches), node)
        return [*nodes[:i], made]
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
