"""The files that come with podusv, by name: `podusv:mu_2017/corrected.yaml`."""

from __future__ import annotations

import os
import posixpath
from functools import cache
from pathlib import Path, PurePath

import podusv_cli
from podusv_cli.core.phrases import did_you_mean

PREFIX = "podusv:"
RENAMED = "renamed.txt"  # beside the scenarios: a folder's old name and its new one, a line each


@cache
def folder(top: str = "configs") -> Path:
    """Where a top folder of the repository (configs, docs, examples, ...) is on this machine.

    An installed package has them inside; in a checkout they lie beside it.
    """
    package = Path(podusv_cli.__file__).parent
    inside = package / top
    return inside if inside.is_dir() else package.parent / top


@cache
def all_files() -> tuple[str, ...]:
    """Scenarios and the files that they take something from, sorted, each by its `podusv:` name."""
    paths = folder().rglob("*.*")
    return tuple(sorted(PREFIX + path.relative_to(folder()).as_posix() for path in paths))


@cache
def names() -> tuple[str, ...]:
    """Every shipped scenario as another names it, sorted: `podusv:mu_2017/base.yaml`."""
    return tuple(name for name in all_files() if name.endswith(".yaml"))


@cache
def renamed_folders() -> dict[str, str]:
    """New names of folders by their old ones, which scenarios of users still have."""
    words = (folder() / RENAMED).read_text("utf-8").split()
    return dict(zip(words[::2], words[1::2], strict=True))


def present(name: str) -> str:
    """A shipped scenario's present name."""
    first, slash, rest = name.removeprefix(PREFIX).partition("/")
    return f"{PREFIX}{renamed_folders().get(first, first)}{slash}{rest}"


def name_of(path: str | os.PathLike[str]) -> str:
    """A scenario's name as text; that of a shipped one has no backslashes, also on Windows."""
    name = os.fspath(path)
    return path.as_posix() if isinstance(path, PurePath) and is_shipped(name) else name


def is_shipped(name: str) -> bool:
    """Whether this names a file that comes with podusv."""
    return name.startswith(PREFIX)


def file_of(name: str) -> str:
    """The file that a name in a scenario or on the command line stands for.

    Any name but that of a shipped scenario is a file's own. Raises ValueError for a name that
    starts like a shipped one and is none.
    """
    if not is_shipped(name):
        return name
    if present(name) not in all_files():
        hint = did_you_mean(name, names())
        raise ValueError(f"podusv has no scenario of this name{hint} (`podusv init` lists them)")
    return str(folder() / present(name).removeprefix(PREFIX))


def relative_to(source: str, name: str) -> str:
    """The file that `source`, a file or a shipped scenario, calls `name`."""
    if is_shipped(name):
        return name
    if not is_shipped(source):
        return os.path.join(os.path.dirname(source), name)
    beside = posixpath.join(posixpath.dirname(source.removeprefix(PREFIX)), name)
    return PREFIX + posixpath.normpath(beside)
