"""Tracks of runs and of their targets in the plane, and what a map of them has to hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.figures.looks import TARGET_LOOK
from podusv_cli.figures.shown import Shown

POINTS = 3000  # of a track, at most about

Span = tuple[float, float]


@dataclass(frozen=True)
class Target:
    """A target, the runs that follow it, how it is drawn, and a log that holds its whole track."""

    runs: Sequence[Shown]
    line_style: dict[str, Any]
    recording: Recording

    @property
    def is_ahead(self) -> bool:
        """Whether it is somewhere at a time: neither a path nor out of sight."""
        return self.in_sight and not self.runs[0].about.follows

    @property
    def in_sight(self) -> bool:
        """Whether there is one; a manoeuvring trial and recorded commands have none."""
        return not self.runs[0].about.trial

    def track(self, span: Span = (0.0, np.inf)) -> tuple[Vector, Vector]:
        """East and north (n,) [m] of the target during a time [s].

        That is all legs of a path, and the track of the run in a trial.
        """
        if self.in_sight and not self.is_ahead:
            north, east = np.array(self.runs[0].about.waypoints).T
            return east, north
        rows, names = rows_of(self.recording, span), ("y_d", "x_d") if self.is_ahead else ("y", "x")
        east, north = (self.recording[name][rows] for name in names)
        return east, north


def targets(runs: Sequence[Shown]) -> list[Target]:
    """Every target that differs from the others, as long as any of its runs lasts."""
    groups: list[list[Shown]] = []
    for run in runs:
        path = run.about.values["path"]
        group = next((g for g in groups if g[0].about.values["path"] == path), None)
        if group is None:
            groups.append([run])
        else:
            group.append(run)
    return [_target(group, only=len(groups) == 1) for group in groups]


def _target(group: Sequence[Shown], *, only: bool) -> Target:
    """The target that these runs have in common; `only` if there is no other."""
    longest = max(group, key=lambda run: run.end).recording
    word = "path" if group[0].about.follows else "target"
    if only:
        return Target(group, {**TARGET_LOOK, "label": word}, longest)
    label = f"{word} of {', '.join(run.name for run in group)}"
    style = {**TARGET_LOOK, "linestyle": group[0].linestyle, "label": label}
    return Target(group, style, longest)


def bounds(runs: Sequence[Shown], room: float = 0.0) -> tuple[Span, Span]:
    """Limits (east, north) [m] of a map of the targets and of the runs that finished, if any.

    Where none finished, targets and starts alone. At least `room` [m] is left around them.
    """
    pairs = [target.track() for target in targets(runs)]
    pairs += [(run.recording["y"], run.recording["x"]) for run in runs if run.whole]
    # The start of every run is on the map.
    pairs += [(run.recording["y"][:1], run.recording["x"][:1]) for run in runs]
    corners = ([(part.min(), part.max()) for part in parts] for parts in zip(*pairs, strict=True))
    east, north = (np.ravel(extremes) for extremes in corners)
    # 6 % of the larger extent; targets at one place still get a map of some size.
    margin = max(0.06 * max(float(np.ptp(east)), float(np.ptp(north)), 1.0), room)
    return (
        (float(east.min()) - margin, float(east.max()) + margin),
        (float(north.min()) - margin, float(north.max()) + margin),
    )


def rows_of(log: Recording, span: Span) -> slice:
    """The rows within a time, thinned in steps: by extremes a track would lose its shape."""
    first, last = (int(row) for row in np.searchsorted(log["time"], span))
    return slice(first, last + 1, max(1, (last + 1 - first) // POINTS))
