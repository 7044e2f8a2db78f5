"""What docs/sea.md tells of loads and wave motions, from the logs that `make sea` leaves."""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from podusv_cli.interface import open_run

SEA = Path(__file__).parents[2] / "results/runs/sea"
RUNS = ("exact", "state_6", "current")
LAW, SINCE = "velocity_vector", 100.0  # s; after the approach
SIGNALS = ["b_u", "b_v", "b_r", "psi_w", "r_w"]  # the last two where there are waves


def rms(name: str) -> pd.Series:
    """Root mean squares of the loads on the hull, and of the waves that compass and gyro see."""
    run = open_run(SEA / name / LAW)
    settled = run["time"] >= SINCE
    logged = [name for name in SIGNALS if name in run.log]
    return pd.Series({name: (run[name][settled] ** 2).mean() ** 0.5 for name in logged})


def main() -> None:
    """Print a line a run."""
    table = pd.DataFrame({name: rms(name) for name in RUNS}).T[SIGNALS]
    sys.stdout.write(table.to_csv(index_label="run", float_format="%.6g"))


if __name__ == "__main__":
    main()
