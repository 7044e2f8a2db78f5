"""The signatures of `signatures` where every number of a vector is one number a lane."""

from __future__ import annotations

import ast
import dis
import linecache
import textwrap
from collections.abc import Iterator, Set
from ctypes import CFUNCTYPE, POINTER
from functools import cache
from typing import Any

from podusv_cli.core.kernel import LANES, constants_type, is_kernel, kernel, shared
from podusv_cli.engine.signatures import NUMBER, SIGNATURES, VECTOR, WHOLE

LANE_VECTOR = POINTER(NUMBER * LANES)
PROTOTYPES: dict[str, Any] = {
    part: CFUNCTYPE(
        None, *(NUMBER if a in ("t", "weight") else LANE_VECTOR for a in arguments.split())
    )
    for part, arguments in SIGNATURES.items()
}
ADVANCE_LANES = CFUNCTYPE(
    WHOLE, *PROTOTYPES.values(), WHOLE, WHOLE, NUMBER, POINTER(LANE_VECTOR), POINTER(WHOLE),
    WHOLE, VECTOR, VECTOR,
)  # fmt: skip


def has_source(function: Any) -> bool:
    """Whether a kernel is from a file; those that podusv writes out itself have no branches."""
    return not function.__code__.co_filename.startswith("<")


def bind(part: str, inner: Any, names: tuple[str, ...], alike: Set[str]) -> Any:
    """The door of a part for lanes; constants in `alike` are the same in all lanes."""
    arguments = SIGNATURES[part].split()
    fields = ", ".join(
        f"shared(p[{i}])" if name in alike else f"p[{i}]" for i, name in enumerate(names)
    )
    inside: dict[str, Any] = {"Constants": constants_type(names), "shared": shared}
    exec(f"def named(p):\n    return Constants({fields})", inside)  # noqa: S102
    passed = ["named(p)" if a == "p" else a for a in arguments]
    passed = ["None", *passed] if has_source(inner) else passed  # its mask: all lanes
    scope: dict[str, Any] = {"kernel": inner, "named": kernel(inside["named"])}
    exec(f"def {part}_entry({', '.join(arguments)}):\n    kernel({', '.join(passed)})", scope)  # noqa: S102
    return scope[f"{part}_entry"]


@cache
def whole_numbers(function: Any) -> frozenset[str]:
    """Constants that a kernel, or one that it calls, makes whole numbers of: `int(k.count)`."""
    return frozenset(_whole_numbers(function, set()))


def _whole_numbers(function: Any, done: set[Any]) -> Iterator[str]:
    if function in done:
        return
    done.add(function)
    for node in ast.walk(_tree(function)):
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id == "int"
            and isinstance(node.args[0], ast.Attribute)
        ):
            yield node.args[0].attr
    for instruction in dis.get_instructions(function):
        called = function.__globals__.get(instruction.argval) if instruction.opname == "LOAD_GLOBAL" else None
        if is_kernel(called):
            yield from _whole_numbers(called, done)


def _tree(function: Any) -> ast.AST:
    code = function.__code__
    lines = linecache.getlines(code.co_filename)
    if not lines:
        return ast.Module([], [])
    import inspect

    block = inspect.getblock(lines[code.co_firstlineno - 1 :])
    return ast.parse(textwrap.dedent("".join(block)))
