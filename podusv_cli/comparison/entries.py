"""The runs of a comparison: metrics, signals and checks, for tables and claims."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from podusv_cli.core.about import MetricAbout, RunAbout
from podusv_cli.core.kernel import Vector
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.recording import Recording, Status
from podusv_cli.figures import signals as derived
from podusv_cli.metrics.table import metrics_with
from podusv_cli.storage.run_folder import FinishedRun

UNKNOWN = "a metric of a plug-in that is not here; its unit is in the run's metrics.csv"
# What claims can check of a run. Arguments: what it says about itself, and how it ended (None
# without a log). None means unknown.
CHECKS: dict[str, Callable[[RunAbout, Status | None], bool | None]] = {
    "finished": lambda about, status: (
        status == "finished" if status in ("finished", "diverged") else None
    ),
    "underactuated": lambda about, status: about.underactuated,
}


@dataclass(frozen=True)
class Entry:
    """A run with a log; a `curves.ClaimedRun`.

    `cost` are metrics measured for this comparison; they replace the run's own.
    """

    label: str
    run: FinishedRun
    about: RunAbout
    cost: Mapping[str, float] = field(default_factory=dict)
    plugins: Plugins = ()  # with signals that follow from the log

    @cached_property
    def recording(self) -> Recording:
        """The log."""
        return self.run.recording

    @property
    def counted(self) -> Recording:
        """The log up to the end of a path that has one, which metrics count."""
        return self.recording.up_to(self.about.path_end)

    @property
    def until(self) -> float:
        """The end of the run, or of its log where it did not finish [s]."""
        if self.recording.status == "finished":
            return self.about.duration
        return float(self.recording["time"][-1]) if len(self.recording["time"]) else 0.0

    @property
    def every(self) -> int:
        """Steps from one logged instant to the next."""
        return self.about.every

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
        return finished and not self.about.at_target(self.metrics())

    def signal(self, name: str) -> Vector:
        """A logged or derived signal; empty where the run has none of this name."""
        has = derived.has(self.recording, name, self.plugins)
        return derived.signal(self.recording, name, self.plugins) if has else np.empty(0)

    def check(self, name: str) -> bool | None:
        """Whether a named property holds."""
        return CHECKS[name](self.about, self.recording.status)


def metrics_of(entries: Sequence[Entry]) -> dict[str, MetricAbout]:
    """All metrics that podusv, a plug-in or a run knows, and those that only a run's files name."""
    plugins = dict.fromkeys(plugin for entry in entries for plugin in entry.plugins)
    known: dict[str, MetricAbout] = {**metrics_with(tuple(plugins))}
    for entry in entries:
        known = known | {n: m for n, m in entry.about.metrics.items() if n not in known}
    names = dict.fromkeys(name for entry in entries for name in entry.run.metrics)
    known |= {name: MetricAbout(name, "", UNKNOWN) for name in names if name not in known}
    return {
        metric.name: metric for metric in sorted(known.values(), key=lambda metric: metric.place)
    }


@dataclass(frozen=True)
class EntryWithoutLog:
    """A run without a log; `failure` is the error message. A `curves.ClaimedRun`."""

    about: RunAbout
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
        """Whether a property holds that does not depend on the log; else None."""
        return CHECKS[name](self.about, None)
