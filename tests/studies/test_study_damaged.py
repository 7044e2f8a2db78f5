"""Damaged records of studies and searches: one sentence with the file and exit code 5."""

import json
import shutil

import pytest
from small_study import TEXT, written

from podusv_cli.workflows import sweep

STUDY, PROVENANCE = "study.json", "provenance.json"
REMOVED = object()
VALUES = [None, [], {}, "x", -1, 1.5, 10**290, True, [1], {"a": [1]}]
DAMAGES = [
    *((STUDY, (key,), value) for key in ("identity", "history") for value in VALUES[3:5]),
    *((STUDY, (key,), REMOVED) for key in ("draws", "identity", "history")),
    *((STUDY, ("draws",), value) for value in VALUES[3:6]),
    *((STUDY, ("history", 0), value) for value in VALUES[6:]),
    *((STUDY, ("history", 0, "draws"), value) for value in ("x", 0)),
    *((PROVENANCE, ("sittings",), value) for value in ({}, 1.5, [None], [[]])),
    *((PROVENANCE, ("sittings", 0, key), REMOVED) for key in ("started", "runs", "podusv")),
    *((PROVENANCE, ("sittings", 0, "platform"), value) for value in ({}, [])),
    *((PROVENANCE, ("sittings", 0, "timed_runs"), value) for value in ({"pid": 0}, {"pid": "x"})),
]
COMMANDS = [("report", "--no-figures"), ("run", "--draws", "5"), ("merge", "--out", "merged")]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    place = tmp_path_factory.mktemp("study")
    config = written(place / "small.yaml", ("draws: 40", "draws: 4"))
    request = sweep.Request(out=place / "whole", workers=1, figures=False)
    return sweep.run(config, request, lambda tally: None).folder


@pytest.fixture
def study(whole, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(whole, tmp_path / "study")


def damaged(content, place, value):
    inner = content
    for step in place[:-1]:
        inner = inner[step]
    inner.pop(place[-1]) if value is REMOVED else inner.__setitem__(place[-1], value)
    return json.dumps(content)


@pytest.mark.parametrize(("name", "place", "value"), DAMAGES)
def test_a_damaged_record_is_told_in_a_sentence(study, podusv, name, place, value):
    before = (study / "runs.h5").read_bytes()
    content = json.loads((study / name).read_text())
    (study / name).write_text(damaged(content, place, value))
    number = DAMAGES.index((name, place, value)) % len(COMMANDS)
    words = ("status",) if name == STUDY and number else COMMANDS[number]
    said = podusv("sweep", words[0], study, *words[1:])
    assert said.code == 5
    assert "Traceback" not in said.err
    assert f"cannot read {study / name}: damaged" in said.err
    assert (study / "runs.h5").read_bytes() == before


@pytest.mark.parametrize("name", [STUDY, PROVENANCE])
@pytest.mark.parametrize("length", [0, -3])
def test_a_record_that_is_cut_is_told_in_a_sentence(study, podusv, name, length):
    (study / name).write_text((study / name).read_text()[:length])
    said = podusv("sweep", "report", study, "--no-figures")
    assert said.code == 5
    assert f"cannot read {study / name}: not valid JSON" in said.err


@pytest.mark.parametrize("key", ["identity", "history", "idle"])
@pytest.mark.parametrize("value", [REMOVED, "x"])
def test_a_damaged_search_is_told_in_a_sentence(tmp_path, podusv, key, value):
    pytest.importorskip("optuna")
    tune = "tune: {budget: 16, train: 2, validate: 2}\n"
    written(tmp_path / "scenario.yaml", (TEXT[TEXT.index("  claims") :], tune))
    content = {"identity": {}, "history": [], "idle": {}}
    (tmp_path / "tune.json").write_text(damaged(content, (key,), value))
    said = podusv("tune", tmp_path)
    assert said.code == 5
    assert f"cannot read {tmp_path / 'tune.json'}: damaged" in said.err
