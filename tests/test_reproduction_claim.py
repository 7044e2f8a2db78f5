"""results/claim.md tells the committed tables, and a few of these are made anew."""

from __future__ import annotations

import importlib.util
import math
import re
from itertools import dropwhile, takewhile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parent.parent
PAPER = ROOT / "results/paper"
PAGE = (ROOT / "results/claim.md").read_text()
ABLATIONS = {"F": "ablation_figures", "S": "ablation_standoff", "C": "ablation"}
LAWS = (
    "proposed",
    "one_node",
    "nodes_8",
    "nodes_125",
    "no_bounds",
    "no_network",
    "neither",
    "high_gain",
)


def module() -> object:
    """results/claim.py, which is a script."""
    spec = importlib.util.spec_from_file_location("claim", ROOT / "results/claim.py")
    assert spec
    assert spec.loader
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def rows(title: str) -> list[list[str]]:
    """The cells of the first table below a heading, without the table's head."""
    lines = iter(PAGE.partition(f"## {title}\n")[2].splitlines())
    below = dropwhile(lambda line: not line.startswith("|"), lines)
    table = takewhile(lambda line: line.startswith("|"), below)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table][2:]


def same(told: str, number: float) -> bool:
    """Whether a number on the page is this one, rounded as told; words stand for no number."""
    text = told.replace(" ", "")
    if not re.fullmatch(r"[\d.]+", text):
        return math.isnan(number)
    digits = len(text.partition(".")[2])
    return abs(float(text) - number) <= 0.51 * 10.0**-digits


def test_parts_switched_off() -> None:
    tables = {
        k: pd.read_csv(PAPER / name / "comparison.csv", index_col=0)
        for k, name in ABLATIONS.items()
    }
    for law, row in zip(LAWS, rows("Parts switched off"), strict=False):
        for told, reading in zip(row[1:4], "FSC", strict=True):
            assert same(told, tables[reading].loc["iae", law]), (law, reading)
        assert same(row[4], tables["C"].loc["peak_tau_u", law]), law


def test_wrong_vessels() -> None:
    table = pd.read_csv(PAPER / "unknown_dynamics.csv", index_col=0)
    for name, *numbers in rows("Wrong vessels"):
        assert all(map(same, numbers, table.loc[name])), name
    told = table[table.index.str.startswith("told")] / table.loc["as it is"] - 1
    assert told[["proposed", "dsc", "li", "pid", "high_gain"]].abs().max(axis=None) < 0.003
    assert told["no_adaptation"].abs().max() < 0.01
    ratio = table["high_gain"] / table["proposed"]
    assert (ratio - 1).abs().max() < 0.0105


def test_sampled_control() -> None:
    table = pd.read_csv(PAPER / "discrete_signals.csv", index_col=[0, 1])
    columns = ["F proposed", "S proposed", "S dsc", "S li", "S pid", "C proposed", "C pid"]
    for period, *numbers in rows("Sampled control"):
        at = table[np.isclose(table["period_s"], 0.0 if period == "continuous" else float(period))]
        for column, told in zip(columns, numbers, strict=True):
            assert same(told, at.loc[tuple(column.split())]["cycle_N"]), (period, column)


def test_the_longest_period_is_the_predicted_one() -> None:
    table = pd.read_csv(PAPER / "period_limits.csv", index_col=[0, 1])
    for law, period in (("proposed", 0.002), ("dsc", 0.002), ("li", 0.002), ("pid", 0.024)):
        for reading in "SC":
            assert table.loc[reading, law].tolist() == [period, period]


def test_a_few_cases_come_out_again() -> None:
    claim = module()
    table = pd.read_csv(PAPER / "unknown_dynamics.csv", index_col=0)
    cases = dict(claim.mismatched(claim.laws(claim.READINGS["C"])["proposed"]))
    for name in ("told all of it +50 %", "true all of it -30 %"):
        assert claim.iae(cases[name]) == pytest.approx(table.loc[name, "proposed"], rel=1e-5)
    periods = pd.read_csv(PAPER / "discrete_signals.csv", index_col=[0, 1, 2])
    again = claim.cycle(claim.sampled(claim.READINGS["S"], 20)["proposed"])
    assert again == pytest.approx(dict(periods.loc["S", "proposed", 0.01]), rel=1e-4)
