"""Logs for the example of `podusv identify`: manoeuvres, as a boat's logger would write them."""

from __future__ import annotations

import math
from pathlib import Path

from podusv_cli.engine.running.simulate import to_end
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.shipped import PREFIX
from podusv_cli.storage import csv_files, files

MANOEUVRES = f"{PREFIX}identify/manoeuvres.yaml"
# A log's columns, the signals that they show, and what a number is in the column's unit.
COLUMNS = {
    "time [s]": ("time", None, 1.0),
    "north [m]": ("x_m", None, 1.0),
    "east [m]": ("y_m", None, 1.0),
    "heading [deg]": ("psi_m", None, math.degrees(1.0)),
    "yaw_rate [deg/s]": ("r_m", None, math.degrees(1.0)),
    "port [rpm]": ("n", 0, 60.0),
    "starboard [rpm]": ("n", 1, 60.0),
}


def write(config: Path, wanted: Identify) -> list[Path]:
    """Write the logs that a copy of the example names, beside it; those that are there stay.

    `config` is the copy, and `wanted` its section `identify`. Returns the files that are new.
    """
    laws = load(MANOEUVRES).scenario.singles()
    paths = [config.with_name(log.file) for log in wanted.logs]
    missing = [path for path in paths if not path.exists()]
    files.write_all({path: _log(laws[path.stem]).encode() for path in missing})
    return missing


def _log(single: Scenario) -> str:
    """The text of a CSV file with the run of a scenario, in the units of `COLUMNS`."""
    single.ready()
    recording = to_end(single.plan())
    columns = [
        # A signal with a column for each propeller.
        (recording[name] if place is None else recording[name][:, place]) * factor
        for name, place, factor in COLUMNS.values()
    ]
    return csv_files.lines([list(COLUMNS), *zip(*map(list, columns), strict=True)], "%.6g")
