"""A scenario with one law and its plan: what a run is made of, and what warnings look at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from podusv_cli.components.facts import Facts
from podusv_cli.core.about import RunAbout
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.check import evaluate_law
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.reference import Reference, reference
from podusv_cli.scenario.resolved import resolved_yaml


@dataclass(frozen=True)
class Case:
    """A scenario with one law, its plan, and what is needed of it several times, computed once.

    The plan is the run's loop on its grid, with the probe of all metrics. `identify` says what a
    log beside the run calls its quantities.
    """

    scenario: Scenario
    plan: Plan
    identify: Identify | None = None

    @classmethod
    def of(cls, scenario: Scenario, identify: Identify | None = None) -> Case:
        """Of a scenario that nobody has planned yet."""
        return cls(scenario, scenario.plan(), identify)

    def __reduce__(self) -> tuple[Any, ...]:
        """The scenario alone: its plan has kernels that other processes cannot name."""
        return Case.of, (self.scenario, self.identify)

    @cached_property
    def reference(self) -> Reference:
        """The steady motion that follows the target."""
        return reference(self.scenario)

    @cached_property
    def about(self) -> RunAbout:
        """What readers of its run need."""
        return about_of(self.scenario, self.identify)

    @cached_property
    def resolved_yaml(self) -> str:
        """The scenario as a file with every value in it."""
        return resolved_yaml(self.scenario)

    @cached_property
    def facts(self) -> Facts:
        """What hull and actuator can do."""
        return self.scenario.facts

    @property
    def first_velocity(self) -> Vector:
        """(u, v, r) at t = 0."""
        start = self.scenario.start
        return np.array([start.u, start.v, start.r])

    @cached_property
    def first_signals(self) -> dict[str, float]:
        """The law's signals at t = 0, by name; NaN where undefined, as on top of the target."""
        law = self.scenario.controller
        try:
            _, _, signals = evaluate_law(self.plan, 0.0)
        except Exception:  # `check_law` reports a faulty law before the run
            signals = np.full(len(law.signals), np.nan)
        names = (part.name for part in law.signals)
        return dict(zip(names, signals.tolist(), strict=True))
