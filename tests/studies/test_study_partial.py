"""Unfinished studies compare laws on common draws; studies on Sobol' points have no intervals."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from small_study import TEXT, small, written

from podusv_cli.core.errors import ScenarioError, UsageError
from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making.dispatch import StudyDriver
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import Store
from podusv_cli.studies.making.unit import make
from podusv_cli.workflows import sweep


def partial_study(folder, **ranges):
    """A study of 40 draws, of which each law has only some."""
    config = written(folder / "small.yaml")
    plan, place, texts = sweep._plan_study(config, sweep.Request(out=folder / "study"))
    store = Store(place, about(plan))
    store.open("now", texts)
    for law, pieces in ranges.items():
        for first, count in pieces:
            store.write(make(plan, Unit(law, 0, first, count)))
    return store


@pytest.mark.slow
def test_an_unfinished_study_compares_laws_on_the_draws_that_all_have(podusv, tmp_path):
    store = partial_study(tmp_path, pid=[(0, 20)], li=[(8, 20)])
    done = sweep.report(store.folder, sweep.Request(figures=False))
    told = "preliminary: 12 of 40 draws that all 2 laws have"
    assert done.results.preliminary == told
    assert set(done.results.summary.n) == {12}
    assert set(done.results.pairs.n) == set(done.results.sensitivity.n) == {12}
    (verdict,) = done.results.verdicts
    assert verdict.draws == 12
    iae = {law: store.runs().metric(law, "iae")[0, 8:20] for law in ("pid", "li")}
    medians = done.results.summary.query("metric == 'iae'").set_index("law").q50
    assert medians["pid"] == np.sort(iae["pid"])[5]
    said = podusv("sweep", "report", store.folder, "--no-figures")
    assert said.out.startswith(f"{told}; continue with: podusv sweep run ")
    assert told.capitalize() in (store.folder / "report.html").read_text()
    assert done.results.made_runs == 40  # all runs are kept, exported and not made again
    table = podusv("sweep", "export", store.folder).out.strip()
    assert len(Path(table).read_text().splitlines()) == 41
    assert {law: int(mask.sum()) for (law, _), mask in store.covered_draws().items()} == {
        "pid": 20,
        "li": 20,
    }


def test_laws_without_a_common_draw_are_not_compared(tmp_path):
    store = partial_study(tmp_path, pid=[(0, 8)], li=[(8, 8)])
    with pytest.raises(UsageError, match=r"no draw in "):
        sweep.report(store.folder, sweep.Request(figures=False))
    assert sum(int(mask.sum()) for mask in store.covered_draws().values()) == 16


def test_laws_advance_together(tmp_path):
    plan = small(draws=1000, grid="{disturbance.scale: [0.5, 1]}")
    driver = StudyDriver(
        Store(tmp_path / "study", about(plan)), plan, lambda tally: None, float("inf"), (1, 1)
    )
    reached = dict.fromkeys(driver.missing(), 0)
    for _, (_, _, unit) in zip(range(100), driver, strict=False):
        reached[unit.law, unit.cell] = unit.first + unit.count
        assert max(reached.values()) - min(reached.values()) <= unit.count


SOBOL = ("  seed: 7\n", "  seed: 7\n  design: sobol\n")
CLAIMS = TEXT[TEXT.index("  claims:") :]


def test_claims_on_sobol_points_are_refused(tmp_path):
    config = written(tmp_path / "small.yaml", SOBOL)
    with pytest.raises(ScenarioError, match=r"small.yaml:13:\d+: sweep.design: Sobol' points are"):
        sweep.run(config, sweep.Request(out=tmp_path / "study"), lambda tally: None)
    assert not (tmp_path / "study").exists()


@pytest.mark.parametrize("more", [(), ("--force",)])
def test_an_early_interrupt_says_how_to_go_on(podusv, tmp_path, monkeypatch, more):
    def interrupted(*_):
        raise KeyboardInterrupt

    config = written(tmp_path / "small.yaml")
    monkeypatch.setattr("podusv_cli.workflows.sweep.check_fits", interrupted)
    said = podusv("sweep", "run", config, "--out", tmp_path / "study", *more)
    assert said.code == 130
    without = " without --force" if more else ""
    assert said.err.endswith(f"interrupted; the same command{without} goes on\n")


@pytest.mark.slow
def test_sobol_points_have_no_intervals(podusv, tmp_path):
    success = "  success: finished and iae <= 0.215\n"
    config = written(tmp_path / "small.yaml", SOBOL, (CLAIMS, success))
    done = sweep.run(config, sweep.Request(out=tmp_path / "study"), lambda tally: None)
    assert not done.missing
    for name in ("summary", "pairs", "sensitivity"):
        frame = getattr(done.results, name)
        ends = [c for c in frame if c.endswith(("_low", "_high")) or c == "by_chance"]
        assert ends
        assert frame[ends].isna().all(axis=None)
    assert done.results.sensitivity.correlation.notna().any()
    page = (done.folder / "report.html").read_text()
    assert "not independent: there are no intervals and no verdicts" in page
    assert "% interval" not in page
    assert not re.search(r"\bnan\b", re.sub(r"<svg.*?</svg>", "", page, flags=re.S))
    said = podusv("sweep", "report", done.folder, "--no-figures").out
    assert not re.search(r"\d \[", said.partition("study:")[0])  # a number and its interval
    assert json.loads((done.folder / "claims.json").read_text())["claims"] == []
