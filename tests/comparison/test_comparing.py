"""Comparisons from scenario or folder to table, verdicts, figures and report."""

import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import pandas as pd
import pytest
from old_results import draw_quickly

from podusv_cli.core.errors import ScenarioError
from podusv_cli.process.extras import Extras
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load
from podusv_cli.workflows import compare, run

SCENARIO = """
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: saturated}
start: {x: -5.0, y: -2.0, u: 0.3}
simulation: {duration: 20.0}
metrics: {settling_radius: 2.0}
controller: {kind: adaptive_neural, k_ze: 0.2}
controllers:
  fast: {}
  slow: {k_ze: 0.02}
  pid: {kind: pid, K_Pu: 100.0}
claims:
  planted_true: {says: Fast is faster., source: here, expect: fast.iae < slow.iae}
  planted_false: {says: Slow is faster., source: here, expect: slow.iae < fast.iae}
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "three.yaml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def done(config, tmp_path_factory):
    target = tmp_path_factory.mktemp("compared") / "all"
    with pytest.MonkeyPatch.context() as patch:
        draw_quickly(patch)
        return compare.compare([config], run.Request(out=target))


def quick(*overrides, out):
    return run.Request(overrides, out, figures=False)


def test_run_takes_the_one_controller_and_says_what_it_left(config, tmp_path):
    said = []
    asked = replace(quick("simulation.duration=1", out=tmp_path / "x"), say=said.append)
    done = run.run(config, asked)
    assert done.controller == "adaptive_neural"
    assert said[0] == (
        "runs `controller` (adaptive_neural) only; `podusv compare` runs fast, slow, pid"
    )
    alone = load(done.folder / "resolved.yaml").scenario
    assert not alone.controllers
    assert not alone.claims


def test_planted_claims_get_their_verdicts_with_numbers(done):
    verdicts = json.loads((done.folder / "claims.json").read_text())["claims"]
    assert [v["verdict"] for v in verdicts] == ["reproduced", "not reproduced"]
    iae = {e.label: e.metric("iae") for e in done.result.runs}
    assert verdicts[0]["numbers"] == pytest.approx(
        {"fast.iae": iae["fast"], "slow.iae": iae["slow"]}
    )


def test_the_table_is_the_same_in_every_form(done):
    frame = pd.read_csv(done.folder / "comparison.csv", index_col=0)
    iae_e = {entry.label: entry.metric("iae_e") for entry in done.result.runs}
    assert frame.loc["iae_e", ["fast", "slow", "pid"]].to_dict() == pytest.approx(iae_e)
    assert frame.loc["iae_e", "slow/fast"] == pytest.approx(iae_e["slow"] / iae_e["fast"])
    best = min(iae_e, key=iae_e.get)
    markdown = (done.folder / "comparison.md").read_text()
    row = next(line for line in markdown.splitlines() if line.endswith("| `iae_e` |"))
    cells = dict(zip(["fast", "slow", "pid"], row.split("|")[3:6], strict=True))
    assert [label for label, cell in cells.items() if "*" in cell] == [best]
    latex = (done.folder / "comparison.tex").read_text()
    assert r"\toprule" in latex
    whole, point, rest = f"{iae_e[best]:.3g}".partition(".")
    assert rf"\textbf{{{whole}}} & \textbf{{{point}{rest}}}" in latex
    nearer = next(line for line in markdown.splitlines() if line.endswith("| `iae` |"))
    assert "*" not in nearer  # the laws keep a standoff: being nearer is not better


def test_runs_that_all_diverge_are_still_reported(config, tmp_path):
    request = run.Request(("start.u=1e300",), tmp_path / "x")
    done = compare.compare([config], request)
    assert all(ending.startswith("diverged at t = 0 s") for ending in done.result.endings.values())
    assert {verdict.verdict for verdict in done.result.verdicts} == {"cannot tell"}
    assert (done.folder / "report.html").is_file()


def test_a_run_cannot_take_the_place_of_the_figures(config, tmp_path):
    request = quick("controllers.figures.kind=pid", out=tmp_path / "x")
    with pytest.raises(ScenarioError, match="is the folder of the figures"):
        compare.compare([config], request)


def test_other_differences_are_named(done, config, tmp_path):
    limits = quick("actuator.surge_limit=4", out=tmp_path / "x")
    other = compare.compare([config, done.folder / "fast"], limits).result
    assert other.differences == {
        "actuator.surge_limit": {"fast": 4.0, "slow": 4.0, "pid": 4.0, "fast_2": 8.0}
    }
    assert not done.result.differences


def test_costs_are_measured_side_by_side(done, config, monkeypatch):
    def costs(runs):
        return [{"law_ns": float(place)} for place, _ in enumerate(runs)]

    monkeypatch.setattr(compare, "law_costs", costs)
    first, *rest = done.result.runs
    singles = load(config).scenario.singles()
    made = {one.label: Case.of(singles[one.label]) for one in rest}
    entries = compare._with_costs([first, *rest], made, Extras())
    assert [entry.metric("law_ns") for entry in entries[1:]] == [0.0, 1.0]
    assert math.isnan(entries[0].metric("law_ns"))


class Links(HTMLParser):
    """Everything that a page would load."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attributes):
        self.found += [v for name, v in attributes if name in ("src", "href", "data") and v]


def test_the_report_needs_nothing_from_outside(done):
    page = (done.folder / "report.html").read_text()
    links = Links()
    links.feed(page)
    assert links.found
    assert all(link.startswith(("data:", "#")) for link in links.found)
    assert not re.search(r"url\((?!#)|@import|\bimport\(|fetch\(|XMLHttpRequest|new Image", page)
