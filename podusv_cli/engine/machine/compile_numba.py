# mypy: disable-error-code="attr-defined"
"""Object code of kernels by numba. `object_cache` keeps it on the disk for later processes."""

from __future__ import annotations

import ctypes
import linecache
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from numba import cfunc, njit, types
from numba.core import cgutils, config
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError
from numba.core.typing.ctypes_utils import from_ctypes
from numba.extending import intrinsic

from podusv_cli.core import kernel
from podusv_cli.engine.machine import finish
from podusv_cli.engine.machine.object_cache import Code

# Kernels are inlined: to pass a law's constants to another function takes as long as the law.
OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": True}
INNER = OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # called by kernels only


# An intrinsic gives numba the signature of a primitive of `core.kernel`, and its LLVM code.
@intrinsic
def tail_of(typing: Any, vector: Any, start: Any) -> Any:
    """The signature and the code of `kernel.tail`."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """LLVM's code: the pointer moved on by so many numbers."""
        return builder.gep(arguments[0], [arguments[1]])

    return vector(vector, types.int64), code


@intrinsic(prefer_literal=True)
def scratch_of(typing: Any, count: Any) -> Any:
    """The signature and the code of `kernel.scratch`, whose `count` is a literal."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """LLVM's code: room on the stack, made once a call of the kernel."""
        kind, size = context.get_value_type(types.float64), count.literal_value
        return cgutils.alloca_once(builder, kind, size)  # type: ignore[no-untyped-call]

    return types.CPointer(types.float64)(count), code  # type: ignore[no-untyped-call]


@intrinsic
def widest(typing: Any) -> Any:
    """The signature and the code of `kernel.widest`, for which llvmlite has no name."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """LLVM's code: none; the kernel that calls it gets the attribute."""
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.none(), code


PRIMITIVES = {kernel.tail: tail_of, kernel.scratch: scratch_of, kernel.widest: widest}


def object_code(function: Any, prototype: Any) -> Code:
    """Object code of a kernel and all kernels it calls, as a C function with this prototype.

    Raises TypeError for a kernel that needs more than arithmetic and the mathematical library.
    """
    code = bitcode(function, prototype)
    return finish.object_code(code, finish.SYMBOL, function.__qualname__)


def bitcode(function: Any, prototype: Any) -> bytes:
    """LLVM bitcode of a kernel as a C function with this prototype, for any machine.

    Raises TypeError for what numba cannot type.
    """
    linecache.checkcache()  # numba shows lines from there; a file may have been edited meanwhile
    try:
        typed = signature(prototype, from_ctypes)
        with plain_code():
            compiled = cfunc(typed, **OPTIONS)(_with_inlined(function))
    except NumbaError as error:
        raise TypeError(in_short(str(error))) from error
    made = llvm.parse_assembly(compiled.inspect_llvm())
    made.get_function(compiled.native_name).name = finish.SYMBOL
    return finish.optimise_module(made, finish.SYMBOL)


# Settings of numba while it compiles kernels. It would optimise each kernel by itself, and again in
# the one that has it inlined. The others are a user's, of programs beside podusv: code that is not
# compiled, or has notes for debuggers and profilers in it, is no kernel.
SETTINGS = {"OPT": 0, "DISABLE_JIT": 0, "DEBUGINFO_DEFAULT": 0, "ENABLE_PROFILING": 0}


@contextmanager
def plain_code() -> Iterator[None]:
    """Have numba compile, and leave its code as it comes, whatever a user's NUMBA_* asks for.

    Its settings are global, so no other thread compiles meanwhile, and they are put back.
    """
    with global_compiler_lock:
        before = {name: getattr(config, name) for name in SETTINGS}
        for name, number in SETTINGS.items():
            setattr(config, name, type(before[name])(number))
        try:
            yield
        finally:
            for name, setting in before.items():
                setattr(config, name, setting)


@cache
def inline_kernel(function: Any) -> Any:
    """The kernel and all kernels it calls, as a numba function to be compiled into its caller."""
    if function in PRIMITIVES:
        return PRIMITIVES[function]
    return njit(**INNER)(_with_inlined(function))


def in_short(message: str) -> str:
    """What numba says of the innermost place in its `message`, in a line, and where that is.

    Its messages tell every level of calls, with paths and hints; one line is for the user.
    """
    reason = re.search(r"raised a specific error:\n +TypingError: (.*)", message)
    words = (
        reason[1]
        if reason
        else message.split("\n\nFile")[0].split("\nThere are")[0].split("\nDuring")[0]
    )
    kept = [line for line in words.splitlines() if not line.startswith("Failed in nopython mode")]
    place = re.search(r'^File "([^"]+)", line (\d+):\n(?:.*\n)*?(.*)\n +\^', message, re.MULTILINE)
    where = f" ({Path(place[1]).name}, line {place[2]}: {place[3].strip()})" if place else ""
    return f"{' '.join(' '.join(kept).split())}{where}"


def _with_inlined(function: Any) -> Any:
    """A copy of the kernel whose globals have numba functions in place of other kernels."""
    inner = {name: inline_kernel(called) for name, called in kernel.named_kernels(function).items()}
    return kernel.with_globals(function, function.__qualname__, **inner)


def signature(prototype: Any, type_of: Any) -> Any:
    """A prototype in numba's types; `type_of` gives that of what is no function."""

    def numba_type(kind: Any) -> Any:
        """numba's type for a type of ctypes; a function inside has a signature of its own."""
        if kind and issubclass(kind, ctypes._CFuncPtr):
            # numba wants a function from a Python object to its address, but never calls it here.
            return types.ExternalFunctionPointer(signature(kind, type_of), ctypes.addressof)
        return type_of(kind)

    return numba_type(prototype._restype_)(*map(numba_type, prototype._argtypes_))
