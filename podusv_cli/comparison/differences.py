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
    `ignored` sections and keys that end as `prose` does are left out. A section's keys stand
    together.
    """
    flattened = {
        label: dict(flat({key: part for key, part in tree.items() if key not in ignored}))
        for label, tree in scenarios.items()
    }
    keys = dict.fromkeys(key for values in flattened.values() for key in values)
    sections = list(dict.fromkeys(map(_section, keys)))
    wanted = (key for key in keys if not key.endswith(prose))
    ordered = sorted(wanted, key=lambda key: sections.index(_section(key)))
    found = {key: {label: v.get(key) for label, v in flattened.items()} for key in ordered}
    return {
        key: values for key, values in found.items() if len({repr(v) for v in values.values()}) > 1
    }


def in_words(found: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """Differences as they are shown: a dash where a run lacks a key.

    Where kinds differ, keys that only one of them has follow from that and are left out.
    """
    return {
        key: {label: in_short(value) for label, value in values.items()}
        for key, values in found.items()
        if not _follows(key, values, found)
    }


def in_short(value: Any) -> str:
    """A value of a scenario as a cell of a table, no digit lost; a dash for None."""
    if isinstance(value, (list, tuple)):
        return " ".join(map(in_short, value))
    if value is None:
        return "-"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if not isinstance(value, float) or float(text) == value else repr(value)


def _section(key: str) -> str:
    return key.partition(".")[0]


def _follows(
    key: str, values: Mapping[str, Any], found: Mapping[str, Mapping[str, Any]]
) -> bool:  # fmt: skip
    """Whether runs that have the key agree on it, and those that lack it are of another kind."""
    above = (key[:at] for at, letter in enumerate(key) if letter == ".")
    known = {repr(value) for value in values.values() if value is not None}
    lacking = None in values.values() and len(known) == 1
    return lacking and any(f"{part}.kind" in found for part in above)
