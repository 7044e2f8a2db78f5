"""A folder as one zip file: the same files, the same bytes. What others packed is not trusted."""

from __future__ import annotations

import os
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path, PurePosixPath
from shutil import copyfileobj
from typing import BinaryIO

from podusv_cli.core.errors import StorageError
from podusv_cli.core.quantities import bytes_in_words
from podusv_cli.core.system import stays_inside, sync_disk
from podusv_cli.process.temporary_names import remove_abandoned_files, temporary_name
from podusv_cli.storage import files

NOTHING: Mapping[str, bytes] = {}
EARLIEST = (1980, 1, 1, 0, 0, 0)  # the time of every file: the first that the format has
PLAIN = stat.S_IFREG | 0o644  # a file that its owner writes and all read, on any machine
MOST_FILES = 100_000
# Logs become 1 to 3 times as large; the format reaches 1032, and any ratio where files share bytes.
LARGEST_RATIO = 100
READ = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED
ENCRYPTED = 0x1  # a bit of `flag_bits`


def write(
    out: Path, folder: Path, names: Sequence[str], made: Mapping[str, bytes] = NOTHING
) -> int:
    """Pack these files of a folder, and others that are `made`, below the folder's name.

    `names` are relative to the folder; `made` has contents by such names. An older archive is
    replaced; the bytes depend on names and contents alone. Returns the archive's size in bytes.
    Raises StorageError, also for a name that would not be unpacked.
    """
    remove_abandoned_files(out.parent)
    part, top = out.with_name(temporary_name()), folder.resolve().name
    if why := next(filter(None, (name_fault(f"{top}/{name}") for name in names)), ""):
        raise StorageError(f"{folder} is not packed: {why}; rename it")
    size = sum((folder / name).stat().st_size for name in names)
    try:
        with files.new_file(part, size) as file, zipfile.ZipFile(file, "w") as archive:
            for name in sorted({*names, *made}):
                with (
                    BytesIO(made[name])
                    if name in made
                    else files.open_regular(folder / name) as source
                ):
                    _add(archive, f"{top}/{name}", source)
        with files.storage_errors(f"cannot write {out}"):
            os.replace(part, out)
    finally:
        part.unlink(missing_ok=True)
    files.sync_folder(out.parent)
    return out.stat().st_size


def name_fault(name: str) -> str:
    """Why a file is not unpacked under this name; "" if it is.

    It has to be below one folder, and to be seen: a folder `.git` or `.ssh` that is suddenly there
    is read by other programs.
    """
    parts = PurePosixPath(name).parts
    inside = len(parts) > 1 and not {"..", "/", "."} & {*parts} and "\\" not in name
    inside = inside and stays_inside(name)  # on Windows more than this leads elsewhere
    if str(PurePosixPath(name)) != name or not inside or not name.isprintable():
        return f"{name!r} is no file inside a folder"
    if any(part[0] in ".-" for part in parts):
        return f"{name!r} is hidden, or begins as an option does"
    return ""


def entry_of(name: str) -> zipfile.ZipInfo:
    """An entry of a plain file without the time at which it is packed."""
    entry = zipfile.ZipInfo(name, EARLIEST)
    # Left to zipfile, the system would be the packer's, and the bytes would differ with it.
    entry.create_system, entry.external_attr = 3, PLAIN << 16  # Unix
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


def _add(archive: zipfile.ZipFile, name: str, source: BinaryIO) -> None:
    """Copy a file into the archive under `name`; the bytes are the same on every machine."""
    entry = entry_of(name)
    entry.file_size = source.seek(0, os.SEEK_END)  # beyond 4 GB it takes another form
    source.seek(0)
    with archive.open(entry, "w") as target:
        copyfileobj(source, target)


class Archive:
    """An open archive whose names lead into one folder, `name`, and whose sizes are bounded.

    `sizes` has the files' bytes by their names in the folder.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        """The content of an `archive` at `path`; StorageError for one that must not be unpacked."""
        self.path, self._archive = path, archive
        entries = archive.infolist()
        if len(entries) > MOST_FILES:
            raise self.fault(f"{len(entries)} files, at most {MOST_FILES} are unpacked")
        for entry in entries:
            self._check(entry)
        tops = {entry.filename.partition("/")[0] for entry in entries}
        if len(tops) != 1:
            raise self.fault(f"it has files of {len(tops)} folders, must have those of one")
        (self.name,) = tops
        within = len(self.name) + 1
        self._entries = {entry.filename[within:]: entry for entry in entries}
        self.sizes = {name: entry.file_size for name, entry in self._entries.items()}
        self._check_whole(len(entries))

    def text(self, name: str) -> str:
        """The file `name` as text. Raises StorageError if it is missing, too long or no UTF-8."""
        if name not in self.sizes:
            raise self.fault(f"it has no {name}")
        if self.sizes[name] > files.LARGEST_TEXT:
            raise self.fault(f"{name} has {self.sizes[name]} bytes")
        try:
            with self._reading():
                return self._archive.read(self._entries[name]).decode()
        except UnicodeDecodeError as error:
            raise self.fault(f"{name} is not UTF-8 text") from error

    def extract(self, folder: Path, tell: Callable[[float], object] = lambda part: None) -> None:
        """Write all files into an empty folder, and sync them all at once. Raises StorageError.

        `tell` hears the part of the bytes that is written.
        """
        done, whole, there = 0, max(1, sum(self.sizes.values())), set[Path]()
        for name, entry in self._entries.items():
            target = folder / name
            if target.parent not in there:
                files.make_folder(target.parent)
                there.add(target.parent)
            with files.new_file(target, entry.file_size, sync=False) as file, self._reading():
                copyfileobj(self._archive.open(entry), file)
            done += entry.file_size
            tell(done / whole)
        # To sync each of thousands of small files takes a hundred times as long.
        if not sync_disk():
            for name in self._entries:
                files.sync_file(folder / name)

    def fault(self, why: str) -> StorageError:
        """An error that says why this archive is not unpacked."""
        return StorageError(f"{self.path} is not unpacked: {why}")

    def _check(self, entry: zipfile.ZipInfo) -> None:
        """Raises StorageError for what is no plain file below one folder."""
        name = entry.filename
        if why := name_fault(name):
            raise self.fault(why)
        kind = stat.S_IFMT(entry.external_attr >> 16)  # 0 where it was packed without Unix modes
        if kind not in (0, stat.S_IFREG):
            raise self.fault(f"{name!r} is a link, folder or device")
        if entry.compress_type not in READ or entry.flag_bits & ENCRYPTED:
            raise self.fault(f"{name!r} is encrypted, or compressed in a way that podusv does not")

    def _check_whole(self, count: int) -> None:
        """Raises StorageError for names that clash, or contents far too large for their archive.

        `count` is how many entries the archive lists.
        """
        if len(self._entries) < count:
            raise self.fault("it has two files of one name")
        folders = {str(p) for name in self._entries for p in PurePosixPath(name).parents}
        if both := sorted(folders & {*self._entries}):
            raise self.fault(f"{both[0]!r} is a file and a folder")
        whole, packed = sum(self.sizes.values()), self.path.stat().st_size
        if whole > LARGEST_RATIO * packed:
            raise self.fault(
                f"its {bytes_in_words(packed)} would become {bytes_in_words(whole)}; results of "
                f"podusv become {LARGEST_RATIO} times as large at most"
            )

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Turns what zipfile raises for a damaged archive into a StorageError."""
        try:
            yield
        except (zipfile.BadZipFile, EOFError, zlib.error, NotImplementedError) as error:
            raise self.fault(f"damaged ({error})") from error


@contextmanager
def open_archive(path: Path) -> Iterator[Archive]:
    """An archive, open for reading. Raises StorageError for one that must not be unpacked."""
    with files.open_regular(path) as file:
        try:
            archive = zipfile.ZipFile(file)
        # NotImplementedError says that the archive is of a later version of zip.
        except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
            text = f"{path} is no archive of podusv pack, or not all of one ({error})"
            raise StorageError(text) from error
        with archive:
            yield Archive(path, archive)
