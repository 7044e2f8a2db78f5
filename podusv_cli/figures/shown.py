"""Runs as figures and animations show them: name, colour, line style, marker, signals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.core import derived_signals as derived
from podusv_cli.core import escaping, quantities
from podusv_cli.core.about import RunAbout
from podusv_cli.core.escaping import visible
from podusv_cli.core.kernel import Vector
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.figures.looks import nth_style

MARKS = 24  # on the curves of a panel together
FEWEST, MOST = 3, 8  # on a curve
ALONE = 9  # places of a run that is shown alone, both ends among them


class RunLook(NamedTuple):
    """Colour, line style and marker of a run's curves.

    `places` are fractions of a curve, in time, where its markers stand.
    """

    color: str
    linestyle: Any
    marker: str
    places: Vector


@dataclass(frozen=True, eq=False)
class Shown:
    """A run with the look under which every figure shows it.

    `peaks` are those of signals that a claim about the runs names.
    """

    run: PastRun
    look: RunLook
    peaks: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def label(self) -> str:
        """The run's, without characters that do not show."""
        return visible(self.run.label)

    @property
    def recording(self) -> Recording:
        """The run's log."""
        return self.run.recording

    @property
    def about(self) -> RunAbout:
        """What the run says about itself."""
        return self.run.about

    @property
    def color(self) -> str:
        """Of its curves."""
        return self.look.color

    @property
    def linestyle(self) -> Any:
        """Of its curves, as `Axes.plot` takes it."""
        return self.look.linestyle

    @property
    def marker(self) -> str:
        """On its curves; empty for a run that is shown alone."""
        return self.look.marker

    @property
    def name(self) -> str:
        """The label as every text of a figure has to have it."""
        return escaping.figure(self.label)

    @property
    def length(self) -> float:
        """Of the vessel [m]."""
        return self.about.length

    @property
    def start(self) -> float:
        """Time of the first row [s]."""
        return float(self.recording["time"][0])

    @property
    def end(self) -> float:
        """Time of the last row [s]."""
        return float(self.recording["time"][-1])

    @cached_property
    def counts_to(self) -> float:
        """Up to when metrics count [s]: the end of a path that has one, else the last row."""
        row = self.recording.row_at(self.about.path_end)
        return self.end if row is None else float(self.recording["time"][row])

    @cached_property
    def steady_from(self) -> float:
        """Start of the part that counts as settled [s], which ends with `counts_to`."""
        row = self.recording.row_at(self.about.path_steady)
        return self.about.steady_from if row is None else float(self.recording["time"][row])

    @property
    def line_style(self) -> dict[str, Any]:
        """Keyword arguments of `Axes.plot`; a legend says how a run ended that did not finish."""
        ending = "" if self.whole else f" ({self.recording.status} at {self.end:g} s)"
        return {"color": self.color, "linestyle": self.linestyle, "label": self.name + ending}

    @property
    def whole(self) -> bool:
        """Whether the run reached its end."""
        return self.run.finished

    def has(self, name: str) -> bool:
        """Whether the run has the signal, logged or derivable."""
        return self.run.has(name)

    @property
    def signals(self) -> list[str]:
        """The signals over time that the run has, logged and derivable."""
        known = derived.derived_with(self.run.plugins)
        derivable = [name for name in known if self.has(name)]
        return [*dict.fromkeys([*self.recording.signals, *derivable])]

    def signal(self, name: str) -> Vector:
        """A logged or derived signal."""
        return self.run.signal(name)

    def during(self, name: str, span: tuple[float, float] | None) -> tuple[Vector, Vector]:
        """Time [s] and a signal, each (rows,), all of it or that during `span` [s]."""
        t, y = self.recording["time"], self.signal(name)
        first, last = span or (t[0], t[-1])
        inside = slice(np.searchsorted(t, first), np.searchsorted(t, last, side="right"))
        return t[inside], y[inside]

    def row(self, t: float) -> int:
        """The first row that is not before a time [s], else the last row."""
        return min(int(np.searchsorted(self.recording["time"], t)), len(self.recording["time"]) - 1)

    def at(self, t: float, name: str) -> float:
        """A signal in the row of a time [s]."""
        return float(self.signal(name)[self.row(t)])


def about(runs: Sequence[Shown], name: str) -> Signal:
    """What a signal is, by the first of the runs that have it, else as podusv derives it."""
    having = [run for run in runs if run.has(name)]
    if not having:
        return derived.derived_with(())[name].signal
    return derived.about(having[0].recording, name, having[0].run.plugins)


def axis_label(runs: Sequence[Shown], name: str) -> str:
    """Symbol and unit of a signal as an axis shows them."""
    return label(about(runs, name))


def constants(runs: Sequence[Shown], names: Iterable[str]) -> dict[str, str]:
    """The signals that no run changes, each with its value in words; none where all are such.

    A figure of constants alone would have no panel.
    """
    held: dict[str, str] = {}
    names = [name for name in names if any(run.has(name) for run in runs)]
    for name in names:
        values = {run.name: run.signal(name) for run in runs if run.has(name)}
        if all(np.ptp(value) == 0.0 for value in values.values()):
            levels = {label: f"{value.flat[0]:.4g}" for label, value in values.items()}
            levels_in_words = ", ".join(f"{level} ({label})" for label, level in levels.items())
            # One value for all runs, or each run's own.
            level = levels_in_words if len({*levels.values()}) > 1 else next(iter(levels.values()))
            held[name] = f"${about(runs, name).symbol}$ = {level} {unit(about(runs, name))}"
    return held if len(held) < len(names) else {}


def label(signal: Signal) -> str:
    """Symbol and unit of a signal."""
    return f"${signal.symbol}$ [{unit(signal)}]"


def unit(signal: Signal) -> str:
    """Unit of a signal with its powers raised."""
    return quantities.raise_powers(signal.unit)


def shorten(text: str, most: int) -> str:
    """A text, or as much of it as so many letters and three dots are."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def places(place: int, count: int) -> Vector:
    """Fractions of a curve (marks,) where the run in this place of `count` has its markers.

    Those of one run stand midway between those of others, so that equal curves show all of them.
    """
    if count == 1:
        return np.linspace(0.0, 1.0, ALONE)
    marks = min(max(MARKS // count, FEWEST), MOST)
    return np.asarray((np.arange(marks) + (place + 0.5) / count) / marks)


def dress_runs(runs: Sequence[PastRun], peaks: Mapping[str, float] | None = None) -> list[Shown]:
    """Runs with their looks, in order; without those too short to draw.

    A run alone has no markers. `peaks` are those of signals as claims about the runs name them.
    """
    count = len(runs)
    looks = [RunLook(*nth_style(i), places(i, count)) for i in range(count)]
    if count == 1:
        looks = [look._replace(marker="") for look in looks]
    return [
        Shown(run, look, peaks or {})
        for run, look in zip(runs, looks, strict=True)
        if len(run.recording["time"]) > 1
    ]
