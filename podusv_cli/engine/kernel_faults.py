"""Faults of kernels that show in their source: what machine code would compute from anything.

Python raises an error where a kernel reads a variable that has no value yet, and counts a negative
index from the end of a vector. Machine code does neither: it takes what happens to be in memory.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import is_kernel, named_kernels
from podusv_cli.engine.lane_source import OtherSource, has_source, source

OWN = "podusv_cli."  # modules whose kernels a test looks at
# What there is no machine code for, and what to write in its place.
CALLS = {
    "print": "print: declare a signal and write the number into it",
    "len": "len: a kernel does not know the length of a vector; write the number",
}
PARTS: dict[type[ast.AST], str] = {
    ast.Raise: "raise: machine code knows no errors; write a number that tells, as a signal",
    ast.Try: "try: machine code knows no errors; test the numbers before",
    ast.List: "a list: take variables, or scratch(n)", ast.Dict: "a dict: take variables",
    ast.ListComp: "a list: write a loop", ast.GeneratorExp: "a generator: write a loop",
    ast.Slice: "a slice: take tail(vector, n), or a loop", ast.JoinedStr: "text: take numbers",
    ast.Lambda: "a lambda: write a kernel", ast.FunctionDef: "a function within: write a kernel",
}  # fmt: skip
RETURNS_NOTHING = {ast.dump(ast.Return()), ast.dump(ast.Return(ast.Constant(None)))}
ENDS = (ast.Return, ast.Raise, ast.Break, ast.Continue)
UNREAD = (ast.Try, ast.With, ast.Match, ast.FunctionDef)  # which no kernel can have
Names = frozenset[str]
EVERYTHING = None  # the names that are set where control never comes


@cache
def check_kernel(function: Any) -> None:
    """Look at a kernel from outside podusv, and at all kernels it calls. Raises LawError."""
    if not function.__module__.startswith(OWN) and has_source(function):
        try:
            node = source(function)
        except OtherSource:  # edited meanwhile; it is compiled as it was loaded
            return
        for line, text in faults(node):
            place = f"{Path(function.__code__.co_filename).name}, line {line}"
            raise LawError(f"kernel {function.__qualname__} ({place}): {text}")
    for other in named_kernels(function).values():
        check_kernel(other)


def faults(node: ast.FunctionDef) -> Iterator[tuple[int, str]]:
    """Line and sentence of every fault of a kernel."""
    vectors = {argument.arg for argument in node.args.args}
    for part in ast.walk(node):
        if _counts_from_the_end(part, vectors):
            yield (
                part.lineno,  # type: ignore[attr-defined]
                f"{ast.unparse(part)} counts from the end, and a kernel does not know where a "
                "vector ends; count from the front",
            )
    yield from _Reads(node).unset()


def _counts_from_the_end(part: ast.AST, vectors: set[str]) -> bool:
    return (
        isinstance(part, ast.Subscript)
        and isinstance(part.value, ast.Name)
        and part.value.id in vectors
        and isinstance(part.slice, ast.UnaryOp)
        and isinstance(part.slice.op, ast.USub)
    )


def unsupported(function: Any) -> str:
    """What of a kernel, or of one that it calls, there is no machine code for; else empty."""
    if not is_kernel(function):
        return f"{function.__name__} is no kernel; write @kernel above it"
    if has_source(function) and not function.__module__.startswith(OWN):
        node, file = source(function), Path(function.__code__.co_filename).name
        for part in (part for line in node.body for part in ast.walk(line)):
            if text := _without_code(part, function.__globals__):
                return f"{file}, line {part.lineno}: {text}"  # type: ignore[attr-defined]
        if line := _returns_at_times(node):
            return f"{file}, line {line}: it returns a value here only; always return one"
    return next(filter(None, map(unsupported, named_kernels(function).values())), "")


def _without_code(part: ast.AST, known: dict[str, Any]) -> str:
    match part:
        case ast.Call(func=ast.Name(id=name)):
            called = known.get(name)
            plain = isinstance(called, FunctionType) and not is_kernel(called)
            return f"{name} is no kernel; write @kernel above it" if plain else CALLS.get(name, "")
        case ast.Attribute(value=ast.Name(id=name)) if known.get(name) is np:
            return f"{ast.unparse(part)}: numpy works on arrays; take math, min, max and loops"
    return next((text for kind, text in PARTS.items() if isinstance(part, kind)), "")


def _returns_at_times(node: ast.FunctionDef) -> int:
    """The line of a value that a kernel returns which need not return one; else 0."""
    returns = [part for part in ast.walk(node) if isinstance(part, ast.Return)]
    lines = [part.lineno for part in returns if ast.dump(part) not in RETURNS_NOTHING]
    always = len(lines) == len(returns) and _Reads(node).always_returns()
    return lines[0] if lines and not always else 0


@dataclass
class _Loop:
    """The names that are set where a loop is left, or its next round begins, from within."""

    left: list[Names] = field(default_factory=list)
    again: list[Names] = field(default_factory=list)


class _Reads:
    """Follows a kernel's statements with the names that surely have a value."""

    def __init__(self, node: ast.FunctionDef) -> None:
        stores = (n for n in ast.walk(node) if isinstance(n, ast.Name))
        self._own = {name.id for name in stores if isinstance(name.ctx, ast.Store)}
        self._node, self._found = node, dict[tuple[int, str], str]()
        self._loops: list[_Loop] = []

    def always_returns(self) -> bool:
        """Whether every way through the kernel ends in `return`."""
        return self._block(self._node.body, frozenset()) is EVERYTHING

    def unset(self) -> Iterator[tuple[int, str]]:
        """Line and sentence for each variable that may be read before it is set."""
        self._block(self._node.body, frozenset(a.arg for a in self._node.args.args))
        yield from ((line, text) for (line, _), text in self._found.items())

    def _block(self, nodes: list[ast.stmt], known: Names | None) -> Names | None:
        for node in nodes:
            if known is not EVERYTHING:
                known = self._statement(node, known)
        return known

    def _statement(self, node: ast.stmt, known: Names) -> Names | None:
        follow = getattr(self, f"_after_{type(node).__name__}", self._after_other)
        after: Names | None = follow(node, known)
        return after

    def _after_other(self, node: ast.stmt, known: Names) -> Names | None:
        if not isinstance(node, UNREAD):
            self._read(node, known)
        if isinstance(node, ast.Break):
            self._loops[-1].left.append(known)
        if isinstance(node, ast.Continue):
            self._loops[-1].again.append(known)
        return EVERYTHING if isinstance(node, ENDS) else known | _stored(node)

    def _after_AugAssign(self, node: ast.AugAssign, known: Names) -> Names:
        if isinstance(node.target, ast.Name):
            self._note(node.target, known)
        self._read(node, known)
        return known

    def _after_If(self, node: ast.If, known: Names) -> Names | None:
        self._read(node.test, known)
        known |= _stored(node.test)
        return _both([self._block(node.body, known), self._block(node.orelse, known)])

    def _after_While(self, node: ast.While, known: Names) -> Names | None:
        self._read(node.test, known)
        known |= _stored(node.test)
        loop, _ = self._round(node.body, known)
        endless = isinstance(node.test, ast.Constant) and bool(node.test.value)
        ended = EVERYTHING if endless else self._block(node.orelse, known)
        return _both([ended, *loop.left])

    def _after_For(self, node: ast.For, known: Names) -> Names | None:
        self._read(node.iter, known)
        loop, last = self._round(node.body, known | _stored(node.target))
        over = _both([last, *loop.again]) if _has_rounds(node.iter) else known
        ended = EVERYTHING if over is EVERYTHING else self._block(node.orelse, over)
        return _both([ended, *loop.left])

    def _round(self, body: list[ast.stmt], known: Names) -> tuple[_Loop, Names | None]:
        self._loops.append(_Loop())
        last = self._block(body, known)
        return self._loops.pop(), last

    def _read(self, node: ast.AST, known: Names) -> None:
        for part in ast.walk(node):
            if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load):
                self._note(part, known)

    def _note(self, name: ast.Name, known: Names) -> None:
        if name.id in self._own and name.id not in known:
            self._found[name.lineno, name.id] = (
                f"{name.id} may have no value here, since it is set in a branch or a loop that "
                "need not run; set it before that, too"
            )


def _stored(node: ast.AST) -> Names:
    names = (n for n in ast.walk(node) if isinstance(n, ast.Name))
    return frozenset(name.id for name in names if isinstance(name.ctx, ast.Store))


def _both(several: list[Names | None]) -> Names | None:
    """The names that are set whichever way control comes."""
    ways = [names for names in several if names is not EVERYTHING]
    return frozenset.intersection(*ways) if ways else EVERYTHING


def _has_rounds(counts: ast.expr) -> bool:
    """Whether a loop over `range(3)` and the like has a round at least."""
    if not (isinstance(counts, ast.Call) and isinstance(counts.func, ast.Name)):
        return isinstance(counts, ast.Tuple) and bool(counts.elts)
    numbers = [a.value for a in counts.args if isinstance(a, ast.Constant)]
    whole = [number for number in numbers if isinstance(number, int)]
    return counts.func.id == "range" and len(whole) == len(counts.args) and bool(range(*whole))
