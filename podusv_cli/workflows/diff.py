"""`podusv diff`: finished runs compared with others, to the last bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from podusv_cli.comparison.run_difference import RunDifference, difference
from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import RunFolder
from podusv_cli.workflows.members import runs_of


@dataclass(frozen=True)
class Differences:
    """Pairs of compared runs by label, and the labels that only one side has."""

    pairs: Mapping[str, tuple[Path, Path, RunDifference]]
    only_one: Sequence[str] = ()
    only_other: Sequence[str] = ()

    @property
    def same(self) -> bool:
        """Whether all are the same in scenario, signals and metrics."""
        alone = self.only_one or self.only_other
        return not alone and all(pair.same for _, _, pair in self.pairs.values())

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of them."""
        return {
            "format": 1,
            "identical": self.same,
            "only": [list(self.only_one), list(self.only_other)],
            "pairs": [
                {"label": label, "runs": [str(one), str(other)], **differing.as_json()}
                for label, (one, other, differing) in self.pairs.items()
            ],
        }


def diff(one: Path, other: Path) -> Differences:
    """Compare a run with another, or the runs of a comparison with those of the same name.

    Both are folders. Raises UsageError where one is no run folder, and StorageError.
    """
    sides = [_runs(path) for path in (one, other)]
    # Two single runs are compared whatever their names.
    if all(len(runs) == 1 for runs in sides):
        return Differences({"": _pair(sides[0][0], sides[1][0])})
    ours, theirs = ({run.path.name: run for run in runs} for runs in sides)
    return Differences(
        {label: _pair(run, theirs[label]) for label, run in ours.items() if label in theirs},
        [label for label in ours if label not in theirs],
        [label for label in theirs if label not in ours],
    )


def _runs(path: Path) -> list[RunFolder]:
    manifest.demand(path)
    return runs_of(path)


def _pair(one: RunFolder, other: RunFolder) -> tuple[Path, Path, RunDifference]:
    """Two run folders, and what differs between them."""
    return one.path, other.path, difference(one, other)
