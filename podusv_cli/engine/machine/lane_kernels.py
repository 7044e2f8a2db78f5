"""Kernels rewritten so that every lane goes its own way through their branches.

A kernel is a plain function of floats. For lanes its source is rewritten: a branch is taken where
any lane takes it, and stores and assignments in it act in those lanes only (if-conversion).
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Collection
from pathlib import Path
from typing import Any

from podusv_cli.engine.machine.lane_expressions import ON, stores, takes_mask
from podusv_cli.engine.machine.lane_loops import Loops, Returns, note_outer_reads
from podusv_cli.engine.machine.lane_source import NotForLanes, refused, source
from podusv_cli.engine.machine.lane_syntax import (
    call,
    found,
    leaves,
    name_of,
    reads,
    set_to,
    tailed,
)

RESULT = "lanes_result"
RETURN = (ast.Return,)


def rewritten(function: Any, words: dict[str, Any], plain: Collection[Any]) -> Any:
    """The kernel with the lanes in which it acts as its first argument.

    `words` are the functions that it is written in; kernels in `plain` know nothing of lanes.
    Raises NotForLanes with the kernel's file, line and what to write.
    """
    node = copy.deepcopy(source(function))
    try:
        _check_names(node, function.__globals__, words)
        written = _Rewriter(node, function.__globals__, plain).function()
    except NotForLanes as error:
        raise NotForLanes(f"{Path(function.__code__.co_filename).name}, {error}") from error
    return _made(function, written, words)


def _check_names(node: ast.FunctionDef, scope: dict[str, Any], words: Collection[str]) -> None:
    """Refuse arguments and names that the rewritten kernel would take for something else."""
    given = node.args
    if given.posonlyargs or given.kwonlyargs or given.vararg or given.kwarg:
        raise refused(node, f"{node.name} takes other than plain arguments; write def f(a, b)")
    for part in [part for part in ast.walk(node) if isinstance(part, ast.Name)]:
        name = part.id
        if name.startswith("lanes_") or (name in scope and name in {*words, "bool"}):
            raise refused(
                part,
                f"{name} stands for something else in kernels side by side; call it another name",
            )


def everywhere(function: Any, plain: Collection[Any]) -> Any:
    """A kernel that is written for lanes, which calls other kernels in all lanes."""
    node = copy.deepcopy(source(function))
    for part in ast.walk(node):
        if isinstance(part, ast.Call) and takes_mask(found(part.func, function.__globals__), plain):
            part.args.insert(0, ast.Constant(None))
    node.args = _arguments(node, [])
    node.decorator_list, node.returns = [], None
    return _made(function, node, {})


def _arguments(node: ast.FunctionDef, first: list[str]) -> ast.arguments:
    names = [*first, *(argument.arg for argument in node.args.args)]
    return ast.arguments([], [ast.arg(name) for name in names], None, [], [], None, [])


def _made(function: Any, node: ast.FunctionDef, words: dict[str, Any]) -> Any:
    module = ast.fix_missing_locations(ast.Module([node], []))
    scope: dict[str, Any] = {**function.__globals__, **words}
    exec(compile(module, function.__code__.co_filename, "exec"), scope)  # noqa: S102
    made = scope[node.name]
    made.__qualname__, made.__module__ = function.__qualname__, function.__module__
    return made


class _Rewriter(Loops):
    """One kernel's source while it is rewritten."""

    def function(self) -> ast.FunctionDef:
        """The kernel."""
        node = self.node
        Returns().function(node)
        ast.fix_missing_locations(node)
        note_outer_reads(node)
        body = node.body[1:] if ast.get_docstring(node) is not None else node.body
        body = tailed(body, RETURN, self.fresh("left"))
        several = leaves(body[:-1], RETURN) or not body or not isinstance(body[-1], RETURN)
        values = [n.value for b in body for n in ast.walk(b) if isinstance(n, ast.Return)]
        written = self.block(body) or [ast.Pass()]
        if several and any(values):
            written.append(ast.Return(name_of(RESULT)))
        node.args, node.body = _arguments(node, [ON]), written
        node.decorator_list, node.returns = [], None
        return node

    def block(self, nodes: list[ast.stmt]) -> list[ast.stmt]:
        """Statements, one after another."""
        written: list[ast.stmt] = []
        for node in nodes:
            written += self.statement(node)
        return written

    def statement(self, node: ast.stmt) -> list[ast.stmt]:
        """What one statement becomes."""
        outer, self.before = self.before, []
        write = getattr(self, f"on_{type(node).__name__}", None)
        if write is None:
            raise refused(
                node, f"{ast.unparse(node).splitlines()[0]}: runs side by side cannot do this"
            )
        for name in ("value", "test", "iter"):
            if part := getattr(node, name, None):
                self.check_order(part)
        made = write(node)
        made, self.before = [*self.before, *made], outer
        for part in made:
            ast.copy_location(part, node)
        return [ast.fix_missing_locations(part) for part in made]

    def on_Pass(self, node: ast.Pass) -> list[ast.stmt]:
        return []

    def on_Expr(self, node: ast.Expr) -> list[ast.stmt]:
        return [ast.Expr(self.expression(node.value))]

    def on_Return(self, node: ast.Return) -> list[ast.stmt]:
        if node.value is None:
            return []
        value = self.expression(node.value)
        if not self.apart:
            return [ast.Return(value)]
        return [self.kept(RESULT, value)]

    def kept(self, name: str, value: ast.expr) -> ast.stmt:
        """An assignment in the lanes that are under way."""
        if not self.apart:
            made = value
        elif name in self.known:
            made = call("lanes_assign", name_of(self.mask), value, name_of(name))
        else:
            if not name.startswith("lanes_"):
                self.check(name)
            made = call("lanes_lift", name_of(self.mask), value)
        self.known.add(name)
        return set_to(name, made)

    def on_AnnAssign(self, node: ast.AnnAssign) -> list[ast.stmt]:
        if node.value is None:
            return []
        return self.on_Assign(ast.Assign([node.target], node.value))

    def on_AugAssign(self, node: ast.AugAssign) -> list[ast.stmt]:
        if self.calls_kernel(node.target):
            raise refused(node, "a place that a kernel computes; name it first")
        old = copy.deepcopy(node.target)
        old.ctx = ast.Load()
        return self.to(node.target, ast.BinOp(old, node.op, node.value))

    def check_places(self, node: ast.Assign) -> None:
        """Refuse places that would be computed before what Python computes first."""
        parts = [part for target in node.targets for part in ast.walk(target)]
        several = len(node.targets) > 1 or isinstance(node.targets[0], ast.Tuple)
        stored = any(stores(self.called(part)) for part in ast.walk(node.value))
        looked_up = sum(isinstance(part, ast.Subscript) for part in parts) > 1
        if (stored and looked_up) or ((stored or several) and any(map(self.goes_first, parts))):
            raise refused(
                node,
                "a place that is computed beside a kernel that stores, or a "
                "choice in one of several places; name the value, or the place, first",
            )

    def on_Assign(self, node: ast.Assign) -> list[ast.stmt]:
        self.check_places(node)
        if len(node.targets) == 1:
            return self.to(node.targets[0], node.value)
        name = self.fresh("value")
        made: list[ast.stmt] = [set_to(name, self.expression(node.value))]
        for target in node.targets:
            made += self.into(target, name_of(name))
        return made

    def to(self, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        """An assignment of an expression as it was written."""
        if not isinstance(target, ast.Tuple):
            return self.into(target, self.expression(value))
        if not self.apart and all(isinstance(t, ast.Name) for t in target.elts):
            self.known |= {t.id for t in target.elts if isinstance(t, ast.Name)}
            return [ast.Assign([target], self.expression(value))]
        names = [self.fresh("value") for _ in target.elts]
        made: list[ast.stmt] = []
        if isinstance(value, ast.Tuple):
            for name, part in zip(names, value.elts, strict=True):
                made.append(set_to(name, self.expression(part)))
        else:
            several = ast.Tuple([ast.Name(n, ast.Store()) for n in names], ast.Store())
            made.append(ast.Assign([several], self.expression(value)))
        for name, part in zip(names, target.elts, strict=True):
            made += self.into(part, name_of(name))
        return made

    def into(self, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        """An assignment of a rewritten expression."""
        if isinstance(target, ast.Name):
            return [self.kept(target.id, value)]
        if not isinstance(target, ast.Subscript):
            raise refused(
                target,
                f"{ast.unparse(target)} = ...; assign to a variable, or to a number of a vector",
            )
        place = [self.expression(target.value), self.expression(target.slice)]
        return [ast.Expr(call("lanes_store", name_of(self.mask), *place, value))]

    def on_If(self, node: ast.If) -> list[ast.stmt]:
        condition = self.fresh("condition")
        made: list[ast.stmt] = [set_to(condition, self.truth(node.test))]
        outer, self.apart = self.apart, True
        both = [(self.fresh("before"), name) for name in self.of_both(node)]
        made += [set_to(before, name_of(name)) for before, name in both]
        made += self.lanes(node.body, condition, "lanes_if")
        for before, name in both:
            made.append(ast.Expr(call("lanes_same", name_of(before), name_of(name))))
        made += self.lanes(node.orelse, condition, "lanes_else")
        self.apart = outer
        return made

    def of_both(self, node: ast.If) -> list[str]:
        """Variables that one branch sets and the other one reads."""
        parts = [part for inner in node.body for part in ast.walk(inner)]
        names = {p.id for p in parts if isinstance(p, ast.Name) and isinstance(p.ctx, ast.Store)}
        read = {n for n in names & self.known if any(reads(other, n) for other in node.orelse)}
        return sorted(read)

    def lanes(self, nodes: list[ast.stmt], condition: str, word: str) -> list[ast.stmt]:
        """Statements that run where any lane takes the branch."""
        if not nodes:
            return []
        mask, outer = self.fresh("mask"), self.mask
        made: list[ast.stmt] = [set_to(mask, call(word, name_of(outer), name_of(condition)))]
        if all(map(self.cheap_statement, nodes)):
            for node in nodes:
                made += self.picked(node, mask)
            return made
        self.mask = mask
        inner = self.block(nodes)
        self.mask = outer
        return [*made, ast.If(call("lanes_any", name_of(mask)), inner or [ast.Pass()], [])]

    def cheap_statement(self, node: ast.stmt) -> bool:
        """Whether a statement may as well run in all lanes: it sets known variables, no more."""
        if isinstance(node, ast.Return):
            return node.value is not None and RESULT in self.known and self.cheap(node.value)
        if not isinstance(node, ast.Assign) or len(node.targets) != 1:
            return False
        target = node.targets[0]
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        known = all(isinstance(n, ast.Name) and n.id in self.known for n in names)
        return (
            known
            and self.cheap(node.value)
            and (len(names) == 1 or isinstance(node.value, ast.Tuple))
        )

    def picked(self, node: ast.stmt, mask: str) -> list[ast.stmt]:
        """A cheap statement without a branch."""
        if isinstance(node, ast.Return):
            node = set_to(RESULT, node.value)  # type: ignore[arg-type]
        target = node.targets[0]  # type: ignore[attr-defined]
        value = node.value  # type: ignore[attr-defined]
        pairs = (
            list(zip(target.elts, value.elts, strict=True))
            if isinstance(target, ast.Tuple)
            else [(target, value)]
        )
        names = [self.fresh("value") for _ in pairs]
        made: list[ast.stmt] = [
            set_to(name, self.expression(v)) for name, (_, v) in zip(names, pairs, strict=True)
        ]
        for name, (t, _) in zip(names, pairs, strict=True):
            made.append(
                set_to(t.id, call("lanes_pick", name_of(mask), name_of(name), name_of(t.id)))
            )
        return made
