"""`podusv validate`: check a scenario, estimate its run, show where its values come from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from podusv_cli.cli.options import AllowLarge, Assignments, Config, Plugins, Trust
from podusv_cli.cli.terminal import echo

if TYPE_CHECKING:
    from podusv_cli.scenario.load import Loaded
    from podusv_cli.scenario.sweep import Sweep
    from podusv_cli.scenario.yaml_tree import Route


def validate(
    config: Config,
    assign: Assignments = None,
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            "-v",
            help="Show the rank argument, the proof's gain conditions, every value and its origin.",
        ),
    ] = False,
    allow_large: AllowLarge = False,
    trust: Trust = False,
    plugin: Plugins = None,
) -> None:
    """Check a scenario as a run does before its first step; if all is valid, print findings.

    Exit code 0, with a line for each finding; 2 with a line for each fault; or 5 for a study that
    fits neither on the disk nor into memory.
    """
    from podusv_cli.comparison.parsing import parse_claims
    from podusv_cli.core.finding import merged
    from podusv_cli.findings.finding import Case, unknown_codes
    from podusv_cli.scenario.limits import largest, limits
    from podusv_cli.scenario.load import load
    from podusv_cli.scenario.plugins import of_files
    from podusv_cli.studies.making.check import sweep_faults
    from podusv_cli.workflows.execute import examined, warm_up

    checks = (unknown_codes, limits(allow_large), sweep_faults, _tune_faults)
    loaded = load(config, assign or (), checks, plugin or (), of_files(trust))
    parse_claims(loaded)
    scenario = loaded.scenario
    laws, steps = ", ".join(scenario.labels()), scenario.time_grid().steps
    study = _study(loaded, scenario.sweep) if scenario.sweep else []
    cases = {
        label: Case(single, loaded.plans[label]) for label, single in scenario.singles().items()
    }
    findings = merged({label: examined(case) for label, case in cases.items()})
    for case in cases.values():
        warm_up(case)
    loaded.told(echo)
    echo(f"{config}: ok ({scenario.name}, {laws}, {steps} steps)")
    echo(f"a run takes {largest(loaded)}", *study, *findings)
    if verbose:
        if scenario.sweep:
            _tell_marches(loaded)
        _explain(loaded)


def _tune_faults(loaded: Loaded) -> list[tuple[Route, str]]:
    """What is wrong with a search; its modules are slow to import, and few scenarios have one."""
    if loaded.scenario.tune is None:
        return []
    from podusv_cli.studies.tuning.check import tune_faults

    return tune_faults(loaded)


def _study(loaded: Loaded, sweep: Sweep) -> list[str]:
    """How many runs the study has, and which draws the scenario cannot take."""
    from podusv_cli.studies.making.check import unjudged
    from podusv_cli.studies.making.estimate import check_fits
    from podusv_cli.studies.making.invalid import check_draws
    from podusv_cli.studies.making.plan import plan
    from podusv_cli.studies.tuning.plan import TunePlan
    from podusv_cli.workflows.sweep import default_folder

    made = plan(loaded)
    check_fits(made, default_folder(loaded.scenario))
    counted = (
        f"runs of the study: {len(made.laws) * len(made.cells) * sweep.draws:,} "
        f"(laws: {len(made.laws)}, cells: {len(made.cells)}, draws: {sweep.draws:,})"
    )
    remark = unjudged(loaded.scenario)
    lines = [counted, check_draws(made).in_words(), *filter(None, [remark])]
    if not loaded.scenario.tune:
        return lines
    search = TunePlan(loaded.scenario).in_words()
    return ["as a study, by podusv sweep:", *lines, "as a search, by podusv tune:", *search]


def _tell_marches(loaded: Loaded) -> None:
    """Which laws' runs march side by side, and why the others do not."""
    from podusv_cli.engine.running.lanes import why_alone

    for law, plan in loaded.plans.items():
        why = why_alone(plan)
        echo(f"{law}: runs march {f'one by one: {why}' if why else 'side by side'}")


def _explain(loaded: Loaded) -> None:
    from podusv_cli.core.component import BY_RULE
    from podusv_cli.core.phrases import as_yaml
    from podusv_cli.findings.proof import argument, conditions
    from podusv_cli.scenario.load import values

    echo(argument(loaded.scenario))
    for line in conditions(loaded.scenario):
        echo(line)
    if loaded.scenario.keys_by_rule():
        echo(f"defaults {BY_RULE}: {loaded.scenario.facts.in_words()}")
    for key, content in values(loaded.scenario).items():
        echo(f"{key}: {as_yaml(content)}  # {loaded.origins[key]}")
