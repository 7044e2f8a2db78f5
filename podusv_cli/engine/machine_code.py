"""Machine code on disk: found again by any later process, and never older than its source.

What is kept of a kernel is plain object code: it needs no Python and no numba, and loading it takes
llvmlite alone. The name of a kept piece ends in a digest of all that goes into it: the byte code
and constants of the kernel and of every kernel that it calls, the processor, the versions of what
translates. The pieces lie in a folder named after a digest of the source files that can hold
kernels. So kernels of one name, laws that live elsewhere, machines that share a home, and a process
that imported the source before it was edited do not get into each other's way.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

from podusv_cli import kernels
from podusv_cli.parts import forget_files, part_name

OWN = re.compile(r"[0-9a-f]{16}")
KEPT = 8  # caches of this many states of the source stay on disk
NUMBERS = (bool, int, float, str, tuple)
# Rooms and files that hold no kernel: what is edited there leaves machine code as it is.
APART = (
    "cli", "comparison", "config", "figures", "findings", "logbook", "repetition", "verification",
    "comparing.py", "plotting.py", "repeating.py", "running.py", "verifying.py", "workflows.py",
)  # fmt: skip


class Code(NamedTuple):
    """Object code, and the name in it of the function to call."""

    symbol: str
    content: bytes


def stored(prototype: Any, name: str, translate: Callable[[], Code]) -> Any:
    """The function of this name as ctypes calls it: found on disk, or translated and kept there."""
    folder = cache_folder()
    path = folder / f"{name}.code" if folder else None
    code = _read(path) if path else None
    if code is None:
        code = translate()
        if path:
            with suppress(OSError):  # a full disk costs the next process its time, no more
                _write(path, code)
    return _loaded(prototype, code)


def target() -> Any:
    """This machine, as LLVM takes it."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )


def _loaded(prototype: Any, code: Code) -> Any:
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code.content))
    engine.finalize_object()
    function = prototype(engine.get_function_address(code.symbol))
    function.engine = engine  # whose memory the code lies in
    return function


def _read(path: Path) -> Code | None:
    with suppress(OSError):
        digest, _, rest = path.read_bytes().partition(b"\n")
        if _seal(path, rest) == digest:
            symbol, _, content = rest.partition(b"\n")
            return Code(symbol.decode(), content)
    return None


def _write(path: Path, code: Code) -> None:
    rest = code.symbol.encode() + b"\n" + code.content
    part = path.with_name(part_name())
    try:
        part.write_bytes(_seal(path, rest) + b"\n" + rest)
        os.replace(part, path)  # whole, whoever else writes or reads it now
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _seal(path: Path, rest: bytes) -> bytes:
    """Digest of a piece and of its name: whole, but under another's name, it is damaged."""
    return _digest(path.name.encode() + b"\0" + rest).encode()


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def fingerprint(function: Any) -> str:
    """A short digest of what the machine code of a kernel depends on."""
    return _digest("\n".join([*ingredients(function, {}), *_circumstances()]).encode())


@cache
def _circumstances() -> tuple[str, ...]:
    settings = sorted(f"{k}={v}" for k, v in os.environ.items() if k.startswith("NUMBA_"))
    versions = [version(package) for package in ("numba", "llvmlite")]
    cpu = [llvm.get_process_triple(), llvm.get_host_cpu_name()]
    return (*settings, *versions, *cpu, llvm.get_host_cpu_features().flatten())


def ingredients(function: Any, told: dict[Any, int]) -> Iterator[str]:
    """Everything that the machine code of a kernel depends on, the kernels it calls included.

    `told` counts the kernels that have been told already.
    """
    told[function] = len(told)
    code, outside = function.__code__, function.__globals__
    yield code.co_code.hex()
    yield repr([c for c in code.co_consts if not isinstance(c, CodeType)])
    yield repr((code.co_names, code.co_varnames))
    # Names of attributes are among these names, too. That one of them may add to the digest what
    # the kernel does not use does no harm.
    for name in code.co_names:
        thing = outside.get(name)
        if not kernels.is_kernel(thing):
            yield _described(thing)
        elif thing in told:
            yield str(told[thing])
        else:
            yield from ingredients(thing, told)


def _described(thing: Any) -> str:
    """A number by its value, a named tuple by its fields, anything else by what it is called."""
    if thing is None or isinstance(thing, NUMBERS):
        return repr(thing)
    if isinstance(thing, np.ndarray):
        return f"{thing.dtype}{thing.shape}{thing.tobytes().hex()}"
    called = getattr(thing, "__qualname__", getattr(thing, "__name__", ""))
    return repr((getattr(thing, "__module__", ""), called, getattr(thing, "_fields", ())))


@cache
def source_digest() -> str:
    """Digest of every source file that can hold a kernel or turns kernels into machine code."""
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parent.parent
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package)
        if name.parts[0] not in APART:
            digest.update(name.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@cache
def cache_folder() -> Path | None:
    """Where compiled code of this state of the source is kept; None where nothing can be written.

    $PODUSV_CACHE, else podusv under $XDG_CACHE_HOME or ~/.cache, else under the temporary folder.
    """
    for root in _roots():
        folder = Path(root) / source_digest()
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            tempfile.TemporaryFile(dir=folder).close()
            if folder.stat().st_uid == os.getuid():  # never run code that someone else put there
                _forget_old(folder)
                forget_files(folder)
                return folder
    return None


def _roots() -> Iterator[str]:
    if given := os.environ.get("PODUSV_CACHE"):
        yield given
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if os.path.isabs(home):  # without a home it is `~`, which is no place to make a folder
        yield f"{home}/podusv"
    private = f"podusv-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
    yield f"{tempfile.gettempdir()}/{private}"


def _forget_old(current: Path) -> None:
    # The folder may be shared: only what bears a digest's name is a cache.
    found = (path for path in current.parent.iterdir() if OWN.fullmatch(path.name))
    caches = sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)
    for old in [path for path in caches if path != current and path.is_dir()][KEPT:]:
        shutil.rmtree(old, ignore_errors=True)
