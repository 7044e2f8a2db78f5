"""Laws that are shown a path's corners rounded: their kernels, composed with `round_corner`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from podusv_cli.components.paths.fillet import round_corner
from podusv_cli.core.kernel import Vector, scratch, specialise, tail, taking
from podusv_cli.engine.machine.signatures import SIGNATURES

Kernel = Callable[..., None]


def _inner_law(
    t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector, tau: Vector,
    rate: Vector, signals: Vector, work: Vector,
) -> None:  # fmt: skip
    """Stands for a law's `law`."""


def _inner_sample(
    t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector
) -> None:
    """Stands for a law's `sample`."""


def _law(
    t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector, tau: Vector,
    rate: Vector, signals: Vector, work: Vector,
) -> None:  # fmt: skip
    """`law` of the rounded target."""
    shown = scratch(6)
    round_corner(t, k, tail(table, int(k.fillet_place)), target, shown)
    _inner_law(t, x, memory, shown, k, table, tau, rate, signals, work)


def _sample(t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector) -> None:
    """`sample` of the rounded target."""
    shown = scratch(6)
    round_corner(t, k, tail(table, int(k.fillet_place)), target, shown)
    _inner_sample(t, x, memory, shown, k, table)


@cache
def law_of_rounded(law: Kernel) -> Kernel:
    """A law's kernel that is shown the rounded target; the same one for the same kernel."""
    made: Kernel = specialise(
        _law, f"{law.__qualname__}_rounded", _inner_law=taking(law, SIGNATURES["law"].split())
    )
    return made


@cache
def sample_of_rounded(sample: Kernel) -> Kernel:
    """A law's `sample` that is shown the rounded target; the same one for the same kernel."""
    inner = taking(sample, SIGNATURES["sample"].split())
    made: Kernel = specialise(_sample, f"{sample.__qualname__}_rounded", _inner_sample=inner)
    return made
