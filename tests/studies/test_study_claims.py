"""Claims about studies: their meaning, what mistakes are told, how seldom verdicts are wrong."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.special import bdtr
from scipy.stats import binomtest
from study_samples import Made, claim, judged, study

from podusv_cli.expressions.verdict import as_markdown
from podusv_cli.metrics.table import METRICS
from podusv_cli.studies.counting import statistics as st
from podusv_cli.studies.counting.claims import judge
from podusv_cli.studies.counting.expressions import judge_success, parse_success

inf, nan = math.inf, math.nan
LAWS = ["proposed", "pid", "li"]
STUDIES = 2000


def sea(seed: int, n: int = 400) -> tuple[np.random.Generator, np.ndarray]:
    """A generator, and how hard each draw is for every law."""
    random = np.random.default_rng(seed)
    return random, np.exp(random.normal(size=n))


# meaning -----------------------------------------------------------------------------------------


def test_every_statistic_is_what_its_definition_says() -> None:
    a, b = np.array([1.0, 2.0, inf, 4.0, 5.0, inf]), np.array([2.0, 1.0, inf, 8.0, inf, 1.0])
    runs = study(a=a, b=b)
    for text, expected in {
        "share(a.iae < b.iae)": st.share(3, 6, 0.95),
        "share(a.iae <= b.iae)": st.share(4, 6, 0.95),  # both failing is a tie
        "share(not a.iae < b.iae)": st.share(3, 6, 0.95),
        "share(a.iae < b.iae and finished(b))": st.share(2, 6, 0.95),
        "share(not success(a))": st.share(2, 6, 0.95),
        "share(a.iae > 3 * b.iae)": st.share(1, 6, 0.95),
        "share(1 < a.iae <= 4)": st.share(2, 6, 0.95),
        "failures(a)": st.share(2, 6, 0.95),
        "quantile(a.iae, 0.25)": st.quantile(a, 0.25, 0.95),
        "median(a.iae / b.iae)": st.quantile(np.array([0.5, 2, 1, 0.5, 0, inf]), 0.5, 0.95),
        "median(a.iae - b.iae)": st.quantile(np.array([-1, 1, 0, -4, -inf, inf]), 0.5, 0.95),
        # the limit of a large common number: 1 / (1 + 1)
        "quantile(a.iae / (a.iae + b.iae), 0.6)": st.quantile(
            np.array([1 / 3, 2 / 3, 0.5, 1 / 3, 0, 1]), 0.6, 0.95
        ),
    }.items():
        (part,) = judged(runs, f"{text} >= 0.5").parts
        assert (part.estimate, part.low, part.high) == pytest.approx(tuple(expected)), text
        assert part.n == 6


def test_two_shares_are_compared_by_the_draws_in_which_they_differ() -> None:
    """McNemar's exact test: of 6 + 21 draws with one failure, 6 are a's; scipy has the p-value."""
    a, b = np.ones(300), np.ones(300)
    a[:6], b[6:27] = inf, inf
    a[27:60] = b[27:60] = inf
    verdict = judged(study(a=a, b=b), "failures(a) < failures(b)")
    assert verdict.answer is True
    (part,) = verdict.parts
    assert (part.n, part.differ, part.estimate) == (300, 27, pytest.approx(6 / 27))
    assert "failures(a) alone, not failures(b) = 0.2222 [" in part.in_words()
    assert "(300 draws, one of both alone in 27)" in part.in_words()
    p = binomtest(6, 27).pvalue
    for level in (0.9, 0.95, 0.99, 0.995, 0.999):
        answer = judged(study(a=a, b=b), "failures(a) < failures(b)", level=level).answer
        assert answer is (True if p < 1.0 - level else None), level
    both = judged(study(a=a, b=b), "failures(b) > failures(a)", "failures(a) > failures(b)")
    assert [one.answer for one in both] == [True, False]


def test_independent_intervals_would_not_tell_what_paired_draws_tell() -> None:
    a, b = np.ones(300), np.ones(300)
    a[:60] = b[:60] = b[60:72] = inf  # b fails wherever a does, and in 12 draws more
    runs = study(a=a, b=b)
    assert judged(runs, "failures(a) < 0.22 and failures(b) > 0.22").answer is None
    assert judged(runs, "share(not success(a)) < share(not success(b))").answer is True


def test_shares_that_never_differ_cannot_be_told_apart() -> None:
    runs = study(a=[1.0, inf, 2.0], b=[3.0, inf, 4.0])
    verdict = judged(runs, "failures(a) < failures(b)")
    assert verdict.answer is None
    assert verdict.more is None
    never = "in no draw does exactly one of the two conditions hold, so the shares do not differ"
    assert list(verdict.reasons())[-1] == never
    # The other cell has draws that tell, though too few: only the cell where none does is named.
    cells, b = ["scale=1", "scale=2"], [[1.0, inf, 2.0], [inf, 1.0, 2.0]]
    one = judged(
        study(cells, a=[[1.0, inf, 2.0], [1.0, 1.0, 2.0]], b=b), "failures(a) < failures(b)"
    )
    assert list(one.reasons())[-1] == f"for failures(a) alone, not failures(b) at scale=1, {never}"


def test_two_shares_are_seldom_told_apart_wrongly() -> None:
    """Equal shares, failing together or not: in at most 5 % of studies there is an answer."""
    random, wrong = np.random.default_rng(8), 0
    for _ in range(STUDIES // 4):
        hard, own = random.random(80) < 0.2, random.random((2, 80)) < 0.15
        a, b = (np.where(hard | one, inf, 1.0) for one in own)
        wrong += judged(study(a=a, b=b), "failures(a) < failures(b)").answer is not None
    assert wrong / (STUDIES // 4) <= 0.05 + 0.02


def test_a_share_shows_draws_without_a_winner() -> None:
    runs = study(a=[1.0, 1.0, inf, 1.0], b=[1.004, 2.0, inf, inf])
    (part,) = judged(runs, "share(a.iae < b.iae) > 0.5", tolerance=0.01).parts
    assert (part.estimate, part.both_failed, part.close) == (0.5, 1, 1)
    assert "both failed in 1, 1 within the margin" in part.in_words()


def test_a_number_on_the_left_means_the_same() -> None:
    runs = study(a=np.arange(100.0))
    mirrored = judged(runs, "0.6 < share(a.iae < 80)", "0.9 >= share(a.iae < 80) >= 0.6")
    plain = judged(runs, "share(a.iae < 80) > 0.6", "share(a.iae < 80) <= 0.9")
    assert [v.answer for v in mirrored] == [v.answer for v in plain] == [True, True]


def test_the_tolerance_is_a_margin_between_metrics_and_not_of_a_share() -> None:
    _, hard = sea(1)
    runs = study(dsc=0.9996 * hard, proposed=hard)
    better, ratio = "share(dsc.iae < proposed.iae) > 0.9", "median(dsc.iae / proposed.iae) < 1"
    assert [v.answer for v in judged(runs, better, ratio)] == [True, True]
    assert [v.answer for v in judged(runs, better, ratio, tolerance=0.01)] == [False, False]
    worse = "median(proposed.iae / dsc.iae) <= 1"
    assert judged(runs, worse).answer is False
    assert judged(runs, worse, tolerance=0.01).answer is True
    many = study(a=np.r_[np.ones(920), np.zeros(80)])
    assert judged(many, "share(a.iae > 0.5) >= 0.95", tolerance=0.05).answer is False


def test_times_that_never_come_and_numbers_that_a_law_lacks() -> None:
    time = np.array([*range(18), nan, nan])
    runs = Made({"a": {"iae": np.ones(20), "settling_time": time, "energy": time}}, wanted=20)
    (never,) = judged(runs, "quantile(a.settling_time, 0.5) <= 30").parts
    assert (never.unknown, never.low, never.high) == (0, 5.0, 14.0)
    (lacking,) = judged(runs, "quantile(a.energy, 0.5) <= 30").parts
    assert (lacking.unknown, lacking.low, lacking.high) == (2, 3.0, 14.0)


def test_a_run_that_finished_without_success_is_failed_and_the_worst() -> None:
    poor = np.arange(20) < 4
    runs = Made({"a": {"iae": np.ones(20)}, "b": {"iae": np.full(20, 2.0)}}, poor={"a": poor})
    for text, expected in {
        "failures(a)": 0.2,
        "share(finished(a))": 1.0,
        "share(success(a))": 0.8,
        "share(a.iae < b.iae)": 0.8,
        "quantile(a.iae, 0.9)": inf,
        "quantile(a.iae, 0.8)": 1.0,
    }.items():
        assert judged(runs, f"{text} >= 0.5").parts[0].estimate == expected, text


def test_a_failed_run_has_the_least_of_what_more_is_better_of() -> None:
    """A share of legs done: infinite it would be the best."""
    poor = {"a": np.arange(20) < 4}
    iae = {"iae": np.ones(20)}
    laws = {"a": {"path_done": np.ones(20), **iae}, "b": {"path_done": np.full(20, 0.5), **iae}}
    for text, expected in {
        "share(a.path_done > b.path_done)": 0.8,
        "share(a.path_done < b.path_done)": 0.2,
        "share(a.path_done >= 1)": 0.8,
        "quantile(a.path_done, 0.1)": -inf,
        "quantile(a.path_done, 0.3)": 1.0,
    }.items():
        assert judged(Made(laws, poor=poor), f"{text} >= 0.5").parts[0].estimate == expected, text
    both = Made(laws, poor={law: np.arange(20) < 4 for law in laws})
    assert judged(both, "share(a.path_done > b.path_done) >= 0.5").parts[0].estimate == 0.8


def test_success_is_a_condition_on_one_run() -> None:
    tree = parse_success("finished and z_e_steady <= 1.5", METRICS)
    values = {"z_e_steady": np.array([1.0, 1.6, 1.0, nan])}
    finished = np.array([True, True, False, True])
    assert judge_success(tree, values, finished, METRICS).tolist() == [True, False, False, False]
    for unknown in ("not z_e_steady > 1.5", "not settling_time < 9"):
        ended = np.array([False])
        assert not judge_success(parse_success(unknown, METRICS), {}, ended, METRICS).any()


# verdicts ----------------------------------------------------------------------------------------


def test_a_planted_winner_is_found_and_its_opposite_refuted() -> None:
    random, hard = sea(2)
    runs = study(
        proposed=hard * np.exp(0.1 * random.normal(size=400)),
        pid=hard * np.exp(0.2 + 0.1 * random.normal(size=400)),
    )
    found, refuted, ratio = judged(
        runs,
        "share(proposed.iae < pid.iae) >= 0.85",
        "share(pid.iae < proposed.iae) >= 0.15",
        "median(proposed.iae / pid.iae) <= 0.9",
    )
    assert (found.verdict, refuted.verdict) == ("reproduced", "not reproduced")
    assert ratio.verdict == "reproduced"
    assert found.as_json()["needed"] is None


@pytest.mark.slow
def test_laws_of_the_same_distribution_are_told_apart_no_more_often_than_the_level() -> None:
    random = np.random.default_rng(3)
    a, b = random.random((2, STUDIES, 60))
    one_each = study([f"study {i}" for i in range(STUDIES)], a=a, b=b)
    for null in ("median(a.iae - b.iae) <= 0", "share(a.iae < b.iae) >= 0.5"):
        verdict = judged(one_each, null)
        decided = [answer is not None for answer in verdict.by_cell.values()]
        assert (len(decided), verdict.level) == (STUDIES, 0.95)
        assert 0 < np.mean(decided) <= 0.05


def test_claims_are_judged_together_as_holm_says() -> None:
    random, met = np.random.default_rng(4), set()
    claims = [claim(f"share({law}.iae < 0.5) >= 0.5", "abc", name=law) for law in "abc"]
    for _ in range(60):
        numbers = random.random((3, 60)) ** random.choice([0.6, 1.0, 1.5], (3, 1))
        yes = (numbers < 0.5).sum(axis=-1)
        p = [2 * min(bdtr(k, 60, 0.5), bdtr(60 - k, 60, 0.5)) for k in yes]
        steps = np.maximum.accumulate(np.sort(p) * [3, 2, 1])  # Holm's adjusted probabilities
        wrong = dict(zip(np.argsort(p).tolist(), steps, strict=True))
        verdicts = judge(claims, study(**dict(zip("abc", numbers, strict=True))), 0.95, METRICS)
        expected = [bool(yes[i] > 30) if wrong[i] <= 0.05 else None for i in range(3)]
        assert [verdict.answer for verdict in verdicts] == expected
        met.add(sum(answer is None for answer in expected))
    assert met == {0, 1, 2, 3}


def test_a_decided_claim_leaves_its_part_of_the_level_to_the_others() -> None:
    runs = study(a=np.r_[np.zeros(30), np.ones(70)], b=np.zeros(100))
    clear, open_ = judged(runs, "failures(b) <= 0.5", "share(a.iae < 0.5) <= 0.3")
    assert (clear.level, open_.level) == pytest.approx((0.975, 0.95))
    alone = judged(runs, "share(a.iae < 0.5) <= 0.3")
    assert alone.parts == open_.parts


def test_statistics_of_one_claim_share_its_level() -> None:
    runs = study(a=np.arange(100.0))
    both = judged(runs, "failures(a) <= 0.5 and quantile(a.iae, 0.5) <= 90 and failures(a) < 0.9")
    assert [part.level for part in both.parts] == pytest.approx([0.975, 0.975])
    assert both.answer is True
    refuted = judged(runs, "failures(a) <= 0.5 and quantile(a.iae, 0.5) <= 9")
    assert refuted.answer is False


def test_all_cells_have_to_agree() -> None:
    good, bad, between = np.zeros(200), np.full(200, inf), np.r_[np.zeros(100), np.full(100, inf)]
    text, cells = "failures(a) <= 0.5", ["scale=1", "scale=2"]
    answers = [
        judged(study(cells, a=np.array(pair)), text)
        for pair in ((good, good), (bad, bad), (good, bad), (good, between))
    ]
    assert [v.answer for v in answers] == [True, False, None, None]
    disagree = "the cells disagree: holds at scale=1, fails at scale=2"
    assert disagree in answers[2].evidence()
    assert answers[2].as_json()["needed"] is None
    # A third cell that is still open changes nothing: no number of its draws would decide.
    three = judged(
        study([*cells, "scale=3"], a=np.array([good, bad, between])), "failures(a) <= 0.45"
    )
    assert f"{disagree}, cannot tell at scale=3" in three.evidence()
    assert three.as_json()["needed"] is None
    assert "failures(a) at scale=1 = 0 [0, 0.01" in answers[0].evidence()


def test_what_cannot_be_told_says_how_many_draws_would_tell() -> None:
    open_ = judged(study(a=np.ones(100)), "failures(a) <= 0.01")
    assert open_.answer is None
    assert open_.more == 368
    assert "; about 368 draws would decide, if shares stay as they are" in open_.evidence()
    two = judged(study(["scale=1", "scale=2"], a=np.ones((2, 100))), "failures(a) <= 0.01")
    assert "; about 368 draws in each cell would decide, if shares stay" in two.evidence()
    assert judged(study(a=np.ones(368)), "failures(a) <= 0.01").answer is True
    values = np.r_[np.zeros(48), np.ones(2)]
    quantile = judged(study(a=values), "quantile(a.iae, 0.9) <= 0.5")
    assert quantile.more == st.draws_for_share(0.96, 0.9, 0.95)
    assert judged(study(a=1 - values), "quantile(a.iae, 0.1) >= 0.5").more == quantile.more
    bound = judged(study(a=np.r_[np.zeros(5), np.full(5, inf)]), "failures(a) <= 0.5")
    # 0.33332 asked for, 1/3 found: some 5e9 draws would decide, more than are ever looked for.
    near = judged(study(a=np.array([inf, 1.0, 1.0])), "failures(a) <= 0.33332")
    why = "asked for, or so near them that no practicable number of draws decides"
    assert all(f"the shares found are those {why}" in one.evidence() for one in (bound, near))


def test_the_draws_needed_decide_the_quantile_too() -> None:
    share, q = 0.96, 0.9
    n = st.draws_for_share(share, q, 0.95)
    assert n
    for factor, answer in ((0.8, None), (1.2, True)):
        count = round(n * factor / 25) * 25
        values = np.r_[np.zeros(round(share * count)), np.ones(count - round(share * count))]
        assert judged(study(a=values), "quantile(a.iae, 0.9) <= 0.5").answer is answer


def test_an_unfinished_study_is_preliminary() -> None:
    undone = {"a": np.arange(200) >= 150}
    runs = Made({"a": {"iae": np.zeros(200)}}, wanted=200, undone=undone)
    verdict = judged(runs, "failures(a) <= 0.1")
    assert (verdict.answer, verdict.preliminary, verdict.draws) == (True, True, 150)
    assert "preliminary: 150 of 200 draws" in verdict.evidence()
    assert "**holds**, preliminary" in as_markdown([verdict])
    assert not judged(study(a=np.zeros(200)), "failures(a) <= 0.1").preliminary


def test_only_draws_that_all_laws_of_the_claim_met_count() -> None:
    undone = {"a": np.arange(10) < 3, "b": np.arange(10) >= 8}
    runs = Made({x: {"iae": np.ones(10)} for x in "ab"}, wanted=10, undone=undone)
    ratio, alone = judged(runs, "median(a.iae / b.iae) <= 2", "failures(a) <= 0.9")
    assert (ratio.draws, alone.draws) == (5, 7)
    nothing = Made({"a": {"iae": np.ones(4)}}, wanted=4, undone={"a": True})
    for text in ("failures(a) <= 0.9", "quantile(a.iae, 0.5) <= 2"):
        verdict = judged(nothing, text)
        assert verdict.answer is None
        assert "no draw has runs of all laws in the claim" in verdict.evidence()


def test_broken_runs_count_as_failed_and_are_named_where_they_decide() -> None:
    broken = np.arange(400) < 60
    runs = Made({"a": {"iae": np.where(broken, inf, 1.0)}}, wanted=400, broke={"a": broken})
    verdict = judged(runs, "failures(a) <= 0.05")
    assert verdict.answer is False
    assert "60 runs crashed, hung or were invalid, and count as failed" in verdict.evidence()
    assert "without their draws it would be `holds`" in verdict.evidence()
    harmless = judged(runs, "failures(a) <= 0.5")
    assert harmless.without_broken is harmless.answer is True
    assert "decide the verdict" not in harmless.evidence()


def test_missing_numbers_are_never_counted_silently() -> None:
    lacking = Made(
        {x: {"iae": np.ones(50)} for x in "ab"} | {"c": {"iae": np.ones(50), "energy": np.ones(50)}}
    )
    missing = judged(lacking, "median(a.energy / c.energy) <= 1")
    assert missing.answer is None
    assert "no run has a number that the claim is about" in missing.evidence()
    # Where one statistic or one cell alone lacks all numbers, it is named.
    partly = judged(lacking, "failures(a) <= 0.5 and median(a.energy / c.energy) <= 1")
    assert list(partly.reasons())[-1] == "no run has a number for median(a.energy / c.energy)"
    energy, iae = np.array([np.ones(50), np.full(50, nan)]), np.ones((2, 50))
    gridded = Made({"a": {"iae": iae, "energy": energy}}, ["scale=1", "scale=2"], 50)
    lost = judged(gridded, "median(a.energy) <= 2")
    assert list(lost.reasons())[-1] == "no run has a number for median(a.energy) at scale=2"
    undone = {"a": np.array([[False] * 50, [True] * 50])}
    half = judged(
        Made({"a": {"iae": iae}}, ["scale=1", "scale=2"], 50, undone), "failures(a) <= 0.5"
    )
    assert list(half.reasons())[-1] == "no draw has runs of all laws in failures(a) at scale=2"
    some = np.where(np.arange(100) < 20, nan, 0.0)
    runs = Made({"a": {"iae": np.ones(100), "energy": some}})
    open_ = judged(runs, "share(a.energy <= 1) >= 0.85")
    assert open_.answer is None
    assert "a number is missing in 20" in open_.evidence()
    assert judged(runs, "share(a.energy <= 1) >= 0.6").answer is True
    assert judged(runs, "quantile(a.energy, 0.5) <= 1").answer is True
    assert judged(runs, "quantile(a.energy, 0.85) <= 1").answer is None


def test_verdicts_as_plain_data_and_as_a_table() -> None:
    runs = study(a=np.r_[np.ones(5), inf], b=np.ones(6))
    verdict = judged(runs, "quantile(a.iae, 0.9) <= 2")
    plain = json.loads(json.dumps(verdict.as_json(), allow_nan=False))
    assert plain["verdict"] == "cannot tell"
    assert plain["statistics"][0]["high"] is None
    assert plain["expect"] == "quantile(a.iae, 0.9) <= 2"
    table = as_markdown([verdict]).splitlines()
    assert table[2].startswith("| S1 | One is better. (ours) | **cannot tell** | `quantile(a.iae")
    assert table[2].count(" | ") == 4


def test_names_of_text_are_escaped_in_the_table() -> None:
    text = as_markdown([judged(study(["a|b"], a=np.ones((1, 6))), "failures(a) <= 0.9")])
    assert "a\\|b" in text
