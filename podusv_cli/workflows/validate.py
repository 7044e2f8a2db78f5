"""`podusv validate`: a scenario in, all that a run checks before its first step out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core.component import BY_RULE
from podusv_cli.core.finding import Finding, merge_findings
from podusv_cli.core.phrases import as_yaml
from podusv_cli.engine.running.lanes import why_alone
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.findings.proof import argument, conditions
from podusv_cli.scenario.limits import largest, limits
from podusv_cli.scenario.load import Loaded, values
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.scenario.yaml_tree import Route
from podusv_cli.studies.making.check import sweep_faults, unjudged_claims
from podusv_cli.workflows.execute import examine, warm_up
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import open_scenario

# Sections in the order in which their values are shown; all others follow, and then the hulls.
SHOWN_FIRST = (
    "name",
    "description",
    "controller",
    "controllers",
    "actuator",
    "path",
    "disturbance",
)
HULLS = ("vessel", "nominal")  # a hundred numbers


@dataclass(frozen=True)
class Valid:
    """A scenario without a fault: what a run of it takes, its study, and its findings."""

    loaded: Loaded
    findings: Sequence[Finding]
    study: Sequence[str] = ()

    def lines(self) -> Iterator[str]:
        """Lines on the scenario: laws, steps, time and memory of a run, study, findings."""
        scenario = self.loaded.scenario
        laws, steps = ", ".join(scenario.labels()), scenario.time_grid().steps
        yield f"ok ({scenario.name}, {laws}, {steps} steps)"
        yield f"a run takes {largest(self.loaded)}"
        yield from self.study
        yield from map(str, self.findings)

    def explain_lines(self) -> Iterator[str]:
        """How runs march, the rank argument, the proof's conditions, every value and its origin."""
        scenario = self.loaded.scenario
        for law, plan in self.loaded.plans.items() if scenario.sweep else ():
            why = why_alone(plan)
            yield f"{law}: runs march {f'one by one: {why}' if why else 'side by side'}"
        yield argument(scenario)
        yield from conditions(scenario)
        if scenario.keys_by_rule():
            yield f"defaults {BY_RULE}: {scenario.facts.in_words()}"
        yield from self._value_lines()

    def _value_lines(self) -> Iterator[str]:
        """Every value and its origin; law, task and limits first, hulls last.

        A nominal vessel that is the true one is one line.
        """
        origins = self.loaded.origins
        shown = {
            key: f"{as_yaml(content)}  # {origins[key]}"
            for key, content in values(self.loaded.scenario).items()
        }
        own, nominal = (
            {key.removeprefix(room): line for key, line in shown.items() if key.startswith(room)}
            for room in ("vessel.", "nominal.")
        )
        same = own == nominal
        for key in sorted(shown, key=_place_of):
            if not (same and key.startswith("nominal.")):
                yield f"{key}: {shown[key]}"
        if same:
            yield "nominal: as vessel  # every value, and its origin"


def validate(config: Path, request: Request) -> Valid:
    """Check a scenario as a run does before its first step.

    Raises ScenarioError, LawError, and StorageError for a study that fits nowhere.
    """
    checks = (unknown_codes, limits(request.allow_large), sweep_faults, _tune_faults)
    loaded = open_scenario(config, request, checks)
    parse_claims(loaded)
    scenario = loaded.scenario
    study = _study(loaded, scenario.sweep) if scenario.sweep else []
    findings = merge_findings({label: examine(case) for label, case in loaded.cases.items()})
    for case in loaded.cases.values():
        warm_up(case)
    return Valid(loaded, findings, study)


def _place_of(key: str) -> int:
    """Where a value stands in the list, by its section."""
    section = key.partition(".")[0].partition("[")[0]
    if section in HULLS:
        return len(SHOWN_FIRST) + 1
    return SHOWN_FIRST.index(section) if section in SHOWN_FIRST else len(SHOWN_FIRST)


def _tune_faults(loaded: Loaded) -> list[tuple[Route, str]]:
    """What is wrong with a search; its modules are slow to import, and few scenarios have one."""
    if loaded.scenario.tune is None:
        return []
    from podusv_cli.studies.tuning.check import tune_faults

    return tune_faults(loaded)


def _study(loaded: Loaded, sweep: Sweep) -> list[str]:
    """Lines on the study: how many runs it has, and which draws the scenario cannot take."""
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
    remark = unjudged_claims(loaded.scenario)
    lines = [counted, check_draws(made).in_words(), *filter(None, [remark])]
    if not loaded.scenario.tune:
        return lines
    search = TunePlan(loaded.scenario).in_words()
    return ["as a study, by podusv sweep:", *lines, "as a search, by podusv tune:", *search]
