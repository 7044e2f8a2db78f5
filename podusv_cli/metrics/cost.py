"""What a law costs to compute."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from podusv_cli.core.recording import Recording
from podusv_cli.engine.replay import replayer
from podusv_cli.engine.simulate import ClosedLoop

REPLAYS = 25
QUARTILES = [REPLAYS * quarter // 4 for quarter in (1, 2, 3)]  # of the times in order


def law_costs(runs: Sequence[tuple[ClosedLoop, Recording]]) -> list[dict[str, float]]:
    """Median time of one evaluation of each law [ns], and its quartiles over repeated replays.

    The laws take turns, so that a machine whose speed drifts treats them alike.
    """
    replays = [replayer(loop, recording) for loop, recording in runs]
    times = np.array([[replay() for replay in replays] for _ in range(REPLAYS)])
    quartiles = np.sort(times, axis=0)[QUARTILES]  # np.percentile would import numpy.ma
    return [
        {"law_ns": float(middle), "law_ns_low": float(low), "law_ns_high": float(high)}
        for low, middle, high in quartiles.T
    ]
