"""Kernels of podusv's own that come with it as LLVM bitcode, so that a first run needs no numba.

They lie in one file, under a digest of the source of a kernel and of all that it calls or reads,
which is the same in every version of Python. What other files of podusv made, or a newer LLVM, is
not used: numba makes it then.
"""

from __future__ import annotations

import ctypes
import hashlib
import inspect
import json
import linecache
import lzma
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from podusv_cli.core.plugins import TEXT
from podusv_cli.engine.machine import kernel_source, object_cache

FILE = Path(__file__).with_name("kernels.xz")
# The files of podusv that make bitcode, from the package's folder.
MAKERS = (
    "core/kernel.py",
    "engine/machine/compile_numba.py",
    "engine/machine/finish.py",
    "engine/machine/wide/*.py",
)


def bitcode(function: Any, prototype: Any, compiler: str) -> bytes | None:
    """The bitcode of this kernel as a C function with this prototype, if it came with podusv."""
    # A digest reads the source of all that a kernel calls: not for a file that has nothing
    return _kernels().get(digest(function, prototype, compiler)) if _kernels() else None


@cache
def digest(function: Any, prototype: Any, compiler: str) -> str:
    """The digest of a kernel, its C prototype and its compiler, under which it is kept.

    Empty where the kernel's file is gone, or edited since it was loaded.
    """
    try:
        words = [
            compiler,
            _name_type(prototype),
            *object_cache.ingredients(function, {}, source_of),
        ]
    except (OSError, kernel_source.OtherSource):
        return ""
    return hashlib.sha256("\n".join(words).encode()).hexdigest()[:16]


@cache
def _kernels() -> Mapping[str, bytes]:
    """The bitcode of all kernels by digest.

    No kernels where the file is missing or damaged, or made by other files of podusv than are here.
    """
    with suppress(OSError, lzma.LZMAError, ValueError, TypeError):
        head, _, body = lzma.decompress(FILE.read_bytes()).partition(b"\n")
        makers, version, sizes = json.loads(head)
        # A newer LLVM reads the bitcode of an older one, not the other way round.
        if makers == object_cache.translators(MAKERS) and tuple(version) <= llvm.llvm_version_info:
            ends = [*accumulate(sizes.values())]
            begins = [0, *ends[:-1]]
            return {name: body[a:b] for name, a, b in zip(sizes, begins, ends, strict=True)}
    return {}


def write(kernels: Mapping[str, bytes]) -> None:
    """Make the file of the bitcode of kernels, by their digests."""
    sizes = {name: len(code) for name, code in kernels.items()}
    head = [object_cache.translators(MAKERS), llvm.llvm_version_info, sizes]
    whole = json.dumps(head).encode() + b"\n" + b"".join(kernels.values())
    FILE.write_bytes(lzma.compress(whole, preset=9))


def source_of(function: Any) -> tuple[str, ...]:
    """Name and text of a function as its file has it.

    Of one that podusv wrote out itself, name, line and the whole text. Raises OSError without a
    file, OtherSource for one that was edited.
    """
    code = function.__code__
    if (text := function.__globals__.get(TEXT)) is not None:
        return code.co_name, str(code.co_firstlineno), text
    kernel_source.check_source(function)  # the digest is of the text, and the byte code runs
    lines = linecache.getlines(code.co_filename)[code.co_firstlineno - 1 :]
    if not lines:
        raise OSError(f"{code.co_filename} has no line {code.co_firstlineno}")
    return code.co_name, "".join(inspect.getblock(lines))


def _name_type(kind: Any) -> str:
    """A type of ctypes in words that are alike on all systems, where ctypes' own names differ."""
    if kind is None:
        return "none"
    if issubclass(kind, ctypes._CFuncPtr):  # type: ignore[attr-defined]
        return f"{_name_type(kind._restype_)}({','.join(map(_name_type, kind._argtypes_))})"
    if issubclass(kind, ctypes._Pointer):
        return f"{_name_type(kind._type_)}*"
    if issubclass(kind, ctypes.Array):
        return f"{kind._length_}x{_name_type(kind._type_)}"
    return f"{'f' if kind is ctypes.c_double else 'i'}{ctypes.sizeof(kind)}"
