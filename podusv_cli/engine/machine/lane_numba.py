# mypy: disable-error-code="no-untyped-call"
"""Object code of kernels for lanes by numba."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

from numba import njit, types
from numba.core.typing.ctypes_utils import from_ctypes

from podusv_cli.core import kernel
from podusv_cli.core.errors import in_a_line
from podusv_cli.engine.machine import compile_numba
from podusv_cli.engine.machine.lane_kernels import everywhere, rewritten
from podusv_cli.engine.machine.lane_parts import PRIMITIVES, WORDS
from podusv_cli.engine.machine.lane_source import OtherSource, has_source
from podusv_cli.engine.machine.lane_types import FLOAT
from podusv_cli.engine.machine.object_cache import Code
from podusv_cli.engine.step import lane_march

AS_WRITTEN = (
    lane_march.advance_lanes, lane_march.end_lanes, lane_march.copy_lane, lane_march.follow_lane,
)  # fmt: skip
PLAIN = {*PRIMITIVES, *AS_WRITTEN}


def object_code(function: Any, prototype: Any) -> Code:
    """Object code of a kernel for lanes and all kernels it calls, or why there is none.

    numba may raise anything where a kernel does what its types for lanes have no code for. Raises
    TypeError where that need not be so the next time.
    """
    try:
        signature = compile_numba.signature(prototype, _type)
        return compile_numba.translated(function, _for_lanes, signature)
    except (OtherSource, MemoryError, OSError) as error:
        raise TypeError(in_a_line(error)) from error
    except TypeError as error:  # says what and where
        return Code("", " ".join(str(error).split()).encode())
    except Exception as error:
        return Code("", in_a_line(error).encode())


@cache
def inlined(function: Any) -> Any:
    """The kernel and all kernels it calls, as a numba function to be compiled into its caller."""
    if function in PRIMITIVES:
        return PRIMITIVES[function]
    return njit(**compile_numba.INNER)(_for_lanes(function))


def _for_lanes(function: Any) -> Any:
    """A copy of the kernel for lanes whose globals have numba functions in place of kernels."""
    made = function
    if function in AS_WRITTEN:
        made = everywhere(function, PLAIN)
    elif has_source(function):
        made = rewritten(function, WORDS, PLAIN)
    inner = {name: inlined(called) for name, called in kernel.named_kernels(made).items()}
    return kernel.with_globals(made, function.__qualname__, **inner)


def _type(kind: Any) -> Any:
    if kind and issubclass(kind, ctypes._Pointer):
        return types.CPointer(_type(kind._type_))
    return FLOAT if kind and issubclass(kind, ctypes.Array) else from_ctypes(kind)
