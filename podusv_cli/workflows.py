"""What the commands do, as short pipelines: scenario in, finished folder out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from podusv_cli import __version__
from podusv_cli.config.loading import Loaded, load, resolved_yaml
from podusv_cli.config.scenario import Scenario
from podusv_cli.engine.simulate import marcher, simulate
from podusv_cli.logbook import folder, hdf5, provenance
from podusv_cli.metrics.cost import law_cost
from podusv_cli.metrics.table import METRICS
from podusv_cli.metrics.watching import observer, summarise
from podusv_cli.recording import Recording

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Request:
    """What a user asks `podusv run` for."""

    config: Path
    overrides: Sequence[str] = ()
    out: Path | None = None
    force: bool = False
    figures: bool = True
    argv: Sequence[str] = ()


@dataclass(frozen=True)
class Finished:
    """A run that is over: where it lies, how it ended, its numbers."""

    folder: Path
    recording: Recording
    metrics: dict[str, float]
    timing: dict[str, float]


@dataclass
class Stopwatch:
    """Seconds spent in each part of a pipeline."""

    seconds: dict[str, float] = field(default_factory=dict)
    began: float = field(default_factory=time.perf_counter)

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Add what happens inside to `<name>_s`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            key = f"{name}_s"
            self.seconds[key] = self.seconds.get(key, 0.0) + time.perf_counter() - start

    def total(self) -> dict[str, float]:
        """All parts and the time since the start."""
        return self.seconds | {"total_s": time.perf_counter() - self.began}


def run(request: Request, progress: Progress | None = None) -> Finished:
    """Load, simulate, measure, write, draw.

    A run that diverges or is interrupted is written like any other; its status tells. Raises
    ScenarioError and StorageError.
    """
    started, watch = datetime.now(UTC), Stopwatch()
    with watch.part("load"):
        loaded = load(request.config, request.overrides)
        resolved = resolved_yaml(loaded.scenario)
    name = loaded.scenario.name
    target = request.out or folder.default_folder(Path("results"), name, resolved)
    with folder.RunWriter(target, force=request.force) as writer:
        recording, metrics = measured(loaded.scenario, watch, progress)
        with watch.part("write"):
            _write(writer, loaded, resolved, recording, metrics)
        with watch.part("figures"):
            if request.figures:
                _draw(writer, loaded.scenario, recording)
        with watch.part("write"):
            origin = provenance.collect(list(request.argv), started, datetime.now(UTC))
            writer.add_json("provenance.json", origin)
            final = writer.finish(recording.status)
    return Finished(final, recording, metrics, watch.total())


def measured(
    scenario: Scenario, watch: Stopwatch, progress: Progress | None = None
) -> tuple[Recording, dict[str, float]]:
    """Simulate a scenario and sum it up in metrics."""
    loop, grid = scenario.closed_loop(), scenario.time_grid()
    compiled, settings = scenario.simulation.compiled, scenario.metrics
    seeing = observer(
        loop,
        grid,
        steady_fraction=settings.steady_fraction,
        settling_radius=settings.settling_radius,
    )
    with watch.part("compile"):
        marcher(loop, seeing, compiled)
    with watch.part("engine"):
        recording = simulate(loop, grid, observer=seeing, compiled=compiled, progress=progress)
    with watch.part("metrics"):
        metrics = summarise(recording.seen, grid.step) if recording.seen is not None else {}
        cost = law_cost(loop, recording) if compiled and len(recording["time"]) else {}
    return recording, metrics | cost


def _write(
    writer: folder.RunWriter, loaded: Loaded, resolved: str, recording: Recording,
    metrics: dict[str, float],
) -> None:  # fmt: skip
    scenario = loaded.scenario
    log = hdf5.encode(
        recording, resolved_yaml=resolved, title=scenario.description or scenario.name,
        source=scenario.vessel.source, version=__version__,
    )  # fmt: skip
    writer.add("scenario.yaml", loaded.text.encode())
    writer.add("resolved.yaml", resolved.encode())
    writer.add("log.h5", log)
    status = {"status": recording.status, "controller": recording.controller}
    writer.add_json("metrics.json", {**status, "metrics": metrics})
    rows = [f"{name},{metrics[name]!r},{METRICS[name].unit}" for name in METRICS if name in metrics]
    writer.add("metrics.csv", "\n".join(["metric,value,unit", *rows, ""]).encode())


def _draw(writer: folder.RunWriter, scenario: Scenario, recording: Recording) -> None:
    from podusv_cli.figures.drawing import FIGURES, draw, dressed  # matplotlib is slow to import

    if len(recording["time"]) < 2:
        return
    vessel = scenario.vessel
    shown = dressed(
        [(recording.controller, recording)], length=vessel.length, beam=vessel.beam,
        steady_fraction=scenario.metrics.steady_fraction,
    )  # fmt: skip
    for name, content in draw(shown, FIGURES, ("png",)):
        writer.add(f"figures/{name}", content)


def as_json(done: Finished) -> dict[str, Any]:
    """What `--json` prints of a run."""
    return {
        "format": 1,
        "status": done.recording.status,
        "run": str(done.folder),
        "controller": done.recording.controller,
        "metrics": done.metrics,
        "timing": done.timing,
    }
