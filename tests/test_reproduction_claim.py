"""results/claim.md tells the committed tables, and a few of these are made anew."""

from __future__ import annotations

import importlib.util
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parent.parent
PAPER = ROOT / "results/paper"
PAGE = (ROOT / "results/claim.md").read_text()
ABLATIONS = {"F": "ablation_figures", "S": "ablation_standoff", "C": "ablation"}
LAWS = (
    "proposed", "one_node", "nodes_8", "nodes_125", "no_bounds", "no_network", "neither",
    "high_gain", "equal_gain_1", "equal_gain_27",
)  # fmt: skip


def module() -> object:
    """examples/reproduce/claim.py, which is a script."""
    spec = importlib.util.spec_from_file_location("claim", ROOT / "examples/reproduce/claim.py")
    assert spec
    assert spec.loader
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def rows(title: str, which: int = 0) -> list[list[str]]:
    """The cells of a table below a heading, without the table's head."""
    section = PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]
    tables = re.findall(r"(?:^\|.*\n)+", section, re.MULTILINE)
    lines = tables[which].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def same(told: str, number: float) -> bool:
    """Whether a number on the page is this one, rounded as told; words stand for no number."""
    text = told.replace(" ", "")
    if not re.fullmatch(r"[\d.]+", text):
        return math.isnan(number)
    digits = len(text.partition(".")[2])
    return abs(float(text) - number) <= 0.51 * 10.0**-digits


def test_parts_switched_off() -> None:
    tables = {
        letter: pd.read_csv(PAPER / name / "comparison.csv", index_col=0)
        for letter, name in ABLATIONS.items()
    }
    for law, row in zip(LAWS, rows("Parts switched off"), strict=True):
        for told, reading in zip(row[1:4], "FSC", strict=True):
            assert same(told, tables[reading].loc["iae_e", law]), (law, reading)
        assert same(row[4], 1000 * tables["C"].loc["e_steady", law]), law
        assert same(row[5], tables["C"].loc["peak_tau_u", law]), law


def test_pid_without_windup() -> None:
    table = pd.read_csv(PAPER / "ablation_pid/comparison.csv", index_col=0)
    laws = ("proposed", "pid", "pid_no_integral", "pid_anti_windup")
    for law, (_, error, settled, energy) in zip(laws, rows("PID"), strict=True):
        found = table[law]
        assert same(error, found["iae_e"])
        assert same(settled, 1000 * found["e_steady"])
        assert same(energy, found["energy"])


def test_what_the_networks_learn() -> None:
    table = pd.read_csv(PAPER / "learnt.csv", index_col=[0, 1])
    for name, *numbers in rows("Parts switched off", which=2):
        reading, axis = name[0], {"surge": "u", "yaw": "r"}[name.split()[1].strip(",")]
        assert all(map(same, numbers, table.loc[reading, axis])), name


def test_wrong_vessels() -> None:
    table = pd.read_csv(PAPER / "unknown_dynamics.csv", index_col=[0, 1])
    error = table["iae_e"].unstack()[
        ["proposed", "dsc", "li", "pid", "no_adaptation", "equal_gain"]
    ]
    page = rows("Wrong vessels")
    assert len(page) == 12
    for name, *numbers in page:
        assert all(map(same, numbers, error.loc[name])), name
    change = (error[error.index.str.startswith("told")] / error.loc["as it is"] - 1).abs().max()
    assert change["proposed"] < 0.004
    assert change["equal_gain"] < 0.00003
    assert round(100 * change.max(), 2) == round(100 * change["no_adaptation"], 2) == 1.34
    ratio = error["equal_gain"] / error["proposed"] - 1
    assert ratio.abs().max() < 0.005
    assert ratio[ratio.index.str.startswith("true")].abs().max() < 0.0004
    family = error[["proposed", "dsc", "li"]]
    assert (family.max(axis=1) / family.min(axis=1) - 1).max() < 0.053
    assert (len(error), int((error["li"] < error["proposed"]).sum())) == (43, 40)


@pytest.mark.parametrize("update", ["after", "before"])
def test_sampled_control(update: str) -> None:
    table = pd.read_csv(PAPER / "discrete_signals.csv", index_col=[0, 1, 2])
    columns = ["F proposed", "S proposed", "S dsc", "S li", "S pid", "C proposed", "C pid"]
    page = rows("Sampled control", which=("after", "before").index(update))
    assert len(page) == {"after": 6, "before": 5}[update]
    for period, *numbers in page:
        at = table[np.isclose(table["period_s"], 0.0 if period == "continuous" else float(period))]
        for column, told in zip(columns, numbers, strict=True):
            assert same(told, at.loc[(*column.split(), update)]["cycle_N"]), (period, column)


def test_the_longest_period_is_the_predicted_one() -> None:
    table = pd.read_csv(PAPER / "period_limits.csv", index_col=[0, 1, 2])
    page = rows("Sampled control", which=2)
    assert len(page) == 9
    for name, *numbers in page:
        law, _, reading = name.lower().partition(" in ")
        for update, (found, predicted) in zip(
            ("after", "before"), (numbers[:2], numbers[2:]), strict=True
        ):
            told = table.loc[reading.upper(), law, update]
            assert (float(found), float(predicted)) == (told["found_s"], told["predicted_s"]), name
    near = table.drop("F").xs("after", level=2)
    assert near["found_s"].equals(near["predicted_s"])


def test_settled_velocity_errors_tell_the_gain() -> None:
    table = pd.read_csv(PAPER / "fixed_gains.csv", index_col=[0, 1])
    for law, *numbers in rows("Parts switched off", which=1):
        name = "proposed" if law == "proposed" else f"k_{''.join(law.split()[1:-1])}"
        errors = (table.loc[r, name][e] for r in "CS" for e in ("rms_u_e", "rms_r_e"))
        assert all(same(told, 1e3 * error) for told, error in zip(numbers, errors, strict=True))
    for reading in "FSC":
        ratio = table.loc[reading, "k_13208"] / table.loc[reading, "proposed"]
        assert abs(ratio["rms_u_e"] - 1.0) < 0.003
        assert abs(ratio["rms_r_e"] - 1.0) < 0.003


def test_the_limit_of_pid_is_that_of_its_lag() -> None:
    claim = module()
    pid = claim.sampled(claim.READINGS["C"], 0, "after")["pid"]
    for lag, period in ((0.05, 0.016), (0.01, 0.004)):
        law = pid.controller.model_copy(update={"T_d": lag})
        assert claim.predicted(pid.model_copy(update={"controller": law})) == period


def test_a_few_cases_come_out_again() -> None:
    claim = module()
    table = pd.read_csv(PAPER / "unknown_dynamics.csv", index_col=[0, 1])
    cases = dict(claim.mismatched(claim.laws(claim.READINGS["C"])["proposed"]))
    for name in ("told all of it +50 %", "true all of it -30 %"):
        committed = dict(table.loc[name, "proposed"])
        assert claim.errors(cases[name]) == pytest.approx(committed, rel=1e-3)
    periods = pd.read_csv(PAPER / "discrete_signals.csv", index_col=[0, 1, 2, 3])
    again = claim.cycle(claim.sampled(claim.READINGS["S"], 20, "after")["proposed"])
    assert again == pytest.approx(dict(periods.loc["S", "proposed", "after", 0.01]), rel=1e-4)
