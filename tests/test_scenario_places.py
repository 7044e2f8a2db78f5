"""Places of lists: set, overridden and varied by either form of their name."""

import pytest
from scenario_samples import SOUND, findings, loaded, told, write

from podusv_cli.scenario.load import load

PODS = SOUND.replace("{kind: ideal}", "{kind: pod, preset: cybership2_pod}")


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    """Messages show file names as a user gives them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()


def test_an_item_of_a_list_can_be_set_by_its_place_also_where_a_preset_brings_the_list():
    sets = ("actuator.pods.1.n_lag=0.5", "actuator.pods.0={angle_lag: 0.2, n_lag: 0.3}")
    one, two = loaded(PODS, sets).scenario.actuator.pods
    assert (one.n_lag, one.angle_lag, one.T_nn) == (0.3, 0.2, 3.65034e-3)
    assert (two.n_lag, two.angle_lag, two.y) == (0.5, 0.1, 0.078)
    assert told(PODS, ["actuator.pods.1.T_nn=-1"]) == [
        "--set actuator.pods.1.T_nn=-1: actuator.pods[1].T_nn: must be a number above 0 [N s2], "
        "found -1"
    ]


def test_a_place_that_a_list_does_not_have_is_no_item():
    (line,) = told(PODS, ["actuator.pods.2.n_lag=0.5"])
    place = "--set actuator.pods.2.n_lag=0.5: actuator.pods[2]"
    assert line.startswith(f"{place}: the list has 2 entries, actuator.pods[0] to actuator.pods[1]")


PARTS = "{kind: current}, {kind: wind, speed: 1}, {kind: waves, height: 0.1, period: 2}"
SEA = SOUND.replace("{kind: none}", f"[{PARTS}]")
ENTRIES = "the list has 3 entries, disturbance[0] to disturbance[2] (current, wind, waves)"


@pytest.mark.parametrize("key", ["disturbance[2].seed", "disturbance.2.seed"])
def test_both_forms_of_a_place_may_be_set(key):
    seeds = [part.seed for part in loaded(SEA, [f"{key}=7"]).scenario.disturbance]
    assert seeds == [1, 1, 7]


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("disturbance[3].seed=2", "disturbance[3]"),
        ("disturbance.3.kind=none", "disturbance[3]"),
        ("disturbance.-1.seed=2", "disturbance.-1"),
        ("disturbance.waves.seed=2", "disturbance.waves"),
        ("disturbance.seed=2", "disturbance.seed"),
    ],
)
def test_what_a_list_does_not_have_is_told_with_what_it_has(override, key):
    assert told(SEA, [override]) == [f"--set {override}: {key}: {ENTRIES}; name one of these"]


def test_a_file_above_names_places_of_a_list_that_it_extends():
    write("base.yaml", SEA)
    write("a.yaml", "extends: base.yaml\ndisturbance: {'3': {seed: 2}}\n")
    assert findings("a.yaml") == [f"a.yaml:2:15: disturbance[3]: {ENTRIES}; name one of these"]
    write("a.yaml", "extends: base.yaml\ndisturbance: {kind: none}\n")
    assert load("a.yaml").scenario.disturbance.kind == "none"


def test_a_list_of_numbers_tells_its_places():
    points = SOUND.replace("{kind: line}", "{kind: waypoints, points: [[0, 0], [1, 1]]}")
    assert loaded(points, ["path.points[1][0]=5"]).scenario.path.points == ((0, 0), (5, 1))
    (line,) = told(points, ["path.points[1].2=5"])
    assert "path.points[1][2]: the list has 2 entries, path.points[1][0] to" in line


@pytest.mark.parametrize("form", ["disturbance[2].seed", "disturbance.2.seed"])
def test_both_forms_name_the_same_quantity(form):
    text = f"{SEA}sweep: {{vary: {{'{form}': {{seed: true}}}}}}\n"
    (name,) = loaded(text).scenario.sweep.vary
    assert name == "disturbance[2].seed"
    assert loaded(text, ["sweep.vary.disturbance.2.seed=null"]).scenario.sweep.vary == {}
    (twice,) = told(text.replace("true}}", "true}, 'disturbance[2].seed': {seed: true}}"))[:1]
    assert "given twice" in twice
