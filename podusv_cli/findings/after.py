"""Findings about a finished run, from its logged rows."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.finding import Finding, Sentences, after, rows_where, times_of
from podusv_cli.core.recording import Recording
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.scenario.model import Scenario

LONG = 0.02  # fraction of the run; shorter saturation is no finding


@after(
    "saturated",
    about="actuator",
    meaning="the actuator limited the law for long",
    condition=f"limited during more than {LONG:.0%} of the run",
    remedy="take anti_windup: auxiliary, smaller gains, or a stronger actuator",
)
def saturated(scenario: Scenario, log: Recording) -> Sentences:
    """The actuator limits the law during a considerable part of the run."""
    if "saturated" not in log:
        return
    limited = rows_where(log, lambda part: part["saturated"] > 0.5)
    fraction = float(limited.mean())
    if fraction > LONG:
        consequence = (
            "anti_windup is on: saturation does not wind up the law's adaptation or integrators"
            if scenario.controller.wants_loads()
            else "while saturated, the law's adaptation and integrators wind up; consider "
            "anti_windup: auxiliary"
        )
        yield (
            f"the actuator limits the law during {fraction:.1%} of the run, "
            f"{times_of(log, limited)}; {consequence}"
        )


def postflight(scenario: Scenario, log: Recording) -> list[Finding]:
    """All findings about a run of this scenario, silenced ones included."""
    if not len(log["time"]):
        return []
    kinds = [kind for kind in finding_kinds(scenario.plugged).values() if kind.when == "after"]
    with np.errstate(all="ignore"):
        return [
            finding
            for kind in kinds
            for finding in kind.findings(scenario.controller, scenario, log)
        ]
