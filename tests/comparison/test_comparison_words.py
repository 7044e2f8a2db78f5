"""The language of claims: what it computes, what it refuses, every verdict planted both ways."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from known_signals import ABOUT
from paper_samples import rerun

from podusv_cli.comparison.claims import ParsedClaim, judge
from podusv_cli.comparison.curves import Curve, decay, pointwise
from podusv_cli.comparison.expressions import Evaluation, parse, with_labels
from podusv_cli.core.about import Claim
from podusv_cli.scenario.load import load

CORRECTED = Path(__file__).parents[2] / "configs/mu_2017/corrected.yaml"


class Planted:
    """A run with known numbers: z_e falls linearly from 10 m to 0 over 10 s."""

    def __init__(
        self, scale: float = 1.0, until: float = 10.0, every: int = 1, step: int = 1
    ) -> None:
        self.scale, self.until, self.every, self.step = scale, until, every, step
        self.ending = "" if until == 10.0 else f"diverged at t = {until:g} s"

    def metric(self, name: str) -> float:
        scale = math.nan if self.ending else self.scale
        return {"iae": 50.0, "peak_tau_u": 300.0}.get(name, math.nan) * scale

    def signal(self, name: str) -> np.ndarray:
        t = np.linspace(0.0, 10.0, 101)
        t = t[t <= self.until + 1e-9][:: self.every * self.step]
        known = {"time": t, "z_e": self.scale * (10.0 - t), "x_d": 0.5 * t, "tau_u": 0 * t + 2.0}
        return known.get(name, np.empty(0))

    def has(self, name: str) -> bool:
        return len(self.signal(name)) > 0

    def check(self, name: str) -> bool | None:
        return None if self is RUNS["cut"] else not self.ending


RUNS = {
    "a": Planted(),
    "b": Planted(2.0),
    "c": Planted(1.01),
    "lost": Planted(until=8.1),
    "cut": Planted(until=3.0),
    "thin": Planted(every=30),  # logged up to 9 s
    "even": Planted(every=20),  # logged up to 10 s
    "coarse": Planted(step=20),  # a step of 2 s, each logged
}


def judged(text: str, tolerance: float = 0.05, runs=RUNS) -> tuple[bool | None, Evaluation]:
    evaluation = Evaluation(runs, tolerance)
    return evaluation.holds(parse(text, runs, ABOUT)), evaluation


def verdict(text: str, tolerance: float = 0.05):
    answer, found = judged(text, tolerance)
    return answer, found.numbers


@pytest.mark.parametrize(
    ("kind", "true", "false"),
    [
        ("near a number", "a.peak_tau_u == 310", "a.peak_tau_u == 320"),
        ("order", "a.iae < b.iae", "b.iae < a.iae"),
        ("chain", "a.iae < b.iae < 3 * a.iae", "a.iae < b.iae < a.iae"),
        ("ratio", "b.iae / a.iae > 1.5", "b.iae / a.iae > 3"),
        ("bound", "max(abs(a.z_e)) <= 10", "max(abs(b.z_e)) <= 10"),
        ("window", "mean(a.z_e, 0, 4) == 8", "mean(a.z_e, 6, 10) == 8"),
        ("rate", "max(rate(a.x_d)) == min(rate(a.x_d))", "final(a.x_d) == final(a.z_e)"),
        ("integral", "integral(a.z_e) == a.iae", "integral(b.z_e) == a.iae"),
        ("variation", "variation(a.z_e) == 10", "variation(b.z_e) == 10"),
        (
            "fast",
            "rms_above(a.z_e, 2) < rms_above(a.z_e, 0.1)",
            "rms_above(a.z_e, 0.1) < rms_above(a.z_e, 2)",
        ),
        ("plane", "max(hypot(a.z_e, a.x_d)) == 10", "max(hypot(a.z_e, a.x_d)) == 11"),
        ("check", "finished(a)", "finished(lost)"),
        ("denial", "not finished(lost)", "not finished(a)"),
        ("both", "finished(a) and a.iae < b.iae", "finished(a) and b.iae < a.iae"),
    ],
)
def test_planted_claims_of_every_kind(kind, true, false):
    assert verdict(true)[0] is True
    assert verdict(false)[0] is False


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a.iae < c.iae", "a.iae and c.iae differ by no more than the tolerance of 0.05"),
        ("lost.iae < a.iae", "lost.iae: lost diverged at t = 8.1 s"),
        ("max(a.z_e, 5, 20) < 100", "max(a.z_e, 5, 20): a ends at 10 s"),
        ("a.rmse < 1", "a.rmse: this run has none (root of the mean of z_e^2)"),
        ("max(a.psi_e) < 1", "a.psi_e: a does not log it"),
        ("finished(cut)", "finished(cut): cut diverged at t = 3 s"),
        ("max(lost.z_e) < 100", "max(lost.z_e): lost diverged at t = 8.1 s"),
        ("max(a.z_e - lost.z_e, 0, 9) < 1", "max(a.z_e - lost.z_e, 0, 9): lost diverged"),
        ("max(a.z_e, 4.01, 4.09) < 1", "max(a.z_e, 4.01, 4.09): nothing is logged in this window"),
        ("integral(a.z_e, 5, 5.05) < 1", "integral(a.z_e, 5, 5.05) is not a finite number"),
        ("variation(a.z_e, 5, 5.05) < 1", "variation(a.z_e, 5, 5.05) is not a finite number"),
        ("max(thin.z_e) < 1", "max(thin.z_e): thin logs only one step in 30, and"),
        ("max(abs(thin.z_e)) > 1", "log every step (log.every: 1), or use a metric, which sees"),
        ("integral(thin.z_e, 5, 7) < 1", "thin logs only one step in 30"),
        ("max(a.z_e - thin.z_e, 0, 9) < 1", "thin logs only one step in 30"),
        ("max(rate(thin.x_d)) < 1", "rate: thin logs only one step in 30"),
        ("final(rate(even.x_d)) < 1", "rate: even logs only one step in 20"),
        ("final(even.x_d, 0, 5) < 1", "even logs only one step in 20"),
        ("final(thin.z_e) == 1", "thin logs only one step in 30"),  # 0, at 10 s, is not logged
        ("a.iae / (a.iae - a.iae) < 1", "a.iae / (a.iae - a.iae) is not a finite number"),
        ("max(1 / (a.z_e - a.z_e)) < 1", "is not a finite number"),
    ],
)
def test_what_cannot_be_told_and_why(text, why):
    answer, found = judged(text)
    assert answer is None
    assert len(found.doubts) == 1
    assert why in found.doubts[0]


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("a.settling_time > 2 * b.iae", True),  # no planted run settles: later than any time
        ("2 * a.settling_time <= b.iae", False),
        ("a.settling_time == b.iae", False),
        ("a.settling_time > b.settling_time", None),
        ("lost.settling_time > a.iae", None),  # diverged: whether it had settled is unknown
        ("a.settling_time - b.settling_time < a.iae", None),
    ],
)
def test_an_event_that_never_happens_is_later_than_any_other(text, answer):
    assert verdict(text)[0] is answer


@pytest.mark.parametrize(
    ("given", "answer", "reason"),
    [
        ("a.iae < b.iae", "reproduced", ""),
        ("a.iae > b.iae", "cannot tell", "the premise does not hold: a.iae > b.iae"),
        ("lost.iae > b.iae", "cannot tell", "whether the premise holds is unknown: lost.iae: lost"),
    ],
)
def test_a_claim_whose_premise_fails_cannot_be_told(given, answer, reason):
    expect = "a.iae < b.iae"
    claim = Claim(says="x", source="x", given=given, expect=expect)
    trees = (parse(text, RUNS, ABOUT) for text in (expect, given))
    (found,) = judge([ParsedClaim("C", claim, *trees)], RUNS)
    assert found.verdict == answer
    assert found.reason.startswith(reason)
    assert bool(found.reason) == bool(reason)


@pytest.mark.parametrize(
    "text",
    [
        "max(lost.z_e, 0, 2) == 10",
        "min(lost.z_e, 0, 8.1) == 1.9",  # up to its last instant
        "max(rate(lost.x_d), 1, 2) == 0.5",
        "mean(abs(a.z_e - lost.z_e), 0, 8) == 0",
        "final(even.x_d) == 5",  # the last instant is logged
        "final(even.x_d - a.x_d) == 0",
        "max(abs(a.x_d - coarse.x_d)) == 0",  # another step is interpolated
        "thin.iae == a.iae",  # metrics see every step
    ],
)
def test_windows_that_a_run_covers_are_judged_whatever_became_of_it(text):
    answer, found = judged(text, tolerance=1e-9)
    assert answer is True
    assert not found.doubts


def test_no_verdict_flips_with_the_log_s_interval():
    answers, peaks = [], []
    for every in (1, 5000):
        keys = ("simulation.duration=60", f"log.every={every}")
        runs = {"law": rerun(load(CORRECTED, keys).scenario)}
        answers.append(judged("max(abs(law.tau_u_cmd)) < 200", 0.0, runs)[0])
        peaks.append(runs["law"].metric("peak_tau_u"))
    assert answers == [False, None]
    assert peaks[0] == peaks[1] > 25_000


def test_both_ends_of_a_window_belong_to_it():
    _, numbers = verdict("max(a.z_e, 2, 4) + 1000 * min(a.z_e, 2, 4) < 1")
    assert list(numbers.values()) == pytest.approx([8.0 + 6000.0])


@pytest.mark.parametrize(
    ("sign", "answers"),
    [
        # left side 94, 95, 99, 100, 101, 105, 106 against 100 with a tolerance of 5 %
        ("<", [True, None, None, None, None, None, False]),
        (">", [False, None, None, None, None, None, True]),
        ("<=", [True, True, True, True, True, True, False]),
        (">=", [False, True, True, True, True, True, True]),
        ("==", [False, True, True, True, True, True, False]),
    ],
)
def test_every_sign_at_its_limits(sign, answers):
    lefts = (94, 95, 99, 100, 101, 105, 106)
    assert [verdict(f"{left} {sign} 2 * a.iae")[0] for left in lefts] == answers


@pytest.mark.parametrize(
    ("sign", "answer"), [("<", False), (">", False), ("<=", True), (">=", True), ("==", True)]
)
def test_equal_numbers_without_tolerance(sign, answer):
    assert verdict(f"a.iae {sign} 50", tolerance=0.0)[0] is answer


def test_the_tolerance_of_an_order_is_of_the_larger_number():
    assert verdict("95.1 < 2 * a.iae")[0] is None
    assert verdict("-100 < -95.1 * a.iae / a.iae")[0] is None
    assert verdict("-106 < -2 * a.iae")[0] is True


def test_an_integral_knows_its_time():
    assert verdict("integral(coarse.tau_u) == 20", tolerance=1e-9)[0] is True
    assert verdict("mean(coarse.tau_u, 4, 8) == 2", tolerance=1e-9)[0] is True
    # Trapezoids over 0, 1, 4 at 0, 2, 4 s.
    assert verdict("mean(coarse.x_d * coarse.x_d, 0, 4) == 1.5", tolerance=1e-9)[0] is True


def test_names_of_a_scenario_stand_for_other_runs():
    text = "a.iae < b.iae and max(a.z_e, 0, 1) > 1 and finished(a)"
    found = Evaluation(RUNS)
    assert found.holds(with_labels(parse(text, RUNS, ABOUT), {"a": "b", "b": "a"})) is False
    assert list(found.numbers) == ["b.iae", "a.iae", "max(b.z_e, 0, 1)", "finished(b)"]


def test_a_run_may_have_the_name_of_a_function():
    tree = parse("max(max.z_e) < 1", ["max"], ABOUT)
    assert ast.unparse(with_labels(tree, {"max": "max_2"})) == "max(max_2.z_e) < 1"


def test_a_false_part_decides_even_beside_an_unknown_one():
    assert verdict("b.iae < a.iae and lost.iae < 1")[0] is False
    assert verdict("a.iae < b.iae and lost.iae < 1")[0] is None


def test_the_tolerance_decides():
    assert verdict("a.iae < c.iae", tolerance=0.001)[0] is True
    assert verdict("a.peak_tau_u == 320", tolerance=0.1)[0] is True


def test_the_numbers_are_shown_by_their_text():
    _, numbers = verdict("mean(a.z_e, 0, 4) / b.iae < 7")
    assert numbers == pytest.approx({"mean(a.z_e, 0, 4) / b.iae": 0.08})


def test_curves_of_different_logs_meet_at_the_same_times():
    fine, coarse = np.arange(5.0), np.arange(0.0, 9.0, 2.0)
    pair = [Curve(t, 3.0 * t, {}) for t in (fine, coarse)]
    difference = pointwise(np.subtract, pair)
    assert difference.time.tolist() == fine.tolist()
    assert not difference.values.any()


def test_the_decay_of_a_signal_is_the_rate_of_its_exponential():
    t = np.linspace(2.0, 7.0, 31)
    for scale in (3.0, -3.0):
        assert decay(t, scale * np.exp(-0.3 * t)) == pytest.approx(0.3, rel=1e-12)
    assert decay(t, np.exp(0.3 * t)) == pytest.approx(-0.3, rel=1e-12)
    assert math.isnan(decay(t, t - 2.0))  # 0 has no logarithm
    assert math.isnan(decay(t[:1], t[:1]))
