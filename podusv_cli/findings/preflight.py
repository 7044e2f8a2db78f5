"""All findings about a scenario before it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from podusv_cli.core.finding import Finding
from podusv_cli.findings.finding import Case, finding_kinds
from podusv_cli.scenario.model import Scenario


def preflight(scenario: Scenario) -> list[Finding]:
    """All findings about a scenario before it runs, silenced ones included.

    With `controllers` these are the findings for each law, merged.
    """
    if scenario.controllers:
        return merged({name: preflight(one) for name, one in scenario.singles().items()})
    case = Case(scenario)
    kinds = [kind for kind in finding_kinds(scenario.plugged).values() if kind.when == "before"]
    with np.errstate(all="ignore"):
        return [found for kind in kinds for found in kind.findings(scenario.controller, case)]


def merged(findings: Mapping[str, Sequence[Finding]]) -> list[Finding]:
    """Findings of several runs (by label), each once, with its runs unless all runs have it."""
    alike: dict[Finding, list[str]] = {}
    for label, several in findings.items():
        for finding in dict.fromkeys(several):
            alike.setdefault(finding, []).append(label)
    return [
        replace(finding, runs=() if len(labels) == len(findings) else tuple(labels))
        for finding, labels in alike.items()
    ]
