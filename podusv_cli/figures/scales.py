"""The scale of a signal: which runs it has to fit, and from where on it is logarithmic."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from podusv_cli.core.recording import blocks, largest
from podusv_cli.figures.shown import Shown

TALL = 20.0  # a peak this many times the usual values gets a logarithmic axis
DECADES = 4  # at most, on the logarithmic axis of runs that finished
USUAL = 0.1  # of a signal's mean size: where a run settles below this, this is the usual size
SAMPLES = 1000  # of a signal, about, for what is usual in it
DIP = 0.02  # of the run; a distance that is smaller for less than this is a passage

Span = tuple[float, float]


def scaling(runs: Sequence[Shown], span: Span | None = None) -> list[Shown]:
    """The runs that the scale has to fit: those that finished, or go on after the span [s].

    A run that diverges leaves every scale; drawn to fit, it would hide all others. Where there is
    no other run, it sets the scale.
    """
    kept = [run for run in runs if run.whole or (span is not None and run.end > span[1])]
    return kept or list(runs)


def linear_up_to(runs: Sequence[Shown], name: str, peak: float) -> float | None:
    """The size beyond which an axis of signal `name` is logarithmic; None where it is linear.

    That is so where the `peak` dwarfs what is usual; the size is a power of ten.
    """
    kept = scaling([run for run in runs if run.has(name)])
    usual = max(_usual(run, name) for run in kept)
    if any(run.whole for run in kept):
        usual = max(usual, peak * 10.0**-DECADES)
    # A usual size of 0 has no decade to begin at.
    return float(10.0 ** np.ceil(np.log10(usual))) if peak > TALL * usual > 0.0 else None


def _usual(run: Shown, name: str) -> float:
    """The usual size of a signal: its largest settled value, or a share of its mean size if larger.

    Of a run that did not get to its settled part, the median.
    """
    values = run.signal(name)
    counted = slice(*np.searchsorted(run.recording["time"], [run.steady_from, run.counts_to]))
    settled = values[counted.start : counted.stop + 1]
    if run.whole and len(settled):
        return max(largest(len(settled), lambda rows: settled[rows]), USUAL * mean_size(run, name))
    return float(np.median(np.abs(values)))


def mean_size(run: Shown, name: str) -> float:
    """The mean of a signal's size over the run, which a short peak hardly raises; 0 for none."""
    values = run.signal(name)
    size = sum(float(np.sum(np.abs(values[part]))) for part in blocks(len(values)))
    return size / values.size if np.isfinite(size) else 0.0


def smallest_distance(runs: Sequence[Shown]) -> float:
    """The smallest distance [m] worth showing.

    It is the way of a step, or less where a vessel stays nearer. How near a vessel comes in passing
    depends on where the steps happen to fall.
    """
    return min(
        _smallest_distance_of(run) for run in runs if run.has("u")
    )  # a measured track may have none


def _smallest_distance_of(run: Shown) -> float:
    """The distance [m] at which an axis of distances begins for a run.

    It is the way of one step, or less where much of the log is nearer to the target.
    """
    stride = -(-len(run.recording["time"]) // SAMPLES)
    z_e, u = (np.abs(run.signal(name)[::stride]) for name in ("z_e", "u"))
    way = run.about.step * float(np.median(u))
    return min(way, float(np.quantile(z_e, DIP)))
