"""Commands whose clock is not that of the motion, or that are exchanged: by the filter itself.

The filter follows a log with its commands acting later or earlier, and with the motion mirrored.
Where that foretells the log much better, also once the hull is fitted to it, the log is so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from podusv_cli.identify import estimate
from podusv_cli.identify.commands import later
from podusv_cli.identify.formats import LogFault
from podusv_cli.identify.problem import Problem
from podusv_cli.identify.reading import Table
from podusv_cli.identify.records import log_of
from podusv_cli.scenario.model import Scenario

STEP = 0.25
DELAYS = STEP * np.arange(-4, 21)  # s, by which commands may act later than the log says
SMALL = 0.4  # s: a delay that the fit itself finds
BETTER = 30.0  # in -2 log of the posterior
ENOUGH = 300.0  # s of a log, which tell a delay
MIRRORED = ("y", "psi", "v", "r")


@dataclass(frozen=True)
class Way:
    """A way to read a log: its commands act later [s], port and starboard are exchanged.

    `value` is -2 log of the likelihood, or of the posterior once the hull is fitted.
    """

    delay: float
    mirrored: bool
    value: float = np.inf


@dataclass(frozen=True)
class Clocks:
    """A log's commands against its motion, for the vessel that a scenario has."""

    scenario: Scenario
    table: Table

    def settled(self, delay: float | None) -> Table:
        """The log with its commands as they acted: `delay` [s] later, or as the motion says.

        Raises LogFault where port and starboard are exchanged.
        """
        if delay is not None:
            return later(self.table, self.scenario.actuator, delay)
        none, *others = self._likely()
        if not others:
            return self.table
        none, *others = [self._fitted(way) for way in (none, *others)]
        best = min(others, key=lambda way: way.value)
        straight = min(way.value for way in (none, *others) if not way.mirrored)
        if best.mirrored and straight - best.value > BETTER:
            raise LogFault(
                f"{self.table.name}: the boat turns against its commands: with port and starboard "
                f"exchanged its motion is foretold better, by {straight - best.value:.0f} in -2 "
                "log of the posterior. Exchange the columns of port and starboard under "
                'identify.columns, or write "-COLUMN" for what has the other sign; or write '
                "identify.frame: enu if all of the motion is counted to port"
            )
        gain = none.value - best.value
        if best.mirrored or gain <= BETTER:
            return self.table
        line = (
            f"{self.table.name}: its commands act {best.delay:.2f} s later than it says, and are "
            f"moved by that (its motion is foretold better, by {gain:.0f} in -2 log of the "
            "posterior). identify.logs[].delay gives another."
        )
        moved = later(self.table, self.scenario.actuator, best.delay)
        return replace(moved, warnings=(*self.table.warnings, line))

    def _likely(self) -> list[Way]:
        """The log as it is, then what the vessel as it was given foretells much better."""
        own, mirrored = ([self._valued(Way(d, m)) for d in DELAYS.tolist()] for m in (False, True))
        none = own[int(np.argmin(np.abs(DELAYS)))]
        lower = [w for w in (*_lowest(own), *_lowest(mirrored)) if w.value < none.value - BETTER]
        return [none, *(way for way in lower if way.mirrored or abs(way.delay) >= SMALL)]

    def _problem(self, way: Way) -> Problem:
        """The filter along a log that is read so."""
        wanted, actuator = self.scenario.identify, self.scenario.actuator
        assert wanted is not None
        part = self.table.part(self.table.times[0], self.table.times[0] + ENOUGH)
        read = later(_mirrored(part) if way.mirrored else part, actuator, way.delay)
        return Problem(self.scenario, wanted, [log_of(read, actuator, wanted.step)])

    def _valued(self, way: Way) -> Way:
        problem = self._problem(way)
        return replace(way, value=_search(problem).value(np.zeros(len(problem.numbers))))

    def _fitted(self, way: Way) -> Way:
        problem = self._problem(way)
        found = estimate.estimated(_search(problem), np.zeros(len(problem.numbers)))
        return replace(way, value=found.value)


def _search(problem: Problem) -> estimate.Search:
    return estimate.Search(problem.innovations, len(problem.numbers), problem.blocks)


def _lowest(ways: Sequence[Way]) -> list[Way]:
    """The two lowest of those that are lower than their neighbours."""
    values = np.array([np.inf, *(way.value for way in ways), np.inf])
    low = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:]))
    return sorted((ways[i] for i in low.tolist()), key=lambda way: way.value)[:2]


def _mirrored(table: Table) -> Table:
    """What a boat would have done with port and starboard exchanged."""
    columns = {n: -c if n in MIRRORED else c for n, c in table.columns.items()}
    return replace(table, columns=columns)
