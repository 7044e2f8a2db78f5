"""Kernels as machine code: the parts of a loop, the march, the replay.

numba, which is slow to import, is needed only for what is not on disk yet.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import LawError
from podusv_cli.engine import object_cache, signatures
from podusv_cli.engine.closed_loop import advance, evaluate_all, rates_along
from podusv_cli.process.interrupts import interrupts_held

RULES = (
    "a kernel is marked with @kernel, reads and writes numbers of vectors one by one (x[2], "
    "tau[0] = ...), calls math.sin and the like and other kernels, and allocates, prints and "
    "raises nothing"
)


@cache
def entry(door: Any, inner: Any, names: tuple[str, ...]) -> Any:
    """Machine code of a component's kernel behind its door, callable by the loop.

    Raises LawError for a kernel that cannot become machine code.
    """
    label = f"{door.__name__}_{inner.__module__}_{inner.__qualname__}"
    bound = signatures.bind(door, inner, names)
    try:
        return compiled(bound, signatures.PROTOTYPES[door], label)
    except TypeError as error:
        place = f"{Path(inner.__code__.co_filename).name}, line {inner.__code__.co_firstlineno}"
        raise LawError(
            f"kernel {inner.__qualname__} ({place}) cannot become machine code: {error}; {RULES}"
        ) from error


@cache
def march() -> Any:
    """Machine code of `closed_loop.advance`."""
    return compiled(advance, signatures.ADVANCE)


@cache
def replay() -> Any:
    """Machine code of `closed_loop.evaluate_all`."""
    return compiled(evaluate_all, signatures.EVALUATE_ALL)


@cache
def rates_replay() -> Any:
    """Machine code of `closed_loop.rates_along`."""
    return compiled(rates_along, signatures.RATES_ALONG)


def compiled(function: Any, prototype: Any, label: str = "") -> Any:
    """Machine code of a kernel as a function of C's calling convention, of this ctypes prototype.

    Raises TypeError for a kernel that needs more than arithmetic and the mathematical library.
    """
    name = f"{label or function.__qualname__}_{object_cache.fingerprint(function)}"

    def translate() -> object_cache.Code:
        from podusv_cli.engine import compile_numba

        # An interrupt inside the compiler would be swallowed there, so it waits a second or two.
        with interrupts_held():
            return compile_numba.translate(function, prototype)

    return object_cache.stored(prototype, re.sub(r"\W", "_", name), translate)
