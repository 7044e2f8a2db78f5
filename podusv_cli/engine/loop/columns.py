"""Names of the columns of a logged row, and these columns as signals."""

from __future__ import annotations

from collections.abc import Mapping

from podusv_cli.components.paths.base import TARGET
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import Signal
from podusv_cli.engine.loop.closed_loop import DEMAND, LOADS, STATE, ClosedLoop


def names(loop: ClosedLoop) -> list[str]:
    """Names of a logged row's columns: time, state, row; a slot of size n has n columns."""
    law, actuator = loop.controller, loop.actuator
    slots = [part for part, size in law.slots() for _ in range(size)]
    own_states = (*actuator.states, *loop.estimated(), *loop.path.places, *slots)
    states = [part.name for part in own_states]
    parts = (
        law.signals, loop.disturbance.signals, actuator.signals_with, loop.measurement.signals
    )  # fmt: skip
    own, sea, others, seen = ([part.name for part in signals] for signals in parts)
    return ["time", *STATE, *states, *TARGET, "z_e", *own, *DEMAND, *LOADS, *sea, *others, *seen]


def by_name(labels: list[str], table: Vector, about: Mapping[str, Signal]) -> dict[str, Vector]:
    """A table's columns by name; those of a vector together, shape (rows, size)."""
    vectors = {name for name, part in about.items() if part.axes}
    columns: dict[str, list[int]] = {}
    for column, name in enumerate(labels):
        columns.setdefault(name, []).append(column)
    return {
        name: table[:, at[0] : at[-1] + 1] if name in vectors else table[:, at[0]]
        for name, at in columns.items()
    }
