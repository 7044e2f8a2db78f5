"""Compiled code of kernels, loaded from the disk or compiled by numba.

numba is slow to import, so it is imported only for code that is not on the disk yet.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, cast

from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.engine.machine import finish, object_cache, shipped, signatures
from podusv_cli.engine.machine.kernel_faults import check_kernel, unsupported_construct
from podusv_cli.process.interrupts import interrupts_deferred
from podusv_cli.process.workers import available_workers, run_all, workers_inherit

# What compiles kernels for a run, and for lanes
ALONE_BY, LANES_BY = "compile_numba", "wide.object_code"
SYMBOLS = {ALONE_BY: finish.SYMBOL, LANES_BY: "podusv_lanes"}
NO_NUMBA = (
    "its machine code does not come with podusv, and numba, which makes it, cannot be imported"
)
SHARE = 40_000  # size of what a process of its own compiles at least: about 3 s
RULES = (
    "a kernel is marked with @kernel and reads and writes numbers of vectors one by one (x[2], "
    "tau[0] = ...); it calls functions of math and other kernels; it allocates, prints and raises "
    "nothing"
)


class NoTranslator(TypeError):
    """Nothing is wrong with a kernel, but nothing here can compile it."""


class Piece(NamedTuple):
    """A kernel that becomes a C function with this prototype, and what its name begins with.

    `compiler` is the module that makes its object code, imported only where there is none yet.
    """

    function: Any
    prototype: Any
    label: str = ""
    compiler: str = ALONE_BY

    @property
    def name(self) -> str:
        """The name under which its code is kept."""
        return _kept_as(self)

    @property
    def size(self) -> int:
        """How much there is to compile, as the length of all byte code."""
        return sum(map(len, object_cache.ingredients(self.function, {})))

    @property
    def shipped_bitcode(self) -> bytes | None:
        """Its bitcode, if it came with podusv."""
        return shipped.bitcode(self.function, self.prototype, self.compiler)

    def bitcode(self) -> bytes:
        """LLVM bitcode that suits any machine: what came with podusv, or what numba makes now.

        Raises TypeError for a kernel that cannot become machine code, and without numba.
        """
        # The compiler would swallow an interrupt, so interrupts wait for it, a second or two.
        with interrupts_deferred():
            made = self.shipped_bitcode or self.translator().bitcode(self.function, self.prototype)
            return cast(bytes, made)

    def compile(self) -> object_cache.Code:
        """Its object code. Raises TypeError as `bitcode`."""
        with interrupts_deferred():
            if ready := self.shipped_bitcode:
                name = self.function.__qualname__
                return finish.object_code(ready, SYMBOLS[self.compiler], name)
            made = self.translator().object_code(self.function, self.prototype)
            return cast(object_cache.Code, made)

    def translator(self) -> Any:
        """The module that makes its code. Raises NoTranslator where numba cannot be imported."""
        try:
            return import_module(f"podusv_cli.engine.machine.{self.compiler}")
        except ImportError as error:
            raise NoTranslator(f"{NO_NUMBA} ({in_a_line(error)}); pip install numba") from error


@cache  # it reads all byte code of a piece
def _kept_as(piece: Piece) -> str:
    """The name of a piece's file: its label, and the digest of all that goes into it."""
    name = piece.label or piece.function.__qualname__
    return re.sub(r"\W", "_", f"{name}_{object_cache.fingerprint(piece.function)}")


def prepare(pieces: Sequence[Piece], tell: Callable[[float], None] | None = None) -> None:
    """Have the code of these pieces on the disk, compiled by as many processes as there are cores.

    Where processes begin empty this one compiles: a kernel is no thing that crosses as bytes.
    Pieces go to processes largest first, each to that with the least to do.

    `tell` is called with the fraction that is compiled, if there is anything to compile. A piece
    that cannot be compiled is left to `compile_piece`, which says why. Raises KeyboardInterrupt.
    """
    missing = [piece for piece in pieces if not object_cache.is_cached(piece.name)]
    if not (missing and object_cache.keeps()):
        return
    sizes = {piece: piece.size for piece in missing}
    whole = sum(sizes.values())
    most = min(available_workers(), whole // SHARE) if workers_inherit() else 1
    shares: list[list[Piece]] = [[] for _ in range(max(1, most))]
    for piece in sorted(missing, key=lambda piece: -sizes[piece]):
        min(shares, key=lambda share: sum(sizes[other] for other in share)).append(piece)
    done = [0.0] * len(shares)

    def advance(share: int, size: float) -> None:
        """Note how much of its share (in bytes of byte code) a process has compiled."""
        done[share] = size
        if tell:
            tell(sum(done) / whole)

    # Told at once, since the first piece may take seconds
    advance(0, 0.0)
    for piece in missing:
        if not piece.shipped_bitcode:  # numba is needed, and then imported once, before the forks
            with suppress(TypeError):  # `compile_piece` says that it is missing
                piece.translator()
    if len(shares) == 1:
        _keep(shares[0], partial(advance, 0))
        return
    outcomes = run_all([partial(_keep, share) for share in shares], advance)
    if any(outcome.interrupted for outcome in outcomes):
        raise KeyboardInterrupt


def _keep(pieces: Sequence[Piece], tell: Callable[[float], None]) -> None:
    """Compile pieces one by one, and tell the size of what is compiled so far.

    One that cannot be compiled is passed over, see `prepare`.
    """
    done = 0
    for piece in pieces:
        with suppress(TypeError):
            object_cache.code_from_cache(piece.name, piece.compile)
        done += piece.size
        tell(float(done))


@cache
def adapter(part: str, inner: Any, names: tuple[str, ...]) -> Piece:
    """The kernel `inner` of a component as what the loop calls as this part.

    `names` are those of the component's constants. Raises LawError for a kernel that would read
    what is not there.
    """
    check_kernel(inner)
    label = f"{part}_entry_{inner.__module__}_{inner.__qualname__}"
    return Piece(signatures.bind(part, inner, names), signatures.PROTOTYPES[part], label)


@cache
def entry(part: str, inner: Any, names: tuple[str, ...]) -> Any:
    """As `adapter`, compiled to a C function. Raises LawError also where that cannot be.

    The message has what in its source has no machine code, else what the compiler says.
    """
    try:
        return compile_piece(adapter(part, inner, names))
    except TypeError as error:
        place = f"{Path(inner.__code__.co_filename).name}, line {inner.__code__.co_firstlineno}"
        is_faulty = not isinstance(error, NoTranslator)
        reason = (
            is_faulty and unsupported_construct(inner)
        ) or f"{error}{f'; {RULES}' if is_faulty else ''}"
        raise LawError(
            f"kernel {inner.__qualname__} ({place}) cannot become machine code: {reason}"
        ) from error


@cache
def lane_adapter(part: str, inner: Any, names: tuple[str, ...], alike: frozenset[str]) -> Piece:
    """As `adapter`, with a run in every lane; constants in `alike` are the same in all of them."""
    check_kernel(inner)
    label = f"lanes_{part}_entry_{inner.__module__}_{inner.__qualname__}"
    bound = signatures.bind(part, inner, names, alike)
    return Piece(bound, signatures.LANE_PROTOTYPES[part], label, LANES_BY)


@cache
def routine(piece: Piece) -> Any:
    """The compiled kernel, loaded once. Raises TypeError as `compile_piece`."""
    return compile_piece(piece)


def compile_piece(piece: Piece) -> Any:
    """A kernel as ctypes calls it, compiled unless its code is on the disk.

    Raises TypeError for a kernel that needs more than arithmetic and the mathematical library.
    """
    return object_cache.load_or_translate(piece.prototype, piece.name, piece.compile)
