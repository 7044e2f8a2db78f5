"""What a law costs to compute."""

from __future__ import annotations

import numpy as np

from podusv_cli.engine.replay import law_times
from podusv_cli.engine.simulate import ClosedLoop
from podusv_cli.recording import Recording


def law_cost(loop: ClosedLoop, recording: Recording) -> dict[str, float]:
    """Median time of one evaluation of the law [ns], and its quartiles over repeated replays."""
    low, middle, high = np.percentile(law_times(loop, recording), [25, 50, 75])
    return {"law_ns": float(middle), "law_ns_low": float(low), "law_ns_high": float(high)}
