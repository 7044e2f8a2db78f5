"""A log of a boat as an argument of `podusv compare`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from podusv_cli.comparison.measured import POSE, Track
from podusv_cli.core.errors import UsageError
from podusv_cli.core.signal import STATE
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.named_files import YAML


def is_log(path: Path) -> bool:
    """Whether an argument is a log, and neither a scenario nor a folder."""
    if path.suffix in ("", *YAML) or path.is_dir():
        return False
    from podusv_cli.identify.logs.formats import READERS  # h5py is slow to import

    return path.suffix.lower() in READERS


def track(path: Path, identify: Sequence[Identify]) -> Track:
    """The measured track of a log; the first of these sections says what its columns are called.

    A row stands where a position is new; all else is straight between its own values. Raises
    UsageError where the log has no pose.
    """
    from podusv_cli.identify.logs.reading import Named, delivered, table

    named = Named(identify[0].columns, identify[0].frame) if identify else Named()
    log = table(path, STATE, named)
    if lacking := [name for name in POSE if name not in log.columns]:
        raise UsageError(
            f"{path}: nothing is known of {', '.join(lacking)}; call its columns time, x, y, psi, "
            "with units in brackets where these are not s, m, rad, or write identify.columns in a "
            "scenario beside it, which says what they are called"
        )
    rows = delivered(log.columns["x"]) & np.isfinite(log.columns["y"])
    if np.count_nonzero(rows) < 2:
        raise UsageError(f"{path}: has fewer than two positions, which is no track")
    signals = {}
    for name, values in log.columns.items():
        known = np.isfinite(values)
        whole = np.unwrap(values[known]) if name == "psi" else values[known]
        if known.any() and name in {signal.name for signal in STATE}:
            signals[name] = np.interp(log.times[rows], log.times[known], whole)
    return Track(path, log.times[rows], signals)
