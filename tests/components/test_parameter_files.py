"""Parameter files of autopilots, as keys of their laws."""

import math

import pytest

from podusv_cli.components.controllers.ardupilot import ArduPilot
from podusv_cli.components.controllers.parameter_files import (
    ARDUPILOT,
    PX4,
    of_ardupilot,
    of_px4,
    parameters,
)
from podusv_cli.components.controllers.px4 import Px4
from podusv_cli.core.errors import ScenarioError
from podusv_cli.scenario.load import load

ROVER = {
    "ATC_SPEED_FF": "0.05",
    "ATC_SPEED_P": "0.4",
    "ATC_STR_RAT_FF": "0.35",
    "ATC_STR_RAT_MAX": "60",
    "ATC_STR_RAT_D": "0.01",
    "CRUISE_SPEED": "1.6",
    "CRUISE_THROTTLE": "40",
    "PSC_POS_P": "0.3",
    "SERVO1_FUNCTION": "73",
    "BATT_MONITOR": "4",
}
BOAT = """\
vessel: {preset: otter}
actuator: {kind: pod, preset: otter}
disturbance: {kind: none}
path: {kind: line}
"""


@pytest.mark.parametrize("line", ["{},{}", "{} {}", "{}\t{}", "1\t1\t{}\t{}\t9"])
def test_files_of_every_ground_station_have_the_same_numbers(line):
    text = "# saved\n" + "".join(line.format(*pair) + "\n" for pair in ROVER.items())
    keys, remarks = of_ardupilot(text, ())
    assert keys == {
        "speed_P": 0.4,
        "rate_FF": 0.35,
        "r_m": pytest.approx(1.0471975512),
        "pos_P": 0.3,
        "speed_FF": pytest.approx(0.3),  # 0.05 + 0.4/1.6, as AR_AttitudeControl adds them
    }
    assert remarks == ["these parameters have no key: ATC_STR_RAT_D, SERVO1_FUNCTION"]


def test_a_file_of_old_rovers_asks_for_l1():
    keys, remarks = of_ardupilot("NAVL1_PERIOD,12\nNAVL1_DAMPING,0.7\n", ())
    assert keys == {"l1_period": 12.0, "l1_damping": 0.7, "guidance": "l1"}
    assert "guidance is l1" in remarks[0]


def test_what_the_scenario_gives_itself_is_no_matter_of_the_file():
    keys, remarks = of_ardupilot("NAVL1_PERIOD,12\nATC_STR_RAT_MAX,0\n", ("guidance", "r_m"))
    assert keys == {"l1_period": 12.0}
    assert remarks == []


def test_limits_that_are_none_are_said_and_cruise_may_be_missing():
    keys, remarks = of_px4("RO_SPEED_LIM,-1\nRO_SPEED_P,0.2\n", ())
    assert keys == {"speed_P": 0.2}
    assert remarks == ["RO_SPEED_LIM sets no limit; podusv's own stands"]
    assert of_ardupilot("CRUISE_SPEED,0\nATC_SPEED_FF,0.2\n", ())[0] == {"speed_FF": 0.2}


def test_px4_names_full_throttle_and_a_wheel_track():
    keys, remarks = of_px4(
        "RO_MAX_THR_SPEED 2.5\nRD_WHEEL_TRACK 0.8\nRO_YAW_RATE_CORR 1.5\nRO_YAW_RATE_LIM 0\n"
        "RO_YAW_RATE_TH 3\nRO_JERK_LIM 1\n",
        (),
    )
    assert keys == {
        "speed_FF": pytest.approx(0.4),
        "rate_FF": pytest.approx(0.24),  # 0.8 * 1.5 / (2 * 2.5)
        "r_least": pytest.approx(math.radians(3.0)),
    }
    assert remarks == [
        "RO_YAW_RATE_LIM sets no limit; podusv's own stands",
        "these parameters have no key: RO_JERK_LIM",
    ]


@pytest.mark.parametrize(("law", "table"), [(ArduPilot, ARDUPILOT), (Px4, PX4)])
def test_every_key_is_one_of_the_law_and_names_its_parameter(law, table):
    for parameter, (key, _) in table.items():
        meaning = law.model_fields[key].description
        named = parameter in meaning
        assert named or key in {"U", "r_m", "speed_P", "speed_I", "rate_FF", "rate_P", "rate_I"}


def test_a_scenario_takes_them_and_its_own_keys_go_before(tmp_path):
    (tmp_path / "boat.param").write_text("".join(f"{k},{v}\n" for k, v in ROVER.items()))
    (tmp_path / "a.yaml").write_text(
        BOAT + "controller: {kind: ardupilot, file: boat.param, pos_P: 0.25}\n"
    )
    loaded = load(tmp_path / "a.yaml")
    law = loaded.scenario.controller
    assert (law.pos_P, law.speed_P, law.speed_FF, law.file) == (0.25, 0.4, 0.3, None)
    assert "these parameters have no key: ATC_STR_RAT_D" in loaded.remarks[0]
    assert loaded.origins["controller.speed_P"].endswith("boat.param")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("ATC_SPEED_P\t0,3\n", "line 1 has no name and number of a parameter"),
        ("ATC_SPEED_P,0,3\n", "line 1 has no name and number of a parameter"),
        ("ATC_SPEED_P,1\nATC_SPEED_P,2\n", "line 2 gives ATC_SPEED_P a second time"),
        ("ATC_SPEED_P\n", "line 1 has no name and number of a parameter"),
        ("ATC_SPEED_P,abc\n", "line 1 has no name and number of a parameter"),
        ("BATT_MONITOR,4\n", "has no parameter that this law has a key for"),
        ("", "has no parameter that this law has a key for"),
        ("PSC_POS_P,-1\n", "controller.pos_P: must be a number above 0"),
    ],
)
def test_what_is_no_parameter_file_is_one_sentence(tmp_path, text, says):
    (tmp_path / "boat.param").write_text(text)
    (tmp_path / "a.yaml").write_text(BOAT + "controller: {kind: ardupilot, file: boat.param}\n")
    with pytest.raises(ScenarioError, match=r"boat\.param") as caught:
        load(tmp_path / "a.yaml")
    assert says in str(caught.value)


def test_comments_and_marks_are_no_parameters():
    assert parameters("\ufeff# a\n\nA_B,1 # c\n") == {"A_B": 1.0}
