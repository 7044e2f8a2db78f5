"""runs.h5: every run of a study in one table; `runs_writer` writes it."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from podusv_cli.core.about import MetricAbout
from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.storage import hdf5
from podusv_cli.studies.counting.expressions import (
    OfOneRun,
    judge_success,
    parse_success,
    shortfalls,
)
from podusv_cli.studies.counting.runs import (
    AXES,
    BROKEN,
    DRAWN,
    FAILED,
    NOT_MADE,
    OWN,
    SEAL,
    SEAL_OF_THE_REST,
    STATUSES,
    Codes,
    Mask,
    Unit,
    UnitResult,
)

Known = Mapping[str, MetricAbout]
ROWS = 4096  # runs read or written at a time


def digest(pieces: Iterable[Any]) -> str:
    """A digest of the bytes of arrays, given piece by piece."""
    sha = hashlib.sha256()
    for piece in pieces:
        sha.update(piece)
    return sha.hexdigest()


def digest_of_the_rest(file: h5py.File) -> str:
    """SHA-256 of all that SEAL does not cover: axes, causes and drawn quantities.

    Names and types are included, so that no two columns can be exchanged.
    """
    names = [*AXES, *FAILED]
    if DRAWN in file:
        file[DRAWN].visititems(
            lambda name, thing: (
                names.append(f"{DRAWN}/{name}") if isinstance(thing, h5py.Dataset) else None
            )
        )
    arrays = ((name, file[name][()]) for name in names)
    return digest(
        piece for name, a in arrays for piece in (f"{name} {a.dtype.str}\n".encode(), a.tobytes())
    )


class RunsTable:
    """runs.h5, open for reading, as `StudyRuns`; arrays are read when they are asked for."""

    def __init__(self, path: Path, success: str, known: Known) -> None:
        """Open `path`.

        `success` is the condition that makes a run a success, in the language of expressions;
        `known` has the metrics that it may name. Raises StorageError for a damaged file.
        """
        self.path, self._known, self._successes = path, known, dict[str, Mask]()
        self._success = parse_success(success, known)
        self._open = ExitStack()
        self._file = self._open.enter_context(hdf5.open_hdf5(path, "runs"))
        with hdf5.readable(path, "runs"):
            self.identity = self._file.attrs["identity"].decode()
            self.laws = tuple(word.decode() for word in self._file["law"][()])
            self.cells = tuple(word.decode() for word in self._file["cell"][()])
            self.wanted = len(self._file["draw"])

    def check(self) -> None:
        """Compare the content with its digests. Raises StorageError where anything was altered."""
        with hdf5.readable(self.path, "runs"):
            arrays = (self._file[name] for name in ("status", "until", *self.metrics))
            digests = {SEAL: digest(law for array in arrays for law in array)}
            if SEAL_OF_THE_REST in self._file:
                digests[SEAL_OF_THE_REST] = digest_of_the_rest(self._file)
            same = all(bytes(self._file[name][()]) == own.encode() for name, own in digests.items())
        if not same:
            raise StorageError(f"cannot read {self.path}: its numbers were altered")

    @cached_property
    def metrics(self) -> tuple[str, ...]:
        """The names of the metrics."""
        return tuple(name for name in self._file if name not in OWN)

    def metric(self, law: str, name: str) -> Vector:
        """A metric of every run of a law, shape (cell, draw); NaN where it has none."""
        if name not in self.metrics:
            return np.full((len(self.cells), self.wanted), np.nan)
        return np.asarray(self._file[name][self.laws.index(law)])

    def status(self, law: str) -> Codes:
        """How every run of a law ended, positions in STATUSES."""
        return np.asarray(self._file["status"][self.laws.index(law)])

    def until(self, law: str) -> Vector:
        """The time that every run of a law reached [s]."""
        return np.asarray(self._file["until"][self.laws.index(law)])

    def tried(self, law: str) -> Mask:
        """Whether a run was tried."""
        return np.not_equal(self.status(law), NOT_MADE)

    @cached_property
    def common(self) -> Mask:
        """The draws (cell, draw) that all laws were tried on."""
        return np.asarray(np.logical_and.reduce([self.tried(law) for law in self.laws]))

    def done(self, law: str) -> Mask:
        """The same for every law, so that an unfinished study compares them on the same draws."""
        return self.common

    def finished(self, law: str) -> Mask:
        """Whether a run reached its end."""
        return np.equal(self.status(law), STATUSES.index("finished"))

    def broken(self, law: str) -> Mask:
        """Whether a run crashed, hung or was invalid."""
        return np.isin(self.status(law), [STATUSES.index(word) for word in BROKEN])

    def success(self, law: str) -> Mask:
        """Whether a run was a success, a mask (cells, draws).

        It is computed once a law, since it is asked often.
        """
        if law not in self._successes:
            successes = judge_success(
                self._success, self._read(law), self.finished(law), self._known
            )
            self._successes[law] = np.ascontiguousarray(successes)
        return self._successes[law]

    def failed(self, law: str) -> Mask:
        """Whether a run has a result and is no success."""
        return self.done(law) & ~self.success(law) & ~self.broken(law)

    def shortfalls_of(self, law: str) -> list[Vector]:
        """By how much every run misses each comparison of success; see `shortfalls`."""
        runs = OfOneRun(self._known, values=self._read(law), ended=self.finished(law))
        return [*shortfalls(self._success, runs)]

    def _read(self, law: str) -> dict[str, Vector]:
        """The metrics of a law that its condition of success reads, each (cells, draws)."""
        return {name: self.metric(law, name) for name in self.success_metrics}

    @cached_property
    def success_metrics(self) -> list[str]:
        """The metrics that success depends on."""
        used = {part.id for part in ast.walk(self._success) if isinstance(part, ast.Name)}
        return [name for name in self._known if name in used]

    @property
    def drawn_quantities(self) -> dict[str, Any]:
        """The drawn quantities by name, each (draws,): numbers, or an array of words."""
        columns: dict[str, Any] = {}

        def note(name: str, thing: Any) -> None:  # returns None, so that all are visited
            """Keep the column of a drawn quantity: numbers, or words as text."""
            if isinstance(thing, h5py.Dataset):
                content = thing[()]
                columns[name] = np.char.decode(content) if content.dtype.kind == "S" else content

        if DRAWN in self._file:
            self._file[DRAWN].visititems(note)
        return columns

    @cached_property
    def causes(self) -> dict[tuple[int, int, int], str]:
        """Why runs did not finish, by law, cell and draw."""
        runs = map(tuple, self._file["failed_run"][()].tolist())
        # Not strict: without failed runs the file has one empty cause.
        return dict(zip(runs, (c.decode() for c in self._file["failed_cause"][()]), strict=False))

    def results(self) -> Iterator[UnitResult]:
        """The runs that are made, as units of at most ROWS draws, so that memory stays small."""
        for position, law in enumerate(self.laws):
            status = self.status(law)
            for cell in range(len(self.cells)):
                for rows in stretches(status[cell] != NOT_MADE):
                    for first in range(rows.start, rows.stop, ROWS):
                        part = range(first, min(first + ROWS, rows.stop))
                        yield self._unit(position, law, cell, part, status[cell])

    def _unit(self, place: int, law: str, cell: int, rows: range, status: Codes) -> UnitResult:
        """The results of some draws (`rows`) of a law in a cell; `place` is the law's position.

        `status` has the codes of all draws.
        """
        part = slice(rows.start, rows.stop)
        return UnitResult(
            Unit(law, cell, rows.start, len(rows)),
            {name: self._file[name][place, cell, part] for name in self.metrics},
            status[part],
            self._file["until"][place, cell, part],
            tuple(self.causes.get((place, cell, draw), "") for draw in rows),
        )


def stretches(there: Any) -> list[range]:
    """The maximal ranges of positions where the mask `there` (n,) is true, in order."""
    # A False at either end makes every stretch begin and end with a change.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    return [range(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]
