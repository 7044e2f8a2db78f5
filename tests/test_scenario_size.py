"""What podusv accepts, it reads back afterwards; what runs need of the disk."""

import pytest
from scenario_samples import SOUND, write

from podusv_cli.scenario import limits
from podusv_cli.scenario.load import load, load_stored, resolved_yaml
from podusv_cli.scenario.yaml_text import MAX_NODES
from podusv_cli.storage import json_files, manifest


@pytest.fixture
def of_two_files(tmp_path, monkeypatch):
    """A scenario of more values than one file may have."""
    monkeypatch.chdir(tmp_path)
    several = MAX_NODES // 3 - 100
    write("base.yaml", f"path: {{kind: waypoints, points: {[[i, 0.0] for i in range(several)]}}}\n")
    codes = ", ".join(["saturated"] * several)
    rest = "".join(line for line in SOUND.splitlines(True) if not line.startswith("path"))
    write("a.yaml", f"extends: base.yaml\n{rest}silence: [{codes}]\n")
    return load("a.yaml").scenario


@pytest.mark.slow
def test_a_scenario_of_several_long_files_is_read_back(of_two_files):
    text = resolved_yaml(of_two_files)
    assert load_stored(text, "resolved.yaml").scenario == of_two_files


@pytest.mark.slow
def test_the_manifest_of_many_runs_is_read_back(tmp_path):
    entry = manifest.FileEntry(sha256="a" * 64, bytes=10**9)
    names = ("scenario.yaml", "resolved.yaml", "log.h5", "metrics.json", "metrics.csv",
             "theory.json", "figures/controls.png", "provenance.json", "manifest.json",
             "missing.json")  # fmt: skip
    files = {f"a_rather_long_name_of_law_{i:04}/{n}": entry for i in range(3000) for n in names}
    whole = manifest.Manifest(podusv_format=1, status="finished", files=files)
    (tmp_path / "manifest.json").write_bytes(json_files.encode(whole.model_dump()))
    assert len(manifest.read(tmp_path).files) == len(files)


@pytest.mark.parametrize(("at_once", "largest"), [(1, 1000), (2, 1100), (3, 1110), (9, 1110)])
def test_runs_made_at_once_may_be_those_that_need_the_most_disk(at_once, largest):
    sizes = [limits.Size(1, 1, 50, 0.0, scratch, compressed=True) for scratch in (100, 10, 1000)]
    packed = limits.LEAST_COMPRESSED * 150
    assert limits.needed(sizes, at_once) == pytest.approx(packed + largest)
