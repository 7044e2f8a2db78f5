"""What is wrong with a scenario's key `tune`, found before anything is simulated."""

from __future__ import annotations

from collections.abc import Iterator

from podusv_cli.expressions.reading import ExpressionError
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.tune import Tune
from podusv_cli.scenario.yaml_tree import Route
from podusv_cli.studies.making.check import singles
from podusv_cli.studies.tuning.objective import parse_inequality, parse_objective
from podusv_cli.studies.tuning.space import space_faults

Faults = Iterator[tuple[Route, str]]


def tune_faults(loaded: Loaded) -> list[tuple[Route, str]]:
    """Steps of the key and message for everything that is wrong; nothing without `tune`."""
    scenario, tune = loaded.scenario, loaded.scenario.tune
    if tune is None:
        return []
    return [
        *_study(scenario),
        *_budget(tune),
        *_expressions(scenario, tune),
        *_space(scenario, tune),
    ]


def _study(scenario: Scenario) -> Faults:
    """What keeps the scenario's study from being tuned on."""
    if scenario.sweep is None:
        yield (("tune",), "needs the key sweep: its `vary` says what is drawn (podusv docs tuning)")
    elif scenario.sweep.grid:
        fault = "needs a study without a grid: put what laws have to cope with under sweep.vary"
        yield ("tune",), f"{fault}, and write `grid: {{{next(iter(scenario.sweep.grid))}: null}}`"
    elif not scenario.sweep.independent:
        fault = f"{scenario.sweep.design} points have no intervals, which a comparison needs"
        yield ("sweep", "design"), f"{fault}; write design: random"


def _budget(tune: Tune) -> Faults:
    """A budget that is less than one batch: `batch` gains, each with all `train` draws."""
    # With less, no trial might meet all draws, and only such a trial can win.
    least = tune.batch * tune.train
    if tune.budget < least:
        yield (
            ("tune", "budget"),
            f"{tune.budget} runs are less than one batch of {tune.batch} gains with {tune.train} "
            f"draws each; give {least} or more, or fewer draws (train)",
        )


def _expressions(scenario: Scenario, tune: Tune) -> Faults:
    """An objective or inequality that cannot be read."""
    metrics = {n: m for n, m in scenario.known_metrics().items() if m.accumulator}
    try:
        parse_objective(tune.objective, metrics)
    except ExpressionError as error:
        yield ("tune", "objective"), str(error)
    for place, text in enumerate(tune.subject_to):
        try:
            parse_inequality(text, metrics)
        except ExpressionError as error:
            yield ("tune", "subject_to", place), str(error)


def _space(scenario: Scenario, tune: Tune) -> Faults:
    for name, text in space_faults(singles(scenario), tune):
        yield ("tune", "space", name), text
