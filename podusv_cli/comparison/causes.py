"""Possible causes of different results: changes of the scenario, and of versions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from podusv_cli.comparison.differences import differences, flat
from podusv_cli.core.errors import StorageError
from podusv_cli.scenario.yaml_text import read
from podusv_cli.scenario.yaml_tree import Fault, plain

Change = tuple[Any, Any]
# Keys of provenance.json that are different for every run, or told by the scenario
OF_EACH_RUN = ("argv", "started", "finished", "duration_s", "plugins")


def scenario_changes(one: str, other: str) -> dict[str, Change]:
    """Keys with different values in two resolved scenarios; None for a missing key.

    Raises StorageError where a text is no scenario.
    """
    trees = {"one": _tree(one), "other": _tree(other)}
    found = differences(trees, ignored=(), prose=())
    return {key: (values["one"], values["other"]) for key, values in found.items()}


def _tree(resolved: str) -> dict[str, Any]:
    faults: list[Fault] = []
    node = read(resolved, "resolved scenario", faults)
    tree = plain(node) if node else None
    if faults or not isinstance(tree, dict):
        reason = faults[0].text if faults else "it is no mapping"
        raise StorageError(f"the scenario in a log is damaged: {reason}")
    return tree


def version_changes(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Change]:
    """Entries that differ between two provenance.json; those in only one of them do not count."""
    before, now = _facts(one), _facts(other)
    return {
        key: (before[key], now[key]) for key in before if key in now and before[key] != now[key]
    }


def _facts(provenance: Mapping[str, Any]) -> dict[str, Any]:
    return {key: v for key, v in flat(provenance) if key not in OF_EACH_RUN and v is not None}
