"""Kernels to machine code, cached on disk and never stale.

numba tells cached functions apart by name and byte code, and notices a change in the file of a
function, not in what that function calls. So the cache lives in a folder named after a digest of
every source file of the package, and the name of every cached function ends in a digest of all that
goes into its machine code: kernels of one name, laws that live elsewhere, and a process that
imported the source before it was edited do not get into each other's way.
"""

from __future__ import annotations

import dis
import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any

from numba import njit, types
from numba.core import cgutils
from numba.core import config as numba_config
from numba.extending import intrinsic

from podusv_cli import kernels
from podusv_cli.engine import signatures
from podusv_cli.engine.closed_loop import Plan, Wires, advance, evaluate_all
from podusv_cli.interrupts import interrupts_held

config: Any = numba_config  # its settings are made at run time
# Kernels are merged into their caller: to hand on a law's constants costs as much as the law.
OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": True}
OWN = re.compile(r"[0-9a-f]{16}")
KEPT = 8  # caches of this many states of the source stay on disk

NUMBERS = (bool, int, float, str, tuple)
NUMBER = types.float64
VECTOR: Any = types.CPointer(NUMBER)  # type: ignore[no-untyped-call]
ARRAY = types.Array(NUMBER, 1, "C")

SIGNATURES = {
    signatures.path_entry: types.void(NUMBER, *[VECTOR] * 3),
    signatures.disturbance_entry: types.void(NUMBER, *[VECTOR] * 4),
    signatures.law_entry: types.void(NUMBER, *[VECTOR] * 9),
    signatures.sample_entry: types.void(NUMBER, *[VECTOR] * 5),
    signatures.actuator_entry: types.void(NUMBER, *[VECTOR] * 8),
    signatures.observer_entry: types.void(NUMBER, NUMBER, *[VECTOR] * 4),
}
LOOP = (
    signatures.path_entry,
    signatures.disturbance_entry,
    signatures.law_entry,
    signatures.sample_entry,
    signatures.actuator_entry,
    signatures.observer_entry,
)


@intrinsic
def _tail(typing: Any, vector: Any, start: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.gep(arguments[0], [arguments[1]])

    return vector(vector, types.int64), code


@intrinsic
def _address(typing: Any, array: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return VECTOR(array), code


@intrinsic(prefer_literal=True)
def _scratch(typing: Any, count: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = context.get_value_type(NUMBER)
        return cgutils.alloca_once(builder, number, count.literal_value)  # type: ignore[no-untyped-call]

    return VECTOR(count), code


def ingredients(function: Any) -> Iterator[str]:
    """Everything that the machine code of a kernel depends on, the kernels it calls included."""
    code, seen = function.__code__, function.__globals__
    yield code.co_code.hex()
    yield repr([c for c in code.co_consts if not isinstance(c, CodeType)])
    yield repr((code.co_names, code.co_varnames))
    for name in sorted(_named(function) & seen.keys()):
        thing = seen[name]
        if kernels.is_kernel(thing):
            yield from ingredients(thing)
        else:
            yield repr(getattr(thing, "_fields", thing if isinstance(thing, NUMBERS) else name))


def fingerprint(*functions: Any) -> str:
    """A short digest of the ingredients of these kernels."""
    text = "\n".join(part for function in functions for part in ingredients(function))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _named(function: Any) -> set[str]:
    return {i.argval for i in dis.get_instructions(function) if i.opname == "LOAD_GLOBAL"}


PRIMITIVES = {
    kernels.tail: _tail,
    kernels.address: _address,
    kernels.scratch: _scratch,
}


@cache
def machine(function: Any) -> Any:
    """The kernel and all kernels it names, ready to be compiled into their caller."""
    if function in PRIMITIVES:
        return PRIMITIVES[function]
    seen = function.__globals__
    inner = {
        name: machine(seen[name]) for name in _named(function) if kernels.is_kernel(seen.get(name))
    }
    return njit(**OPTIONS)(kernels.with_globals(function, function.__qualname__, **inner))


@cache
def entry(door: Any, inner: Any, names: tuple[str, ...]) -> Any:
    """Machine code of a component's kernel behind its door, callable by the loop."""
    named = kernels.unpacker(names)
    label = f"{door.__name__}_{inner.__module__}_{inner.__qualname__}"
    bound = kernels.with_globals(door, label, kernel=machine(inner), named=machine(named))
    return _stored(SIGNATURES[door], _labelled(bound, fingerprint(door, inner, named)))


@cache
def march() -> Any:
    """Machine code of `closed_loop.advance`."""
    functions = [types.FunctionType(SIGNATURES[door]) for door in LOOP]
    wires = _tuple_of(ARRAY, Wires)
    plan = _tuple_of(types.int64, Plan)
    signature = types.int64(*functions, types.int64, types.int64, NUMBER, wires, plan)
    return _stored(signature, _labelled(machine(advance).py_func, fingerprint(advance)))


def _tuple_of(each: Any, kind: Any) -> Any:
    return types.NamedUniTuple(each, len(kind._fields), kind)  # type: ignore[no-untyped-call]


@cache
def replay() -> Any:
    """Machine code of `replay.evaluate_all`."""
    law = types.FunctionType(SIGNATURES[signatures.law_entry])
    signature = types.void(law, *[types.int64] * 3, *[ARRAY] * 5)
    return _stored(signature, _labelled(machine(evaluate_all).py_func, fingerprint(evaluate_all)))


def _labelled(function: Any, mark: str) -> Any:
    return kernels.with_globals(function, re.sub(r"\W", "_", f"{function.__qualname__}_{mark}"))


def _stored(signature: Any, function: Any) -> Any:
    folder = cache_folder()
    # An interrupt inside the compiler would be swallowed there, so it waits for a second or two.
    with _caching_in(folder), interrupts_held():
        return njit(signature, cache=folder is not None, **OPTIONS)(function)


@contextmanager
def _caching_in(folder: Path | None) -> Iterator[None]:
    # numba reads its cache folder when a function is decorated; other users of numba in this
    # process keep theirs.
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder or before)
    try:
        yield
    finally:
        config.CACHE_DIR = before


@cache
def source_digest() -> str:
    """Digest of every source file of the package."""
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parent.parent
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@cache
def cache_folder() -> Path | None:
    """Where compiled code of this state of the source is kept; None where nothing can be written.

    $PODUSV_CACHE, else podusv under $XDG_CACHE_HOME or ~/.cache, else under the temporary folder.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    private = f"podusv-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
    roots = [os.environ.get("PODUSV_CACHE"), f"{home}/podusv", f"{tempfile.gettempdir()}/{private}"]
    for root in filter(None, roots):
        folder = Path(root) / source_digest()
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            tempfile.TemporaryFile(dir=folder).close()
            if folder.stat().st_uid == os.getuid():  # never run code that someone else put there
                _forget_old(folder)
                return folder
    return None


def _forget_old(current: Path) -> None:
    # The folder may be shared: only what bears a digest's name is a cache.
    found = (path for path in current.parent.iterdir() if OWN.fullmatch(path.name))
    caches = sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)
    for old in [path for path in caches if path != current and path.is_dir()][KEPT:]:
        shutil.rmtree(old, ignore_errors=True)
