"""provenance.json of a study: every session in which it was computed, with machine and versions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    AliasPath,
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeInt,
    PositiveInt,
)

from podusv_cli.core import json_text
from podusv_cli.core.plugins import Plugin
from podusv_cli.storage import files, json_files, manifest, provenance
from podusv_cli.storage.writer import PATIENCE, PROVENANCE, sole_writer

NAME = "provenance.json"


class _Noted(BaseModel):
    """What is read of a session; there may be more."""

    model_config = ConfigDict(strict=True)
    started: str
    finished: str | None
    duration_s: float | None
    runs: NonNegativeInt
    podusv: str
    python: str
    processor: str = Field(validation_alias=AliasPath("platform", "processor"))
    libc: str | None = Field(validation_alias=AliasPath("platform", "libc"))
    numpy: str | None = Field(validation_alias=AliasPath("packages", "numpy"))
    numba: str | None = Field(validation_alias=AliasPath("packages", "numba"))
    timed_runs: dict[str, PositiveInt] = {}
    processor_s: dict[str, float] = {}


def _note_session(session: dict[str, Any]) -> dict[str, Any]:
    _Noted.model_validate(session)
    return session


class _Provenance(BaseModel):
    # The files call sessions sittings; files of earlier studies have this key.
    sittings: list[Annotated[dict[str, Any], AfterValidator(_note_session)]]


def sessions(folder: Path) -> list[dict[str, Any]]:
    """The sessions of a study so far, the oldest first. Raises StorageError."""
    path = folder / NAME
    return json_files.read_as(path, _Provenance).sittings if path.exists() else []


def timing(folder: Path) -> dict[str, Any]:
    """How long the runs of each law took, over all sessions: the content of timing.json.

    By law: number of timed runs, processor time [s], and milliseconds a run. Raises StorageError.
    """
    every = sessions(folder)
    runs, seconds = Counter[str](), Counter[str]()
    for session in every:
        runs.update(session.get("timed_runs", {}))
        seconds.update(session.get("processor_s", {}))
    laws = {
        law: {"runs": n, "processor_s": seconds[law], "ms_a_run": 1e3 * seconds[law] / n}
        for law, n in runs.items()
    }
    keys = ("started", "duration_s", "runs")
    return {
        "format": 1,
        "laws": laws,
        # The file's word for sessions, as in provenance.json.
        "sittings": [{k: session[k] for k in keys} for session in every],
    }


class SessionLog:
    """One session, noted when it begins and again when its runs are over.

    A report may note its own session while runs still come.
    """

    def __init__(
        self,
        folder: Path,
        argv: Sequence[str],
        started: datetime,
        plugins: Iterable[Plugin],
        others: Iterable[Path] = (),
    ) -> None:
        """Note the session, after those of `others`, whose runs it takes over.

        The manifest of an earlier session is removed, because the folder is no longer finished.
        Raises StorageError.
        """
        self._folder, self._started = folder, started
        begun = provenance.collect(argv, started, started, plugins)
        self._origin = begun | {"finished": None, "duration_s": None, "runs": 0}
        with files.storage_errors(f"cannot remove {folder / manifest.NAME}"):
            (folder / manifest.NAME).unlink(missing_ok=True)
        # Several shards may begin at once in one folder; each needs a place of its own.
        with sole_writer(folder, PROVENANCE, PATIENCE):
            earlier = sessions(folder)
            for other in others:
                earlier += [session for session in sessions(other) if session not in earlier]
            self._place = len(earlier)
            self._write(earlier)

    def end(self, runs: int, facts: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Note that `runs` runs were made, and further `facts` of the session.

        Raises StorageError.
        """
        times = provenance.times(self._started, datetime.now(UTC))
        self._origin |= {**times, "runs": runs, **facts}
        with sole_writer(self._folder, PROVENANCE, PATIENCE):
            self._write(sessions(self._folder))

    def _write(self, noted: list[dict[str, Any]]) -> None:
        """Write the sessions anew, with this one at its place; `noted` are those in the file."""
        noted[self._place : self._place + 1] = [self._origin]
        content = {"format": 1, "sittings": noted}
        files.write_bytes(self._folder / NAME, json_text.encode(content))
