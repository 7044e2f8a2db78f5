"""Trials of a search, and the file that keeps those of one law and repeat."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import files, json_files

FOLDER = "trials"
FORMAT = 2
VECTORS = ("excesses",)
FINISHED, PRUNED, CUT = "finished", "pruned", "cut"


@dataclass(frozen=True)
class Trial:
    """Gains that were tried, on how many draws, and what came of it.

    `status` is `finished`; `pruned` after a part of the draws; or `cut`, where the budget was used
    up. Only finished trials can win. `excesses` say by how much each inequality does not hold.
    `first` is the objective over the first part of the draws, by which trials are pruned.
    """

    number: int
    batch: int
    gains: Mapping[str, Any]
    runs: int
    status: str
    value: float
    excesses: tuple[float, ...]
    first: float
    failures: float

    @property
    def excess(self) -> float:
        """By how much inequalities do not hold, together."""
        return sum(max(0.0, over) for over in self.excesses)


def write(folder: Path, name: str, trials: Sequence[Trial]) -> None:
    """Write the trials of a search. Raises StorageError."""
    content = {"format": FORMAT, "trials": [asdict(trial) for trial in trials]}
    files.write_bytes(folder / FOLDER / f"{name}.json", json_files.encode(content))


def read(folder: Path, name: str) -> list[Trial]:
    """The trials of a search that are there; none where it has not begun. Raises StorageError."""
    path = folder / FOLDER / f"{name}.json"
    if not path.exists():
        return []
    try:
        return [_trial(told) for told in json_files.read(path)["trials"]]
    except (KeyError, TypeError, ValueError) as error:
        raise StorageError(f"cannot read {path}: damaged, not as podusv wrote it") from error


def _trial(told: dict[str, Any]) -> Trial:
    numbers: dict[str, Any] = {name: tuple(map(_number, told[name])) for name in VECTORS}
    numbers |= {name: _number(told[name]) for name in ("value", "first")}
    return Trial(**(told | numbers))


def _number(told: float | None) -> float:
    """JSON knows no infinity, the only number of a trial that is not finite."""
    return math.inf if told is None else float(told)


def best(trials: Sequence[Trial]) -> Trial:
    """The finished trial that wins: inequalities first, then the objective, then the earlier."""
    finished = [trial for trial in trials if trial.status == FINISHED]
    least = min(trial.excess for trial in finished)
    return min((t for t in finished if t.excess == least), key=lambda t: t.value)
