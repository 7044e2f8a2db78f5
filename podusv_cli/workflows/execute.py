"""One scenario simulated, measured, written and drawn into one finished folder."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli import __version__
from podusv_cli.core import earth
from podusv_cli.core.about import MetricAbout, RunAbout
from podusv_cli.core.errors import StorageError
from podusv_cli.core.finding import Finding
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.recording import Allocate, Recording, Status
from podusv_cli.engine.running.check import check_law
from podusv_cli.engine.running.simulate import ready, run
from podusv_cli.findings.finding import find_before_run, postflight
from podusv_cli.metrics.cost import law_costs
from podusv_cli.metrics.operations import operations
from podusv_cli.metrics.table import headlines_first
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_deferred, interrupts_enabled
from podusv_cli.process.workers import Outcome
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.limits import HELD, estimate
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage import csv_files, files
from podusv_cli.storage import run_folder as folder
from podusv_cli.theory import monitor
from podusv_cli.theory.report import as_json as theory_report

Progress = Callable[[float], None]
UNDRAWN = (
    "interrupted after the simulation; log.h5 is complete, what was still to be made is missing"
)


@dataclass
class Stopwatch:
    """Seconds spent in each part of a pipeline."""

    seconds: dict[str, float] = field(default_factory=dict)
    began: float = field(default_factory=time.perf_counter)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Add the time [s] that passes inside to `<name>_s`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            key = f"{name}_s"
            self.seconds[key] = self.seconds.get(key, 0.0) + time.perf_counter() - start

    def total(self) -> dict[str, float]:
        """All parts and the time since the start."""
        return self.seconds | {"total_s": time.perf_counter() - self.began}


@dataclass(frozen=True)
class RunTask:
    """A scenario, its file's text, where its run folder goes, how it is called and drawn.

    `named`: the user asked for this folder. `noticed` is what was found before the run. A log of
    more than `held` bytes is not held in memory.
    """

    scenario: Scenario
    text: str
    target: Path
    force: bool = False
    named: bool = True
    figures: bool = False
    names: Sequence[str] = ()  # of figures, as `figures.drawing.choose_sheets` has them
    argv: Sequence[str] = ()
    label: str = ""  # in figures; the law's kind by default
    noticed: Sequence[Finding] = ()
    held: int = HELD
    compiling: Progress | None = None  # is called where there is code to compile


@dataclass(frozen=True)
class Finished:
    """A run that is over: where it lies, how it ended, its numbers."""

    folder: Path
    controller: str
    status: Status
    message: str
    metrics: dict[str, float]
    timing: dict[str, float]
    warnings: tuple[Finding, ...] = ()
    missing: tuple[Failure, ...] = ()
    rows: Mapping[str, MetricAbout] = field(default_factory=dict)  # headlines before the others

    def as_json(self) -> dict[str, Any]:
        """What `--json` prints of a run."""
        return {
            "format": 1,
            "status": self.status,
            "run": str(self.folder),
            "controller": self.controller,
            "metrics": self.metrics,
            "timing": self.timing,
            "warnings": [finding.as_json() for finding in self.warnings],
            "missing": [str(part) for part in self.missing],
        }


def execute(
    task: RunTask,
    progress: Progress | None = None,
    watch: Stopwatch | None = None,
    case: Case | None = None,
) -> Finished:
    """Simulate, measure, write and draw a run.

    The folder `target` appears only when all is written. `case` is the task's scenario with its
    plan, where it was looked at before; `watch` adds up the time of each part. A run that diverges
    or is interrupted is written like any other; its status says so. An interrupt after the
    simulation costs the figures or the law's cost, nothing else. What fails after the simulation is
    left out, and missing.json says why. Raises StorageError.
    """
    watch, case = watch or Stopwatch(), case or Case.of(task.scenario)
    size = estimate(case.scenario, case.plan)
    with (
        interrupts_deferred(),
        folder.RunWriter(
            task.target,
            force=task.force,
            named=task.named,
            needed=size.bytes_needed,
            argv=task.argv,
        ) as writer,
    ):
        long = size.content > task.held and not task.scenario.log.compress
        # A long log that is not compressed lies on the disk from the start, not in memory.
        allocate = partial(files.disk_array, writer.folder) if long else np.empty
        recording = simulate_case(case, watch, progress, allocate, task.compiling)
        extras = writer.extras
        extras.interrupted = recording.status == "interrupted"
        with watch.part("metrics"):
            gather = partial(summary, case, recording, extras)
            metrics = extras.make_or_record("the metrics", gather) or {}
            metrics |= extras.attempt("the law's cost", lambda: _cost(case, recording)) or {}
        with watch.part("theory"):
            whole, theory = extras.make_or_record(
                "theory.json with the signals that follow from others",
                lambda: add_derived(case, recording, allocate),
            ) or (recording, {})
        with watch.part("write"):
            whole = _write_log(writer, case, whole, again=long)
        with watch.part("metrics"):
            # After the log is written: findings then read its signals one by one, see `_write_log`.
            noticed = extras.make_or_record("warnings", lambda: postflight(task.scenario, whole))
        warnings = *task.noticed, *(noticed or ())
        with watch.part("write"):
            _write(writer, task, whole, metrics, warnings)
            about = extras.make_or_record(
                f"{folder.ABOUT}, which figures need,", lambda: case.about
            )
            if about:
                facts = about.model_dump(exclude_defaults=True)
                writer.add_json(folder.ABOUT, {"format": 1, **facts})
            if theory:
                writer.add_json("theory.json", theory)
        with watch.part("figures"):
            figures = (
                extras.attempt("figures", lambda: _draw_figures(task, whole, about, extras)) or {}
            )
            for name, content in figures.items():
                writer.add(f"figures/{name}", content)
        status = "interrupted" if extras.interrupted else recording.status
        with watch.part("write"):
            writer.add_origin(task.scenario.plugged)
            final = writer.finish(status)
    message = recording.message or ("" if status == "finished" else UNDRAWN)
    return Finished(
        final,
        recording.controller,
        status,
        message,
        metrics,
        watch.total(),
        warnings=warnings,
        missing=tuple(extras.missing),
        rows={m.name: m.about for m in headlines_first(task.scenario.known_metrics())},
    )


def why_unwritten(outcomes: Iterable[Outcome]) -> str:
    """Why a run could not be written, "" where none failed for that.

    A result without such a run must not replace an older one. Raises StorageError where there is no
    run at all.
    """
    outcomes = tuple(outcomes)
    causes = [o.failure for o in outcomes if o.code == StorageError.exit_code]
    if causes and not any(outcome.result for outcome in outcomes):
        raise StorageError(causes[0])
    return next(iter(causes), "")


def warm_up(case: Case, compiling: Progress | None = None) -> None:
    """Make every check of a run before its first step, and have all its code compiled and loaded.

    `compiling` is called with the fraction that is compiled, if there is anything to compile.
    Raises LawError.
    """
    compiled = case.scenario.simulation.compiled
    ready(case.plan, compiled, compiling)
    if case.scenario.log.monitor:
        monitor.prepare(case.plan, compiled)


def examine(case: Case) -> list[Finding]:
    """The findings about a scenario before its run; figures' names and the law are checked first.

    Raises LawError.
    """
    check_figures(case.scenario)
    check_law(case.plan)
    return find_before_run(case)


def simulate_case(
    case: Case,
    watch: Stopwatch,
    progress: Progress | None = None,
    allocate: Allocate = np.empty,
    compiling: Progress | None = None,
) -> Recording:
    """Simulate a scenario with the probe of its metrics; `watch` adds up compiling and simulating.

    `progress` and `compiling` are called with the fraction done. `allocate` makes the log's arrays,
    as `simulate` says.
    """
    with watch.part("compile"), interrupts_enabled():
        warm_up(case, compiling)
    compiled = case.scenario.simulation.compiled
    with watch.part("engine"):
        return run(case.plan, compiled=compiled, progress=progress, allocate=allocate)


def check_figures(scenario: Scenario) -> None:
    """Raise LawError where a plug-in's figure has the name of another.

    This is asked before anything is simulated.
    """
    if scenario.plugged:
        from podusv_cli.figures.drawing import figures_with  # matplotlib is slow to import

        figures_with(scenario.plugged)


def summary(case: Case, recording: Recording, extras: Extras) -> dict[str, float]:
    """The metrics of a run by name: those that its probe gathered, and those computed from the log.

    One that raises is noted in `extras`.
    """
    seen, counted = recording.seen, recording.up_to(case.plan.loop.passed_by(1.0))
    numbers = case.plan.probe.summary(seen, extras.note) if seen is not None else {}
    for name, metric in case.scenario.known_metrics().items():
        if metric.of_log and len(recording["time"]):
            try:
                numbers[name] = float(metric.of_log(counted))
            except Exception as error:  # a plug-in's function may raise anything
                extras.note(f"metric {name}", error)
    return numbers


def _cost(case: Case, recording: Recording) -> dict[str, float]:
    """Measured and counted cost of the law, by metric; {} for a run without an instant."""
    if not len(recording["time"]):
        return {}
    timed = law_costs([(case.plan, recording)])[0] if case.scenario.simulation.compiled else {}
    return timed | operations(case.plan, recording)


def add_derived(
    case: Case, recording: Recording, allocate: Allocate = np.empty
) -> tuple[Recording, dict[str, Any]]:
    """The recording with places on earth and the stability monitor's signals, and its theory.json.

    No places without an origin; nothing of the monitor ({}) without V. `allocate` makes arrays.
    """
    plan, scenario = case.plan, case.scenario
    monitored_run = scenario.log.monitor and monitor.monitor_recording(
        plan,
        recording,
        steady_fraction=scenario.metrics.steady_fraction,
        compiled=scenario.simulation.compiled,
        allocate=allocate,
    )
    whole = monitored_run.recording if monitored_run else recording
    placed = earth.add_places(whole, scenario.plane, allocate) if scenario.plane else whole
    if not monitored_run:
        return placed, {}
    return placed, theory_report(plan.loop, plan.grid, monitored_run)


def _write_log(
    writer: folder.RunWriter, case: Case, recording: Recording, *, again: bool
) -> Recording:
    """Write log and scenario, and return the recording.

    If `again`, its signals are as read from the log, where each is in one piece. The march leaves
    them row by row, so that reading one signal of a long log would read all others from the disk,
    too.
    """
    from podusv_cli.storage import log, log_reader  # h5py is slow to import

    path, scenario = writer.folder / folder.LOG, case.scenario
    title = scenario.description or scenario.name
    texts = log.Texts(case.resolved_yaml, title, scenario.vessel.source, __version__)
    log.write(path, recording, texts, compress=scenario.log.compress)
    writer.add(folder.RESOLVED, case.resolved_yaml.encode())
    signals = log_reader.read_log(path, math.inf).signals if again else recording.signals
    return replace(recording, signals=signals)


def _write(
    writer: folder.RunWriter,
    task: RunTask,
    recording: Recording,
    metrics: dict[str, float],
    warnings: Sequence[Finding],
) -> None:
    """Put scenario, plug-ins, metrics and findings into the run's folder."""
    writer.add("scenario.yaml", task.text.encode())
    for name, text in task.scenario.plugin_files().items():
        writer.add(name, text.encode())
    status = {"status": recording.status, "controller": recording.controller}
    findings = [finding.as_json() for finding in warnings]
    writer.add_json("metrics.json", {**status, "metrics": metrics, "warnings": findings})
    known = task.scenario.known_metrics()
    rows = [(name, metrics[name], m.unit) for name, m in known.items() if name in metrics]
    writer.add("metrics.csv", csv_files.lines([("metric", "value", "unit"), *rows]).encode())


def _draw_figures(
    task: RunTask, recording: Recording, about: RunAbout | None, extras: Extras
) -> dict[str, bytes]:
    """PNG files of the wanted figures by name; `extras` notes those that fail."""
    if not (task.figures and about):
        return {}
    from podusv_cli.figures.drawing import (  # matplotlib is slow to import
        choose_sheets,
        draw_in_parallel,
    )
    from podusv_cli.figures.shown import dress_runs

    label = task.label or recording.controller
    shown = dress_runs([PastRun(label, about, recording, plugins=task.scenario.plugged)])
    return draw_in_parallel(shown, choose_sheets(task.names, shown, extras), ("png",), extras)
