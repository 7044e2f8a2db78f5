"""results/tuning.md tells the committed tables of searches."""

import re
from pathlib import Path

import pandas as pd
import pytest

from podusv_cli.scenario.load import load
from podusv_cli.studies.tuning.check import tune_faults
from podusv_cli.studies.tuning.plan import TunePlan

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "results" / "tuning.md").read_text()
CASES = ("hull", "network", "phases", "sensors", "sliding")
WHOLE = ("rank_before", "rank_after", "better_than_before", "better_than_after")
RANGED = r"(\S+ \[\S+ \S+\])"
ROW = r"^\| (\w+) " + r"\| (\d+) " * 5 + rf"\| {RANGED} \| {RANGED} \| {RANGED} \|$"


def table(case, name):
    return pd.read_csv(ROOT / "results" / "tuning" / case / f"{name}.csv")


def section(case):
    (found,) = re.findall(
        rf"(?ms)^## [^\n]*\n\n`configs/studies/tune_{case}.yaml`.*?(?=^## |\Z)", PAGE
    )
    return found


def told(row, name, digits):
    numbers = (row[name], row[f"{name}_low"], row[f"{name}_high"])
    return "{} [{}, {}]".format(*(f"{number:.{digits}f}" for number in numbers))


@pytest.mark.parametrize("case", CASES)
def test_the_table_of_laws_is_that_of_the_search(case):
    rows = re.findall(ROW, section(case), re.MULTILINE)
    gains = table(case, "gains").groupby("law").size()
    expected = [
        (row["law"], str(gains[row["law"]]), *(str(row[name]) for name in WHOLE),
         told(row, "objective_before", 0), told(row, "objective_after", 0), told(row, "ratio", 2))
        for row in table(case, "laws").sort_values("rank_after").to_dict("records")
    ]  # fmt: skip
    assert rows == expected


@pytest.mark.parametrize("case", CASES)
def test_every_law_had_the_runs_that_the_scenario_says(case):
    loaded = load(ROOT / "configs" / "studies" / f"tune_{case}.yaml", (), [tune_faults])
    plan = TunePlan(loaded.scenario)
    assert list(table(case, "laws").law) == list(plan.laws)
    assert set(table(case, "laws").runs) == {plan.tune.budget * plan.tune.repeats}
    assert set(table(case, "validation").n) == {plan.tune.validate}


PAIR = r"`(\w+)` / `(\w+)`: (\S+ \[\S+ \S+\]) before, (\S+ \[\S+ \S+\]) after"


@pytest.mark.parametrize("case", CASES)
def test_the_pairs_that_are_named_are_those_of_the_search(case):
    pairs = table(case, "validation").query("metric == 'iae'").set_index(["when", "a", "b"])
    found = re.findall(PAIR, " ".join(section(case).split()))
    assert found
    for a, b, before, after in found:
        assert told(pairs.loc["before", a, b], "ratio", 3) == before
        assert told(pairs.loc["after", a, b], "ratio", 3) == after


def test_the_total_variations_behind_sensors_are_those_of_the_fresh_draws():
    """Whoever chatters is told by it, and by nothing else on the page."""
    limits = table("sensors", "limits").set_index(["law", "when", "inequality"]).value
    found = re.findall(r"^\| (\w+) " + r"\| (\d+) " * 4 + r"\|$", section("sensors"), re.MULTILINE)
    assert len(found) == len(table("sensors", "laws"))
    for law, *numbers in found:
        expected = [
            f"{limits[law, when, text]:.0f}"
            for text in ("quantile(tv_tau_u, 0.95) <= 2000", "quantile(tv_tau_r, 0.95) <= 620")
            for when in ("before", "after")
        ]
        assert numbers == expected
