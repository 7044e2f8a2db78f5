"""The rules by which logs are read: cells, decimal commas, names, ranges, clocks, damaged files."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
import yaml
from log_files import read, write_bag, write_dataflash, write_ulog, written
from scipy.spatial.transform import Rotation
from test_units import WORTH

from podusv_cli.core.signal import Signal
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.formats import READERS, columns_of, contents_of
from podusv_cli.identify.logs.listing import listing
from podusv_cli.identify.logs.ranges import without_none
from podusv_cli.identify.logs.reading import OF_LOGS, UNITS, NamedQuantities, table, tables


def contents(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode(encoding))
    return contents_of(path)


# Cells and names


def test_a_comma_at_the_end_of_each_row_is_no_column(tmp_path):
    read = contents(tmp_path, "t,x\n0,1.5,\n1,2.5,\n2,3.5,\n")
    assert {name: values.tolist() for name, values in read.columns.items()} == {
        "t": [0.0, 1.0, 2.0],
        "x": [1.5, 2.5, 3.5],
    }
    assert read.warnings == ()
    assert read.doubts == {}


def test_a_surplus_cell_with_something_in_it_is_refused(tmp_path):
    with pytest.raises(LogFault, match=r"2 of 2 lines .* line 2 has 3 cells, and there are 2 n"):
        contents(tmp_path, "t,x\n0,1.5,7\n1,2.5,7\n")
    with pytest.raises(LogFault, match="decimal commas need a semicolon between cells"):
        contents(tmp_path, "t,x\n0,5,1,5\n1,5,2,5\n")


def test_a_few_broken_rows_are_left_out_and_counted(tmp_path):
    rows = [f"{i},{i}.5" for i in range(60)]
    rows[7], rows[30] = "7", "\0" * 20
    read = contents(tmp_path, "\n".join(["t,x", *rows, ""]))
    assert read.columns["t"].tolist() == [i for i in range(60) if i not in (7, 30)]
    assert read.warnings == (
        "2 lines are left out for the number of cells: line 9 has 1 cell, and there are 2 names",
    )


def test_a_decimal_comma_beside_a_bad_cell_keeps_its_fraction(tmp_path):
    read = contents(tmp_path, "t;x;mode\n0;1,5;AUTO\n1;-;AUTO, far\n2;0,56;\n3;7;AUTO\n")
    assert read.columns["x"].tolist()[::2] == [1.5, 0.56]
    assert math.isnan(read.columns["x"][1])
    assert read.columns["x"][3] == 7.0
    assert read.doubts["x"] == "has 1 cell that is no number, the first '-' in line 3"


def test_a_point_among_decimal_commas_is_no_number(tmp_path):
    read = contents(tmp_path, "t;x\n0;1,5\n1;1.000\n2;2,5\n3;3,5\n")
    assert math.isnan(read.columns["x"][1])
    assert "the first '1.000' in line 3" in read.doubts["x"]


def test_marks_of_thousands_are_no_decimal_commas(tmp_path):
    with pytest.raises(LogFault, match="'12,500' may be thousands or have a decimal comma"):
        contents(tmp_path, "t;x\n0;12,500\n1;13,000\n")
    read = contents(tmp_path, "t\tx\n0\t12,500\n1\t999.5\n2\t998.5\n")
    assert math.isnan(read.columns["x"][0])
    assert read.columns["x"][1:].tolist() == [999.5, 998.5]
    assert contents(tmp_path, "t;x\n0;0,500\n1;13,000\n").columns["x"].tolist() == [0.5, 13.0]


@pytest.mark.parametrize("cell", ["inf", "-Infinity", "1e999", "1_0", "0x10", "\u0663", "1,5"])
def test_what_python_takes_for_a_number_is_none_in_a_log(tmp_path, cell):
    read = contents(tmp_path, f't,x\n0,1.5\n1,"{cell}"\n2,3.5\n')
    assert read.columns["x"].tolist()[::2] == [1.5, 3.5]
    assert math.isnan(read.columns["x"][1])
    assert "1 cell that is no number" in read.doubts["x"]


def test_empty_cells_are_no_doubt(tmp_path):
    read = contents(tmp_path, "t,x\n0,1.5\n1,\n2,NaN\n3,null\n")
    assert np.isnan(read.columns["x"]).tolist() == [False, True, True, True]
    assert not read.doubts


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("0,1.5,2\n1,2.5,3\n", "has numbers and no names"),
        ("t, x,x \n0,1,2\n1,2,3\n", "calls 2 columns 'x'"),
        ("$GPRMC,0,A\n$GNHDT,1,T\n", "has no sentence with a clock"),
        ("", "names no columns"),
        (",,\n1,2,3\n", "names no columns"),
    ],
)
def test_a_first_line_that_gives_no_names(tmp_path, text, says):
    with pytest.raises(LogFault, match=says):
        contents(tmp_path, text)


def test_utf_16_says_so_with_a_mark(tmp_path):
    text = "t,x\n0,1.5\n1,2.5\n"
    assert contents(tmp_path, text, "utf-16").columns["x"].tolist() == [1.5, 2.5]
    with pytest.raises(LogFault, match="is it UTF-16 without a mark"):
        contents(tmp_path, text, "utf-16-le")


def test_a_last_line_without_an_end_may_be_cut(tmp_path):
    read = contents(tmp_path, "t,x\n0,1.5\n1,2.5\n2,3")
    assert read.columns["t"].tolist() == [0.0, 1.0]
    assert "its last line (4) has no line end and may be cut" in read.warnings[0]


def test_a_column_without_a_name_has_its_number(tmp_path):
    assert [*contents(tmp_path, ",x,\n0,1,\n1,2,\n").columns] == ["column 1", "x"]


# What columns are


def test_a_needed_column_without_numbers_is_an_error(tmp_path):
    columns = {"time": [0, 1, 2], "x": [0, 1, 2], "y": [0, 0, 0], "psi": [0, 0, 0]}
    nothing = [math.nan] * 3
    for name in ("x", "psi", "time", "tau_u"):
        path = written(tmp_path / "log.csv", {**columns, name: nothing})
        with pytest.raises(LogFault, match=f"log.csv: {name} has no numbers"):
            read(path)
    assert np.isnan(
        read(written(tmp_path / "log.csv", {**columns, "u": nothing})).columns["u"]
    ).all()


def test_two_columns_that_may_be_one_quantity_are_named(tmp_path):
    path = written(tmp_path / "log.csv", {"time": [0, 1], "x [m]": [0, 1], "x [ft]": [0, 3]})
    with pytest.raises(LogFault, match=r"x may be any of x \[m\], x \[ft\]; say which"):
        read(path)
    assert read(path, {"x": "x [ft]"}).columns["x"].tolist() == [0.0, pytest.approx(0.9144)]


def test_every_unit_of_the_table_is_read_in_a_log(tmp_path):
    of_logs = {
        "rad": 180.0 / math.pi,
        "1e-7 deg": 1e-7,
        "deg": 1.0,
        "rad/s": 0.5 / math.pi,
        "1e-2 deg": math.pi / 18000.0,
        "1e-6 deg": 1e-6,
    }
    read_ones = 0
    for unit, others in UNITS.items():
        for name in others.keys() - {unit}:
            path = written(tmp_path / "log.csv", {"time": [0, 1], f"q [{name}]": [3.0, 30.0]})
            log = table(path, [Signal("q", unit, "")], NamedQuantities())
            worth = of_logs[name] if name in OF_LOGS.get(unit, {}) else WORTH[name]
            assert log.columns["q"] == pytest.approx([3.0 * worth, 30.0 * worth], rel=1e-14)
            read_ones += 1
    assert read_ones >= len(WORTH) + 3


@pytest.mark.parametrize(
    ("lat", "lon", "says"),
    [
        (4330.0, 1042.0, "latitude 4330 is beyond 90 deg; is it in NMEA's degrees and minutes"),
        (-90.5, 10.0, "latitude -90.5 is beyond 90 deg; write degrees from -90 to 90"),
        (43.0, 360.5, "longitude 360.5 is beyond 180 deg"),
        (43.0, -180.5, "longitude -180.5 is beyond 180 deg"),
        (590000000, 100000000, r"latitude 590000000 .*write lat: \"COLUMN \[1e-7 deg\]\" under"),
        (30.0, 10342.5, "longitude 10342.5 is beyond 180 deg; is it in NMEA's"),
    ],
)
def test_places_are_on_earth(tmp_path, lat, lon, says):
    columns = {"time": np.arange(30), "lat": np.full(30, lat), "lon": np.full(30, lon)}
    with pytest.raises(LogFault, match=f"^log.csv: {says}"):
        read(written(tmp_path / "log.csv", columns))


def test_a_single_place_beyond_the_earth_is_left_out(tmp_path):
    lat = np.full(30, 59.0)
    lat[7] = 590.0
    columns = {"time": np.arange(30), "lat": lat, "lon": 10.0 + 1e-5 * np.arange(30)}
    log = read(written(tmp_path / "log.csv", columns))
    assert np.flatnonzero(np.isnan(log.columns["x"])).tolist() == [7]
    assert "lat is out of range once: latitude 590 is beyond 90 deg" in log.warnings[0]


@pytest.mark.parametrize("value", [65535.0, 655.35, 511.0, -32768.0, 9999.0, 214.7483647])
def test_a_word_for_no_value_is_left_out_and_counted(value):
    values = np.linspace(-3.0, 3.0, 40)
    values[[3, 9]] = value
    left, says = without_none(values)
    assert np.flatnonzero(np.isnan(left)).tolist() == [3, 9]
    assert says == f"is {value:.10g} 2 times, which stands for no value and is left out"


def test_a_value_among_others_is_a_value():
    near = np.linspace(400.0, 600.0, 201)
    near[100] = 511.0
    for values in (near, np.full(5, 999.0), np.linspace(0.0, 511.0, 512), np.full(3, np.nan)):
        left, says = without_none(values)
        assert np.array_equal(left, values, equal_nan=True)
        assert says == ""


# Clocks


def test_rows_of_one_time_fill_each_other_s_empty_cells(tmp_path):
    nan = math.nan
    path = written(
        tmp_path / "log.csv",
        {
            "time": [0, 1, 1, 2, 2, 3],
            "x": [0, 1, nan, nan, 2, 3],
            "y": [0, nan, 5, 6, 6, 7],
            "psi": [0, 1, 1, nan, nan, 0],
        },
    )
    log = read(path)
    assert log.times.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert log.columns["x"].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert log.columns["y"].tolist() == [0.0, 5.0, 6.0, 7.0]
    assert np.isnan(log.columns["psi"][2])
    assert "2 rows have the time of the row before" in log.warnings[0]


def test_two_boots_are_two_tables(tmp_path):
    times = np.append(np.arange(0.0, 30.0, 0.5), np.arange(0.0, 20.0, 0.5))
    path = written(tmp_path / "log.csv", {"time": times, "x": times, "y": times, "psi": 0 * times})
    first, other = tables(path, (Signal("x", "m", ""),), NamedQuantities())
    assert [first.name, other.name] == ["log.csv, boot 1", "log.csv, boot 2"]
    assert [len(first.times), len(other.times)] == [60, 40]
    assert "steps back from 29.5 to 0 s; it is taken as 2 logs" in first.warnings[0]
    with pytest.raises(LogFault, match=r"after row 60 \(29.5 s, then 0 s\), as two boots"):
        read(path)


def test_a_clock_that_is_corrected_a_little_is_no_second_boot(tmp_path):
    times = np.append(np.arange(0.0, 30.0, 0.5), np.arange(29.0, 50.0, 0.5))
    with pytest.raises(LogFault, match="row 61 has an earlier time"):
        read(written(tmp_path / "log.csv", {"time": times, "x": times}))


def test_clock_times_are_named(tmp_path):
    (tmp_path / "log.csv").write_text("time,x\n12:03:04.5,1\n12:03:05.0,2\n")
    with pytest.raises(LogFault, match=r"time has no numbers; it has clock times such as '12:03:0"):
        read(tmp_path / "log.csv")


# Messages


def test_yaw_is_that_of_a_boat_that_rolls_and_pitches(tmp_path):
    """Against scipy's rotations: yaw, pitch, roll about axes that move."""
    yaw, pitch, roll = 0.1 * np.arange(20), 0.3, -0.4
    turns = Rotation.from_euler("ZYX", [(y, pitch, roll) for y in yaw])
    columns = columns_of(write_ulog(tmp_path / "log.ulg", turns))
    assert columns["vehicle_attitude.q.yaw"] == pytest.approx(yaw, abs=1e-6)
    columns = columns_of(write_bag(tmp_path / "bag", tilted=Rotation.from_euler("YX", [0.3, -0.4])))
    yaw = columns["boat/odom.pose.pose.orientation.yaw"]
    assert yaw == pytest.approx(0.1 * np.arange(25), abs=1e-6)


def test_stamps_of_a_simulation_s_clock_give_way_to_arrival(tmp_path):
    columns = columns_of(write_bag(tmp_path / "bag", stamped_from=12_500_000_000))
    assert columns["boat/odom.time"][:3] == pytest.approx([0.0, 0.1, 0.2])


def test_what_a_library_meets_inside_a_damaged_log_is_a_sentence(tmp_path):
    whole = write_ulog(tmp_path / "log.ulg").read_bytes()
    (tmp_path / "log.ulg").write_bytes(
        whole.replace(b"timestamp;float[4] q;", b"timestumb;float[4] q;")
    )
    with pytest.raises(LogFault, match=r"log.ulg: cannot be read: it is damaged \(KeyError: 'time"):
        contents_of(tmp_path / "log.ulg")
    whole = write_dataflash(tmp_path / "log.bin").read_bytes()
    (tmp_path / "log.bin").write_bytes(whole.replace(b"TimeUS", b"TimeXS"))
    with pytest.raises(LogFault, match=r"log.bin: holds no messages with numbers and times"):
        contents_of(tmp_path / "log.bin")


def test_what_a_library_prints_of_a_damaged_log_is_a_warning(tmp_path, capfd):
    whole = write_dataflash(tmp_path / "log.bin").read_bytes()
    (tmp_path / "log.bin").write_bytes(whole[:600] + b"\x13\x37" * 300 + whole[600:])
    assert (
        "it is damaged, and what is whole was read: "
        in contents_of(tmp_path / "log.bin").warnings[0]
    )
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("ending", READERS)
def test_a_pipe_or_a_device_is_no_log(tmp_path, ending):
    (tmp_path / f"log{ending}").symlink_to(os.devnull)
    with pytest.raises(LogFault, match="is a pipe or a device"):
        contents_of(tmp_path / f"log{ending}")


# The mapping that `--columns` prints


def test_names_with_quotes_are_yaml(tmp_path):
    (tmp_path / "log.csv").write_text(
        '"time ""s""";"he said ""x""";back\\slash.y;Größe "psi"\n0;1;2;3\n1;2;3;4\n'
    )
    found = listing(tmp_path / "log.csv")
    columns = yaml.safe_load("\n".join(found.mapping()))["columns"] or {}
    assert columns
    assert {*columns.values()} <= {own.name for own in found.columns}


def test_the_command_says_what_is_doubtful_about_a_log(podusv, tmp_path):
    (tmp_path / "log.csv").write_text("time,x,psi\n0,1,0\n1,oops,0\n2,3,0\n3,4,0\n")
    said = podusv("identify", "--columns", "log.csv")
    assert said.code == 0
    assert "warning: log.csv: 'x' has 1 cell that is no number, the first 'oops'" in said.err


# Longitudes from 0 to 360 deg, and what is proposed for places


@pytest.mark.parametrize("share", [0.0, 0.03, 0.5, 0.97, 1.0])
def test_longitudes_from_0_to_360_are_less_a_turn_beyond_180(tmp_path, share):
    """On both sides of Greenwich: so much of the log is west of it."""
    signed = (np.arange(200.0) - round(200 * share) + 0.5) * 1e-5
    columns = {"time": range(200), "lat": [48.0] * 200, "psi": [0.0] * 200}
    path = written(tmp_path / "log.csv", {**columns, "lon": signed % 360.0})
    wanted = table(written(tmp_path / "own.csv", {**columns, "lon": signed}), (), NamedQuantities())
    read = table(path, (), NamedQuantities())
    assert read.columns["y"] == pytest.approx(wanted.columns["y"], abs=1e-5)
    assert not read.warnings
    path = written(tmp_path / "log.csv", {**columns, "lon": (signed - 122.0) % 360.0})
    assert not table(path, (), NamedQuantities()).warnings


def test_a_single_longitude_beyond_180_elsewhere_is_left_out(tmp_path):
    lon = [16.0 + 1e-5 * i for i in range(60)]
    lon[20] = 211.0
    path = written(tmp_path / "log.csv", {"time": range(60), "lat": [48.0] * 60, "lon": lon})
    read = table(path, (), NamedQuantities())
    assert np.isnan(read.columns["y"]).sum() == 1
    assert "lon is out of range once: longitude 211 is beyond 180 deg" in read.warnings[0]


@pytest.mark.parametrize(
    ("lat", "lon", "proposed", "says"),
    [
        (435000000.0, 164000000.0, "[1e-7 deg]", ""),
        (43500000.0, 16400000.0, "", "write 1e-6 deg instead"),
        (4330.0015, 1624.0015, "", "is it in NMEA's degrees and minutes"),
        (43.5, 16.4, "plain", ""),
        (5000000.0, 1790000000.0, "[1e-7 deg]", ""),
    ],
)
def test_units_of_places_are_proposed_where_they_are_sure(tmp_path, lat, lon, proposed, says):
    path = written(
        tmp_path / "log.csv",
        {
            "time": range(30),
            "lat": [lat + (i if lat > 1e4 else 1e-4 * i) for i in range(30)],
            "lon": [lon + (i if lon > 1e4 else 1e-4 * i) for i in range(30)],
            "psi": [0.1] * 30,
        },
    )
    found = listing(path)
    lines = [line.strip() for line in found.mapping()]
    unit = {"plain": "", "": None}.get(proposed, f" {proposed}")
    assert (f'lat: "lat{unit}"' in lines) == (unit is not None)
    assert (unit is None) == any("'lat' is not taken for lat: " in x for x in found.warnings)
    assert says in " ".join(found.warnings)


def test_a_word_for_no_value_says_nothing_of_a_unit(tmp_path):
    psi = [-9999.0 if i % 9 == 4 else 0.1 * i for i in range(60)]
    path = written(tmp_path / "log.csv", {"time": range(60), "x": range(60), "psi": psi})
    assert '  psi: "psi"' in listing(path).mapping()


@pytest.mark.filterwarnings("error")
def test_a_clock_without_numbers_is_listed_without_a_warning_of_numpy(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,x\n12:00:00,1\n12:00:01,2\n12:00:02,3\n")
    assert [own.name for own in listing(path).columns] == ["time", "x"]


# Lines above the names


@pytest.mark.parametrize("above", ["sep=;\n", "SEP=;\r\n", '"sep=;"\n', "  # by me\n// and you\n"])
def test_what_stands_above_the_names_is_skipped(tmp_path, above):
    read = contents(tmp_path, f"{above}t;x\n0;1.5\n1;2.5\n")
    assert {name: values.tolist() for name, values in read.columns.items()} == {
        "t": [0.0, 1.0],
        "x": [1.5, 2.5],
    }
    read = contents(tmp_path, "sep=,\nt,x;y\n0,1.5\n1,2.5\n")
    assert [*read.columns] == ["t", "x;y"]


def test_bars_separate_cells(tmp_path):
    assert contents(tmp_path, "t | x\n0 | 1.5\n1 | 2.5\n").columns["x"].tolist() == [1.5, 2.5]


@pytest.mark.parametrize(
    ("above", "says"),
    [
        ("% by my logger", r"line 2 has .* line 1 was taken for the names, so if it is a title"),
        ("Boat log 2024-05-01", r"\(Boat, log, 2024-05-01\).*line 1 was taken for the names"),
        ("Log,2024,May", r"line 1 was taken for .*\(Log, 2024, May\), but line 2 looks like them"),
    ],
)
def test_a_title_that_is_taken_for_names_is_named(tmp_path, above, says):
    with pytest.raises(LogFault, match=says):
        contents(tmp_path, f"{above}\nt,x,y\n0,1.5,3\n1,2.5,4\n2,2.5,4\n")


def test_a_line_of_units_below_the_names_is_no_line_of_names(tmp_path):
    read = contents(tmp_path, "t,x\ns,m\n0,1.5\n1,2.5\n")
    assert read.doubts["x"] == "has 1 cell that is no number, the first 'm' in line 2"
