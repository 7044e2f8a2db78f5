"""All kinds of findings, and what they say of a scenario and its run."""

from __future__ import annotations

from functools import cache

import numpy as np

from podusv_cli.core import registry
from podusv_cli.core.errors import LawError
from podusv_cli.core.finding import Finding, FindingKind, merge_findings
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.recording import Recording
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import BASES, Scenario

# A kind of finding may be in the file of the component that it is about.
PACKAGES = ("findings", *(f"components.{section}s" for section in BASES))


@cache
def finding_kinds(plugins: Plugins = ()) -> dict[str, FindingKind]:
    """Every kind of finding by code, in the order of the scenario's sections.

    Those of these plug-ins are among them. Raises LawError for one about an unknown section.
    """
    by_code: dict[str, FindingKind] = {}
    for package in PACKAGES:
        by_code |= registry.find_by_name(f"podusv_cli.{package}", FindingKind, plugins)
    sections = list(Scenario.model_fields)
    for kind in by_code.values():
        if kind.about.partition(".")[0] not in sections:
            what = f"finding {kind.name!r} is about {kind.about!r}: "
            raise LawError(what + unknown_word("section", kind.about.partition(".")[0], sections))
    ordered = sorted(by_code.values(), key=lambda n: sections.index(n.about.partition(".")[0]))
    return {kind.name: kind for kind in ordered}


def unknown_codes(loaded: Loaded) -> list[tuple[str, str]]:
    """Key and sentence for every unknown code in `silence`; a check for `load`."""
    codes = tuple(finding_kinds(loaded.scenario.plugged))
    return [
        (f"silence[{place}]", unknown_word(f"finding {code!r}", code, codes, "podusv list"))
        for place, code in enumerate(loaded.scenario.silence)
        if code not in codes
    ]


def preflight(scenario: Scenario) -> list[Finding]:
    """The findings about a scenario before it runs, but those that it silences.

    With `controllers` these are the findings for each law, merged.
    """
    return merge_findings(
        {name: find_before_run(Case.of(single)) for name, single in scenario.singles().items()}
    )


def find_before_run(case: Case) -> list[Finding]:
    """The findings about a case before it runs, but those that its scenario silences."""
    return _findings("before", case.scenario, case)


def postflight(scenario: Scenario, log: Recording) -> list[Finding]:
    """The findings about a run of this scenario, but those that it silences."""
    return _findings("after", scenario, scenario, log) if len(log["time"]) else []


def _findings(when: str, scenario: Scenario, *seen: object) -> list[Finding]:
    """What is found before or after a run, but what the scenario silences.

    `seen` is what findings of that time look at: a case, or a scenario and its log.
    """
    known = finding_kinds(scenario.plugged).items()
    kinds = [kind for code, kind in known if kind.when == when and code not in scenario.silence]
    # A diverged run has numbers that overflow.
    with np.errstate(all="ignore"):
        return [finding for kind in kinds for finding in kind.findings(scenario.controller, *seen)]
