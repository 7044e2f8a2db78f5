"""A log is looked at before anything is fitted, and what it proposes is what the boat takes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from podusv_cli.identify.logs.contents import Contents
from podusv_cli.identify.logs.formats import contents_of
from podusv_cli.identify.logs.listing import list_contents
from podusv_cli.identify.look import drawn_signals, track_of
from podusv_cli.scenario.load import load_text

HEAD = "time [ms],lat,lon,heading [deg],left [%],right [%],rudder [deg],RCOU.C1,note\n"
BOAT = """
name: boat
vessel: {preset: otter}
actuator: ACTUATOR
path: {kind: line}
disturbance: {kind: none}
controller: {kind: pid}
simulation: {duration: 10.0}
"""
PARTS = """
  kind: pod
  counts: parts
  pods:
    - {x: 0, y: -0.4, table: [[0, 0], [1, 9]], n_rate: 4, n_lag: 0.1, angle_limit: 0}
    - {x: 0, y: 0.4, table: [[0, 0], [1, 9]], n_rate: 4, n_lag: 0.1, angle_limit: 0}
"""


@pytest.fixture
def log(tmp_path, monkeypatch):
    """Ten seconds to the north-east of a place in Norway."""
    monkeypatch.chdir(tmp_path)
    rows = [
        f"{100 * i},{63.4 + 1e-6 * i:.6f},{10.4 + 2e-6 * i:.6f},45,{30 + i % 7},40,{i % 5},1500,a"
        for i in range(100)
    ]
    Path("log.csv").write_text(HEAD + "\n".join([*rows, ""]))
    return Path("log.csv")


def proposed(log, actuator):
    """The mapping of a log for a boat with this actuator, by quantity."""
    scenario = load_text(BOAT.replace("ACTUATOR", actuator), "boat.yaml").scenario
    found = list_contents(contents_of(log), log.name, scenario.actuator)
    return {own.quantity: (own.name, own.unit) for own in found.columns if own.quantity}


def test_a_mapping_is_that_of_the_boat(log):
    by_parts = proposed(log, PARTS)
    assert by_parts["n_part_cmd_1"] == ("left [%]", "%")
    assert by_parts["n_part_cmd_2"] == ("right [%]", "%")
    assert not {"n_part_cmd_3", "delta_1"} & by_parts.keys()  # two thrusters that are fixed
    by_turns = proposed(log, "{kind: pod, preset: revolt}")
    assert "delta_1" in by_turns
    assert not {name for name in proposed(log, "{kind: ideal}") if name[0] in "nd"}


def test_numbers_up_to_100_are_percents_of_a_boat_that_counts_in_parts(tmp_path):
    rows = [f"{0.1 * i:g},0,0,0,{60 + i % 3},55" for i in range(50)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time,x,y,psi,left,right", *rows, ""]))
    assert proposed(path, PARTS)["n_part_cmd_1"] == ("left", "%")
    assert proposed(path, "{kind: pod, preset: otter}")["n_1"] == ("left", "")


def test_a_channel_that_drives_nothing_is_no_thruster():
    still, moving = np.full(50, 1500.0), np.linspace(1300.0, 1700.0, 50)
    found = list_contents(Contents({"RCOU.C1": still, "RCOU.C3": moving}), "a.bin")
    assert [own.quantity for own in found.columns] == ["", "n_part_cmd_1"]
    assert found.columns[1].unit == "us"
    assert any("pwm: {rest: 1500, span: 400}" in line for line in found.mapping())


def test_the_track_is_in_metres_from_its_first_place(log):
    """One 1e-6 deg of latitude is 0.1112 m, of longitude at 63.4 deg 0.0499 m."""
    contents = contents_of(log)
    east, north = track_of(contents, list_contents(contents, log.name))
    assert (east[0], north[0]) == (0.0, 0.0)
    assert north[-1] == pytest.approx(99 * 0.11146, rel=3e-3)
    assert east[-1] == pytest.approx(198 * 0.04999, rel=3e-3)


def test_look_writes_one_page_with_pictures_and_a_mapping(podusv, log):
    said = podusv("identify", "--look", "log.csv")
    assert (said.code, said.out) == (0, "page: log_look.html\n")
    page = Path("log_look.html").read_text()
    assert page.count("data:image/png;base64") >= 2
    assert "left [%]" in page
    assert "lat: &#34;lat&#34;" in page or 'lat: "lat"' in page
    assert "not drawn, without a number or beyond 60: note" in page
    assert "http" not in page.replace("http://www.w3.org", "")
    again = podusv("identify", "--look", "log.csv")
    assert (again.code, again.err) == (
        5,
        "log_look.html exists; name another with --out, or replace it with --force\n",
    )
    Path("boat.yaml").write_text(BOAT.replace("ACTUATOR", PARTS))
    told = podusv("identify", "boat.yaml", "--look", "log.csv", "--out", "deep/b.html", "--json")
    assert '  n_part_cmd_1: "left [%]"' in json.loads(told.out)["mapping"]
    assert Path("deep/b.html").is_file()
    assert podusv("identify", "boat.yaml", "--columns", "log.csv").code == 0


def test_many_columns_are_named_where_they_are_not_drawn():
    columns = {f"c{i}": np.arange(9.0) for i in range(90)} | {"x": np.arange(9.0)}
    found = list_contents(Contents(columns), "a.csv")
    drawn = [own.name for own in drawn_signals(found)]
    assert (len(drawn), drawn[0]) == (60, "x")
