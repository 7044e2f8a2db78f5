"""The metrics that a comparison's runs may have."""

from __future__ import annotations

from collections.abc import Sequence

from podusv_cli.core.about import MetricAbout
from podusv_cli.core.past_run import PastRun
from podusv_cli.metrics.table import metrics_with

UNKNOWN = "a metric of a plug-in that is not here; its unit is in the run's metrics.csv"


def metrics_of(runs: Sequence[PastRun]) -> dict[str, MetricAbout]:
    """All metrics that podusv, a plug-in or a run knows, and those that only a run's files name."""
    plugins = dict.fromkeys(plugin for run in runs for plugin in run.plugins)
    known: dict[str, MetricAbout] = {**metrics_with(tuple(plugins))}
    for run in runs:
        known = known | {n: m for n, m in run.about.metrics.items() if n not in known}
    names = dict.fromkeys(name for run in runs for name in run.metrics)
    known |= {name: MetricAbout(name, "", UNKNOWN) for name in names if name not in known}
    return {
        metric.name: metric for metric in sorted(known.values(), key=lambda metric: metric.place)
    }
