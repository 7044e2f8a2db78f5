# mypy: disable-error-code="no-untyped-call,attr-defined"
"""Object code of kernels for lanes: numba makes scalar code, which `widening` widens."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.errors import NumbaError
from numba.core.typing.ctypes_utils import from_ctypes
from numba.extending import intrinsic

from podusv_cli.core import kernel
from podusv_cli.core.errors import in_a_line
from podusv_cli.engine.machine import compile_numba, finish
from podusv_cli.engine.machine.object_cache import Code
from podusv_cli.engine.machine.signatures import LANE_VECTOR
from podusv_cli.engine.machine.wide import widening
from podusv_cli.engine.machine.wide.masks import LANES_MEMORY, PLAIN_MEMORY
from podusv_cli.engine.machine.wide.scalar_ir import NotForLanes


def object_code(function: Any, prototype: Any) -> Code:
    """Object code of a kernel for lanes and all kernels it calls, or why there is none.

    Another version of numba or llvmlite may fail in any way; runs then march one by one. Raises
    TypeError where that need not be so the next time.
    """
    try:
        code = bitcode(function, prototype)
        return finish.object_code(code, widening.NAME, function.__qualname__)
    except (MemoryError, OSError) as error:
        raise TypeError(in_a_line(error)) from error
    except NumbaError as error:
        return Code("", compile_numba.in_short(str(error)).encode())
    except NotForLanes as error:
        return Code("", f"its machine code cannot be widened: {error}".encode())
    except TypeError as error:  # says what and where
        return Code("", str(error).encode())
    except Exception as error:
        versions = f"numba {numba.__version__}, llvmlite {llvmlite.__version__}"
        reason = f"its machine code cannot be widened: {in_a_line(error)}; {versions}"
        return Code("", reason.encode())


def bitcode(function: Any, prototype: Any) -> bytes:
    """LLVM bitcode of a kernel for lanes, as a C function with this prototype, for any machine.

    Raises what `object_code` gives as a reason.
    """
    signature = compile_numba.signature(prototype, _type)
    with compile_numba.plain_code():  # which `widening` works on
        compiled = njit(**compile_numba.INNER)(_with_inlined(function))
        compiled.compile(signature.args)
    scalar = compiled.overloads[signature.args]
    module = llvm.parse_assembly(scalar.library.get_llvm_str())
    memory = [_memory(kind) for kind in prototype._argtypes_]
    result = "i64" if prototype._restype_ else ""
    name = scalar.fndesc.llvm_func_name
    machine = finish.neutral_machine()
    made = widening.widen_module(module, name, memory, result, machine)
    return finish.bare(made, widening.NAME)


def _type(kind: Any) -> Any:
    """numba's type of an argument of scalar code."""
    if kind and issubclass(kind, ctypes._Pointer):
        return types.CPointer(_type(kind._type_))
    return types.float64 if kind and issubclass(kind, ctypes.Array) else from_ctypes(kind)


def _memory(kind: Any) -> str:
    """The kind of memory that an argument of this type points at; "" for a number."""
    if kind is LANE_VECTOR:
        return LANES_MEMORY
    return PLAIN_MEMORY if issubclass(kind, (ctypes._Pointer, ctypes._CFuncPtr)) else ""


def _mark(name: str, result: Any = None) -> Any:
    """A call that numba's code has for a primitive of `core.kernel`, and that widening replaces.

    Returns a function from the types given to the call's own type and code. It has the type of its
    first argument, unless `result` is another.
    """

    def type_mark(given: Any) -> Any:
        """Type and code of a call that stands for something until the IR is widened."""
        kinds = [types.unliteral(kind) for kind in given]
        back = result or kinds[0]

        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            """A call of `podusv.NAME`, without effects, so that the optimiser may move it."""
            kind = ir.FunctionType(context.get_value_type(back), [a.type for a in arguments])
            called = cgutils.get_or_insert_function(builder.module, kind, f"podusv.{name}")
            called.attributes.add("readnone")
            called.attributes.add("nounwind")
            return builder.call(called, arguments)

        return back(*kinds), code

    llvm.add_symbol(f"podusv.{name}", 1)  # numba links its code, too, which nobody calls
    return type_mark


SHARED, ANY = _mark("shared"), _mark("lanes_any", types.boolean)
TRUE, NUMBERS = _mark("lane_true", types.boolean), _mark("lane_numbers")


@intrinsic
def _count_unpadded(typing: Any, whole: Any, count: Any) -> Any:
    """`kernel.padded_rounds`: a register holds several lanes, and no rounds."""
    return types.int64(types.int64, types.int64), lambda c, b, s, arguments: arguments[1]


PRIMITIVES = compile_numba.PRIMITIVES | {
    kernel.padded_rounds: _count_unpadded,
    kernel.shared: intrinsic(lambda typing, number: SHARED([number])),
    kernel.lanes_any: intrinsic(lambda typing, mask: ANY([mask])),
    kernel.lane_true: intrinsic(lambda typing, mask, lane: TRUE([mask, lane])),
    kernel.lane_numbers: intrinsic(lambda typing, vector: NUMBERS([vector])),
}


@cache
def inline_wide(function: Any) -> Any:
    """The kernel and all kernels it calls, as a numba function to be compiled into its caller."""
    if function in PRIMITIVES:
        return PRIMITIVES[function]
    return njit(**compile_numba.INNER)(_with_inlined(function))


def _with_inlined(function: Any) -> Any:
    """A copy of the kernel whose globals have numba functions in place of other kernels."""
    named = kernel.named_kernels(function)
    place = function.__code__.co_filename
    ours = place.startswith("<") or function.__module__.startswith("podusv_cli.")
    if kernel.shared in named.values() and not ours:
        line = f"{Path(place).name}, line {function.__code__.co_firstlineno}"
        raise TypeError(
            f"{line}: shared is for podusv's own kernels, whose runs are sorted by what is shared"
        )
    inner = {name: inline_wide(called) for name, called in named.items()}
    return kernel.with_globals(function, function.__qualname__, **inner)
