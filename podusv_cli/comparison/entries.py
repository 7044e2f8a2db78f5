"""The runs of a comparison: metrics, signals and checks, for tables and claims."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording, Status
from podusv_cli.findings.proof import input_rank
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import metrics_with
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage.run_folder import FinishedRun
from podusv_cli.theory import derived

UNKNOWN = "a metric of a plug-in that is not here; its unit is in the run's metrics.csv"
# What claims can check of a run. Arguments: the scenario, and how its run ended (None without a
# log). None means unknown.
CHECKS: dict[str, Callable[[Scenario, Status | None], bool | None]] = {
    "finished": lambda scenario, status: (
        status == "finished" if status in ("finished", "diverged") else None
    ),
    "underactuated": lambda scenario, status: (
        None if scenario.actuator.is_recorded else input_rank(scenario.actuator) < 3
    ),
}


@dataclass(frozen=True)
class Entry:
    """A run with a log; a `curves.Source`.

    `cost` are metrics measured for this comparison; they replace the run's own.
    """

    label: str
    run: FinishedRun
    scenario: Scenario
    cost: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def recording(self) -> Recording:
        """The log."""
        return self.run.recording

    @property
    def until(self) -> float:
        """The end of the run, or of its log where it did not finish [s]."""
        if self.recording.status == "finished":
            return self.scenario.simulation.duration
        return float(self.recording["time"][-1]) if len(self.recording["time"]) else 0.0

    @property
    def every(self) -> int:
        """Steps from one logged instant to the next."""
        return self.scenario.time_grid().log_every

    @property
    def ending(self) -> str:
        """How the run ended that did not finish, up to the colon of its message; else empty."""
        return self.recording.message.partition(":")[0]

    def metric(self, name: str) -> float:
        """A metric; NaN where it is undefined, and for a run that did not finish."""
        number = self.cost.get(name, self.run.metrics.get(name))
        finished = self.recording.status == "finished"
        return float(number) if number is not None and finished else math.nan

    def metrics(self) -> dict[str, float]:
        """Every metric of the run by name, NaN where it is undefined."""
        return {name: self.metric(name) for name in dict.fromkeys([*self.run.metrics, *self.cost])}

    @property
    def off_target(self) -> bool:
        """Whether the run finished, but not at its target; no table ranks it."""
        finished = self.recording.status == "finished"
        return finished and not self.scenario.at_target(self.metrics())

    def signal(self, name: str) -> Vector:
        """A logged or derived signal; empty where the run has none of this name."""
        log, plugins = self.recording, self.scenario.plugged
        has = derived.has(log, name, plugins)
        return derived.signal(log, name, plugins) if has else np.empty(0)

    def check(self, name: str) -> bool | None:
        """Whether a named property holds."""
        return CHECKS[name](self.scenario, self.recording.status)


def metrics_of(entries: Sequence[Entry]) -> dict[str, Metric]:
    """All metrics that podusv or a run's plug-ins know, and those that only a run's files name."""
    plugins = dict.fromkeys(plugin for entry in entries for plugin in entry.scenario.plugged)
    settings = [entry.scenario.metrics for entry in entries]
    windows = {name: ends for one in settings for name, ends in one.windows.items()}
    radii = {name: radius for one in settings for name, radius in one.radii.items()}
    known = metrics_with(tuple(plugins), (tuple(windows.items()), tuple(radii.items())))
    names = dict.fromkeys(name for entry in entries for name in entry.run.metrics)
    return known | {name: Metric(name, "", UNKNOWN) for name in names if name not in known}


@dataclass(frozen=True)
class Absent:
    """A run without a log; `failure` is the error message. A `curves.Source`."""

    scenario: Scenario
    failure: str
    until = 0.0
    every = 1

    @property
    def ending(self) -> str:
        """The last line of the error message."""
        return f"has no log: {self.failure.strip().splitlines()[-1]}"

    def metric(self, name: str) -> float:
        """NaN, as there are no metrics."""
        return math.nan

    def signal(self, name: str) -> Vector:
        """Empty, as there is no log."""
        return np.empty(0)

    def check(self, name: str) -> bool | None:
        """Whether a property holds that depends on the scenario alone; else None."""
        return CHECKS[name](self.scenario, None)
