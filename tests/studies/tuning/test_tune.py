"""`podusv tune`: equal budgets, found optima, interrupted searches, outputs, mistakes."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from tune_samples import planned, searched, toy, tuned

from podusv_cli.scenario.load import load
from podusv_cli.scenario.plugins import of_files
from podusv_cli.studies.counting.runs import UnitResult
from podusv_cli.studies.tuning import sampler, trials
from podusv_cli.studies.tuning.remarks import remarks
from podusv_cli.studies.tuning.sampler import Sampler
from podusv_cli.studies.tuning.search import GainSearch, _far
from podusv_cli.studies.tuning.space import Gain
from podusv_cli.studies.tuning.trials import CUT, FINISHED, PRUNED, GainTrial, best
from podusv_cli.studies.tuning.validation import choose_search

BUDGET = 64


@pytest.fixture
def optuna():
    return pytest.importorskip("optuna", reason="the search needs Optuna: podusv[tune]")


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    pytest.importorskip("optuna", reason="the search needs Optuna: podusv[tune]")
    folder = tmp_path_factory.mktemp("tune")
    return tuned(folder, f"tune.budget={BUDGET}", workers=2, figures=True)


def test_a_planted_optimum_is_found(done):
    assert done.results.winner("toy").gains["gain"] == pytest.approx(3.0, rel=0.1)
    (row,) = done.results.laws[done.results.laws.law == "toy"].to_dict("records")
    assert row["objective_after"] < 1e-2 * row["objective_before"]
    assert row["ratio_high"] < 0.05
    assert (row["rank_before"], row["rank_after"]) == (2, 1)
    assert (row["better_than_before"], row["better_than_after"]) == (0, 1)


def test_a_law_that_does_not_end_at_its_target_has_no_rank(done):
    far = done.results.plan.scenario
    far = far.model_copy(
        update={"metrics": far.metrics.model_copy(update={"settling_radius": 1e-9})}
    )
    results = replace(done.results, plan=replace(done.results.plan, scenario=far))
    assert results.laws.rank_after.isna().all()
    assert results.laws.place_low.isna().all()


def test_failed_draws_count_as_not_settled_and_half_of_the_draws_are_enough(done, monkeypatch):
    """Whatever the numbers of a run that failed are."""
    draws = [
        SimpleNamespace(failed=np.array(f), metrics={"x": np.zeros(4)}) for f in FAILED.values()
    ]
    monkeypatch.setattr(
        type(done.results.plan.scenario), "at_target", lambda scenario, numbers: True
    )
    for name, draw in zip(FAILED, draws, strict=True):
        monkeypatch.setattr(type(done.results), "outcomes_of", lambda results, law, one=draw: one)
        assert done.results.settles("toy", "before") == (name == "half")


FAILED = {"half": [True, True, False, False], "most": [True, True, True, False]}


def test_every_search_spends_the_whole_budget_and_counts_pruned_trials(done):
    for found in done.results.trials["toy"]:
        assert sum(trial.runs for trial in found) == BUDGET
        counts = {s: [t.runs for t in found if t.status == s] for s in (FINISHED, PRUNED, CUT)}
        assert set(counts[FINISHED]) == {4}
        assert set(counts[PRUNED]) == {1}, "a quarter of the draws"
    assert done.results.runs_spent == {"toy": 2 * BUDGET}


def test_the_first_trial_has_the_published_gains(done):
    for search in done.results.trials["toy"]:
        assert search[0].gains == {"gain": 1.0, "other": 1.0}
        assert search[0].status == FINISHED


def test_an_objective_is_told_with_its_unit(done):
    assert done.results.label == "median(effort_u) [N2 s]"


def test_repeats_differ(done):
    first, second = done.results.trials["toy"]
    assert [t.gains for t in first[1:]] != [t.gains for t in second[1:]]


@pytest.mark.long
def test_searches_take_the_training_sets_in_turn_and_the_first_set_is_that_of_a_single_one(
    optuna, tmp_path
):
    """The scenario's own gains, which every search tries first, tell the sets apart."""
    changes = ("tune.budget=8", "tune.batch=2", "tune.train=2", "tune.objective=median(iae)")
    single, several = tmp_path / "single", tmp_path / "several"
    alone = searched(single, *changes)
    sets = searched(several, *changes, "tune.training_sets=3")
    own = [search.trials[0].value for search in sets]
    assert own[:3] == own[3:]
    assert len(set(own)) == 3
    assert sets[0].trials == alone[0].trials
    assert [trial.gains for trial in sets[3].trials] != [trial.gains for trial in sets[0].trials]


def test_a_law_without_gains_is_kept_and_reported(done):
    (row,) = done.results.laws[done.results.laws.law == "bare"].to_dict("records")
    assert row["objective_before"] == row["objective_after"]
    assert row["runs"] == 0
    assert "bare has no gains, kept as it is" in remarks(done.results)
    assert "<li>bare has no gains" in (done.folder / "report.html").read_text()


def test_the_found_scenario_extends_the_searched_one(done):
    scenario = load(done.folder / "tuned.yaml", plugged=of_files(trusted=True)).scenario
    assert scenario.name == "toy-tuned"
    assert scenario.tune is None
    assert scenario.sweep
    gains = done.results.winner("toy").gains
    assert scenario.controllers["toy"].gain == gains["gain"]
    assert scenario.controllers["bare"].label == "bare"


def test_numbers_of_the_report_come_from_draws_that_no_search_has_seen(done):
    drawn = done.results.runs.drawn_quantities["start.psi"]
    plan = done.results.plan
    from podusv_cli.studies.making.draws import SWEEP, table
    from podusv_cli.studies.tuning.plan import TRAIN

    others = [table(plan.scenario.sweep, 0, 500, s)["start.psi"] for s in (SWEEP, TRAIN)]
    assert len(drawn) == plan.tune.validate
    assert not set(drawn.tolist()) & {*others[0].tolist(), *others[1].tolist()}


def test_the_found_gains_give_the_numbers_of_the_validation(done):
    """One run of the validation again, by hand."""
    from podusv_cli.studies.making.unit import Unit, make
    from podusv_cli.studies.tuning.plan import VALIDATE

    scenario = load(done.folder / "tuned.yaml", plugged=of_files(trusted=True)).scenario
    gains = {key: getattr(scenario.controllers["toy"], key) for key in ("gain", "other")}
    made = done.results.plan.variant({"toy": ("toy", gains)}, VALIDATE, 12)
    again = make(made, Unit("toy", 0, 3, 1)).metrics["effort_u"][0]
    assert again == done.results.runs.metric("toy tuned", "effort_u")[0, 3]


def test_tables_have_a_row_for_every_law_gain_trial_and_pair(done):
    read = {name: pd.read_csv(done.folder / f"{name}.csv") for name in ("laws", "gains", "history")}
    assert list(read["laws"].law) == ["toy", "bare"]
    assert list(read["gains"].gain) == ["gain", "other"]
    assert len(read["history"]) == sum(len(found) for found in done.results.trials["toy"])
    for _, rows in read["history"].groupby("repeat"):
        assert rows.best.is_monotonic_decreasing
        assert rows.spent.iloc[-1] == BUDGET
    pairs = pd.read_csv(done.folder / "validation.csv")
    assert set(pairs["when"]) == {"before", "after", "tuning"}


def test_the_gain_that_matters_is_the_important_one(done):
    table = done.results.importance.set_index("gain")
    assert table.importance["gain"] > 0.6 > 0.4 > table.importance["other"]
    assert all(table.low <= table.importance)
    assert all(table.importance <= table.high)


def test_the_page_has_figures_and_no_broken_value(done):
    page = (done.folder / "report.html").read_text()
    assert page.count("<figure") == 6
    assert not re.search(r">\s*nan\b|Undefined|\bNone<", page)
    names = {path.stem for path in (done.folder / "figures").iterdir()}
    assert names == {"validation", "effort", "history", "ratios", "importance", "slices-toy"}


@pytest.mark.slow
def test_an_inequality_is_respected(done, tmp_path):
    """The best gain is 3, and only gains up to about 1.6 hold the inequality."""
    changes = ("tune.repeats=1", "tune.budget=120", "tune.subject_to=[median(effort_u) >= 0.4]")
    (bound,) = searched(tmp_path, *changes)
    assert best(done.results.trials["toy"][0]).value < 0.1
    winner = best(bound.trials)
    assert winner.excess == 0.0
    assert 0.4 <= winner.value < 0.7


@pytest.mark.slow
def test_gains_that_the_law_refuses_fail_and_cost_no_simulation(optuna, tmp_path, monkeypatch):
    from podusv_cli.studies.tuning import search as module

    real = module.with_gains
    monkeypatch.setattr(
        module, "with_gains", lambda law, new: real(law, new) if new["gain"] < 2 else None
    )
    (found,) = searched(tmp_path, "tune.repeats=1")
    refused = [trial for trial in found.trials if trial.gains["gain"] >= 2]
    assert refused
    assert all(trial.failures == 1.0 and trial.value == math.inf for trial in refused)
    assert found.runs_spent == 64
    assert best(found.trials).gains["gain"] < 2


@pytest.mark.slow
def test_a_search_in_which_everything_fails_ends_and_says_so(optuna, tmp_path):
    made = tuned(
        tmp_path, "sweep.success=finished and effort_u < 0", "tune.repeats=1", "tune.budget=40"
    )
    assert made.results.winner("toy").gains["gain"] == 1.0
    assert "toy: every trial failed on most draws; its gains mean nothing" in remarks(made.results)


@pytest.mark.slow
def test_the_command_prints_before_and_after(optuna, podusv, tmp_path):
    code, out, err = podusv(
        "tune",
        str(toy(tmp_path)),
        "--set",
        "tune.budget=32",
        "--set",
        "tune.repeats=1",
        "--out",
        str(tmp_path / "out"),
        "--no-figures",
    )
    assert code == 0
    assert "search: 32 (budget 32" in err.splitlines()[0]
    assert "median(effort_u) on 12 fresh draws:" in out
    assert re.search(r"^toy +2 -> 2 +0 -> 0 +1\.6\d+, no spread +0\.03\d+,", out, re.MULTILINE)
    told = json.loads((tmp_path / "out" / "tune.json").read_text())
    assert told["gains"] == {"toy": ["gain", "other"], "bare": []}
    assert told["idle"] == {"toy": ["unread"]}
    assert "toy: not searched, since no run depends on them: unread" in out


def test_without_optuna_the_command_says_how_to_get_it(podusv, tmp_path, monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(sampler, "import_module", missing)
    code, _, err = podusv("tune", str(toy(tmp_path)), "--out", str(tmp_path / "out"))
    assert code == 2
    assert "podusv tune needs Optuna: pip install 'podusv[tune]'" in err
    assert not (tmp_path / "out").exists()


def test_a_scenario_without_the_key_is_refused(optuna, podusv, tmp_path):
    code, _, err = podusv("tune", str(toy(tmp_path)), "--set", "tune=null")
    assert code == 2
    assert "has no key `tune`" in err


def made_up(number, value, *, excess=0.0, status=FINISHED):
    return GainTrial(number, 0, {}, 4, status, value, (excess,), value, 0.0)


def test_the_best_trial_holds_inequalities_first_and_is_finished():
    found = [
        made_up(0, 5.0),
        made_up(1, 1.0, excess=0.1),
        made_up(2, 0.5, status=PRUNED),
        made_up(3, 4.0),
        made_up(4, 4.0),
    ]
    assert best(found).number == 3
    assert best(found[1:2]).number == 1, "where none holds them, the nearest"


def test_the_gains_that_are_taken_gained_most_beside_the_scenarios_own_on_the_same_draws():
    own = made_up(0, 9.0)
    winners = [made_up(7, 5.0), made_up(7, 0.5, excess=0.1), made_up(3, 4.0), made_up(2, 4.5)]
    assert choose_search([[own, trial] for trial in winners]) == 2
    easy = [made_up(0, 4.5), made_up(3, 4.0)]  # another training set
    assert choose_search([easy, [own, made_up(7, 5.0)]]) == 1
    assert choose_search([[made_up(0, math.inf), made_up(7, 5.0)], easy]) == 1, (
        "by value where own fail"
    )


def test_a_trial_is_far_worse_by_more_than_half():
    assert _far(2.0, 3.01)
    assert not _far(2.0, 3.0)
    assert _far(2.0, math.inf)
    assert not _far(math.inf, math.inf)


@pytest.mark.parametrize(("excess", "met"), [(0.0, 0), (0.1, 1)])
def test_only_a_trial_that_holds_all_inequalities_prunes_others(optuna, tmp_path, excess, met):
    """Where a far better one holds them, the next batch begins; else the trials go on to draw 1."""
    search = GainSearch(
        planned(tmp_path, "tune.subject_to=[median(effort_u) >= 0]"), "toy", 0, tmp_path
    )
    search.trials = [made_up(0, 0.01, excess=excess)]
    (tmp_path / trials.FOLDER).mkdir()
    nothing = np.zeros(1)
    following = [
        search.take_result(
            place, UnitResult(unit, {"effort_u": np.ones(1)}, nothing, nothing, ("",))
        )
        for place, _, unit in search.begin()
    ]
    assert {unit.first for _, _, unit in following[-1]} == {met}


def test_trials_that_have_not_ended_keep_others_away(optuna):
    """A batch is asked for at once: of two samplers with the same results and random numbers, one
    has a trial under way."""

    def asked(batches: tuple[int, ...]):
        sampler = Sampler([Gain("gain", 1.0, 0.1, 10.0)], [1])
        tried = sampler.ask(0, 8)
        sampler.tell([(trial["gain"] - 3.0) ** 2 for trial in tried], [[]] * 8)
        return [sampler.ask(batch, 1) for batch in batches][-1]

    assert asked((1, 2)) != asked((2,))


def test_trials_read_back_with_infinite_numbers(tmp_path):
    (tmp_path / trials.FOLDER).mkdir()
    written = [
        GainTrial(0, 0, {"a": 0.1 + 0.2, "b": "word", "n": 3}, 4, FINISHED, math.inf, (), 1.0, 1.0)
    ]
    trials.write(tmp_path, "pid-0", written)
    assert trials.read(tmp_path, "pid-0") == written
    assert trials.read(tmp_path, "pid-1") == []
