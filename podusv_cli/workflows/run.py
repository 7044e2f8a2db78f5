"""`podusv run`: one scenario in, one finished run folder out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from podusv_cli.core.finding import Finding
from podusv_cli.findings.finding import not_silenced, unknown_codes
from podusv_cli.findings.preflight import preflight
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import Loaded, load, resolved_yaml
from podusv_cli.storage.run_folder import default_folder
from podusv_cli.workflows.execute import Finished, Progress, Stopwatch, Task, execute

RESULTS = Path("results")
DRAWN = ("controls", "trajectory", "errors")  # the one that takes longest first


@dataclass(frozen=True)
class Request:
    """The options that `run` and `compare` share; see `podusv run --help`."""

    overrides: Sequence[str] = ()
    out: Path | None = None
    force: bool = False
    figures: bool = True
    argv: Sequence[str] = ()
    warn: Callable[[Finding], None] = lambda finding: None  # called before any simulation
    allow_large: bool = False
    plugins: Sequence[str] = ()  # files beside those that a scenario names
    names: Sequence[str] = ()  # of figures of a comparison; all that fit where empty
    formats: Sequence[str] = ("png",)  # of figures of a comparison
    jobs: int = 0  # processes at a time; 0: one a core


def run(config: Path, request: Request, progress: Progress | None = None) -> Finished:
    """Load a scenario and execute it. Raises ScenarioError and StorageError."""
    watch = Stopwatch()
    with watch.part("load"):
        checks = (unknown_codes, limits(request.allow_large))
        loaded = load(config, request.overrides, checks, request.plugins)
    return run_loaded(loaded, request, progress, watch)


def run_loaded(
    loaded: Loaded, request: Request, progress: Progress | None = None,
    watch: Stopwatch | None = None,
) -> Finished:  # fmt: skip
    """Execute a scenario that is loaded and checked. Raises StorageError."""
    watch = watch or Stopwatch()
    with watch.part("load"):
        scenario = loaded.scenario.alone()
        target = request.out or default_folder(RESULTS, scenario.name, resolved_yaml(scenario))
    with watch.part("preflight"):
        noticed = not_silenced(preflight(scenario), scenario)
    for finding in noticed:
        request.warn(finding)
    task = Task(
        scenario, loaded.text, target, force=request.force, named=request.out is not None,
        figures=DRAWN if request.figures else (), argv=request.argv, noticed=noticed,
    )  # fmt: skip
    return replace(execute(task, progress, watch), others=tuple(loaded.scenario.controllers))
