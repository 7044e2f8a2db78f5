"""Runs of papers as a comparison sees them."""

from __future__ import annotations

from podusv_cli.core.past_run import PastRun
from podusv_cli.engine.running import simulate as simulation
from podusv_cli.metrics.operations import operations
from podusv_cli.scenario.about import about_of


def untimed(runs):
    """No times of laws, which take a while to measure and are not committed."""
    return [{} for _ in runs]


def rerun(scenario):
    """A run without a folder, as a comparison sees it; nothing is timed."""
    plan = scenario.plan()
    recording = simulation.run(plan)
    numbers = plan.probe.summary(recording.seen) | operations(plan, recording)
    return PastRun("", about_of(scenario), recording, numbers)
