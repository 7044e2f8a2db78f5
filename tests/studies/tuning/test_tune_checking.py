"""The key `tune`: mistakes are told at their place, gains and their ranges are found."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_study import TEXT
from tune_samples import faults, planned, toy

from podusv_cli.core.component import Component, value
from podusv_cli.core.errors import ScenarioError
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.tune import Range
from podusv_cli.scenario.yaml_tree import DISTRIBUTIONS, RANGE
from podusv_cli.studies.making.draws import SWEEP, table, words
from podusv_cli.studies.tuning.check import tune_faults
from podusv_cli.studies.tuning.objective import (
    Outcomes,
    evaluate,
    excess,
    parse_inequality,
    parse_objective,
)
from podusv_cli.studies.tuning.plan import TRAIN, VALIDATE, TunePlan
from podusv_cli.studies.tuning.space import _around

TUNED = TEXT + "tune: {budget: 200, train: 4, validate: 10, space: {around: 10.0}}\n"


def plan(*changes: str) -> TunePlan:
    return TunePlan(load_text(TUNED, "a.yaml", changes, [tune_faults]).scenario)


def test_a_gain_that_is_a_time_has_to_fit_the_steps():
    """At the ends of its range, and between them; and nothing is such a gain by itself."""
    law = "controllers.pid={rate: difference, difference_step: 0.02}"
    for space, told in (
        ("uniform: [0.02, 0.05]", "difference_step of pid: 0.03146 s is no whole number of steps"),
        ("choice: [0.02, 0.035]", "difference_step of pid: 0.035 s is no whole number of steps"),
    ):
        with pytest.raises(ScenarioError, match=told):
            plan(law, f"tune.space.difference_step={{{space}}}")
    plan(law, "tune.space.difference_step={choice: [0.02, 0.04]}")
    trial = plan("controllers={turn: {kind: zigzag}}", "sweep.claims=null", "claims=null")
    assert "execute" not in [gain.key for gain in trial.gains["turn"]]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("tune.budget=31", "31 runs are less than one batch of 8 gains with 4 draws each; give 32"),
        ("sweep.design=sobol", "sobol points have no intervals, which a comparison needs; write"),
        ("tune.budgte=3", "unknown key; did you mean 'budget'?"),
        ("tune.objective=median(iea)", "unknown metric 'iea'; did you mean"),
        ("tune.objective=iae", "no statistic of all draws; write median(...)"),
        ("tune.objective=1 + 2", "is a number, whatever the gains are"),
        ("tune.objective=share(iae)", "unknown statistic 'share'"),
        ("tune.objective=median(iae / 0)", "'iae / 0': divides by zero"),
        ("tune.objective=median(iae) / -0.0", "divides by zero"),
        ("tune.objective=median(iae / (ise - ise))", "is no finite number, whatever the runs are"),
        ("tune.objective=median(iae * 1e200)", "is no finite number, whatever the runs are"),
        ("tune.subject_to=[median(iae / 0) < 1]", "divides by zero"),
        ("tune.objective=median(iae < 3)", "write metrics by their names alone"),
        ("tune.subject_to=[failures]", "compare one statistic with one number"),
        ("tune.subject_to=[0.1 <= failures <= 0.2]", "compare one statistic with one number"),
        ("tune.subject_to=[failures <= ise]", "not a plain number"),
        ("tune.space.k_zee.log=[1, 2]", "unknown gain; did you mean 'k_ze'?"),
        ("tune.space.pidd.K_Pu.log=[1, 2]", "unknown gain; did you mean 'pid.K_Pu'?"),
        ("tune.space.K_Pu.log=[-1, 2]", "-1 is not above 0; write uniform: [low, high]"),
        ("tune.space.K_Pu.log=[2, 1]", "log: 2 is not below 1"),
        ("tune.space.K_Pu.uniform=[-2, 1]", "pid does not take K_Pu = -2.0"),
        ("tune.space.K_Pu={}", "must have one of log, uniform"),
        ("tune.space.K_Pu={log: [1, 2], keep: true}", "found log and keep"),
        ("tune.space.hold_below.around=2", "hold_below of pid is 0.0; a factor needs"),
        ("tune.space.reference.choice=[path]", "needs two different values"),
        ("tune.space.reference.choice=[path, pahth]", "pid does not take reference = 'pahth'"),
        ("tune.space.around=1", "must be a number above 1"),
        ("tune.space.K_Pu=3.0", "is a number; write {log: [low, high]}, or keep: true"),
        ("sweep.grid={vessel.m: [20, 30]}", "needs a study without a grid"),
        ("sweep=null", "needs the key sweep"),
    ],
)
def test_a_mistake_is_told_once_at_its_place(change, told):
    sentences = faults(TUNED, change)
    assert len(sentences) == 1 or change.startswith("tune.space.hold_below"), sentences
    assert told in sentences[0]
    assert sentences[0].startswith(f"--set {change}") or sentences[0].startswith("a.yaml:")


def test_a_sound_search_has_no_faults_and_reads_back():
    loaded = load_text(TUNED, "a.yaml", ["tune.space.pid.K_Pu.log=[1, 2]"], [tune_faults])
    assert load_text(resolved_yaml(loaded.scenario), "b.yaml").scenario == loaded.scenario


def test_another_range_replaces_an_inherited_one():
    loaded = load_text(
        TUNED, "a.yaml", ["tune.space.K_Pu.log=[1, 2]", "tune.space.T_d={uniform: [1, 2]}"]
    )
    space = loaded.scenario.tune.space
    assert space["T_d"].given_keys == ["uniform"]
    assert set(space) == {"around", "K_Pu", "T_d"}
    assert {*Range.model_fields} <= RANGE | DISTRIBUTIONS


class Bounded(Component):
    gain: float = value(1.0, "1", "with ends that a factor of 10 leaves", ge=0.5, le=4.0)


def test_around_covers_every_gain_and_stays_in_its_range():
    by_key = {gain.key: gain for gain in plan().gains["pid"]}
    assert {"K_Pu", "K_Ir", "T_d", "k_ze", "standoff"} <= set(by_key)
    assert not {"difference_step", "hold_below", "kind", "reference"} & set(by_key)
    assert (by_key["K_Pu"].low, by_key["K_Pu"].high) == (110.0, 11000.0)
    assert all(gain.log and gain.low < gain.own < gain.high for gain in by_key.values())
    field = Bounded.model_fields["gain"]
    cut = [(gain.low, gain.high) for gain in (_around(f, "gain", 1.0, field) for f in (10.0, 1.5))]
    assert cut == [(0.5, 4.0), (1.0 / 1.5, 1.5)]


def test_a_key_may_be_kept_or_be_of_one_law():
    by_law = plan("tune.space.standoff.keep=true", "tune.space.pid.k_ze.log=[0.01, 1]").gains
    assert "standoff" not in {gain.key for gain in by_law["pid"]}
    (ours,) = [gain for gain in by_law["pid"] if gain.key == "k_ze"]
    (theirs,) = [gain for gain in by_law["li"] if gain.key == "k_ze"]
    assert (ours.low, ours.high) == (0.01, 1.0)
    assert (theirs.low, theirs.high) == (pytest.approx(0.01), pytest.approx(1.0))


def test_without_around_only_named_keys_are_searched(tmp_path):
    text = TUNED.replace("{around: 10.0}", "{K_Pu: {log: [100, 1000]}}")
    by_law = TunePlan(load_text(text, "a.yaml", (), [tune_faults]).scenario).gains
    assert [gain.key for gain in by_law["pid"]] == ["K_Pu"]
    assert by_law["li"] == ()


def test_a_law_without_numbers_has_no_gains(tmp_path):
    made = planned(tmp_path)
    assert [gain.key for gain in made.gains["toy"]] == ["gain", "other", "unread"]
    assert made.gains["bare"] == ()
    lines = list(made.in_words())
    assert "bare has no gains and is kept as it is" in lines
    assert lines[-1].startswith(
        "runs of the search: 128 (budget 64 for each law, repeats: 2, training"
    )
    assert made.runs_wanted() == {"toy": (128, 36), "bare": (0, 12)}


def test_a_gain_is_tried_in_four_digits_within_its_range():
    gain = next(gain for gain in plan().gains["pid"] if gain.key == "K_Pu")
    assert gain.value(123.456789) == 123.5
    assert gain.value(109.99999) == 110.0
    assert (gain.bound(110.0), gain.bound(1100.0), gain.bound(10900.0)) == ("lower", "", "upper")
    # The scenario's own value, the first trial, may lie outside.
    assert (gain.bound(0.0), gain.bound(99.0), gain.bound(20000.0)) == ("", "", "")


RUNS = Outcomes(
    {"iae": np.array([1.0, 2.0, 3.0, np.nan]), "tv_tau_u": np.array([4.0, 4.0, 8.0, 1.0])},
    np.array([False, False, False, True]),
)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("median(iae)", 2.0),
        ("quantile(iae, 0.75)", 3.0),
        ("quantile(iae, 0.95)", math.inf),
        ("median(iae) + 0.5 * median(tv_tau_u)", 4.0),
        ("median(iae / tv_tau_u)", 0.375),
        ("failures", 0.25),
        ("-failures * 4", -1.0),
        ("-median(iae)", -1.0),
        ("-quantile(iae, 0.25)", math.inf),
        ("median(-iae)", -2.0),
        ("quantile(-iae, 0.95)", math.inf),
        ("10 - median(iae)", 9.0),
        ("-2 * median(iae)", -2.0),
        ("12 / median(iae)", 12.0),
        ("12 / -median(iae)", -6.0),
        ("median(iae) / (quantile(iae, 0.75) - quantile(iae, 0.25))", 2.0),
        ("1 / (quantile(tv_tau_u, 0.75) - quantile(tv_tau_u, 0.74))", -0.25),
    ],
)
def test_a_failed_run_is_the_worst_of_every_statistic(text, number):
    assert evaluate(parse_objective(text, METRICS), RUNS, METRICS) == number


def test_what_nobody_knows_is_the_worst():
    runs = Outcomes({"iae": np.full(4, np.nan)}, np.zeros(4, bool))
    assert evaluate(parse_objective("median(iae)", METRICS), runs, METRICS) == math.inf
    assert evaluate(parse_objective("median(iae) - median(iae)", METRICS), runs, METRICS) > 1e300
    assert evaluate(parse_objective("1 / median(iae)", METRICS), runs, METRICS) == math.inf


@pytest.mark.parametrize(
    ("text", "over"),
    [
        ("failures <= 0.25", 0.0),
        ("failures <= 0.1", 1.5),
        ("failures <= 0", 0.25),
        ("median(iae) >= 4", 0.75),
        ("quantile(iae, 0.75) >= 2", 0.0),
        ("quantile(iae, 0.25) >= 1", math.inf),
        ("median(iae) < 4", -0.5),
        ("quantile(iae, 0.95) > 1", -2.0),
    ],
)
def test_an_inequality_says_by_how_much_it_does_not_hold(text, over):
    inequality = parse_inequality(text, METRICS)
    assert excess(inequality, RUNS, METRICS) == pytest.approx(over)


def test_training_validation_and_sweep_share_no_word():
    streams = [words(3, "start.psi", 0, 2000, s).tolist() for s in (SWEEP, TRAIN, VALIDATE)]
    assert len({word for stream in streams for word in stream}) == 6000


def test_the_streams_reach_the_runs(tmp_path):
    made = planned(tmp_path)
    assert made.scenario.sweep
    plans = [
        made.variant({law: (law, {}) for law in made.laws}, stream, 10)
        for stream in (TRAIN, VALIDATE)
    ]
    drawn = [table(plan.sweep, 0, 10, plan.stream)["start.psi"].tolist() for plan in plans]
    own = table(made.scenario.sweep, 0, 10)["start.psi"].tolist()
    assert len({*drawn[0], *drawn[1], *own}) == 30
    assert plans[0].identity["stream"] != plans[1].identity["stream"]


def test_validate_tells_gains_runs_and_laws_without_gains(podusv, tmp_path):
    code, out, _ = podusv("validate", str(toy(tmp_path)))
    assert code == 0
    assert "gains of toy (3): gain, other, unread" in out
    assert "bare has no gains" in out
    assert "search: 128" in out


def test_a_comparison_ignores_the_search(tmp_path):
    made = planned(tmp_path).scenario
    assert all(single.tune is None and single.sweep is None for single in made.singles().values())
