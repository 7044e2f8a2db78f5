"""`podusv rerun`: the same comes out, or podusv says what parted and what had changed."""

import json
import re
import tempfile
from typing import Any

import pytest
from command_samples import commanded
from rerun_samples import SCENARIO, copied, flip, made, relogged, replaced, told_otherwise
from storage_samples import beside, files

from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import open_run
from podusv_cli.workflows import compare
from podusv_cli.workflows import run as running
from podusv_cli.workflows.members import runs_of


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return made(tmp_path_factory.mktemp("rerun") / "first")


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    room = tmp_path / "passing"
    room.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(room))
    return commanded(monkeypatch, capsys)


def shown(said: Any) -> str:
    """The output on one line."""
    return " ".join(said.out.split())


def test_an_untouched_run_comes_out_the_same_and_leaves_nothing(run, tmp_path, podusv):
    before = files(run.parent)
    said = podusv("rerun", run)
    assert said.code == 0
    digest = manifest.read(run).files["log.h5"].sha256
    size = (run / "log.h5").stat().st_size
    assert shown(said) == f"first identical: {size} bytes, sha256 {digest}"
    assert files(run.parent) == before
    assert not list((tmp_path / "passing").iterdir())


def test_a_changed_gain_is_found_and_named(run, tmp_path, podusv):
    change = replaced("K_Pu: 1100.0", "K_Pu: 1200.0")
    said = podusv("rerun", copied(run, tmp_path / "copy", resolved_yaml=change))
    assert said.code == 3
    assert "copy not identical" in shown(said)
    assert "changed in the scenario: controller.K_Pu 1100.0 -> 1200.0" in shown(said)
    # Surge acceleration at the start differs, so the law's output is the first to differ.
    assert "first difference: tau_u_cmd at t = 0.0 s: " in shown(said)


def test_a_changed_version_is_named_though_nothing_moved(run, tmp_path, podusv):
    other = copied(run, tmp_path / "copy", provenance_json=told_otherwise(numba="0.1.0"))
    said = podusv("rerun", other)
    assert said.code == 0
    now = json.loads((run / "provenance.json").read_text())["packages"]["numba"]
    told = f"changed in versions: packages.numba 0.1.0 -> {now}"
    assert told in shown(said).replace('"', "")


def test_one_flipped_bit_is_found_with_time_values_and_size(run, tmp_path, podusv):
    change = relogged(run, lambda signals: flip(signals["psi"], 31))
    other = copied(run, tmp_path / "copy", log_h5=change)
    said = podusv("rerun", other)
    assert said.code == 3
    was, now = (open_run(f).recording["psi"][31] for f in (other, run))
    assert f"psi at t = 0.31 s: {float(was)!r} -> {float(now)!r} rad (1 ulp" in shown(said)
    assert "no change in the scenario or in the versions of provenance.json explains it" in shown(
        said
    )


def test_the_same_numbers_in_another_file_are_identical(run, tmp_path, podusv):
    other = copied(run, tmp_path / "copy", log_h5=relogged(run, lambda signals: None))
    said = podusv("rerun", other)
    assert said.code == 0
    assert "identical in every number" in shown(said)


def test_out_keeps_the_repeated_run(run, tmp_path, podusv):
    said = podusv("rerun", run, "--out", tmp_path / "kept", "--json")
    assert said.code == 0
    told = json.loads(said.out)
    assert (told["identical"], told["folder"]) == (True, str(tmp_path / "kept"))
    assert (tmp_path / "kept/log.h5").read_bytes() == (run / "log.h5").read_bytes()
    assert open_run(tmp_path / "kept").status == "finished"
    assert beside(tmp_path / "kept") == {"passing"}
    again = podusv("rerun", run, "--out", tmp_path / "kept")
    assert (again.code, again.out) == (5, "")
    assert again.err.startswith(f"{tmp_path / 'kept'} exists")


def test_a_run_that_diverges_and_had_not_has_a_code_of_its_own(run, tmp_path, podusv):
    change = replaced("K_Pu: 1100.0", "K_Pu: 1.0e+300")
    said = podusv("rerun", copied(run, tmp_path / "copy", resolved_yaml=change))
    assert said.code == 4
    assert "status: finished -> diverged" in shown(said)


def test_a_run_that_diverges_as_it_did_is_identical(tmp_path, podusv):
    run = made(tmp_path / "wild", "controller.K_Pu=1e300")
    assert open_run(run).status == "diverged"
    assert podusv("rerun", run).code == 0


def test_an_interrupted_run_is_refused(run, tmp_path, podusv):
    other = copied(run, tmp_path / "copy")
    stated = (other / "manifest.json").read_text()
    (other / "manifest.json").write_text(stated.replace('"finished"', '"interrupted"'))
    said = podusv("rerun", other)
    assert said.code == 2
    assert said.err == f"{other} was interrupted; there is no whole run to repeat\n"


def test_what_is_no_run_folder(run, tmp_path, podusv):
    for path in (tmp_path, run / "log.h5", tmp_path / "nowhere"):
        said = podusv("rerun", path)
        assert (said.code, said.out) == (2, "")
        assert said.err.startswith(f"{path} ")
    broken = copied(run, tmp_path / "broken")
    (broken / "resolved.yaml").write_text("name: x\n")
    assert podusv("rerun", broken).code == 5


def test_a_key_that_this_podusv_does_not_know(run, tmp_path, podusv):
    change = replaced("K_Pu:", "K_Qu:")
    other = copied(run, tmp_path / "copy", resolved_yaml=change)
    said = podusv("rerun", other)
    assert said.code == 2
    assert re.search(r"resolved\.yaml:\d+:\d+: controller\.K_Qu: unknown key", said.err)


@pytest.fixture
def compared(tmp_path):
    config = tmp_path / "two.yaml"
    config.write_text(SCENARIO + "controllers: {soft: {K_Pu: 500.0}, hard: {K_Pu: 1500.0}}\n")
    request = running.Request(out=tmp_path / "two", figures=False)
    return compare.compare([config], request).folder


@pytest.mark.slow
def test_every_run_of_a_comparison_is_repeated(compared, tmp_path, podusv):
    said = podusv("rerun", compared, "--out", tmp_path / "kept")
    assert said.code == 0
    assert re.findall(r"^(\w+)  identical", said.out, re.MULTILINE) == ["soft", "hard"]
    for label in ("soft", "hard"):
        logs = [folder / label / "log.h5" for folder in (compared, tmp_path / "kept")]
        assert logs[0].read_bytes() == logs[1].read_bytes()
    manifest.check(tmp_path / "kept")


@pytest.mark.long
def test_runs_made_again_are_compared_in_the_order_of_the_scenario(compared, tmp_path, podusv):
    again, twice = tmp_path / "again", tmp_path / "twice"
    podusv("rerun", compared, "--out", again)
    podusv("rerun", again, "--out", twice)
    for folder in (compared, again, twice):
        assert [run.path.name for run in runs_of(folder)] == ["soft", "hard"]
    provenance = again / "provenance.json"
    provenance.write_text(json.dumps({**json.loads(provenance.read_text()), "runs": 3}))
    manifest.write(again, "finished")
    assert "damaged, not as podusv wrote it (runs" in podusv("compare", again).err


@pytest.mark.long
def test_a_run_that_cannot_be_repeated_takes_no_other_with_it(compared, podusv, monkeypatch):
    real = compare.execute

    def execute(task: Any, progress: Any = None, **case: Any) -> Any:
        if task.scenario.controller.K_Pu == 500.0:
            raise RuntimeError("planted")
        return real(task, progress, **case)

    monkeypatch.setattr(compare, "execute", execute)
    said = podusv("rerun", compared)
    assert said.code == 3
    assert said.out.startswith("hard  identical")
    assert said.err.startswith("soft: ")
    assert "planted" in said.err
