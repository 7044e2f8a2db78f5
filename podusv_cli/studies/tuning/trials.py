"""Trials of a search, and the file that keeps those of one search."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, NonNegativeInt

from podusv_cli.core import json_text
from podusv_cli.core.portable import add_up
from podusv_cli.storage import files, json_files

FOLDER = "trials"
FORMAT = 2
FINISHED, PRUNED, CUT = "finished", "pruned", "cut"


@dataclass(frozen=True)
class GainTrial:
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
        return add_up(max(0.0, over) for over in self.excesses)


def write(folder: Path, name: str, trials: Sequence[GainTrial]) -> None:
    """Write the trials of a search. Raises StorageError."""
    content = {"format": FORMAT, "trials": [asdict(trial) for trial in trials]}
    files.write_bytes(folder / FOLDER / f"{name}.json", json_text.encode(content))


class Stored(BaseModel):
    """A trial as the file has it: null for a number that is not finite."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")
    number: NonNegativeInt
    batch: NonNegativeInt
    gains: dict[str, Any]
    runs: NonNegativeInt
    status: Literal["finished", "pruned", "cut"]
    value: float | None
    excesses: list[float | None]
    first: float | None
    failures: float

    def trial(self) -> GainTrial:
        """The trial itself."""
        infinite = {"value": _number(self.value), "first": _number(self.first)}
        excesses = tuple(map(_number, self.excesses))
        return GainTrial(**(self.model_dump() | infinite | {"excesses": excesses}))


class File(BaseModel):
    """What is read of a search's file; there is more."""

    model_config = ConfigDict(strict=True, frozen=True)
    trials: list[Stored]


def read(folder: Path, name: str) -> list[GainTrial]:
    """The trials of a search that are there; none where it has not begun. Raises StorageError."""
    path = folder / FOLDER / f"{name}.json"
    if not path.exists():
        return []
    return [stored.trial() for stored in json_files.read_as(path, File).trials]


def _number(number: float | None) -> float:
    """JSON knows no infinity, the only number of a trial that is not finite."""
    return math.inf if number is None else number


def best(trials: Sequence[GainTrial]) -> GainTrial:
    """The finished trial that wins: inequalities first, then the objective, then the earlier."""
    finished = [trial for trial in trials if trial.status == FINISHED]
    # The first trial is always whole, unless the budget is less than one batch, which is refused.
    least = min(trial.excess for trial in finished)
    return min((t for t in finished if t.excess == least), key=lambda t: t.value)
