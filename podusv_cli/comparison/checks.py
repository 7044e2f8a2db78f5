"""Properties of a run that a claim can state by name."""

from __future__ import annotations

from collections.abc import Callable

from podusv_cli.core.recording import Status
from podusv_cli.findings.underactuation import input_rank
from podusv_cli.scenario.model import Scenario

# By name: whether a run of this scenario that ended so has the property; None where it cannot be
# told. The status is None for a run that left nothing behind.
CHECKS: dict[str, Callable[[Scenario, Status | None], bool | None]] = {
    "finished": lambda scenario, status: (
        status == "finished" if status in ("finished", "diverged") else None
    ),
    "underactuated": lambda scenario, status: input_rank(scenario.actuator) < 3,
}
