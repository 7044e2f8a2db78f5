"""`podusv capability`: table, files and refusals."""

import csv
import json
import math
from pathlib import Path

import pytest
from command_samples import commanded

BOX = """
vessel: {preset: cybership2}
actuator: {kind: saturated_full, surge_limit: 3.0, sway_limit: 1.5}
path: {kind: hold}
disturbance: [{kind: wind, speed: 2.0, at: 1.0}, {kind: current}]
controller: {kind: pose_pid}
"""


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text(BOX)
    return commanded(monkeypatch, capsys)


def test_it_prints_a_table_and_writes_csv_json_and_a_figure(podusv):
    said = podusv("capability", "a.yaml", "--of", "force", "--every", "45", "--format", "png,svg")
    assert said.code == 0, said.err
    assert "all thrusters: holds 1.5 N from anywhere, least from 90 deg" in said.out
    folder = Path("results/a/capability")
    head, *rows = csv.reader(folder.joinpath("capability.csv").read_text().splitlines())
    assert head == ["from [deg]", "all thrusters [N]"]
    assert [float(row[0]) for row in rows] == [0, 45, 90, 135, 180, 225, 270, 315]
    expected = [3.0, 1.5 * math.sqrt(2.0), 1.5, 1.5 * math.sqrt(2.0)] * 2
    assert [float(row[1]) for row in rows] == pytest.approx(expected, rel=2e-3)
    written = json.loads(folder.joinpath("capability.json").read_text())
    assert written["held"]["all thrusters"] == pytest.approx(expected, rel=2e-3)
    assert (written["load"], written["unit"]) == ("force", "N")
    figures = {path.name for path in folder.joinpath("figures").iterdir()}
    assert figures == {"capability.png", "capability.svg"}
    assert json.loads(folder.joinpath("manifest.json").read_text())["status"] == "finished"


def test_two_demands_are_said_to_hold_along_the_keel_alone(podusv):
    two = ("actuator.kind=saturated", "controller.kind=pid", "path.kind=line")
    said = podusv("capability", "a.yaml", *[w for s in two for w in ("--set", s)], "--every", "90")
    assert said.code == 0, said.err
    assert "the actuator takes no sway force" in said.out
    assert "the actuator takes no sway force" not in podusv("capability", "a.yaml").out


def test_json_is_what_is_written_and_each_thruster_has_a_column(podusv):
    pods = ("actuator.kind=pod", "actuator.preset=milliampere", "actuator.sway_weight=1")
    set_ = [word for key in ("vessel.preset=milliampere", *pods) for word in ("--set", key)]
    said = podusv("capability", "a.yaml", *set_, "--every", "90", "--out", "c", "--json")
    assert said.code == 0, said.err
    told = json.loads(said.out)
    assert told == json.loads(Path("c/capability.json").read_text())
    assert list(told["held"]) == ["all thrusters", "without pods[0]", "without pods[1]"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--every", "50"], "--every 50: 50 deg do not divide a turn of 360 deg; give 45"),
        (["--set", "actuator.kind=ideal_full"], "the actuator ideal_full has no limits"),
        (["--of", "wind", "--set", "vessel.windage=null"], "the vessel has no windage"),
        (["--format", "bmp"], "bmp"),
    ],
)
def test_what_cannot_be_answered_is_said_in_a_sentence(podusv, words, sentence):
    said = podusv("capability", "a.yaml", *words)
    assert said.code == 2
    assert sentence in " ".join(said.err.split())
    assert not Path("results/a/capability").exists()
