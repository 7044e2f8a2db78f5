"""From the topics of milliAmpere's trials to logs for `podusv identify`.

    python examples/reproduce/milliampere_logs.py physical_tests/maneuvering1/maneuvering1 out.csv

The trials are public (github.com/Andeshog/milliampere_data, physical_tests; no licence is given, so
neither they nor what this writes is a part of podusv). Position and heading are those of the GNSS
compass VS330, loads are what the boat's own software reckons that its four thrusters give.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd


def topic(folder: Path, name: str) -> pd.DataFrame:
    """A topic's rows by time [s]."""
    frame = pd.read_csv(folder / f"{name}.csv")
    times = pd.to_datetime(frame["time"], format="%Y/%m/%d %H:%M:%S.%f")
    frame.index = (times - pd.Timestamp(0)) / pd.Timedelta(1, "s")
    return frame[~frame.index.duplicated()].sort_index()


def main() -> None:
    """Write one table with a row for each time of any topic."""
    folder, out = map(Path, sys.argv[1:])
    fix, heading = topic(folder, "vectorVS330/fix"), topic(folder, "vectorVS330/heading")
    loads = topic(folder, "tau_actual")
    angle = 2.0 * np.arctan2(heading["quaternion_z"], heading["quaternion_w"])
    columns = {
        "lat [deg]": fix["latitude"],
        "lon [deg]": fix["longitude"],
        "psi [rad]": np.arctan2(np.sin(angle), np.cos(angle)),
        "tau_u [N]": loads["wrench_force_x"],
        "tau_v [N]": loads["wrench_force_y"],
        "tau_r [N m]": loads["wrench_torque_z"],
    }
    table = pd.concat(columns, axis=1).sort_index()
    loaded = ["tau_u [N]", "tau_v [N]", "tau_r [N m]"]
    table[loaded] = table[loaded].ffill()
    table = table.dropna(subset=loaded)
    table.index = (table.index - table.index[0]).rename("time [s]")
    table.to_csv(out, float_format="%.9g")


if __name__ == "__main__":
    main()
