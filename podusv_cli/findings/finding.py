"""All kinds of findings, what they say of a scenario and its run, and the `Case` they look at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from podusv_cli.components.facts import Facts
from podusv_cli.core import registry
from podusv_cli.core.about import RunAbout
from podusv_cli.core.errors import LawError
from podusv_cli.core.finding import Finding, FindingKind, merged
from podusv_cli.core.kernel import Vector
from podusv_cli.core.phrases import unknown
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.recording import Recording
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.check import evaluated
from podusv_cli.findings.reference import Reference, reference
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.load import Loaded, resolved_yaml
from podusv_cli.scenario.model import BASES, Scenario

# A kind of finding may be in the file of the component that it is about.
PACKAGES = ("findings", *(f"components.{section}s" for section in BASES))


@cache
def finding_kinds(plugins: Plugins = ()) -> dict[str, FindingKind]:
    """Every kind of finding by code, in the order of the scenario's sections.

    Those of these plug-ins are among them.
    """
    by_code: dict[str, FindingKind] = {}
    for package in PACKAGES:
        by_code |= registry.named(f"podusv_cli.{package}", FindingKind, plugins)
    sections = list(Scenario.model_fields)
    for kind in by_code.values():
        if kind.about.partition(".")[0] not in sections:
            what = f"finding {kind.name!r} is about {kind.about!r}: "
            raise LawError(what + unknown("section", kind.about.partition(".")[0], sections))
    ordered = sorted(by_code.values(), key=lambda n: sections.index(n.about.partition(".")[0]))
    return {kind.name: kind for kind in ordered}


def unknown_codes(loaded: Loaded) -> list[tuple[str, str]]:
    """Key and sentence for every unknown code in `silence`; a check for `load`."""
    codes = tuple(finding_kinds(loaded.scenario.plugged))
    return [
        (f"silence[{place}]", unknown(f"finding {code!r}", code, codes, "podusv list"))
        for place, code in enumerate(loaded.scenario.silence)
        if code not in codes
    ]


def preflight(scenario: Scenario) -> list[Finding]:
    """The findings about a scenario before it runs, but those that it silences.

    With `controllers` these are the findings for each law, merged.
    """
    return merged({name: Case.of(single).findings() for name, single in scenario.singles().items()})


def postflight(scenario: Scenario, log: Recording) -> list[Finding]:
    """The findings about a run of this scenario, but those that it silences."""
    return _findings("after", scenario, scenario, log) if len(log["time"]) else []


def _findings(when: str, scenario: Scenario, *seen: object) -> list[Finding]:
    known = finding_kinds(scenario.plugged).items()
    kinds = [kind for code, kind in known if kind.when == when and code not in scenario.silence]
    with np.errstate(all="ignore"):
        return [finding for kind in kinds for finding in kind.findings(scenario.controller, *seen)]


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
    def of(cls, scenario: Scenario) -> Case:
        """Of a scenario that nobody has planned yet."""
        return cls(scenario, scenario.plan())

    def findings(self) -> list[Finding]:
        """The findings about it before it runs, but those that it silences."""
        return _findings("before", self.scenario, self)

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
        """The law's signals at t = 0; NaN where undefined, as on top of the target."""
        law = self.scenario.controller
        try:
            _, _, signals = evaluated(self.plan, 0.0)
        except Exception:  # `check_law` reports a faulty law before the run
            signals = np.full(len(law.signals), np.nan)
        names = (part.name for part in law.signals)
        return dict(zip(names, signals.tolist(), strict=True))
