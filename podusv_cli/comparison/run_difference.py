"""All differences between two finished runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from podusv_cli.comparison.differences import differences
from podusv_cli.comparison.log_difference import LogDifference, compare
from podusv_cli.core.errors import StorageError
from podusv_cli.metrics.table import CLOCKED, METRICS
from podusv_cli.pages.page import flat
from podusv_cli.scenario.yaml_text import read
from podusv_cli.scenario.yaml_tree import Fault, plain
from podusv_cli.storage import log_reader, manifest
from podusv_cli.storage.run_folder import LOG, RunFolder

Change = tuple[Any, Any]
Numbers = tuple[float | None, float | None]
# Keys of provenance.json that are different for every run, or given by the scenario
OF_EACH_RUN = ("argv", "started", "finished", "duration_s", "plugins")


@dataclass(frozen=True)
class RunDifference:
    """The differences between two runs.

    `digests` are the SHA-256 of their logs, `sizes` the logs' bytes. `metrics` has the numbers of
    both runs by name, None where a run has none. `log` is None where the log of one is missing.
    """

    log: LogDifference | None
    digests: tuple[str, str]
    sizes: tuple[int, int]
    scenario: Mapping[str, Change]
    versions: Mapping[str, Change]
    metrics: Mapping[str, Numbers]

    @property
    def same_bytes(self) -> bool:
        """Whether the log files are the same, byte for byte."""
        return self.digests[0] == self.digests[1]

    @property
    def same_numbers(self) -> bool:
        """Whether every number of the log is the same, to the last bit."""
        return self.log.same if self.log else self.same_bytes

    @property
    def changed_metrics(self) -> list[str]:
        """Names of metrics that differ, measured times excepted."""
        return [k for k, (a, b) in self.metrics.items() if k not in CLOCKED and a != b]

    @property
    def same(self) -> bool:
        """Whether scenario, metrics and every number of the log are the same."""
        return self.same_numbers and not self.scenario and not self.changed_metrics

    def as_json(self) -> dict[str, Any]:
        """The difference as plain data."""
        return {
            "same_numbers": self.same_numbers,
            "same_bytes": self.same_bytes,
            "sha256": list(self.digests),
            "scenario": {key: list(change) for key, change in self.scenario.items()},
            "versions": {key: list(change) for key, change in self.versions.items()},
            "metrics": {
                name: {"values": list(pair), "relative": relative(*pair)}
                for name, pair in self.metrics.items()
            },
            "log": self.log and self.log.as_json(),
        }


def relative(one: float | None, other: float | None) -> float | None:
    """(other - one) / |one|; None where a number is missing, or only the first is 0."""
    if one is None or other is None or (one == 0 and other != 0):
        return None
    return (other - one) / abs(one) if one else 0.0


def difference(one: RunFolder, other: RunFolder) -> RunDifference:
    """Compare two opened run folders: log, scenario, versions and metrics. Raises StorageError.

    A log that is missing, as it was not packed, is compared by its digest.
    """
    entries = [manifest.read(run.path).files[LOG] for run in (one, other)]
    whole = one.has_log and other.has_log
    # A log has the scenario that made it, also where the file beside it was changed.
    texts = [
        log_reader.resolved_yaml(run.path / LOG) if whole else run.resolved_yaml
        for run in (one, other)
    ]
    given = dict.fromkeys((*one.metrics, *other.metrics))
    # Metrics that only a plug-in or an older podusv knows come last.
    names = sorted(given, key=lambda name: [*METRICS, *given].index(name))
    return RunDifference(
        log=compare(one.recording, other.recording) if whole else None,
        digests=(entries[0].sha256, entries[1].sha256),
        sizes=(entries[0].bytes, entries[1].bytes),
        scenario=scenario_changes(*texts),
        versions=version_changes(one.provenance, other.provenance),
        metrics={name: (_number(one, name), _number(other, name)) for name in names},
    )


def _number(run: RunFolder, name: str) -> float | None:
    """A metric of a run; None where it has none, or where it is not finite."""
    number = run.metrics.get(name)
    return number if number is None or math.isfinite(number) else None


def scenario_changes(one: str, other: str) -> dict[str, Change]:
    """Keys with different values in two resolved scenarios; None for a missing key.

    Raises StorageError where a text is no scenario.
    """
    trees = {"one": _tree(one), "other": _tree(other)}
    changed = differences(trees, ignored=(), prose=())
    return {key: (values["one"], values["other"]) for key, values in changed.items()}


def _tree(resolved: str) -> dict[str, Any]:
    """The keys and values of a resolved scenario. Raises StorageError."""
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
    """Dotted keys of provenance.json that can explain another result: no times, no paths."""
    return {key: v for key, v in flat(provenance) if key not in OF_EACH_RUN and v is not None}
