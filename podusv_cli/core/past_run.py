"""A run that is over: what claims, tables, figures and Python ask of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from podusv_cli.core import derived_signals as derived
from podusv_cli.core.about import RunAbout
from podusv_cli.core.kernel import Vector
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.recording import Recording, Status

# What claims can check of a run. Arguments: what it says about itself, and how it ended. None means
# unknown: an interrupted run might have finished.
CHECKS: dict[str, Callable[[RunAbout, Status], bool | None]] = {
    "finished": lambda about, status: None if status == "interrupted" else status == "finished",
    "underactuated": lambda about, status: about.underactuated,
}


class LogOnDisk(Protocol):
    """A log that is read when it is first asked for, and kept."""

    @property
    def recording(self) -> Recording:
        """The content. Raises StorageError where it cannot be read."""


@dataclass(frozen=True, eq=False)
class PastRun:
    """A run that is over.

    `log` is what was recorded, or where that can be read. `metrics` are the run's own, NaN where
    they are undefined; `cost` are metrics measured for a comparison, which replace the run's own.
    `plugins` have signals that follow from the log. `folder` is None for a run that was only
    simulated, and the file of what was measured. `theory` has the findings of the stability
    monitor, empty without a Lyapunov function. `failure` is the error of a run without a log.
    """

    label: str
    about: RunAbout
    log: Recording | LogOnDisk
    metrics: Mapping[str, float] = field(default_factory=dict)
    cost: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    plugins: Plugins = ()
    folder: Path | None = None
    theory: Mapping[str, Any] = field(default_factory=dict)
    failure: str = ""

    @classmethod
    def without_log(cls, label: str, about: RunAbout, failure: str) -> PastRun:
        """A run of which there is no log; `failure` is its error message, in several lines."""
        nothing = Recording("interrupted", "", {"time": np.empty(0)})
        return cls(label, about, nothing, failure=failure)

    @property
    def recording(self) -> Recording:
        """The log, read on first use. Raises StorageError."""
        return self.log if isinstance(self.log, Recording) else self.log.recording

    @property
    def counted_recording(self) -> Recording:
        """The log up to the end of a path that has one, which metrics count."""
        return self.recording.up_to(self.about.path_end)

    @property
    def finished(self) -> bool:
        """Whether it reached its end."""
        return self.recording.status == "finished"

    @property
    def until(self) -> float:
        """The time up to which it was simulated [s]: its end, or that of its log."""
        if self.finished:
            return self.about.duration
        return float(self.recording["time"][-1]) if len(self.recording["time"]) else 0.0

    @property
    def every(self) -> int:
        """Steps from one logged instant to the next; 1 where every step is logged."""
        return self.about.every

    @property
    def ending(self) -> str:
        """Why it did not reach its end, as `diverged at t = 2 s`; empty where it did."""
        if self.failure:
            return f"has no log: {self.failure.strip().splitlines()[-1]}"
        return self.recording.message.partition(":")[0]

    def metric(self, name: str) -> float:
        """A metric; NaN where it is undefined, and for a run that did not finish."""
        return self.cost.get(name, self.metrics.get(name, math.nan)) if self.finished else math.nan

    def compared_metrics(self) -> dict[str, float]:
        """Every metric by name as `metric` has it, those of the comparison last."""
        return {name: self.metric(name) for name in dict.fromkeys([*self.metrics, *self.cost])}

    @property
    def off_target(self) -> bool:
        """Whether the run finished, but not at its target; no table ranks it."""
        return self.finished and not self.about.at_target(self.compared_metrics())

    def has(self, name: str) -> bool:
        """Whether there is a signal of this name, logged or derivable."""
        return derived.has(self.recording, name, self.plugins)

    def signal(self, name: str) -> Vector:
        """A logged or derived signal; KeyError where there is none of this name."""
        return derived.signal(self.recording, name, self.plugins)

    def check(self, name: str) -> bool | None:
        """Whether a named property holds; None where that is unknown."""
        return CHECKS[name](self.about, self.recording.status)
