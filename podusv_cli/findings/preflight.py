"""All findings about a scenario that can be told before it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from podusv_cli.core.finding import Finding
from podusv_cli.findings.finding import Case, notices
from podusv_cli.scenario.model import Scenario


def preflight(scenario: Scenario) -> list[Finding]:
    """What is worth knowing about a scenario before it runs, silenced findings included.

    With `controllers` it is asked of each law; what they share is told once.
    """
    if scenario.controllers:
        return together({name: preflight(one) for name, one in scenario.singles().items()})
    case = Case(scenario)
    looks = [notice for notice in notices().values() if notice.when == "before"]
    with np.errstate(all="ignore"):
        return [told for notice in looks for told in notice.findings(scenario.controller, case)]


def together(findings: Mapping[str, Sequence[Finding]]) -> list[Finding]:
    """Findings about several runs, by label: the same told once, with its runs unless it is all."""
    alike: dict[Finding, list[str]] = {}
    for label, several in findings.items():
        for finding in dict.fromkeys(several):
            alike.setdefault(finding, []).append(label)
    return [
        replace(finding, runs=() if len(labels) == len(findings) else tuple(labels))
        for finding, labels in alike.items()
    ]
