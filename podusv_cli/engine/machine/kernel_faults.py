"""Faults of kernels that show in their source: what machine code would compute from anything.

Python raises an error where a kernel reads a variable that has no value yet, and counts a negative
index from the end of a vector. Machine code does neither: it takes what happens to be in memory.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import is_kernel, named_kernels
from podusv_cli.engine.machine.kernel_reads import Reads, whole_number
from podusv_cli.engine.machine.kernel_source import OtherSource, has_source, source

OWN = "podusv_cli."  # modules whose kernels a test looks at
# What there is no machine code for, and what to write in its place.
CALLS = {
    "print": "print: declare a signal and write the number into it",
    "len": "len: a kernel does not know the length of a vector; write the number",
}
PARTS: dict[type[ast.AST], str] = {
    ast.Assert: "assert: machine code knows no errors; write a number that tells, as a signal",
    ast.Raise: "raise: machine code knows no errors; write a number that tells, as a signal",
    ast.Try: "try: machine code knows no errors; test the numbers before",
    ast.List: "a list: take variables, or scratch(n)",
    ast.Dict: "a dict: take variables",
    ast.ListComp: "a list: write a loop",
    ast.GeneratorExp: "a generator: write a loop",
    ast.Slice: "a slice: take tail(vector, n), or a loop",
    ast.JoinedStr: "text: take numbers",
    ast.Lambda: "a lambda: write a kernel",
    ast.FunctionDef: "a function within: write a kernel",
}
FROM_THE_END = (
    "counts from the end, and a kernel does not know where a vector ends; count from the front"
)
RETURNS_NOTHING = {ast.dump(ast.Return()), ast.dump(ast.Return(ast.Constant(None)))}


def check_kernel(function: Any) -> None:
    """Check a kernel from outside podusv, and all kernels it calls.

    Raises LawError with file, line and what to write, for the first fault.
    """
    for called in _reached_kernels(function):
        node = _source(called)
        for line, text in faults(node, called.__globals__) if node else ():
            place = f"{Path(called.__code__.co_filename).name}, line {line}"
            raise LawError(f"kernel {called.__qualname__} ({place}): {text}")


def check_arguments(function: Any, names: Collection[str]) -> None:
    """Raises LawError for a kernel that writes to an argument in `names`, which are to be read."""
    node = None if str(function.__module__).startswith(OWN) else _source(function)
    for part in ast.walk(node) if node else ():
        match part:
            case ast.Subscript(value=ast.Name(id=name), ctx=ast.Store()) if name in names:
                place = f"{Path(function.__code__.co_filename).name}, line {part.lineno}"
                text = f"it writes {ast.unparse(part)}, which it may only read"
                raise LawError(f"kernel {function.__qualname__} ({place}): {text}")


@cache
def _reached_kernels(function: Any) -> tuple[Any, ...]:
    """The kernel and all kernels from outside podusv that it calls, each once."""
    reached, waiting = dict[Any, None](), [function]
    while waiting:
        called = waiting.pop()
        if isinstance(called, FunctionType) and called not in reached:
            reached[called] = None
            waiting += named_kernels(called).values()
    return tuple(called for called in reached if not str(called.__module__).startswith(OWN))


def _source(function: Any) -> ast.FunctionDef | None:
    """A kernel's source, where it can be told: not of one that is edited, or written otherwise."""
    with suppress(OtherSource):
        if isinstance(function, FunctionType) and has_source(function):
            return source(function)
    return None


def faults(node: ast.FunctionDef, known: Mapping[str, Any]) -> Iterator[tuple[int, str]]:
    """Line and sentence of every fault of a kernel: negative indices, then variables without value.

    `node` is its source, `known` are its globals.
    """
    vectors = _vectors(node)
    for part in ast.walk(node):
        match part:
            case ast.Subscript(value=of, slice=index) if _is_vector(of, vectors):
                if (whole_number(index, known) or 0) < 0:
                    yield part.lineno, f"{ast.unparse(part)} {FROM_THE_END}"
    yield from Reads(node, known).unset_variables()


def _vectors(node: ast.FunctionDef) -> set[str]:
    """The names of a kernel that stand for vectors.

    An argument may be one unless it is annotated as a tuple; of a number no index is taken anyhow.
    """
    arguments = (a for a in node.args.args if "tuple" not in ast.unparse(a.annotation or a).lower())
    vectors = {argument.arg for argument in arguments}
    for part in ast.walk(node):
        match part:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if _is_vector(value, vectors):
                vectors.add(name)
    return vectors


def _is_vector(node: ast.expr, vectors: Collection[str]) -> bool:
    """Whether an expression is a vector: a name in `vectors`, `tail(...)` or `scratch(...)`."""
    match node:
        case ast.Name(id=name):
            return name in vectors
        case ast.Call(func=ast.Name(id=name)):
            return name in ("tail", "scratch")
    return False


def unsupported_construct(function: Any) -> str:
    """What of a kernel, or of one that it calls, there is no machine code for; else empty."""
    if not is_kernel(function):
        return f"{getattr(function, '__name__', function)} is no kernel; write @kernel above it"
    return next(filter(None, map(_unsupported_in, _reached_kernels(function))), "")


def _unsupported_in(function: Any) -> str:
    """What of this kernel alone there is no machine code for, with file and line; else empty."""
    if function in named_kernels(function).values():
        return f"{function.__name__} calls itself; write a loop"
    node = _source(function)
    if not node:
        return ""
    looks = (_without_code, _of_numpy)
    texts = ((part, look(part, function.__globals__)) for look in looks for part in _body(node))
    marked = [(part.lineno, text) for part, text in texts if text]  # type: ignore[attr-defined]
    if line := _returns_at_times(node):
        marked.append((line, "it returns a value here only; always return one"))
    file = Path(function.__code__.co_filename).name
    return next((f"{file}, line {line}: {text}" for line, text in marked), "")


def _body(node: ast.FunctionDef) -> Iterator[ast.AST]:
    """Every part of a function's body, without its arguments and decorators."""
    for line in node.body:
        yield from ast.walk(line)


def _without_code(part: ast.AST, known: Mapping[str, Any]) -> str:
    """Why a part of a kernel's source cannot become machine code; "" where it can.

    `known` are the kernel's globals.
    """
    match part:
        case ast.Call(func=ast.Name(id=name)):
            called = known.get(name)
            plain = isinstance(called, FunctionType) and not is_kernel(called)
            return f"{name} is no kernel; write @kernel above it" if plain else CALLS.get(name, "")
        case ast.BinOp(op=ast.Pow(), right=power) if (whole_number(power, {}) or 0) < 0:
            return f"{ast.unparse(part)}: a negative whole power; write ** -2.0, or divide"
    return next((text for kind, text in PARTS.items() if isinstance(part, kind)), "")


def _of_numpy(part: ast.AST, known: Mapping[str, Any]) -> str:
    """What is wrong with a call of numpy that works on arrays; "" for any other part.

    Its functions of single numbers (ufuncs) have machine code.
    """
    match part:
        case ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr=attr) as called):
            if known.get(name) is np and not isinstance(getattr(np, attr, None), np.ufunc):
                return (
                    f"{ast.unparse(called)}: numpy works on arrays; take math, min, max and loops"
                )
    return ""


def _returns_at_times(node: ast.FunctionDef) -> int:
    """The line of the first value that a kernel returns which does not always return one; else 0.

    Machine code has to return the same type whichever way it goes.
    """
    returns = [part for part in ast.walk(node) if isinstance(part, ast.Return)]
    lines = [part.lineno for part in returns if ast.dump(part) not in RETURNS_NOTHING]
    always = len(lines) == len(returns) and Reads(node, {}).always_returns()
    return lines[0] if lines and not always else 0
