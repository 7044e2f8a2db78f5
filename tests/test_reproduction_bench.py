"""results/bench.md tells the committed runs of the bench."""

from pathlib import Path

import pandas as pd
import pytest

from podusv_cli.bench.cases import AXES, shipped_bench
from podusv_cli.bench.page import as_markdown

RESULTS = Path(__file__).parents[1] / "results"
PAGE = (RESULTS / "bench.md").read_text()
RUNS = pd.read_csv(RESULTS / "bench" / "runs.csv")
FAILED = RUNS[RUNS.status != "finished"]
WORDS = " ".join(PAGE.split())


def count(law, query):
    return len(FAILED[FAILED.law == law].query(query))


def test_the_leaderboard_is_that_of_the_runs():
    table = as_markdown(RUNS)
    assert table == (RESULTS / "bench" / "leaderboard.md").read_text()
    assert table in PAGE


def test_the_runs_are_those_of_the_shipped_bench():
    for axis in AXES:
        names = {path.stem for path in (shipped_bench() / axis).iterdir()}
        assert set(RUNS[axis.rstrip("s")]) == names
    laws, cases = RUNS.law.nunique(), len(RUNS) // RUNS.law.nunique()
    assert f"{laws} laws over 8 tasks, 4 vessels and 7 conditions, {len(RUNS)} runs" in WORDS
    best = RUNS[RUNS.ratio == 1.0].groupby("law").size()
    ours, other = best.velocity_vector, best.super_twisting
    assert f"in {ours} of {cases} cases; `super_twisting` has it in {other}" in WORDS


def test_the_findings_are_those_of_the_runs():
    hand = ("adrc", "hand_position", "sliding_mode", "super_twisting")
    pods = sorted(count(law, "condition == 'pod'") for law in hand)
    assert f"{pods[0]} to {pods[-1]} of 32 cases" in WORDS
    assert {count(law, "condition in ('calm', 'sea', 'sampled')") for law in hand} == {0}
    assert {count(law, "condition == 'pod' and vessel == 'otter'") for law in hand} == {1}
    family = ("dsc", "li", "proposed", "proposed_crab")
    sampled = [count(law, "condition == 'sampled'") for law in family]
    assert f"in {min(sampled)} to {max(sampled)} of 32 cases, PID in none" in WORDS
    assert count("pid", "condition == 'sampled'") == 0
    corners = "task in ('lawnmower', 'square')"
    assert f"fails in {count('li', corners)} of 56 cases" in WORDS
    assert f"`dsc` in {count('dsc', corners)}." in WORDS
    assert count("velocity_vector", "task == 'station' and condition == 'pod'") == 3
    resting = count("los_pid", "task == 'station'")
    assert f"`los_pid` fails at rest in {resting} of 28" in WORDS


@pytest.mark.parametrize(
    ("law", "condition", "told"),
    [
        ("hand_position", "calm", "5.6"), ("hand_position", "hull_light", "8.5"),
        ("sliding_mode", "calm", "2.7"), ("sliding_mode", "hull_light", "6.0"),
    ],
)  # fmt: skip
def test_the_ranks_by_condition_are_those_of_the_runs(law, condition, told):
    ranks = RUNS[(RUNS.law == law) & (RUNS.condition == condition)]["rank"]
    assert f"{ranks.mean():.1f}" == told
    assert told in PAGE
