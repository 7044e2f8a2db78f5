"""results/studies.md tells the committed tables of studies."""

import re
from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).parents[1] / "results"
PAGE = (RESULTS / "studies.md").read_text()
LAWS = {"proposed": "proposed", "DSC": "dsc", "Li": "li", "PID": "pid"}


def table(name):
    return pd.read_csv(RESULTS / "studies/hull_and_sea" / name)


def test_the_table_of_laws_is_that_of_the_study():
    summary = table("summary.csv").query("metric == 'iae'").set_index("law")
    rows = re.findall(
        r"^\| (\w+) \| (\S+) \[(\S+), (\S+)\] \| (\S+) \[(\S+), (\S+)\] \| (.*) \|$", PAGE, re.M
    )
    assert [row[0] for row in rows] == list(LAWS)
    for law, *told, last in rows:
        found = summary.loc[LAWS[law]]
        shares = [100 * found[name] for name in ("failed", "failed_low", "failed_high")]
        medians = [found[name] for name in ("q50", "q50_low", "q50_high")]
        assert told == [f"{x:.2f}" for x in shares] + [f"{x:.1f}" for x in medians]
        assert last == ("more than 5 % fail" if law == "PID" else f"{found.q95:.1f}")


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
