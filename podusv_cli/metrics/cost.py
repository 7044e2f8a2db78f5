"""The processor time that a law takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from podusv_cli.core.recording import Recording
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.replay import replayer
from podusv_cli.metrics.metric import Metric

REPLAYS = 25  # of each log; quartiles leave out those that the system delayed
law_ns = Metric(
    "law_ns",
    "ns",
    "median processor time of one evaluation of the law over its logged states",
    place=200,
    words="time of one evaluation of the law",
    headline=True,
)
low = Metric(
    "law_ns_low",
    "ns",
    "lower quartile of that time over the replays",
    place=200,
    words="time of one evaluation, lower quartile",
)
high = Metric(
    "law_ns_high",
    "ns",
    "upper quartile of that time over the replays",
    place=200,
    words="time of one evaluation, upper quartile",
)
QUARTILES = [REPLAYS * quarter // 4 for quarter in (1, 2, 3)]  # positions in the sorted times


def law_costs(runs: Sequence[tuple[Plan, Recording]]) -> list[dict[str, float]]:
    """Median time of one evaluation of each law [ns], and its quartiles, over repeated replays.

    By name of the metric, one mapping for each of `runs`, which are plans and their recordings. The
    laws are timed in turn, so that changes of the machine's speed affect all alike.
    """
    replays = [replayer(plan, recording) for plan, recording in runs]
    times = np.array([[replay() for replay in replays] for _ in range(REPLAYS)])
    quartiles = np.sort(times, axis=0)[QUARTILES]  # np.percentile would import numpy.ma
    return [
        {"law_ns": float(middle), "law_ns_low": float(low), "law_ns_high": float(high)}
        for low, middle, high in quartiles.T
    ]
