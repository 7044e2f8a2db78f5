"""Closed loops that differ in numbers, from arrays of parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from podusv_cli.core.component import Component
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop


def variants(
    loop: ClosedLoop, parameters: Mapping[str, Sequence[float] | Vector]
) -> list[ClosedLoop]:
    """The loop with the i-th number of every array, for all i.

    Keys are a scenario's: `disturbance.b_u.mean`, `controller.k_ze`, `start.x`. `vessel.m` does not
    touch `nominal`, the vessel that the law is told about. Raises ValueError for unknown keys,
    arrays of different lengths, and numbers out of range.
    """
    lengths = {key: len(numbers) for key, numbers in parameters.items()}
    if len(set(lengths.values())) != 1:
        raise ValueError(f"all parameters need one number a run; their lengths are {lengths}")
    rows = zip(*parameters.values(), strict=True)
    return [_changed(loop, dict(zip(parameters, row, strict=True))) for row in rows]


def _changed(loop: ClosedLoop, numbers: Mapping[str, float]) -> ClosedLoop:
    sections: dict[str, Any] = {}
    for key, number in numbers.items():
        part, _, rest = key.partition(".")
        if part not in sections:
            sections[part] = _content(getattr(loop, part, None))
        _put(sections[part], rest, float(number), key)
    return replace(loop, **{part: _built(loop, part, new) for part, new in sections.items()})


def _content(part: Any) -> Any:
    if isinstance(part, Component):
        return part.model_dump()
    return dict(zip(STATE, part, strict=True)) if part else {}


def _put(section: Any, rest: str, number: float, key: str) -> None:
    *outer, last = rest.split(".")
    for name in outer:
        section = section.get(name) if isinstance(section, dict) else None
    if not isinstance(section, dict) or last not in section or isinstance(section[last], dict):
        raise ValueError(f"{key}: no number of this closed loop has this name")
    section[last] = number


def _built(loop: ClosedLoop, part: str, content: dict[str, Any]) -> Any:
    if part == "start":
        return tuple(content.values())
    return type(getattr(loop, part)).model_validate(content)
