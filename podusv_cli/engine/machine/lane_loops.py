# ruff: noqa: D102  the methods are named after the nodes that they rewrite
"""Loops of a kernel rewritten for lanes, see `lane_kernels`.

A loop that may end at another time in every lane runs until the last lane has ended it, and acts in
the lanes that have not.
"""

from __future__ import annotations

import ast
from typing import Any

from podusv_cli.engine.machine.lane_expressions import Expressions
from podusv_cli.engine.machine.lane_source import refused
from podusv_cli.engine.machine.lane_syntax import (
    LOOPS,
    OUT_OF_LOOP,
    call,
    leaves,
    name_of,
    reads,
    set_to,
    tailed,
)

READ, SET = "read", "set"
BACK, VALUE = "lanes_back", "lanes_value"  # whether a lane returned from a loop, and what


def note_outer_reads(function: ast.FunctionDef) -> None:
    """Note for each loop the variables that are read outside it; copies of the loop keep it."""
    names = {n.id for n in ast.walk(function) if isinstance(n, ast.Name)}
    for loop in ast.walk(function):
        if isinstance(loop, LOOPS):
            own = {n: reads(loop, n) - _of_counts(loop, n) for n in names}
            loop.outside = {  # type: ignore[union-attr]
                n for n in names if reads(function, n) - _of_counts(function, n) > max(own[n], 0)
            }


def _of_counts(node: ast.AST, name: str) -> int:
    """How often a variable is read in loops of which it is the count."""
    if isinstance(node, ast.For) and _sets(node.target, name):
        return sum(reads(part, name) for part in node.body)
    return sum(_of_counts(part, name) for part in ast.iter_child_nodes(node))


def ends_apart(loop: ast.For | ast.While) -> bool:
    """Whether a loop may end at another time in every lane."""
    return isinstance(loop, ast.While) or leaves(loop.body, (ast.Break,))


def first_use(nodes: list[ast.stmt], name: str) -> str:
    """What these statements do first with a variable; empty where they may do nothing."""
    return next((use for use in (_use(node, name) for node in nodes) if use), "")


def _use(node: ast.stmt, name: str) -> str:
    if isinstance(node, ast.If):
        return _use_of_branches(node, name)
    if isinstance(node, LOOPS):
        head = node.iter if isinstance(node, ast.For) else node.test
        use = READ if reads(head, name) else first_use(node.body, name)
        return "" if use == SET else use  # it may have no round
    if reads(node, name) or (isinstance(node, ast.AugAssign) and _sets(node.target, name)):
        return READ
    targets = node.targets if isinstance(node, ast.Assign) else []
    return SET if any(_sets(target, name) for target in targets) else ""


def _use_of_branches(node: ast.If, name: str) -> str:
    uses = {first_use(node.body, name), first_use(node.orelse, name)}
    if reads(node.test, name) or READ in uses:
        return READ
    return SET if uses == {SET} else ""


def _sets(target: ast.expr, name: str) -> bool:
    parts = target.elts if isinstance(target, ast.Tuple) else [target]
    return any(isinstance(part, ast.Name) and part.id == name for part in parts)


class Returns(ast.NodeTransformer):
    """A `return` from within a loop becomes a `break`, and a `return` behind the loop."""

    def __init__(self) -> None:
        """Outside all loops."""
        self.depth, self.found = 0, False

    def function(self, node: ast.FunctionDef) -> None:
        """Change a whole kernel."""
        self.generic_visit(node)
        if self.found:
            at = int(ast.get_docstring(node) is not None)
            node.body[at:at] = [set_to(BACK, ast.Constant(False)), set_to(VALUE, ast.Constant(0))]

    def visit_Return(self, node: ast.Return) -> Any:
        """Note the value, and leave the loop."""
        if not self.depth:
            return node
        self.found = True
        noted = [set_to(VALUE, node.value)] if node.value else []
        return [*noted, set_to(BACK, ast.Constant(True)), ast.Break()]

    def visit_For(self, node: ast.For | ast.While) -> Any:
        """Leave the next loop, too, or return."""
        returns = [part for part in ast.walk(node) if isinstance(part, ast.Return)]
        self.depth += 1
        self.generic_visit(node)
        self.depth -= 1
        if not returns:
            return node
        value = name_of(VALUE) if returns[0].value else None
        out: ast.stmt = ast.Break() if self.depth else ast.Return(value)
        return [node, ast.If(name_of(BACK), [out], [])]

    visit_While = visit_For


class Loops(Expressions):
    """A kernel's loops while they are rewritten."""

    def block(self, nodes: list[ast.stmt]) -> list[ast.stmt]:
        """Statements, one after another."""
        raise NotImplementedError

    def check(self, name: str) -> None:
        """Refuse a variable that a branch within a loop sets first, and that outlives it.

        Lanes that do not take the branch would lose what they have of the round before.
        """
        for loop in reversed(self.loops):
            use = first_use(loop.body, name)
            outlives = name in loop.outside and (use != SET or ends_apart(loop))  # type: ignore[union-attr]
            if use == READ or outlives:
                raise refused(
                    loop,
                    f"{name} is set in a branch within a loop, or in a loop "
                    "that ends early; set it before the loop, too",
                )

    def on_For(self, node: ast.For) -> list[ast.stmt]:
        if node.orelse:
            raise refused(node, "a loop with else; test a variable after the loop")
        parts = node.target.elts if isinstance(node.target, ast.Tuple) else [node.target]
        if not all(isinstance(part, ast.Name) for part in parts):
            raise refused(node, "a loop whose count is no variable; name it")
        over = self.expression(node.iter)
        counts = {n.id for n in ast.walk(node.target) if isinstance(n, ast.Name)}
        if (self.apart or ends_apart(node)) and counts & node.outside:  # type: ignore[attr-defined]
            raise refused(
                node,
                "not every run has this loop, whose count is read after it; keep it in a variable",
            )
        self.known |= counts
        if not ends_apart(node):
            return [ast.For(node.target, over, self.rounds(node), [])]
        start, going, outer = self.begun()
        inside = [*self.rounds(node), self.left(going)]
        self.mask, self.apart = outer
        return [start, ast.For(node.target, over, inside, [])]

    def on_While(self, node: ast.While) -> list[ast.stmt]:
        if node.orelse:
            raise refused(node, "a loop with else; test a variable after the loop")
        start, going, outer = self.begun()
        kept, self.before = self.before, []
        test = self.truth(node.test)
        first, self.before = self.before, kept
        inside = [*first, set_to(going, call("lanes_if", name_of(going), test)), self.left(going)]
        inside += self.rounds(node)
        if leaves(node.body, (ast.Break,)):  # which no test may come after
            inside.append(self.left(going))
        self.mask, self.apart = outer
        return [start, ast.While(ast.Constant(True), inside, [])]

    def begun(self) -> tuple[ast.stmt, str, tuple[str, bool]]:
        """Begin a loop that ends at another time in every lane, and act in the lanes under way."""
        going, outer = self.fresh("going"), (self.mask, self.apart)
        start = set_to(going, call("lanes_start", name_of(self.mask)))
        self.mask, self.apart = going, True
        return start, going, outer

    def left(self, going: str) -> ast.stmt:
        """Leave the loop once it has ended in all lanes."""
        over = ast.UnaryOp(ast.Not(), call("lanes_any", name_of(going)))
        return ast.If(over, [ast.Break()], [])

    def rounds(self, loop: ast.For | ast.While) -> list[ast.stmt]:
        """The statements of a loop."""
        self.loops.append(loop)
        self.going.append(self.mask)
        loop.body = tailed(loop.body, OUT_OF_LOOP, self.fresh("left"))
        written = self.block(loop.body) or [ast.Pass()]
        self.loops.pop()
        self.going.pop()
        return written

    def on_Break(self, node: ast.Break) -> list[ast.stmt]:
        going = self.going[-1]
        return [set_to(going, call("lanes_else", name_of(going), name_of(self.mask)))]

    def on_Continue(self, node: ast.Continue) -> list[ast.stmt]:
        return []
