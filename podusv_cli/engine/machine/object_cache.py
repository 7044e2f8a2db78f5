"""Machine code on disk: found again by any later process, and never older than its source.

What is kept of a kernel is plain object code: it needs no Python and no numba, and loading it takes
llvmlite alone. The name of a kept piece ends in a digest of all that goes into it: the byte code
and constants of the kernel and of every kernel that it calls, the processor, the versions of what
translates. The pieces lie in a folder named after a digest of podusv's own files that translate. So
kernels of one name, laws that live elsewhere, machines that share a home, and a process that
imported the source before it was edited do not get into each other's way; and a comment, which
changes no byte code, compiles nothing anew.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache, singledispatch
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

from podusv_cli.process import code_folder

# The files of podusv that turn kernels into machine code, from the package's folder.
TRANSLATORS = ("core/kernel.py", "engine/machine/**/*.py")


class Code(NamedTuple):
    """Object code, and the name in it of the function to call.

    Without a name it is the reason why there is no object code, so that it is not tried again.
    """

    symbol: str
    content: bytes


def load_or_translate(prototype: Any, name: str, translate: Callable[[], Code]) -> Any:
    """The function of this name as ctypes calls it: found on disk, or translated and kept there.

    Raises TypeError with the reason where there is no object code.
    """
    code = code_from_cache(name, translate)
    if not code.symbol:
        raise TypeError(code.content.decode())
    return _load_code(prototype, code)


def code_from_cache(name: str, translate: Callable[[], Code]) -> Code:
    """The code of this name: found on disk, or translated and kept there."""
    path = _path(name)
    code = _read(path) if path else None
    if code is None:
        code = translate()
        if path:
            with suppress(OSError):  # a full disk costs the next process its time, no more
                _write(path, code)
    return code


def is_cached(name: str) -> bool:
    """Whether a piece of this name is on the disk."""
    path = _path(name)
    return bool(path and path.exists())


def keeps() -> bool:
    """Whether there is a folder for pieces."""
    return code_folder.code_folder(translators()) is not None


def _path(name: str) -> Path | None:
    """The file of this name in the folder of code; None without a folder."""
    folder = code_folder.code_folder(translators())
    return folder / f"{name}.code" if folder else None


def target() -> Any:
    """This machine, as LLVM takes it."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )


def _load_code(prototype: Any, code: Code) -> Any:
    """Object code as a function that ctypes calls with this prototype.

    LLVM's engine wants a module to begin with; an empty one will do.
    """
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code.content))
    engine.finalize_object()
    function = prototype(engine.get_function_address(code.symbol))
    function.engine = engine  # whose memory the code lies in
    return function


def _read(path: Path) -> Code | None:
    """The code in a file; None where there is none, or a damaged one."""
    with suppress(OSError):
        digest, _, rest = path.read_bytes().partition(b"\n")
        if _seal(path, rest) == digest:
            symbol, _, content = rest.partition(b"\n")
            return Code(symbol.decode(), content)
    return None


def _write(path: Path, code: Code) -> None:
    """Keep code in its file, behind the digest that seals it."""
    rest = code.symbol.encode() + b"\n" + code.content
    code_folder.write(path, _seal(path, rest) + b"\n" + rest)


def _seal(path: Path, rest: bytes) -> bytes:
    """Digest of a piece and of its name: whole, but under another's name, it is damaged."""
    return _digest(path.name.encode() + b"\0" + rest).encode()


def _digest(content: bytes) -> str:
    """The beginning of the SHA-256 in hex, long enough for a name."""
    return hashlib.sha256(content).hexdigest()[:16]


def fingerprint(function: Any) -> str:
    """A short digest of what the machine code of a kernel depends on."""
    return _digest("\n".join([*ingredients(function, {}), *_circumstances()]).encode())


@cache
def _circumstances() -> tuple[str, ...]:
    """What beside the kernel decides its machine code: settings, versions, processor."""
    settings = sorted(f"{k}={v}" for k, v in os.environ.items() if k.startswith("NUMBA_"))
    versions = [sys.version, version("llvmlite"), numba_version()]
    cpu = [llvm.get_process_triple(), llvm.get_host_cpu_name()]
    return (*settings, *versions, *cpu, llvm.get_host_cpu_features().flatten())


def numba_version() -> str:
    """The version of numba; empty without one, which podusv's own kernels do not need."""
    with suppress(PackageNotFoundError):
        return version("numba")
    return ""


def byte_code(function: Any) -> Iterator[str]:
    """A function by itself, as this version of Python runs it."""
    for code in _codes(function.__code__):
        yield code.co_code.hex()
        yield repr([c for c in code.co_consts if not isinstance(c, CodeType)])
        yield repr((code.co_names, code.co_varnames))


def ingredients(
    function: Any, numbered: dict[Any, int], alone: Callable[[Any], Iterable[str]] = byte_code
) -> Iterator[str]:
    """Everything that the machine code of a kernel depends on, the kernels it calls included.

    As texts, for a digest. `numbered` counts the functions and attributes of modules that came
    before, so that each is described once; `alone` describes a function by itself.
    """
    # Numbered before its parts are looked at, or a kernel that calls itself would have no end
    numbered[function] = len(numbered)
    yield from alone(function)
    # Names of attributes are among these names, too. That one of them may add to the digest what
    # the kernel does not use does no harm.
    names = sorted({name for code in _codes(function.__code__) for name in code.co_names})
    for name in names:
        yield name
        yield from _describe_thing(function.__globals__.get(name), names, numbered, alone)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function and of the functions inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


@singledispatch
def _describe_thing(
    thing: Any, names: Iterable[str], numbered: dict[Any, int], alone: Any
) -> Iterator[str]:
    """What stands behind a name of a function that uses these `names`, as texts.

    A class or a function of a library is described by its name. What has no name is described by
    its address at worst, and then compiled by each process anew.
    """
    called = getattr(thing, "__qualname__", getattr(thing, "__name__", ""))
    members = getattr(thing, "__members__", ())  # of an enumeration
    fields = getattr(thing, "_fields", ())  # of a named tuple
    yield repr((getattr(thing, "__module__", ""), called or thing, fields, members))
    if source := getattr(thing, "py_func", None):  # of what numba's own decorators made
        yield from _describe_thing(source, names, numbered, alone)


@_describe_thing.register
def _(
    thing: FunctionType, names: Iterable[str], numbered: dict[Any, int], alone: Any
) -> Iterator[str]:
    """A function: by its number where it came before, else by all that it depends on."""
    if thing in numbered:
        yield str(numbered[thing])
    else:
        yield from ingredients(thing, numbered, alone)


@_describe_thing.register
def _(
    thing: ModuleType, names: Iterable[str], numbered: dict[Any, int], alone: Any
) -> Iterator[str]:
    """A module, by what it has of these names: `settings.GAIN`."""
    yield thing.__name__
    for name in names:
        if (thing, name) not in numbered and hasattr(thing, name):
            numbered[thing, name] = len(numbered)
            yield name
            yield from _describe_thing(getattr(thing, name), names, numbered, alone)


@_describe_thing.register(tuple)
def _(thing: Any, names: Iterable[str], numbered: dict[Any, int], alone: Any) -> Iterator[str]:
    """A tuple, by its type and each item."""
    yield repr((type(thing).__qualname__, getattr(thing, "_fields", ()), len(thing)))
    for item in thing:
        yield from _describe_thing(item, names, numbered, alone)


@_describe_thing.register(np.ndarray)
@_describe_thing.register(np.generic)
def _(thing: Any, names: Iterable[str], numbered: dict[Any, int], alone: Any) -> Iterator[str]:
    """An array or number of numpy, by type, shape and bytes."""
    yield f"{thing.dtype}{thing.shape}{thing.tobytes().hex()}"


@cache
def translators(patterns: tuple[str, ...] = TRANSLATORS) -> str:
    """Digest of podusv's files that turn kernels into machine code."""
    package = Path(__file__).resolve().parents[2]
    files = sorted(path for pattern in patterns for path in package.glob(pattern))
    return _digest(b"\0".join(path.read_bytes() for path in files))
