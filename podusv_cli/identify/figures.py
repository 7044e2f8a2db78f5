"""Figures of `podusv identify`. Import this module where a figure is drawn: matplotlib is slow."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from podusv_cli.core import escaping
from podusv_cli.figures.looks import nth_style
from podusv_cli.figures.sketch import COLUMNS, Sketch
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.identify.answer import Identification
from podusv_cli.identify.judge import WHO, FreeRun

MEASURED: dict[str, Any] = {
    "color": "#777777",
    "ls": "none",
    "marker": "o",
    "mfc": "none",
    "ms": 3.0,
}
POINTS = 60  # of what was measured, about
HEIGHT = 2.6  # inches
DRAWN = 1.6  # of the measured track: how far from its middle others are drawn


def sketches(answer: Identification) -> Iterator[Sketch]:
    """For every log its free run from the first start, measured and predicted; then the forces."""
    for i, (log, role, runs) in enumerate(answer.judged, 1):
        if runs:
            yield Sketch(
                f"free-run-{i}",
                f"{log.name} ({role}): measured, and predicted from its commands alone from "
                f"{runs[0].times[0] - log.times[0]:.0f} s on",
                partial(free_run, runs[0]),
            )
    caption = (
        "Damping over speed: the hull that was identified with its 95 % interval, and the interval "
        "before the logs; between the dotted lines lies the middle 80 % of the logs"
    )
    yield Sketch("forces", caption, partial(forces, answer))


def free_run(run: FreeRun) -> Figure:
    """Track and heading of a free run; of what was measured so many points that runs are seen."""
    figure = new_figure(COLUMNS, HEIGHT)
    track, heading = figure.subplots(1, 2)
    since = run.times - run.times[0]
    seen = np.isfinite(run.measured[:, 2])
    psi = np.unwrap(run.measured[seen, 2])
    for axes, east, north in (
        (track, *run.measured[np.isfinite(run.measured[:, 0])][:, [1, 0]].T),
        (heading, since[seen], np.degrees(psi)),
    ):
        every = max(1, len(east) // POINTS)
        axes.plot(east[::every], north[::every], **MEASURED, label="measured")
    middle_of_track = np.nanmean(run.measured[:, :2], axis=0)
    reach = DRAWN * float(np.nanmax(np.abs(run.measured[:, :2] - middle_of_track)))
    for i, (who, pose) in enumerate(zip(WHO, run.poses, strict=True)):
        colour = nth_style(i)[0]
        near = np.max(np.abs(pose[:, :2] - middle_of_track), axis=1) <= reach
        track.plot(
            np.where(near, pose[:, 1], np.nan),
            np.where(near, pose[:, 0], np.nan),
            color=colour,
            label=escaping.figure(who),
        )
        # The filter counts turns since the log began, what was measured since the run did.
        turns = np.round((psi[0] - pose[seen, 2][0]) / (2.0 * np.pi))
        heading.plot(since, np.degrees(pose[:, 2] + 2.0 * np.pi * turns), color=colour)
    middle, side = np.degrees(np.median(psi)), np.degrees(np.ptp(psi))
    heading.set_ylim(middle - side - 10.0, middle + side + 10.0)
    track.set(xlabel="east [m]", ylabel="north [m]")
    track.set_aspect("equal", adjustable="datalim")
    heading.set(xlabel="time since the free run began [s]", ylabel="heading [deg]")
    legend(figure)
    return figure


def forces(answer: Identification) -> Figure:
    """X(u), Y(v), N(r) with intervals."""
    figure = new_figure(COLUMNS, HEIGHT)
    for axes, curve in zip(figure.subplots(1, 3), answer.curves, strict=True):
        for low, high, colour, label in (
            (*curve.before, "#dddddd", "before the logs"),
            (*curve.after, nth_style(0)[0], "95 % interval"),
        ):
            axes.fill_between(curve.speeds, low, high, color=colour, alpha=0.5, lw=0.0, label=label)
        axes.plot(curve.speeds, curve.value, color=nth_style(0)[0], label="identified")
        for edge in curve.covered:
            axes.axvline(edge, color="black", lw=0.8, ls=":")
        axes.locator_params(axis="x", nbins=4)
        axes.set(
            xlabel=f"{curve.axis.speed} [{curve.axis.speed_unit}]",
            ylabel=f"{curve.axis.name} [{curve.axis.unit}]",
        )
    legend(figure)
    return figure
