"""What the loop calls, as machine code takes it.

A component's kernel takes those arguments that it names, its constants as a named tuple `k`; the
loop hands over all of them, and `k` as a bare vector. `bind` makes the adapter between the two.

As machine code all of them follow C's calling convention, whose types are given here by ctypes.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from ctypes import CFUNCTYPE, POINTER, c_double, c_int64
from typing import Any

import numpy as np

from podusv_cli.core.kernel import LANES, Vector, taking, unpacker
from podusv_cli.engine.step.layout import NUMBERS, SIGNATURES

NUMBER, WHOLE = c_double, c_int64
VECTOR = POINTER(NUMBER)
PROTOTYPES: dict[str, Any] = {
    part: CFUNCTYPE(None, *(NUMBER if a in NUMBERS else VECTOR for a in arguments))
    for part, arguments in SIGNATURES.items()
}
ADVANCE = CFUNCTYPE(
    WHOLE, *PROTOTYPES.values(), WHOLE, WHOLE, NUMBER, POINTER(VECTOR), POINTER(WHOLE)
)
RATES_ALONG = CFUNCTYPE(
    None, *PROTOTYPES.values(), WHOLE, VECTOR, VECTOR, POINTER(VECTOR), POINTER(WHOLE)
)
# The same where every number of a vector is one number a lane.
LANE_VECTOR = POINTER(NUMBER * LANES)
LANE_PROTOTYPES: dict[str, Any] = {
    part: CFUNCTYPE(None, *(NUMBER if a in NUMBERS else LANE_VECTOR for a in arguments))
    for part, arguments in SIGNATURES.items()
}
ADVANCE_LANES = CFUNCTYPE(
    WHOLE,
    *LANE_PROTOTYPES.values(),
    WHOLE,
    WHOLE,
    NUMBER,
    POINTER(LANE_VECTOR),
    POINTER(WHOLE),
    WHOLE,
    VECTOR,
    VECTOR,
)
EVALUATE_ALL = CFUNCTYPE(None, PROTOTYPES["law"], WHOLE, WHOLE, WHOLE, *[VECTOR] * 5)


def bind(part: str, inner: Any, names: tuple[str, ...], alike: Set[str] = frozenset()) -> Any:
    """The adapter of a part to the kernel `inner`, whose constants have these names.

    Those in `alike` are the same in all runs that march side by side. Raises LawError for a kernel
    that names an argument which the part does not have.
    """
    return taking(inner, SIGNATURES[part], unpacker(names, alike))


def pointer(vector: Vector, kind: Any = VECTOR) -> Any:
    """Where the numbers of a vector begin. TypeError unless they are float64, one by the other."""
    if vector.dtype != np.float64 or not vector.flags.c_contiguous:
        raise TypeError(f"machine code takes contiguous float64, not {vector.dtype}")
    return vector.ctypes.data_as(kind)


def pointers(vectors: Sequence[Vector], kind: Any = VECTOR) -> Any:
    """Where each of these vectors begins.

    It keeps them: a march that hangs is abandoned, and writes to them until it sees its stop flag.
    """
    places = (kind * len(vectors))(*(pointer(vector, kind) for vector in vectors))
    places.vectors = vectors
    return places


def whole_numbers(numbers: Sequence[int]) -> Any:
    """These whole numbers, one by the other, as machine code reads them."""
    return (WHOLE * len(numbers))(*numbers)
