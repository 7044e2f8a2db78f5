"""`podusv run`: one scenario in, one finished run folder out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

from podusv_cli.core.component import BY_RULE
from podusv_cli.core.errors import UsageError
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.plugins import Plugins
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.scenario.address import content
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import Check, Loaded, load
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.plugins import of_files
from podusv_cli.scenario.yaml_tree import dotted_key
from podusv_cli.storage.run_folder import RunWriter, default_folder
from podusv_cli.workflows.execute import Finished, Progress, RunTask, Stopwatch, examine, execute
from podusv_cli.workflows.request import Request

RESULTS = Path("results")


def run(config: Path, request: Request, progress: Progress | None = None) -> Finished:
    """Load a scenario and execute it. Raises ScenarioError and StorageError."""
    watch = Stopwatch()
    with watch.part("load"):
        checks = (unknown_codes, limits(request.allow_large))
        loaded = open_scenario(config, request, checks)
    return run_loaded(loaded, request, progress, watch)


def open_scenario(config: Path, request: Request, checks: Sequence[Check]) -> Loaded:
    """The scenario of a file; warns of values that it loses. Raises ScenarioError."""
    loaded = load(config, request.overrides, checks, request.plugins, of_files(request.trust))
    return loaded.warn_of_remarks(request.warn)


def writer_of(request: Request, target: Path, needed: float = 0.0) -> RunWriter:
    """What writes the folder that a request asks for."""
    return RunWriter(
        target, force=request.force, named=request.out is not None, needed=needed, argv=request.argv
    )


def run_loaded(
    loaded: Loaded,
    request: Request,
    progress: Progress | None = None,
    watch: Stopwatch | None = None,
) -> Finished:
    """Execute a scenario that is loaded and checked. Raises UsageError, LawError, StorageError."""
    watch = watch or Stopwatch()
    with watch.part("load"):
        scenario = single(loaded, request.controller)
        check_asked(request, [scenario.plugged])
        case = loaded.case(scenario)
        target = request.out or default_folder(RESULTS, scenario.name, case.resolved_yaml)
    with watch.part("preflight"):
        noticed = examine(case)
    for line in _choices(scenario, others(loaded, request.controller)):
        request.say(line)
    if claims := loaded.scenario.claims:
        each = "claim is" if len(claims) == 1 else "claims are"
        request.say(f"{len(claims)} {each} not judged by one run; `podusv compare` judges them")
    for finding in noticed:
        request.warn(finding)
    task = RunTask(
        scenario,
        loaded.text,
        target,
        force=request.force,
        named=request.out is not None,
        figures=request.figures,
        names=request.names,
        argv=request.argv,
        noticed=noticed,
        compiling=request.compiling,
    )
    return execute(task, progress, watch, case)


def _choices(scenario: Scenario, others: Sequence[str]) -> Iterator[str]:
    """Sentences on what nobody chose: the law of several, and the numbers by rule.

    `others` are the laws that do not run.
    """
    if others:
        only = f"runs `controller` ({scenario.controller.label}) only"
        yield f"{only}; `podusv compare` runs {', '.join(others)}"
    for section, keys in groupby(scenario.keys_by_rule(), lambda at: at[:-1]):
        numbers = (f"{at[-1]} {content(scenario, at):.4g}" for at in keys)
        yield f"{dotted_key(section)}: defaults {BY_RULE}: {', '.join(numbers)}"


def check_asked(request: Request, plugins: Iterable[Plugins]) -> None:
    """Raise UsageError for unknown figures and formats, and for figures that are unwanted."""
    if request.names and not request.figures:
        raise UsageError(f"--figure {request.names[0]} and --no-figures contradict each other")
    if request.names or set(request.formats) != {"png"}:
        from podusv_cli.figures.drawing import (  # matplotlib is slow to import
            check_names,
            figures_of,
        )

        check_names(request.names, request.formats, figures_of(plugins))


def others(loaded: Loaded, label: str = "") -> tuple[str, ...]:
    """The `controllers` that do not run where nobody chose a law by `label`.

    Empty if there is no choice.
    """
    several = loaded.scenario.controllers  # one may be the `controller` under a name
    alone = label or list(several.values()) == [loaded.scenario.controller]
    return () if alone else tuple(several)


def single(loaded: Loaded, label: str = "") -> Scenario:
    """The scenario of one run: of the law that is chosen from `controllers`, or of `controller`.

    Raises UsageError for an unknown law, and where `controllers` leaves the choice open.
    """
    known = loaded.scenario.controllers
    if label and label not in known:
        raise UsageError(unknown_word(f"controller {label!r}", label, known))
    if loaded.scenario.open_choice and not label:
        raise UsageError(
            f"{loaded.scenario.name} has several controllers; choose one with --controller "
            f"({', '.join(known)}), or compare all: podusv compare"
        )
    return loaded.scenario.singles()[label] if label else loaded.scenario.alone()
