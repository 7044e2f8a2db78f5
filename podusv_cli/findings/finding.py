"""A finding, and the scenario as the checks see it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from podusv_cli.core import registry
from podusv_cli.core.finding import Finding, Notice
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.findings.reference import Reference, reference
from podusv_cli.paths.base import TARGET
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.phrases import unknown

# A finding may stand beside the component that it is about.
ROOMS = ("findings", "paths", "disturbances", "actuators", "controllers")


@cache
def notices() -> dict[str, Notice]:
    """Every kind of finding by its code, in the order of the scenario's sections."""
    found: dict[str, Notice] = {}
    for room in ROOMS:
        found |= registry.named(f"podusv_cli.{room}", Notice)
    sections = list(Scenario.model_fields)
    ordered = sorted(found.values(), key=lambda n: sections.index(n.about.partition(".")[0]))
    return {notice.name: notice for notice in ordered}


def unknown_codes(scenario: Scenario) -> list[tuple[str, str]]:
    """Key and sentence for every code in `silence` that no finding has; a check for `load`."""
    codes = tuple(notices())
    return [
        (f"silence[{place}]", unknown(f"finding {code!r}", code, codes))
        for place, code in enumerate(scenario.silence)
        if code not in codes
    ]


def heard(findings: Iterable[Finding], scenario: Scenario) -> list[Finding]:
    """The findings that the scenario does not silence."""
    return [finding for finding in findings if finding.code not in scenario.silence]


@dataclass(frozen=True)
class Case:
    """A scenario of one law, with what several checks need of it, computed once."""

    scenario: Scenario

    @cached_property
    def reference(self) -> Reference:
        """What following the target means for this vessel."""
        return reference(self.scenario)

    @property
    def first_velocity(self) -> Vector:
        """(u, v, r) at t = 0."""
        start = self.scenario.start
        return np.array([start.u, start.v, start.r])

    @cached_property
    def first(self) -> dict[str, float]:
        """The law's signals at t = 0; NaN where it has no numbers, as right on the target."""
        loop = self.scenario.closed_loop()
        law, memory = loop.controller, loop.first_memory()
        x, target = np.array(loop.start), np.zeros(len(TARGET))
        loop.path.evaluate(0.0, bundle(loop.path.constants()), loop.path.table(), target)
        k, table = bundle(law.constants_with(loop.nominal)), law.table()
        signals, rate = np.zeros(len(law.signals)), np.zeros(len(memory))
        work = np.zeros(law.workspace())
        try:
            if law.sample_period() > 0:
                law.sample(0.0, x, memory, target, k, table)
            law.law(0.0, x, memory, target, k, table, np.zeros(2), rate, signals, work)
        except (
            Exception
        ):  # plain Python's; a law's mistakes are told when it is asked, before the run
            signals[:] = np.nan
        return dict(zip((part.name for part in law.signals), signals.tolist(), strict=True))
