"""The convention for code that runs inside the compiled loop.

A kernel is a plain Python function on floats and vectors. It can be called as it is (tests and
the uncompiled engine do), and `engine.machine.compile` compiles it with every kernel that it calls.
In compiled code a vector is a bare pointer: index it, pass `tail(v, n)` for the part from n on, and
never ask for its length.
"""

from __future__ import annotations

import builtins
import dis
from collections import namedtuple
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from podusv_cli.core.errors import LawError
from podusv_cli.core.plugins import TEXT

Vector = npt.NDArray[np.float64]
LOAD_GLOBAL = dis.opmap["LOAD_GLOBAL"]
LANES = 8  # numbers in the widest vector register; loops over whole registers are fastest
Function = TypeVar("Function", bound=Callable[..., object])


def kernel(function: Function) -> Function:
    """Mark a function as code for the compiled loop; the function itself stays as it is."""
    function.__kernel__ = True  # type: ignore[attr-defined]
    return function


def is_kernel(thing: object) -> bool:
    """Whether `thing` was marked with `kernel`."""
    return getattr(thing, "__kernel__", False) is True


def named_kernels(function: Any) -> dict[str, Any]:
    """The kernels among the globals that a function names, by name."""
    things = {name: function.__globals__.get(name) for name in _read_in(function.__code__)[0]}
    return {name: thing for name, thing in things.items() if is_kernel(thing)}


def whole_numbers(function: Any) -> frozenset[str]:
    """Constants that a kernel, or one that it calls, makes whole numbers of: `int(k.count)`."""
    whole = _read_in(function.__code__)[1]
    return whole.union(*map(whole_numbers, named_kernels(function).values()))


def _globals_read(code: Any) -> frozenset[str]:
    """Names of globals that code reads; `dis.get_instructions` takes ten times as long.

    Byte code is pairs of operation and argument; an argument above 255 has its higher bits ahead.
    """
    names, high = set(), 0
    for operation, low in zip(code.co_code[::2], code.co_code[1::2], strict=True):
        argument = low | high
        high = argument << 8 if operation == dis.EXTENDED_ARG else 0
        if operation == LOAD_GLOBAL:
            names.add(code.co_names[argument >> 1])  # the last bit is no part of the place
    return frozenset(names)


@cache
def _read_in(code: Any) -> tuple[frozenset[str], frozenset[str]]:
    """Names of globals that code reads, and of attributes that it makes whole numbers of.

    The latter are those of the form `int(k.count)`: the name `int`, a variable, an attribute of it.
    """
    read = _globals_read(code)
    if "int" not in read:
        return read, frozenset()
    steps = [i for i in dis.get_instructions(code) if i.opname != "PUSH_NULL"]
    return read, frozenset(
        attribute.argval
        for called, _, attribute in zip(steps, steps[1:], steps[2:], strict=False)
        if called.argval == "int" and attribute.opname == "LOAD_ATTR"
    )


@kernel
def tail(vector: Vector, start: int) -> Vector:
    """The part of `vector` from index `start` on, sharing its memory."""
    return vector[start:]


@kernel
def scratch(count: int) -> Vector:
    """Room for `count` numbers, a constant, while the kernel runs; on the stack where compiled."""
    return np.empty(count)


@kernel
def widest() -> None:
    """Have loops of the kernel that calls this use the widest vector registers there are.

    The compiler prefers 256 bits, since short loops gain nothing by 512. It changes no result.
    """


@kernel
def shared(number: float) -> float:
    """A number that is the same in all runs that march side by side."""
    return number


@kernel
def lanes_any(truth: bool) -> bool:
    """Whether something is true in any of the runs that march side by side."""
    return truth


@kernel
def lane_true(truth: bool, lane: int) -> bool:
    """Whether something is true in the run of this lane."""
    return truth


@kernel
def lane_numbers(vector: Vector) -> Vector:
    """A vector's numbers one by one: the first number of every lane, then the second, ..."""
    return vector


@kernel
def padded_rounds(whole: int, count: int) -> int:
    """How many rounds a loop over `count` numbers takes that are filled up to `whole` registers.

    All of them where a register holds several rounds; where it holds several runs, `count`.
    """
    return whole


def arguments_of(function: Any, offered: Collection[str]) -> tuple[str, ...]:
    """The arguments that a kernel takes, in its own order; it names those that it needs.

    Raises LawError for one that is not among those offered.
    """
    code = function.__code__
    names: tuple[str, ...] = code.co_varnames[: code.co_argcount]
    if isinstance(function, MethodType):
        raise LawError(f"kernel {function.__qualname__} is a method; write @staticmethod above it")
    for name in names:
        if name not in offered:
            place = f"{Path(code.co_filename).name}, line {code.co_firstlineno}"
            what = f"{name!r} is none of its arguments (allowed: {', '.join(offered)})"
            raise LawError(f"kernel {function.__qualname__} ({place}): {what}")
    return names


def call(function: Any, **offered: Any) -> Any:
    """What a kernel gives for those of these arguments that it takes; raises as `arguments_of`."""
    return function(*(offered[name] for name in arguments_of(function, offered)))


class NoKernel(LawError):
    """A component lacks a kernel."""


def absent(name: str) -> Callable[[], None]:
    """What stands for a kernel of this name until a component has one of its own.

    A function that raises NoKernel, with what to write.
    """

    def none() -> None:
        raise NoKernel(f"no kernel `{name}`; write one below @staticmethod and @kernel")

    return none


def taking(function: Any, arguments: Sequence[str], named: Any = None) -> Any:
    """A kernel that takes all of these arguments and passes `function` those that it names.

    With `named` it passes `named(k)` for the constants k. Raises LawError as `arguments_of`. Its
    source is written out: compiled code has no calls by name.
    """
    passed = ", ".join(
        "named(k)" if a == "k" and named else a for a in arguments_of(function, arguments)
    )
    text = f"def adapter({', '.join(arguments)}):\n    kernel({passed})"
    scope: dict[str, Any] = {"kernel": function, "named": named, TEXT: text}
    scope["__name__"] = function.__module__
    exec(compile(text, "arguments of a kernel", "exec"), scope)  # noqa: S102
    return kernel(scope["adapter"])


def with_globals(function: Any, name: str, **replaced: Any) -> Any:
    """A copy of `function`, called `name`, that sees `replaced` in place of its globals."""
    copy = FunctionType(function.__code__, {**function.__globals__, **replaced}, name)
    copy.__qualname__ = name
    copy.__module__ = function.__module__
    copy.__doc__ = function.__doc__
    return copy


def transplant(function: Any, parts: Mapping[Any, Any]) -> Any:
    """A copy of a kernel, and of all kernels it calls, with other objects in place of some.

    `parts` says what stands for a kernel, a module or a builtin, by identity. So the copy computes
    with other things than numbers, as with symbols or with numbers that count.
    """
    replaced = {}
    for name in _globals_read(function.__code__):
        thing = function.__globals__.get(name, getattr(builtins, name, None))
        other = next((new for old, new in parts.items() if old is thing), None)
        if other is not None:
            replaced[name] = other
        elif is_kernel(thing):
            replaced[name] = transplant(thing, parts)
    return with_globals(function, function.__name__, **replaced)


def specialise(function: Any, name: str, **parts: Any) -> Any:
    """A kernel that is `function` with these kernels put in for globals of the same names.

    Compiled code cannot be cached when it takes a kernel as an argument; this is the way around.
    """
    return kernel(with_globals(function, name, **parts))


@cache
def constants_type(names: tuple[str, ...]) -> type[Any]:
    """The named tuple type with these fields; the same type for the same names."""
    return namedtuple("Constants", names)


def bundle(constants: Mapping[str, float]) -> Any:
    """Constants as kernels take them: `k.m11` instead of `constants["m11"]`."""
    return constants_type(tuple(constants))._make(constants.values())


def whole_lanes(count: int) -> int:
    """`count` rounded up to whole vector registers."""
    return -(-count // LANES) * LANES


def unpacker(names: tuple[str, ...], alike: Collection[str] = ()) -> Callable[[Vector], Any]:
    """A kernel from a vector to the named tuple of these constants; those in `alike` are `shared`.

    `names` are the constants' in the order of the vector's numbers. Its source is written out, one
    index a field: compiled code has no calls of variable length.
    """
    fields = ", ".join(
        f"shared(p[{i}])" if name in alike else f"p[{i}]" for i, name in enumerate(names)
    )
    text = f"def named(p):\n    return Constants({fields})"
    scope: dict[str, Any] = {"Constants": constants_type(names), "shared": shared, TEXT: text}
    exec(text, scope)  # noqa: S102
    return kernel(scope["named"])  # type: ignore[no-any-return]
