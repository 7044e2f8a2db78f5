"""The folder of a study: units as they come, then runs.h5 with every run in one table.

    study.json     what the study is (identity), how many draws were asked for, and when
    units/*.h5     a file a unit, each written whole; gone once they are in runs.h5
    runs.h5        every run, dimensions (law, cell, draw)

runs.h5 holds one dataset a metric, `status` (a code, see its attribute), `until` [s] and causes; a
unit has metrics and `until` as rows of `table`, whose attribute names them. Before that, in the
user block that HDF5 leaves alone, are its facts in one line of JSON, with a digest of all bytes: so
a unit is counted without HDF5, which takes ten times longer. A unit that is damaged or belongs to
another identity is not read and not counted; such a runs.h5 is an error, as it may be all there is.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import numpy as np

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.metrics.table import metrics_with
from podusv_cli.scenario.plugins import again
from podusv_cli.storage import files, hdf5, json_files
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.studies.study import record, runs_file, runs_writer
from podusv_cli.studies.study.plan import Plan, digest, disagreements
from podusv_cli.studies.study.runs import Mask
from podusv_cli.studies.study.unit import Unit, UnitResult

UNITS, RUNS = "units", "runs.h5"
SCENARIO = "scenario.yaml"  # whole: it refers to no other file but plug-ins beside it
FORMAT = 1
SEAL = "sha256"
BLOCK = 512  # bytes of the smallest user block of HDF5


class Store:
    """A study's folder."""

    def __init__(
        self, folder: Path, plan: Plan, kernels: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        """`kernels` are digests in the runs' identity that are not those of this podusv."""
        self.folder, self.plan, self.kernels = folder, plan, kernels
        self.identity = {**plan.identity, **kernels}
        self.seal = digest(self.identity)

    @property
    def remark(self) -> str:
        """What a reader of the study has to know; "" where there is nothing."""
        if not self.kernels:
            return ""
        laws = dict.fromkeys(key.rpartition("[")[0] for key in self.kernels)
        return (
            f"the runs in {self.folder} are of other kernels than those of this podusv (laws: "
            f"{', '.join(laws)}); they are shown as they are, and no runs or logs are added"
        )

    def open(self, started: str, texts: Mapping[str, str] = MappingProxyType({})) -> None:
        """Make the folder, or check that it holds this very study, and note what is asked for.

        `texts` has the scenario and its plug-ins by the names of their files, where they are to be
        written. Raises UsageError where it holds another study, naming what is different, and
        StorageError.
        """
        history: list[Any] = []
        known = (self.folder / STUDY).exists()
        if known:
            there = record.read(self.folder)
            self._agree(self.folder, there.identity)
            history = [asked.model_dump() for asked in there.history]
            if self.plan.sweep.draws < there.draws:
                raise UsageError(
                    f"{self.folder} has {there.draws} draws; ask for as many or more, or name "
                    "another folder with --out"
                )
        elif not files.is_empty(self.folder):
            raise UsageError(f"{self.folder} is no study and not empty; name another with --out")
        asked = {"draws": self.plan.sweep.draws, "started": started}
        content = {
            "format": FORMAT, "name": self.plan.scenario.name, "draws": self.plan.sweep.draws,
            "laws": self.plan.laws, "cells": [cell.label for cell in self.plan.cells],
            "identity": self._identity(), "history": [*history, asked], **self._metrics(),
        }  # fmt: skip
        # With more draws in study.json than in the scenario, the study could not be continued. And
        # without study.json, a folder that is not empty is no study.
        if known:
            files.write_texts(self.folder, texts)
        files.make_folder(self.folder)
        files.write_bytes(self.folder / STUDY, json_files.encode(content))
        files.make_folder(self.folder / UNITS)
        if not known:
            files.write_texts(self.folder, texts)

    def _metrics(self) -> dict[str, Any]:
        """What a reader without the study's plug-ins has to know of its metrics."""
        scenario = self.plan.scenario
        if not scenario.plugins:
            return {}
        own = metrics_with((), scenario.metrics.named())
        known = {name: scenario.known_metrics()[name] for name in self.plan.metrics}
        return {"metrics": list(known), "metrics_of_plugins": record.of_plugins(known, own)}

    def agree(self, other: Store) -> None:
        """Raise UsageError where another folder holds another study, naming what is different."""
        self._agree(other.folder, other._identity(), "leave it out")

    def _agree(
        self, folder: Path, identity: Mapping[str, Any],
        remedy: str = "name another folder with --out",
    ) -> None:  # fmt: skip
        if found := disagreements(identity, self._identity()):
            raise UsageError(f"{folder} holds another study: {found}; {remedy}")

    def _identity(self) -> dict[str, Any]:
        """The identity as JSON gives it back."""
        return json_files.plain(self.identity)

    def write(self, result: UnitResult) -> None:
        """Keep the result of a unit. Raises StorageError."""
        unit = result.unit
        name = f"{unit.law}-{unit.cell}-{unit.first}-{unit.count}.h5"
        files.write_bytes(self.folder / UNITS / name, encoded(result, self.seal))

    def results(self) -> Iterator[UnitResult]:
        """Every undamaged unit of this study in the folder, and what runs.h5 has already."""
        for earlier in self._earlier():
            yield from earlier.results()
        for path in self._units():
            if result := read(path, self.seal):
                yield result

    def _units(self) -> list[Path]:
        return sorted((self.folder / UNITS).glob("*.h5"))

    def write_runs(self) -> None:
        """Put every run into runs.h5, and remove its units once no run is missing.

        A driver may make more units meanwhile, so the same ones are read each time. Raises
        StorageError.
        """
        paths = [path for path in self._units() if undamaged(_content(path), self.seal)]
        runs_writer.write(self.folder / RUNS, self.plan, self.seal, lambda: self._these(paths))
        if all(self.runs().tried(law).all() for law in self.plan.laws):
            with files.storage_errors(f"cannot remove the files in {self.folder / UNITS}"):
                for path in paths:
                    path.unlink(missing_ok=True)

    def _these(self, paths: Sequence[Path]) -> Iterator[UnitResult]:
        """What runs.h5 has already, and these units. Raises StorageError for other metrics."""
        there = (result for earlier in self._earlier() for result in earlier.results())
        for result in chain(there, filter(None, (read(path, self.seal) for path in paths))):
            if set(result.metrics) != set(self.plan.metrics):
                raise StorageError(
                    f"cannot read {self.folder / STUDY}: damaged, it has other metrics than the "
                    "runs; restore the file"
                )
            yield result

    def runs(self) -> runs_file.Table:
        """The runs of a study that has runs.h5. Raises StorageError, also for altered numbers."""
        path = self.folder / RUNS
        try:
            known = self.plan.scenario.known_metrics()
            found = runs_file.Table(path, self.plan.sweep.success, known)
            found.check()
            if found.identity != self.seal:
                raise StorageError(f"cannot read {path}: its runs are of another study")
        except StorageError as error:
            raise StorageError(
                f"{error}; restore the file, or move it away and simulate its runs again with: "
                f"{again('sweep run', self.folder)}"
            ) from error
        return found

    def _earlier(self) -> Iterator[runs_file.Table]:
        """runs.h5, if it is there. Raises StorageError where it is damaged or of another study."""
        if os.path.lexists(self.folder / RUNS):
            yield self.runs()

    def covered(self) -> dict[tuple[str, int], Mask]:
        """By law and cell, which of the wanted draws are there."""
        there = {
            (law, cell.index): np.zeros(self.plan.sweep.draws, bool)
            for law in self.plan.laws
            for cell in self.plan.cells
        }
        for earlier in self._earlier():
            for (law, cell), mask in there.items():
                mask[: earlier.wanted] = earlier.tried(law)[cell]
        for path in self._units():
            if unit := undamaged(_content(path), self.seal):
                there[unit.law, unit.cell][unit.first : unit.draws.stop] = True
        return there


def encoded(result: UnitResult, seal: str) -> bytes:
    """A unit as the content of a file. One array is read several times faster than one a metric."""
    unit, buffer = result.unit, io.BytesIO()
    facts = {"identity": seal, **asdict(unit)}
    # The digest is as long whatever it is of, and a user block has 512 bytes, or 1024, 2048, ...
    block = BLOCK
    while block <= len(_head(facts, b"")):
        block *= 2
    with h5py.File(buffer, "w", libver=("v108", "v108"), userblock_size=block) as file:
        table = np.stack([*result.metrics.values(), result.until])
        arrays = {"table": table, "status": result.status, "cause": _texts(result.causes)}
        for name, array in arrays.items():
            file.create_dataset(name, data=array, track_times=False)
        file["table"].attrs["metrics"] = " ".join(result.metrics)
    content = buffer.getvalue()[block:]
    return _head(facts, content).ljust(block, b"\0") + content


def _head(facts: Mapping[str, Any], content: bytes) -> bytes:
    """The line before a unit's content: what it is, and a digest of this and of the content."""
    found = hashlib.sha256(json.dumps(facts).encode() + content).hexdigest()
    return json.dumps({**facts, SEAL: found}).encode() + b"\n"


def undamaged(content: bytes, seal: str) -> Unit | None:
    """Which unit a file has; None for one that is damaged or of another identity."""
    head = content[: content.find(b"\n") + 1]
    block = BLOCK
    while block <= len(head):
        block *= 2
    try:
        facts = json.loads(head)
        del facts[SEAL]
        whole = content[:block].rstrip(b"\0") == head == _head(facts, content[block:])
        if not whole or facts.pop("identity") != seal:
            return None
        return Unit(**facts)
    except (ValueError, KeyError, TypeError):
        return None


def read(path: Path, seal: str) -> UnitResult | None:
    """A unit with its runs; None for a file that is damaged or of another identity.

    Raises StorageError for one that is sealed like a unit and is none.
    """
    content = _content(path)
    unit = undamaged(content, seal)
    if unit is None:
        return None
    with hdf5.opened(path, "runs", content) as file:
        table, names = file["table"][()], file["table"].attrs["metrics"].split()
        causes = tuple(text.decode() for text in file["cause"][()])
        metrics = dict(zip(names, table[:-1], strict=True))
        return UnitResult(unit, metrics, file["status"][()], table[-1], causes)


def _content(path: Path) -> bytes:
    """A file's bytes; none where another podusv removed it meanwhile, or where it is no file.

    Raises StorageError.
    """
    with files.storage_errors(f"cannot read {path}"), suppress(FileNotFoundError):
        return path.read_bytes() if path.is_file() else b""
    return b""


def _texts(texts: Sequence[str]) -> Any:
    content = [text.encode() for text in texts]
    return np.array(content, dtype=f"S{max(1, *map(len, content))}")
