"""Object code of kernels for lanes by numba."""

from __future__ import annotations

import ctypes
import dis
import linecache
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba import cfunc, njit, types
from numba.core.errors import NumbaError
from numba.core.typing.ctypes_utils import from_ctypes

from podusv_cli.core import kernel
from podusv_cli.engine import lane_march, lane_parts
from podusv_cli.engine.compile_numba import INNER, OPTIONS, _check_calls, _in_short
from podusv_cli.engine import compile_numba
from podusv_cli.engine.lane_kernels import has_source, rewritten
from podusv_cli.engine.lane_types import FLOAT
from podusv_cli.engine.object_cache import Code, target

AS_WRITTEN = {lane_march.advance_lanes: lane_parts, lane_march.bury: lane_parts}
PLAIN = {*lane_parts.PRIMITIVES, *AS_WRITTEN}


def object_code(function: Any, prototype: Any) -> Code:
    linecache.checkcache()
    try:
        compiled = cfunc(_signature(prototype), **OPTIONS)(as_numba(function))
    except NumbaError as error:
        raise TypeError(_in_short(str(error))) from error
    module = llvm.parse_assembly(compiled.inspect_llvm())
    _check_calls(module, function.__qualname__)
    return Code(compiled.native_name, target().emit_object(module)), module


@cache
def inlined(function: Any) -> Any:
    if function in lane_parts.PRIMITIVES:
        return lane_parts.PRIMITIVES[function]
    return njit(**INNER)(as_numba(function))


def as_numba(function: Any) -> Any:
    written = function in AS_WRITTEN or not has_source(function)
    made = function if written else rewritten(function, lane_parts.WORDS, PLAIN)
    outer = made.__globals__
    named = {i.argval for i in dis.get_instructions(function) if i.opname == "LOAD_GLOBAL"}
    inner = {name: inlined(outer[name]) for name in named if kernel.is_kernel(outer.get(name))}
    if function in AS_WRITTEN:
        inner |= {n: getattr(lane_parts, n) for n in named if n.startswith("lane")}
    if function is lane_march.bury:
        inner["tail"] = lane_parts.PRIMITIVES[kernel.tail]
    return kernel.with_globals(made, function.__qualname__, **inner)


def _signature(prototype: Any) -> Any:
    arguments = [_type(kind) for kind in prototype._argtypes_]
    return _type(prototype._restype_)(*arguments)


def _type(kind: Any) -> Any:
    if kind and issubclass(kind, ctypes._CFuncPtr):
        return types.ExternalFunctionPointer(_signature(kind), ctypes.addressof)
    if kind and issubclass(kind, ctypes._Pointer):
        return types.CPointer(_type(kind._type_))
    if kind and issubclass(kind, ctypes.Array):
        return FLOAT
    return from_ctypes(kind)
