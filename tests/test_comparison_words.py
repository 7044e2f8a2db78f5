"""The language of claims: what it computes, what it refuses, every verdict planted both ways."""

import math

import numpy as np
import pytest

from podusv_cli.comparison.parsing import ExpressionError, parse


class Planted:
    """A run with known numbers: z_e falls linearly from 10 m to 0 over 10 s."""

    def __init__(self, scale: float = 1.0, finished: bool = True) -> None:
        self.scale, self.is_finished = scale, finished

    def metric(self, name: str) -> float:
        return {"iae": 50.0, "peak_tau_u": 300.0}.get(name, math.nan) * self.scale

    def signal(self, name: str) -> np.ndarray:
        t = np.linspace(0.0, 10.0, 101)
        return {"time": t, "z_e": self.scale * (10.0 - t), "x_d": 0.5 * t}.get(name, np.empty(0))

    def check(self, name: str) -> bool:
        return self.is_finished


RUNS = {"a": Planted(), "b": Planted(2.0), "c": Planted(1.01), "lost": Planted(math.nan, False)}


def verdict(text: str, tolerance: float = 0.05):
    numbers: dict[str, float] = {}
    return parse(text, RUNS).holds(RUNS, tolerance, numbers), numbers


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
    "text",
    [
        "a.iae < c.iae",  # closer than the tolerance
        "lost.iae < a.iae",
        "max(a.z_e, 5, 20) < 100",  # the run ends before the window does
        "a.rmse < 1",  # this run has no such metric
    ],
)
def test_what_cannot_be_told(text):
    assert verdict(text)[0] is None


def test_a_false_part_decides_even_beside_an_unknown_one():
    assert verdict("b.iae < a.iae and lost.iae < 1")[0] is False
    assert verdict("a.iae < b.iae and lost.iae < 1")[0] is None


def test_the_tolerance_decides():
    assert verdict("a.iae < c.iae", tolerance=0.001)[0] is True
    assert verdict("a.peak_tau_u == 320", tolerance=0.1)[0] is True


def test_the_numbers_are_shown_by_their_text():
    _, numbers = verdict("mean(a.z_e, 0, 4) / b.iae < 7")
    assert numbers == pytest.approx({"mean(a.z_e, 0, 4) / b.iae": 0.08})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a.iae", "is no condition"),
        ("a.z_e < 3", "runs over time: sum it up with one of"),
        ("a.ia < 3", "unknown signal or metric 'ia'; did you mean 'iae'?"),
        ("d.iae < 3", "unknown run 'd' (allowed: a, b, c, lost)"),
        ("maximum(a.z_e) < 3", "unknown function 'maximum'"),
        ("max(a.iae) < 3", "is a number, a signal is wanted"),
        ("max(a.z_e, 5) < 3", "takes a signal, or a signal and two times"),
        ("max(a.z_e, 5, 2) < 3", "the first time must lie before the second"),
        ("max(a.z_e, a.iae, 9) < 3", "times are plain numbers"),
        ("a.iae < b.iae or finished(a)", "joined with `and` only"),
        ("a.iae ** 2 < 3", "calculate with + - * / only"),
        ("a.iae != 3", "compare with <, <=, >, >=, =="),
        ("ended(a)", "unknown check 'ended'"),
        ("finished(a.iae)", "takes the name of one run"),
        ("__import__('os').system('true') < 1", "called by name"),
        ("a.__class__ < 1", "unknown signal or metric '__class__'"),
        ("[x for x in a] < 1", "has no meaning here"),
        ("'text' < 1", "is no number"),
        ("True < 1", "is no number"),
        ("a.iae <", "cannot read"),
        ("", "cannot read"),
        ("(" * 300 + ")" * 300, "is longer than 500 characters"),
    ],
)
def test_what_means_nothing_gets_a_sentence(text, says):
    with pytest.raises(ExpressionError) as error:
        parse(text, RUNS)
    assert says in str(error.value)
