"""Skjetne and others (2005): the page against the runs, and the sway that the ellipse takes."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from conftest import VESSELS

import podusv
from podusv_cli.expressions.verdict import ANSWERS, OF_OWN, OWN

ROOT = Path(__file__).parents[2]
CONFIGS = ROOT / "configs" / "skjetne_2005"
RESULTS = ROOT / "results"
PAGE = (RESULTS / "skjetne_2005.md").read_text()
ROWS = re.findall(r"^\| (S\d+\w?) \| (.+?) \| (.+?) \| (.*?) ?\| (.+?) \|$", PAGE, re.M)
VERDICTS = {claim: verdict for claim, _, verdict, _, _ in ROWS}
FOUND = {claim: found for claim, *_, found in ROWS}
# Claims with the ship's own thrusters have a letter behind the claim's: t at 33, w at 25 rev/s.
OWN_THRUSTERS = {
    claim + letter: verdict
    for claim, _, _, own, _ in ROWS
    for letter, verdict in zip("tw", filter(None, own.split("; ")), strict=False)
}
COMPARISONS = (
    "ellipse",
    "far",
    "limits",
    "load",
    "thrusters",
    "thrusters_weak",
    "thrusters_far",
    "thrusters_load",
)


def in_words(claim: Any) -> str:
    answer = {word: answer for answer, word in ANSWERS.items()}[claim["verdict"]]
    return OF_OWN[answer] if claim["source"].startswith(OWN) else ANSWERS[answer]


@cache
def compared(name: str) -> Any:
    return podusv.compare(CONFIGS / f"{name}.yaml", figures=False)


@pytest.mark.papers
@pytest.mark.parametrize("name", COMPARISONS)
def test_the_verdicts_on_the_page_are_those_of_the_comparison(name):
    verdicts = compared(name).claims
    assert len(verdicts)
    for claim, row in verdicts.iterrows():
        assert (VERDICTS | OWN_THRUSTERS)[str(claim)] == in_words(row), claim


def test_every_verdict_with_the_ship_s_own_thrusters_is_of_a_claim():
    assert set(OWN_THRUSTERS) == {"S1t", "S1w", "S2t", "S2w", "S3t", "S4t", "S5t", "S5w"}


def across_needed(u: float) -> float:
    """Sway force [N] where the ellipse bends most, at this speed ahead [m/s], by the hull alone."""
    hull, a, b = VESSELS["cybership2"], 5.5, 4.5
    r = u * a / b**2
    return float(hull.m11 * u * r - hull.Y_r * r - hull.Y_rr * r * r)


def test_the_sway_that_the_ellipse_takes_is_that_of_its_sharpest_bend():
    """Where v is 0 and r has its largest value; a little before it r still grows."""
    assert across_needed(0.15) == pytest.approx(0.4588, abs=1e-4)
    assert across_needed(0.25) == pytest.approx(0.9462, abs=1e-4)
    changes = {"controllers": {}, "claims": None, "doubt": None, "simulation.duration": 300.0}
    law = {"kind": "maneuvering", "speed": 0.15, "speed_after": 0.25, "speed_change": 120.0}
    run = podusv.simulate(CONFIGS / "ellipse.yaml", changes | {"controller": law})
    for since, until, speed in ((80.0, 120.0, 0.15), (200.0, 300.0, 0.25)):
        there = (run["time"] >= since) & (run["time"] <= until)
        assert np.abs(run["tau_v"][there]).max() == pytest.approx(across_needed(speed), rel=0.01)


def test_weak_thrusters_lack_sway_where_they_make_the_moment_of_the_bend():
    """By hand, at 25 rev/s: a propeller ahead with its rudder, one astern, and the tunnel."""
    scenario = podusv.load(CONFIGS / "thrusters_weak.yaml").singles()["gradient"]
    stern, _, bow = scenario.actuator.pods
    surge, sway, moment = 0.158, across_needed(0.15), 0.086
    tunnel = bow.T_nn * bow.n_max**2
    rudder = sway - tunnel  # what is missing, at the stern
    apart = (moment - bow.x * tunnel - stern.x * rudder) / 0.078  # N between the propellers
    ahead = 0.5 * (surge + apart)
    assert (tunnel, rudder, ahead) == pytest.approx((0.098, 0.361, 1.607), abs=1e-3)
    given = stern.rudder.lift * stern.rudder.stall * ahead / stern.T_nn
    assert given == pytest.approx(0.28, abs=5e-3)
    assert given < 0.8 * rudder


@pytest.mark.papers
def test_the_numbers_on_the_page_are_those_of_the_comparisons():
    far, own, limits = (compared(name).table for name in ("far", "thrusters_far", "limits"))
    energies = far.loc["energy"]
    assert f"{energies['gradient']:.0f} against {energies['tracking']:.0f} J" in FOUND["S3"]
    assert FOUND["S3c"] == f"{energies['filtered']:.0f} J"
    energies = own.loc["energy"]
    assert f"{energies['gradient']:.2f} against {energies['tracking']:.2f} J" in FOUND["S3"]
    for name, form in (("peak_tau_u", ".2f"), ("peak_tau_v", ".1f")):
        peaks = far.loc[name]
        told = f"{peaks['gradient']:{form}} against {peaks['tracking']:{form}} N"
        assert told in FOUND["S3b"]
    times = limits.loc["settling_time"]
    assert f"{times['gradient']:.0f} s, tracking {times['tracking']:.0f} s" in FOUND["S6c"]
    left = {
        (name, law): [
            1000.0 * np.hypot(run["z_1u"], run["z_1v"])[(t >= a) & (t <= b)].max()
            for a, b in ((80.0, 120.0), (200.0, 300.0))
        ]
        for name, law in (
            ("load", "adaptive"),
            ("load", "gradient"),
            ("thrusters_load", "adaptive"),
        )
        for run in (compared(name)[law],)
        for t in (run["time"],)
    }
    learnt, plain, weak = ([f"{mm:.0f}" for mm in pair] for pair in left.values())
    assert f"{learnt[0]} mm at 0.15 m/s, {learnt[1]} mm at 0.25 m/s" in FOUND["S4"]
    assert f"own thrusters {weak[0]} and {weak[1]} mm" in FOUND["S4"]
    assert FOUND["S4b"] == f"{plain[0]} and {plain[1]} mm"


def test_the_verdicts_and_numbers_of_the_study_are_those_on_the_page():
    studies = ("claims.json", "thrusters.json")
    files = [json.loads((RESULTS / "skjetne_2005" / name).read_text()) for name in studies]
    verdicts = [claim for file in files for claim in file["claims"]]
    told = dict(re.findall(r"^\| ([GT]\d) \| .+? \| (.+?) \| .+? \|$", PAGE, re.M))
    assert {claim["claim"]: in_words(claim) for claim in verdicts} == told
    failures = [claim["statistics"][0]["estimate"] for claim in files[1]["claims"]]
    shown = re.findall(r"^\| T\d .* (\d+) % (?:of the draws )?fail", PAGE, re.M)
    assert [int(share) for share in shown] == [round(100.0 * share) for share in failures]
    numbers = pd.read_csv(RESULTS / "skjetne_2005" / "summary.csv")
    for law, *cells in re.findall(r"^\| `(\w+)` \| (.+?) \| (.+?) \| (.+?) \|$", PAGE, re.M):
        rows = numbers[numbers.law == law].sort_values("cell")
        failed = rows[rows.metric == "energy"].failed
        medians = [rows[rows.metric == name].q50 for name in ("settling_time", "energy")]
        assert cells == [
            "; ".join(f"{1000 * share:.0f}" for share in failed),
            *("; ".join(f"{number:.1f}" for number in numbers) for numbers in medians),
        ]
