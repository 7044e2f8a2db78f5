"""about.json: what a run says about itself, by hand, by algebra and from its folder."""

import json
import math
from pathlib import Path

import pytest
from command_samples import one_line
from comparison_samples import about, scenario
from plugin_samples import LAW, SCENARIO, put

from podusv_cli.core import json_text
from podusv_cli.core.about import RunAbout
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.load import load
from podusv_cli.storage import json_files

SHIPPED = ("own_vessel", "laws/legs", "pod/kept", "sea/sensors", "trials/zigzag_20")
WAYPOINTS = "path={kind: waypoints, points: [[0, 0], [30, 40]], speed: 0.5}"
LEGS = "path={kind: legs, points: [[0, 0], [30, 40], [60, 0]], acceptance: 5}"


@pytest.mark.parametrize("name", SHIPPED)
def test_what_is_written_is_read(name, tmp_path):
    for single in load(f"configs/{name}.yaml").scenario.singles().values():
        told = about_of(single)
        place = tmp_path / f"{single.controller.label}.json"
        place.write_bytes(json_text.encode(told.model_dump(exclude_defaults=True)))
        assert json_files.read_as(place, RunAbout) == told


def test_the_numbers_are_those_of_the_scenario():
    """CyberShip II is 1.255 m long and 0.29 m wide (Skjetne, Smogeli, Fossen 2004)."""
    told = about("metrics.steady_fraction=0.25", "log.every=7", "simulation.step=0.02")
    assert (told.length, told.beam) == (1.255, 0.29)
    assert (told.duration, told.step, told.every) == (4.0, 0.02, 7)
    assert told.steady_from == pytest.approx(4.0 - 0.25 * 4.0)
    assert told.limits == (8.0, 2.5)
    assert told.outages == ((),) * 6


def test_a_path_s_points_and_what_it_is_are_told():
    still, followed = about(WAYPOINTS), about(LEGS)
    assert (still.follows, followed.follows) == (False, True)
    assert still.waypoints == ((0.0, 0.0), (30.0, 40.0))
    assert followed.circles == ((30.0, 40.0, 5.0), (60.0, 0.0, 5.0))
    assert about().waypoints == about().circles == ()


def test_a_limit_that_is_not_constant_is_none():
    assert about("actuator.kind=ideal").limits == (None, None)
    pods = about("actuator={kind: pod, preset: cybership2_pod}")
    assert pods.limits == (None, None)
    assert pods.underactuated


def test_a_law_s_standoff_and_family_are_told():
    one = about("controller={kind: adaptive_neural, standoff: 3}")
    assert (one.standoff, one.polar, one.trial) == (3.0, True, False)
    trial = about("controller={kind: zigzag}")
    assert (trial.standoff, trial.polar, trial.trial) == (0.0, False, True)


def test_only_metrics_that_podusv_does_not_have_itself_are_told():
    assert about().metrics == {}
    named = about("metrics.windows={line: [1, 3]}").metrics
    assert named["error_line_rms"].unit == "m"


def test_a_run_is_at_its_target_within_the_radius_or_at_the_end_of_its_legs():
    near = {"e_steady": 0.9, "path_done": 0.5}
    assert about().at_target(near)
    assert not about().at_target({"e_steady": math.nan})
    assert not about(LEGS).at_target(near)
    assert about(LEGS).at_target({"e_steady": 9.0, "path_done": 1.0})
    assert scenario().at_target(near)


FAULTY = (
    LAW
    + """

    def optimum_of(self):
        return 1 / 0
"""
)


def test_a_part_that_fails_when_it_is_asked_costs_the_figures_and_not_the_log(podusv):
    said = podusv("run", put(SCENARIO, FAULTY), "--out", "r")
    assert said.code == 0
    assert "about.json, which figures need, could not be made: " in said.err
    assert Path("r/log.h5").exists()
    assert not Path("r/figures").exists()
    (lack,) = json.loads(Path("r/missing.json").read_text())["missing"]
    assert "my_law.py" in lack["why"]
    said = podusv("compare", "a.yaml", "--out", "c")
    assert (said.code, said.out) == (2, "")
    assert "ZeroDivisionError: division by zero (my_law.py, line" in one_line(said.err)
