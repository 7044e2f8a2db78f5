"""The event that is nearest to a window of a claim, such as a leg that begins just behind it.

A claim whose window ends shortly before an event turns when that event comes earlier.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.comparison.curves import REDUCERS, SETTINGS
from podusv_cli.core.past_run import PastRun
from podusv_cli.expressions.reading import literal


class Event(NamedTuple):
    """A logged whole number, such as `leg` or `saturated`, that changes to `value` at `time` [s].

    `edge` [s] is the start or the end of a claim's window that is nearest to it.
    """

    run: str
    signal: str
    value: float
    time: float
    edge: float

    @property
    def gap(self) -> float:
        """The time between the event and the window's start or end [s]."""
        return abs(self.time - self.edge)

    def __str__(self) -> str:
        """The event as a sentence: what a run's signal becomes, and how near a window's edge."""
        side = "before" if self.time < self.edge else "after"
        return (
            f"{self.signal} of {self.run} becomes {self.value:g} at {self.time:g} s, "
            f"{self.gap:.3g} s {side} the edge of a window at {self.edge:g} s"
        )


def nearest_event(claim: ParsedClaim, runs: Mapping[str, PastRun]) -> Event | None:
    """The event nearest to an edge of a window; None where no window or nothing changes."""
    events = (
        Event(label, *event, edge)
        for label, edges in _windows(claim)
        if label in runs
        for event in _events(runs[label])
        for edge in edges
    )
    return min(events, key=lambda event: event.gap, default=None)


def _windows(claim: ParsedClaim) -> Iterator[tuple[str, list[float]]]:
    """Each run in a number of the claim that has a window, with the window's start and end [s]."""
    trees = filter(None, (claim.expect, claim.given))
    for node in (node for tree in trees for node in ast.walk(tree)):
        match node:
            case ast.Call(func=ast.Name(id=name), args=[curve, *rest]) if name in REDUCERS:
                # Some reducers take a number before the window.
                edges = rest[1:] if name in SETTINGS else rest
                if len(edges) == 2:
                    for run in {n.id for n in ast.walk(curve) if isinstance(n, ast.Name)}:
                        yield run, [literal(edge) for edge in edges]


def _events(run: PastRun) -> Iterator[tuple[str, float, float]]:
    """Every change of a logged signal that has whole numbers alone: name, new value, time [s]."""
    time = run.recording["time"]
    for name, values in run.recording.signals.items():
        about = run.recording.about.get(name)
        if about and about.unit == "1" and values.ndim == 1 and (values == np.round(values)).all():
            for i in np.flatnonzero(np.diff(values)) + 1:
                yield name, float(values[i]), float(time[i])
