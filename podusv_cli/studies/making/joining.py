"""Joining folders of one study: are runs that two of them have the same, and what is missing."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.core.errors import StorageError
from podusv_cli.studies.counting.runs import Mask, UnitResult
from podusv_cli.studies.counting.runs_file import stretches
from podusv_cli.studies.making.sessions import NAME, sessions
from podusv_cli.studies.making.store import Store

SIZE = 8  # bytes of a run's digest
NOWHERE = -1  # the folder of a run that none has yet


def join(into: Store, others: Sequence[Store]) -> None:
    """Write the runs of other folders of a study into one, after all of them are compared.

    Raises StorageError where two have the same run with other numbers; nothing is written then.
    """
    seen = SeenRuns(into)
    for other in (into, *others):
        seen.add(other)
    for other in others:
        for result in other.results():
            into.write(result)


class SeenRuns:
    """A digest of every run that was seen, and in which folder: 12 bytes a run."""

    def __init__(self, first: Store) -> None:
        """Nothing is seen yet of the study that this store belongs to."""
        draws, places = first.about.draws, first.covered_draws()
        self._digests = {place: np.zeros(draws, np.uint64) for place in places}
        self._origins = {place: np.full(draws, NOWHERE, np.int32) for place in places}
        self._stores: list[Store] = []

    def add(self, store: Store) -> None:
        """Note all runs of a folder. Raises StorageError where one was seen with other numbers."""
        self._stores.append(store)
        for new in store.results():
            place, rows = (new.unit.law, new.unit.cell), slice(new.unit.first, new.unit.draws.stop)
            known, origins = self._digests[place][rows], self._origins[place][rows]
            new_digests = digests(new)
            other = (origins != NOWHERE) & (known != new_digests)
            if other.any():
                self._refuse(new, other, self._stores[origins[np.argmax(other)]])
            # Views of rows: this writes into the tables of digests and origins.
            known[:], origins[:] = new_digests, len(self._stores) - 1

    def _refuse(self, new: UnitResult, other: Mask, earlier: Store) -> None:
        """Raise StorageError: draws of the unit `new` have other numbers in `earlier`.

        `other` is a mask (count,) over the unit's draws: those that differ.
        """
        unit, folder = new.unit, self._stores[-1].folder
        first = unit.first + int(np.argmax(other))
        names = ", ".join(_differing(new, earlier, first))
        cell = self._stores[-1].about.cells[unit.cell]
        raise StorageError(
            f"{folder}: {_ranges(other, unit.first)} of {unit.law}{f' at {cell}' if cell else ''} "
            f"with other numbers than in {earlier.folder} ({names} of draw {first}); {folder} was "
            f"made on {machines(folder)}, {earlier.folder} on {machines(earlier.folder)}; leave "
            "one of the two out, or make its runs again on the other's kind of machine"
        )


def digests(result: UnitResult) -> Any:
    """A digest of 64 bits for each run of a unit (count,).

    It covers metrics by name, end time, status and cause, so that the order of metrics does not
    matter.
    """
    columns = [*(result.metrics[name] for name in sorted(result.metrics)), result.until]
    table = np.column_stack([*columns, result.status])
    # NaN has many bit patterns; all count as the same number.
    table[np.isnan(table)] = np.nan
    run_digests = (
        hashlib.blake2b(row.tobytes() + cause.encode(), digest_size=SIZE).digest()
        for row, cause in zip(table, result.causes, strict=True)
    )
    return np.frombuffer(b"".join(run_digests), np.uint64)


def _differing(new: UnitResult, earlier: Store, draw: int) -> Iterator[str]:
    """What the same run (number `draw`) has with other values in `earlier`.

    They are names of metrics, or status, until, cause.
    """
    old = next(
        result
        for result in earlier.results()
        if (result.unit.law, result.unit.cell) == (new.unit.law, new.unit.cell)
        and draw in result.unit.draws
    )
    one, two = _run(old, draw), _run(new, draw)
    for name, value in one.items():
        # numpy cannot ask a text whether it is NaN.
        if not np.array_equal(value, two[name], equal_nan=name != "cause"):
            yield name


def _run(result: UnitResult, draw: int) -> dict[str, Any]:
    """Everything that is known of one draw of a unit, by name; `draw` counts in the study."""
    row = draw - result.unit.first
    arrays: dict[str, Any] = {**result.metrics, "status": result.status, "until": result.until}
    return {name: array[row] for name, array in arrays.items()} | {"cause": result.causes[row]}


def mixture(folder: Path) -> str:
    """A warning where the runs of a folder were made on different machines or versions, else ""."""
    hosts = _machines(folder)
    return (
        f"the runs in {folder} are made on different machines or versions: {' and '.join(hosts)}; "
        "their numbers may differ in the last bits"
        if len(hosts) > 1
        else ""
    )


def _machines(folder: Path) -> list[str]:
    """The machines that made a study's runs, each once, in the order of sessions."""
    # A session without runs, such as one that only wrote a report, says nothing of the numbers.
    # A session that was killed has no end, and does not know how many runs it made.
    made = (
        session for session in sessions(folder) if session["runs"] or session["finished"] is None
    )
    return list(dict.fromkeys(map(_machine, made)))


def machines(folder: Path) -> str:
    """On what the runs of a folder were made: processor, C library and versions."""
    hosts = _machines(folder)
    return " and ".join(hosts) or f"a machine that its {NAME} does not tell"


def _machine(session: Mapping[str, Any]) -> str:
    """Processor and versions that decide the bits of a session's runs, in words.

    `session` is one of `sessions`.
    """
    platform, packages = session["platform"], session["packages"]
    return (
        f"{platform['processor']} ({platform['libc']}, podusv {session['podusv']}, "
        f"Python {session['python']}, numpy {packages['numpy']}, numba {packages['numba']})"
    )


def gaps(store: Store) -> list[str]:
    """Sentences on the draws that are missing; laws and cells that lack the same ones share one."""
    lacking: dict[str, list[str]] = {}
    covered = store.covered_draws()
    for (law, cell), there in covered.items():
        if not there.all():
            label = store.about.cells[cell]
            lacking_it = lacking.setdefault(_ranges(np.logical_not(there)), [])
            lacking_it.append(f"{law}{f' at {label}' if label else ''}")
    every = len(covered)
    return [
        f"missing: {ranges} of {'every law and cell' if len(of) == every else _few(of)}"
        for ranges, of in lacking.items()
    ]


def _few(words: Sequence[str]) -> str:
    return ", ".join(words[:4]) + (f" and {len(words) - 4} more" if len(words) > 4 else "")


def _ranges(mask: Mask, first: int = 0) -> str:
    """`draw 9`, or `draws 3, 8 to 12`, where `mask` (n,) is true; its entry 0 is draw `first`."""
    ranges = [range(r.start + first, r.stop + first) for r in stretches(mask)]
    words = [f"{r.start} to {r[-1]}" if len(r) > 1 else str(r.start) for r in ranges]
    return f"draw{'s' if np.sum(mask) > 1 else ''} {_few(words)}"
