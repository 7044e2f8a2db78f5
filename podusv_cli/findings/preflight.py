"""All findings about a scenario that can be told before it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from podusv_cli.findings import law, task, values
from podusv_cli.findings.finding import Case, Finding
from podusv_cli.scenario.model import Scenario

Check = Callable[[Case], Iterator[Finding]]

# One function a code, in the order in which findings are shown.
CHECKS: dict[str, Check] = {
    "damping-sign": values.damping_sign,
    "large-angle": values.large_angle,
    "path-jump": task.path_jump,
    "path-corner": task.path_corner,
    "path-bend": task.path_bend,
    "sway-drift": task.sway_drift,
    "sway-unstable": task.sway_unstable,
    "thrust-short": task.thrust_short,
    "coupling-saddle": law.coupling_saddle,
    "start-astern": law.start_astern,
    "start-kick": law.start_kick,
    "network-range": law.network_range,
    "stiff-adaptation": law.stiff_adaptation,
    "stiff-start": law.stiff_start,
    "stiff-actuator": task.stiff_actuator,
    "stiff-derivative": law.stiff_derivative,
    "sampled-adaptation": law.sampled_adaptation,
    "sampled-derivative": law.sampled_derivative,
}


def preflight(scenario: Scenario) -> list[Finding]:
    """What is worth knowing about a scenario before it runs, silenced findings included.

    With `controllers` it is asked of each law; what they share is told once.
    """
    if scenario.controllers:
        return together({name: preflight(one) for name, one in scenario.singles().items()})
    case = Case(scenario)
    with np.errstate(all="ignore"):
        return [finding for check in CHECKS.values() for finding in check(case)]


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
