"""Signals of all runs as the report's curves show them: thinned to some hundred numbers each."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.quantities import letters_of_symbol
from podusv_cli.figures.scales import linear_up_to, scaling, smallest_distance
from podusv_cli.figures.shown import Shown, about
from podusv_cli.pages.page import raise_powers_markup

PIECES = 300  # of a run; a curve keeps the least and the largest number of each
MOST, CURVES = 20, 200  # signals of many runs, and curves of all signals of a few
NUMBERED = re.compile(r" \(\d+\)")  # equations of the first paper, which few readers have at hand
DISTANCE = "z_e"
FIRST = (DISTANCE, "e_ct", "psi_e", "tau_u", "tau_r")  # which readers look at first
ASKED, SWAY = "tau_v_cmd", "tau_v"  # of a vessel that is asked for a sway force, that one, too
NEXT = ("x_e", "y_e")  # which follow from the log


def traces(runs: Sequence[Shown], names: Sequence[str] = ()) -> dict[str, Any]:
    """The scalar signals of the runs with meaning, symbol, unit and scale; {} where there is none.

    `names` chooses them; by default those that readers look at first, and some more. Every curve is
    over the whole run, thinned by `thin_trace` and encoded by `encode_trace`; null where a run
    lacks the signal. `first` is how many signals readers look at first.
    """
    runs = [run for run in runs if len(run.recording["time"])]
    shown = names or _scalar(runs)[: max(MOST, CURVES // max(1, len(runs)))]
    if not shown:
        return {}
    return {
        "signals": [_describe_signal(runs, name) for name in shown],
        # A page begins with one curve at least.
        "first": sum(name in _first(runs) for name in shown) or 1,
        "runs": [
            {
                "label": run.label,
                "color": run.color,
                "dash": [] if run.linestyle == "-" else list(run.linestyle[1]),
                "start": float(run.recording["time"][0]),
                "end": run.end,
                "counts": run.counts_to,
                "whole": run.whole,
                "curves": [
                    encode_trace(*thin_trace(run.signal(name))) if run.has(name) else None
                    for name in shown
                ],
            }
            for run in runs
        ],
    }


def _first(runs: Sequence[Shown]) -> Sequence[str]:
    """What readers look at first."""
    return (*FIRST, SWAY) if any(run.has(ASKED) for run in runs) else FIRST


def _scalar(runs: Sequence[Shown]) -> list[str]:
    """The names of what is one number at every instant, in the order of readers' interest."""
    names = [n for run in runs for n, numbers in run.recording.signals.items() if numbers.ndim == 1]
    first = [name for name in (*_first(runs), *NEXT) if any(run.has(name) for run in runs)]
    return [name for name in dict.fromkeys([*first, *names]) if name != "time"]


def _describe_signal(runs: Sequence[Shown], name: str) -> dict[str, Any]:
    """What the page says of one signal, and the scale of its axis over all runs."""
    signal = about(runs, name)
    return {
        "name": name,
        "meaning": NUMBERED.sub("", signal.meaning),
        "unit": raise_powers_markup(signal.unit),
        "symbol": letters_of_symbol(signal.symbol),
    } | _scale([run for run in runs if run.has(name)], name)


def _scale(runs: Sequence[Shown], name: str) -> dict[str, Any]:
    """The scale of a signal's axis: linear up to `linear` (None: all of it), logarithmic beyond.

    With `floor` it begins there, as an axis of distances does.
    """
    if name == DISTANCE:
        return {"linear": smallest_distance(runs), "floor": True}
    numbers = np.concatenate([run.signal(name) for run in scaling(runs)], dtype=float)
    finite = numbers[np.isfinite(numbers)]
    counts = np.array_equal(finite, np.rint(finite))  # such as 0 or 1, or the number of a leg
    peak = float(np.max(np.abs(finite), initial=0.0))
    return {"linear": None if counts else linear_up_to(runs, name, peak), "floor": False}


def thin_trace(numbers: Vector) -> tuple[Vector, Vector]:
    """The least and the largest number of each of PIECES pieces, in the order in which they come.

    Shapes (2 PIECES,): the numbers, and where in its piece each is, from 0 to 255. Where there are
    no more numbers than that: all of them, and no places, as they are evenly spaced.
    """
    if len(numbers) <= 2 * PIECES:
        return numbers, np.empty(0)
    edges = np.linspace(0, len(numbers), PIECES + 1).round().astype(int)
    first, sizes = edges[:-1, None], np.diff(edges)[:, None]
    # Pieces differ by one in length; the shorter ones repeat their last number.
    rows = np.minimum(first + np.arange(sizes.max()), edges[1:, None] - 1)  # the last one again
    pieces = numbers[rows]
    good = np.isfinite(pieces)
    least = np.where(good, pieces, np.inf).argmin(axis=1)
    most = np.where(good, pieces, -np.inf).argmax(axis=1)
    within = np.sort(np.stack((least, most), axis=1), axis=1)
    # A piece without a finite number keeps its first.
    within[~good.any(axis=1)] = 0
    return numbers[(first + within).ravel()], (255 * within // sizes).ravel()


def encode_trace(numbers: Vector, places: Vector) -> dict[str, str]:
    """The arrays (n,) in base 64: four bytes a number, the least significant first, a byte a place.

    A number beyond the range of four bytes is NaN. A page decodes both.
    """
    with np.errstate(over="ignore"):
        small = np.asarray(numbers, dtype="<f4")
    finite = np.where(np.isfinite(small), small, np.nan).astype("<f4")
    parts = {"numbers": finite.tobytes(), "places": places.astype("u1").tobytes()}
    return {name: base64.b64encode(part).decode() for name, part in parts.items()}
