"""The pages about the sea and sensors say what the code and the shipped scenarios do."""

import re
from pathlib import Path

import pytest
import yaml

from podusv_cli.components.measurements.sensors import Sensors
from podusv_cli.scenario.load import load_text

ROOT = Path(__file__).parents[1]
SEA, MEASUREMENTS = ((ROOT / "docs" / name).read_text() for name in ("sea.md", "measurements.md"))


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_the_example_of_a_list_is_a_scenario_whose_loads_all_act():
    (block,) = re.findall(r"```yaml\n(.*?)```", SEA, re.S)
    scenario = load_text(block, "a.yaml").scenario
    kinds = [part.kind for part in scenario.disturbance]
    assert kinds == ["harmonic", "current", "wind", "waves"]
    again = load_text(block, "a.yaml", ["disturbance[3].seed=2"]).scenario.disturbance
    assert [part.seed for part in again[1:]] == [1, 1, 2]
    (line,) = re.findall(r"`(disturbance\[3\].seed: .*?)` below `vary:`", SEA)
    study = f"{block}sweep:\n  draws: 2\n  vary:\n    {line}\n"
    assert load_text(study, "a.yaml").scenario.sweep.vary["disturbance[3].seed"].seed


@pytest.mark.parametrize("state", range(2, 7))
def test_the_table_of_sea_states_is_that_of_the_shipped_scenarios(state):
    (row,) = (cells(line) for line in SEA.splitlines() if line.startswith(f"| {state} |"))
    text = (ROOT / "configs" / "sea" / f"state_{state}.yaml").read_text()
    parts = {part["kind"]: part for part in yaml.safe_load(text)["disturbance"]}
    model = [parts["waves"]["height"], parts["waves"]["period"], parts["wind"]["speed"]]
    assert [float(cell) for cell in row[4:7]] == model
    assert "on the ship waves of {} m and {} s and a wind of {} m/s".format(*row[1:4]) in text


def test_the_sensors_that_are_on_by_default_are_documented():
    found = [cells(line) for line in MEASUREMENTS.splitlines() if line.startswith("| `")]
    documented = {row[0].strip("`"): (float(row[2]), float(row[3])) for row in found}
    sensors = Sensors().instruments()
    assert documented == {name: (one.period, one.noise) for name, (one, _) in sensors.items()}
