"""How far a run is from a measured track, which only comparisons with a log have."""

from __future__ import annotations

from functools import partial

from podusv_cli.metrics.metric import Metric

_metric = partial(Metric, place=-1, headline=True)
log_distance_rms = _metric(
    "log_distance_rms", "m", "rms distance from the measured track, at equal times"
)
log_distance_max = _metric(
    "log_distance_max", "m", "largest distance from the measured track, at equal times"
)
log_heading_rms = _metric("log_heading_rms", "rad", "rms of the heading less the measured one")
log_instants = _metric(
    "log_instants", "1", "instants of the measured track that the run has, too", margin=True
)
OF_LOG = (log_distance_rms, log_distance_max, log_heading_rms, log_instants)
