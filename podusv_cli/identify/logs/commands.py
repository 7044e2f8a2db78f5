"""What the actuator did, from what it was commanded: its lags, and the clock of the commands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.identify.logs.reading import LogTable

FINE = 0.2  # of the shortest lag, one step at most
KNOWN = 0.01  # of the largest value in a log: how well a state has to be known


def with_actuator_state(table: LogTable, actuator: Actuator) -> LogTable:
    """The log with what the actuator did at its rows, where it has only the commands of it.

    Lags hang on no motion of the hull. What the log itself has of this stays.
    """
    names, lacking, inputs = _take_commands(table, actuator)
    if not lacking:
        return table
    did = dict(zip(names, _lag_commands(table.times, inputs, actuator, inputs[0]).T, strict=True))
    note = f"{table.name}: {', '.join(lacking)} follow from commands by the actuator's lags."
    columns = {**table.columns, **{name: did[name] for name in lacking}}
    return replace(table, columns=columns, notes=(*table.notes, note))


def with_known_state(table: LogTable, actuator: Actuator) -> LogTable:
    """The same, from where it does not matter what the actuator did before the log began.

    There it is in one state, wherever it was before between rest and the least and the largest that
    the log commands: lags do not overtake each other. A log of commands alone has no rows where
    that is nowhere.
    """
    whole = with_actuator_state(table, actuator)
    names, lacking, inputs = _take_commands(table, actuator)
    if not lacking:
        return whole
    ends = np.minimum(inputs.min(axis=0), 0.0), np.maximum(inputs.max(axis=0), 0.0)
    least, most = (_lag_commands(table.times, inputs, actuator, end) for end in ends)
    places = [names.index(name) for name in lacking]
    at = _first_known(least[:, places], most[:, places])
    if 0 < at < len(most):
        since = f"It counts from {table.times[at]:.10g} s on, where they forget what was before."
        whole = replace(whole, notes=(*whole.notes[:-1], f"{whole.notes[-1]} {since}"))
    return whole.where(np.arange(len(most)) >= at)


def _take_commands(table: LogTable, actuator: Actuator) -> tuple[list[str], list[str], Vector]:
    """What is `replayed`, what of it the log has commands of alone, and what all of it follows."""
    names = [signal.name for signal in actuator.replayed]
    commands = dict(zip(names, (signal.name for signal in actuator.lagged), strict=False))
    lacking = [n for n in names if n not in table.columns and commands.get(n) in table.columns]
    still = np.zeros(len(table.times))
    inputs = [
        hold_values(table.columns.get(n, table.columns.get(commands.get(n, ""), still)))
        for n in names
    ]
    return names, lacking, np.column_stack(inputs) if inputs else np.zeros((len(table.times), 0))


def _first_known(one: Vector, other: Vector) -> int:
    """The first row from which on two courses of the states are one; behind the last if none is."""
    largest = np.maximum(np.abs(one), np.abs(other)).max(axis=0)
    unlike = np.any(np.abs(one - other) > KNOWN * largest, axis=1)
    return int(np.flatnonzero(unlike)[-1]) + 1 if unlike.any() else 0


def hold_values(values: Vector) -> Vector:
    """Values that stay until the next; before the first it holds, too."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(len(values))
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), np.argmax(known)))
    return np.asarray(values[last])


def _lag_commands(times: Vector, commands: Vector, actuator: Actuator, begin: Vector) -> Vector:
    """The actuator's state at each time by Heun's method, from one that it begins with."""
    k, table = bundle(actuator.constants()), actuator.table()
    longest, states = FINE * actuator.shortest_lag(), np.empty_like(commands)
    states[0] = state = begin
    first, second = np.zeros(len(state)), np.zeros(len(state))
    for row, span in enumerate(np.diff(times)):
        steps = max(1, int(np.ceil(span / longest)))
        h = span / steps
        for _ in range(steps):
            given = {"command": commands[row], "k": k, "table": table}
            call(actuator.lag, state=state, rate=first, **given)
            call(actuator.lag, state=state + h * first, rate=second, **given)
            state = state + 0.5 * h * (first + second)
        states[row + 1] = state
    return states
