"""Full run folders of a study's runs that `sweep.keep` asks for, made again from their draws."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from podusv_cli.core.system import relative_path
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.sections import LONGEST_NAME
from podusv_cli.storage.run_folder import LOGS
from podusv_cli.studies.making.draws import draw_scenario, draws
from podusv_cli.studies.making.plan import StudyPlan
from podusv_cli.studies.telling.keep import Kept, KeptRun, find_kept, missing_runs
from podusv_cli.studies.telling.results import Results
from podusv_cli.workflows.execute import RunTask, execute, warm_up
from podusv_cli.workflows.request import Request


def scenario_of_draw(plan: StudyPlan, law: str, cell: int, draw: int) -> Scenario:
    """The scenario of one run of a study, under a name of its own."""
    (numbers,) = draws(plan.sweep, draw, 1)
    single = draw_scenario(plan.single(law, cell), plan.sweep.vary, numbers)
    # Long names are cut, so that the whole fits the limit.
    end = f"-{KeptRun(law, cell, draw, '').name}"
    return single.model_copy(update={"name": f"{single.name[: LONGEST_NAME - len(end)]}{end}"})


def seen_from(place: Path, study: Path, scenario: Scenario) -> Scenario:
    """A scenario of a study, with its plug-in files named as from the folder `place`.

    `study` is the folder of the study, which keeps the files.
    """
    kept = scenario.plugin_files()
    names = {name: relative_path(study / name, place) for name in kept}
    plugins = {names.get(name, name): required for name, required in scenario.plugins.items()}
    return scenario.model_copy(update={"plugins": plugins})


def keep(
    folder: Path, plan: StudyPlan, results: Results, extras: Extras, request: Request
) -> list[Kept]:
    """Make those kept runs that are not there yet; all of them, compared with the table.

    A run that fails is noted in `extras`. Raises StorageError only for what is not about one run.
    """
    missing = missing_runs(folder, results)
    tasks = [_task(folder, plan, run, request) for run in missing]
    with interrupts_enabled():
        # Compiled here, once, before the processes fork.
        for law, cell in dict.fromkeys((run.law, run.cell) for run in missing):
            warm_up(Case(plan.single(law, cell), plan.run_plan(law, cell)))
    outcomes = run_all([partial(execute, task) for task in tasks], workers=request.workers)
    for run, outcome in zip(missing, outcomes, strict=True):
        if outcome.failure:
            extras.missing.append(Failure(f"{LOGS}/{run.name}", outcome.failure))
    extras.interrupted |= any(outcome.interrupted for outcome in outcomes)
    return find_kept(folder, results, extras)


def _task(folder: Path, plan: StudyPlan, run: KeptRun, request: Request) -> RunTask:
    """The run of a draw whose log the study keeps, as `execute` takes it."""
    scenario = scenario_of_draw(plan, run.law, run.cell, run.draw)
    return RunTask(
        scenario,
        resolved_yaml(scenario),
        folder / LOGS / run.name,
        figures=request.figures,
        argv=request.argv,
        label=run.law,
    )
