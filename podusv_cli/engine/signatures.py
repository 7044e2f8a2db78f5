"""The few signatures that the loop calls through.

A component's kernel takes its constants as a named tuple `k`; the loop hands over a bare vector
`p`. Each function here is the door between the two. `kernel` and `named` stand for the component's
kernel and for the unpacking of its constants; `bind` puts them in.

As machine code all of them follow C's calling convention, whose types are given here by ctypes.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import CFUNCTYPE, POINTER, c_double, c_int64
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector, unpacker, with_globals


def kernel(*arguments: Any) -> None:
    """Stands for a component's kernel."""
    raise NotImplementedError


def named(p: Vector) -> Any:
    """Stands for the unpacking of its constants."""
    raise NotImplementedError


def path_entry(t: float, p: Vector, table: Vector, target: Vector) -> None:
    """A path's door."""
    kernel(t, named(p), table, target)


def disturbance_entry(t: float, x: Vector, p: Vector, table: Vector, b: Vector) -> None:
    """A disturbance's door."""
    kernel(t, x, named(p), table, b)


def law_entry(
    t: float, x: Vector, memory: Vector, target: Vector, p: Vector, table: Vector,
    tau: Vector, rate: Vector, signals: Vector, work: Vector,
) -> None:  # fmt: skip
    """A law's door."""
    kernel(t, x, memory, target, named(p), table, tau, rate, signals, work)


def sample_entry(
    t: float, x: Vector, memory: Vector, target: Vector, p: Vector, table: Vector
) -> None:
    """The door of a law's sampling."""
    kernel(t, x, memory, target, named(p), table)


def actuator_entry(
    t: float, x: Vector, state: Vector, demand: Vector, p: Vector, table: Vector,
    tau: Vector, rate: Vector, signals: Vector,
) -> None:  # fmt: skip
    """An actuator's door."""
    kernel(t, x, state, demand, named(p), table, tau, rate, signals)


def after_saturation_entry(
    t: float, memory: Vector, demand: Vector, tau: Vector, p: Vector, table: Vector, rate: Vector
) -> None:
    """The door of a law that learns which loads really act."""
    kernel(t, memory, demand, tau, named(p), table, rate)


def observer_entry(
    t: float, weight: float, s: Vector, row: Vector, p: Vector, seen: Vector
) -> None:
    """An observer's door: state and signals at an instant, and its weight [s] in an integral."""
    kernel(t, weight, s, row, named(p), seen)


def bind(entry: Any, inner: Any, names: tuple[str, ...]) -> Any:
    """`entry` around the kernel `inner` whose constants have these names."""
    return with_globals(entry, entry.__name__, kernel=inner, named=unpacker(names))


NUMBER, WHOLE = c_double, c_int64
VECTOR = POINTER(NUMBER)
PROTOTYPES: dict[Any, Any] = {
    path_entry: CFUNCTYPE(None, NUMBER, *[VECTOR] * 3),
    disturbance_entry: CFUNCTYPE(None, NUMBER, *[VECTOR] * 4),
    law_entry: CFUNCTYPE(None, NUMBER, *[VECTOR] * 9),
    sample_entry: CFUNCTYPE(None, NUMBER, *[VECTOR] * 5),
    actuator_entry: CFUNCTYPE(None, NUMBER, *[VECTOR] * 8),
    after_saturation_entry: CFUNCTYPE(None, NUMBER, *[VECTOR] * 6),
    observer_entry: CFUNCTYPE(None, NUMBER, NUMBER, *[VECTOR] * 4),
}
LOOP = (
    path_entry, disturbance_entry, law_entry, sample_entry, actuator_entry, after_saturation_entry,
    observer_entry,
)  # fmt: skip
RIGHT_HAND_SIDE = (path_entry, disturbance_entry, law_entry, actuator_entry, after_saturation_entry)
_PARTS = [PROTOTYPES[door] for door in LOOP]
ADVANCE = CFUNCTYPE(WHOLE, *_PARTS, WHOLE, WHOLE, NUMBER, POINTER(VECTOR), POINTER(WHOLE))
RATES_ALONG = CFUNCTYPE(
    None, *[PROTOTYPES[door] for door in RIGHT_HAND_SIDE],
    WHOLE, VECTOR, VECTOR, POINTER(VECTOR), POINTER(WHOLE),
)  # fmt: skip
EVALUATE_ALL = CFUNCTYPE(None, PROTOTYPES[law_entry], WHOLE, WHOLE, WHOLE, *[VECTOR] * 5)


def pointer(vector: Vector) -> Any:
    """Where the numbers of a vector begin. TypeError unless they are float64, one by the other."""
    if vector.dtype != np.float64 or not vector.flags.c_contiguous:
        raise TypeError(f"machine code takes contiguous float64, not {vector.dtype}")
    return vector.ctypes.data_as(VECTOR)


def pointers(vectors: Sequence[Vector]) -> Any:
    """Where each of these vectors begins; they have to outlive its use."""
    return (VECTOR * len(vectors))(*map(pointer, vectors))


def whole_numbers(numbers: Sequence[int]) -> Any:
    """These numbers, one by the other."""
    return (WHOLE * len(numbers))(*numbers)
