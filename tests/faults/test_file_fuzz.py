"""Damaged files of boats: sentences, telemetry, MATLAB, routes, parameters; never silent, no trace.

What is read of a damaged file is of the undamaged one, or a sentence says that something is wrong.
A changed digit of a format without checksums is a number like any other: it is left out here.
"""

from __future__ import annotations

import json
import random
from functools import partial

import numpy as np
import pytest
from counts import count
from log_files import sentences, write_tlog
from scipy.io import savemat

from podusv_cli.components.actuators.thrust_table import of_file
from podusv_cli.components.controllers.parameter_files import of_ardupilot
from podusv_cli.core.errors import PodusvError
from podusv_cli.identify.logs.formats import contents_of
from podusv_cli.scenario.load import load_text

EACH = count(30, 1000)  # files of a format
NOISE = b"\x00\xff\n,;:<>{}[]()*$#\"'eE-+. x"


def damaged(content, seed):
    """A file that ends early, has odd letters, lacks a piece, or has one twice."""
    rng, data = random.Random(seed), bytearray(content)
    at = rng.randrange(len(data))
    length = rng.randint(1, 60)
    if seed % 4 == 0:
        del data[at:]
    elif seed % 4 == 1:
        for _ in range(rng.randint(1, 12)):
            data[rng.randrange(len(data))] = NOISE[rng.randrange(len(NOISE))]
    elif seed % 4 == 2:
        del data[at : at + length]
    else:
        data[at:at] = data[at : at + length]
    return bytes(data)


def outcome(read):
    """What a reader gives, and what it says instead; other errors are tracebacks of a user."""
    try:
        return read(), ""
    except (PodusvError, ValueError) as error:
        return None, str(error)


def values_of(columns):
    """The numbers of a log by column, but for times."""
    return {
        name: set(values[np.isfinite(values)].tolist())
        for name, values in columns.items()
        if not name.endswith(".time")
    }


def test_of_damaged_sentences_only_whole_ones_are_read(tmp_path, capfd):
    path, whole = tmp_path / "log.nmea", "\r\n".join([*sentences(120), ""]).encode()
    path.write_bytes(whole)
    good = values_of(contents_of(path).columns)
    for seed in range(EACH):
        path.write_bytes(damaged(whole, seed))
        read, said = outcome(lambda: contents_of(path))
        assert "\n" not in said, (seed, said)
        if read is None:
            continue
        values = values_of(read.columns)
        wrong = {name for name, own in values.items() if own - good.get(name, set())}
        lost = sum(map(len, good.values())) - sum(map(len, values.values()))
        assert not wrong or read.warnings, (seed, wrong)
        whole_lines = {*path.read_bytes().splitlines()} <= {*whole.splitlines()}
        assert not lost or whole_lines or seed % 4 == 0 or read.warnings, (seed, lost)
    printed = capfd.readouterr()
    assert printed.out + printed.err == ""


def made_mat(path):
    t = 0.1 * np.arange(80)
    content = {"t": t, "x": t, "y": np.sin(t), "boat": {"psi": 0.1 * t, "n": np.vstack([t, -t])}}
    savemat(path, content, do_compression=True)
    return path


@pytest.mark.parametrize(("name", "make"), [("log.mat", made_mat), ("log.tlog", write_tlog)])
@pytest.mark.filterwarnings("error", "default::pytest.PytestUnraisableExceptionWarning")
def test_damaged_binary_logs_are_read_or_refused(tmp_path, capfd, name, make):
    """Both have checksums: of what is whole every number is one of the undamaged file."""
    path = make(tmp_path / name)
    whole = path.read_bytes()
    good = {column: set(values.tolist()) for column, values in contents_of(path).columns.items()}
    for seed in range(EACH):
        rng, content = random.Random(seed), bytearray(damaged(whole, seed))
        if seed % 2 and content:
            content[rng.randrange(len(content))] = rng.randrange(256)
        path.write_bytes(content)
        read, said = outcome(lambda: contents_of(path))
        assert "\n" not in said, (seed, said)
        if read is None or read.warnings:
            continue
        clocks = name.endswith(".tlog")
        for column, values in read.columns.items():
            strange = set(values[np.isfinite(values)].tolist()) - good.get(column, set())
            assert not strange or (clocks and column.endswith(".time")), (seed, column, strange)
    printed = capfd.readouterr()
    assert printed.out + printed.err == ""


PLACES = [(63.43 + 0.001 * i, 10.4 + 0.002 * i) for i in range(9)]
ITEM = {"type": "SimpleItem", "frame": 3, "command": 16}
PLAN = {
    "fileType": "Plan",
    "mission": {"items": [{**ITEM, "params": [0, 0, 0, None, *place, 0]} for place in PLACES]},
}
ROUTES = {
    "plan": json.dumps(PLAN, indent=1),
    "wpl": "QGC WPL 110\n"
    + "".join(f"{i}\t0\t3\t16\t0\t0\t0\t0\t{a}\t{b}\t0\t1\n" for i, (a, b) in enumerate(PLACES)),
    "gpx": '<gpx xmlns="http://www.topografix.com/GPX/1/1"><rte>'
    + "".join(f'<rtept lat="{a}" lon="{b}"/>\n' for a, b in PLACES)
    + "</rte></gpx>",
    "kml": "<kml><Placemark><LineString><coordinates>"
    + "\n".join(f"{b},{a},0" for a, b in PLACES)
    + "</coordinates></LineString></Placemark></kml>",
    "geojson": json.dumps(
        {"type": "LineString", "coordinates": [[b, a] for a, b in PLACES]}, indent=1
    ),
    "moos": "points = pts={" + ": ".join(f"{10 * i},{7 * i}" for i in range(9)) + "}\n",
    "csv": "lat,lon\n" + "".join(f"{a},{b}\n" for a, b in PLACES),
}


@pytest.mark.parametrize("form", ROUTES)
def test_a_damaged_route_is_read_or_told(tmp_path, form):
    text = (
        "name: boat\nvessel: {preset: otter}\nactuator: {kind: ideal}\ndisturbance: {kind: none}\n"
        "path: {kind: legs, file: route}\ncontroller: {kind: los_pid}\n"
    )
    for seed in range(-(-EACH // len(ROUTES))):
        (tmp_path / "route").write_bytes(damaged(ROUTES[form].encode(), seed))
        read, said = outcome(lambda: load_text(text, str(tmp_path / "boat.yaml")))
        assert read or said, seed
        assert "Traceback" not in said
        if read:
            points = np.array(read.scenario.path.waypoints())
            assert np.isfinite(points).all(), seed


PARAMETERS = "".join(
    f"{name},{value}\n"
    for name, value in (
        *(("ATC_SPEED_P", 0.31), ("ATC_SPEED_I", 0.22), ("ATC_STR_RAT_FF", 0.35)),
        *(("CRUISE_SPEED", 1.6), ("CRUISE_THROTTLE", 40), ("PSC_POS_P", 0.3)),
        *((f"SERVO{i}_FUNCTION", i) for i in range(1, 17)),
    )
)
TABLE = "pwm [us],thrust [kgf]\n" + "".join(
    f"{us},{0.01 * (us - 1500) if abs(us - 1500) > 25 else 0:.3f}\n" for us in range(1100, 1901, 25)
)


@pytest.mark.parametrize(
    ("read", "text"), [(of_ardupilot, PARAMETERS), (of_file, TABLE)], ids=["parameters", "table"]
)
def test_damaged_rows_of_parameters_and_thrust_are_told(read, text):
    """A key is one of the undamaged file, or the file is refused; digits that are lost are not."""
    whole = values_by_name(read(text, ())[0])
    for seed in range(EACH):
        content = damaged(text.encode(), seed).decode("utf-8", "replace")
        found, said = outcome(partial(read, content, ()))
        assert "\n" not in said, (seed, said)
        assert found or said, seed
        if found and seed % 4 == 1:  # odd letters: a separator or sign in place of a digit
            strange = {k for k, v in values_by_name(found[0]).items() if v != whole.get(k)}
            assert not strange or found[1] or set(strange) <= {*whole, "table"}, (seed, strange)


def values_by_name(keys):
    return {name: str(content) for name, content in keys.items()}
