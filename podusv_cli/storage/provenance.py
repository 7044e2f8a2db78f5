"""Where a result comes from: versions, source tree, platform, command and times."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import podusv_cli
from podusv_cli.core.plugins import Plugin

PACKAGES = ("numpy", "scipy", "numba", "h5py", "pydantic")  # those that can move a number
GIT_PATIENCE = 5.0  # s


def collect(
    argv: Sequence[str], started: datetime, finished: datetime, plugins: Iterable[Plugin] = ()
) -> dict[str, Any]:
    """The content of provenance.json; `argv` is the command that `started` and `finished` then.

    Both are aware datetimes.

    A plug-in with neither version nor path, as one that is made in Python, is left out.
    """
    return {
        **surroundings(),
        "plugins": [plugin.as_json() for plugin in plugins if plugin.version or plugin.path],
        "argv": list(argv),
        **times(started, finished),
    }


@cache
def surroundings() -> Mapping[str, Any]:
    """What is the same for all results of a process, and of those that it forks afterwards.

    `git` is None where podusv does not run from a git checkout or git is missing; a version is
    None where a package is not installed. Processor and C library are noted because functions of
    the library, which a component of one's own may call, depend on both in the last bit.
    """
    return {
        "podusv": podusv_cli.__version__,
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in PACKAGES},
        "platform": {
            "system": platform.system(),
            "release": platform.release(),
            "machine": platform.machine(),
            "processor": processor(),
            "libc": " ".join(platform.libc_ver()).strip() or None,
        },
        "git": source_tree(Path(podusv_cli.__file__).parent),
    }


def times(started: datetime, finished: datetime) -> dict[str, Any]:
    """When something `started` and `finished`, in UTC as ISO texts, and how long it took [s]."""
    return {
        "started": _utc(started),
        "finished": _utc(finished),
        "duration_s": round((finished - started).total_seconds(), 6),
    }


@cache
def source_tree(package: Path) -> dict[str, Any] | None:
    """Commit of the checkout that `package` is part of, and whether the package differs from it.

    None where it is part of none, or nothing is committed there yet.
    """
    # A package installed somewhere below an unrelated checkout is not tracked there.
    if _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    status = _git(
        package, "status", "--porcelain=v2", "--branch", "--untracked-files=normal", "--", "."
    )
    lines = (status or "").splitlines()
    commit = next((line.split()[-1] for line in lines if line.startswith("# branch.oid ")), None)
    if commit in (None, "(initial)"):
        return None
    return {"commit": commit, "dirty": any(not line.startswith("#") for line in lines)}


def _git(folder: Path, *words: str) -> str | None:
    """What git says in a folder, or None where it fails, or says nothing within `GIT_PATIENCE`."""
    # Variables that git itself sets, in its hooks for instance, would point to another checkout.
    environment = {key: word for key, word in os.environ.items() if not key.startswith("GIT_")}
    # `git status` would else lock and rewrite the index, which a git of the user may be using.
    environment["GIT_OPTIONAL_LOCKS"] = "0"
    try:
        done = subprocess.run(
            ["git", *words],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=GIT_PATIENCE,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def processor() -> str | None:
    """The processor's model, None if unknown."""
    with suppress(OSError), open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
        for line in file:
            key, _, model = line.partition(":")
            if key.strip() == "model name":
                return model.strip()
    return platform.processor() or None


def _version(package: str) -> str | None:
    """The version of an installed package, or None."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _utc(time: datetime) -> str:
    """A time in UTC as ISO 8601 writes it, to milliseconds."""
    return time.astimezone(UTC).isoformat(timespec="milliseconds")
