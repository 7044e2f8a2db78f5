"""What a finished run shows that a user should know, with times; from its logged rows."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.finding import Finding, Sentences, after, rows_where, times_of
from podusv_cli.core.recording import Recording
from podusv_cli.findings.finding import notices
from podusv_cli.scenario.model import Scenario

LONG = 0.02  # of the run; a limit in force for less is not told


@after("saturated", about="actuator", meaning="the actuator limited the law for long")
def saturated(scenario: Scenario, log: Recording) -> Sentences:
    """The actuator limits the law for long."""
    if "saturated" not in log:
        return
    limited = rows_where(log, lambda part: part["saturated"] > 0.5)
    part = float(limited.mean())
    if part > LONG:
        learnt = (
            "anti_windup is on: saturation does not wind up the law's adaptation or integrators"
            if scenario.controller.wants_loads()
            else "while saturated, the law's adaptation and integrators wind up; consider "
            "anti_windup: auxiliary"
        )
        yield (
            f"the actuator limits the law during {part:.1%} of the run, {times_of(log, limited)}; "
            f"{learnt}"
        )


def aftermath(scenario: Scenario, log: Recording) -> list[Finding]:
    """What is worth knowing about a run of this scenario, silenced findings included."""
    if not len(log["time"]):
        return []
    looks = [notice for notice in notices().values() if notice.when == "after"]
    with np.errstate(all="ignore"):
        return [
            told for notice in looks for told in notice.findings(scenario.controller, scenario, log)
        ]
