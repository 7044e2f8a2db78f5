"""A case simulated in memory: the same numbers and warnings as in a folder, and nothing written."""

from __future__ import annotations

from podusv_cli.core.past_run import PastRun
from podusv_cli.findings.finding import find_before_run, postflight
from podusv_cli.process.extras import Extras
from podusv_cli.scenario.case import Case
from podusv_cli.workflows.execute import Stopwatch, add_derived, simulate_case, summary


def run_in_memory(case: Case) -> PastRun:
    """Simulate a case without a folder; a metric that cannot be computed becomes a warning.

    Its law's cost is not measured. Raises LawError.
    """
    extras = Extras()
    recording = simulate_case(case, Stopwatch())
    whole, _ = add_derived(case, recording)
    findings = [*find_before_run(case), *postflight(case.scenario, whole)]
    numbers = summary(case, recording, extras)
    return PastRun(
        whole.controller,
        case.about,
        whole,
        numbers,
        warnings=tuple(map(str, (*findings, *extras.missing))),
        plugins=case.scenario.plugged,
    )
