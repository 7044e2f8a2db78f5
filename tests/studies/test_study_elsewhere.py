"""A folder of podusv shows what is stored in its own files, and nothing of another file."""

import json
import os
import shutil
from itertools import product

import h5py
import numpy as np
import pytest
from rerun_samples import copied
from rerun_samples import made as made_run
from rotation import one_in
from small_study import folder_with_scenario

from podusv_cli.studies.making.store import RUNS, SCENARIO, UNITS

SECRET = 0.123456789
KEY = "drawn/vessel.m"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return folder_with_scenario(tmp_path_factory.mktemp("study") / "whole")


@pytest.fixture
def study(whole, tmp_path):
    return shutil.copytree(whole, tmp_path / "study")


@pytest.fixture
def secret(tmp_path):
    """A file of somebody else, as bytes and as HDF5."""
    np.full(4, SECRET).tofile(tmp_path / "secret")
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = np.full(4, SECRET)
    return tmp_path


def external(file, place):
    file.create_dataset(KEY, (4,), "<f8", external=[(str(place / "secret"), 0, 32)])


def virtual(file, place):
    layout = h5py.VirtualLayout(shape=(4,), dtype="<f8")
    layout[:] = h5py.VirtualSource(str(place / "secret.h5"), "x", shape=(4,))
    file.create_virtual_dataset(KEY, layout)


def external_link(file, place):
    file[KEY] = h5py.ExternalLink(str(place / "secret.h5"), "x")


def soft_link(file, place):
    file[KEY] = h5py.SoftLink("/until")


@pytest.mark.parametrize("put", [external, virtual, external_link, soft_link])
def test_data_in_another_file_are_refused(study, secret, podusv, put):
    with h5py.File(study / RUNS, "a") as file:
        del file[KEY], file["sha256_rest"]
        put(file, secret)
    said = podusv("sweep", "export", study)
    assert said.code == 5
    assert f"{KEY} is a link to elsewhere" in said.err or "data in another file" in said.err
    assert not (study / "runs.csv").exists()


@pytest.mark.parametrize(("name", "code"), [(RUNS, 5), (f"{UNITS}/pid-0-0-4.unit", 0)])
def test_a_pipe_in_place_of_a_file_does_not_hang(study, podusv, name, code):
    (study / name).unlink(missing_ok=True)
    os.mkfifo(study / name)
    said = podusv("sweep", "status", study)
    assert said.code == code
    assert ("not a regular file" in said.err) == (code == 5)


ROWS = "t,b_u,b_v,b_r\n0,7654.5,0,0\n1,0,0,0\n"
WAYS = {
    "extends": ("name:", "extends: {}/a.yaml\nname:"),
    "file": ("{kind: harmonic}", "{{kind: file, file: {}/a.csv}}"),
    "list": ("{kind: harmonic}", "[{{kind: none}}, {{kind: file, file: {}/a.csv}}]"),
    "link": None,
}
COMMANDS = {
    "draw": ("sweep", "draw", "--law", "pid", "--draw", "1"),
    "run": ("sweep", "run", "--no-figures"),
    "tune": ("tune",),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_stored_study_names_no_other_file(study, secret, podusv, command, way):
    if command == "tune":
        pytest.importorskip("optuna")
        (study / "tune.json").write_text(json.dumps({}))
    (secret / "a.csv").write_text(ROWS)
    (secret / "a.yaml").write_text("s3cret: 7654.5\ndescription: s3cret\n")
    path = study / SCENARIO
    if WAYS[way]:
        old, new = WAYS[way]
        path.write_text(path.read_text().replace(old, new.format(secret)))
    else:
        path.replace(secret / "whole.yaml")
        path.symlink_to(secret / "whole.yaml")
    words = COMMANDS[command]
    before = sorted(study.iterdir())
    said = podusv(*words[:2], study, *words[2:]) if words[0] == "sweep" else podusv("tune", study)
    assert said.code == 5
    assert "refers to another file" in said.err or "a symbolic link" in said.err
    assert "s3cret" not in said.err
    assert "7654.5" not in said.err
    assert sorted(study.iterdir()) == before


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return made_run(tmp_path_factory.mktemp("run") / "first")


FILES = {
    "disturbance": b"disturbance: {kind: file, file: %s/a.csv}",
    "list": b"disturbance: [{kind: none}, {kind: file, file: %s/a.csv}]",
}


@pytest.mark.parametrize(
    ("text", "command"), one_in(3, [*product(FILES.values(), ("plot", "compare", "diff", "rerun"))])
)
def test_a_finished_run_names_no_other_file(finished, secret, podusv, command, text):
    (secret / "a.csv").write_text(ROWS)
    given = text.replace(b"%s", str(secret).encode())

    def change(content):
        old = b"disturbance:\n  kind: none"
        assert old in content
        return content.replace(old, given)

    run = copied(finished, secret / "run", resolved_yaml=change)
    others = {
        "diff": [finished],
        "compare": [finished, "--no-figures"],
        "plot": ["--figure", "errors"],
    }
    said = podusv(command, run, *others.get(command, ()))
    reads = command == "rerun"  # the others look at about.json and the log alone
    assert said.code == (5 if reads else 0)
    assert ("file: refers to another file" in said.err) is reads
    assert "7654.5" not in said.out + said.err
