"""Compiled code of kernels, loaded from the disk or compiled by numba.

numba is slow to import, so it is imported only for code that is not on the disk yet.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, cast

from podusv_cli.core.errors import LawError
from podusv_cli.engine.machine import object_cache, signatures
from podusv_cli.engine.machine.kernel_faults import check_kernel, unsupported
from podusv_cli.process.interrupts import interrupts_deferred

LANES_BY = "wide_numba"  # what compiles kernels for lanes
RULES = (
    "a kernel is marked with @kernel, reads and writes numbers of vectors one by one (x[2], "
    "tau[0] = ...), calls math.sin and the like and other kernels, and allocates, prints and "
    "raises nothing"
)


@cache
def entry(part: str, inner: Any, names: tuple[str, ...]) -> Any:
    """The compiled kernel `inner` of a component, callable by the loop as this part.

    `names` are those of the component's constants. Raises LawError for a kernel that cannot be
    compiled, or that would read what is not there.
    """
    check_kernel(inner)
    label = f"{part}_entry_{inner.__module__}_{inner.__qualname__}"
    bound = signatures.bind(part, inner, names)
    try:
        return compiled(bound, signatures.PROTOTYPES[part], label)
    except TypeError as error:
        place = f"{Path(inner.__code__.co_filename).name}, line {inner.__code__.co_firstlineno}"
        reason = unsupported(inner) or f"{error}; {RULES}"
        raise LawError(
            f"kernel {inner.__qualname__} ({place}) cannot become machine code: {reason}"
        ) from error


@cache
def lane_entry(part: str, inner: Any, names: tuple[str, ...], alike: frozenset[str]) -> Any:
    """The same with a run in every lane; constants in `alike` are the same in all of them.

    Raises TypeError for a kernel that cannot go another way in every lane.
    """
    return compiled(*_lane_adapter(part, inner, names, alike), LANES_BY)


def has_lanes(
    parts: Sequence[tuple[str, Any, tuple[str, ...], frozenset[str]]], march: Any
) -> bool:
    """Whether all of these parts are compiled for lanes, and the march."""
    adapters = [_lane_adapter(*part) for part in parts]
    pieces = [(function, label) for function, _, label in adapters]
    return all(object_cache.is_kept(_name(*piece)) for piece in (*pieces, (march, "")))


def _lane_adapter(
    part: str, inner: Any, names: tuple[str, ...], alike: frozenset[str]
) -> tuple[Any, Any, str]:
    label = f"lanes_{part}_entry_{inner.__module__}_{inner.__qualname__}"
    bound = signatures.bind(part, inner, names, alike)
    return bound, signatures.LANE_PROTOTYPES[part], label


@cache
def routine(function: Any, prototype: Any, compiler: str = "compile_numba") -> Any:
    """A compiled kernel of the engine itself."""
    return compiled(function, prototype, compiler=compiler)


def compiled(
    function: Any, prototype: Any, label: str = "", compiler: str = "compile_numba"
) -> Any:
    """The kernel as a compiled C function with this ctypes prototype.

    `compiler` is the module that makes its object code, imported only where there is none yet.

    Raises TypeError for a kernel that needs more than arithmetic and the mathematical library.
    """

    def compile_now() -> object_cache.Code:
        # The compiler would swallow an interrupt, so interrupts wait for it, a second or two.
        with interrupts_deferred():
            module = import_module(f"podusv_cli.engine.machine.{compiler}")
            return cast(object_cache.Code, module.object_code(function, prototype))

    return object_cache.stored(prototype, _name(function, label), compile_now)


def _name(function: Any, label: str) -> str:
    name = f"{label or function.__qualname__}_{object_cache.fingerprint(function)}"
    return re.sub(r"\W", "_", name)
