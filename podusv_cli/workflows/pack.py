"""`podusv pack` and `unpack`: a finished folder as one archive; unpacking executes nothing."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict

from podusv_cli.comparison.run_difference import Change, version_changes
from podusv_cli.core.errors import StorageError
from podusv_cli.core.plugins import installed_plugins
from podusv_cli.storage import archive, json_files, manifest, provenance, wheel
from podusv_cli.storage.manifest import Manifest
from podusv_cli.storage.run_folder import LOG, check_free_space
from podusv_cli.storage.staging import Staging, remove_abandoned
from podusv_cli.workflows import runs

PROVENANCE = "provenance.json"
PACKAGES = "packages"  # the folder of wheels, which no manifest lists
# A file that only folders of one kind have.
KINDS = {mark: kind for mark, (kind, *_) in runs.KINDS.items()} | {"comparison.csv": "comparison"}
AGAIN = {
    "run": "podusv rerun {folder}",
    "comparison": "podusv rerun {folder}",
    "study": "podusv sweep run {folder}/scenario.yaml --out again",
    "search": "podusv tune {folder}/scenario.yaml --out again",
}
# What podusv reads and shows; whatever else is in an archive counts as code.
DATA = {".yaml", ".json", ".h5", ".csv", ".md", ".tex", ".png", ".pdf", ".gif", ".mp4"}
PAGES = {".html", ".svg"}  # may have scripts, which a browser executes


class _Plugin(BaseModel):
    """A package that offers components, or a file; a file has no `package`."""

    package: str = ""
    version: str = ""
    sha256: str = ""


class _PackSession(BaseModel):
    """What made a result, as provenance.json has it."""

    model_config = ConfigDict(extra="allow")

    plugins: list[_Plugin] = []


class _PackOrigin(_PackSession):
    """provenance.json; that of a study has several sessions."""

    sittings: list[_PackSession] | None = None


@dataclass(frozen=True)
class PackedContents:
    """What a packed folder says of itself.

    `sizes` are bytes by file, `lacking` the logs that were not packed. `code` are files that are
    neither data nor pages, `pages` those for a browser. `packages` are installed packages whose
    components the runs take, and what is to be done for them here. `differs` has the versions that
    are others here.
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
        """The command that makes the result once more from `folder`; "" where there is none."""
        command = AGAIN.get(self.kind, "")
        # Without its log the original cannot be compared, so the new run is kept.
        kept = " --out again" if self.lacking and "rerun" in command else ""
        own = [name for name in self.code if not _is_wheel(name)]
        trust = " --trust" if command and own else ""
        return f"{command.format(folder=shlex.quote(str(folder)))}{kept}{trust}"


class WrittenArchive(NamedTuple):
    """What was packed, the archive's bytes, and files of the folder that are not of the result."""

    contents: PackedContents
    size: int
    left_out: tuple[str, ...]


def pack(folder: Path, out: Path, *, logs: bool, force: bool) -> WrittenArchive:
    """Write what the manifest of a finished folder lists into one archive.

    Installed packages whose components its runs took come with it as wheels, where they are still
    the ones that were used. Raises UsageError for a folder without a manifest, StorageError for a
    damaged one, and where `out` exists and `force` is not given.
    """
    manifest.demand(folder)
    if out.exists() and not force:
        raise StorageError(f"{out} exists already; --force replaces it")
    listed = manifest.check(folder, optional=LOG)
    there = {name: one.bytes for name, one in listed.files.items() if (folder / name).exists()}
    sizes = {n: size for n, size in there.items() if logs or PurePosixPath(n).name != LOG}
    sessions = _sessions(
        json_files.read_as(folder / name, _PackOrigin) for name in sizes if _is_origin(name)
    )
    # Wheels from an earlier unpacking are packed again.
    foreign = manifest.foreign(folder, listed)
    sizes |= {name: (folder / name).stat().st_size for name in foreign if _is_wheel(name)}
    made = {name: data for name, data in _wheels(sessions).items() if name not in sizes}
    written = archive.write(out, folder, [*sizes, manifest.NAME], made)
    sizes |= {name: len(data) for name, data in made.items()}
    contents = _contents(folder.resolve().name, listed, sizes, sessions)
    return WrittenArchive(contents, written, tuple(name for name in foreign if not _is_wheel(name)))


@dataclass(frozen=True)
class Packed:
    """An open archive, and what it has."""

    contents: PackedContents
    _archive: archive.Archive

    def unpack(self, out: Path, tell: Callable[[float], object] = lambda part: None) -> None:
        """Write the folder `out`, which appears whole; no file of it is imported or executed.

        `tell` hears the part of the bytes that is written, from 0 to 1. What an earlier unpacking
        left unfinished beside `out` is removed. Raises StorageError, also where `out` exists or a
        file is not the one that was packed.
        """
        if out.exists():
            raise StorageError(f"{out} exists; name another folder with --out")
        check_free_space(out, sum(self.contents.sizes.values()), "unpack elsewhere (--out)")
        remove_abandoned(out.parent)
        staging = Staging(out)
        try:
            self._archive.extract(staging.folder, tell)
            # Before the folder gets its name; logs may have been left out when it was packed.
            manifest.check(staging.folder, optional=LOG)
            staging.publish(replace=False)
        finally:
            staging.discard()


@contextmanager
def open_packed(path: Path) -> Iterator[Packed]:
    """An archive of `pack` and what it has, before anything of it is written.

    Raises StorageError for what is no such archive, and for one that would be written elsewhere
    than in its folder, has links, would become far too large, or has files, beside wheels of
    packages, that its manifest does not list.
    """
    with archive.open_archive(path) as packed:
        listed = manifest.parse_manifest(packed.text(manifest.NAME), path / packed.name)
        sizes = {name: size for name, size in packed.sizes.items() if name != manifest.NAME}
        for name, size in sizes.items():
            entry = listed.files.get(name)
            # What is listed has the listed size; unlisted are wheels alone, which no manifest has.
            if entry.bytes != size if entry else not _is_wheel(name):
                raise packed.fault(f"{name} is not as its {manifest.NAME} lists it")
        missing = {*listed.files} - {*sizes}
        if gone := sorted(name for name in missing if PurePosixPath(name).name != LOG):
            raise packed.fault(f"{gone[0]} is missing")
        sessions = _sessions(
            json_files.parsed_as(packed.text(name), path / name, _PackOrigin)
            for name in sizes
            if _is_origin(name)
        )
        yield Packed(_contents(packed.name, listed, sizes, sessions), packed)


def _is_origin(name: str) -> bool:
    return PurePosixPath(name).name == PROVENANCE


def _is_wheel(name: str) -> bool:
    path = PurePosixPath(name)
    return str(path.parent) == PACKAGES and path.suffix == ".whl"


def _sessions(origins: Iterable[_PackOrigin]) -> list[_PackSession]:
    """What made the results: a session each, of a study several."""
    several = ([origin] if origin.sittings is None else origin.sittings for origin in origins)
    return [session for sessions in several for session in sessions]


def _contents(
    name: str, listed: Manifest, sizes: Mapping[str, int], sessions: Sequence[_PackSession]
) -> PackedContents:
    """What a packed folder has and lacks; `sizes` [bytes] by name, `sessions` oldest first."""
    made_by = sessions[-1].model_dump() if sessions else {}
    kinds = (kind for mark, kind in KINDS.items() if mark in listed.files)
    ends = {name: PurePosixPath(name).suffix for name in sizes}
    return PackedContents(
        name,
        next(kinds, "result"),
        listed.status,
        sizes,
        lacking=tuple(sorted({*listed.files} - {*sizes})),
        code=tuple(name for name, end in ends.items() if end not in DATA | PAGES),
        pages=tuple(name for name, end in ends.items() if end in PAGES),
        packages={
            f"{package} {version}": _find_package(package, version, sha256, sizes)
            for package, version, sha256 in _packages(sessions)
        },
        made_by={key: made_by[key] for key in ("podusv", "python", "packages") if key in made_by},
        differs=version_changes(made_by, provenance.surroundings()),
    )


def _packages(sessions: Iterable[_PackSession]) -> list[tuple[str, str, str]]:
    """Name, version and digest of the packages whose components runs took, each once."""
    listed = (plugin for session in sessions for plugin in session.plugins)
    named = ((p.package, p.version, p.sha256) for p in listed if p.package)
    return [*dict.fromkeys(named)]


def _find_package(package: str, version: str, sha256: str, sizes: Mapping[str, int]) -> str:
    """Whether the very package (by digest) is installed here; else what to do for it.

    `sizes` are the packed files, where its wheel may be.
    """
    here = {plugin.name: plugin for plugin in installed_plugins()}.get(package)
    if here and here.sha256 == sha256:
        return "installed"
    place = f"{PACKAGES}/{wheel.name_of(package, version)}"
    read = f"; read it, then pip install {shlex.quote(place)}"
    how = read if place in sizes else ", and not packed"
    return (f"another one is installed ({here})" if here else "not installed") + how


def _wheels(sessions: Iterable[_PackSession]) -> dict[str, bytes]:
    """Wheels, by file name, of packages that these sessions used.

    Only where the very ones are installed and have no compiled modules, so that any machine takes
    them.
    """
    here = {(plugin.name, plugin.sha256): plugin for plugin in installed_plugins()}
    used = {
        (name, version): here.get((name, sha256)) for name, version, sha256 in _packages(sessions)
    }
    made = {key: wheel.wheel(plugin) for key, plugin in used.items() if plugin}
    return {f"{PACKAGES}/{wheel.name_of(*key)}": data for key, data in made.items() if data}
