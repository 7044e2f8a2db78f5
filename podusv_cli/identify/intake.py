"""From a file to logs that the filter can follow: read, checked, in pieces without gaps."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.earth import PLACE
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import bundle
from podusv_cli.core.signal import STATE
from podusv_cli.identify.fit.records import FEWEST, POSE, FilterLog, complete, log_of
from podusv_cli.identify.logs.checks import check_log
from podusv_cli.identify.logs.commands import with_actuator_state, with_known_state
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.motion import BinnedMotion
from podusv_cli.identify.logs.reading import (
    CLOCK,
    LogTable,
    NamedQuantities,
    delivered_each,
    tables,
)
from podusv_cli.identify.offsets import Clocks
from podusv_cli.scenario.identify import LogFile
from podusv_cli.scenario.model import Scenario

STABLE, QUICK = 0.5, 0.99  # decay of a variance in a step; quantile of the yaw rate for it
LONG = 3.0  # times a lag, from which on rows of commands are long
GAP, ROWS = 2.0, 10.0  # s without a row, and usual distances of rows: a gap that ends a piece


def logs_of(path: Path, given: LogFile, scenario: Scenario) -> list[FilterLog]:
    """The logs of a file, one for each piece without a gap. Raises UsageError, StorageError."""
    wanted, actuator = scenario.identify, scenario.actuator
    assert wanted is not None
    signals = (*STATE, *actuator.replayed, *actuator.lagged)
    _all_taken(wanted.columns, {signal.name for signal in (*signals, CLOCK, *PLACE)})
    boots = tables(
        path,
        signals,
        NamedQuantities(wanted.columns, wanted.frame, scenario.plane, actuator.scales),
        name=given.name,
    )
    found, step = list[LogTable](), wanted.step
    for boot in boots if given.span is None else _within(boots, given.span):
        at_rows = with_actuator_state(boot, actuator)
        complete(at_rows, actuator)  # says what is missing before anything else is looked at
        doubts = [*check_log(at_rows, actuator, scenario.facts.U), *_long_rows(boot, actuator)]
        part = replace(boot, warnings=(*boot.warnings, *doubts))
        step = min(step, stable_step(at_rows, scenario.vessel))
        found += [*pieces(part)]
    found = _long_ones([with_known_state(piece.finer(step), actuator) for piece in found])
    longest = max(found, key=lambda piece: piece.times[-1] - piece.times[0])
    delay, lines = (
        (given.delay, []) if given.delay is not None else Clocks(scenario, longest).delay()
    )
    if lines and given.role == "judge":  # what the whole log says must not help to predict it
        lines = [f"{line} A log for judging stays as it is without that." for line in lines]
        delay = 0.0
    found[0] = replace(found[0], warnings=(*found[0].warnings, *lines))
    return [log_of(piece, actuator, step, delay) for piece in found]


def stable_step(log: LogTable, hull: Vessel) -> float:
    """The longest step [s] with which RK4 follows the variances of a filter along a log.

    A variance decays twice as fast as the motion that damping brakes, and RK4 lets grow what decays
    by more than 2.78 in a step (E. Hairer and G. Wanner, "Solving Ordinary Differential Equations
    II", 2nd ed. 1996, IV.2). By `hull` it decays by STABLE: the boat may brake five times as much.
    """
    motion = BinnedMotion(log)
    known = "r" in log.columns and np.isfinite(log.columns["r"]).any()
    turns = np.abs(motion.mean("r") if known else motion.rate(motion.heading()))
    r = float(np.nanquantile(turns, QUICK)) if np.isfinite(turns).any() else 0.0
    k = bundle(hull.constants())
    surge = -(k.X_u + 2.0 * k.X_uu * motion.fastest + 3.0 * k.X_uuu * motion.fastest**2) / k.m11
    sway, yaw = -(k.Y_v + k.Y_rv * r) / k.m22, -(k.N_r + 2.0 * k.N_rr * r) / k.m33
    coupled = k.m22 * k.m33 / (k.m22 * k.m33 - k.m23 * k.m32)
    decay = 2.0 * max(surge, coupled * sway, coupled * yaw)
    return STABLE / decay if decay > 0.0 else math.inf


def _long_rows(log: LogTable, actuator: Actuator) -> list[str]:
    """A sentence where rows are so long beside a lag that what acts between them is not known."""
    names = {signal.name for signal in (*actuator.replayed, *actuator.lagged)}
    acts = [np.isfinite(values) for name, values in log.columns.items() if name in names]
    rows = np.diff(log.times[np.any(acts, axis=0)]) if acts else np.zeros(0)
    lag = actuator.shortest_lag()
    if not len(rows) or np.median(rows) < LONG * lag:
        return []
    return [
        f"{log.name}: its commands are {np.median(rows):.3g} s apart, and the actuator's shortest "
        f"lag is {lag:.3g} s. What acts between rows is guessed: with rows of five lags inertia "
        "came out 3 to 4 % off, with rows of two lags within 0.6 %. Log them more often."
    ]


def _within(boots: Sequence[LogTable], span: tuple[float, float]) -> list[LogTable]:
    """What each of the tables has in a span [s]. Raises LogFault where none has anything."""
    inside = [boot for boot in boots if np.any((boot.times >= span[0]) & (boot.times < span[1]))]
    return [boot.part(*span) for boot in (inside or boots[:1])]


def _all_taken(columns: Mapping[str, str], taken: Collection[str]) -> None:
    """Raises UsageError for a quantity in `identify.columns` that nothing is made of."""
    for name in columns:
        if name not in taken:
            near = difflib.get_close_matches(name, taken, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise UsageError(
                f"identify.columns: {name!r} is no quantity that is taken from a log with this "
                f"actuator{hint} (taken: {', '.join(sorted(taken))})"
            )


def pieces(log: LogTable) -> Iterator[LogTable]:
    """The parts of a log between its gaps, but those that are too short to follow.

    Nobody knows what was commanded in a gap. The first piece has the warnings.
    """
    steps = np.diff(log.times)
    ends = np.flatnonzero(steps > max(GAP, ROWS * float(np.median(steps)))) + 1
    marks = [0, *ends.tolist(), len(log.times)]
    spans = [(a, b) for a, b in pairwise(marks) if _long(log, a, b)]
    if not len(ends) or not spans:
        yield log
        return
    longest = int(ends[np.argmax(steps[ends - 1])])
    line = (
        f"{log.name}: has {len(ends)} gap{'s' if len(ends) > 1 else ''}, the longest of "
        f"{steps[longest - 1]:.3g} s at {log.times[longest - 1]:.10g} s; it is taken as "
        f"{len(spans)} log{'s' if len(spans) > 1 else ''}, without {len(marks) - 1 - len(spans)} "
        "that would be too short."
    )
    warnings: tuple[str, ...] = (*log.warnings, line)
    rows = np.arange(len(log.times))
    for a, b in spans:
        piece = log.where((rows >= a) & (rows < b))
        name = f"{log.name} from {log.times[a]:.10g} s"
        yield replace(piece, name=name, warnings=warnings)
        warnings = ()


def _long_ones(found: Sequence[LogTable]) -> list[LogTable]:
    """Pieces that are still long enough to follow, the first with the warnings of all.

    Raises LogFault where none is.
    """
    kept = [piece for piece in found if _long(piece, 0, len(piece.times))]
    if not kept:
        raise LogFault(
            f"{found[0].name}: {'it ends' if len(found) == 1 else 'its pieces between gaps end'} "
            "before the actuator's lags forget what was commanded ahead; take a longer part of the "
            "log, or name the columns of what the actuator did"
        )
    warnings = tuple(line for piece in found for line in piece.warnings)
    short = [piece.name for piece in found if not _long(piece, 0, len(piece.times))]
    if short:
        warnings += (
            f"{', '.join(short)}: left out, as too little comes behind where the actuator's lags "
            "forget what was commanded ahead.",
        )
    return [replace(kept[0], warnings=warnings), *kept[1:]]


def _long(log: LogTable, begin: int, end: int) -> bool:
    """Whether enough of the pose is delivered in these rows."""
    pose = {signal.name: log.columns[signal.name][begin:end] for signal in STATE[:POSE]}
    return min(int(new.sum()) for new in delivered_each(pose).values()) >= FEWEST
