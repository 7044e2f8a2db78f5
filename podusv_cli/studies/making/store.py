"""The folder of a study: units as they come, then runs.h5 with every run in one table.

    study.json     what the study is (identity), how many draws were asked for, and when
    units/*.unit   a file a unit, each written whole; gone once they are in runs.h5
    runs.h5        every run, dimensions (law, cell, draw)

runs.h5 holds one dataset a metric, `status` (a code, see its attribute), `until` [s] and causes. A
unit is one line of JSON (law, cell, draws, names of metrics, causes, a digest of all bytes) before
its numbers: the metrics and `until`, 64 bits each, then a byte of status for each draw. A unit that
is damaged or belongs to another identity is not read and not counted; such a runs.h5 is an error,
as it may be all there is.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, replace
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from podusv_cli.core.about import StudyAbout, SweepCall
from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.scenario.plugins import FOLDER, continue_with
from podusv_cli.storage import files, manifest
from podusv_cli.storage.run_folder import STUDY
from podusv_cli.studies.counting import runs_file
from podusv_cli.studies.counting.runs import Mask, Unit, UnitResult
from podusv_cli.studies.making import record, runs_writer
from podusv_cli.studies.making.plan import digest, disagreements

UNITS, RUNS = "units", "runs.h5"
SCENARIO = "scenario.yaml"  # whole: it refers to no other file but plug-ins beside it
UNFINISHED = (SCENARIO, UNITS, RUNS, FOLDER, "provenance.json")  # in any study's folder
SEAL = "sha256"
RunKey = tuple[int, int, int]  # the positions of its law, its cell and its draw


class Store:
    """A study's folder."""

    def __init__(self, folder: Path, about: StudyAbout) -> None:
        """`about` is the study of its runs."""
        self.folder, self.about, self.seal = folder, about, digest(about.identity)

    def open(self, started: str, texts: Mapping[str, str] = MappingProxyType({})) -> None:
        """Make the folder, or check that it holds this very study, and note what is asked for.

        `started` is the time of this call in ISO 8601. `texts` has the scenario and its plug-ins by
        the names of their files, where they are to be written. Raises UsageError where it holds
        another study, naming what is different, and StorageError.
        """
        history: tuple[SweepCall, ...] = ()
        known = (self.folder / STUDY).exists()
        if known:
            there = record.read_identity(self.folder)
            self._agree(self.folder, there.identity)
            history = there.history
            if self.about.draws < there.draws:
                raise UsageError(
                    f"{self.folder} has {there.draws} draws; ask for as many or more, or name "
                    "another folder with --out, or begin anew with --force"
                )
        elif not files.is_empty(self.folder):
            raise UsageError(f"{self.folder} is no study and not empty; name another with --out")
        call = SweepCall(draws=self.about.draws, started=started)
        self.about = self.about.model_copy(update={"history": (*history, call)})
        # With more draws in study.json than in the scenario, the study could not be continued. And
        # without study.json, a folder that is not empty is no study.
        if known:
            files.write_texts(self.folder, texts)
        files.make_folder(self.folder)
        record.write(self.folder, self.about)
        files.make_folder(self.folder / UNITS)
        if not known:
            files.write_texts(self.folder, texts)

    def clear(self) -> None:
        """Remove the study that the folder holds, whichever it is.

        Raises UsageError where the folder has something else, too.
        """
        manifest.remove(self.folder, "study", STUDY, UNFINISHED)

    def agree(self, other: Store) -> None:
        """Raise UsageError where another folder holds another study, naming what is different."""
        self._agree(other.folder, other.about.identity, "leave it out")

    def _agree(
        self,
        folder: Path,
        identity: Mapping[str, Any],
        remedy: str = "name another folder with --out, or begin anew with --force",
    ) -> None:
        """Raise UsageError where `identity` is not this study's.

        The message names `folder` and the `remedy`.
        """
        if different := disagreements(identity, self.about.identity):
            raise UsageError(f"{folder} holds another study: {different}; {remedy}")

    def write(self, result: UnitResult) -> None:
        """Keep the result of a unit. Raises StorageError."""
        unit = result.unit
        # With its count, since half of a unit begins at the same draw.
        name = f"{unit.law}-{unit.cell}-{unit.first}-{unit.count}.unit"
        files.write_bytes(self.folder / UNITS / name, encode_unit(result, self.seal))

    def results(self) -> Iterator[UnitResult]:
        """Every undamaged unit of this study in the folder, and what runs.h5 has already."""
        for earlier in self._earlier():
            yield from earlier.results()
        for path in self._units():
            if result := read(path, self.seal):
                yield result

    def _units(self) -> list[Path]:
        return sorted((self.folder / UNITS).glob("*.unit"))

    def write_runs(self) -> runs_file.RunsTable:
        """Put every run into runs.h5, and return its table.

        The files of units are removed once no run is missing. Another process may add units
        meanwhile, which are left alone. Raises StorageError.
        """
        earlier, units, causes = [*self._earlier()], list[Path](), dict[RunKey, str]()
        # For the causes alone; each is read again when it is written, so that few are in memory.
        for path in self._units():
            if result := read(path, self.seal):
                units.append(path)
                causes |= self._causes(result)
        for table in earlier:
            # Nothing is new: the table is as it would be written.
            if not units and table.wanted == self.about.draws:
                return table
            causes |= table.causes
        path = self.folder / RUNS
        runs_writer.write(path, self.about, self.seal, causes, self._these(earlier, units))
        # Read back and checked, before the only other copy is removed.
        runs = self.runs()
        if all(runs.tried(law).all() for law in self.about.laws):
            with files.storage_errors(f"cannot remove the files in {self.folder / UNITS}"):
                for path in units:
                    path.unlink(missing_ok=True)
        return runs

    def _causes(self, result: UnitResult) -> dict[RunKey, str]:
        """Why runs of a unit did not finish, by (law, cell, draw); finished runs are left out."""
        unit, law = result.unit, self.about.laws.index(result.unit.law)
        causes = zip(unit.draws, result.causes, strict=True)
        return {(law, unit.cell, draw): cause for draw, cause in causes if cause}

    def _these(
        self, earlier: Sequence[runs_file.RunsTable], units: Sequence[Path]
    ) -> Iterator[UnitResult]:
        """The results in `earlier` tables and in `units`, each with all metrics of the study.

        `units` are files of results. Raises StorageError where a unit has metrics that study.json
        does not know.
        """
        there = (result for table in earlier for result in table.results())
        for result in chain(there, filter(None, (read(path, self.seal) for path in units))):
            self._check_metrics(set(result.metrics) <= set(self.about.measured))
            undefined = np.full(result.unit.count, np.nan)  # of laws that do not have a metric
            metrics = {name: result.metrics.get(name, undefined) for name in self.about.measured}
            yield replace(result, metrics=metrics)

    def runs(self) -> runs_file.RunsTable:
        """The table of runs.h5, checked against its digests. Raises StorageError, with a remedy."""
        path = self.folder / RUNS
        try:
            table = runs_file.RunsTable(path, self.about.success, self.about.metrics)
            table.check()
            own = self.about.laws, self.about.cells
            if table.identity != self.seal or (table.laws, table.cells) != own:
                raise StorageError(f"cannot read {path}: its runs are of another study")
        except StorageError as error:
            raise StorageError(
                f"{error}; restore the file, or move it away and simulate its runs again with: "
                f"{continue_with('sweep run', self.folder)}"
            ) from error
        self._check_metrics(set(table.metrics) == set(self.about.measured))
        return table

    def _check_metrics(self, fit: bool) -> None:
        """Raises StorageError unless the metrics of study.json and of the runs `fit`."""
        if not fit:
            raise StorageError(
                f"cannot read {self.folder / STUDY}: damaged, it has other metrics than the runs; "
                "restore the file"
            )

    def _earlier(self) -> Iterator[runs_file.RunsTable]:
        """runs.h5, if it is there. Raises StorageError where it is damaged or of another study."""
        if os.path.lexists(self.folder / RUNS):
            yield self.runs()

    def covered_draws(self) -> dict[tuple[str, int], Mask]:
        """By law and cell, which of the wanted draws (draws,) are there."""
        there = {
            (law, cell): np.zeros(self.about.draws, bool)
            for law in self.about.laws
            for cell in range(len(self.about.cells))
        }
        for earlier in self._earlier():
            for (law, cell), mask in there.items():
                # The table has fewer draws where more are asked for now.
                mask[: earlier.wanted] = earlier.tried(law)[cell]
        for path in self._units():
            if result := read(path, self.seal):
                unit = result.unit
                there[unit.law, unit.cell][unit.first : unit.draws.stop] = True
        return there


def encode_unit(result: UnitResult, seal: str) -> bytes:
    """A unit as the content of a file; `seal` is the digest of the study's identity.

    A line of JSON, then the metrics and end times as little-endian floats of 64 bits, one row
    (draws,) each, then the statuses as bytes.
    """
    facts = {
        "identity": seal,
        "unit": astuple(result.unit),
        "metrics": [*result.metrics],
        "causes": result.causes,
    }
    table = np.array([*result.metrics.values(), result.until], "<f8")
    numbers = table.tobytes() + np.array(result.status, np.uint8).tobytes()
    return _head(facts, numbers) + numbers


def _head(facts: Mapping[str, Any], numbers: bytes) -> bytes:
    """The line before a unit's numbers: what it is, and a digest of this and of the numbers."""
    sha = hashlib.sha256(json.dumps(facts).encode() + numbers).hexdigest()
    return json.dumps({**facts, SEAL: sha}).encode() + b"\n"


def decode_unit(content: bytes, seal: str) -> UnitResult | None:
    """The unit of a file's `content`; None where it is damaged or of another identity (`seal`)."""
    end = content.find(b"\n") + 1
    try:
        facts = json.loads(content[:end])
        del facts[SEAL]
        # The head is made anew and compared, which checks the digest and the order of its keys at
        # once.
        if content[:end] != _head(facts, content[end:]) or facts["identity"] != seal:
            return None
        names, unit = facts["metrics"], Unit(*facts["unit"])
        shape = len(names) + 1, unit.count
        table = np.frombuffer(content, "<f8", math.prod(shape), end).reshape(shape)
        status = np.frombuffer(content, np.uint8, unit.count, end + table.nbytes)
        metrics = dict(zip(names, table[:-1], strict=True))
        return UnitResult(unit, metrics, status, table[-1], tuple(facts["causes"]))
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def read(path: Path, seal: str) -> UnitResult | None:
    """The unit in a file; None where it is damaged, no file, or of another identity.

    None, too, where another podusv removed it meanwhile. Raises StorageError.
    """
    with files.storage_errors(f"cannot read {path}"), suppress(FileNotFoundError):
        return decode_unit(path.read_bytes(), seal) if path.is_file() else None
    return None
