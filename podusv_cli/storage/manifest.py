"""manifest.json: the files of a finished folder with their digests; written last."""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection
from pathlib import Path, PurePosixPath

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from podusv_cli.core import json_text
from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.core.recording import Status
from podusv_cli.core.system import stays_inside
from podusv_cli.storage import files as atomic
from podusv_cli.storage import json_files
from podusv_cli.storage.files import ELSEWHERE, LARGEST_FILE, fingerprint

NAME = "manifest.json"
# What may be missing for a reason, and what to do then.
REMEDIES = {"log.h5": "; of a run packed without it, podusv rerun --out NEW makes it anew"}
FORMAT = 2  # of run folder and log


class FileEntry(BaseModel):
    """A file as it was when the folder was finished."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")

    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    bytes: int = Field(ge=0)


class Manifest(BaseModel):
    """Every file of a folder by its relative path, `/` between the parts, and how the run ended."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")

    podusv_format: int
    status: Status
    files: dict[str, FileEntry]


def write(folder: Path, status: Status) -> Manifest:
    """Write the manifest of `folder`. Raises StorageError, also for links and devices in it."""
    # No file can list its own digest.
    names = sorted(name for name in atomic.names_inside(folder) if name != NAME)
    manifest = Manifest(
        podusv_format=FORMAT, status=status, files={name: _entry(folder / name) for name in names}
    )
    atomic.write_bytes(folder / NAME, json_text.encode(manifest.model_dump()))
    return manifest


def demand(folder: Path) -> None:
    """Raises UsageError if a folder has no manifest, and so is no run folder or comparison."""
    if not os.path.lexists(folder / NAME):
        why = f"it has no {NAME}" if os.path.lexists(folder) else "it does not exist"
        raise UsageError(f"{folder} is no run folder: {why}")


def read(folder: Path) -> Manifest:
    """The manifest of a folder; the files are not checked. Raises StorageError."""
    return parse_manifest(atomic.read_text(folder / NAME), folder)


def parse_manifest(text: str, folder: Path) -> Manifest:
    """As `read`, of the text of the folder's manifest."""
    path = folder / NAME
    content = json_files.parse_json(text, path)
    # Before the keys are checked: those of another format are no damage.
    if misfit := other_format(content.get("podusv_format")):
        raise StorageError(f"{path}: {misfit}")
    try:
        manifest = Manifest.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise StorageError(f"{path}: damaged: {key}: {first['msg']}") from error
    for name in manifest.files:
        place(folder, name)
    return manifest


def other_format(written: object) -> str:
    """Why this podusv cannot read a format; empty if it can."""
    if written == FORMAT:
        return ""
    return f"written in format {written!r}; this podusv reads format {FORMAT}"


def check(folder: Path, optional: str = "") -> Manifest:
    """The manifest of a folder whose files are all present and unchanged.

    Raises StorageError naming the first file that is not. Files that the manifest does not list are
    allowed; `foreign` lists them. Files that are called `optional` may be missing.
    """
    manifest = read(folder)
    for name, entry in sorted(manifest.files.items()):
        path = place(folder, name)
        if not os.path.lexists(path):
            if path.name == optional:
                continue
            remedy = REMEDIES.get(path.name, "")
            raise StorageError(f"{folder} is not a finished folder: {name} is missing{remedy}")
        if entry.bytes > LARGEST_FILE:  # a sparse file may claim any size
            claim = f"{entry.bytes} bytes, at most {LARGEST_FILE} allowed"
            raise StorageError(f"cannot read {path}: {claim}{ELSEWHERE}")
        # The size first: a file of another size need not be read to its end.
        if os.lstat(path).st_size != entry.bytes or _entry(path) != entry:
            raise StorageError(f"{folder} is not a finished folder: {name} was altered")
    return manifest


def foreign(folder: Path, manifest: Manifest) -> list[str]:
    """Files in `folder` that the manifest does not list, sorted."""
    return sorted(set(atomic.names_inside(folder)) - set(manifest.files) - {NAME})


def remove(folder: Path, what: str, proof: str, unfinished: Collection[str]) -> None:
    """Remove what a folder holds, if it has the file `proof`, which says that it is a `what`.

    `unfinished` are the other names in a folder that has no manifest yet. Raises UsageError where
    there is something else, too. `proof` goes last, because without it a folder that is not empty
    is somebody else's.
    """
    if not (folder / proof).exists():
        return
    listed = read(folder).files if (folder / NAME).exists() else ()
    own = {name.partition("/")[0] for name in (*listed, *unfinished, proof, NAME)}
    there = {path.name for path in folder.iterdir()} - set(atomic.LOCKS)
    if others := sorted(there - own):
        raise UsageError(
            f"{folder} holds {others[0]}, which is not the {what}'s; --force would remove it"
        )
    with atomic.storage_errors(f"cannot remove the {what} in {folder}"):
        for name in sorted(there, key=lambda name: name == proof):
            path = folder / name
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def _entry(path: Path) -> FileEntry:
    """Digest and size of a file. Raises StorageError."""
    digest, size = fingerprint(path)
    return FileEntry(sha256=digest, bytes=size)


def place(folder: Path, name: str) -> Path:
    """The path of a listed file. Raises StorageError if it is not inside the folder.

    A manifest may be somebody else's, so its names are not trusted.
    """
    relative = PurePosixPath(name)
    plain = str(relative) == name and name.isprintable() and name not in (".", NAME)
    if not (plain and stays_inside(name)) or relative.is_absolute() or ".." in relative.parts:
        raise StorageError(f"{folder / NAME}: damaged: {name!r} is no file of this folder")
    path = folder / relative
    if path.parent.resolve() != folder.resolve() / relative.parent:
        raise StorageError(f"{folder / NAME}: damaged: {name!r} leads through a link")
    return path
