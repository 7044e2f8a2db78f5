"""Which figures there are, and drawing them into files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from podusv_cli.core.escaping import visible
from podusv_cli.core.recording import Recording
from podusv_cli.figures.controls import controls
from podusv_cli.figures.filters import filters
from podusv_cli.figures.loads import loads
from podusv_cli.figures.panels import Family, signals_over_time
from podusv_cli.figures.pods import pods
from podusv_cli.figures.stability import stability
from podusv_cli.figures.style import Shown, house_style, image, look
from podusv_cli.figures.trajectory import trajectory
from podusv_cli.figures.validity import validity
from podusv_cli.process.extras import Extras, Missing
from podusv_cli.process.interrupts import interrupts_heard
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.model import Scenario


@dataclass(frozen=True)
class Sheet:
    """A figure that podusv can draw: what it shows, in signals and in words."""

    caption: str
    signals: tuple[str, ...]
    family: Family

    def fits(self, runs: Sequence[Shown]) -> bool:
        """Whether any run has anything to show here."""
        return any(run.has(name) for run in runs for name in self.signals)


def _grid(
    caption: str, *signals: str, logarithmic: tuple[str, ...] = (), compressed: bool = False
) -> Sheet:
    family = signals_over_time(*signals, logarithmic=logarithmic, compressed=compressed)
    return Sheet(caption, signals, family)


PEAKS = "; where peaks dwarf the settled values the axis is logarithmic beyond these"
FIGURES: dict[str, Sheet] = {
    "trajectory": Sheet(
        "tracks and target on a map; aside, the end of the run close up, framed on the map",
        ("x", "y"),
        trajectory,
    ),
    "errors": _grid(
        "tracking errors (18) over time, the distance on a logarithmic axis",
        "x_e", "y_e", "z_e", "psi_e", logarithmic=("z_e",),
    ),
    "controls": Sheet(
        "surge force and yaw moment on the hull, thin what the law asked for: the first moments, "
        "the whole run, the settled part" + PEAKS,
        ("tau_u", "tau_r"),
        controls,
    ),
    "filters": Sheet(
        "virtual controls (21), (30), thin, with what the filter makes of them (22), (31), and the "
        "filter's error y = beta - alpha" + PEAKS,
        ("alpha_u", "alpha_r"),
        filters,
    ),
    "adaptation": _grid(
        "norms of the network weights, estimated bounds, network outputs, largest node output"
        + PEAKS,
        "W_norm_u", "W_norm_r", "b_hat_u", "b_hat_r", "f_hat_u", "f_hat_r", "activation",
        compressed=True,
    ),
    "velocities": _grid("velocities and heading" + PEAKS, "u", "v", "r", "psi", compressed=True),
    "loads": Sheet(
        "disturbance, and when the actuator limits the law", ("b_u", "b_v", "b_r", "saturated"),
        loads,
    ),
    "stability": Sheet(
        "Lyapunov function (46) with its ultimate bound, its rate with what it should stay below "
        "(49), and its terms, stacked, as parts of it; of a single run V itself is stacked, too",
        ("V",),
        stability,
    ),
    "validity": Sheet(
        "distance to the nearest network centre in widths, largest node output, filter errors, "
        "and the sway speed with its bound (51)",
        ("V",),
        validity,
    ),
    "pods": Sheet(
        "propeller speeds, propulsion angles and power of every pod, thin what was asked for",
        ("n", "delta", "power"), pods,
    ),
}  # fmt: skip


def dressed(runs: Sequence[tuple[str, Recording, Scenario]]) -> list[Shown]:
    """Labelled recordings with their looks, in order; without those too short to draw."""
    return [
        Shown(visible(label), recording, scenario, *look(i))
        for i, (label, recording, scenario) in enumerate(runs)
        if len(recording["time"]) > 1
    ]


def draw(
    runs: Sequence[Shown], names: Iterable[str], formats: Sequence[str], columns: int = 2
) -> Iterator[tuple[str, bytes]]:
    """File name and content of each figure that fits the runs, in each format."""
    with house_style(), np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers near the end of all, as diverged runs have
        for name in (name for name in names if FIGURES[name].fits(runs)):
            figure = FIGURES[name].family(runs, columns)
            for form in formats:
                yield f"{name}.{form}", image(figure, form)


def draw_in_parallel(
    runs: Sequence[Shown], names: Iterable[str], formats: Sequence[str], extras: Extras,
    columns: int = 2, progress: Callable[[float], None] | None = None,
) -> dict[str, bytes]:  # fmt: skip
    """The same as `draw`, each of several figures in a process of its own.

    A figure that fails is missing among the `extras`. `progress` is called with the fraction of
    figures that are over. Raises KeyboardInterrupt where several were interrupted.
    """
    names, done = tuple(names), set[int]()

    def drawn(name: str) -> dict[str, bytes]:
        return dict(draw(runs, [name], formats, columns))

    def job(name: str, tell: Callable[[float], None]) -> tuple[dict[str, bytes], list[Missing]]:
        own = Extras()
        with interrupts_heard():
            files = own.made(f"figure {name}", partial(drawn, name))
        tell(1.0)
        return files or {}, own.missing

    def tell(position: int, _: float) -> None:
        done.add(position)
        if progress:
            progress(len(done) / len(names))

    if len(names) == 1:
        return extras.attempt(f"figure {names[0]}", partial(drawn, names[0])) or {}
    outcomes = run_all([partial(job, name) for name in names], tell)
    if any(outcome.cut for outcome in outcomes):
        raise KeyboardInterrupt
    found: dict[str, bytes] = {}
    for name, outcome in zip(names, outcomes, strict=True):
        files, missing = outcome.result or ({}, [Missing(f"figure {name}", outcome.failure)])
        found |= files
        extras.missing += missing
    return found
