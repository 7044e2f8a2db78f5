"""Pieces of Python's syntax, for kernels that are rewritten."""

from __future__ import annotations

import ast
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


def tailed(nodes: list[ast.stmt], kinds: Kinds, flag: str) -> list[ast.stmt]:
    """The same statements with every `return`, or what else leaves, at the end of a branch.

    What follows branches that both may go on runs where the variable `flag` says that none left.
    """
    made = _tailed(nodes, kinds, flag)
    if any(reads(node, flag) for node in made):
        made.insert(0, ast.copy_location(set_to(flag, ast.Constant(False)), made[0]))
    return made


def _tailed(nodes: list[ast.stmt], kinds: Kinds, flag: str) -> list[ast.stmt]:
    for i, node in enumerate(nodes):
        if isinstance(node, kinds):
            return nodes[: i + 1]
        if not _leaves(node, kinds):
            continue
        assert isinstance(node, ast.If)  # loops are not returned from any more, see `lane_loops`
        branches, rest = [node.body, node.orelse], nodes[i + 1 :]
        behind: list[ast.stmt] = []
        going_on = [branch for branch in branches if not ends(branch, kinds)]
        if len(going_on) == 2 and rest:
            branches = [_noted(branch, kinds, flag) for branch in branches]
            stayed = ast.UnaryOp(ast.Not(), name_of(flag))
            behind = [ast.copy_location(ast.If(stayed, _tailed(rest, kinds, flag), []), rest[0])]
        elif going_on:
            branches = [[*b, *rest] if b is going_on[0] else b for b in branches]
        inner = [_tailed(branch, kinds, flag) for branch in branches]
        return [*nodes[:i], ast.copy_location(ast.If(node.test, *inner), node), *behind]
    return nodes


def _noted(nodes: list[ast.stmt], kinds: Kinds, flag: str) -> list[ast.stmt]:
    """The same statements, which set the flag before they leave."""
    made: list[ast.stmt] = []
    for node in nodes:
        if isinstance(node, kinds):
            made.append(ast.copy_location(set_to(flag, ast.Constant(True)), node))
        if isinstance(node, ast.If):
            inner = [_noted(branch, kinds, flag) for branch in (node.body, node.orelse)]
            node = ast.copy_location(ast.If(node.test, *inner), node)
        made.append(node)
    return made


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
