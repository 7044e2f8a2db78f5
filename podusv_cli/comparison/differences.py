"""What compared runs differ in besides the controller."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

PROSE = (".source", ".validity")
IGNORED = ("name", "description", "controller", "controllers", "claims", "silence")


def flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of a nested mapping."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def differences(
    scenarios: Mapping[str, Mapping[str, Any]], *,
    ignored: Sequence[str] = IGNORED, prose: tuple[str, ...] = PROSE,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Keys outside the controller whose values differ, with the value of every run.

    `scenarios` are resolved scenarios by the runs' labels. A key that a run lacks counts as None.
    `ignored` sections and keys that end as `prose` does are left out.
    """
    flattened = {
        label: dict(flat({key: part for key, part in tree.items() if key not in ignored}))
        for label, tree in scenarios.items()
    }
    keys = dict.fromkeys(key for values in flattened.values() for key in values)
    keys = {key: None for key in keys if not key.endswith(prose)}
    found = {key: {label: v.get(key) for label, v in flattened.items()} for key in keys}
    return {
        key: values for key, values in found.items() if len({repr(v) for v in values.values()}) > 1
    }
