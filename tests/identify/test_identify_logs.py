"""Logs on their way into a fit: formats, frames, clocks, and the mistakes of people with logs."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from identify_samples import HULL, SCENARIO, commands_of, motion, table_of
from log_files import read, written

from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.core.errors import UsageError
from podusv_cli.identify.doubts import far_words
from podusv_cli.identify.fit.problem import FitProblem
from podusv_cli.identify.fit.records import log_of
from podusv_cli.identify.intake import logs_of, pieces
from podusv_cli.identify.logs.checks import check_log
from podusv_cli.identify.logs.commands import hold_values
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.reading import LogTable
from podusv_cli.identify.offsets import Clocks
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.load import load
from podusv_cli.workflows.identify import answer_logs

LOGS = (LogFile(file="a.csv"),)


@pytest.fixture(scope="module")
def weaving():
    """A boat that weaves on all headings, by algebra: no hull is behind it."""
    times = np.arange(0.0, 60.0, 0.1)
    fine = np.arange(0.0, 60.0, 0.01)
    psi = 0.1 * fine + 0.8 * np.sin(0.5 * fine)
    u, v = 1.0 + 0.3 * np.sin(0.2 * fine), 0.15 * np.cos(0.5 * fine)
    north, east = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
    x, y = np.cumsum(north) * 0.01, np.cumsum(east) * 0.01
    r = 0.1 + 0.4 * np.cos(0.5 * fine)
    found = dict(zip(("x", "y", "psi", "u", "v", "r"), (x, y, psi, u, v, r), strict=True))
    columns = {name: values[::10].copy() for name, values in found.items()}
    return LogTable("boat.csv", times, columns | {"tau_u": 0 * times, "tau_r": np.sin(times)})


@pytest.fixture(scope="module")
def sailed():
    """90 s of a hull under commands that change, as sensors see it."""
    times = np.arange(0.0, 90.0, 0.2)
    commands = commands_of(times, seed=3)
    states = motion(commands, times, np.array([1.0, -2.0, 0.3, 0.4, 0.0, 0.0]))
    return table_of(times, states, commands, seed=3)


def scenario(vessel=HULL, free=("inertia",), **wanted):
    wanted = {"free": free, **wanted}
    changed = {"vessel": vessel, "nominal": vessel, "identify": Identify(logs=LOGS, **wanted)}
    return SCENARIO.model_copy(update=changed)


# Formats


# Units, frames and clocks


def test_a_log_of_a_date_is_the_log_from_zero(sailed):
    own = log_of(sailed, Ideal(), 0.05)
    dated = log_of(replace(sailed, times=sailed.times + 1.7e9), Ideal(), 0.05)
    assert dated.record.rows == pytest.approx(own.record.rows, abs=1e-5)


def test_headings_may_wrap(sailed):
    wrapped = np.mod(sailed.columns["psi"], 2.0 * math.pi)
    assert np.any(np.abs(np.diff(wrapped)) > 3.0)
    turned = replace(sailed, columns={**sailed.columns, "psi": wrapped})
    assert check_log(turned, Ideal()) == check_log(sailed, Ideal()) == []
    assert log_of(turned, Ideal(), 0.05).state[3:] == pytest.approx(
        log_of(sailed, Ideal(), 0.05).state[3:]
    )


def test_a_sensor_that_is_held_between_its_values_counts_once(weaving):
    held = {name: np.repeat(weaving.columns[name][::5], 5) for name in ("x", "y", "r")}
    log = log_of(replace(weaving, columns={**weaving.columns, **held}), Ideal(), 0.05)
    assert log.counts.tolist() == [120, 120, 600, 600, 600, 120]


def test_a_gap_parts_a_log(sailed):
    kept = (sailed.times < 40.0) | (sailed.times >= 50.0)
    parts = list(pieces(sailed.where(kept)))
    assert [part.name for part in parts] == ["a.csv from 0 s", "a.csv from 50 s"]
    assert [len(part.times) for part in parts] == [200, 200]
    assert "1 gap, the longest of 10.2 s at 39.8 s; it is taken as 2 logs" in parts[0].warnings[0]
    late = sailed.where((sailed.times < 80.0) | (sailed.times > 88.0))
    assert [part.name for part in pieces(late)] == ["a.csv from 0 s"]
    assert list(pieces(sailed)) == [sailed]


# Mistakes that a motion shows

DEG = 180.0 / math.pi
MISTAKES = {
    "heading in degrees": (
        {"psi": lambda c: c["psi"] * DEG % 360.0},
        r'write psi: "COLUMN \[deg\]"',
    ),
    "heading to port": ({"psi": lambda c: -c["psi"]}, r'write psi: "-COLUMN"'),
    "heading from the east": (
        {"psi": lambda c: math.pi / 2 - c["psi"]},
        "psi is counted from the east",
    ),
    "ENU for NED, with a compass": (
        {"x": lambda c: c["y"], "y": lambda c: c["x"]},
        "exchange x and y under identify.columns",
    ),
    "yaw rate in deg/s": ({"r": lambda c: c["r"] * DEG}, r'write r: "COLUMN \[deg/s\]"'),
    "yaw rate to port": ({"r": lambda c: -c["r"]}, r'r is -1 .*write r: "-COLUMN"'),
    "speed in knots": ({"u": lambda c: c["u"] / 0.514444}, r'u is 1\.9\d .*"COLUMN \[kn\]"'),
    "sway to port": ({"v": lambda c: -c["v"]}, r'write v: "-COLUMN"'),
    "a compass that stands": ({"psi": lambda c: 0 * c["psi"] + 0.7}, "psi is 0.7 throughout"),
    "a compass of zeros": ({"psi": lambda c: 0 * c["psi"]}, "psi is 0 throughout while"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_no_motion_explains_is_an_error_that_says_what_to_write(weaving, mistake):
    changes, sentence = MISTAKES[mistake]
    assert check_log(weaving, Ideal()) == []
    changed = {name: change(weaving.columns) for name, change in changes.items()}
    with pytest.raises(LogFault, match=f"(?s)boat.csv: .*{sentence}"):
        check_log(replace(weaving, columns={**weaving.columns, **changed}), Ideal())


def test_a_compass_that_is_mounted_backwards_is_said_with_what_follows_from_it(weaving):
    given = {**weaving.columns, "psi": weaving.columns["psi"] + math.pi}
    with pytest.raises(LogFault, match=r"u is -1.02 .* also, the boat moves -?1\d\d deg off"):
        check_log(replace(weaving, columns=given), Ideal())
    given.pop("u"), given.pop("v")
    lines = check_log(replace(weaving, columns=given), Ideal())
    assert "deg off its heading on average; check that x is north" in lines[0]


def test_a_boat_that_yaws_in_waves_on_a_straight_track_is_no_mistake():
    times = np.arange(0.0, 120.0, 0.1)
    noise = 0.01 * np.random.default_rng(2).standard_normal((2, len(times)))
    columns = {
        "x": 1.5 * times + noise[0],
        "y": 0.1 * times + noise[1],
        "psi": 0.4 * np.sin(1.3 * times),
        "tau_u": np.sin(times),
    }
    assert check_log(LogTable("waves.csv", times, columns), Ideal()) == []


def test_a_yaw_rate_agrees_however_fast_the_boat_weaves():
    """Means over a second of heading and yaw rate differ where a turn takes little more."""
    times = np.arange(0.0, 120.0, 0.1)
    psi = 0.3 * np.sin(1.8 * times)
    columns = {
        "x": 1.5 * times,
        "y": 0.01 * times,
        "psi": psi,
        "r": 0.54 * np.cos(1.8 * times),
        "tau_u": np.sin(times),
    }
    assert check_log(LogTable("weaves.csv", times, columns), Ideal()) == []
    with pytest.raises(LogFault, match=r'write r: "COLUMN \[deg/s\]"'):
        check_log(LogTable("weaves.csv", times, {**columns, "r": DEG * columns["r"]}), Ideal())


def test_times_in_milliseconds(weaving):
    with pytest.raises(LogFault, match=r'100 s apart.* write time: "COLUMN \[ms\]"'):
        check_log(replace(weaving, times=1e3 * weaving.times), Ideal())


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"u": lambda c: 1.7 * c["u"]}, "u is 1.7 times as fast as positions move"),
        ({"tau_u": lambda c: 0 * c["u"] + 2.5}, "tau_u is 2.5 throughout"),
        ({"v": lambda c: np.nan * c["v"]}, "v has no number at all"),
        ({"tau_r": lambda c: 0 * c["tau_r"]}, "its commands are 0 throughout, so the boat lay"),
    ],
)
def test_what_is_only_unlikely_is_a_warning(weaving, changes, sentence):
    changed = {name: change(weaving.columns) for name, change in changes.items()}
    given = replace(weaving, columns={**weaving.columns, **changed})
    assert [line for line in check_log(given, Ideal()) if sentence in line]


def test_a_position_that_jumps_is_a_warning(weaving):
    x = weaving.columns["x"] + np.where(weaving.times < 30.0, 0.0, 40.0)
    (line,) = check_log(replace(weaving, columns={**weaving.columns, "x": x}), Ideal())
    jump = re.search(r"x jumps by (.*?) at 30 s", line)
    assert float(jump[1]) == pytest.approx(40.0, abs=0.2)


def test_a_straight_run_at_one_speed_tells_little():
    times = np.arange(0.0, 60.0, 0.2)
    noise = np.random.default_rng(1).standard_normal((3, len(times))) * 0.005
    columns = {"x": times + noise[0], "y": noise[1], "psi": noise[2], "tau_u": 0 * times + 1.0}
    lines = check_log(LogTable("straight.csv", times, columns), Ideal())
    assert any(
        "determines the drag at one speed and little else; zig-zags" in line for line in lines
    )


def test_a_propeller_in_rpm_is_told_by_what_the_pods_can_do(weaving):
    actuator = load(
        "podusv:trials/base.yaml", ["vessel={preset: otter}", "controller={kind: pid}"]
    ).scenario.actuator
    most = actuator.reach["n_1"]
    given = {**weaving.columns, "n_1": 50.0 * most * np.abs(np.sin(weaving.times))}
    with pytest.raises(LogFault, match=r'n_1 reaches .* write n_1: "COLUMN \[rpm\]"'):
        check_log(replace(weaving, columns=given), actuator)


# Mistakes that the table shows


def test_rows_twice_and_rows_without_a_time_are_left_out(tmp_path):
    path = written(
        tmp_path / "log.csv",
        {"time": [0, 1, 1, np.nan, 2], "x": [0, 1, 1, 5, 2], "y": [0, 0, 0, 0, 0]},
    )
    log = read(path)
    assert log.times.tolist() == [0.0, 1.0, 2.0]
    assert "1 rows have the time of the row before" in " ".join(log.warnings)
    assert "1 rows without a number under 'time'" in " ".join(log.warnings)


@pytest.mark.parametrize(
    ("times", "sentence"),
    [([0, 1, 1, 2], "row 3 has the same time as"), ([0, 1, 0.5, 2], "row 3 has an earlier time")],
)
def test_a_clock_that_stands_or_is_set_back_is_an_error(tmp_path, times, sentence):
    with pytest.raises(LogFault, match=sentence):
        read(written(tmp_path / "log.csv", {"time": times, "x": [0, 1, 2, 3]}))


def test_names_that_are_not_there_are_answered_with_near_ones(tmp_path):
    path = written(tmp_path / "log.csv", {"time": [0, 1], "heading": [0, 1]})
    with pytest.raises(LogFault, match="no column is called 'headin'; did you mean 'heading'"):
        read(path, {"psi": "headin [deg]"})
    with pytest.raises(LogFault, match="psi is given in 'grad'; allowed: rad, deg"):
        read(path, {"psi": "heading [grad]"})
    with pytest.raises(LogFault, match=r"nothing lies between 5 and 9 s; the log goes from 0 to 1"):
        read(path, {"psi": "heading"}).part(5.0, 9.0)


def test_two_boots_in_a_file_are_two_logs_with_currents_of_their_own(tmp_path, sailed):
    columns = {"time": sailed.times, **sailed.columns}
    twice = {name: np.append(values, values[:200]) for name, values in columns.items()}
    path = written(tmp_path / "a.csv", twice)
    given = scenario()
    logs = logs_of(path, LogFile(file="a.csv", delay=0.0), given)
    assert [log.name for log in logs] == ["a.csv, boot 1", "a.csv, boot 2"]
    numbers = [number.name for number in FitProblem(given, given.identify, logs).numbers]
    assert len(numbers) == len(set(numbers))
    assert "its clock steps back from 89.8 to 0 s" in logs[0].warnings[0]
    alone = written(tmp_path / "b.csv", columns)
    (whole,) = logs_of(alone, LogFile(file="b.csv", delay=0.0), given)
    assert logs[0].record.rows == pytest.approx(whole.record.rows)
    late = logs_of(path, LogFile(file="a.csv", delay=0.0, span=(50.0, 80.0)), given)
    assert [log.name for log in late] == ["a.csv from 50 to 80 s, boot 1"]


def test_a_log_that_is_too_short_or_lacks_its_commands(sailed):
    with pytest.raises(LogFault, match="has 10 values of the pose, at least 20"):
        log_of(sailed.part(0.0, 2.0), Ideal(), 0.05)
    bare = {n: c for n, c in sailed.columns.items() if n != "tau_r"}
    with pytest.raises(LogFault, match="the log has no column for tau_r"):
        log_of(replace(sailed, columns=bare), Ideal(), 0.05)


def test_two_parts_of_a_file_are_two_logs_with_currents_of_their_own(tmp_path, sailed):
    path = written(tmp_path / "a.csv", {"time": sailed.times, **sailed.columns})
    parts = [LogFile(file="a.csv", span=span, delay=0.0) for span in ((0.0, 40.0), (40.0, 89.0))]
    given = scenario()
    logs = [log for part in parts for log in logs_of(path, part, given)]
    numbers = [number.name for number in FitProblem(given, given.identify, logs).numbers]
    assert len(numbers) == len(set(numbers))
    assert "current_x, a.csv from 40 to 89 s" in numbers
    times = np.concatenate([log.times for log in logs])
    assert np.all(np.isin(sailed.times[:445].round(6), times.round(6)))


def test_a_quantity_that_nothing_is_made_of_is_an_error(tmp_path, sailed):
    path = written(tmp_path / "a.csv", {"time": sailed.times, **sailed.columns})
    with pytest.raises(UsageError, match=r"identify.columns: 'n_1' is no quantity .* \(taken: lat"):
        logs_of(path, LogFile(file="a.csv"), scenario(columns={"n_1": "tau_u"}))
    with pytest.raises(UsageError, match="did you mean 'psi'"):
        logs_of(path, LogFile(file="a.csv"), scenario(columns={"psi_": "psi"}))


def test_all_logs_for_judging():
    with pytest.raises(ValueError, match="all logs are for judging"):
        Identify(logs=(LogFile(file="a.csv", role="judge"),))


# Commands


@pytest.mark.parametrize(("every", "count"), [(1, 0), (2, 0), (4, 1)])
def test_rows_that_are_long_beside_a_lag_are_doubted(tmp_path, sailed, every, count):
    """Rows of 0.1, 0.2 and 0.4 s, and propellers with a lag of 0.1 s."""
    times = np.arange(0.0, 60.0, 0.1)[::every]
    columns = {n: np.interp(times, sailed.times, c) for n, c in sailed.columns.items()}
    columns |= {"n_1": 10.0 + np.sin(times), "n_2": 10.0 - np.sin(times)}
    del columns["tau_u"], columns["tau_r"]
    path = written(
        tmp_path / "a.csv", {"time": times, **columns, "delta_1": 0 * times, "delta_2": 0 * times}
    )
    pods = load(
        "podusv:trials/base.yaml",
        [
            "vessel={preset: cybership2}",
            "actuator={kind: pod, preset: cybership2_pod}",
            "controller={kind: pid}",
        ],
    ).scenario.model_copy(update={"identify": Identify(logs=LOGS)})
    (log,) = logs_of(path, LogFile(file="a.csv", delay=0.0), pods)
    said = [line for line in log.warnings if "s apart, and the actuator's shortest lag is" in line]
    assert len(said) == count


def later(table, delay):
    """The log with its commands acting so much later."""
    at = np.maximum(np.searchsorted(table.times, table.times - delay + 1e-9, "right") - 1, 0)
    moved = {n: hold_values(table.columns[n])[at] for n in ("tau_u", "tau_r")}
    return replace(table, columns={**table.columns, **moved})


@pytest.mark.long
def test_commands_that_act_two_seconds_later_are_found_and_said(tmp_path, sailed):
    assert Clocks(scenario(), sailed).delay() == (0.0, [])
    early = later(sailed, -2.0)
    path = written(tmp_path / "a.csv", {"time": early.times, **early.columns})
    (log,) = logs_of(path, LogFile(file="a.csv"), scenario())
    assert "its commands act 2.00 s later than it says" in log.warnings[0]
    moved = log_of(early, Ideal(), 0.05, 2.0).record.rows
    assert log.record.rows == pytest.approx(moved, abs=0.1)
    (given,) = logs_of(path, LogFile(file="a.csv", delay=2.0), scenario())
    assert given.record.rows == pytest.approx(moved)
    assert given.warnings == ()


def test_a_delay_is_looked_for_where_the_boat_turns(sailed):
    moored = np.arange(-1000.0, 0.0, 0.5)
    columns = {
        n: np.concatenate([np.full(len(moored), c[0]), c]) for n, c in sailed.columns.items()
    }
    long = LogTable("long.csv", np.concatenate([moored, sailed.times]), columns)
    assert Clocks(scenario(), long).part.times[-1] == sailed.times[-1]


def test_port_and_starboard_exchanged(sailed):
    turned = replace(sailed, columns={**sailed.columns, "tau_r": -sailed.columns["tau_r"]})
    with pytest.raises(LogFault, match=r"turns against its commands.*Exchange the columns of port"):
        Clocks(scenario(), turned).delay()


@pytest.mark.long
def test_a_whole_log_counted_to_port_is_found_by_its_commands(tmp_path, sailed):
    c = sailed.columns
    enu = {
        "time": sailed.times,
        "x": c["y"],
        "y": c["x"],
        "psi": math.pi / 2 - c["psi"],
        "r": -c["r"],
    }
    path = written(tmp_path / "enu.csv", enu | {n: c[n] for n in ("tau_u", "tau_r")})
    with pytest.raises(LogFault, match=r"identify\.frame: enu"):
        logs_of(path, LogFile(file="enu.csv"), scenario())
    enu["tau_r"] = -c["tau_r"]
    path = written(tmp_path / "enu.csv", enu | {"tau_u": c["tau_u"]})
    (log,) = logs_of(path, LogFile(file="enu.csv"), scenario(frame="enu"))
    assert log.warnings == ()
    assert log.record.rows == pytest.approx(log_of(sailed, Ideal(), 0.05).record.rows)


@pytest.mark.long
def test_a_hull_ten_times_too_heavy_is_doubted(sailed):
    inertia = {"m": 10.0 * HULL.m, "I_z": 10.0 * HULL.I_z, "X_udot": 10.0 * HULL.X_udot}
    heavy = HULL.changed({**inertia, "Y_vdot": 10.0 * HULL.Y_vdot, "N_rdot": 10.0 * HULL.N_rdot})
    wanted = {"draws": 2, "prior": 0.3}
    for hull, far in ((HULL, False), (heavy, True)):
        given = scenario(hull, **wanted)
        logs = [(log_of(sailed, Ideal(), 0.05), "fit")]
        lines = far_words(answer_logs(given, given.identify, logs, None))
        assert bool(lines) is far
    assert "Is the vessel's preset of another size" in lines[0]


# What columns may be


def test_what_is_doubtful_reaches_terminal_and_report(podusv, tmp_path, sailed):
    """A log of degrees ends before the fit; with its unit it is fitted, and its gap is said."""
    kept = sailed.where((sailed.times < 40.0) | (sailed.times >= 46.0))
    columns = {"time": kept.times, **kept.columns, "psi": np.degrees(kept.columns["psi"])}
    written(tmp_path / "log.csv", columns)
    (tmp_path / "boat.yaml").write_text(
        "extends: podusv:trials/base.yaml\nvessel: {preset: cybership2}\n"
        "actuator: {kind: ideal}\ncontroller: {kind: pid}\n"
        "identify:\n  logs: [{file: log.csv}]\n  free: [inertia]\n  draws: 2\n"
    )
    said = podusv("identify", "boat.yaml", "--out", "hull", "--no-figures")
    assert said.code == 2
    assert 'write psi: "COLUMN [deg]" under identify.columns' in said.err
    unit = "identify.columns={psi: 'psi [deg]'}"
    said = podusv("identify", "boat.yaml", "--out", "hull", "--no-figures", "--set", unit)
    line = "has 1 gap, the longest of 6.2 s at 39.8 s; it is taken as 2 logs"
    assert said.code == 0
    assert line in " ".join(said.err.split())
    assert line in (tmp_path / "hull/report.html").read_text()


def test_all_logs_are_looked_at_before_one_of_them_ends_the_command(podusv, tmp_path, sailed):
    columns = {"time": sailed.times, **sailed.columns}
    written(tmp_path / "deg.csv", columns | {"psi": np.degrees(sailed.columns["psi"])})
    written(tmp_path / "short.csv", {name: column[:30] for name, column in columns.items()})
    (tmp_path / "boat.yaml").write_text(
        "extends: podusv:trials/base.yaml\nvessel: {preset: cybership2}\n"
        "actuator: {kind: ideal}\ncontroller: {kind: pid}\nidentify:\n"
        "  logs: [{file: deg.csv}, {file: none.csv}, {file: short.csv, span: [0, 2]}]\n"
    )
    said = podusv("identify", "boat.yaml", "--out", "hull")
    assert said.code == 2
    assert 'write psi: "COLUMN [deg]"' in said.err
    assert "none.csv: there is no such file" in said.err
    assert "short.csv from 0 to 2 s: has 10 values of the pose" in said.err
    assert len([line for line in said.err.splitlines() if "warning" not in line]) == 3
    assert not (tmp_path / "hull").exists()


@pytest.mark.long
def test_a_log_for_judging_is_not_moved_by_what_all_of_it_says(tmp_path, sailed):
    early = later(sailed, -2.0)
    path = written(tmp_path / "a.csv", {"time": early.times, **early.columns})
    (log,) = logs_of(path, LogFile(file="a.csv", role="judge"), scenario())
    assert log.record.rows == pytest.approx(log_of(early, Ideal(), 0.05).record.rows)
    assert "A log for judging stays as it is" in log.warnings[0]


# Headings that no course agrees with

WRONG_HEADINGS = {
    "random": lambda psi: np.random.default_rng(1).uniform(-3.0, 3.0, len(psi)),
    "a tenth": lambda psi: psi / 10.0,
    "in turns": lambda psi: psi / (2.0 * math.pi),
    "another column": lambda psi: np.sin(np.arange(len(psi)) / 17.0),
}
OTHER_UNITS = {
    "hundredths of a degree": (
        lambda psi: np.round(100.0 * DEG * psi) % 36000.0,
        r'psi: "COLUMN \[1e-2 deg\]"',
    ),
    "hundredths of a degree as degrees": (
        lambda psi: np.round(100.0 * DEG * psi) % 36000.0 / DEG,
        r'psi: "COLUMN \[1e-2 deg\]"',
    ),
    "radians as degrees": (lambda psi: psi / DEG, r'write psi: "COLUMN \[rad\]"'),
}


def pose_alone(log):
    return replace(log, columns={name: log.columns[name] for name in ("x", "y", "psi")})


@pytest.mark.parametrize("wrong", WRONG_HEADINGS)
def test_a_heading_that_no_course_agrees_with_is_doubted(weaving, wrong):
    log = pose_alone(weaving)
    assert check_log(log) == []
    psi = WRONG_HEADINGS[wrong](log.columns["psi"])
    lines = check_log(replace(log, columns={**log.columns, "psi": psi}))
    said = [re.search(r"course and heading agree to (0\.\d\d) of 1; look at", x) for x in lines]
    assert float(next(filter(None, said))[1]) < 0.9


@pytest.mark.parametrize("unit", OTHER_UNITS)
def test_a_heading_in_another_unit_is_an_error_that_names_it(weaving, unit):
    change, sentence = OTHER_UNITS[unit]
    log = pose_alone(weaving)
    psi = change(log.columns["psi"])
    with pytest.raises(LogFault, match=sentence):
        check_log(replace(log, columns={**log.columns, "psi": psi}))


@pytest.mark.parametrize("rate", [1, 5, 10])
@pytest.mark.parametrize("noise", [0.02, 1.0])
@pytest.mark.parametrize("current", [0.0, 0.3 - 0.2j, 1.2j])
@pytest.mark.parametrize("through", [1.0, 0.3, -0.5, 0.5j, 0.4 + 0.3j])
def test_a_boat_that_drifts_or_goes_sideways_or_slowly_has_a_sound_heading(
    rate, noise, current, through
):
    """By algebra; `through` is the velocity through the water, ahead and to starboard."""
    times = np.arange(0.0, 140.0, 1.0 / rate)
    psi = 0.1 * times
    noises = noise * np.random.default_rng(4).standard_normal((2, len(times)))
    place = through * np.exp(1j * psi) / 0.1j + current * times + noises[0] + 1j * noises[1]
    lines = check_log(LogTable("drift.csv", times, {"x": place.real, "y": place.imag, "psi": psi}))
    assert not [line for line in lines if "course and heading" in line]
