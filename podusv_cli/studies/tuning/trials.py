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
FORMAT = 1
VECTORS = ("values", "excesses", "first")
FINISHED, PRUNED, CUT = "finished", "pruned", "cut"


@dataclass(frozen=True)
class Trial:
    """Gains that were tried, on how many draws, and what came of it.

    `status` is `finished`; `pruned` after a part of the draws; or `cut`, where the budget was used
    up. Only finished trials can win. `excesses` say by how much each inequality does not hold.
    `first` are the objectives over the first part of the draws, by which trials are pruned.
    """

    number: int
    batch: int
    gains: Mapping[str, Any]
    runs: int
    status: str
    values: tuple[float, ...]
    excesses: tuple[float, ...]
    first: tuple[float, ...]
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
    return Trial(**(told | numbers))


def _number(told: float | None) -> float:
    """JSON knows no infinity, the only number of a trial that is not finite."""
    return math.inf if told is None else float(told)


def best(trials: Sequence[Trial]) -> Trial:
    """The finished trial that wins: inequalities first, then the objective; an early one of equals.

    Of several objectives, the one of the Pareto front that is nearest to its ideal corner.
    """
    finished = [trial for trial in trials if trial.status == FINISHED]
    least = min(trial.excess for trial in finished)
    sound = [trial for trial in finished if trial.excess == least]
    return min(sound, key=lambda t: t.values[0]) if len(sound[0].values) == 1 else _middle(sound)


def front(trials: Sequence[Trial]) -> list[Trial]:
    """The finished trials that hold all inequalities and that no other is better than."""
    sound = [t for t in trials if t.status == FINISHED and t.excess == 0.0]
    return [
        one for one in sound
        if all(map(math.isfinite, one.values)) and not any(_beats(o, one) for o in sound)
    ]  # fmt: skip


def _beats(one: Trial, other: Trial) -> bool:
    pairs = list(zip(one.values, other.values, strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def _middle(sound: Sequence[Trial]) -> Trial:
    """Of the front, the one whose worse objective is least, each scaled to the front's extent."""
    found = front(sound)
    if not found:
        return sound[0]
    columns = list(zip(*(trial.values for trial in found), strict=True))
    ends = [(min(column), max(column)) for column in columns]

    def away(trial: Trial) -> float:
        """The larger distance from the ideal corner."""
        pairs = zip(trial.values, ends, strict=True)
        return float(max((value - low) / ((high - low) or 1.0) for value, (low, high) in pairs))

    return min(found, key=away)
