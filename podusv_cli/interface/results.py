"""Runs and comparisons in Python: log, metrics, figures, and how notebooks show them."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from podusv_cli.core.about import RunAbout
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.recording import Recording
from podusv_cli.interface.border import with_short_traceback
from podusv_cli.metrics.table import metrics_with
from podusv_cli.scenario.load import load_stored
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage.files import read_text
from podusv_cli.storage.run_folder import RESOLVED

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from podusv_cli.figures.sheet import Family
    from podusv_cli.figures.shown import Shown

FRAME = "width: 100%; height: 44em; border: 0"

NO_XARRAY = (
    "run.log is an xarray.Dataset and xarray is not installed: pip install 'podusv[python]'; "
    "run['z_e'] is a numpy array and needs nothing"
)


class Numbers(pd.Series):
    """Metrics by name; a KeyError says which there are."""

    @property
    def _constructor(self) -> type[Numbers]:
        """What pandas makes of a part of them."""
        return Numbers

    def __getitem__(self, name: Any) -> Any:
        """The metric, or a part of the series."""
        try:
            return super().__getitem__(name)
        except KeyError:
            sentence = unknown_word(f"metric {name!r} of this run", str(name), map(str, self.index))
            raise KeyError(sentence) from None


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A run that is over: its log, metrics and figures.

    `status` is "finished", "diverged" or "interrupted", and `message` says why a run did not
    finish. `warnings` are the findings before and after the run. `folder` is None for a run that
    was only simulated. `run["z_e"]` is a signal as a numpy array.
    """

    past: PastRun
    given: Scenario | None = None  # of which it was made here

    def __getstate__(self) -> dict[str, Any]:
        """With the numbers of its log: its folder may be gone, or another run's, where it is read.

        Raises StorageError for a log that cannot be read.
        """
        return {"past": replace(self.past, log=self.past.recording), "given": self.given}

    @property
    def label(self) -> str:
        """What it is called: by its law, or as a comparison calls it."""
        return self.past.label

    @property
    def about(self) -> RunAbout:
        """What it says about itself, as about.json has it."""
        return self.past.about

    @property
    def recording(self) -> Recording:
        """What was recorded, as podusv's own functions take it."""
        return self.past.recording

    @property
    def numbers(self) -> Mapping[str, float]:
        """Every metric by name, as plain numbers."""
        return self.past.metrics

    @property
    def warnings(self) -> tuple[str, ...]:
        """The findings before and after the run, as sentences."""
        return self.past.warnings

    @property
    def folder(self) -> Path | None:
        """Where it lies."""
        return self.past.folder

    @cached_property
    def scenario(self) -> Scenario:
        """What was simulated; that of a folder is read when it is asked for.

        Raises ScenarioError where a folder's has components of a file that it keeps, which only
        `podusv.load` of its resolved.yaml executes.
        """
        if self.given is not None:
            return self.given
        assert self.folder is not None  # what is in memory has its scenario
        path = self.folder / RESOLVED
        return load_stored(read_text(path), str(path)).scenario

    @property
    def status(self) -> str:
        """How the run ended."""
        return self.recording.status

    @property
    def message(self) -> str:
        """Why the run did not finish; empty if it did."""
        return self.recording.message

    @property
    def metrics(self) -> pd.Series[float]:
        """Every metric by name; NaN where it is not defined. `podusv explain NAME` has its unit."""
        index = pd.Index(self.numbers, name="metric")
        return Numbers([*self.numbers.values()], index, float, self.label)

    @cached_property
    def log(self) -> xarray.Dataset:
        """Every signal over `time` [s], with units and meaning, as log.h5 has it.

        Raises ImportError where xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise ImportError(NO_XARRAY) from error
        log = self.recording
        arrays = {
            name: (about.dimensions, log[name], {"units": about.unit, "long_name": about.meaning})
            for name, about in log.about.items()
            if name in log
        }
        facts = {"status": self.status, "controller": log.controller, "message": self.message}
        return xarray.Dataset(arrays, attrs=facts).set_coords("time")

    def __getitem__(self, signal: str) -> Vector:
        """A signal that the log has or that follows from it; KeyError names the known ones."""
        if not self.past.has(signal):
            raise KeyError(unknown_word(f"signal {signal!r}", signal, self.recording.signals))
        return self.past.signal(signal)

    @with_short_traceback
    def plot(self, *names: str, columns: int = 2) -> Figure:
        """A matplotlib figure, which notebooks show; `podusv plot --help` describes the files.

        `names` are that of a figure (`"errors"`), or those of signals, each over time
        (`"psi", "tau_u"`); the trajectory without any. `columns` is its width in columns of a
        journal page. Raises UsageError for what podusv does not have or the run did not log.
        """
        return figure({self.label: self}, names, columns)

    @with_short_traceback
    def play(self) -> Animation:
        """The run as an animation with a slider, which notebooks show. Raises UsageError."""
        return animation({self.label: self})

    def __repr__(self) -> str:
        """One line: what ran, how it ended, where it is."""
        end = self.recording["time"][-1] if len(self.recording["time"]) else 0.0
        where = f", {self.folder}" if self.folder else ""
        return f"<podusv run {self.label}: {self.status} at {end:g} s{where}>"

    def _repr_html_(self) -> str:
        """The trajectory beside the metrics, what was warned of above."""
        known = {**metrics_with(self.past.plugins), **self.about.metrics}
        rows = {n: f"{x:.5g} {known[n].unit}" for n, x in self.numbers.items() if n in known}
        table = pd.Series(rows, name=self.label, dtype=str).to_frame().to_html(border=0)
        lines = [repr(self), self.message, *self.warnings]
        return _html(lines, {self.label: self}, table)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Runs side by side.

    `table` has a row a metric and a column a run; `claims` a row for each claim of the scenario;
    `failed` says why a run did not finish. `report` is the HTML page, None where it failed.
    """

    folder: Path
    runs: Mapping[str, Run]
    table: pd.DataFrame
    claims: pd.DataFrame
    failed: Mapping[str, str]

    @property
    def report(self) -> Path | None:
        """The HTML page with table, claims and figures."""
        page = self.folder / "report.html"
        return page if page.exists() else None

    def __getitem__(self, label: str) -> Run:
        """The run of this label; KeyError names the known labels."""
        if label not in self.runs:
            raise KeyError(unknown_word(f"run {label!r}", label, self.runs))
        return self.runs[label]

    @with_short_traceback
    def plot(self, *names: str, columns: int = 2) -> Figure:
        """All runs in one matplotlib figure; as `Run.plot`."""
        return figure(self.runs, names, columns)

    @with_short_traceback
    def play(self) -> Animation:
        """All runs as one animation; as `Run.play`."""
        return animation(self.runs)

    def __repr__(self) -> str:
        """One line: the runs, and where they are."""
        return f"<podusv comparison of {', '.join(self.table.columns)}: {self.folder}>"

    def _repr_html_(self) -> str:
        """All trajectories beside the table."""
        lines = [repr(self), *(f"{label}: {text}" for label, text in self.failed.items())]
        return _html(lines, self.runs, self.table.to_html(border=0, float_format="{:.5g}".format))


@dataclass(frozen=True)
class Animation:
    """A page with the vessels chasing their target: play, pause, a slider, a close-up.

    Notebooks show it; `save` writes it as a file that needs nothing else.
    """

    page: str

    def save(self, file: str | PathLike[str]) -> None:
        """Write the page as an HTML file."""
        Path(file).write_text(self.page, "utf-8")

    def _repr_html_(self) -> str:
        """The page in a frame, whose styles and scripts stay inside."""
        return f'<iframe srcdoc="{escape(self.page)}" style="{FRAME}"></iframe>'


def animation(runs: Mapping[str, Run]) -> Animation:
    """Runs chasing their target. Raises UsageError where no run has two rows."""
    from podusv_cli.figures.chase import page
    from podusv_cli.figures.shown import dress_runs

    shown = dress_runs([replace(run.past, label=label) for label, run in runs.items()])
    if not shown:
        raise UsageError(f"there is nothing to show: {', '.join(map(repr, runs.values()))}")
    return Animation(page(shown))


def figure(runs: Mapping[str, Run], names: Sequence[str], columns: int = 2) -> Figure:
    """One of podusv's figures of several runs, or their signals over time. Raises UsageError."""
    from podusv_cli.figures.shown import dress_runs
    from podusv_cli.figures.style import house_style, image

    shown = dress_runs([replace(run.past, label=label) for label, run in runs.items()])
    family = _family(runs, names or ("trajectory",), shown)
    with house_style():
        drawn = family(shown, columns)
    # A figure without pyplot is shown by notebooks only if it says how.
    vars(drawn)["_repr_png_"] = partial(image, drawn, "png")
    return drawn


def _family(runs: Mapping[str, Run], names: Sequence[str], shown: Sequence[Shown]) -> Family:
    """The function that draws a named figure, or signals over time. Raises UsageError.

    `shown` are the runs with their looks; those without rows are missing there.
    """
    from podusv_cli.figures.drawing import figures_of
    from podusv_cli.figures.panels import signals_over_time

    figures = figures_of(run.past.plugins for run in runs.values())
    if len(names) == 1 and names[0] in figures:
        sheet = figures[names[0]]
        if not shown or not sheet.fits(shown):
            logged = f"{', '.join(runs)} logged none of these"
            raise UsageError(f"figure {names[0]!r} shows {', '.join(sheet.signals)}, and {logged}")
        return sheet.family
    signals = [signal for run in runs.values() for signal in run.recording.signals]
    for name in names:
        if not any(run.has(name) for run in shown):
            known = (*figures, *dict.fromkeys(signals))
            raise UsageError(unknown_word(f"figure or signal {name!r}", name, known, "podusv list"))
    return signals_over_time(*names)


def _html(lines: list[str], runs: Mapping[str, Run], table: str) -> str:
    """Lines of text over a picture of the trajectories, if any, and a table (HTML)."""
    said = "".join(f"<div>{escape(line)}</div>" for line in lines if line)
    drawable = {label: run for label, run in runs.items() if len(run.recording["time"]) > 1}
    picture = _picture(drawable) if drawable else ""
    return f'{said}<div style="display: flex; align-items: center">{picture}{table}</div>'


def _picture(runs: Mapping[str, Run]) -> str:
    """The tracks of runs (by label) as a PNG inside an HTML image."""
    from podusv_cli.figures.style import image

    content: Any = image(figure(runs, ("trajectory",), 1), "png")
    return f'<img src="data:image/png;base64,{base64.b64encode(content).decode()}">'
