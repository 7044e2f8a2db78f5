"""Differences between the scenarios of compared runs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from podusv_cli.core.about import BESIDE_RUNS
from podusv_cli.core.phrases import value_text
from podusv_cli.pages.page import flat

# Ends of keys with words about numbers, which two runs may have the same of.
PROSE = (".source", ".validity")
# What runs of one task may differ in: words, and the laws that are compared.
IGNORED = ("name", "description", "controller", "controllers", "claims", "silence", *BESIDE_RUNS)


def differences(
    scenarios: Mapping[str, Mapping[str, Any]],
    *,
    ignored: Sequence[str] = IGNORED,
    prose: tuple[str, ...] = PROSE,
) -> dict[str, dict[str, Any]]:
    """Keys whose values differ, with the value of every run; None for a missing key.

    `scenarios` are resolved scenarios by label. Sections in `ignored` and keys with an ending in
    `prose` are left out. The keys of one section are adjacent. Lists of mappings are
    compared entry by entry, `disturbance[2].seed`.
    """
    flattened = {
        label: dict(_each({key: part for key, part in tree.items() if key not in ignored}))
        for label, tree in scenarios.items()
    }
    keys = dict.fromkeys(key for values in flattened.values() for key in values)
    sections = list(dict.fromkeys(map(_section, keys)))
    wanted = (key for key in keys if not key.endswith(prose))
    ordered = sorted(wanted, key=lambda key: sections.index(_section(key)))
    # Compared as texts below, since lists and dicts cannot be in a set.
    by_key = {key: {label: v.get(key) for label, v in flattened.items()} for key in ordered}
    return {
        key: values for key, values in by_key.items() if len({repr(v) for v in values.values()}) > 1
    }


def as_text(differing: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """Differences as text, without the keys that only exist because kinds differ."""
    return {
        key: {label: value_text(value) for label, value in values.items()}
        for key, values in differing.items()
        if not _follows_from_kind(key, values, differing)
    }


def _each(tree: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of a scenario; entries of lists of mappings one by one, `a[0].b`."""
    for key, value in flat(tree):
        if (
            isinstance(value, (list, tuple))
            and value
            and all(isinstance(item, Mapping) for item in value)
        ):
            for place, entry in enumerate(value):
                yield from ((f"{key}[{place}].{name}", inner) for name, inner in _each(entry))
        else:
            yield key, value


def _section(key: str) -> str:
    return re.split(r"[.[]", key, maxsplit=1)[0]


def _follows_from_kind(
    key: str, values: Mapping[str, Any], differing: Mapping[str, Mapping[str, Any]]
) -> bool:
    """Whether the key has one value, and is missing only in runs of another kind.

    Such keys say no more than the kind does. A plug-in, too, follows from the kind of a law that
    only some runs have. `values` are by label, `differing` are all differing keys.
    """
    above = (key[:at] for at, letter in enumerate(key) if letter == ".")
    known = {repr(value) for value in values.values() if value is not None}
    lacking = None in values.values() and len(known) == 1
    return lacking and (
        key.startswith("plugins.") or any(f"{part}.kind" in differing for part in above)
    )
