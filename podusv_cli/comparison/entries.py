"""Finished runs as comparison sees them: a label, a folder, a scenario, numbers and signals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from podusv_cli.comparison.checks import CHECKS
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage.run_folder import Run
from podusv_cli.theory import derived


@dataclass(frozen=True)
class Entry:
    """A run in a comparison; see `curves.Source`.

    `cost` holds metrics that were measured for this comparison and replace the run's own.
    """

    label: str
    run: Run
    scenario: Scenario
    cost: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def recording(self) -> Recording:
        """The log."""
        return self.run.recording

    @property
    def until(self) -> float:
        """Where the run ends, else the last instant that was logged [s]."""
        if self.recording.status == "finished":
            return self.scenario.simulation.duration
        return float(self.recording["time"][-1]) if len(self.recording["time"]) else 0.0

    @property
    def every(self) -> int:
        """How many steps are between two logged instants."""
        return self.scenario.time_grid().log_every

    @property
    def ending(self) -> str:
        """The first words of what the run says about its end, empty where it finished."""
        return self.recording.message.partition(":")[0]

    def metric(self, name: str) -> float:
        """A metric; NaN where it is undefined, and for any run that did not reach its end."""
        number = self.cost.get(name, self.run.metrics.get(name))
        whole = self.recording.status == "finished"
        return float(number) if number is not None and whole else math.nan

    def metrics(self) -> dict[str, float]:
        """Every metric of the run by name, NaN where it is undefined."""
        return {name: self.metric(name) for name in dict.fromkeys([*self.run.metrics, *self.cost])}

    def signal(self, name: str) -> Vector:
        """A logged or derived signal; empty where the run has none of this name."""
        has = derived.has(self.recording, name)
        return derived.signal(self.recording, name) if has else np.empty(0)

    def check(self, name: str) -> bool | None:
        """Whether a named property holds."""
        return CHECKS[name](self.scenario, self.recording.status)


@dataclass(frozen=True)
class Absent:
    """A run that failed before it left anything; `failure` says how."""

    scenario: Scenario
    failure: str
    until = 0.0
    every = 1

    @property
    def ending(self) -> str:
        """The last line of the failure: of a traceback, what went wrong."""
        return f"has no log: {self.failure.strip().splitlines()[-1]}"

    def metric(self, name: str) -> float:
        """NaN."""
        return math.nan

    def signal(self, name: str) -> Vector:
        """Empty."""
        return np.empty(0)

    def check(self, name: str) -> bool | None:
        """Whether a property holds that the scenario alone decides."""
        return CHECKS[name](self.scenario, None)
