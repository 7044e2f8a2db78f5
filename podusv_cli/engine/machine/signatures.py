"""The few signatures that the loop calls through.

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

NUMBER, WHOLE = c_double, c_int64
NUMBERS = ("t", "instant", "weight", "again", "stage")
VECTOR = POINTER(NUMBER)
# The arguments of every part, in the order in which the loop takes the parts. The time t, an
# instant's position, its weight in an integral [s], and whether an evaluation is one more at its
# instant or a stage within a step are numbers, all others vectors.
SIGNATURES = {
    "path": "t x place k table target shown",
    "locate": "t x s place k table",
    "disturbance": "t x k table b again stage",
    "law": "t x memory target k table tau rate signals work",
    "sample": "t x memory target k table",
    "actuator": "t x state demand k table tau rate signals",
    "after_saturation": "t memory demand tau k table rate",
    "measurement": "t instant x b k table seen",
    "correct": "t seen state k table",
    "follow": "t seen tau state k table rate",
    "probe": "t weight s row k seen",
}
PROTOTYPES: dict[str, Any] = {
    part: CFUNCTYPE(None, *(NUMBER if a in NUMBERS else VECTOR for a in arguments.split()))
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
    part: CFUNCTYPE(None, *(NUMBER if a in NUMBERS else LANE_VECTOR for a in arguments.split()))
    for part, arguments in SIGNATURES.items()
}
ADVANCE_LANES = CFUNCTYPE(
    WHOLE, *LANE_PROTOTYPES.values(), WHOLE, WHOLE, NUMBER, POINTER(LANE_VECTOR), POINTER(WHOLE),
    WHOLE, VECTOR, VECTOR,
)  # fmt: skip
EVALUATE_ALL = CFUNCTYPE(None, PROTOTYPES["law"], WHOLE, WHOLE, WHOLE, *[VECTOR] * 5)


def bind(part: str, inner: Any, names: tuple[str, ...], alike: Set[str] = frozenset()) -> Any:
    """The adapter of a part to the kernel `inner`, whose constants have these names.

    Those in `alike` are the same in all runs that march side by side. Raises LawError for a kernel
    that names an argument which the part does not have.
    """
    return taking(inner, SIGNATURES[part].split(), unpacker(names, alike))


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
