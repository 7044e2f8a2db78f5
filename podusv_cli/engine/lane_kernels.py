"""Kernels rewritten so that every lane goes its own way through their branches.

A kernel is a plain function of floats. For lanes its source is rewritten: a branch is taken where
any lane takes it, and stores and assignments in it act in those lanes only (if-conversion).
"""

from __future__ import annotations

import ast
import copy
import linecache
from collections.abc import Callable, Collection
from functools import cache
from types import CodeType
from typing import Any

import numpy as np

from podusv_cli.core import kernel
from podusv_cli.engine.lane_doors import has_source

ON, RESULT = "lanes_on", "lanes_result"  # the lanes that a kernel is called in, and its result


class NotForLanes(TypeError):
    """A kernel that cannot be rewritten for lanes."""


def rewritten(function: Any, words: dict[str, Any], plain: Collection[Any]) -> Any:
    """The kernel with the lanes in which it acts as its first argument.

    `words` are the functions that it is written in; kernels in `plain` act in all lanes.
    """
    tree = copy.deepcopy(_source(function))
    scope = function.__globals__
    code = _Rewriter(scope, plain).function(tree)
    module = ast.fix_missing_locations(ast.Module([code], []))
    made: dict[str, Any] = {**scope, **words}
    exec(compile(module, function.__code__.co_filename, "exec"), made)  # noqa: S102
    result = made[code.name]
    result.__qualname__, result.__module__ = function.__qualname__, function.__module__
    return result


def _source(function: Any) -> ast.FunctionDef:
    code = function.__code__
    nodes, codes = _functions("".join(linecache.getlines(code.co_filename)), code.co_filename)
    place = code.co_name, code.co_firstlineno
    found = codes.get(place)
    if found is None or (found.co_code, found.co_names) != (code.co_code, code.co_names):
        raise NotForLanes("its source is not that of what is loaded")
    return nodes[place]


@cache
def _functions(text: str, filename: str) -> tuple[dict[Any, ast.FunctionDef], dict[Any, CodeType]]:
    """Every function of a file by name and first line, as source and as byte code."""
    tree = ast.parse(text)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    nodes = {
        (node.name, min([node.lineno, *(d.lineno for d in node.decorator_list)])): node
        for node in functions
    }
    codes: dict[Any, CodeType] = {}
    waiting = [compile(text, filename, "exec")]
    while waiting:
        code = waiting.pop()
        codes[code.co_name, code.co_firstlineno] = code
        waiting += [part for part in code.co_consts if isinstance(part, CodeType)]
    return nodes, codes


def _call(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(_name(name), list(arguments), [])


def _name(name: str) -> ast.Name:
    return ast.Name(name, ast.Load())


def _set(name: str, value: ast.expr) -> ast.Assign:
    return ast.Assign([ast.Name(name, ast.Store())], value)


def _returns(nodes: list[ast.stmt]) -> bool:
    return any(isinstance(part, ast.Return) for node in nodes for part in ast.walk(node))


def _ends(nodes: list[ast.stmt]) -> bool:
    """Whether these statements always return."""
    if not nodes:
        return False
    last = nodes[-1]
    return isinstance(last, ast.Return) or (
        isinstance(last, ast.If) and _ends(last.body) and _ends(last.orelse)
    )


def _tailed(nodes: list[ast.stmt]) -> list[ast.stmt]:
    """The same statements with every `return` at the end of a branch."""
    for i, node in enumerate(nodes):
        if isinstance(node, ast.Return):
            return nodes[: i + 1]
        if isinstance(node, ast.If) and _returns([node]):
            rest = nodes[i + 1 :]
            branches = [
                _tailed(b if _ends(b) else [*b, *copy.deepcopy(rest)])
                for b in (node.body, node.orelse)
            ]
            return [*nodes[:i], ast.If(node.test, *branches)]
        if isinstance(node, (ast.For, ast.While)) and _returns([node]):
            raise NotForLanes("it returns from within a loop")
    return nodes


class _Rewriter:
    """One kernel's source while it is rewritten."""

    def __init__(self, scope: dict[str, Any], plain: Collection[Any]) -> None:
        self.scope, self.uniform = scope, plain
        self.known: set[str] = set()  # variables that may have a value already
        self.depth = 0  # of branches
        self.count = 0
        self.before: list[ast.stmt] = []  # what has to run before the statement under way
        self.mask = ON

    def function(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """The kernel."""
        names = [argument.arg for argument in node.args.args]
        self.known |= set(names)
        body = node.body[1:] if ast.get_docstring(node) is not None else node.body
        body = _tailed(body)
        single = not _returns(body[:-1]) and bool(body) and isinstance(body[-1], ast.Return)
        self.valued = any(
            isinstance(part, ast.Return) and part.value is not None
            for statement in body
            for part in ast.walk(statement)
        )
        written = self.block(body) or [ast.Pass()]
        if self.valued and not single:
            written.append(ast.Return(_name(RESULT)))
        arguments = ast.arguments([], [ast.arg(a) for a in (ON, *names)], None, [], [], None, [])
        return ast.FunctionDef(node.name, arguments, written, [], type_params=[])

    def fresh(self, word: str) -> str:
        """A name of its own."""
        self.count += 1
        return f"lanes_{word}_{self.count}"

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
            raise NotForLanes(f"line {node.lineno}: {type(node).__name__} is not for lanes")
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
        if self.depth == 0:
            return [ast.Return(value)]
        return [self.kept(RESULT, value)]

    def kept(self, name: str, value: ast.expr) -> ast.stmt:
        """An assignment in the lanes of the branch."""
        if self.depth == 0:
            made = value
        elif name in self.known:
            made = _call("lanes_assign", _name(self.mask), value, _name(name))
        else:
            made = _call("lanes_lift", _name(self.mask), value)
        self.known.add(name)
        return _set(name, made)

    def on_AugAssign(self, node: ast.AugAssign) -> list[ast.stmt]:
        old = copy.deepcopy(node.target)
        old.ctx = ast.Load()  # type: ignore[union-attr]
        return self.on_Assign(ast.Assign([node.target], ast.BinOp(old, node.op, node.value)))

    def on_Assign(self, node: ast.Assign) -> list[ast.stmt]:
        if len(node.targets) == 1:
            return self.to(node.targets[0], node.value)
        name = self.fresh("value")
        made: list[ast.stmt] = [_set(name, self.expression(node.value))]
        for target in node.targets:
            made += self.into(target, _name(name))
        return made

    def to(self, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        """An assignment of an expression as it was written."""
        if not isinstance(target, ast.Tuple):
            return self.into(target, self.expression(value))
        if self.depth == 0 and all(isinstance(t, ast.Name) for t in target.elts):
            self.known |= {t.id for t in target.elts if isinstance(t, ast.Name)}
            return [ast.Assign([target], self.expression(value))]
        names = [self.fresh("value") for _ in target.elts]
        made: list[ast.stmt] = []
        if isinstance(value, ast.Tuple):
            for name, part in zip(names, value.elts, strict=True):
                made.append(_set(name, self.expression(part)))
        else:
            several = ast.Tuple([ast.Name(n, ast.Store()) for n in names], ast.Store())
            made.append(ast.Assign([several], self.expression(value)))
        for name, part in zip(names, target.elts, strict=True):
            made += self.into(part, _name(name))
        return made

    def into(self, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        """An assignment of a rewritten expression."""
        if isinstance(target, ast.Name):
            return [self.kept(target.id, value)]
        if not isinstance(target, ast.Subscript):
            raise NotForLanes(f"line {target.lineno}: an assignment to {ast.unparse(target)}")
        place = [self.expression(target.value), self.expression(target.slice)]
        return [ast.Expr(_call("lanes_store", _name(self.mask), *place, value))]

    def on_For(self, node: ast.For) -> list[ast.stmt]:
        self.plain(node)
        over = self.expression(node.iter)
        self.known |= {n.id for n in ast.walk(node.target) if isinstance(n, ast.Name)}
        # What the loop assigns is there from its second round on.
        return [ast.For(node.target, over, self.block(node.body), [])]

    def on_While(self, node: ast.While) -> list[ast.stmt]:
        self.plain(node)
        test = self.expression(node.test)
        if self.before:
            raise NotForLanes(f"line {node.lineno}: a loop with a choice in its condition")
        return [ast.While(_call("lanes_same", test), self.block(node.body), [])]

    def plain(self, loop: ast.For | ast.While) -> None:
        """Refuse a loop that may end early."""
        leaves = any(isinstance(part, (ast.Break, ast.Continue)) for part in ast.walk(loop))
        if leaves or loop.orelse:
            raise NotForLanes(f"line {loop.lineno}: a loop with break, continue or else")

    def on_If(self, node: ast.If) -> list[ast.stmt]:
        condition = self.fresh("condition")
        made: list[ast.stmt] = [_set(condition, self.expression(node.test))]
        made += self.branch(node.body, condition, "lanes_if")
        return made + self.branch(node.orelse, condition, "lanes_else")

    def branch(self, nodes: list[ast.stmt], condition: str, word: str) -> list[ast.stmt]:
        """Statements that run where any lane takes the branch."""
        if not nodes:
            return []
        mask, outer = self.fresh("mask"), self.mask
        made: list[ast.stmt] = [_set(mask, _call(word, _name(outer), _name(condition)))]
        if all(map(self.cheap_statement, nodes)):
            for node in nodes:
                made += self.picked(node, mask)
            return made
        self.mask, self.depth = mask, self.depth + 1
        inner = self.block(nodes)
        self.mask, self.depth = outer, self.depth - 1
        return [*made, ast.If(_call("lanes_any", _name(mask)), inner or [ast.Pass()], [])]

    def cheap_statement(self, node: ast.stmt) -> bool:
        """Whether a statement may as well run in all lanes: it sets known variables, no more."""
        if isinstance(node, ast.Return):
            return node.value is not None and RESULT in self.known and self.cheap(node.value)
        if not isinstance(node, ast.Assign) or len(node.targets) != 1:
            return False
        target = node.targets[0]
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        known = all(isinstance(n, ast.Name) and n.id in self.known for n in names)
        return known and self.cheap(node.value) and (len(names) == 1 or isinstance(node.value, ast.Tuple))

    def picked(self, node: ast.stmt, mask: str) -> list[ast.stmt]:
        """A cheap statement without a branch."""
        if isinstance(node, ast.Return):
            node = _set(RESULT, node.value)  # type: ignore[arg-type]
        target = node.targets[0]  # type: ignore[attr-defined]
        value = node.value  # type: ignore[attr-defined]
        pairs = (
            list(zip(target.elts, value.elts, strict=True))
            if isinstance(target, ast.Tuple)
            else [(target, value)]
        )
        names = [self.fresh("value") for _ in pairs]
        made: list[ast.stmt] = [
            _set(name, self.expression(v)) for name, (_, v) in zip(names, pairs, strict=True)
        ]
        for name, (t, _) in zip(names, pairs, strict=True):
            made.append(_set(t.id, _call("lanes_pick", _name(mask), _name(name), _name(t.id))))
        return made

    def cheap(self, value: ast.expr) -> bool:
        """Whether an expression may be evaluated where it is not needed."""
        return not any(isinstance(part, (ast.Call, ast.Subscript)) for part in ast.walk(value))

    def expression(self, node: ast.expr) -> ast.expr:
        """What an expression becomes."""
        write = getattr(self, f"of_{type(node).__name__}", self.of_parts)
        return ast.copy_location(write(node), node)  # type: ignore[no-any-return]

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
            first = _call(word, first, other)
        return first

    def of_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        if isinstance(node.op, ast.Not):
            return _call("lanes_not", self.expression(node.operand))
        return self.of_parts(node)

    def of_Compare(self, node: ast.Compare) -> ast.expr:
        places = [node.left, *node.comparators]
        made: ast.expr | None = None
        for left, sign, right in zip(places, node.ops, places[1:], strict=False):
            pair = ast.Compare(self.expression(left), [sign], [self.expression(right)])
            made = pair if made is None else _call("lanes_and", made, pair)
        assert made is not None
        return made

    def of_IfExp(self, node: ast.IfExp) -> ast.expr:
        if self.cheap(node.body) and self.cheap(node.orelse):
            return _call("lanes_pick", *map(self.expression, (node.test, node.body, node.orelse)))
        name, wanted = self.fresh("choice"), []
        for value in (node.body, node.orelse):
            wanted.append([ast.copy_location(_set(name, value), node)])
        self.before += self.statement(ast.copy_location(ast.If(node.test, *wanted), node))
        return _name(name)

    def of_Call(self, node: ast.Call) -> ast.expr:
        if node.keywords:
            raise NotForLanes(f"line {node.lineno}: arguments by name are not for lanes")
        arguments = list(map(self.expression, node.args))
        found = self.found(node.func)
        if kernel.is_kernel(found) and found not in self.uniform and has_source(found):
            arguments.insert(0, _name(self.mask))
        if isinstance(node.func, ast.Attribute) and found in (np.ceil, np.floor):
            return _call(f"lanes_{node.func.attr}", *arguments)
        return ast.Call(node.func, arguments, [])

    def found(self, function: ast.expr) -> Callable[..., Any] | None:
        """What is called, where it is a global or an attribute of one."""
        if isinstance(function, ast.Name):
            return self.scope.get(function.id) if function.id not in self.known else None
        if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
            return getattr(self.scope.get(function.value.id), function.attr, None)
        return None

