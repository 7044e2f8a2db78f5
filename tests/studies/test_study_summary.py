"""Tables of a study: by hand, with failures, missing runs and missing numbers."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import spearmanr
from study_samples import Made, pairs, sensitivity, study, summary

from podusv_cli.metrics.table import METRICS
from podusv_cli.storage import csv_files
from podusv_cli.studies.counting import statistics as st
from podusv_cli.studies.telling import summary as tables
from podusv_cli.studies.telling.outputs import DIGITS

inf, nan = math.inf, math.nan


def row(frame: pd.DataFrame, **keys: str) -> pd.Series:
    entry = frame.loc[np.logical_and.reduce([frame[k] == v for k, v in keys.items()])]
    assert len(entry) == 1
    return entry.iloc[0]


def interval(row: pd.Series, name: str) -> tuple[float, ...]:
    return tuple(row[[name, f"{name}_low", f"{name}_high"]])


def test_the_summary_has_failures_and_quantiles_of_every_law_and_cell():
    a = np.vstack([np.arange(1.0, 41.0), np.r_[np.arange(1.0, 31.0), [inf] * 10]])
    runs = Made({"a": {"iae": a}, "b": {"iae": 2 * a}}, ("s=1", "s=2"), 40)
    frame = summary(runs)
    assert len(frame) == 4
    entry = row(frame, law="a", cell="s=2")
    assert (entry.n, entry.broken, entry.unknown, entry.unit) == (40, 0, 0, "m s")
    assert interval(entry, "failed") == tuple(st.share(10, 40, 0.95))
    assert interval(entry, "q75") == tuple(st.quantile(a[1], 0.75, 0.95))
    assert entry.q95 == inf
    assert row(frame, law="b", cell="s=1").q50 == 40.0


def test_the_summary_counts_only_runs_that_are_there_and_broken_ones_as_failed():
    a, broken = np.r_[np.ones(8), inf, inf], np.arange(10) == 8
    runs = Made({"a": {"iae": a}}, undone={"a": np.arange(10) < 3}, broke={"a": broken})
    entry = summary(runs).iloc[0]
    assert (entry.n, entry.broken, entry.failed) == (7, 1, 2 / 7)
    nothing = Made({"a": {"iae": a}}, undone={"a": True})
    assert summary(nothing).empty
    assert pairs(nothing).empty
    assert csv_files.records([], DIGITS) == csv_files.text(summary(nothing), DIGITS)


def test_metrics_that_a_law_lacks_are_left_out_and_missing_numbers_are_counted():
    numbers = np.r_[nan, np.ones(19)]
    runs = Made(
        {
            "a": {"iae": np.ones(20), "energy": numbers, "settling_time": numbers},
            "b": {"iae": np.ones(20), "settling_time": np.ones(20)},
            "dead": {"iae": np.full(20, inf)},
        }
    )
    frame = summary(runs)
    assert set(frame.metric[frame.law == "b"]) == {"iae", "settling_time"}
    assert row(frame, law="a", metric="energy").unknown == 1
    assert row(frame, law="a", metric="settling_time").unknown == 0  # never settled: the worst
    assert row(frame, law="dead", metric="energy").q05 == inf
    both = pairs(runs)
    assert len(both.query("metric == 'energy' and (a == 'b' or b == 'b')")) == 0
    assert row(both, metric="energy", a="a", b="dead").unknown == 1


def test_pairs_have_both_win_rates_and_the_median_ratio():
    a = np.r_[np.ones(10), 1.995, inf, inf]
    b = np.r_[np.full(10, 2.0), 2.0, inf, 1.0]
    entry = row(pairs(study(a=a, b=b)), metric="iae")
    assert (entry.a, entry.b, entry.n, entry.margin) == ("a", "b", 13, 0.01)
    assert (entry.ties, entry.both_failed) == (2, 1)
    assert interval(entry, "a_wins") == tuple(st.share(10, 13, 0.95))
    assert interval(entry, "b_wins") == tuple(st.share(1, 13, 0.95))
    assert interval(entry, "ratio") == tuple(st.quantile(st.ratios(a, b), 0.5, 0.95))
    assert entry.ratio == 0.5
    assert len(pairs(study(a=a, b=b, c=a))) == 3


def test_more_of_a_share_of_legs_wins_and_a_failed_run_has_the_least():
    """In a failed run as in any other, however many legs it did."""
    iae = {"iae": np.ones(20)}
    laws = {"a": {"path_done": np.ones(20), **iae}, "b": {"path_done": np.full(20, 0.5), **iae}}
    runs = Made(laws, poor={"a": np.arange(20) < 4})
    entry = row(pairs(runs), metric="path_done")
    assert (entry.a_wins, entry.b_wins, entry.ratio) == (0.8, 0.2, 2.0)
    column = row(summary(runs), law="a", metric="path_done")
    assert (column.q05, column.q50) == (-math.inf, 1.0)


def test_sensitivity_finds_the_quantity_that_matters_and_ranks_failures_worst():
    random = np.random.default_rng(1)
    mass, noise = random.random((2, 300))
    runs = study(a=np.where(mass > 0.8, inf, np.exp(mass)), b=random.random(300))
    draws = {"vessel.m": mass, "noise": noise, "count": np.arange(300), "word": ["x"] * 300}
    frame = sensitivity(runs, draws)
    assert set(frame.quantity) == {"vessel.m", "noise", "count"}
    strong = row(frame, law="a", quantity="vessel.m")
    assert strong.correlation > 0.98 > strong.by_chance
    assert abs(row(frame, law="a", quantity="noise").correlation) < strong.by_chance
    # the other way round if failures were left out or counted as small
    late = np.where(mass > 0.2, inf, 1.0 - mass)
    assert row(sensitivity(study(a=late), draws), quantity="vessel.m").correlation > 0.5


def test_sensitivity_is_of_the_draws_in_which_the_number_is_known():
    random = np.random.default_rng(2)
    mass = random.random(40)
    energy = np.where((mass < 0.4) | (random.random(40) < 0.2), nan, mass + random.random(40))
    runs, known = Made({"a": {"iae": np.ones(40), "energy": energy}}), ~np.isnan(energy)
    entry = row(sensitivity(runs, {"vessel.m": mass}), metric="energy")
    assert entry.n == known.sum() < 40
    expected = spearmanr(mass[known], energy[known]).statistic
    assert entry.correlation == pytest.approx(expected, rel=1e-12)
    assert entry.by_chance == pytest.approx(1.959964 / math.sqrt(known.sum() - 1), rel=1e-6)


def test_measured_times_are_in_no_table():
    runs = Made({"a": {"iae": np.ones(9), "law_ns": np.ones(9)}})
    assert set(summary(runs).metric) == {"iae"}


def test_tables_as_csv_have_six_digits_and_no_formulas():
    runs = study(["=cell"], a=np.full((1, 7), 1 / 3), b=np.full((1, 7), inf))
    rows = tables.summary(runs, 0.95, METRICS)
    text = csv_files.records(rows, DIGITS)
    assert text == csv_files.text(pd.DataFrame(rows), DIGITS)  # as pandas writes it
    assert "\r" not in text
    lines = text.splitlines()
    assert lines[0].startswith("law,cell,n,broken,failed,failed_low,failed_high,metric,unit,")
    assert lines[1].startswith("a,'=cell,7,0,0,0,0.409616,iae,m s,0,0.333333,")
    assert ",inf," in lines[2]
