"""`podusv doubt`: what would have to change for the verdicts on a scenario's claims to turn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from podusv_cli.comparison import claims
from podusv_cli.comparison.claims import ParsedClaim, RunsVerdict
from podusv_cli.comparison.known_metrics import metrics_of
from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core.errors import PodusvError, UsageError
from podusv_cli.core.past_run import PastRun
from podusv_cli.doubt import outputs
from podusv_cli.doubt.answer import DoubtReport, answers, labels_of
from podusv_cli.doubt.check import doubt_faults
from podusv_cli.doubt.choices import HULL, Singles, choices, with_loads
from podusv_cli.doubt.events import nearest_event
from podusv_cli.doubt.judged import Judge, Judged, World
from podusv_cli.doubt.search import search
from podusv_cli.engine.running.simulate import to_end
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.metrics.operations import law_operations, operations
from podusv_cli.process.extras import Extras
from podusv_cli.process.interrupts import interrupts_deferred, interrupts_enabled
from podusv_cli.scenario.address import with_values
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.doubt import Doubt
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.yaml_tree import find, tree_with
from podusv_cli.storage.run_folder import default_folder
from podusv_cli.workflows.claimed_margins import with_margins
from podusv_cli.workflows.doubt_study import doubt_study
from podusv_cli.workflows.execute import add_derived, examine, summary, warm_up
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import RESULTS, open_scenario, writer_of

Progress = Callable[[str, float], None]


def doubt(config: Path, request: Request, progress: Progress | None = None) -> outputs.Doubted:
    """Move all that the source of a scenario's claims leaves open, and judge them anew.

    The claims are those of its study, if it has any, else those on runs. An interrupt keeps what is
    tried so far. Raises UsageError without claims, ScenarioError, StorageError.
    """
    checks = (unknown_codes, limits(request.allow_large), doubt_faults)
    loaded = open_scenario(config, request, checks)
    if loaded.scenario.sweep and loaded.scenario.sweep.claims:
        return doubt_study(config, loaded, request, progress)
    return doubt_of(loaded, request, progress)


def doubt_of(loaded: Loaded, request: Request, progress: Progress | None = None) -> outputs.Doubted:
    """As `doubt`, for a scenario that is loaded and checked and whose claims are on runs."""
    scenario, world = loaded.scenario, comparison(loaded)
    target = request.out or default_folder(RESULTS, scenario.name, resolved_yaml(scenario))
    with interrupts_deferred(), writer_of(request, target) as writer:
        report, writer.extras.interrupted = report_doubt(world, scenario, request, progress)
        outputs.write(writer, report, loaded.text, figures=request.figures)
        return outputs.Doubted(
            writer.finish(), report.answers, writer.status, tuple(writer.extras.missing)
        )


@dataclass(frozen=True)
class Subject:
    """The claims of a scenario that runs decide, the laws in them, and the same on other hulls."""

    parsed: Sequence[ParsedClaim]
    singles: Singles
    hulls: Mapping[str, Singles]


def comparison(loaded: Loaded) -> Subject:
    """The claims to judge, the laws in them, and the same laws on other hulls.

    Claims on measured times are left out, since these change with every run. Raises UsageError
    without claims, ScenarioError for a hull that is none.
    """
    parsed = [claim for claim in parse_claims(loaded) if not claims.is_timed(claim.claim)]
    if not parsed:
        raise UsageError(
            f"{loaded.scenario.name} has no claims that runs decide, so no verdict can turn; write "
            "some under `claims`, as podusv docs claims shows"
        )
    named = {label for claim in parsed for label in labels_of(claim.claim)}

    def singles_with_claims(scenario: Scenario) -> Singles:
        singles = with_loads(scenario.singles())
        return {label: single for label, single in singles.items() if label in named}

    hulls = find(loaded.root, ("doubt", "hulls"))
    others = {
        node.content: singles_with_claims(
            loaded.merge_over(tree_with("vessel.preset", node, loaded.root))
        )
        for node in (hulls.content if hulls else ())
    }
    return Subject(parsed, singles_with_claims(loaded.scenario), others)


def report_doubt(
    subject: Subject, scenario: Scenario, request: Request, progress: Progress | None
) -> tuple[DoubtReport, bool]:
    """What every verdict depends on, and whether an interrupt ended the search."""
    cases = {label: Case.of(single) for label, single in subject.singles.items()}
    for case in cases.values():
        examine(case)
        with interrupts_enabled():
            warm_up(case, request.compiling)
    with interrupts_enabled():
        runs = {
            label: _simulate_in_memory(label, case, subject.parsed) for label, case in cases.items()
        }
    judge, asked = judging(subject, runs), scenario.doubt or Doubt()
    moving = choices(subject.singles, asked)
    parsed = {claim.name: claim.claim for claim in subject.parsed}
    tried = search(parsed, moving, judge, asked, request.workers, progress)
    # An interrupted search gives back what it has, which is then shorter.
    interrupted = (len(tried.alone), len(tried.worlds)) != (len(moving), asked.draws)
    verdicts = [
        RunsVerdict(
            claim.name,
            claim.claim,
            tried.base.answers[claim.name],
            dict(tried.base.numbers[claim.name]),
        )
        for claim in subject.parsed
    ]
    events = {claim.name: nearest_event(claim, runs) for claim in subject.parsed}
    return DoubtReport(scenario, answers(verdicts, tried, events), tried), interrupted


def judging(subject: Subject, runs: Mapping[str, PastRun]) -> Judge:
    """A function that judges the claims in a world; `runs` are those of the scenario as it is."""

    def judge(world: World) -> Judged:
        """Answers and numbers of all claims where the world's values are put in.

        Laws that the world does not touch keep their runs.
        """
        labels = dict.fromkeys(label for label, _ in world)
        try:
            moved = {label: _change_scenario(subject, label, world) for label in labels}
            made = {
                label: _simulate_in_memory(label, Case.of(new), subject.parsed)
                for label, new in moved.items()
            }
        # A world without a run is a failed one, and the search goes on with the others.
        except PodusvError as error:
            return Judged({}, {}, str(error))
        every, scenarios = {**runs, **made}, {**subject.singles, **moved}
        # What cannot be computed is noted nowhere: a claim about it has no answer, which says it.
        measured = with_margins([*every.values()], scenarios, subject.parsed, Extras())
        metrics = metrics_of(measured)
        verdicts = claims.judge(subject.parsed, {e.label: e for e in measured}, metrics)
        return Judged({v.name: v.answer for v in verdicts}, {v.name: v.numbers for v in verdicts})

    return judge


def _change_scenario(subject: Subject, label: str, world: World) -> Scenario:
    """The scenario of the law `label` in a world: another hull first, then single values over it.

    Raises ValueRefused where the scenario cannot take a value.
    """
    new = {at: value for (law, at), value in world.items() if law == label}
    hull = new.pop(HULL, None)
    single = (subject.hulls[hull] if hull else subject.singles)[label]
    return with_values(single, new)


def _simulate_in_memory(label: str, case: Case, parsed: Sequence[ParsedClaim]) -> PastRun:
    """A run in memory with all metrics that `parsed` claims may name; `label` names it."""
    recording = to_end(case.plan, compiled=case.scenario.simulation.compiled)
    whole, _ = add_derived(case, recording)
    numbers = summary(case, recording, Extras())
    if len(recording["time"]) and any(law_operations.name in c.claim.expect for c in parsed):
        numbers |= operations(case.plan, recording)
    return PastRun(label, case.about, whole, numbers, plugins=case.scenario.plugged)
