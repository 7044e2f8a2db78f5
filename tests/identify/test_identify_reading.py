"""Logs of all formats: read into one table of named quantities, and their columns listed."""

from __future__ import annotations

import json
import math
import sys

import numpy as np
import pytest
import yaml
from log_files import read, write_bag, write_dataflash, write_ulog, written

from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.core.earth import LAT, LON
from podusv_cli.core.signal import Signal
from podusv_cli.identify.fit.march import DELIVERED, HOLDS, VALUES
from podusv_cli.identify.fit.records import complete, log_of
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.formats import columns_of
from podusv_cli.identify.logs.frames import local_plane
from podusv_cli.identify.logs.listing import listing
from podusv_cli.identify.logs.reading import LogTable, NamedQuantities, delivered_each, table


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
        "x": f"{odometry}.position.x",
        "y": f"{odometry}.position.y",
        "psi": f"{odometry}.orientation.yaw",
        "v": "boat/odom.twist.twist.linear.y",
        "tau_u": "left.data [kN]",
    }
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


def test_propellers_may_be_in_turns_a_second_or_a_minute_and_in_radians(tmp_path):
    path = written(
        tmp_path / "log.csv",
        {"time": [0, 1], "n_1 [rps]": [3, 4], "n_2 [rpm]": [180, 60], "n_3 [rad/s]": [math.pi, 0]},
    )
    speeds = [Signal(f"n_{i}", "1/s", "") for i in (1, 2, 3)]
    log = table(path, speeds, NamedQuantities())
    assert log.columns["n_1"].tolist() == [3.0, 4.0]
    assert log.columns["n_2"].tolist() == [3.0, 1.0]
    assert log.columns["n_3"] == pytest.approx([0.5, 0.0])


@pytest.mark.parametrize(
    "text",
    ["t;x\n0;1,5\n1;2,5\n", "t\tx\n0\t1.5\n1\t2.5\n", "\ufeff# made by hand\nt x\n0 1.5\n1 2.5\n"],
)
def test_separators_and_decimal_commas(tmp_path, text):
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    assert columns_of(tmp_path / "log.csv")["x"].tolist() == [1.5, 2.5]


def test_the_plane_goes_over_the_date_line_and_leaves_out_rows_without_a_fix():
    flat, notes = local_plane(
        {LAT.name: np.array([0.0, -17.0, -17.0]), LON.name: np.array([0.0, 179.9999, -179.9999])},
        None,
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


def test_sensors_of_rates_that_do_not_divide_deliver_what_they_measured(tmp_path):
    """Positions at 3 Hz, headings at 7 Hz, commands at 10 Hz, each with its own clock."""
    clocks = {"gps": np.arange(0, 30, 1 / 3), "imu": np.arange(0, 30, 1 / 7)}
    commands = np.arange(0, 30, 0.1)
    columns = {
        "gps.time": clocks["gps"],
        "gps.x": clocks["gps"],
        "gps.y": -clocks["gps"],
        "imu.time": clocks["imu"],
        "imu.psi": np.sin(clocks["imu"]),
        "time": commands,
        "tau_u": np.floor(commands),
        "tau_r": 0 * commands,
    }
    longest = max(map(len, columns.values()))
    full = {n: np.append(v, np.full(longest - len(v), np.nan)) for n, v in columns.items()}
    path = written(tmp_path / "log.csv", full)
    log = log_of(read(path, {"x": "gps.x", "y": "gps.y", "psi": "imu.psi"}), Ideal(), 0.05)
    rows = log.record.rows
    assert log.counts[:3].tolist() == [90, 90, 210]
    given = rows[:, DELIVERED + 2] != 0
    assert rows[given, VALUES + 2] == pytest.approx(np.sin(log.times[given]))
    assert rows[:, HOLDS].sum() == pytest.approx(log.duration)


def test_columns_are_listed_with_rate_range_and_a_guess(tmp_path):
    times = np.arange(0.0, 20.0, 0.1)
    columns = {
        "TimeUS": 1e6 * times,
        "Lat": 59.0 + 1e-6 * times,
        "Lng": 10.0 + 0 * times,
        "Heading": (10.0 * times + 300.0) % 360.0,
        "gyro_z_dps": 10.0 + 0 * times,
        "rpm_left": 900.0 + times,
        "rpm_right": 800.0 + times,
        "rudder": 20.0 * np.sin(times),
        "battery": np.where(times < 5.0, np.nan, 12.0 + 0.001 * times),
    }
    found = listing(written(tmp_path / "log.csv", columns))
    guesses = {listed.name: listed.guess for listed in found.columns}
    assert guesses == {
        "TimeUS": "time [us]",
        "Lat": "lat",
        "Lng": "lon",
        "Heading": "psi [deg]",
        "gyro_z_dps": "r [deg/s]",
        "rpm_left": "n_1 [rpm]",
        "rpm_right": "n_2 [rpm]",
        "rudder": "delta_1 [deg]",
        "battery": "",
    }
    heading, battery = found.columns[3], found.columns[-1]
    assert heading.rate == pytest.approx(200 / 19.9)
    assert (heading.least, heading.most) == (columns["Heading"].min(), columns["Heading"].max())
    assert battery.missing == pytest.approx(0.25)
    assert found.mapping()[4] == '  psi: "Heading [deg]"'
    assert found.mapping()[-1] == "  # columns not guessed: battery"


@pytest.mark.parametrize(
    "sides",
    [
        ("n left [rpm]", "n right [rpm]"),
        ("port [rpm]", "starboard [rpm]"),
        ("left", "right"),
        ("thruster left [rpm]", "thruster right [rpm]"),
        ("n_port", "n_stbd"),
    ],
)
def test_sides_and_blanks_are_guessed(tmp_path, sides):
    """As another simulator writes them; a rudder's side is no propeller."""
    ramp = np.arange(0.0, 2.0, 0.1)
    names = ("time", "north", "east", "heading [deg]", "yaw rate [deg/s]", *sides, "rudder left")
    found = listing(written(tmp_path / "log.csv", dict.fromkeys(names, ramp)))
    assert [own.quantity for own in found.columns] == [
        "time",
        "x",
        "y",
        "psi",
        "r",
        "n_1",
        "n_2",
        "delta_1",
    ]
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
    said = podusv("identify", "log.csv")
    assert said.code == 2
    assert said.err == (
        "log.csv is a log; CONFIG is a scenario that names logs, as `podusv init identify/otter` "
        "copies one. `podusv identify --columns log.csv` lists its columns\n"
    )


def test_what_is_guessed_of_a_ros_bag_can_be_pasted(tmp_path):
    found = listing(write_bag(tmp_path / "bag"))
    assert found.mapping()[-1].startswith("frame: enu")
    section = yaml.safe_load("\n".join(found.mapping()))
    log = read(tmp_path / "bag", section["columns"], section["frame"])
    assert {"x", "y", "psi", "u", "v", "r"} <= log.columns.keys()


@pytest.mark.parametrize("along", ["x", "y"])
def test_positions_count_together_where_a_boat_goes_along_an_axis(along):
    """To 1 cm; across its way a value stays for 2.5 s, as that of a slow sensor would."""
    times = np.arange(0.0, 40.0, 0.1)
    columns = dict.fromkeys(("x", "y"), np.round(0.004 * times, 2))
    columns |= {along: np.round(0.93 * times, 2), "psi": 0.01 * np.sin(times)}
    columns |= {"tau_u": 0.1 * times, "tau_r": 0.0 * times}
    log = LogTable("east.csv", times, columns)
    complete(log, Ideal())
    assert log_of(log, Ideal(), 0.1).counts[:3].tolist() == [400, 400, 400]


def test_a_position_of_which_half_is_missing_counts_for_the_other_half():
    x, y = np.arange(30.0), 2.0 * np.arange(30.0)
    x[3:7], y[20] = np.nan, np.nan
    new = delivered_each({"x": x, "y": y, "r": np.full(30, np.nan)})
    assert np.flatnonzero(~new["x"]).tolist() == [3, 4, 5, 6]
    assert np.flatnonzero(~new["y"]).tolist() == [20]
    assert not new["r"].any()
    apart = delivered_each({"x": x[:3], "y": np.full(3, np.nan)})
    assert apart["x"].all()


def test_columns_of_a_german_logger_are_guessed(tmp_path):
    text = "Zeit [ms];Breite;Länge;Kurs;Steuerkurs\n"
    rows = [f"{100 * i};59,{1000 + i};10,{1000 + i};{30 + i};{33 + i}\n" for i in range(30)]
    (tmp_path / "log.csv").write_text(text + "".join(rows), encoding="utf-8")
    found = {column.quantity: column.name for column in listing(tmp_path / "log.csv").columns}
    assert found.pop("") == "Kurs"  # over ground, which is no heading
    names = {"time": "Zeit [ms]", "lat": "Breite", "lon": "Länge", "psi": "Steuerkurs"}
    assert found == names


@pytest.mark.parametrize("second", ["", ",stamp"])
def test_clock_times_are_not_proposed_as_time(tmp_path, second):
    rows = [f"2026-05-04,12:03:{i:02d},59.1,10.1,{i}" for i in range(30)]
    rows = [f"{row},{i}" if second else row for i, row in enumerate(rows)]
    head = f"Date,Time,lat,lon,hdg{second}"
    (tmp_path / "log.csv").write_text("\n".join([head, *rows, ""]))
    found = listing(tmp_path / "log.csv")
    clock = [column.name for column in found.columns if column.quantity == "time"]
    assert clock == (["stamp"] if second else [])
    assert ("  # time: ?   (not guessed; see podusv docs identify)" in found.mapping()) != bool(
        clock
    )
    (line,) = found.warnings
    assert "'Time' is not taken for time: it has clock times such as '12:03:00'" in line
