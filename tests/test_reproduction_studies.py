"""results/studies.md tells the committed tables of studies."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from podusv_cli.scenario.load import load
from podusv_cli.studies.study.draws import drawn, draws
from podusv_cli.studies.study.plan import plan

RESULTS = Path(__file__).parents[1] / "results"
STUDIES = RESULTS.parent / "configs" / "studies"
PAGE = (RESULTS / "studies.md").read_text()
LAWS = {"proposed": "proposed", "DSC": "dsc", "Li": "li", "PID": "pid"}
ABLATED = LAWS | {"no adaptation": "no_adaptation"}
HULLS, TOLD = PAGE.split("## True hull and told hull")


def table(name, study="hull_and_sea"):
    return pd.read_csv(RESULTS / "studies" / study / name)


@pytest.mark.parametrize(
    ("study", "text", "laws"), [("hull_and_sea", HULLS, LAWS), ("unknown_dynamics", TOLD, ABLATED)]
)
def test_the_table_of_laws_is_that_of_the_study(study, text, laws):
    summary = table("summary.csv", study).query("metric == 'iae'").set_index("law")
    rows = re.findall(
        r"^\| ([\w ]+) \| (\S+) \[(\S+), (\S+)\] \| (\S+) \[(\S+), (\S+)\] \| (.*) \|$", text, re.M
    )
    assert [row[0] for row in rows] == list(laws)
    for law, *told, last in rows:
        found = summary.loc[laws[law]]
        shares = [100 * found[name] for name in ("failed", "failed_low", "failed_high")]
        medians = [found[name] for name in ("q50", "q50_low", "q50_high")]
        assert told == [f"{x:.2f}" for x in shares] + [f"{x:.1f}" for x in medians]
        assert last == ("more than 5 % fail" if found.failed > 0.05 else f"{found.q95:.1f}")


def test_the_sentences_about_pairs_are_those_of_the_study():
    pairs = table("pairs.csv").query("metric == 'iae'").set_index(["a", "b"])
    for b, wins, losses in (("pid", "77.5", "21.9"), ("li", "5.0", "73.1")):
        found = pairs.loc["proposed", b]
        assert (f"{100 * found.a_wins:.1f}", f"{100 * found.b_wins:.1f}") == (wins, losses)
        assert wins in PAGE
        assert losses in PAGE
    ratio = pairs.loc["proposed", "li"]
    told = f"{ratio.ratio:.3f} [{ratio.ratio_low:.3f}, {ratio.ratio_high:.3f}]"
    assert told in " ".join(PAGE.split())


def test_hulls_matter_less_than_the_start():
    found = table("sensitivity.csv").query("metric == 'iae' and law == 'proposed'")
    by = found.set_index("quantity")["correlation"].abs()
    assert round(by["start.x"], 2) == 0.77
    hull = [q for q in by.index if not q.startswith(("start.", "disturbance."))]
    assert len(hull) == 6
    assert by[hull].max() < 0.12


def test_the_sentences_about_told_hulls_are_those_of_the_study():
    text = " ".join(TOLD.split())
    verdicts = json.loads((RESULTS / "studies/unknown_dynamics/claims.json").read_text())["claims"]
    assert {one["claim"]: one["verdict"] for one in verdicts} == {
        "U1": "reproduced", "U2": "not reproduced", "U3": "reproduced", "U4": "reproduced",
    }  # fmt: skip
    pairs = table("pairs.csv", "unknown_dynamics").query("metric == 'iae'").set_index(["a", "b"])
    adapted, li, pid = (pairs.loc["proposed", law] for law in ("no_adaptation", "li", "pid"))
    assert (adapted.n, adapted.a_wins, li.a_wins) == (2000, 1.0, 0.0)
    for one in (adapted, li):
        assert f"{one.ratio:.3f} [{one.ratio_low:.3f}, {one.ratio_high:.3f}]" in text
    assert f"better by more than 1 % in {100 * li.b_wins:.1f} % of the draws and worse in n" in text
    low, high = 100 * pid.b_wins_low, 100 * pid.b_wins_high
    assert f"worse in {100 * pid.a_wins:.1f} % of the draws (U3) and better in" in text
    assert f"better in {100 * pid.b_wins:.1f} % [{low:.1f}, {high:.1f}]" in text
    summary = table("summary.csv", "unknown_dynamics").query("metric == 'z_e_steady'")
    steady = summary.set_index("law")
    assert steady.loc["proposed"].q95 < 0.502
    assert f"without adaptation the median is {steady.loc['no_adaptation'].q50:.2f} m" in text


def test_what_the_laws_are_told_hardly_matters():
    found = table("sensitivity.csv", "unknown_dynamics").query("metric == 'iae'")
    by = found[found.law == "proposed"].set_index("quantity")["correlation"].abs().round(2)
    told = [q for q in by.index if q.startswith(("nominal.", "told_"))]
    assert len(told) == 4
    assert by[told].max() <= 0.04
    assert by[["surge_damping", "vessel.m"]].tolist() == [0.86, 0.49]
    assert round(found.by_chance.max(), 2) == 0.04


def test_the_sentences_about_the_error_beyond_the_standoff_are_those_of_the_studies():
    text = " ".join(PAGE.split())
    hulls, told = (
        table("pairs.csv", study).query("metric == 'iae_e'").set_index(["a", "b"]).loc["proposed"]
        for study in ("hull_and_sea", "unknown_dynamics")
    )
    pid, li = hulls.loc["pid"], hulls.loc["li"]
    assert f"better in {100 * pid.a_wins:.1f} % and worse in {100 * pid.b_wins:.1f} %" in text
    assert f"by the error in {100 * li.b_wins:.1f} % and {100 * li.a_wins:.1f} %" in text
    assert f"the errors {li.ratio:.3f} [{li.ratio_low:.3f}, {li.ratio_high:.3f}]" in text
    assert (
        f"{100 * (li.ratio - 1):.0f} % worse in the median" in (RESULTS / "README.md").read_text()
    )
    for law in ("no_adaptation", "li"):
        one = told.loc[law]
        assert f"{one.ratio:.3f} [{one.ratio_low:.3f}, {one.ratio_high:.3f}]" in text
    assert f"with Li better in {100 * told.loc['li'].b_wins:.1f} %" in text
    assert told.loc["pid"].a_wins == 1.0


def test_the_told_mass_sets_peak_demand_and_settled_error():
    found = table("sensitivity.csv", "unknown_dynamics").query("law == 'proposed'")
    by = found.set_index(["metric", "quantity"])["correlation"]
    told = " ".join(TOLD.split())
    assert f"the peak demand ({by['peak_tau_u', 'nominal.m']:.2f})" in told
    assert f"about a millimetre ({by['e_steady', 'nominal.m']:.2f})" in told


@pytest.mark.parametrize("config", sorted(STUDIES.glob("*.yaml")), ids=lambda path: path.stem)
def test_no_published_study_draws_what_a_metric_is_measured_by(config):
    """The standoff, and the execute and switch of trials: all runs of a law have the same."""
    made = plan(load(config))
    for law in made.laws:
        single = made.single(law, 0)
        watching = single.observer()
        same = watching.constants_for(single.closed_loop())
        for draw in draws(made.sweep, 0, 5):
            loop = drawn(single, made.sweep.vary, draw).closed_loop()
            assert watching.constants_for(loop) == same
