"""Writing runs.h5 piece by piece, so that a million runs take no memory."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from podusv_cli.core.about import StudyAbout
from podusv_cli.core.errors import StorageError
from podusv_cli.process.temporary_names import temporary_name
from podusv_cli.storage.files import new_file, storage_errors
from podusv_cli.storage.log import FILE, UNDATED, LogLayout, describe, write_at
from podusv_cli.studies.counting.runs import (
    DRAWN,
    NOT_MADE,
    SEAL,
    SEAL_OF_THE_REST,
    STATUSES,
    UnitResult,
)
from podusv_cli.studies.counting.runs_file import ROWS, digest, digest_of_the_rest
from podusv_cli.studies.making import record
from podusv_cli.studies.making.draws import table

BLOCK = 2**20  # bytes written and read at a time
NUMBERS = "iuf"  # numpy's kinds of numbers
HEAD = 1200  # bytes of what the file says of an array, roughly
Causes = Mapping[tuple[int, int, int], str]  # by law, cell and draw


def write(
    path: Path, study: StudyAbout, identity: str, causes: Causes, results: Iterable[UnitResult]
) -> None:
    """Write the table of a study with the `results`, in place of an older one.

    `identity` digests the study's identity. `causes` say why runs did not finish, by (law, cell,
    draw). Raises StorageError; the older table is then still there.
    """
    # Beside the old table, so that replacing it is one step of the file system.
    part = path.with_name(temporary_name())
    try:
        places = _lay_out(part, study, identity, dict(sorted(causes.items())))
        with storage_errors(f"cannot write {path}"):
            _fill(part, study, places, results)
            os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


@dataclass(frozen=True)
class Extent:
    """Where an array is in the file, and its type and shape."""

    offset: int
    kind: np.dtype[Any]
    shape: tuple[int, ...]

    @property
    def end(self) -> int:
        """The byte after its last."""
        return self.offset + self.kind.itemsize * math.prod(self.shape)

    def place(self, *index: int) -> int:
        """The offset of an entry."""
        flat = np.ravel_multi_index(index, self.shape)
        return self.offset + self.kind.itemsize * int(flat)

    def content(self, numbers: Any) -> bytes:
        """Numbers as they are in the file."""
        return np.asarray(numbers, self.kind).tobytes()


def _lay_out(part: Path, study: StudyAbout, identity: str, causes: Causes) -> dict[str, Extent]:
    """Make the file `part` with everything but long arrays; where each of these lies, by name.

    HDF5 only describes the long arrays. Their bytes are written later, without HDF5, block by
    block.
    """
    layout, places, wanted = LogLayout(), dict[str, Extent](), study.draws
    (sweep, stream), shape = record.drawing(study), (len(study.laws), len(study.cells), wanted)
    with h5py.File(layout, "w", **FILE, **UNDATED) as file:
        describe(file, {"title": study.name, "identity": identity, "status": " ".join(STATUSES)})
        scales = [_labels(file, "law", study.laws), _labels(file, "cell", study.cells)]
        scales.append(_labels(file, "draw", np.arange(wanted, dtype=np.int32)))
        # One draw shows whether a quantity is a number; words have no fixed length in the file.
        for name, first in table(sweep, 0, 1, stream).items():
            if first.dtype.kind in NUMBERS:
                path = f"{DRAWN}/{name}"
                places[path] = _extent(file, path, first.dtype, (wanted,), ())
            else:
                words = table(sweep, 0, wanted, stream)[name]
                file.create_dataset(f"{DRAWN}/{name}", data=_column(words))
        file.create_dataset("failed_run", data=np.array(list(causes), np.int64).reshape(-1, 3))
        # numpy takes an empty list for numbers, so that one empty text stands for no text.
        file.create_dataset("failed_cause", data=_label_array(list(causes.values()) or [""]))
        kinds: dict[str, Any] = {"status": np.uint8, "until": np.float64}
        kinds |= dict.fromkeys(study.measured, np.float64)
        for name, kind in kinds.items():
            places[name] = _extent(file, name, kind, shape, scales)
        for name in study.measured:
            own = study.metrics[name]
            describe(file[name], {"units": own.unit, "long_name": own.meaning})
        for seal in (SEAL, SEAL_OF_THE_REST):
            # A seal is a SHA-256 in 64 hexadecimal digits.
            places[seal] = _extent(file, seal, np.uint8, (64,), ())
    with new_file(part, layout.size) as out:
        layout.write_to(out)
        out.truncate(max(layout.size, *(extent.end for extent in places.values())))
    return places


def bytes_of(shape: tuple[int, int, int], metrics: int, drawn: int) -> int:
    """Roughly the size of the table [bytes] for `shape` (laws, cells, draws).

    `metrics` and `drawn` are the numbers of metrics and of drawn quantities.
    """
    of_a_run = 8 * (metrics + 1) + 1  # with `until` and `status`
    return int(np.prod(shape)) * of_a_run + shape[2] * (4 + 8 * drawn) + HEAD * (metrics + 2)


def _extent(
    file: h5py.File, name: str, kind: Any, shape: tuple[int, ...], scales: Sequence[h5py.Dataset]
) -> Extent:
    """Describe an array in `file` whose bytes podusv writes itself; returns where they lie.

    `kind` is the type of its numbers, `scales` are the labels of its axes. Space is allotted at
    once (EARLY) and not filled (NEVER), so that its place in the file is known now.
    """
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    # The same results make the same bytes, whenever they are written.
    made.set_obj_track_times(False)
    made.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    made.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    inside = h5py.h5p.create(h5py.h5p.LINK_CREATE)
    inside.set_create_intermediate_group(True)
    space, little = h5py.h5s.create_simple(shape), np.dtype(kind).newbyteorder("<")
    made = h5py.h5d.create(file.id, name.encode(), h5py.h5t.py_create(little), space, made, inside)
    dataset = h5py.Dataset(made)
    for position, scale in enumerate(scales):
        dataset.dims[position].attach_scale(scale)
    return Extent(made.get_offset(), little, shape)


def _labels(file: h5py.File, axis: str, labels: Any) -> h5py.Dataset:
    """The dimension scale of an axis that has labels or numbers."""
    content = _label_array(labels) if isinstance(labels[0], str) else labels
    scale = file.create_dataset(axis, data=content)
    scale.make_scale(axis)
    return scale


def _label_array(words: Sequence[str]) -> Any:
    return np.array([str(word).encode() for word in words])


def _column(drawn: Any) -> Any:
    """A drawn quantity as HDF5 takes it: numbers, or words where any of the values is one."""
    values = np.array(drawn.tolist()) if drawn.dtype.kind == "O" else drawn
    return _label_array(values.tolist()) if values.dtype.kind == "U" else values


def _fill(
    part: Path, study: StudyAbout, places: dict[str, Extent], results: Iterable[UnitResult]
) -> None:
    """Write the long arrays into `part`, piece by piece, and the two digests last.

    `places` has where each lies and is used up. (An array in memory that is the file would take as
    much memory, and a full disk would end the process.)
    """
    seal, rest = places.pop(SEAL), places.pop(SEAL_OF_THE_REST)
    wanted, (sweep, stream) = study.draws, record.drawing(study)
    drawn = {name: places.pop(name) for name in list(places) if name.startswith(f"{DRAWN}/")}
    with part.open("r+b", buffering=0) as out:
        for first in range(0, wanted if drawn else 0, ROWS):
            columns = table(sweep, first, min(ROWS, wanted - first), stream)
            for name, extent in drawn.items():
                column = columns[name.removeprefix(f"{DRAWN}/")]
                write_at(out, extent.place(first), extent.content(column))
        for name, extent in places.items():
            _blank(out, extent, NOT_MADE if name == "status" else np.nan)
        for result in results:
            unit = result.unit
            # Its place would be in the next law's rows.
            if unit.draws.stop > wanted:
                raise StorageError(
                    f"cannot write runs.h5 of {wanted} draws: there are runs of "
                    f"{unit.draws.stop} draws, which another process has added; run it again"
                )
            at = (study.laws.index(unit.law), unit.cell, unit.first)
            arrays = {**result.metrics, "status": result.status, "until": result.until}
            for name, numbers in arrays.items():
                write_at(out, places[name].place(*at), places[name].content(numbers))
        computed = digest(piece for extent in places.values() for piece in _pieces(out, extent))
        write_at(out, seal.offset, computed.encode())
        with h5py.File(part, "r") as file:
            computed = digest_of_the_rest(file)
        write_at(out, rest.offset, computed.encode())
        os.fsync(out.fileno())


def _blank(out: Any, extent: Extent, content: float) -> None:
    """Fill the room of an array with one number, block by block: runs that are not made stay so."""
    for start in range(extent.offset, extent.end, BLOCK):
        count = (min(BLOCK, extent.end - start)) // extent.kind.itemsize
        write_at(out, start, extent.content(np.full(count, content)))


def _pieces(out: Any, extent: Extent) -> Iterator[bytes]:
    """The bytes of an array in the file, piece by piece."""
    for start in range(extent.offset, extent.end, BLOCK):
        out.seek(start)
        yield out.read(min(BLOCK, extent.end - start))
