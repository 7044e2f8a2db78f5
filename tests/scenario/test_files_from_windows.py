"""Files, paths, names and terminals of Windows: each works, or is refused by a sentence."""

import os
import subprocess
import sys
from pathlib import PureWindowsPath
from types import SimpleNamespace

import pytest
from scenario_samples import SOUND

from podusv_cli.core import system
from podusv_cli.core.errors import ScenarioError, StorageError
from podusv_cli.scenario import shipped
from podusv_cli.scenario.load import load, load_text
from podusv_cli.storage import archive, manifest

LEGS = """
name: mine
vessel: {preset: otter}
actuator: {kind: ideal}
path: {kind: legs, file: 'way points.csv'}
controller: {kind: alos}
simulation: {duration: 60}
disturbance: {kind: none}
"""
WAY = "x,y\n0,0\n10,5\n20,0\n"


def refusal(*sets, text=SOUND):
    with pytest.raises(ScenarioError) as refused:
        load_text(text, "a.yaml", sets)
    return "\n".join(refused.value.lines())


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_files_of_every_editor_are_the_same_scenario(tmp_path, end):
    """In a folder with a blank in its name, as are the file's and the route's."""
    folder = tmp_path / "my boats"
    folder.mkdir()
    for name, text in (("my boat.yaml", LEGS), ("way points.csv", WAY)):
        (folder / name).write_bytes(text.encode().replace(b"\n", end))
    loaded = load(folder / "my boat.yaml").scenario
    assert [point[:2] for point in loaded.path.points] == [(0, 0), (10, 5), (20, 0)]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (r"C:\data\way.csv", "no such file or directory; write / between folders"),
        (r'"C:\data\way.csv"', "unknown escape character 'd'; in a path write / for \\, or put it"),
        (r'"C:\temp\new.csv"', r"in double quotes \t, \n and the like are single letters; write /"),
        ("C:/data/way.csv", "cannot be read: no such file or directory"),
    ],
)
def test_a_path_of_windows_is_taken_as_it_stands_or_refused_by_a_sentence(given, sentence):
    by_set = refusal(f"path.file={given}", text=LEGS)
    in_file = refusal(text=LEGS.replace("'way points.csv'", given))
    assert sentence in by_set
    assert sentence in in_file


@pytest.mark.parametrize("name", ["con", "nul", "COM1", "aux.2", "Lpt9"])
def test_a_name_that_windows_keeps_for_a_device_is_refused(name):
    assert f"name: {name} is a device on Windows, so no folder can have this name" in refusal(
        f"name={name}"
    )


def test_laws_are_no_devices_either_and_names_end_in_no_dot():
    assert "controllers.nul: nul is a device on Windows" in refusal(
        "controllers={nul: {kind: pid}, ok: {kind: pid}}"
    )
    assert "'a.' ends in '.', which Windows leaves out" in refusal("name=a.")
    for name in ("console", "com", "com10", "a.con", "nul1"):
        assert load_text(SOUND, "a.yaml", [f"name={name}"]).scenario.name == name


@pytest.mark.parametrize("name", ["run/..\\..\\x", "run/a:b", "run/nul", "run/con.txt", "run/x."])
def test_nothing_is_unpacked_or_read_outside_of_its_folder_on_windows(monkeypatch, tmp_path, name):
    monkeypatch.setattr(system, "os", SimpleNamespace(name="nt"))
    assert "is no file inside a folder" in archive.name_fault(name)
    with pytest.raises(StorageError, match="is no file of this folder"):
        manifest.place(tmp_path, name)
    assert archive.name_fault("run/figures/path.png") == ""


def test_shipped_scenarios_are_named_with_slashes_where_folders_are_not(monkeypatch):
    import ntpath

    monkeypatch.setattr(shipped, "os", SimpleNamespace(path=ntpath))
    source = "podusv:mu_2017/corrected.yaml"
    assert shipped.relative_to(source, "base.yaml") == "podusv:mu_2017/base.yaml"
    assert shipped.relative_to(source, "../demo.yaml") == "podusv:demo.yaml"


@pytest.mark.long
@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "utf-8"])
def test_a_terminal_that_lacks_letters_gets_them_escaped(encoding, tmp_path):
    """cp65001 is Windows' word for UTF-8."""
    words = "; ".join(
        f"sys.argv = ['podusv', *{line.split()!r}]; run()"
        for line in ("docs model", "explain vessel.N_rr", "validate Süd→.yaml")
    )
    (tmp_path / "Süd→.yaml").write_text("name: south\n" + SOUND, "utf-8")
    script = f"""
import sys
from podusv_cli import cli
def run():
    try:
        cli.main()
    except SystemExit as end:
        assert not end.code, end.code
{words}
"""
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    shown = done.stdout.decode(encoding)
    assert ("Süd→.yaml" if encoding == "utf-8" else "Süd\\u2192.yaml") in shown


def test_a_shipped_scenario_in_a_folder_is_found_from_a_path_of_windows():
    """Such a path turns the slash of the name."""
    name = "podusv:mu_2017/corrected.yaml"
    assert load(PureWindowsPath(name)).scenario == load(name).scenario
    assert shipped.name_of(PureWindowsPath("boats/a.yaml")) == "boats\\a.yaml"
