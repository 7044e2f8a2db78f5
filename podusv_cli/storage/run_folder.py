"""Run folders: their names, writing and reading."""

from __future__ import annotations

import hashlib
import math
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from itertools import count, islice
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from podusv_cli.core import json_text
from podusv_cli.core.about import RunAbout
from podusv_cli.core.errors import StorageError
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.plugins import Plugin, Plugins
from podusv_cli.core.quantities import bytes_in_words
from podusv_cli.core.recording import Recording, Status
from podusv_cli.process.extras import Extras
from podusv_cli.storage import files, json_files, manifest, provenance
from podusv_cli.storage.files import read_text
from podusv_cli.storage.staging import Staging, Taken, remove_abandoned

LOG, ABOUT, THEORY, MISSING = "log.h5", "about.json", "theory.json", "missing.json"
RESOLVED, PROVENANCE = "resolved.yaml", "provenance.json"
STUDY, LOGS = "study.json", "logs"  # in the folder of a study
# Only laws with V have theory.json, and an older podusv wrote no about.json.
NEEDED = (LOG, "metrics.json", PROVENANCE, RESOLVED)


def default_folder(root: Path, name: str, resolved_yaml: str) -> Path:
    """`<root>/<name>/<UTC time>-<first 8 hex digits of the resolved scenario's SHA-256>`.

    A number is appended where a run of the same scenario in the same second has that name.
    """
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    digest = hashlib.sha256(resolved_yaml.encode()).hexdigest()[:8]
    return free_folder(root / name / f"{stamp}-{digest}")


def free_folder(folder: Path) -> Path:
    """The folder, or where that is taken the same name with a number appended."""
    return next(path for path in _numbered_folders(folder) if not os.path.lexists(path))


def _numbered_folders(folder: Path) -> Iterator[Path]:
    """The folder, then the names beside it that end in -2, -3, and so on."""
    yield folder
    for number in count(2):
        yield folder.with_name(f"{folder.name}-{number}")


class RunWriter:
    """Writes a folder that gets its final name when `finish` is called.

    Make it before the simulation, so that a place that cannot be written to is known at once.
    Leaving the `with` block without `finish` deletes the unfinished folder. An existing run folder
    is replaced only with `force`. Anything else is never replaced, except an empty folder. A run
    folder has a readable manifest and, hidden files aside, no files that the manifest does not
    know. Every method raises StorageError.

    If another process takes the name during the run, a number is appended. With `named`, which
    says that the user gave the name, this is an error after the folder is saved.

    `extras` has what could not be made, and whether the user ended it: `finish` writes missing.json
    and the status by it.
    """

    def __init__(
        self,
        final: Path,
        *,
        force: bool = False,
        named: bool = True,
        needed: float = 0.0,
        argv: Sequence[str] = (),
    ) -> None:
        """Check that `final` can be made and `needed` bytes are free; make the hidden folder.

        `force` replaces an older run folder, but only one that the user `named`; `argv` is the
        command, for provenance.json.
        """
        self.final, self._force, self._named = final, force and named, named
        self._argv, self._began, self.extras = argv, datetime.now(UTC), Extras()
        remove_abandoned(final.parent)  # may put back a run folder that a killed run was replacing
        _check_replaceable(final, force)
        self._staging = Staging(final)
        try:
            check_free_space(final, needed, "log less often (log.every), or elsewhere (--out)")
        except StorageError:
            # The `with` block is not entered, so that nothing else would remove the hidden folder.
            self._staging.discard()
            raise

    @property
    def folder(self) -> Path:
        """Where the files are until `finish`; a comparison writes its runs into it."""
        return self._staging.folder

    def add(self, name: str, content: bytes) -> None:
        """Write a new file; `name` is relative, with `/` for a file in a folder inside."""
        files.create(self._place(name), content)

    def add_json(self, name: str, content: Mapping[str, Any]) -> None:
        """Write a new JSON file, null for numbers that are not finite."""
        self.add(name, json_text.encode(content))

    def add_origin(self, plugins: Iterable[Plugin] = (), **more: Any) -> dict[str, Any]:
        """Write provenance.json; what is in it, for a page."""
        origin = provenance.collect(self._argv, self._began, datetime.now(UTC), plugins)
        self.add_json(PROVENANCE, {**origin, **more})
        return origin

    @property
    def status(self) -> Status:
        """How the manifest says that the work ended, of a folder that is no run."""
        return "interrupted" if self.extras.interrupted else "finished"

    def finish(self, status: Status | None = None, missing: str = "") -> Path:
        """Write the manifest and rename the folder to its final path, which is returned.

        An interrupted result, or an incomplete one (`missing` says why), replaces nothing: a number
        is appended to its name. The StorageError for a name that is taken says where the complete
        folder was saved instead.
        """
        status = status or self.status
        whole = status != "interrupted"
        if self.extras.missing:
            self.add_json(MISSING, self.extras.as_json())
        remove_abandoned(self.folder)  # left by killed processes of a comparison
        manifest.write(self.folder, status)
        # Before the renaming: after a crash the final name must not stand for missing files.
        for inner, _, _ in os.walk(self.folder):
            files.sync_folder(Path(inner))
        try:
            # Once more: something may have come there while the simulation ran.
            _check_replaceable(self.final, self._force)
            self._staging.publish(replace=self._force and whole and not missing)
        except Taken as error:
            other = self._publish_beside()
            if self._named and whole:
                texts = (missing, str(error), f"this result is in {other} instead")
                raise StorageError("; ".join(filter(None, texts))) from error
        return self._staging.final

    def _publish_beside(self) -> Path:
        """Publish under the first free number, and return that folder.

        Another process may take a number meanwhile, so each is tried.
        """
        # Without the first, which is the name that was taken.
        for path in islice(_numbered_folders(self.final), 1, None):
            with suppress(Taken):
                _check_replaceable(path, force=False)
                self._staging.final = path
                self._staging.publish(replace=False)
                return path
        raise AssertionError("there is always another number")

    def _place(self, name: str) -> Path:
        """Where the file `name` of this run is written, its folder made."""
        path = manifest.place(self.folder, name)
        files.make_folder(path.parent)
        return path

    def __enter__(self) -> Self:
        """The writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Delete the folder if it was not finished; what was raised goes on."""
        self._staging.discard()


def _check_replaceable(final: Path, force: bool) -> None:
    """Raises StorageError if `final` exists and must not be replaced; Taken where it is there.

    An empty folder may be replaced, a finished run folder with `force`.
    """
    if final.name in ("", ".."):
        raise StorageError(f"cannot make {final}: a folder's own name is needed")
    with files.storage_errors(f"cannot make {final}"):
        if not os.path.lexists(final):
            return
        if final.is_symlink() or not final.is_dir():
            raise Taken(f"{final} exists and is not a folder")
        try:
            if not any(final.iterdir()):
                return
        except FileNotFoundError:  # another writer has just renamed it
            return
    try:
        contents = manifest.read(final)
        foreign = manifest.foreign(final, contents)
    except StorageError as error:  # or another writer has just renamed it
        text = f"{final} exists and is not a finished run folder; name another folder with --out"
        raise Taken(text) from error
    if not force:
        raise Taken(f"{final} exists already; --force replaces it")
    shown = (name for name in foreign if not Path(name).name.startswith("."))
    if other := next(shown, ""):
        raise Taken(f"{final} holds {other}, which is not the run's; --force would remove it")


def check_free_space(final: Path, needed: float, remedy: str) -> None:
    """Raises StorageError if fewer than `needed` bytes are free on the disk of `final`.

    `remedy` is what the message advises. The folder need not be there yet.
    """
    with files.storage_errors(f"cannot make {final}"):
        place = final.absolute()  # as "." has no parents
        there = next(path for path in (place, *place.parents) if path.exists())
        free = shutil.disk_usage(there).free
    if needed > free:
        raise StorageError(
            f"cannot make {final}: it takes {bytes_in_words(needed)} of disk or more, and "
            f"{bytes_in_words(free)} are free; {remedy}"
        )


@dataclass(frozen=True)
class UnreadLog:
    """A log.h5 that is read when it is first asked for, once for all who share it."""

    path: Path

    @cached_property
    def recording(self) -> Recording:
        """Its content. Raises StorageError."""
        # Here, so that commands that look at numbers alone do not load HDF5.
        from podusv_cli.storage import log_reader  # h5py is slow to import

        return log_reader.read_log(self.path)

    def __getstate__(self) -> dict[str, Path]:
        """Its place alone: another process reads the file itself, instead of taking its numbers."""
        return {"path": self.path.absolute()}


@dataclass(frozen=True)
class RunFolder:
    """The files of a finished run folder. `metrics` has None where a number was not finite.

    `about` is None where an older podusv wrote the folder.
    """

    path: Path
    status: Status
    metrics: dict[str, float | None]
    provenance: dict[str, Any]
    resolved_yaml: str
    theory: dict[str, Any] = field(default_factory=dict)  # empty without a Lyapunov function
    about: RunAbout | None = None

    @property
    def has_log(self) -> bool:
        """Whether its log is there; a folder may be packed without."""
        return (self.path / LOG).exists()

    @cached_property
    def log(self) -> UnreadLog:
        """Its log, read on first use."""
        return UnreadLog(self.path / LOG)

    @property
    def recording(self) -> Recording:
        """The content of log.h5. Raises StorageError."""
        return self.log.recording

    def as_run(self, label: str, about: RunAbout, plugins: Plugins = ()) -> PastRun:
        """The run in it under a label, NaN for metrics that were not finite.

        `about` may be made of the scenario where an older podusv wrote none. `plugins` are those
        that the scenario names.
        """
        numbers = {n: math.nan if x is None else float(x) for n, x in self.metrics.items()}
        return PastRun(
            label, about, self.log, numbers, plugins=plugins, folder=self.path, theory=self.theory
        )


def open_run(folder: Path, *, optional: str = "") -> RunFolder:
    """Open a run folder whose files are unchanged since it was finished.

    Raises StorageError naming the first fault. The file `optional` may be missing.
    """
    contents = manifest.check(folder, optional)
    missing = [name for name in NEEDED if name not in contents.files]
    if missing:
        raise StorageError(f"{folder} is not the folder of a run: it has no {missing[0]}")
    return RunFolder(
        path=folder,
        status=contents.status,
        metrics=_metrics(folder / "metrics.json"),
        provenance=json_files.read(folder / PROVENANCE),
        resolved_yaml=read_text(folder / RESOLVED),
        theory=json_files.read(folder / THEORY) if THEORY in contents.files else {},
        about=json_files.read_as(folder / ABOUT, RunAbout) if ABOUT in contents.files else None,
    )


def _metrics(path: Path) -> dict[str, float | None]:
    """The metrics of a metrics.json by name, None where one is not known. Raises StorageError."""
    metrics = json_files.read(path).get("metrics")
    if not isinstance(metrics, dict):
        raise StorageError(f"{path} holds no metrics")
    for name, number in metrics.items():
        if type(number) not in (int, float, type(None)):
            raise StorageError(f"{path}: damaged: {name} is no number")
    return metrics
