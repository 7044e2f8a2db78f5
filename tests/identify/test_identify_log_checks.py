"""Mistakes in a log that its motion alone shows, and sound logs beside them that show none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from log_files import read, written

from podusv_cli.identify.logs.checks import check_log
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.reading import LogTable

TIMES = np.arange(0.0, 120.0, 0.2)
HEADINGS = {
    "circle": 0.4 + 0.11 * TIMES,
    "zigzag": 0.4 + 1.3 * np.sin(0.07 * TIMES),
    "figure of eight": 0.4 + 4.5 * np.sin(0.05 * TIMES),
}
STRAIGHT = {"short zigzag": 0.4 + 0.35 * np.sin(0.07 * TIMES)}
SWAYED = {
    "calm": (1.0, 0.0, 0.0),
    "drift": (1.0, 0.3, 0.0),
    "crab": (1.0, 0.0, 0.6),
    "half its speed against it": (1.0, -0.6 * np.exp(0.4j), 0.0),
    "a current beyond its speed": (1.0, 0.5 + 1.5j, -0.2),
    "astern now and then": (np.where(np.sin(0.09 * TIMES) > 0.3, -0.5, 1.0), 0.1j, 0.0),
    "a spin on the spot": (np.where((TIMES > 40.0) & (TIMES < 70.0), 0.0, 1.0), 0.0, 0.0),
}


def sailed(heading, swayed, noise=0.02):
    """A boat of 1.2 m/s through the water, in a current, at a steady angle to its heading."""
    speed, current, leeway = SWAYED[swayed]
    psi = (HEADINGS | STRAIGHT)[heading]
    velocity = 1.2 * speed * np.exp(1j * (psi + leeway)) + current
    places = np.cumsum(velocity) * 0.2
    rng = np.random.default_rng(len(heading) + len(swayed))
    x, y = (axis + noise * rng.normal(size=len(psi)) for axis in (places.real, places.imag))
    return LogTable("boat.csv", TIMES, {"x": x, "y": y, "psi": psi})


@pytest.mark.parametrize("swayed", SWAYED)
@pytest.mark.parametrize("heading", [*HEADINGS, *STRAIGHT])
def test_a_sound_heading_is_no_half_one(heading, swayed):
    lines = check_log(sailed(heading, swayed))
    assert not any("twice as far as psi" in line for line in lines)


@pytest.mark.parametrize("swayed", ["calm", "drift", "crab"])
@pytest.mark.parametrize("heading", HEADINGS)
def test_a_heading_that_turns_half_as_far_as_the_course_is_doubted(heading, swayed):
    log = sailed(heading, swayed)
    halved = replace(log, columns={**log.columns, "psi": 0.5 * log.columns["psi"]})
    wrapped = replace(
        log, columns={**log.columns, "psi": 0.5 * (log.columns["psi"] % (2.0 * math.pi))}
    )
    for wrong in (halved, wrapped):
        *_, line = check_log(wrong)  # before it one on jumps, where it is wrapped
        assert "the track's course turns twice as far as psi" in line
        assert line.endswith("if psi is half the heading; double its column.")


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_heading_of_the_other_sign_is_refused_in_drift_too(heading):
    log = sailed(heading, "drift")
    with pytest.raises(LogFault, match=r'write psi: "-COLUMN"'):
        check_log(replace(log, columns={**log.columns, "psi": -log.columns["psi"]}))


# Latitude and longitude as degrees and minutes in one number


def as_one_number(degrees):
    """ddmm.mmmm, as NMEA 0183 has it."""
    return np.floor(degrees) * 100.0 + (degrees % 1.0) * 60.0


def fixes(speed, lat=0.61, lon=0.4):
    """Times, latitude and longitude [deg], heading of a boat that weaves."""
    psi = 0.3 + 0.8 * np.sin(0.06 * TIMES)
    north, east = (np.cumsum(speed * part(psi)) * 0.2 for part in (np.cos, np.sin))
    return {
        "time": TIMES,
        "lat": lat + north / 110_574.0,
        "lon": lon + east / 111_320.0,
        "psi": psi,
    }


@pytest.mark.parametrize("speed", [0.5, 1.3, 6.0])
@pytest.mark.parametrize("has_u", [True, False])
def test_degrees_and_minutes_below_90_are_named(tmp_path, speed, has_u):
    right = fixes(speed) | ({"u": 0.0 * TIMES + speed} if has_u else {})
    log = read(written(tmp_path / "log.csv", right))
    assert check_log(log) == []
    wrong = right | {name: as_one_number(right[name]) for name in ("lat", "lon")}
    log = read(written(tmp_path / "log.csv", wrong))
    says = r"m/s by latitude and longitude.*degrees and minutes, ddmm\.mmmm\? Convert it"
    if not has_u and speed < 1.0:  # 30 m/s, which some boats make
        (line,) = check_log(log)
        assert "ddmm.mmmm" in line
        return
    with pytest.raises(LogFault, match=says):
        check_log(log)


def test_a_fast_boat_at_a_place_that_may_be_minutes_is_none(tmp_path):
    """43 N, 7 E: 43 and 7 are below 60. Its own u says that it makes 25 m/s."""
    fast = fixes(25.0, 43.2, 7.1) | {"u": 0.0 * TIMES + 25.0}
    assert not any("ddmm" in line for line in check_log(read(written(tmp_path / "log.csv", fast))))
    slow = fixes(2.0, 43.2, 7.1)
    assert check_log(read(written(tmp_path / "log.csv", slow))) == []
