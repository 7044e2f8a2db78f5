"""How `podusv compare` lays a log on a run: its clock, its place, and what it may lack."""

import csv
import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from command_samples import Command
from drawn_samples import drawn, hulls
from matplotlib.colors import to_hex
from measured_samples import METRICS, TASK, compared, log, made_run, numbers, warnings_of
from rotation import one_in
from scenario_samples import write

import podusv as p
from podusv_cli.core.errors import PodusvError
from podusv_cli.figures.curves import AFTER
from podusv_cli.figures.shown import dress_runs
from podusv_cli.figures.trajectory import views
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.rerun import rerun

OTTER = """
vessel: {preset: otter}
actuator: {kind: pod, preset: otter}
disturbance: {kind: none}
path: {kind: legs, points: [[0, 0], [17, 0], [17, 13]], speed: 1.1, acceptance: 3.0}
controller: {kind: alos}
start: {x: 0.0, y: 1.3}
simulation: {duration: 60, step: 0.02}
log: {every: 5}
"""


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("task.yaml", TASK)


# A clock of its own


def stamps(since, times):
    return [f"{(since + timedelta(seconds=t)).isoformat()}" for t in times.tolist()]


DAY = datetime(2026, 5, 4, 9, 30, 0, 250_000, tzinfo=UTC)
CLOCKS = {
    "seconds since 1970": ("time", lambda t: (t + DAY.timestamp()).tolist(), -DAY.timestamp()),
    "dates": ("time", lambda t: stamps(DAY, t), -DAY.timestamp()),
    "ms since power-on": ("time [ms]", lambda t: (1e3 * t + 37_213.0).tolist(), -37.213),
    "seconds since power-on, within the run": ("time", lambda t: (t + 3.3).tolist(), -3.3),
    "a log that began before the run": ("time", lambda t: (t - 2.7).tolist(), 2.7),
}


@pytest.mark.parametrize("clock", one_in(2, [*CLOCKS]))
def test_start_takes_the_first_position_for_the_first_instant_of_the_run(clock):
    """The run's own track, 5 m away and by another clock, is 0 m from the run once it is laid."""
    head, told, shift = CLOCKS[clock]
    run = made_run()
    t, x, y, psi = (run[name][0:76:4] for name in ("time", "x", "y", "psi"))
    cells = zip(told(t), x + 3.0, y - 4.0, psi, strict=True)
    rows = [",".join(map(str, row)) for row in cells]
    write("LOG.csv", "\n".join([f"{head},x,y,psi", *rows, ""]))
    done = compared("run", "LOG.csv", align="start")
    assert numbers(done, "run") == pytest.approx([0.0, 0.0, 0.0, len(t)], abs=1e-6)
    (line,) = warnings_of(done)
    moved, _, rest = line.removeprefix("--align start moves its clock by ").partition(" s, and ")
    assert float(moved) == pytest.approx(shift, abs=1e-3)
    assert rest.startswith("x by -3 m, y by +4 m: its position at 0 s of the runs is that of run")
    if abs(shift) > 7.9:
        with pytest.raises(PodusvError, match=r"--align start (takes|if)"):
            compared("run", "LOG.csv")


def test_place_leaves_the_clock_as_it_is():
    run = made_run()
    t, x, y, psi = (run[name][8:76:4] for name in ("time", "x", "y", "psi"))
    log("LOG.csv", "time,x,y,psi", np.column_stack([t, x + 3.0, y - 4.0, psi]))
    assert numbers(compared("run", "LOG.csv", align="place"), "run")[1] < 1e-9
    late = numbers(compared("run", "LOG.csv", align="start"), "run")[1]
    moved = [run[name][8:76:4] - run[name][8] + run[name][0] for name in ("x", "y")]
    off = np.hypot(*(run[n][0:68:4] - m for n, m in zip(("x", "y"), moved, strict=True)))
    assert late == pytest.approx(off.max(), rel=1e-6)
    assert late > 1e-3


# A log without headings


@pytest.mark.long
def test_a_log_without_a_heading_is_compared_by_its_positions(podusv: Command):
    run = made_run()
    t, x, y = (run[name][0:76:4] for name in ("time", "x", "y"))
    log("LOG.csv", "time,x,y", np.column_stack([t, x + 0.3, y - 0.4]))
    done = compared("run", "LOG.csv")
    found = numbers(done, "run")
    assert found[:2] == pytest.approx([0.5, 0.5], rel=1e-9)
    assert math.isnan(found[2])
    (line,) = warnings_of(done)
    assert line.startswith("no column is called psi: positions alone are compared")
    said = podusv("compare", "run", "LOG.csv", "--out", "both", "--force", "--figure", "all")
    assert not Path("both/missing.json").exists()
    assert "compared 1 run and 1 log: both" in said.out
    (row,) = [line for line in said.out.splitlines() if line.endswith(METRICS[2])]
    assert row.split()[-3:-1] == ["-", "-"]


def test_degrees_that_are_called_x_and_y_are_refused_without_a_heading_too():
    times = np.arange(0.0, 29.9, 0.1)
    x, y = 59.0 + 2e-5 * np.sin(0.1 * times), 10.0 + 1e-5 * times / 3.0
    log("LOG.csv", "time,x,y", np.column_stack([times, x, y]))
    made_run()
    with pytest.raises(PodusvError, match="if they are latitude and longitude in degrees"):
        compared("run", "LOG.csv")


# What a finished run calls the columns


def test_a_finished_run_says_what_the_columns_of_a_log_are_called():
    write("names.yaml", "extends: task.yaml\nidentify: {columns: {time: t, x: north, y: east}}\n")
    run = p.run(
        "names.yaml",
        {"controllers": None, "controller": {"kind": "momentum_vector"}},
        out="run",
        figures=False,
    )
    t, x, y, psi = (run[name][0:76:4] for name in ("time", "x", "y", "psi"))
    log("LOG.csv", "t,north,east,psi", np.column_stack([t, x, y + 0.7, psi]))
    assert numbers(compared("run", "LOG.csv"), "run")[1] == pytest.approx(0.7)
    rerun(Path("run"), Request(out=Path("again"), figures=False))
    assert numbers(compared("again", "LOG.csv"), "again")[1] == pytest.approx(0.7)
    compared("names.yaml", "LOG.csv")
    Path("both").rename("kept")
    assert numbers(compared("kept", "LOG.csv"), "momentum")[1] == pytest.approx(0.7)


def test_the_frame_of_a_log_comes_from_a_finished_run_too():
    names = "identify: {frame: enu, columns: {x: east, y: north, psi: yaw}}"
    write("enu.yaml", f"extends: task.yaml\n{names}\n")
    run = p.run(
        "enu.yaml",
        {"controllers": None, "controller": {"kind": "momentum_vector"}},
        out="run",
        figures=False,
    )
    t, x, y, psi = (run[name][0:76:4] for name in ("time", "x", "y", "psi"))
    log("LOG.csv", "time,east,north,yaw", np.column_stack([t, y, x, 0.5 * math.pi - psi]))
    assert numbers(compared("run", "LOG.csv"), "run")[:3] == pytest.approx([0.0] * 3, abs=1e-9)


# After the end of a path


@pytest.fixture
def on_legs():
    """A run on legs and its own track as a log beside it, 1 m away; when the legs were done."""
    write("legs.yaml", OTTER)
    run = p.run("legs.yaml", out="run", figures=False)
    t, x, y, psi = (run[name][::5] for name in ("time", "x", "y", "psi"))
    log("LOG.csv", "time,x,y,psi", np.column_stack([t, x + 1.0, y, psi]))
    shown = dress_runs(compared("run", "LOG.csv").result.runs)
    return shown, float(run.metrics["path_time"])


def test_a_log_is_grey_after_the_end_of_the_run_s_path_as_the_run_is(on_legs):
    (run, measured), path_time = on_legs
    assert 20.0 < path_time < 50.0
    assert measured.counts_to == pytest.approx(path_time, abs=0.5)
    assert measured.counts_to >= path_time
    assert all(view.t <= run.counts_to for view in views([run, measured]))
    whole, *_, below = drawn("trajectory", [run, measured]).axes
    grey = [line for line in whole.lines if line.get_label() == "_LOG, after its path"]
    assert [line.get_color() for line in grey] == [AFTER["color"]]
    (own,) = (line for line in whole.lines if line.get_label() == "LOG")
    last = np.flatnonzero(measured.recording["time"] <= measured.counts_to)[-1]
    assert own.get_xydata()[-1] == pytest.approx(
        [measured.recording[name][last] for name in ("y", "x")]
    )
    curves = {line.get_label(): line.get_xdata() for line in below.lines}
    assert curves["LOG"].max() == pytest.approx(measured.counts_to)
    assert curves["_LOG, after its path"].min() == pytest.approx(measured.counts_to)


def test_hulls_after_the_end_of_a_path_are_grey(on_legs):
    runs, _ = on_legs
    whole, *_ = drawn("trajectory", runs).axes
    colors = [to_hex(color) for *_, color in hulls(whole)]
    late = [sum(run.look.places * run.end > run.counts_to) for run in runs]
    assert all(0 < count < len(run.look.places) for count, run in zip(late, runs, strict=True))
    assert colors.count(AFTER["color"]) == sum(late)
    for count, run in zip(late, runs, strict=True):
        assert colors.count(to_hex(run.color)) == len(run.look.places) - count


@pytest.mark.long
def test_the_command_counts_runs_and_logs_apart(podusv: Command):
    run = made_run()
    columns = [run[name][0:76:4] for name in ("time", "x", "y", "psi")]
    log("LOG.csv", "time,x,y,psi", np.column_stack(columns))
    said = podusv("compare", "task.yaml", "LOG.csv", "--out", "both", "--no-figures")
    assert "compared 2 runs and 1 log: both" in said.out
    with Path("both/comparison.csv").open() as file:
        assert "LOG" in next(csv.reader(file))
