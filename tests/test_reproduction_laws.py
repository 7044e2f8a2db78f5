"""docs/laws.md compares the laws as the committed study of rivals has them."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "laws.md").read_text()
STUDY = ROOT / "results" / "studies" / "rivals"
SUMMARY = pd.read_csv(STUDY / "summary.csv").set_index(["law", "metric"])
ROWS = {
    "`velocity_vector`": "velocity_vector", "`adrc`": "adrc", "`hand_position`": "hand_position",
    "`sliding_mode`": "sliding_mode", "`sliding_mode`, `super_twisting`": "super_twisting",
    "`alos`": "alos", "`alos`, `integral`": "ilos", "`los_pid`": "los_pid", "`pid`": "pid",
    "`adaptive_neural`": "adaptive_neural", "`dsc`": "dsc", "`backstepping`": "backstepping",
    "`adaptive_neural` as published": "adaptive_neural_published",
    "`pid` as published": "pid_published", "`adaptive_neural`, `crab`": "adaptive_crab",
    "`adaptive_neural`, `crab`, `k_ze` 0.2, `k_psie` 0.5": "adaptive_crab_tuned",
}  # fmt: skip


def millimetres(number):
    return "fails" if number == float("inf") else f"{1000 * number:.0f}"


@pytest.mark.parametrize("shown", ROWS)
def test_the_row_of_a_law_is_that_of_the_study(shown):
    (row,) = re.findall(rf"^\| {re.escape(shown)} \| (\d.*) \|$", PAGE, re.M)
    *_, failed, circle, after = row.split(" | ")
    found = SUMMARY.loc[ROWS[shown]]
    assert failed == f"{500 * found.failed.iloc[0]:.0f}"
    for told, metric in ((circle, "error_circle_rms"), (after, "error_after_max")):
        one = found.loc[metric]
        assert told == f"{millimetres(one.q50)}, {millimetres(one.q95)}"


def test_the_sentences_about_the_draws_are_those_of_the_study():
    text = " ".join(PAGE.split())
    medians = [SUMMARY.loc[(law, "iae")].q50 for law in ("super_twisting", "velocity_vector")]
    assert f"({medians[0]:.0f} against {medians[1]:.0f} m s)" in text
    pairs = pd.read_csv(STUDY / "pairs.csv").query("metric == 'iae'").set_index(["a", "b"])
    ratio = pairs.loc["velocity_vector", "adrc"]
    assert round(1 / ratio.ratio, 3) == 1.032
    assert {SUMMARY.loc[(law, "iae")].failed for law in ("velocity_vector", "adrc", "alos")} == {0}
