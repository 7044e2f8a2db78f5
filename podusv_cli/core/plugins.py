"""Components, metrics, figures and findings from outside the package: files and installed packages.

A plug-in is a value. Whoever looks something up passes the plug-ins on (`registry.kinds`), so what
is known never depends on what another scenario in the same process has loaded.
"""

from __future__ import annotations

import hashlib
import re
import site
import sys
import traceback
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import Distribution, EntryPoint, distributions
from importlib.util import find_spec
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import Any

from podusv_cli.core.errors import LawError, in_a_line
from podusv_cli.core.escaping import visible
from podusv_cli.core.foreign import in_folder

ROOMS = (
    "controllers",
    "paths",
    "disturbances",
    "actuators",
    "measurements",
    "estimators",
    "vessels",
    "metrics",
    "figures",
    "findings",
)
GROUPS = tuple(f"podusv.{room}" for room in ROOMS)
TEXT = "__text__"  # where a module of a file keeps its text; the file may be edited or gone
MODULES = "podusv_plugins"  # what the modules of files are called: podusv_plugins.my_law_1a2b3c4d

_ONE_AT_A_TIME = RLock()


@dataclass(frozen=True)
class Plugin:
    """What one file or one installed package offers, and which it is.

    `sha256` is the digest of the file, or of the package's modules that entry points name. `text`
    is the file's own, "" for a package. `offers` are modules, objects and entry points, each with
    its room; a file's module is for all rooms.
    """

    name: str  # of the file, or of the package
    sha256: str
    version: str = ""  # of a package
    path: str = field(default="", compare=False)  # of a file
    text: str = field(default="", compare=False)
    offers: tuple[tuple[str, Any], ...] = field(default=(), compare=False)

    def members(self, room: str) -> Iterator[Any]:
        """Everything in this plug-in that may belong to a room. Raises LawError."""
        for thing in self._offers(room):
            yield from _inside(thing)

    def folders(self, room: str) -> list[str]:
        """The packages of this plug-in whose YAML files are presets of a room. Raises LawError."""
        return [thing.__name__ for thing in self._offers(room) if hasattr(thing, "__path__")]

    def _offers(self, room: str) -> Iterator[Any]:
        """What the plug-in has for a room of podusv, imported where it is an entry point."""
        for place, thing in self.offers:
            if place in ("", room):
                yield self._load_point(thing) if isinstance(thing, EntryPoint) else thing

    def _load_point(self, point: EntryPoint) -> Any:
        """What an entry point names. Raises LawError where it cannot be imported."""
        try:
            return point.load()
        except Exception as error:
            what = f"installed package {self}: entry point {point.name} = {point.value}"
            raise LawError(f"{what} cannot be imported: {in_a_line(error)}") from error

    def __reduce__(self) -> str | tuple[Any, ...]:
        """A file crosses to another process as its path and text; its module does not."""
        return (from_file, (self.path, self.text)) if self.text else super().__reduce__()

    def as_json(self) -> dict[str, str]:
        """What provenance.json says of it."""
        which = {"file": self.path} if self.path else {"package": self.name}
        return which | ({"version": self.version} if self.version else {}) | {"sha256": self.sha256}

    def __str__(self) -> str:
        """`my_law.py`, or `my_lab 1.0`."""
        return f"{self.name} {self.version}".rstrip()


Plugins = tuple[Plugin, ...]


def _inside(thing: Any) -> Iterator[Any]:
    """All public things of a module; any other thing by itself."""
    if not isinstance(thing, ModuleType):
        yield thing
        return
    yield from (part for name, part in vars(thing).items() if not name.startswith("__"))


def digest(text: str) -> str:
    """The SHA-256 of a file's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def from_file(path: str, text: str) -> Plugin:
    """The plug-in that is this file's text. Raises LawError where it cannot be imported.

    Equal texts are one module. So a law has one class and one compiled code, whether it is read
    from its own place or from the copy in a run folder.
    """
    sha256 = digest(text)
    stem = re.sub(r"\W", "_", Path(path).stem)
    module = _module(f"{stem}_{sha256[:8]}", path, text)
    place = str(Path(path).resolve())
    return Plugin(Path(path).name, sha256, path=place, text=text, offers=(("", module),))


def _module(name: str, path: str, text: str) -> ModuleType:
    """The module that is made of just this text; Python's own import might take an older one."""
    whole = f"{MODULES}.{name}"
    with _ONE_AT_A_TIME:  # another thread would find a module that is not complete
        return sys.modules.get(whole) or _execute_module(whole, path, text)


def _execute_module(whole: str, path: str, text: str) -> ModuleType:
    """The module of a plug-in's text, under the name `whole` in sys.modules.

    Raises LawError with the line that failed.
    """
    module = ModuleType(whole)
    module.__file__ = str(Path(path).resolve())
    vars(module)[TEXT] = text
    sys.modules[whole] = module  # where pydantic looks up annotations, and inspect the source
    try:
        # Not with this file's own `from __future__ import annotations`
        exec(compile(text, module.__file__, "exec", dont_inherit=True), vars(module))  # noqa: S102
    except BaseException as error:
        del sys.modules[whole]  # so that a mended file is read anew
        if not isinstance(error, (Exception, SystemExit)):
            raise
        raise LawError(f"cannot be imported: {_fault(error, module.__file__)}") from error
    return module


def _fault(error: BaseException, path: str) -> str:
    """What was raised, and in which line of the plug-in's file at `path`."""
    if isinstance(error, SyntaxError):  # which names its place
        return visible(f"{type(error).__name__}: {error}")
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == path]
    place = f" ({Path(path).name}, line {lines[-1]})" if lines else ""
    # pydantic ends its messages with a hint at a page of its own
    message = " ".join(str(error).split("\n\nFor further information")[0].split())
    return visible(f"{type(error).__name__}: {message}{place}")


@cache
def installed_plugins() -> Plugins:
    """What installed packages offer by entry points of the groups `podusv.controllers` and so on.

    Their modules are imported when something is looked for in their room.
    """
    by_package: dict[str, Plugin] = {}
    for package, found in installed_points(*GROUPS):
        points = tuple(  # with the backport of importlib.metadata, which Dask imports, of its class
            (point.group.removeprefix("podusv."), EntryPoint(point.name, point.value, point.group))
            for point in found
        )
        if package.name not in by_package:  # the first one hides another
            digest = _package_digest(points)
            by_package[package.name] = Plugin(package.name, digest, package.version, offers=points)
    return tuple(by_package[name] for name in sorted(by_package))


def installed_points(*groups: str) -> Iterator[tuple[Distribution, list[EntryPoint]]]:
    """The installed packages that have entry points of these groups, each with those.

    A package that lies in the folder of a run, study or search is left out: nobody installed it.
    """
    for package in distributions():
        points = [point for point in package.entry_points if point.group in groups]
        if points and _is_from_installer(package):
            yield package, points


def _is_from_installer(package: Distribution) -> bool:
    """Whether this package lies where installers of this Python put it, or in one's own folder.

    Python looks for packages in the current folder too: `python -m` and notebooks do.
    """
    place = str(package.locate_file(""))
    sites = {Path(p).resolve() for p in (*site.getsitepackages(), site.getusersitepackages())}
    return Path(place).resolve() in sites or not in_folder(place)


def package_files(package: Plugin) -> dict[str, Path]:
    """Every file of an installed package's modules, by its place beside other packages."""
    points = [(room, thing) for room, thing in package.offers if isinstance(thing, EntryPoint)]
    return {
        f"{top}/{name.as_posix()}" if is_folder else name.as_posix(): path
        for top, is_folder, files in _modules(points)
        for name, path in files
        if path.is_file() and "__pycache__" not in name.parts
    }


def _modules(
    points: Iterable[tuple[str, EntryPoint]],
) -> Iterator[tuple[str, bool, list[tuple[Path, Path]]]]:
    """The modules that hold entry points: name, whether it is a folder, its files with their names.

    `points` are rooms and entry points. A package may be spread over several folders.
    """
    for top in sorted({point.module.partition(".")[0] for _, point in points}):
        spec = find_spec(top)
        folders = (spec and spec.submodule_search_locations) or ()
        inside = [(path.relative_to(top), path) for top in folders for path in Path(top).rglob("*")]
        alone = [Path(spec.origin)] if spec and spec.origin and not folders else []
        files = [*inside, *((Path(path.name), path) for path in alone)]
        # In one order on every system, as a digest is made of them
        yield top, bool(folders), sorted(files)


def _package_digest(points: Iterable[tuple[str, EntryPoint]]) -> str:
    """The digest of all Python and YAML files of the packages in which the entry points are."""
    whole = hashlib.sha256()
    for _, _, files in _modules(points):
        for name, path in files:
            if path.suffix in (".py", ".yaml"):
                content = path.read_bytes()
                whole.update(f"{name.as_posix()}\0{len(content)}\0".encode() + content)
    return whole.hexdigest()
