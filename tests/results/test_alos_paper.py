"""Fossen (2023): its page against the runs, algebra, and a plain loop of kinematics and law."""

from __future__ import annotations

import json
import math
import re
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rotation import one_in
from scipy.integrate import solve_ivp

import podusv
from podusv_cli.expressions.verdict import ANSWERS, OF_OWN, OWN

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs" / "fossen_2023"
RESULTS = ROOT / "results"
PAGE = (RESULTS / "fossen_2023.md").read_text()
ROWS = re.findall(r"^\| ([AG]\d+\w?) \| (.+?) \| (.+?) \| (.*?) ?\|$", PAGE, re.M)
VERDICTS = {claim: verdict for claim, _, verdict, _ in ROWS}
FOUND = {claim: found for claim, _, _, found in ROWS}
COMPARISONS = ("demo", "line", "far", "windward", "sensors")

DELTA, GAMMA, K_F = 10.0, 0.001, 0.3
PUSH, DRAG, INERTIA = 100.0, 77.554, 55.0 + 5.2815  # N, kg/s, kg
THROUGH = PUSH / DRAG  # m/s through the water
FLOW = 0.3 * np.array([math.cos(math.radians(30.0)), math.sin(math.radians(30.0))])
CRAB = math.asin(FLOW[0] / THROUGH)  # on a leg to the east
ACROSS = THROUGH * math.cos(CRAB)  # m/s across the leg per rad of heading


def in_words(claim: Any) -> str:
    answer = {word: answer for answer, word in ANSWERS.items()}[claim["verdict"]]
    return OF_OWN[answer] if claim["source"].startswith(OWN) else ANSWERS[answer]


def plain(offset: float, gamma: float, times: Any) -> tuple[Any, Any]:
    """Cross-track error and estimate on a leg to the east, with a heading that is exact.

    The law as its author's programs have it: ALOSpsi, and LOSobserver in continuous time.
    """
    lag = 1.0 / (K_F + 2.0 * math.sqrt(K_F) + 1.0)

    def rates(t: float, s: Any) -> Any:
        north, _, angle, lagged, crab, speed = s
        e = -north
        turn = angle - lagged
        off = np.angle(np.exp(1j * (math.pi / 2 - crab - math.atan(e / DELTA) - angle)))
        return [
            speed * math.cos(angle) + FLOW[0],
            speed * math.sin(angle) + FLOW[1],
            turn + K_F * off,
            turn / lag,
            gamma * DELTA * e / math.hypot(DELTA, e),
            (PUSH - DRAG * speed) / INERTIA,
        ]

    start = [-offset, 0.0, math.pi / 2, math.pi / 2, 0.0, -FLOW[1]]
    found = solve_ivp(
        rates, (0.0, times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-9, max_step=0.5
    )
    return -found.y[0], found.y[4]


def sailed(offset: float, gamma: float) -> Any:
    """One run of the leg of line.yaml."""
    law = {"kind": "mss", "U": 1.6, "gamma": gamma}
    return podusv.simulate(
        CONFIGS / "line.yaml", {"controllers": {}, "controller": law, "start.x": -offset}
    )


@pytest.mark.parametrize(
    ("offset", "gamma"), one_in(4, [*product((0.0, 30.0, -150.0), (GAMMA, 0.0))])
)
def test_a_run_is_that_of_a_plain_loop_but_for_what_the_heading_needs(offset, gamma):
    """The plain hull neither slips sideways nor lags behind its heading, which the start shows."""
    run = sailed(offset, gamma)
    error, crab = plain(offset, gamma, run["time"])
    assert np.abs(error - run["e_ct"]).max() < max(0.2, 0.07 * abs(offset))
    assert np.abs(crab - run["crab"]).max() < 0.01
    if abs(offset) < 100.0 or gamma == 0.0:
        assert abs(error[-1] - run["e_ct"][-1]) < 1e-5
    else:
        assert abs(error[-1]) > 400.0  # it goes away in the plain loop, too
        assert abs(error[-1] - run["e_ct"][-1]) < 4.0


def test_what_is_left_without_learning_is_the_lookahead_times_the_tangent():
    assert DELTA * math.tan(CRAB) == pytest.approx(2.0571, abs=5e-5)
    assert -sailed(0.0, 0.0)["e_ct"][-1] == pytest.approx(DELTA * math.tan(CRAB), rel=1e-6)


def test_error_and_estimate_fall_by_the_roots_of_the_linear_loop():
    slow, fast = sorted(-np.roots([1.0, ACROSS / DELTA, GAMMA * ACROSS]).real)
    assert (slow, fast) == pytest.approx((0.01095, 0.1153), abs=5e-5)
    run = sailed(0.0, GAMMA)
    late = (run["time"] > 150.0) & (run["time"] < 400.0)
    fitted = -np.polyfit(run["time"][late], np.log(np.abs(run["e_ct"][late])), 1)[0]
    assert fitted == pytest.approx(slow, rel=0.005)
    left = 1.0 + run["crab"][run["time"] == 282.7] / CRAB
    told = (fast * math.exp(-slow * 282.7) - slow * math.exp(-fast * 282.7)) / (fast - slow)
    assert told == pytest.approx(0.05, abs=2e-5)
    assert left == pytest.approx(told, abs=1e-3)  # the heading lags, which the roots leave out
    ilos = -np.roots([1.0, ACROSS / DELTA, ACROSS / DELTA * 0.001 / DELTA]).real
    assert min(ilos) == pytest.approx(1e-4, rel=0.01)
    kappa = GAMMA * DELTA**2  # of ILOS with equal poles
    assert kappa == pytest.approx(0.1)


@cache
def compared(name: str) -> Any:
    return podusv.compare(CONFIGS / f"{name}.yaml", figures=False)


@pytest.mark.papers
@pytest.mark.parametrize("name", COMPARISONS)
def test_the_verdicts_on_the_page_are_those_of_the_comparison(name):
    verdicts = compared(name).claims
    assert len(verdicts)
    for claim, row in verdicts.iterrows():
        assert VERDICTS[str(claim)] == in_words(row), claim


@pytest.mark.papers
def test_the_numbers_on_the_page_are_those_of_the_comparisons():
    demo, far = compared("demo"), compared("far")
    alos = demo["alos"]
    ends = [(137.5, 138.5), (235, 236), (460, 461), (703.5, 704.5), (916, 917), (1111, 1112)]
    errors = [
        np.abs(alos["e_ct"][(alos["time"] >= a) & (alos["time"] <= b)]).max() for a, b in ends
    ]
    *first, last = (f"{error:.2f}" for error in errors)
    assert f"{', '.join(first)} and {last} m" in FOUND["A4"]
    spans = [np.sum(alos["leg"] == k) * 0.05 for k in range(6)]
    assert f"legs last {round(min(spans))} to {round(max(spans))} s" in PAGE
    rms = demo.table.loc["e_ct_rms"]
    assert f"{rms['alos']:.2f} against {rms['los']:.2f} m rms" in FOUND["A5"]
    overshoots = [-far[law]["e_ct"].min() for law in ("alos", "ilos_equal", "adaptive")]
    assert "{:.1f} against {:.1f} m;".format(*overshoots) in FOUND["A3b"]
    assert FOUND["A3c"] == f"{overshoots[2]:.1f} m"
    away = abs(compared("windward")["alos"]["e_ct"][-1])
    assert f"{away:.0f} m away" in FOUND["A7"]


def test_the_verdicts_and_numbers_of_the_study_are_those_on_the_page():
    verdicts = json.loads((RESULTS / "fossen_2023" / "claims.json").read_text())["claims"]
    told = {claim["claim"]: in_words(claim) for claim in verdicts}
    assert set(told) == {"G1", "G2", "G3", "G4"}
    assert told.items() <= VERDICTS.items()
    numbers = pd.read_csv(RESULTS / "fossen_2023" / "summary.csv")
    numbers = numbers[numbers.metric == "e_ct_integral"]
    rows = re.findall(r"^\| `mss`.* \| (\d+) \| (\d+) \|$", PAGE, re.M)
    assert rows == [(f"{500 * row.failed:.0f}", f"{row.q50:.0f}") for row in numbers.itertuples()]
    (nearer,) = (claim["statistics"][0]["estimate"] for claim in verdicts if claim["claim"] == "G4")
    assert f"in {100 * nearer:.1f} % of the starts" in FOUND["G4"]
