"""Properties of a run that a claim can check by name."""

from __future__ import annotations

from collections.abc import Callable

from podusv_cli.core.recording import Status
from podusv_cli.findings.underactuation import input_rank
from podusv_cli.scenario.model import Scenario

# Arguments: the scenario, and how its run ended (None without a log). None means unknown.
CHECKS: dict[str, Callable[[Scenario, Status | None], bool | None]] = {
    "finished": lambda scenario, status: (
        status == "finished" if status in ("finished", "diverged") else None
    ),
    "underactuated": lambda scenario, status: (
        None if scenario.actuator.is_recorded else input_rank(scenario.actuator) < 3
    ),
}
