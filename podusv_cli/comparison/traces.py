"""Signals of all runs as the report's curves show them: thinned to some hundred numbers each."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.figures.shown import Shown

PIECES = 300  # of a run; a curve keeps the least and the largest number of each
MOST = 20  # signals
NUMBERED = re.compile(r" \(\d+\)")  # equations of the first paper, which few readers have at hand
FIRST = ("z_e", "e_ct", "psi_e", "tau_u", "tau_r")  # which readers look at first


def traces(runs: Sequence[Shown]) -> dict[str, Any]:
    """The scalar signals that all runs have, with meaning and unit; {} where there is none.

    Every curve is over the whole run, thinned by `thinned` and encoded by `encoded`.
    """
    runs = [run for run in runs if len(run.recording["time"])]
    names = [name for name in _scalar(runs) if all(run.has(name) for run in runs)][:MOST]
    about = {name: signal for run in runs for name, signal in run.recording.about.items()}
    shown = [name for name in names if name in about]
    if not shown:
        return {}
    return {
        "signals": [
            {"name": n, "meaning": NUMBERED.sub("", about[n].meaning), "unit": about[n].unit}
            for n in shown
        ],
        "runs": [
            {
                "label": run.label,
                "color": run.color,
                "dash": [] if run.linestyle == "-" else list(run.linestyle[1]),
                "start": float(run.recording["time"][0]),
                "end": run.end,
                "curves": [encoded(*thinned(run.signal(name))) for name in shown],
            }
            for run in runs
        ],
    }  # fmt: skip


def _scalar(runs: Sequence[Shown]) -> dict[str, None]:
    """The names of what is one number at every instant, in the order of readers' interest."""
    names = [n for run in runs for n, numbers in run.recording.signals.items() if numbers.ndim == 1]
    return dict.fromkeys([*FIRST, *(name for name in names if name != "time")])


def thinned(numbers: Vector) -> tuple[Vector, Vector]:
    """The least and the largest number of each of PIECES pieces, in the order in which they come.

    Shapes (2 PIECES,): the numbers, and where in its piece each is, from 0 to 255. Where there are
    no more numbers than that: all of them, and no places, as they are evenly spaced.
    """
    if len(numbers) <= 2 * PIECES:
        return numbers, np.empty(0)
    edges = np.linspace(0, len(numbers), PIECES + 1).round().astype(int)
    first, sizes = edges[:-1, None], np.diff(edges)[:, None]
    rows = first + np.arange(sizes.max())  # of every piece, the shorter ones filled up
    inside = rows < edges[1:, None]
    pieces = numbers[np.minimum(rows, len(numbers) - 1)]
    good = inside & np.isfinite(pieces)
    least = np.where(good, pieces, np.inf).argmin(axis=1)
    most = np.where(good, pieces, -np.inf).argmax(axis=1)
    within = np.sort(np.stack((least, most), axis=1), axis=1)
    within[~good.any(axis=1)] = 0
    return numbers[(first + within).ravel()], (255 * within // sizes).ravel()


def encoded(numbers: Vector, places: Vector) -> dict[str, str]:
    """In base 64: four bytes a number, the least significant first, and a byte a place.

    What is beyond any number of four bytes is none.
    """
    with np.errstate(over="ignore"):
        small = np.asarray(numbers, dtype="<f4")
    finite = np.where(np.isfinite(small), small, np.nan).astype("<f4")
    parts = {"numbers": finite.tobytes(), "places": places.astype("u1").tobytes()}
    return {name: base64.b64encode(part).decode() for name, part in parts.items()}
