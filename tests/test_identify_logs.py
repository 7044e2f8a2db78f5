"""Logs on their way into a fit: formats, frames, clocks, and the mistakes of people with logs."""

from __future__ import annotations

import json
import math
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from log_files import write_bag, write_dataflash, write_ulog
from test_identify import HULL, SCENARIO, commands_of, motion, table_of

from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.core.errors import UsageError
from podusv_cli.core.signal import STATE, TAU
from podusv_cli.identify.checks import checked
from podusv_cli.identify.commands import acted, later
from podusv_cli.identify.formats import LogFault, columns_of
from podusv_cli.identify.frames import LAT, LON, local_plane, radii
from podusv_cli.identify.intake import logs_of, pieces
from podusv_cli.identify.listing import listing
from podusv_cli.identify.march import DELIVERED, HOLDS, VALUES
from podusv_cli.identify.offsets import Clocks
from podusv_cli.identify.phrases import far_words
from podusv_cli.identify.problem import Problem
from podusv_cli.identify.reading import Named, Table, table
from podusv_cli.identify.records import log_of
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.load import load
from podusv_cli.workflows.identify import answered

WANTED = (*STATE, *TAU)
LOGS = (LogFile(file="a.csv"),)


def written(path, columns):
    """A CSV file of columns by name; NaN is an empty cell."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join("" if x != x else repr(float(x)) for x in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path


def read(path, columns=None, frame="ned"):
    return table(path, WANTED, Named(columns or {}, frame))


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
    return Table("boat.csv", times, columns | {"tau_u": 0 * times, "tau_r": np.sin(times)})


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


def test_a_ros_bag_gives_its_topics_by_their_stamps(tmp_path):
    columns = columns_of(write_bag(tmp_path / "bag"))
    assert columns["boat/odom.time"][:3] == pytest.approx([-0.005, 0.095, 0.195])
    assert columns["boat/odom.pose.pose.position.y"][:3].tolist() == [0.0, 3.0, 6.0]
    assert columns["boat/odom.pose.pose.orientation.yaw"][:3] == pytest.approx([0.0, 0.1, 0.2])
    assert columns["left.time"][:3] == pytest.approx([0.0, 0.25, 0.5])
    assert not any("covariance" in name for name in columns)
    assert columns_of(next((tmp_path / "bag").glob("*.db3"))).keys() == columns.keys()


def test_odometry_of_ros_comes_in_podusvs_frame_and_at_the_times_of_every_topic(tmp_path):
    odometry = "boat/odom.pose.pose"
    names = {
        "x": f"{odometry}.position.x", "y": f"{odometry}.position.y",
        "psi": f"{odometry}.orientation.yaw", "v": "boat/odom.twist.twist.linear.y",
        "tau_u": "left.data [kN]",
    }  # fmt: skip
    log = read(write_bag(tmp_path / "bag"), names, "enu")
    assert log.times[:4] == pytest.approx([-0.005, 0.0, 0.095, 0.195])
    assert len(log.times) == 25 + 10
    poses = log.times != log.times[1]
    assert log.columns["x"][[0, 2, 3]].tolist() == [0.0, 3.0, 6.0]  # north is y of ROS
    assert log.columns["psi"][[0, 2]] == pytest.approx([math.pi / 2, math.pi / 2 - 0.1])
    assert log.columns["v"][0] == -0.25
    assert np.isnan(log.columns["x"][1])
    assert log.columns["tau_u"][1] == 0.0
    assert np.isnan(log.columns["tau_u"][0])
    assert poses.sum() == 34


def test_a_px4_log_gives_messages_receivers_and_yaw(tmp_path):
    columns = columns_of(write_ulog(tmp_path / "flight.ulg"))
    assert columns["vehicle_attitude.time"][:2] == pytest.approx([2.0, 2.1])
    assert columns["vehicle_attitude.q.yaw"][:3] == pytest.approx([0.0, 0.1, 0.2], abs=1e-6)
    assert columns["gps_1.lat"][0] - columns["gps.lat"][0] == 1.0


def test_an_ardupilot_log_becomes_a_track_in_metres(tmp_path):
    path = write_dataflash(tmp_path / "00000001.BIN")
    log = read(path, {"psi": "ATT.Yaw [deg]", "lat": "GPS.Lat", "lon": "GPS.Lng"})
    assert log.times[:3] == pytest.approx([0.0, 0.02, 0.1])
    heading = log.columns["psi"][np.isfinite(log.columns["psi"])]
    assert np.degrees(heading[[0, 9, 10]]) == pytest.approx([350.0, 359.0, 0.0])
    x = log.columns["x"][np.isfinite(log.columns["x"])]
    # A degree of latitude at 59 deg is 111.39 km, of longitude 57.47 km (tables of WGS 84).
    assert x[1] == pytest.approx(18e-6 * 111_392.0, rel=1e-4)
    assert "latitude 59.0000000, longitude 10.0000000" in log.notes[0]


@pytest.mark.parametrize(
    ("ending", "library"), [("mcap", "rosbags"), ("ulg", "pyulog"), ("bin", "pymavlink")]
)
def test_without_the_extra_a_sentence_names_it(tmp_path, monkeypatch, ending, library):
    (tmp_path / f"log.{ending}").write_bytes(b"")
    for name in ("rosbags", "rosbags.highlevel", "pyulog", "pymavlink", "pymavlink.DFReader"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(Exception, match=f"needs {library}: pip install 'podusv\\[logs\\]'"):
        columns_of(tmp_path / f"log.{ending}")


def test_damaged_and_unknown_files_are_sentences(tmp_path):
    (tmp_path / "log.ulg").write_bytes(b"no log")
    with pytest.raises(LogFault, match=r"log\.ulg: cannot be read: "):
        columns_of(tmp_path / "log.ulg")
    (tmp_path / "log.xlsx").write_bytes(b"")
    with pytest.raises(LogFault, match=r"\.csv, .*or the folder of a ROS 2 bag"):
        columns_of(tmp_path / "log.xlsx")


# Units, frames and clocks


def test_a_column_may_have_units_in_brackets_another_sign_and_dates_for_times(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(
        "when,north (ft),q[0],q[1],east\n"
        "2026-05-04T10:00:00Z,10,1,7,0\n2026-05-04T10:00:00.5Z,20,2,8,1\n"
    )
    log = read(path, {"time": "when", "x": "north", "psi": "-q[1] [deg]", "y": "east"})
    assert np.diff(log.times) == pytest.approx([0.5])
    assert log.columns["x"] == pytest.approx([3.048, 6.096])
    assert np.degrees(log.columns["psi"]) == pytest.approx([-7.0, -8.0])


@pytest.mark.parametrize(
    "text",
    ["t;x\n0;1,5\n1;2,5\n", "t\tx\n0\t1.5\n1\t2.5\n", "\ufeff# made by hand\nt x\n0 1.5\n1 2.5\n"],
)
def test_separators_and_decimal_commas(tmp_path, text):
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    assert columns_of(tmp_path / "log.csv")["x"].tolist() == [1.5, 2.5]


def test_the_local_plane_is_that_of_the_ellipsoid():
    """Against the earth-centred algebra of the same ellipsoid, and tables of a degree's length."""
    a, e2 = 6378137.0, 0.00669437999014

    def across_at(lat):
        return a / math.sqrt(1.0 - e2 * math.sin(lat) ** 2)

    def centred(lat, lon):
        n = across_at(lat)
        c = math.cos(lat)
        z = n * (1.0 - e2) * math.sin(lat)
        return np.array([n * c * math.cos(lon), n * c * math.sin(lon), z])

    lat, lon = math.radians(59.91), math.radians(10.72)
    d = centred(lat + 4e-5, lon + 6e-5) - centred(lat, lon)
    sin, cos, e, f = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    north, east = np.array([-sin * f, -sin * e, cos]) @ d, np.array([-e, f, 0.0]) @ d
    places = {
        "lat": np.degrees([lat, lat + 4e-5]), "lon": np.degrees([lon, lon + 6e-5])
    }  # fmt: skip
    flat, _ = local_plane(places)
    # 255 m north meridians are nearer to each other: 13 mm of the 192 m east.
    nearer = across_at(lat) * sin * 4e-5 * 6e-5
    assert flat["x"][1] == pytest.approx(north, abs=0.01)
    assert flat["y"][1] - nearer == pytest.approx(east, abs=1e-4)
    along, across = radii(math.radians(45.0))
    assert math.radians(along) == pytest.approx(111_131.8, abs=0.3)
    assert math.radians(across) * math.cos(math.radians(45.0)) == pytest.approx(78_846.8, abs=0.3)


def test_the_plane_goes_over_the_date_line_and_leaves_out_rows_without_a_fix():
    flat, notes = local_plane(
        {LAT.name: np.array([0.0, -17.0, -17.0]), LON.name: np.array([0.0, 179.9999, -179.9999])}
    )
    assert np.isnan(flat["x"][0])
    assert flat["y"][2] == pytest.approx(2e-4 * 106_450.0, rel=1e-3)
    assert "1 rows without a fix" in notes[0]


def test_latitude_stays_north_where_all_else_is_east_north_up(tmp_path):
    path = written(
        tmp_path / "log.csv",
        {"time": [0, 1], "lat": [59.0, 59.001], "lon": [10.0, 10.0], "psi": [0.5, 0.5]},
    )
    log = read(path, frame="enu")
    assert log.columns["x"][1] == pytest.approx(111.39, abs=0.01)
    assert log.columns["psi"][0] == pytest.approx(math.pi / 2 - 0.5)


def test_a_log_of_a_date_is_the_log_from_zero(sailed):
    own = log_of(sailed, Ideal(), 0.05)
    dated = log_of(replace(sailed, times=sailed.times + 1.7e9), Ideal(), 0.05)
    assert dated.record.rows == pytest.approx(own.record.rows, abs=1e-5)


def test_headings_may_wrap(sailed):
    wrapped = np.mod(sailed.columns["psi"], 2.0 * math.pi)
    assert np.any(np.abs(np.diff(wrapped)) > 3.0)
    turned = replace(sailed, columns={**sailed.columns, "psi": wrapped})
    assert checked(turned, Ideal()) == checked(sailed, Ideal()) == []
    assert log_of(turned, Ideal(), 0.05).state[3:] == pytest.approx(
        log_of(sailed, Ideal(), 0.05).state[3:]
    )


def test_sensors_of_rates_that_do_not_divide_deliver_what_they_measured(tmp_path):
    """Positions at 3 Hz, headings at 7 Hz, commands at 10 Hz, each with its own clock."""
    clocks = {"gps": np.arange(0, 30, 1 / 3), "imu": np.arange(0, 30, 1 / 7)}
    commands = np.arange(0, 30, 0.1)
    columns = {
        "gps.time": clocks["gps"], "gps.x": clocks["gps"], "gps.y": -clocks["gps"],
        "imu.time": clocks["imu"], "imu.psi": np.sin(clocks["imu"]),
        "time": commands, "tau_u": np.floor(commands), "tau_r": 0 * commands,
    }  # fmt: skip
    longest = max(map(len, columns.values()))
    full = {n: np.append(v, np.full(longest - len(v), np.nan)) for n, v in columns.items()}
    path = written(tmp_path / "log.csv", full)
    log = log_of(read(path, {"x": "gps.x", "y": "gps.y", "psi": "imu.psi"}), Ideal(), 0.05)
    rows = log.record.rows
    assert log.counts[:3].tolist() == [90, 90, 210]
    given = rows[:, DELIVERED + 2] != 0
    assert rows[given, VALUES + 2] == pytest.approx(np.sin(log.times[given]))
    assert rows[:, HOLDS].sum() == pytest.approx(log.duration)


def test_a_sensor_that_is_held_between_its_values_counts_once(weaving):
    held = np.repeat(weaving.columns["x"][::5], 5)
    log = log_of(replace(weaving, columns={**weaving.columns, "x": held}), Ideal(), 0.05)
    assert log.counts[:2].tolist() == [120, 600]


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
        {"psi": lambda c: c["psi"] * DEG % 360.0}, r'write psi: "COLUMN \[deg\]"'
    ),
    "heading to port": ({"psi": lambda c: -c["psi"]}, r'write psi: "-COLUMN"'),
    "heading from the east": (
        {"psi": lambda c: math.pi / 2 - c["psi"]}, "psi is counted from the east"
    ),
    "ENU for NED, with a compass": (
        {"x": lambda c: c["y"], "y": lambda c: c["x"]}, "exchange x and y under identify.columns"
    ),
    "yaw rate in deg/s": ({"r": lambda c: c["r"] * DEG}, r'write r: "COLUMN \[deg/s\]"'),
    "yaw rate to port": ({"r": lambda c: -c["r"]}, r'r is -1.04 .*write r: "-COLUMN"'),
    "speed in knots": ({"u": lambda c: c["u"] / 0.514444}, r'u is 1\.9\d .*"COLUMN \[kn\]"'),
    "sway to port": ({"v": lambda c: -c["v"]}, r'write v: "-COLUMN"'),
    "a compass that stands": ({"psi": lambda c: 0 * c["psi"] + 0.7}, "psi is 0.7 throughout"),
    "a compass of zeros": ({"psi": lambda c: 0 * c["psi"]}, "psi is 0 throughout while"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_what_no_motion_explains_is_an_error_that_says_what_to_write(weaving, mistake):
    changes, sentence = MISTAKES[mistake]
    assert checked(weaving, Ideal()) == []
    changed = {name: change(weaving.columns) for name, change in changes.items()}
    with pytest.raises(LogFault, match=f"(?s)boat.csv: .*{sentence}"):
        checked(replace(weaving, columns={**weaving.columns, **changed}), Ideal())


def test_a_compass_that_is_mounted_backwards_is_said_with_what_follows_from_it(weaving):
    given = {**weaving.columns, "psi": weaving.columns["psi"] + math.pi}
    with pytest.raises(LogFault, match=r"u is -1.02 .* also, the boat moves -?1\d\d deg off"):
        checked(replace(weaving, columns=given), Ideal())
    given.pop("u"), given.pop("v")
    lines = checked(replace(weaving, columns=given), Ideal())
    assert "deg off its heading on average; check that x is north" in lines[0]


def test_a_boat_that_yaws_in_waves_on_a_straight_track_is_no_mistake():
    times = np.arange(0.0, 120.0, 0.1)
    noise = 0.01 * np.random.default_rng(2).standard_normal((2, len(times)))
    columns = {
        "x": 1.5 * times + noise[0], "y": 0.1 * times + noise[1],
        "psi": 0.4 * np.sin(1.3 * times), "tau_u": np.sin(times),
    }  # fmt: skip
    assert checked(Table("waves.csv", times, columns), Ideal()) == []


def test_times_in_milliseconds(weaving):
    with pytest.raises(LogFault, match=r'100 s apart.* write time: "COLUMN \[ms\]"'):
        checked(replace(weaving, times=1e3 * weaving.times), Ideal())


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
    assert [line for line in checked(given, Ideal()) if sentence in line]


def test_a_position_that_jumps_is_a_warning(weaving):
    x = weaving.columns["x"] + np.where(weaving.times < 30.0, 0.0, 40.0)
    (line,) = checked(replace(weaving, columns={**weaving.columns, "x": x}), Ideal())
    jump = re.search(r"jumps at 29\.5 s \(a speed of (.*?) m/s", line)
    assert float(jump[1]) == pytest.approx(40.0 / 2.0, abs=1.5)  # over two bins of a second


def test_a_straight_run_at_one_speed_tells_little():
    times = np.arange(0.0, 60.0, 0.2)
    noise = np.random.default_rng(1).standard_normal((3, len(times))) * 0.005
    columns = {"x": times + noise[0], "y": noise[1], "psi": noise[2], "tau_u": 0 * times + 1.0}
    lines = checked(Table("straight.csv", times, columns), Ideal())
    assert any("tells the drag at one speed and little else; zig-zags" in line for line in lines)


def test_a_propeller_in_rpm_is_told_by_what_the_pods_can_do(weaving):
    actuator = load(
        "podusv:trials/base.yaml", ["vessel={preset: otter}", "controller={kind: pid}"]
    ).scenario.actuator
    most = actuator.reach["n_1"]
    given = {**weaving.columns, "n_1": 50.0 * most * np.abs(np.sin(weaving.times))}
    with pytest.raises(LogFault, match=r'n_1 reaches .* write n_1: "COLUMN \[rpm\]"'):
        checked(replace(weaving, columns=given), actuator)


# Mistakes that the table shows


def test_rows_twice_and_rows_without_a_time_are_left_out(tmp_path):
    path = written(
        tmp_path / "log.csv",
        {"time": [0, 1, 1, np.nan, 2], "x": [0, 1, 1, 5, 2], "y": [0, 0, 0, 0, 0]},
    )
    log = read(path)
    assert log.times.tolist() == [0.0, 1.0, 2.0]
    assert "1 rows are there twice" in " ".join(log.warnings)
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


def test_a_log_that_is_too_short_or_lacks_its_commands(sailed):
    with pytest.raises(LogFault, match="has 11 values of the pose, at least 20"):
        log_of(sailed.part(0.0, 2.0), Ideal(), 0.05)
    bare = {n: c for n, c in sailed.columns.items() if n != "tau_r"}
    with pytest.raises(LogFault, match="nothing is known of tau_r"):
        log_of(replace(sailed, columns=bare), Ideal(), 0.05)


def test_two_parts_of_a_file_are_two_logs_with_currents_of_their_own(tmp_path, sailed):
    path = written(tmp_path / "a.csv", {"time": sailed.times, **sailed.columns})
    parts = [LogFile(file="a.csv", span=span, delay=0.0) for span in ((0.0, 40.0), (40.2, 89.0))]
    given = scenario()
    logs = [log for part in parts for log in logs_of(path, part, given)]
    numbers = [number.name for number in Problem(given, given.identify, logs).numbers]
    assert len(numbers) == len(set(numbers))
    assert "current_x, a.csv from 40.2 to 89 s" in numbers


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


def test_what_pods_did_follows_from_their_commands():
    """A step goes as 1 - exp(-t / T); an angle turns no faster than its limit."""
    pods = (
        "{x: -0.5, T_nn: 0.01, T_nn_astern: 0.01, n_max: 100, n_max_astern: 50, n_rate: 1e6, "
        "n_lag: 0.5, angle_limit: 1.5, angle_rate: 0.25, angle_lag: 0.1}"
    )
    actuator = load(
        "podusv:trials/base.yaml",
        [
            "vessel={preset: cybership2}",
            "controller={kind: pid}",
            f"actuator={{kind: pod, pods: [{pods}]}}",
        ],
    ).scenario.actuator
    times = np.arange(0.0, 4.0, 0.1)
    ordered = {
        "n_cmd_1": np.where(times < 1.0, 0.0, 10.0),
        "delta_cmd_1": np.where(times < 1.0, 0.0, 0.5),
    }
    log = acted(Table("a.csv", times, ordered), actuator)
    after = np.maximum(times - 1.0, 0.0)
    assert log.columns["n_1"] == pytest.approx(10.0 * (1.0 - np.exp(-after / 0.5)), abs=0.15)
    turning = (after > 0.0) & (after < 1.8)
    assert log.columns["delta_1"][turning] == pytest.approx(0.25 * after[turning], abs=1e-9)
    assert "n_1, delta_1 follow from commands" in log.notes[0]
    own = replace(log, notes=())
    assert acted(own, actuator) is own


def test_commands_that_act_two_seconds_later_are_found_and_said(tmp_path, sailed):
    assert Clocks(scenario(), sailed).delay() == (0.0, [])
    early = later(sailed, Ideal(), -2.0)
    path = written(tmp_path / "a.csv", {"time": early.times, **early.columns})
    (log,) = logs_of(path, LogFile(file="a.csv"), scenario())
    assert "its commands act 2.00 s later than it says" in log.warnings[0]
    moved = log_of(later(early, Ideal(), 2.0), Ideal(), 0.05).record.rows
    assert log.record.rows == pytest.approx(moved)
    (given,) = logs_of(path, LogFile(file="a.csv", delay=2.0), scenario())
    assert given.record.rows == pytest.approx(moved)
    assert given.warnings == ()


def test_a_delay_is_looked_for_where_the_boat_turns(sailed):
    moored = np.arange(-1000.0, 0.0, 0.5)
    columns = {
        n: np.concatenate([np.full(len(moored), c[0]), c]) for n, c in sailed.columns.items()
    }
    long = Table("long.csv", np.concatenate([moored, sailed.times]), columns)
    assert Clocks(scenario(), long).part.times[-1] == sailed.times[-1]


def test_port_and_starboard_exchanged(sailed):
    turned = replace(sailed, columns={**sailed.columns, "tau_r": -sailed.columns["tau_r"]})
    with pytest.raises(LogFault, match=r"turns against its commands.*Exchange the columns of port"):
        Clocks(scenario(), turned).delay()


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


def test_a_hull_ten_times_too_heavy_is_doubted(sailed):
    inertia = {"m": 10.0 * HULL.m, "I_z": 10.0 * HULL.I_z, "X_udot": 10.0 * HULL.X_udot}
    heavy = HULL.changed({**inertia, "Y_vdot": 10.0 * HULL.Y_vdot, "N_rdot": 10.0 * HULL.N_rdot})
    wanted = {"draws": 2, "prior": 0.3}
    for hull, far in ((HULL, False), (heavy, True)):
        given = scenario(hull, **wanted)
        logs = [(log_of(sailed, Ideal(), 0.05), "fit")]
        lines = far_words(answered(given, given.identify, logs, None))
        assert bool(lines) is far
    assert "Is the vessel's preset of another size" in lines[0]


# What columns may be


def test_columns_are_listed_with_rate_range_and_a_guess(tmp_path):
    times = np.arange(0.0, 20.0, 0.1)
    columns = {
        "TimeUS": 1e6 * times, "Lat": 59.0 + 1e-6 * times, "Lng": 10.0 + 0 * times,
        "Heading": (10.0 * times + 300.0) % 360.0, "gyro_z_dps": 10.0 + 0 * times,
        "rpm_left": 900.0 + times, "rpm_right": 800.0 + times, "rudder": 20.0 * np.sin(times),
        "battery": np.where(times < 5.0, np.nan, 12.0 + 0.001 * times),
    }  # fmt: skip
    found = listing(written(tmp_path / "log.csv", columns))
    guesses = {listed.name: listed.guess for listed in found.columns}
    assert guesses == {
        "TimeUS": "time [us]", "Lat": "lat", "Lng": "lon", "Heading": "psi [deg]",
        "gyro_z_dps": "r [deg/s]", "rpm_left": "n_1 [rpm]", "rpm_right": "n_2 [rpm]",
        "rudder": "delta_1 [deg]", "battery": "",
    }  # fmt: skip
    heading, battery = found.columns[3], found.columns[-1]
    assert heading.rate == pytest.approx(200 / 19.9)
    assert (heading.least, heading.most) == (columns["Heading"].min(), columns["Heading"].max())
    assert battery.missing == pytest.approx(0.25)
    assert found.mapping()[4] == '  psi: "Heading [deg]"'
    assert found.mapping()[-1] == "  # columns not guessed: battery"


@pytest.mark.parametrize(
    "sides",
    [
        ("n left [rpm]", "n right [rpm]"), ("port [rpm]", "starboard [rpm]"), ("left", "right"),
        ("thruster left [rpm]", "thruster right [rpm]"), ("n_port", "n_stbd"),
    ],
)  # fmt: skip
def test_sides_and_blanks_are_guessed(tmp_path, sides):
    """As another simulator writes them; a rudder's side is no propeller."""
    ramp = np.arange(0.0, 2.0, 0.1)
    names = ("time", "north", "east", "heading [deg]", "yaw rate [deg/s]", *sides, "rudder left")
    found = listing(written(tmp_path / "log.csv", dict.fromkeys(names, ramp)))
    assert [own.quantity for own in found.columns] == [
        "time", "x", "y", "psi", "r", "n_1", "n_2", "delta_1"
    ]  # fmt: skip
    assert not any("#" in line for line in found.mapping())


def test_what_a_log_needs_and_nothing_is_guessed_for_stands_in_the_mapping(tmp_path):
    ramp = np.arange(0.0, 2.0, 0.1)
    columns = {"time": ramp, "north": ramp, "east": ramp, "way": ramp, "fan": ramp}
    lines = listing(written(tmp_path / "log.csv", columns)).mapping()
    assert lines[-3:] == [
        "  # psi: ?   (not guessed; see podusv docs identify)",
        "  # n_1: ?   (not guessed; see podusv docs identify)",
        "  # columns not guessed: way, fan",
    ]
    assert yaml.safe_load("\n".join(lines)) == {
        "columns": {"time": "time", "x": "north", "y": "east"}
    }


def test_the_command_lists_columns_without_a_scenario(podusv, tmp_path):
    written(tmp_path / "log.csv", {"t": [0.0, 0.5], "heading": [350.0, 10.0]})
    said = podusv("identify", "--columns", "log.csv")
    assert said.code == 0
    assert "heading" in said.out
    assert '    psi: "heading [deg]"\n    # x: ?' in said.out
    listed = json.loads(podusv("identify", "--columns", "log.csv", "--json").out)
    assert listed["columns"][1]["unit"] == "deg"
    assert podusv("identify", "--columns", "none.csv").err == "none.csv: there is no such file\n"
    assert "CONFIG is missing" in podusv("identify").err


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


def test_what_is_guessed_of_a_ros_bag_can_be_pasted(tmp_path):
    found = listing(write_bag(tmp_path / "bag"))
    assert found.mapping()[-1].startswith("frame: enu")
    section = yaml.safe_load("\n".join(found.mapping()))
    log = read(tmp_path / "bag", section["columns"], section["frame"])
    assert {"x", "y", "psi", "u", "v", "r"} <= log.columns.keys()


def test_a_log_for_judging_is_not_moved_by_what_all_of_it_says(tmp_path, sailed):
    early = later(sailed, Ideal(), -2.0)
    path = written(tmp_path / "a.csv", {"time": early.times, **early.columns})
    (log,) = logs_of(path, LogFile(file="a.csv", role="judge"), scenario())
    assert log.record.rows == pytest.approx(log_of(early, Ideal(), 0.05).record.rows)
    assert "A log for judging stays as it is" in log.warnings[0]
