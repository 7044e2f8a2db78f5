"""The rms loads that results/sea.md tells, as a CSV table from the logs that `make sea` leaves."""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from podusv_cli.interface import open_run

SEA = Path(__file__).parent / "sea"
RUNS = ("exact", "state_6", "current")
LAW, SINCE = "velocity_vector", 100.0  # s; after the approach
LOADS = ["b_u", "b_v", "b_r"]


def rms(name: str) -> pd.Series:
    """Root mean squares of the loads on the hull in a run."""
    run = open_run(SEA / name / LAW)
    settled = run["time"] >= SINCE
    return pd.Series({load: (run[load][settled] ** 2).mean() ** 0.5 for load in LOADS})


def main() -> None:
    """Print a line a run."""
    table = pd.DataFrame({name: rms(name) for name in RUNS}).T
    sys.stdout.write(table.to_csv(index_label="run", float_format="%.6g"))


if __name__ == "__main__":
    main()
