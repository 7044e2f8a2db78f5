"""The learned law: its page says what the committed study says, and it goes with its bow ahead."""

import math

import pandas as pd
import pytest
from command_samples import ROOT

import podusv

PAGE = (ROOT / "results/learned.md").read_text()
STUDY = ROOT / "results/studies/learned"


def test_the_page_has_the_numbers_of_the_study():
    found = pd.read_csv(STUDY / "summary.csv").set_index(["law", "metric"])
    lines = [line.split(" | ") for line in PAGE.splitlines()]
    table = {cells[0].strip("| "): cells[1:] for cells in lines if len(cells) == 6}
    for law in ("policy", "velocity_vector", "momentum_vector", "adrc", "pid"):
        iae = found.loc[law, "iae"]
        share = [f"{100 * iae[name]:.1f}" for name in ("failed", "failed_low", "failed_high")]
        around = [f"{iae[name]:.1f}" for name in ("q50", "q50_low", "q50_high")]
        assert table[law] == [
            *(f"{a} [{b}, {c}]" for a, b, c in (share, around)),
            f"{1000 * found.loc[(law, 'z_e_steady'), 'q50']:.0f}",
            f"{found.loc[(law, 'tv_tau_u'), 'q50']:.1f}",
            f"{found.loc[(law, 'energy'), 'q50']:.0f} |",
        ]


def test_the_page_has_the_study_s_comparison_with_velocity_vector():
    pairs = pd.read_csv(STUDY / "pairs.csv").query("metric == 'iae' and a == 'policy'")
    pair = pairs.set_index("b").loc["velocity_vector"]
    assert (
        f"better in {100 * pair.a_wins:.1f} % of the draws and worse in {100 * pair.b_wins:.1f} %; "
        f"the median of the ratio is {pair.ratio:.3f} [{pair.ratio_low:.3f}, {pair.ratio_high:.3f}]"
    ) in " ".join(PAGE.split())


def test_the_page_says_where_velocity_vector_is_better():
    pairs = pd.read_csv(STUDY / "pairs.csv").query("a == 'policy' and b == 'velocity_vector'")
    settled, calm = (pairs.set_index("metric").loc[name] for name in ("z_e_steady", "tv_tau_u"))
    words = " ".join(PAGE.split())
    assert (
        f"larger in {100 * settled.b_wins:.1f} % of the draws, by a factor of {settled.ratio:.2f} "
        f"[{settled.ratio_low:.2f}, {settled.ratio_high:.2f}] in the median"
    ) in words
    assert f"{calm.ratio:.1f} times the variation of" in words
    assert f"in {100 * calm.a_wins:.1f} % of the draws it is calmer" in words


@pytest.mark.papers
@pytest.mark.parametrize("period", [0.0, 0.2])
def test_the_shipped_policy_follows_the_paper_s_target_without_turning_round(period):
    """Its training is over at 80 s; the circle turns the vessel once."""
    base = podusv.load("podusv:laws/learned.yaml")
    run = podusv.simulate(base.singles()["policy"], {"control.period": period})
    assert run.metrics["z_e_steady"] < 0.1
    assert run.metrics["iae"] < 1.1 * 214.3  # that of velocity_vector
    assert abs(run["psi"][-1]) / math.tau < 2.0


def test_the_page_has_the_comparison_with_searched_gains():
    judged = pd.read_csv(ROOT / "results/tuning/learned/judged.csv")
    for pair in judged.query("metric == 'iae'").itertuples():
        row = (
            f"| {pair.b} | {pair.ratio:.3f} [{pair.ratio_low:.3f}, {pair.ratio_high:.3f}] "
            f"| {100 * pair.a_wins:.1f} %, {100 * pair.b_wins:.1f} %"
        )
        assert row in PAGE
    beyond = judged.query("metric == 'iae_e'").iloc[0]
    assert f"beyond it the policy is better in {100 * beyond.a_wins:.1f} % of the draws" in PAGE
