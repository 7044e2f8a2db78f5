"""The runs as the report's animation shows them: positions thinned to some thousand numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.shown import Shown
from podusv_cli.figures.tracks import bounds
from podusv_cli.pages.page import environment

FRAMES = 1000  # of a run, at most
WHERE = ("x", "y", "psi")  # without these a run cannot be shown
ON_EARTH = ("lat", "lon")  # of runs whose scenario has an origin
DIGITS = {"time": 4, "psi": 4, "lat": 6, "lon": 6}
AWAY = ("z_e", "e_ct")  # the distance that is drawn: to the target, else from the active leg
MILLIMETRES = 3  # digits of all others
FAR = 1e9  # m; diverged runs end beyond any map


def chase(runs: Sequence[Shown], frames: int = FRAMES) -> dict[str, Any]:
    """Where runs and targets are at up to `frames` instants, as JSON takes it.

    {} where no run has x, y and psi. `box` is west, south, east, north [m] of the map.
    """
    moving = [run for run in runs if all(run.has(name) for name in WHERE)]
    if not moving:
        return {}
    (west, east), (south, north) = bounds(moving)
    half = max(run.length for run in moving) / 2  # a hull reaches beyond its track
    return {
        "box": _round_numbers((west - half, south - half, east + half, north + half)),
        "end": _round_numbers([max(run.end for run in moving)], DIGITS["time"])[0],
        "runs": [_track(run, frames) for run in moving],
    }


def page(runs: Sequence[Shown]) -> str:
    """The animation alone, as a page that needs nothing else."""
    from markupsafe import Markup  # with jinja2

    moving = chase(runs)
    template = environment("podusv_cli.pages").get_template("play.html.j2")
    title = ", ".join(run.label for run in runs)
    return template.render(title=title, chase=moving, chase_json=Markup(as_json(moving)))


def as_json(content: dict[str, Any]) -> str:
    """JSON that cannot end the script element that holds it."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _track(run: Shown, frames: int) -> dict[str, Any]:
    """What the page draws of a run: at most `frames` instants of its log, and its hull.

    Numbers are rounded to what can be seen, as the page holds all of them.
    """
    count = len(run.recording["time"])
    rows = np.linspace(0, count - 1, min(count, frames)).round().astype(int)
    # Runs with a distance z_e to a target have the target's place.
    names = ("time", *WHERE, *ON_EARTH, *(("x_d", "y_d") if run.has("z_e") else ()))
    away = next(filter(run.has, AWAY), None)
    legs = np.array(run.about.waypoints if run.about.follows else ())
    stopped = f"{run.recording.status} at t = {run.end:g} s"
    return {
        "label": run.label,
        "color": run.color,
        "dash": [] if run.linestyle == "-" else list(run.linestyle[1]),
        "length": run.length,
        "beam": run.about.beam,
        "standoff": run.about.standoff,
        "counts": _round_numbers([run.counts_to], DIGITS["time"])[0],
        "ending": "" if run.whole else run.recording.message.partition(":")[0] or stopped,
        "legs": [_round_numbers(axis) for axis in legs.T],
        "distance": _round_numbers(np.abs(run.signal(away)[rows]), MILLIMETRES + 1) if away else [],
        **{
            name: _round_numbers(run.signal(name)[rows], DIGITS.get(name, MILLIMETRES))
            for name in names
            if run.has(name)
        },
    }


def _round_numbers(
    numbers: Sequence[float] | Vector, digits: int = MILLIMETRES
) -> list[float | None]:
    """The numbers (n,) with so many digits after the point; None for NaN, which JSON lacks."""
    within = np.round(np.clip(numbers, -FAR, FAR), digits).tolist()
    return [None if math.isnan(x) else x for x in within]
