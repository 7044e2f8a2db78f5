"""The rows of a log that count, as metrics have it: to the end of a path, and its last part."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.finding import Mask
from podusv_cli.core.recording import Recording
from podusv_cli.scenario.model import Scenario


def counted_rows(scenario: Scenario, log: Recording) -> Mask:
    """The rows up to the end of a path that has one, else all; see `metrics.spans`."""
    rows = np.arange(len(log["time"]))
    last = log.row_at(scenario.passed_by(1.0))
    return rows >= 0 if last is None else rows <= last


def steady_rows(scenario: Scenario, log: Recording) -> Mask:
    """The counted rows (n,) in the steady window.

    The window is the last part of the way where a path has an end, else of the time. A log that
    does not come so far on its path has the last part of the time.
    """
    share = 1.0 - scenario.metrics.steady_fraction
    first = log.row_at(scenario.passed_by(share))
    late = log["time"] >= (scenario.steady_from() if first is None else log["time"][first])
    return late & counted_rows(scenario, log)
