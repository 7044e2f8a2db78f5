"""`podusv identify`: the hull of a boat from its logs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from podusv_cli.core.errors import UsageError
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.identify import outputs
from podusv_cli.identify.answer import Identification
from podusv_cli.identify.doubts import list_doubts, refusal
from podusv_cli.identify.fit import estimate
from podusv_cli.identify.fit.gusts import estimate_in_sea
from podusv_cli.identify.fit.problem import FitProblem
from podusv_cli.identify.fit.records import FilterLog
from podusv_cli.identify.intake import logs_of
from podusv_cli.identify.judge import FreeRun, free_runs, scores
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.process.interrupts import interrupts_deferred, interrupts_enabled
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.shipped import relative_to
from podusv_cli.storage.run_folder import default_folder
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS, open_scenario, writer_of

Progress = Callable[[str, float], None]
SETTLES = 30  # rounds, after which a search has usually settled


def identify(
    config: Path, request: Request, progress: Progress | None = None
) -> outputs.Identified:
    """Find the hull's numbers from the logs that a scenario names.

    An interrupt keeps the best numbers so far. Raises UsageError without logs and for logs that
    cannot be used, ScenarioError, StorageError.
    """
    loaded = open_scenario(config, request, (unknown_codes,))
    return identify_of(loaded, request, progress)


def identify_of(
    loaded: Loaded, request: Request, progress: Progress | None = None
) -> outputs.Identified:
    """The same for a scenario that is loaded and checked."""
    scenario = loaded.scenario
    if scenario.identify is None or not scenario.identify.logs:
        raise UsageError(
            f"{scenario.name} names no logs; write them under identify.logs, as podusv docs "
            "identify shows"
        )
    logs = _read(loaded, scenario.identify.logs, progress)
    target = request.out or default_folder(RESULTS, scenario.name, resolved_yaml(scenario))
    with interrupts_deferred(), writer_of(request, target) as writer:
        with interrupts_enabled():
            answer = answer_logs(scenario, scenario.identify, logs, progress)
        warnings = (*(line for log, _ in logs for line in log.warnings), *list_doubts(answer))
        refused = "" if request.force else refusal(answer)
        for line in warnings:
            request.warn(line)
        writer.extras.interrupted = answer.estimate.interrupted
        outputs.write(
            writer, answer, loaded.text, refusal=refused, warnings=warnings, figures=request.figures
        )
        return outputs.Identified(
            writer.finish(), answer, writer.status, refused, warnings, tuple(writer.extras.missing)
        )


def _read(
    loaded: Loaded, wanted: Sequence[LogFile], progress: Progress | None
) -> list[tuple[FilterLog, str]]:
    """The logs with their roles. Raises LogFault with what is wrong with all of them."""
    logs: list[tuple[FilterLog, str]] = []
    faults: list[str] = []
    for i, given in enumerate(wanted):
        if progress:
            progress(f"looking at {given.file}", i / len(wanted))
        path = Path(relative_to(loaded.root.mark.source, given.file))
        try:
            logs += [(log, given.role) for log in logs_of(path, given, loaded.scenario)]
        except LogFault as fault:
            faults += fault.lines()
    if faults:
        raise LogFault(*faults)
    return logs


def answer_logs(
    scenario: Scenario,
    wanted: Identify,
    logs: Sequence[tuple[FilterLog, str]],
    progress: Progress | None,
) -> Identification:
    """The hull, and what is known of its errors."""
    problem = FitProblem(scenario, wanted, [log for log, role in logs if role == "fit"])

    def tell(i: int, value: float) -> None:
        if progress:
            progress(f"fitting, round {i}", min(i / SETTLES, 0.99))

    problem, best = estimate_in_sea(problem, tell)
    found = estimate.prior_kept(problem.search, best, tell)
    ways = estimate.directions(found.covariance, len(problem.hull))
    judged: list[tuple[FilterLog, str, Sequence[FreeRun]]] = [(log, role, ()) for log, role in logs]
    try:
        for i, (log, role) in enumerate(logs):
            judged[i] = log, role, free_runs(problem, log, found.y)
    except KeyboardInterrupt:
        found = replace(found, interrupted=True)
    marks = [score for log, role, runs in judged for score in scores(log, role, runs)]
    return Identification(problem, found, ways, judged, marks)
