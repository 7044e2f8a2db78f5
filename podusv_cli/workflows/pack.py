"""`podusv pack` and `unpack`: a finished folder as one archive; unpacking executes nothing."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from podusv_cli.comparison.run_difference import Change, version_changes
from podusv_cli.core.errors import StorageError
from podusv_cli.core.plugins import installed
from podusv_cli.storage import archive, json_files, manifest, provenance
from podusv_cli.storage.manifest import Manifest
from podusv_cli.storage.run_folder import LOG, check_free_space
from podusv_cli.storage.staging import Staging, remove_abandoned

PROVENANCE = "provenance.json"
# A file that only folders of one kind have, and how such a folder is made once more.
KINDS = {
    "metrics.json": ("run", "podusv rerun {folder}"),
    "comparison.csv": ("comparison", "podusv rerun {folder}"),
    "study.json": ("study", "podusv sweep run {folder}/scenario.yaml --out again"),
    "tune.json": ("search", "podusv tune {folder}/scenario.yaml --out again"),
}
OTHER = "result"
# What podusv reads and shows; whatever else is in an archive counts as code.
DATA = {".yaml", ".json", ".h5", ".csv", ".md", ".tex", ".png", ".pdf", ".gif", ".mp4"}
PAGES = {".html", ".svg"}  # may have scripts, which a browser executes


@dataclass(frozen=True)
class Contents:
    """What a packed folder says of itself.

    `sizes` are bytes by file, `lacking` the logs that were not packed. `code` are files that are
    neither data nor pages, `pages` those for a browser. `packages` are installed packages whose
    components the runs take, and what of them is here. `differs` has the versions that are others
    here.
    """

    name: str
    kind: str
    status: str
    sizes: Mapping[str, int]
    lacking: tuple[str, ...]
    code: tuple[str, ...]
    pages: tuple[str, ...]
    packages: Mapping[str, str]
    made_by: Mapping[str, Any]
    differs: Mapping[str, Change]

    def as_json(self) -> dict[str, Any]:
        """As plain data."""
        return {"format": 1, **asdict(self)}

    def repeat(self, folder: Path) -> str:
        """The command that makes it once more; "" where there is none."""
        command = next((KINDS[mark][1] for mark in KINDS if mark in self.sizes), "")
        kept = " --out again" if self.lacking and "rerun" in command else ""
        trust = " --trust" if command and self.code else ""
        return f"{command.format(folder=shlex.quote(str(folder)))}{kept}{trust}"


class Written(NamedTuple):
    """What was packed, the archive's bytes, and files of the folder that are not of the result."""

    contents: Contents
    size: int
    left_out: tuple[str, ...]


def pack(folder: Path, out: Path, *, logs: bool, force: bool) -> Written:
    """Write what the manifest of a finished folder lists into one archive.

    Raises UsageError for a folder without a manifest, StorageError for a damaged one, and where
    `out` exists and `force` is not given.
    """
    manifest.demand(folder)
    if out.exists() and not force:
        raise StorageError(f"{out} exists already; --force replaces it")
    listed = manifest.check(folder, optional=LOG)
    there = {name for name in listed.files if (folder / name).exists()}
    names = sorted(name for name in there if logs or PurePosixPath(name).name != LOG)
    origins = [json_files.read(folder / name) for name in names if _is_origin(name)]
    contents = _contents(folder.resolve().name, listed, names, origins)
    size = archive.write(out, folder, [*names, manifest.NAME])
    return Written(contents, size, tuple(manifest.foreign(folder, listed)))


@dataclass(frozen=True)
class Packed:
    """An open archive, and what it has."""

    contents: Contents
    _archive: archive.Archive

    def unpack(self, out: Path) -> None:
        """Write the folder, which appears whole; no file of it is imported or executed.

        Raises StorageError, also where `out` exists or a file is not the one that was packed.
        """
        if out.exists():
            raise StorageError(f"{out} exists; name another folder with --out")
        check_free_space(out, sum(self.contents.sizes.values()), "unpack elsewhere (--out)")
        remove_abandoned(out.parent)
        staging = Staging(out)
        try:
            self._archive.extract(staging.folder)
            manifest.check(staging.folder, optional=LOG)
            staging.publish(replace=False)
        finally:
            staging.discard()


@contextmanager
def opened(path: Path) -> Iterator[Packed]:
    """An archive of `pack` and what it has, before anything of it is written.

    Raises StorageError for what is no such archive, and for one that would be written elsewhere
    than in its folder, has links, would become far too large, or has files that its
    manifest does not list.
    """
    with archive.opened(path) as packed:
        listed = manifest.parsed(packed.text(manifest.NAME), path / packed.name)
        names = [name for name in packed.sizes if name != manifest.NAME]
        for name in names:
            entry = listed.files.get(name)
            if entry is None or entry.bytes != packed.sizes[name]:
                raise packed.fault(f"{name} is not as its {manifest.NAME} lists it")
        missing = {*listed.files} - {*names}
        if gone := sorted(name for name in missing if PurePosixPath(name).name != LOG):
            raise packed.fault(f"{gone[0]} is missing")
        origins = [
            json_files.parsed(packed.text(name), path / name) for name in names if _is_origin(name)
        ]
        yield Packed(_contents(packed.name, listed, names, origins), packed)


def _is_origin(name: str) -> bool:
    return PurePosixPath(name).name == PROVENANCE


def _contents(
    name: str, listed: Manifest, names: Sequence[str], origins: Iterable[Mapping[str, Any]]
) -> Contents:
    sessions = [session for origin in origins for session in origin.get("sittings", [origin])]
    made_by = sessions[-1] if sessions else {}
    kinds = [kind for mark, (kind, _) in KINDS.items() if mark in listed.files]
    ends = {name: PurePosixPath(name).suffix for name in names}
    return Contents(
        name, next(iter(kinds), OTHER), listed.status,
        {name: listed.files[name].bytes for name in names},
        lacking=tuple(sorted({*listed.files} - {*names})),
        code=tuple(name for name, end in ends.items() if end not in DATA | PAGES),
        pages=tuple(name for name, end in ends.items() if end in PAGES),
        packages=dict(_packages(sessions)),
        made_by={key: made_by[key] for key in ("podusv", "python", "packages") if key in made_by},
        differs=version_changes(made_by, provenance.surroundings()),
    )  # fmt: skip


def _packages(sessions: Iterable[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    """The packages of plug-ins that runs took, and whether these very ones are installed."""
    here = {plugin.name: plugin for plugin in installed()}
    for session in sessions:
        for plugin in session.get("plugins", ()):
            if name := plugin.get("package"):
                own = here.get(name)
                same = own is not None and own.sha256 == plugin.get("sha256")
                found = "installed" if same else f"another one is installed ({own})"
                yield f"{name} {plugin.get('version', '')}", found if own else "not installed"
