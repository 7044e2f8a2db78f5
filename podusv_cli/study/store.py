"""The folder of a study: units as they come, then runs.h5 with every run in one table.

    study.json     what the study is (identity), how many draws were asked for, and when
    units/*.h5     a file a unit, each written whole; gone once they are in runs.h5
    runs.h5        every run, dimensions (law, cell, draw)

runs.h5 holds one dataset a metric, `status` (a code, see its attribute), `until` [s] and causes; a
unit has metrics and `until` as rows of `table`, with their names among its facts. Whatever is
damaged or belongs to another identity is not read and not counted.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.metrics.table import metrics_with
from podusv_cli.storage import files, json_files
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.study import runs_file
from podusv_cli.study.draws import table
from podusv_cli.study.plan import Plan, digest, disagreements
from podusv_cli.study.runs import Mask
from podusv_cli.study.unit import Unit, UnitResult

UNITS, RUNS = "units", "runs.h5"
FORMAT = 1
SEAL = "sha256"


class Store:
    """A study's folder."""

    def __init__(self, folder: Path, plan: Plan) -> None:
        """Nothing is read or written yet."""
        self.folder, self.plan = folder, plan
        self.seal = digest(plan.identity)

    def open(self, started: str) -> None:
        """Make the folder, or check that it holds this very study, and note what is asked for.

        Raises UsageError where it holds another study, naming what is different, and StorageError.
        """
        history: list[Any] = []
        if (self.folder / STUDY).exists():
            told = json_files.read(self.folder / STUDY)
            self._agree(self.folder, told.get("identity", {}))
            history = list(told.get("history", []))
            if self.plan.sweep.draws < told["draws"]:
                raise UsageError(
                    f"{self.folder} has {told['draws']} draws; ask for as many or more, or name "
                    "another folder with --out"
                )
        elif self.folder.exists() and any(self.folder.iterdir()):
            raise UsageError(f"{self.folder} is no study and not empty; name another with --out")
        asked = {"draws": self.plan.sweep.draws, "started": started}
        content = {
            "format": FORMAT, "name": self.plan.scenario.name, "draws": self.plan.sweep.draws,
            "laws": self.plan.laws, "cells": [cell.label for cell in self.plan.cells],
            "identity": self._identity(), "history": [*history, asked],
        }  # fmt: skip
        files.make_folder(self.folder)
        files.write_bytes(self.folder / STUDY, json_files.encode(content))
        files.make_folder(self.folder / UNITS)

    def agree(self, folder: Path, other: Plan) -> None:
        """Raise UsageError where another folder holds another study, naming what is different."""
        self._agree(folder, Store(folder, other)._identity())

    def _agree(self, folder: Path, identity: Mapping[str, Any]) -> None:
        if differing := disagreements(identity, self._identity()):
            raise UsageError(
                f"{folder} holds another study: {'; '.join(differing[:4])}"
                f"{' and more' if len(differing) > 4 else ''}; name another folder with --out"
            )

    def _identity(self) -> dict[str, Any]:
        """The identity as JSON gives it back."""
        encoded = json_files.encode(self.plan.identity)
        return dict(json.loads(encoded))

    def write(self, result: UnitResult) -> None:
        """Keep the result of a unit. Raises StorageError."""
        name = "{}-{}-{}-{}.h5".format(*_place(result.unit, self.plan))
        files.write_bytes(self.folder / UNITS / name, encoded(result, self.seal))

    def results(self) -> Iterator[UnitResult]:
        """Every undamaged unit of this study in the folder, and what runs.h5 has already."""
        yield from self._earlier()
        for path in sorted((self.folder / UNITS).glob("*.h5")):
            if result := read(path, self.seal):
                yield result

    def write_runs(self) -> None:
        """Put every run into runs.h5, and remove the units. Raises StorageError."""
        plan, known = self.plan, metrics_with(self.plan.scenario.plugged)
        header = runs_file.Header(
            plan.scenario.name, self.seal, plan.laws, [cell.label for cell in plan.cells],
            plan.sweep.draws, table(plan.sweep, 0, plan.sweep.draws),
            {name: known[name] for name in plan.metrics},
        )  # fmt: skip
        runs_file.write(self.folder / RUNS, header, _Again(self.results))
        for path in (self.folder / UNITS).glob("*.h5"):
            path.unlink()

    def runs(self) -> runs_file.Table:
        """The runs of a study that has runs.h5. Raises StorageError."""
        sweep, plugins = self.plan.sweep, self.plan.scenario.plugged
        return runs_file.Table(self.folder / RUNS, sweep.success, metrics_with(plugins))

    def _earlier(self) -> Iterator[UnitResult]:
        try:
            earlier = runs_file.Table(self.folder / RUNS)
            earlier.check()
        except StorageError:
            return
        if earlier.identity == self.seal:
            yield from earlier.results()

    def covered(self) -> dict[tuple[str, int], Mask]:
        """By law and cell, which of the wanted draws are there."""
        wanted = self.plan.sweep.draws
        there = {
            (law, cell.index): np.zeros(wanted, bool)
            for law in self.plan.laws
            for cell in self.plan.cells
        }
        for result in self.results():
            unit = result.unit
            there[unit.law, unit.cell][unit.first : unit.first + unit.count] = True
        return there


@dataclass(frozen=True)
class _Again:
    """Something that can be gone through more than once."""

    make: Callable[[], Iterator[UnitResult]]

    def __iter__(self) -> Iterator[UnitResult]:
        return self.make()


def _place(unit: Unit, plan: Plan) -> tuple[str, int, int, int]:
    return unit.law, unit.cell, unit.first, unit.count


def encoded(result: UnitResult, seal: str) -> bytes:
    """A unit as the content of a file. One array and one attribute are read several times faster
    than one for each metric and fact.
    """
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("v108", "v108"), track_order=True) as file:
        unit = result.unit
        table = np.stack([*result.metrics.values(), result.until])
        facts: dict[str, Any] = {
            "identity": seal,
            "law": unit.law,
            "cell": unit.cell,
            "first": unit.first,
        }
        facts["metrics"] = " ".join(result.metrics)
        facts[SEAL] = _seal((table, result.status), result.causes, facts)
        file.attrs["facts"] = json.dumps(facts)
        arrays = {"table": table, "status": result.status, "cause": _texts(result.causes)}
        for name, array in arrays.items():
            file.create_dataset(name, data=array, track_times=False)
    return buffer.getvalue()


def read(path: Path, seal: str) -> UnitResult | None:
    """A unit; None for a file that is damaged or of another identity."""
    try:
        with h5py.File(io.BytesIO(path.read_bytes()), "r") as file:
            facts = json.loads(file.attrs["facts"])
            sealed = facts.pop(SEAL)
            table, status = file["table"][()], file["status"][()]
            causes = tuple(text.decode() for text in file["cause"][()])
            whole = _seal((table, status), causes, facts) == sealed
    except (OSError, KeyError, ValueError, RuntimeError, AttributeError, TypeError):
        return None
    if not whole or facts["identity"] != seal:
        return None
    metrics = dict(zip(facts["metrics"].split(), table[:-1], strict=True))
    unit = Unit(facts["law"], facts["cell"], facts["first"], len(status))
    return UnitResult(unit, metrics, status, table[-1], causes)


def _texts(texts: Sequence[str]) -> Any:
    content = [text.encode() for text in texts]
    return np.array(content, dtype=f"S{max(1, *map(len, content))}")


def _seal(arrays: Iterable[Any], causes: Sequence[str], facts: Mapping[str, Any]) -> str:
    found = hashlib.sha256(repr((tuple(facts.items()), tuple(causes))).encode())
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()
