"""Looking at somebody's study runs none of their code; what needs the code asks for `--trust`."""

import csv
import json
import shutil
import sys
from pathlib import Path

import pytest
from installed_sample import LAB, importable, install
from loop_counts import COUNTED, loop_counts
from plugin_parts import MORE
from plugin_samples import LAW
from small_study import TEXT

from podusv_cli.core.plugins import MODULES
from podusv_cli.workflows import studies, sweep

MARK = Path("imported")
TRACE = "\nfrom pathlib import Path\nPath({!r}).touch()\n"
MINE = "plugins: [my_law.py]\ncontrollers:\n  mine: {kind: cross_track}\n"
GRID = """
  grid: {controllers.mine.gain: [0.5, 1.5], path: [{kind: line}]}
  keep: {draws: [0]}
  success: finished and largest_east <= 1e6
"""


@pytest.fixture(scope="module")
def planted(tmp_path_factory):
    """A whole study with a law and a metric of a file, which leaves a trace where it is run."""
    place = tmp_path_factory.mktemp("somebody")
    trace = place / MARK
    (place / "my_law.py").write_text(LAW + MORE + TRACE.format(str(trace)))
    text = TEXT.replace("controllers:\n", MINE)
    text = text.replace("draws: 40\n", f"draws: 4{GRID}")
    text = text.replace("share(li.iae < pid.iae)", "share(mine.largest_east < pid.largest_east)")
    (place / "mine.yaml").write_text(text)
    return place


@pytest.fixture(scope="module")
def whole(planted):
    request = sweep.Request(out=planted / "study", workers=1, figures=False)
    return sweep.run(planted / "mine.yaml", request, lambda tally: None).folder


@pytest.fixture
def study(whole, planted, tmp_path, monkeypatch):
    """A copy of it; what is imported from here on leaves a trace."""
    for name in [name for name in sys.modules if name.startswith(f"{MODULES}.")]:
        monkeypatch.delitem(sys.modules, name)
    (planted / MARK).unlink(missing_ok=True)
    return shutil.copytree(whole, tmp_path / "study")


LOOKS = {
    "status": ("status",),
    "export": ("export",),
    "report": ("report", "--no-figures"),
    "merge": ("merge", "--out", "merged", "--no-figures"),
}


@pytest.mark.parametrize("words", LOOKS.values(), ids=LOOKS)
def test_a_look_executes_no_plug_in(study, planted, tmp_path, monkeypatch, podusv, words):
    monkeypatch.chdir(tmp_path)
    said = podusv("sweep", words[0], study, *words[1:])
    assert said.code == 0, said.err
    assert not (planted / MARK).exists()


@pytest.mark.parametrize("words", LOOKS.values(), ids=LOOKS)
def test_a_look_builds_no_loop_and_reads_no_scenario(study, tmp_path, monkeypatch, podusv, words):
    monkeypatch.chdir(tmp_path)
    calls = loop_counts(monkeypatch)
    (study / "scenario.yaml").write_text("not a scenario")
    said = podusv("sweep", words[0], study, *words[1:])
    assert said.code == 0, said.err
    assert not calls


def test_what_a_look_does_without_is_counted(study, tmp_path, monkeypatch):
    calls = loop_counts(monkeypatch)
    studies.draw(study, "pid", 1, 0, tmp_path / "one.yaml", trusted=True)
    assert {*calls} == {owner.__name__ for owner, _ in COUNTED}


def test_what_is_told_without_plug_ins_is_what_was_told_with_them(study, tmp_path, podusv):
    told = ("summary.csv", "pairs.csv", "claims.json", "runs.h5")
    before = {name: (study / name).read_bytes() for name in told}
    assert podusv("sweep", "report", study, "--no-figures").code == 0
    assert {name: (study / name).read_bytes() for name in told} == before
    page = (study / "report.html").read_text()
    assert "largest |y|" in page
    merged = tmp_path / "merged"
    assert podusv("sweep", "merge", study, "--out", merged, "--no-figures").code == 0
    assert (merged / "runs.h5").read_bytes() == before["runs.h5"]
    assert (merged / "plugins/my_law.py").read_text() == (study / "plugins/my_law.py").read_text()
    table = Path(podusv("sweep", "export", study).out.strip())
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert all(float(row["largest_east"]) > 0 for row in rows)


def test_a_study_json_of_before_is_read_with_the_scenario_beside_it(study, planted, podusv):
    told = ("summary.csv", "pairs.csv", "claims.json", "runs.h5")
    before = {name: (study / name).read_bytes() for name in told}
    record = json.loads((study / "study.json").read_text())
    facts = record["metrics"]["largest_east"] | {"happens": False, "symbol": ""}
    old = {key: record[key] for key in ("name", "draws", "laws", "cells", "identity", "history")}
    old |= {"format": 1, "metrics_of_plugins": {"largest_east": facts}}
    del facts["name"]
    (study / "study.json").write_text(json.dumps(old))
    said = podusv("sweep", "report", study, "--no-figures")
    assert said.code == 2
    assert "controllers.mine.kind: unknown kind 'cross_track'" in said.err
    assert f"have study.json written anew: podusv sweep run {study} --trust" in said.err
    assert not (planted / MARK).exists()
    assert podusv("sweep", "run", study, "--no-figures", "--trust").code == 0
    (planted / MARK).unlink()
    assert podusv("sweep", "report", study, "--no-figures").code == 0
    assert {name: (study / name).read_bytes() for name in told} == before
    assert "largest |y|" in (study / "report.html").read_text()
    assert not (planted / MARK).exists()


NEEDS = {
    "draw": ("sweep", "draw", "--law", "pid", "--draw", "1", "--out", "one.yaml"),
    "run": ("sweep", "run", "--no-figures"),
    "rerun": ("rerun",),
}


@pytest.mark.parametrize("name", NEEDS)
def test_what_needs_the_code_asks_for_trust(study, planted, tmp_path, monkeypatch, podusv, name):
    monkeypatch.chdir(tmp_path)
    folder = study / "logs/mine-0-0" if name == "rerun" else study
    words = [*NEEDS[name][: 1 if name == "rerun" else 2], folder, *NEEDS[name][2:]]
    said = podusv(*words)
    assert said.code == 2
    place = f"{folder}/plugins/my_law.py"
    assert f" {place}; " in said.err
    assert "--trust" in said.err
    assert not (planted / MARK).exists()
    assert podusv(*words, "--trust").code == 0
    assert (planted / MARK).exists()


@pytest.mark.slow
def test_logs_are_made_where_the_plug_ins_are_trusted(study, podusv):
    shutil.rmtree(study / "logs")
    said = podusv("sweep", "report", study, "--no-figures")
    assert f"they are made by: podusv sweep run {study} --trust" in said.err
    assert not (study / "logs").exists()
    assert podusv("sweep", "run", study, "--no-figures", "--trust").code == 0
    assert len(list((study / "logs").iterdir())) == 3 * 2


ODD = {
    "name": {"metrics": {"<script>": {"name": "<script>"}}},
    "other": {"metrics": {"iae": {}}},
    "unit": {"metrics": {"largest_east": {"unit": "\n"}}},
    "unknown": {"measured": ["iae", "largest_west"]},
    "twice": {"measured": ["iae", "iae"]},
    "fewer": {"measured": ["iae"]},
    "law": {"laws": ["mine", "pid", "lee"]},
    "cell": {"cells": ["", "", ""]},
}


@pytest.mark.parametrize("change", ODD.values(), ids=ODD)
def test_odd_words_in_the_record_are_refused_in_a_sentence(study, podusv, change):
    record = json.loads((study / "study.json").read_text())
    plain = record["metrics"]["largest_east"]
    metrics = {name: plain | new for name, new in change.get("metrics", {}).items()}
    record |= change | {"metrics": record["metrics"] | metrics}
    (study / "study.json").write_text(json.dumps(record))
    before = (study / "runs.h5").read_bytes()
    said = podusv("sweep", "report", study, "--no-figures")
    assert said.code == 5
    assert f"{study / 'study.json'}: damaged" in said.err
    assert (study / "runs.h5").read_bytes() == before


@pytest.fixture
def installed_lab(tmp_path):
    """`examples/my_lab` as an installed package."""
    with importable(install(tmp_path / "site")):
        yield


@pytest.mark.slow
@pytest.mark.usefixtures("installed_lab")
def test_a_study_of_an_installed_package_asks_for_no_trust(tmp_path, podusv):
    text = (LAB / "scenario.yaml").read_text().replace("duration: 20.0", "duration: 0.5")
    sweep = "sweep: {draws: 2, vary: {start.psi: {angle: all}}, keep: {draws: [0]}}\n"
    (tmp_path / "lab.yaml").write_text(text.partition("claims:")[0] + sweep)
    study = tmp_path / "study"
    made = podusv("sweep", "run", "lab.yaml", "--out", study, "--workers", "1", "--no-figures")
    assert made.code == 0, made.err
    shutil.rmtree(study / "logs")
    said = podusv("sweep", "run", study, "--no-figures")
    assert (said.code, "trust" in said.err) == (0, False)
    assert len(list((study / "logs").iterdir())) == 3


CHANGES = [("seed: 7", "seed: 8"), ("[0.7, 1.3]", "[0.7, 1.4]"), ("duration: 1.0", "duration: 2.0")]


@pytest.mark.parametrize(("old", "new"), CHANGES)
def test_another_scenario_is_still_refused(study, podusv, old, new):
    path = study / "scenario.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    words = ("sweep", "draw", study, "--law", "pid", "--draw", "1", "--trust")
    said = podusv(*words)
    assert said.code == 2
    assert "is not the scenario of the runs" in said.err


def test_a_plug_in_file_that_was_changed_is_not_merged(study, tmp_path, podusv):
    (study / "plugins/my_law.py").write_text("print('another')")
    said = podusv("sweep", "merge", study, "--out", tmp_path / "merged")
    assert said.code == 5
    assert "is not the plug-in file of the runs" in said.err


def test_a_search_that_is_continued_asks_for_trust(planted, tmp_path, podusv):
    pytest.importorskip("optuna")
    place = tmp_path / "search"
    place.mkdir()
    (place / "tune.json").write_text(json.dumps({}))
    text = (planted / "mine.yaml").read_text()
    (place / "scenario.yaml").write_text(text + "tune: {budget: 16, train: 2, validate: 2}\n")
    (place / "my_law.py").write_text((planted / "my_law.py").read_text())
    (planted / MARK).unlink(missing_ok=True)
    said = podusv("tune", place)
    assert said.code == 2
    assert "--trust" in said.err
    assert not (planted / MARK).exists()
