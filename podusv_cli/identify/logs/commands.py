"""What the actuator did, from what it was commanded: its lags, and the clock of the commands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.identify.logs.reading import LogTable

FINE = 0.2  # of the shortest lag, one step at most


def with_actuator_state(table: LogTable, actuator: Actuator) -> LogTable:
    """The log with what the actuator did at its rows, where it has only the commands of it.

    Lags hang on no motion of the hull. What the log itself has of this stays.
    """
    names = [signal.name for signal in actuator.replayed]
    commands = dict(zip(names, (signal.name for signal in actuator.lagged), strict=False))
    lacking = [n for n in names if n not in table.columns and commands.get(n) in table.columns]
    if not lacking:
        return table
    still = np.zeros(len(table.times))
    inputs = [
        hold_values(table.columns.get(n, table.columns.get(commands.get(n, ""), still)))
        for n in names
    ]
    did = dict(
        zip(names, _lag_commands(table.times, np.column_stack(inputs), actuator).T, strict=True)
    )
    note = f"{table.name}: {', '.join(lacking)} follow from commands by the actuator's lags."
    columns = {**table.columns, **{name: did[name] for name in lacking}}
    return replace(table, columns=columns, notes=(*table.notes, note))


def hold_values(values: Vector) -> Vector:
    """Values that stay until the next; before the first it holds, too."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(len(values))
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), np.argmax(known)))
    return np.asarray(values[last])


def _lag_commands(times: Vector, commands: Vector, actuator: Actuator) -> Vector:
    """The actuator's state at each time by Heun's method; it begins as it is commanded."""
    k, table = bundle(actuator.constants()), actuator.table()
    longest, states = FINE * actuator.shortest_lag(), np.empty_like(commands)
    states[0] = state = commands[0].copy()
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
