"""The signatures of `signatures` where every number of a vector is one number a lane."""

from __future__ import annotations

from collections.abc import Set
from ctypes import CFUNCTYPE, POINTER
from typing import Any

from podusv_cli.core.kernel import LANES, constants_type, kernel, shared, taken
from podusv_cli.engine.machine.lane_source import has_source
from podusv_cli.engine.machine.signatures import NUMBER, NUMBERS, SIGNATURES, VECTOR, WHOLE

LANE_VECTOR = POINTER(NUMBER * LANES)
PROTOTYPES: dict[str, Any] = {
    part: CFUNCTYPE(None, *(NUMBER if a in NUMBERS else LANE_VECTOR for a in arguments.split()))
    for part, arguments in SIGNATURES.items()
}
ADVANCE_LANES = CFUNCTYPE(
    WHOLE, *PROTOTYPES.values(), WHOLE, WHOLE, NUMBER, POINTER(LANE_VECTOR), POINTER(WHOLE),
    WHOLE, VECTOR, VECTOR,
)  # fmt: skip


def bind(part: str, inner: Any, names: tuple[str, ...], alike: Set[str]) -> Any:
    """The door of a part for lanes; constants in `alike` are the same in all lanes."""
    arguments = SIGNATURES[part].split()
    fields = ", ".join(
        f"shared(p[{i}])" if name in alike else f"p[{i}]" for i, name in enumerate(names)
    )
    inside: dict[str, Any] = {"Constants": constants_type(names), "shared": shared}
    exec(f"def named(p):\n    return Constants({fields})", inside)  # noqa: S102
    passed = ["named(k)" if a == "k" else a for a in taken(inner, arguments)]
    passed = ["None", *passed] if has_source(inner) else passed  # its mask: all lanes
    scope: dict[str, Any] = {"kernel": inner, "named": kernel(inside["named"])}
    exec(f"def {part}_entry({', '.join(arguments)}):\n    kernel({', '.join(passed)})", scope)  # noqa: S102
    return scope[f"{part}_entry"]
