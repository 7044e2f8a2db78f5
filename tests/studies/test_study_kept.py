"""Kept runs and drawn scenarios have the numbers of a study's table to the last bit."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_samples import commanded, one_line
from small_study import written

from podusv_cli.core.errors import UsageError
from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import open_run
from podusv_cli.studies.telling import keep
from podusv_cli.studies.telling.results import judge_study
from podusv_cli.workflows import run as running
from podusv_cli.workflows import studies, sweep
from podusv_cli.workflows.merge import merge

VARIED = (
    "    start.psi: {angle: all}\n",
    "    start.psi: {angle: all}\n    start.y: {choice: [0, 2.5]}\n    chosen: {keys: [start.x], "
    "choice: [-1.0, -0.3]}\n",
)
KEPT = (
    "  claims:\n",
    "  success: finished and iae <= 1.5\n"
    "  keep: {failed: 2, worst: {iae: 1}, draws: [0]}\n  claims:\n",
)
GRID = (
    "  claims:\n",
    "  grid: {disturbance.scale: [0.5, 1], simulation.step: [0.02]}\n  claims:\n",
)


def run(config, out, figures=False, **given):
    request = sweep.Request(out=out, workers=1, figures=figures, **given)
    return sweep.run(config, request, lambda tally: None)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept")
    config = written(folder / "small.yaml", VARIED, KEPT, GRID)
    return run(config, folder / "study", overrides=["sweep.draws=6"])


def table_of(study, law, cell, draw):
    runs = study.results.runs
    return {name: float(runs.metric(law, name)[cell, draw]) for name in runs.metrics}


def same(metrics, table):
    return all(metrics[name] == (x if math.isfinite(x) else None) for name, x in table.items())


@pytest.mark.slow
def test_kept_runs_are_those_asked_for(study):
    runs, names = study.results.runs, {path.name for path in (study.folder / "logs").iterdir()}
    wanted = keep.wanted_runs(study.results)
    assert names == {one.name for one in wanted}
    assert "failed" in {one.why for one in wanted}
    for law in ("pid", "li"):
        failed = [tuple(place)[::-1] for place in np.argwhere(runs.failed(law).T).tolist()][:2]
        assert [one[1:3] for one in wanted if one.law == law and one.why == "failed"] == failed
        assert runs.success(law).any()
        good = np.where(runs.success(law), runs.metric(law, "iae"), -np.inf)
        cell, draw = np.unravel_index(np.argmax(good), good.shape)
        assert f"{law}-{cell}-{draw}" in names
        assert {f"{law}-0-0", f"{law}-1-0"} <= names


def test_kept_runs_equal_the_table(study):
    assert study.missing == ()
    for one in keep.wanted_runs(study.results):
        kept = open_run(study.folder / "logs" / one.name)
        assert same(kept.metrics, table_of(study, one.law, one.cell, one.draw))
        assert kept.recording.status == "finished"


def test_a_kept_log_that_differs_leaves_no_verdict(study, tmp_path, podusv):
    (one, other, *_) = keep.wanted_runs(study.results)
    folder = tmp_path / "study"
    shutil.copytree(study.folder, folder)
    shutil.rmtree(folder / "logs" / one.name)
    shutil.copytree(folder / "logs" / other.name, folder / "logs" / one.name)
    before = json.loads((folder / "claims.json").read_text())
    assert before["claims"]
    code, out, err = podusv("sweep", "report", str(folder), "--no-figures")
    assert code == 3
    kept = len(keep.wanted_runs(study.results))
    assert f"1 of {kept} kept logs differ from it; in that of {one.name}, iae is" in out
    assert f"logs/{one.name} differs from runs.h5: iae is" in err
    assert "could not be made" not in err + (folder / "missing.json").read_text()
    claims = json.loads((folder / "claims.json").read_text())
    assert claims["claims"] == []
    assert claims["contradicted"] in out
    assert (folder / "claims.md").read_text().startswith("No claim is judged, since the table")
    assert "No claim is judged" in (folder / "report.html").read_text()


def test_continuing_keeps_what_is_kept(study, tmp_path):
    folder = tmp_path / "grown"
    shutil.copytree(study.folder, folder)
    before = {p: p.stat().st_mtime_ns for p in (folder / "logs").rglob("log.h5")}
    grown = run(folder, None, overrides=["sweep.draws=9"])
    assert grown.results.made_runs == 9 * 4
    assert {p: p.stat().st_mtime_ns for p in before} == before
    assert {one.name for one in keep.wanted_runs(grown.results)} <= {
        path.name for path in (folder / "logs").iterdir()
    }
    assert grown.missing == ()


@pytest.mark.long
def test_a_kept_run_that_cannot_be_made_costs_nothing_else(study, tmp_path):
    folder = tmp_path / "blocked"
    shutil.copytree(study.folder, folder)
    shutil.rmtree(folder / "logs")
    (folder / "logs").write_text("in the way")
    again = run(folder, None)
    assert again.results.made_runs == again.results.wanted_runs
    assert any(missing.what.startswith("logs/pid-") for missing in again.missing)
    assert json.loads((folder / "missing.json").read_text())["missing"]
    assert (folder / "report.html").exists()


@pytest.mark.parametrize(("law", "cell", "number"), [("pid", 0, 5), ("li", 1, 3)])
def test_a_drawn_scenario_gives_the_numbers_of_the_table(study, tmp_path, law, cell, number):
    path = studies.draw(study.folder, law, number, cell, tmp_path / "one.yaml")
    done = running.run(path, running.Request(out=tmp_path / "one", figures=False))
    told = {name: x if math.isfinite(x) else None for name, x in done.metrics.items()}
    assert same(told, table_of(study, law, cell, number))


def test_drawn_scenarios_have_names_of_their_own(study, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    paths = [
        studies.draw(study.folder, law, 0, cell, None) for law in ("pid", "li") for cell in (0, 1)
    ]
    assert [path.name for path in paths] == [
        f"small-{law}-{cell}-0.yaml" for law in ("pid", "li") for cell in (0, 1)
    ]
    assert len({line for p in paths for line in p.read_text().splitlines() if "name:" in line}) >= 4
    with pytest.raises(UsageError, match=r"^small-pid-0-0\.yaml exists"):
        studies.draw(study.folder, "pid", 0, 0, None)
    long = written(tmp_path / "long.yaml", ("name: small", f"name: {'n' * 80}"))
    run(long, tmp_path / "long", overrides=["sweep.draws=1"])
    assert len(studies.draw(tmp_path / "long", "pid", 0, 0, None).stem) == 80


@pytest.mark.parametrize(
    ("law", "number", "cell", "told"),
    [
        ("pdi", 0, 0, "did you mean 'pid'"),
        ("pid", 0, 2, "no such cell; they are numbered 0 to 1"),
        ("pid", 6, 0, "no such draw; they are numbered 0 to 5"),
    ],
)
def test_a_draw_that_the_study_lacks_is_refused(study, law, number, cell, told):
    with pytest.raises(UsageError, match=told):
        studies.draw(study.folder, law, number, cell, Path("never.yaml"))


def test_a_finished_study_lists_all_its_files_and_one_being_continued_none(study, tmp_path):
    listed = manifest.check(study.folder)
    assert listed.status == "finished"
    assert manifest.foreign(study.folder, listed) == []
    folder = tmp_path / "late"
    shutil.copytree(study.folder, folder)
    late = run(folder, None, overrides=["sweep.draws=20"], seconds=-1.0)
    assert late.results is None
    assert not (folder / manifest.NAME).exists()
    part = sweep.report(folder, sweep.Request(figures=False))
    assert part.results.made_runs == 6 * 4 < part.results.wanted_runs
    assert manifest.check(folder).status == "interrupted"


@pytest.mark.slow
def test_every_sitting_is_kept(study, tmp_path):
    folder = tmp_path / "sittings"
    shutil.copytree(study.folder, folder)
    run(folder, None, overrides=["sweep.draws=8"], argv=["podusv", "again"])
    first, second = json.loads((folder / "provenance.json").read_text())["sittings"]
    assert (first["runs"], second["runs"]) == (6 * 4, 2 * 4)
    assert second["argv"] == ["podusv", "again"]
    assert first["finished"] <= second["started"] <= second["finished"]
    parts = [tmp_path / f"part{number}" for number in (1, 2)]
    for number, part in enumerate(parts, 1):
        config = written(tmp_path / "small.yaml")
        run(config, part, overrides=["sweep.draws=4"], shard=(number, 2))
    merged = merge(parts, tmp_path / "merged", sweep.Request(figures=False))
    told = json.loads((merged.folder / "provenance.json").read_text())["sittings"]
    assert [session["runs"] for session in told] == [4, 4, 0]


def test_values_to_choose_from_and_every_quantity_are_in_the_table(study):
    runs = study.results.runs
    assert list(runs.drawn_quantities) == sorted(study.results.about.quantities)
    assert set(runs.drawn_quantities["start.y"].tolist()) <= {0.0, 2.5}
    assert set(judge_study(study.results.about, runs).sensitivity.quantity) == set(
        runs.drawn_quantities
    )


def test_seeds_have_no_sensitivity_because_their_numbers_have_no_order(study):
    about, runs = study.results.about, study.results.runs
    seed = about.quantities["start.y"].model_copy(update={"is_seed": True})
    seeded = about.model_copy(update={"quantities": about.quantities | {"start.y": seed}})
    assert set(judge_study(seeded, runs).sensitivity.quantity) == set(runs.drawn_quantities) - {
        "start.y"
    }


@pytest.mark.parametrize("command", ["plot", "compare", "rerun", "diff"])
def test_a_study_is_no_run(study, monkeypatch, capsys, tmp_path, command):
    monkeypatch.chdir(tmp_path)
    given = [study.folder] * (2 if command == "diff" else 1)
    ended = commanded(monkeypatch, capsys)(command, *given)
    assert ended.code == 2
    assert f"{study.folder} is a study, not a run; name one of the runs that it keeps" in ended.err
    assert "podusv sweep draw" in ended.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "small.yaml", "--until", "5x"], "write a number and s, min, h or d: 30min"),
        (["run", "small.yaml", "--shard", "4/3"], "write its number and the count: 3/20"),
        (["run", "small.yaml", "--out", "small.yaml"], "is a file; name a folder"),
        (["run", "."], ". is not the folder of a study: it has no study.json"),
        (["status", "nowhere"], "nowhere does not exist; it has to be the folder of a study"),
        (["report", "small.yaml"], "small.yaml is a file, not the folder of a study"),
        (["export", "nowhere", "--format", "xls"], "unknown format 'xls'"),
    ],
)
def test_a_mistake_is_told_in_a_sentence(monkeypatch, capsys, tmp_path, words, told):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "small.yaml")
    ended = commanded(monkeypatch, capsys)("sweep", *words)
    assert (ended.code, ended.out) == (2, "")
    assert told in one_line(ended.err)
    assert [path.name for path in tmp_path.iterdir()] == ["small.yaml"]
