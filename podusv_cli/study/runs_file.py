"""runs.h5: every run of a study in one table, written without holding it in memory."""

from __future__ import annotations

import ast
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from podusv_cli.core.errors import StorageError
from podusv_cli.core.kernel import Vector
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import METRICS
from podusv_cli.process.temporary_names import temporary_name
from podusv_cli.storage.files import new_file, storage_errors
from podusv_cli.storage.log import FILE, UNDATED, LogLayout, describe
from podusv_cli.study.expressions import FINISHED, parse_success, succeeded
from podusv_cli.study.runs import Mask
from podusv_cli.study.unit import BROKEN, MISSING, STATUSES, Codes, Unit, UnitResult

AXES = ("law", "cell", "draw")
SEAL = "sha256"  # of all other arrays, in the order of the file
Known = Mapping[str, Metric]
BLOCK = 2**22  # bytes hashed at a time
ROWS = 4096  # runs read at a time
HEAD = 1200  # bytes of what the file says of an array, roughly


@dataclass(frozen=True)
class Header:
    """What the table is about: labels of the axes, the identity, what was drawn, and metrics."""

    title: str
    identity: str
    laws: Sequence[str]
    cells: Sequence[str]
    wanted: int  # draws of each cell
    draws: Mapping[str, Any]
    metrics: Mapping[str, Metric]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of every array of runs."""
        return len(self.laws), len(self.cells), self.wanted


def write(path: Path, header: Header, results: Sequence[UnitResult] | Any) -> None:
    """Write the table, in place of an older one. `results` can be gone through more than once.

    Raises StorageError; the older table is then still there.
    """
    part = path.with_name(temporary_name())
    try:
        causes = {
            (header.laws.index(r.unit.law), r.unit.cell, r.unit.first + i): cause
            for r in results for i, cause in enumerate(r.causes) if cause
        }  # fmt: skip
        places = _lay_out(part, header, dict(sorted(causes.items())))
        with storage_errors(f"cannot write {path}"):
            _fill(part, header, places, results)
            os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _lay_out(
    part: Path, header: Header, causes: Mapping[tuple[int, int, int], str]
) -> dict[str, tuple[int, Any, tuple[int, ...]]]:
    """Make the file with everything but the runs; offset, type and shape of the arrays of runs."""
    layout = LogLayout()
    with h5py.File(layout, "w", **FILE, **UNDATED) as file:
        facts = {"title": header.title, "identity": header.identity, "status": " ".join(STATUSES)}
        describe(file, facts)
        scales = [_labels(file, "law", header.laws), _labels(file, "cell", header.cells)]
        scales.append(_labels(file, "draw", np.arange(header.shape[2], dtype=np.int32)))
        for name, numbers in header.draws.items():
            file.create_dataset(f"drawn/{name}", data=_column(numbers))
        file.create_dataset("failed_run", data=np.array(list(causes), np.int64).reshape(-1, 3))
        file.create_dataset("failed_cause", data=_labelled(list(causes.values()) or [""]))
        kinds: dict[str, Any] = {"status": np.uint8, "until": np.float64}
        kinds |= dict.fromkeys(header.metrics, np.float64)
        places = {n: _room(file, n, kind, header.shape, scales) for n, kind in kinds.items()}
        for name, metric in header.metrics.items():
            describe(file[name], {"units": metric.unit, "long_name": metric.meaning})
        places[SEAL] = _room(file, SEAL, np.uint8, (64,), ())
    with new_file(part, layout.size) as out:
        layout.write_to(out)
        out.truncate(max(layout.size, *(at + _size(k, s) for at, k, s in places.values())))
    return places


def bytes_of(shape: tuple[int, int, int], metrics: int, drawn: int) -> int:
    """Roughly the size of a table of so many laws, cells and draws."""
    of_a_run = 8 * (metrics + 1) + 1  # with `until` and `status`
    return int(np.prod(shape)) * of_a_run + shape[2] * (4 + 8 * drawn) + HEAD * (metrics + 2)


def _size(kind: Any, shape: tuple[int, ...]) -> int:
    return int(np.dtype(kind).itemsize * np.prod(shape))


def _room(
    file: h5py.File, name: str, kind: Any, shape: tuple[int, ...], scales: Sequence[h5py.Dataset]
) -> tuple[int, Any, tuple[int, ...]]:
    """An array whose numbers podusv writes; its offset, type and shape."""
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_obj_track_times(False)
    made.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    made.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    space, little = h5py.h5s.create_simple(shape), np.dtype(kind).newbyteorder("<")
    made = h5py.h5d.create(file.id, name.encode(), h5py.h5t.py_create(little), space, made)
    dataset = h5py.Dataset(made)
    for position, scale in enumerate(scales):
        dataset.dims[position].attach_scale(scale)
    return made.get_offset(), little, shape


def _labels(file: h5py.File, axis: str, labels: Any) -> h5py.Dataset:
    content = _labelled(labels) if isinstance(labels[0], str) else labels
    scale = file.create_dataset(axis, data=content)
    scale.make_scale(axis)
    return scale


def _labelled(words: Sequence[str]) -> Any:
    return np.array([str(word).encode() for word in words])


def _column(drawn: Any) -> Any:
    """A drawn quantity as HDF5 takes it: numbers, or words where any of the values is one."""
    values = np.array(drawn.tolist()) if drawn.dtype.kind == "O" else drawn
    return _labelled(values.tolist()) if values.dtype.kind == "U" else values


def _fill(part: Path, header: Header, places: Mapping[str, Any], results: Iterable[Any]) -> None:
    arrays = {
        name: np.memmap(part, kind, "r+", offset, shape)
        for name, (offset, kind, shape) in places.items()
    }
    seal = arrays.pop(SEAL)
    for name, array in arrays.items():
        array[...] = MISSING if name == "status" else np.nan
    for result in results:
        unit = result.unit
        rows = (header.laws.index(unit.law), unit.cell, slice(unit.first, unit.first + unit.count))
        arrays["status"][rows], arrays["until"][rows] = result.status, result.until
        for name, numbers in result.metrics.items():
            arrays[name][rows] = numbers
    seal[...] = np.frombuffer(_digest(arrays.values()).encode(), np.uint8)
    for array in (*arrays.values(), seal):
        array.flush()


def _digest(arrays: Iterable[Any]) -> str:
    found = hashlib.sha256()
    for array in arrays:
        flat = array.reshape(-1).view(np.uint8)
        for start in range(0, len(flat), BLOCK):
            found.update(flat[start : start + BLOCK])
    return found.hexdigest()


class Table:
    """runs.h5, open for reading: the `Runs` of a study; arrays are read when they are asked for."""

    def __init__(self, path: Path, success: str = FINISHED, known: Known = METRICS) -> None:
        """`success` is the expression for a run's. Raises StorageError for a damaged file."""
        self.path, self._known = path, known
        self._success = parse_success(success, known)
        try:
            self._file = h5py.File(path, "r")
            self.identity = self._file.attrs["identity"].decode()
            self.laws = tuple(word.decode() for word in self._file["law"][()])
            self.cells = tuple(word.decode() for word in self._file["cell"][()])
            self.wanted = len(self._file["draw"])
        except (OSError, KeyError, ValueError, RuntimeError, AttributeError) as error:
            raise StorageError(f"cannot read {path}: damaged ({error})") from error

    def check(self) -> None:
        """Raises StorageError where a number is not as it was written."""
        arrays = (self._file[name][()] for name in ("status", "until", *self.metrics))
        if _digest(arrays) != bytes(self._file[SEAL][()]).decode():
            raise StorageError(f"cannot read {self.path}: its numbers were altered")

    @cached_property
    def metrics(self) -> tuple[str, ...]:
        """The names of the metrics."""
        own = {*AXES, "status", "until", "drawn", "failed_run", "failed_cause", SEAL}
        return tuple(name for name in self._file if name not in own)

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

    def done(self, law: str) -> Mask:
        """Whether a run was tried."""
        return np.not_equal(self.status(law), MISSING)

    def finished(self, law: str) -> Mask:
        """Whether a run reached its end."""
        return np.equal(self.status(law), STATUSES.index("finished"))

    def broken(self, law: str) -> Mask:
        """Whether a run crashed, hung or was invalid."""
        return np.isin(self.status(law), [STATUSES.index(word) for word in BROKEN])

    def success(self, law: str) -> Mask:
        """Whether a run was a success."""
        read = {name: self.metric(law, name) for name in self.asked}
        return succeeded(self._success, read, self.finished(law), self._known)

    def failed(self, law: str) -> Mask:
        """Whether a run has a result and is no success."""
        return self.done(law) & ~self.success(law) & ~self.broken(law)

    @cached_property
    def asked(self) -> list[str]:
        """The metrics that success depends on."""
        used = {part.id for part in ast.walk(self._success) if isinstance(part, ast.Name)}
        return [name for name in self._known if name in used]

    @cached_property
    def drawn(self) -> dict[str, Any]:
        """The drawn quantities, one entry a draw."""
        found: dict[str, Any] = {}

        def note(name: str, thing: Any) -> None:  # returns None, so that all are visited
            if isinstance(thing, h5py.Dataset):
                content = thing[()]
                found[name] = np.char.decode(content) if content.dtype.kind == "S" else content

        if "drawn" in self._file:
            self._file["drawn"].visititems(note)
        return found

    @cached_property
    def causes(self) -> dict[tuple[int, int, int], str]:
        """Why runs did not finish, by law, cell and draw."""
        runs = map(tuple, self._file["failed_run"][()].tolist())
        return dict(zip(runs, (c.decode() for c in self._file["failed_cause"][()]), strict=False))

    def results(self) -> Iterator[UnitResult]:
        """The runs that are made, as units."""
        for position, law in enumerate(self.laws):
            status = self.status(law)
            for cell in range(len(self.cells)):
                for rows in stretches(status[cell] != MISSING):
                    for first in range(rows.start, rows.stop, ROWS):
                        part = range(first, min(first + ROWS, rows.stop))
                        yield self._unit(position, law, cell, part, status[cell])

    def _unit(self, place: int, law: str, cell: int, rows: range, status: Codes) -> UnitResult:
        part = slice(rows.start, rows.stop)
        return UnitResult(
            Unit(law, cell, rows.start, len(rows)),
            {name: self._file[name][place, cell, part] for name in self.metrics},
            status[part], self._file["until"][place, cell, part],
            tuple(self.causes.get((place, cell, draw), "") for draw in rows),
        )  # fmt: skip


def stretches(there: Any) -> list[range]:
    """The ranges of positions where a mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    return [range(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]
