"""Studies, searches, benches and optima from Python: the tables are those of the commands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_samples import commanded
from test_interface import TWO

import podusv

SWEEP = {"draws": 4, "seed": 1, "vary": {"start.x": {"uniform": [-6.0, -4.0]}}}
SHORT = {**TWO, "controller": {"kind": "pid"}}
CLAIM = {"says": "s", "source": "p", "expect": "share(stiff.iae < soft.iae) > 0.1"}


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_study_is_a_table_with_a_row_a_run_and_a_dataset_over_law_and_draw(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study = podusv.sweep(SHORT, {"sweep": SWEEP}, out="s", figures=False)
    assert list(study.table.columns[:6]) == ["law", "cell", "draw", "start.x", "status", "success"]
    assert study.table.shape[0] == study.data["iae"].size == 8
    assert study.data["iae"].dims == ("law", "draw")
    for row in study.table.to_dict("records"):
        there = study.data.sel(law=row["law"], draw=row["draw"])
        assert (there["iae"], there["start.x"], there["status"]) == (
            row["iae"],
            row["start.x"],
            "finished",
        )
    alone = podusv.load(podusv.load(SHORT).singles()["soft"], {"start.x": row["start.x"]})
    assert podusv.simulate(alone).metrics["iae"] == row["iae"]
    assert commanded(monkeypatch, capsys)("sweep", "export", "s").code == 0
    exported = pd.read_csv("s/runs.csv", keep_default_na=False, na_values=[""])
    pd.testing.assert_series_equal(exported["iae"], study.table["iae"])


def test_a_study_of_a_grid_keeps_its_cells() -> None:
    grid = {**SWEEP, "draws": 2, "grid": {"start.y": [-2.0, -1.0, 0.0]}}
    study = podusv.sweep({**SHORT, "sweep": grid}, out="g", figures=False)
    assert dict(study.data["iae"].sizes) == {"law": 2, "cell": 3, "draw": 2}
    assert len(study.table) == 12


@pytest.mark.long
def test_a_study_is_opened_and_continued_from_its_folder() -> None:
    claimed = {**SWEEP, "draws": 2, "claims": {"C1": CLAIM}}
    study = podusv.sweep(SHORT, {"sweep": claimed}, out="s", figures=False)
    assert podusv.open_study("s").claims.equals(study.claims)
    assert list(study.claims["claim"]) == ["C1"]
    more = podusv.sweep("s", {"sweep.draws": 3}, figures=False)
    assert len(more.table) == 6
    assert np.array_equal(more.data["iae"][:, :2], study.data["iae"])
    with pytest.raises(podusv.PodusvError, match="is not the folder of a study"):
        podusv.open_study(".")
    with pytest.raises(podusv.PodusvError, match="has no key `sweep`"):
        podusv.sweep(SHORT, out="t")


@pytest.mark.long
def test_a_search_gives_gains_by_law_and_ranks() -> None:
    pytest.importorskip("optuna")
    search = {
        "budget": 8,
        "batch": 2,
        "train": 2,
        "repeats": 1,
        "validate": 4,
        "objective": "median(iae)",
        "space": {"around": 2.0},
    }
    found = podusv.tune(SHORT, {"sweep": SWEEP, "tune": search}, out="t", figures=False)
    assert list(found.laws["law"]) == list(found.gains.columns) == ["stiff", "soft"]
    assert 100.0 <= found.gains.loc["K_Pu", "stiff"] <= 400.0
    assert set(found.laws.columns) >= {"rank_before", "rank_after"}
    assert (found.folder / "tuned.yaml").is_file()


@pytest.mark.slow
def test_a_bench_has_a_row_a_run_and_a_row_a_law() -> None:
    done = podusv.bench(
        tasks=["line"], vessels=["paper_nonlinear"], conditions=["calm"], figures=False
    )
    assert len(done.runs) == len(done.board) > 10
    assert done.report == Path("results/bench/report.html")


@pytest.mark.slow
def test_an_optimum_is_a_run_with_less_error_than_its_law_s() -> None:
    pytest.importorskip("casadi")
    short = {"simulation.duration": 10.0}
    best = podusv.optimum("podusv:own_vessel.yaml", short, step=0.5, out="o", figures=False)
    law = podusv.simulate("podusv:own_vessel.yaml", short)
    assert best.metrics["iae"] < law.metrics["iae"]
