"""Commands whose clock is not that of the motion, or that are exchanged: by the filter itself.

The filter follows a log with its commands acting later or earlier, and with the motion mirrored.
Where that predicts the log much better, also once the hull is fitted to it, the log is so.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from podusv_cli.identify.fit import estimate
from podusv_cli.identify.fit.march import DELAY
from podusv_cli.identify.fit.problem import WALKS, FitProblem
from podusv_cli.identify.fit.records import log_of
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.reading import LogTable
from podusv_cli.process.workers import available_workers
from podusv_cli.scenario.model import Scenario

DELAYS = tuple(0.5 * i for i in range(-2, 11))  # s, by which commands may act later than logged
BETTER = 30.0  # in -2 log of the likelihood, or of the posterior
REFINED = 4  # times, that a delay is the start of another fit
QUIET = -2.0  # prior standard deviations
ENOUGH = 200.0  # s of a log, which determine a delay
MIRRORED = ("y", "psi", "v", "r")


@dataclass(frozen=True)
class Way:
    """A way to read a log: its commands act later [s], port and starboard are exchanged.

    By default it is as it says. `value` is -2 log of the likelihood, or of the posterior once the
    hull is fitted.
    """

    delay: float = 0.0
    mirrored: bool = False
    value: float = np.inf


@dataclass(frozen=True)
class Clocks:
    """A log's commands against its motion, for the vessel that a scenario has."""

    scenario: Scenario
    table: LogTable

    def delay(self) -> tuple[float, list[str]]:
        """By how much later than the log says its commands act [s], and a sentence if they do.

        Raises LogFault where port and starboard are exchanged.
        """
        likely = self._likely()
        if not likely:
            return 0.0, []
        with ThreadPoolExecutor(available_workers()) as pool:
            none, *others = pool.map(self._fit_way, (Way(), *likely))
        if not np.isfinite(none.value):  # the fit of all logs says why
            return 0.0, []
        best = min(others, key=lambda way: way.value)
        if best.mirrored:
            self._refuse_mirrored(best, (none, *others))
        gain = none.value - best.value
        if best.mirrored or gain <= BETTER:
            return 0.0, []
        best = self._refine_delay(best)
        line = (
            f"{self.table.name}: its commands act {best.delay:.2f} s later than it says (that "
            f"predicts its motion better, by {gain:.0f} in -2 log of the posterior); logs for "
            "fitting are moved by that. identify.logs[].delay gives another."
        )
        return best.delay, [line]

    def _refuse_mirrored(self, best: Way, ways: Sequence[Way]) -> None:
        """Raises LogFault where no way without mirroring predicts nearly as well."""
        gain = min(way.value for way in ways if not way.mirrored) - best.value
        if gain > BETTER:
            raise LogFault(
                f"{self.table.name}: the boat turns against its commands: with port and starboard "
                f"exchanged its motion is predicted better, by {gain:.0f} in -2 log of the "
                "posterior. Exchange the columns of port and starboard under identify.columns, or "
                'write "-COLUMN" for what has the other sign; or write identify.frame: enu if all '
                "of the motion is counted to port"
            )

    def _refine_delay(self, best: Way) -> Way:
        """With the delay that fits best from one fit to the next."""
        for _ in range(REFINED):
            nearer = self._fit_way(Way(best.delay))
            if nearer.value > best.value - 1.0:
                break
            best = nearer
        return best

    def _likely(self) -> list[Way]:
        """Ways that the vessel as it was given predicts much better than the log as it is."""
        with ThreadPoolExecutor(available_workers()) as pool:
            own, mirrored = (
                [*pool.map(self._score_way, [Way(d, turned) for d in DELAYS])]
                for turned in (False, True)
            )
        none = own[DELAYS.index(0.0)].value
        best, turned = (min(ways, key=lambda way: way.value) for ways in (own, mirrored))
        likely = [best] if best.value < none - BETTER else []
        if turned.value < none - BETTER:
            likely += [turned, Way(0.0, True)][: 2 if turned.delay else 1]
        return likely

    @cached_property
    def part(self) -> LogTable:
        """So much of the log as determines a delay: where the heading turns most."""
        times, psi = self.table.times, self.table.columns["psi"]
        known = np.flatnonzero(np.isfinite(psi))
        turned = np.zeros(len(times))
        turned[known[1:]] = np.abs(np.diff(np.unwrap(psi[known])))
        sums = np.cumsum(turned)
        ends = np.searchsorted(times, times + ENOUGH, "right") - 1
        begin = times[np.argmax(sums[ends] - sums)]
        return self.table.part(begin, begin + ENOUGH)

    def _problem(self, way: Way) -> FitProblem:
        """The filter along a log that is read so."""
        wanted, actuator = self.scenario.identify, self.scenario.actuator
        assert wanted is not None
        read = _mirror_log(self.part) if way.mirrored else self.part
        return FitProblem(self.scenario, wanted, [log_of(read, actuator, wanted.step, way.delay)])

    def _score_way(self, way: Way) -> Way:
        """With loads that hardly wander, so that the commands have to explain the motion."""
        problem = self._problem(way)
        y = np.array([QUIET * (number.name in WALKS) for number in problem.numbers])
        return replace(way, value=float(problem.search.values([y])[0]))

    def _fit_way(self, way: Way) -> Way:
        """With the hull fitted to the log, and the delay that came out."""
        problem = self._problem(way)
        search = problem.search
        if not np.isfinite(search.values([np.zeros(search.size)])[0]):
            return replace(way, value=np.inf)
        found = estimate.estimate_hull(search, starts=1)
        delay = way.delay + problem.values(found.y)[DELAY]
        return replace(way, delay=delay, value=found.value)


def _mirror_log(table: LogTable) -> LogTable:
    """What a boat would have done with port and starboard exchanged."""
    columns = {n: -c if n in MIRRORED else c for n, c in table.columns.items()}
    return replace(table, columns=columns)
