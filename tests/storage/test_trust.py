"""Code that somebody's folder brings along is run with `--trust` alone, wherever it is named.

The kinds of traps are what an unpacked folder can hold: a plug-in of a base in a subfolder, of a
base beside or outside the folder, of a scenario below the manifest, behind a link.
"""

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest
from command_samples import ROOT, one_line
from installed_sample import install

import podusv as python
from podusv_cli.core.errors import ScenarioError
from podusv_cli.storage import archive
from podusv_cli.workflows.live import Live

TRAP = "open({!r}, 'a').write('ran')\n"
WHOLE = """\
name: x
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: saturated}
controllers: {a: {kind: pid}}
simulation: {duration: 2.0}
sweep: {draws: 3, vary: {vessel.m: {uniform: [20, 25]}}}
tune: {budget: 400, objective: "quantile(iae, 0.5)", space: {a.K_Pu: {log: [10, 300]}}}
claims: {good: {says: It is., expect: a.iae < 1000}}
"""
PLUGGED = "plugins: [evil.py]\n"


def gift(files, mark="manifest.json", place="gift"):
    """A folder of these files, with the mark of a run, study or search and a plug-in each."""
    for name, text in files.items():
        path = Path(place, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        (path.parent / "evil.py").write_text(TRAP.format(os.path.abspath("MARK")))
    Path(place, mark).write_text("{}")


def in_a_subfolder():
    gift({"scenario.yaml": f"extends: sub/base.yaml\n{WHOLE}", "sub/base.yaml": PLUGGED})
    return "gift/scenario.yaml"


def in_the_second_of_two():
    gift(
        {
            "scenario.yaml": f"extends: [sub/one.yaml, sub/two.yaml]\n{WHOLE}",
            "sub/one.yaml": "{}\n",
            "sub/two.yaml": "extends: deep/base.yaml\n",
            "sub/deep/base.yaml": PLUGGED,
        }
    )
    return "gift/scenario.yaml"


def of_a_member():
    gift({"runs/one/scenario.yaml": f"{PLUGGED}{WHOLE}"})
    return "gift/runs/one/scenario.yaml"


def of_a_run_in_a_run():
    gift({"scenario.yaml": f"{PLUGGED}{WHOLE}"}, place="gift/logs/one")
    Path("gift/study.json").write_text("{}")
    Path("gift/logs/one/manifest.json").unlink()
    return "gift/logs/one/scenario.yaml"


def of_a_folder_elsewhere():
    """Which a scenario in the folder extends by an absolute name."""
    gift({"base.yaml": PLUGGED}, place="beside", mark="no_mark")
    gift({"scenario.yaml": f"extends: {os.path.abspath('beside/base.yaml')}\n{WHOLE}"})
    return "gift/scenario.yaml"


def behind_two_dots():
    gift({"base.yaml": PLUGGED}, place="beside", mark="no_mark")
    gift({"sub/scenario.yaml": f"extends: ../../beside/base.yaml\n{WHOLE}"})
    return "gift/sub/scenario.yaml"


def that_one_s_own_extends():
    in_a_subfolder()
    Path("mine.yaml").write_text("extends: gift/scenario.yaml\n")
    return "mine.yaml"


def that_leads_out_again():
    """One's own scenario extends the folder's, and this a file outside that names the plug-in."""
    behind_two_dots()
    Path("mine.yaml").write_text("extends: gift/sub/scenario.yaml\n")
    return "mine.yaml"


def behind_a_link():
    in_a_subfolder()
    Path("mine").symlink_to("gift/sub")
    Path("mine.yaml").write_text(f"extends: mine/base.yaml\n{WHOLE}")
    return "mine.yaml"


def behind_a_link_to_a_file():
    gift({"sub/scenario.yaml": f"{PLUGGED}{WHOLE}"})
    shutil.copy("gift/sub/evil.py", "evil.py")
    Path("mine.yaml").symlink_to("gift/sub/scenario.yaml")
    return "mine.yaml"


def behind_a_link_out_of_the_folder():
    gift({"base.yaml": PLUGGED}, place="beside", mark="no_mark")
    gift({"scenario.yaml": f"extends: away/base.yaml\n{WHOLE}"})
    Path("gift/away").symlink_to("../beside")
    return "gift/scenario.yaml"


def of_an_absolute_name():
    gift({"base.yaml": PLUGGED}, place="beside", mark="no_mark")
    gift({"scenario.yaml": f"plugins: [{os.path.abspath('beside/evil.py')}]\n{WHOLE}"})
    return "gift/scenario.yaml"


def moved_elsewhere():
    in_a_subfolder()
    Path("elsewhere").mkdir()
    shutil.move("gift", "elsewhere/other")
    return "elsewhere/other/scenario.yaml"


def of_a_search():
    gift({"sub/tuned.yaml": f"{PLUGGED}{WHOLE}"}, mark="tune.json")
    return "gift/sub/tuned.yaml"


TRAPS = {
    trap.__name__: trap
    for trap in (
        in_a_subfolder,
        in_the_second_of_two,
        of_a_member,
        of_a_run_in_a_run,
        of_a_folder_elsewhere,
        behind_two_dots,
        that_one_s_own_extends,
        that_leads_out_again,
        behind_a_link,
        behind_a_link_to_a_file,
        behind_a_link_out_of_the_folder,
        of_an_absolute_name,
        moved_elsewhere,
        of_a_search,
    )
}
COMMANDS = (
    "run",
    "compare",
    "validate",
    "validate -v",
    "verify",
    "margins",
    "capability --every 180",
    "optimum",
    "export",
    "tune",
    "sweep run",
    "doubt",
    "identify",
    "live --no-open",
    "compare --doubt",
)
FUNCTIONS = (
    python.load,
    python.simulate,
    python.run,
    python.compare,
    python.sweep,
    python.tune,
    python.verify,
    python.doubt,
    python.optimum,
    python.open_session,
    python.identify,
)


@pytest.fixture(autouse=True)
def _place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("trap", TRAPS)
def test_every_trap_asks_for_trust_and_runs_with_it(podusv, trap):
    config = TRAPS[trap]()
    said = podusv("validate", config)
    assert (said.code, said.out) == (2, "")
    assert "evil.py; read it, then allow it with --trust" in one_line(said.err)
    assert not Path("MARK").exists()
    podusv("run", config, "--trust", "--no-figures", "-q")
    assert Path("MARK").read_text() == "ran"


@pytest.mark.parametrize("trap", ["in_a_subfolder", "of_a_member", "that_leads_out_again"])
@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_runs_a_file_of_somebody_s_folder(podusv, command, trap):
    config = TRAPS[trap]()
    said = podusv(*command.split(), config)
    assert (said.code, said.out) == (2, ""), said.out
    assert "allow it with --trust" in one_line(said.err)
    assert not Path("MARK").exists()
    assert "--trust" in podusv(*command.split()[: 2 if command == "sweep run" else 1], "--help").out


def test_a_bench_does_not_run_it_either(podusv):
    gift({"sub/laws.yaml": "plugins: [evil.py]\ncontrollers: {a: {kind: pid}}\n"})
    words = ("bench", "--laws", "gift/sub/laws.yaml", "--task", "line", "--condition", "calm")
    said = podusv(*words)
    assert (said.code, said.out) == (2, "")
    assert "evil.py; read it, then allow it with --trust" in one_line(said.err)
    assert not Path("MARK").exists()


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_no_function_runs_a_file_of_somebody_s_folder(function):
    config = in_a_subfolder()
    with pytest.raises(ScenarioError, match=r"podusv\.load\(\.\.\., trust=True\)"):
        function(config)
    with pytest.raises(ScenarioError, match="trust=True"):
        python.simulate_many(config, {"vessel.m": [20.0]})
    assert not Path("MARK").exists()


def test_no_environment_runs_a_file_of_somebody_s_folder():
    gym = pytest.importorskip("podusv.gym")
    config = in_a_subfolder()
    for make in (gym.Env, gym.VectorEnv):
        with pytest.raises(ScenarioError, match="trust=True"):
            make(config)
    assert not Path("MARK").exists()


def test_python_loads_it_when_told_to():
    config = in_a_subfolder()
    assert [plugin.name for plugin in python.load(config, trust=True).plugged] == ["evil.py"]
    assert Path("MARK").exists()


def test_a_live_page_does_not_run_it_either():
    with pytest.raises(ScenarioError, match="allow it with --trust"):
        Live(in_a_subfolder()).load({})
    assert not Path("MARK").exists()


def test_one_s_own_tree_asks_for_nothing(podusv):
    gift({"scenario.yaml": f"extends: sub/base.yaml\n{WHOLE}", "sub/base.yaml": PLUGGED}, "no_mark")
    assert podusv("validate", "gift/scenario.yaml").code == 0
    assert Path("MARK").exists()


def test_one_s_own_plug_in_needs_no_trust_where_somebody_s_scenario_is_extended(podusv):
    gift({"base.yaml": WHOLE})
    Path("mine.py").write_text("")
    Path("mine.yaml").write_text("extends: gift/base.yaml\nplugins: [mine.py]\n")
    assert podusv("validate", "mine.yaml").code == 0


def test_a_shipped_scenario_is_nobody_else_s_in_a_folder_of_a_run(podusv):
    Path("manifest.json").write_text("{}")
    assert podusv("validate", "podusv:own_vessel.yaml").code == 0


def test_an_unpacked_archive_is_such_a_folder(podusv):
    """The public way: an archive whose manifest is right, unpacked and validated."""
    from podusv_cli.storage import manifest

    in_a_subfolder()
    Path("gift/manifest.json").unlink()
    manifest.write(Path("gift"), "finished")
    names = [path.relative_to("gift").as_posix() for path in Path("gift").rglob("*.*")]
    archive.write(Path("g.zip"), Path("gift"), names)
    with ZipFile("g.zip") as packed:
        assert "gift/sub/evil.py" in packed.namelist()
    shutil.rmtree("gift")
    assert podusv("unpack", "g.zip").code == 0
    assert podusv("validate", "gift/scenario.yaml").code == 2
    assert not Path("MARK").exists()


def as_if_installed():
    """A folder of somebody's that looks like an installed package to a Python that begins there."""
    text = WHOLE.replace("kind: pid", "kind: evil")
    gift(
        {
            "scenario.yaml": text,
            "evil-1.0.dist-info/METADATA": "Name: evil\nVersion: 1.0\n",
            "evil-1.0.dist-info/entry_points.txt": "[podusv.controllers]\nevil = evil:Evil\n"
            "[podusv.commands]\nevil = evil:Evil\n",
        }
    )
    shutil.copy("gift/evil.py", "gift/yaml.py")
    shutil.copy("gift/evil.py", "gift/signal.py")


def begun(*words, cwd, python=sys.executable, path=ROOT):
    """What a Python says that begins in a folder, where it looks for packages, too."""
    return subprocess.run(
        [python, *words],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(path)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize(
    ("module", "command"),
    [
        ("podusv_cli", "validate scenario.yaml"),
        ("podusv", "list laws"),
        pytest.param("podusv_cli", "list laws", marks=pytest.mark.long),
        pytest.param("podusv", "validate scenario.yaml", marks=pytest.mark.long),
    ],
)
def test_no_module_of_somebody_s_folder_runs_where_podusv_begins_in_it(module, command):
    as_if_installed()
    said = begun("-m", module, *command.split(), cwd="gift")
    assert not Path("MARK").exists()
    if command == "list laws":
        assert said.returncode == 0
        assert "evil" not in said.stdout
    else:
        assert said.returncode == 2
        assert "evil" in one_line(said.stderr)


@pytest.mark.long
@pytest.mark.parametrize("place", ["gift", "gift/evil-1.0.dist-info"])
def test_a_notebook_in_somebody_s_folder_takes_nothing_there_for_installed(place):
    as_if_installed()
    for name in ("yaml.py", "signal.py"):  # which Python itself would take
        Path("gift", name).unlink()
    code = (
        f"import sys; sys.path.insert(0, '..')\n{NAMES}{COMMANDS}"
        "import podusv; podusv.load('scenario.yaml')"
    )
    Path("gift/evil-1.0.dist-info/scenario.yaml").write_text(Path("gift/scenario.yaml").read_text())
    said = begun("-c", code, cwd=place)
    assert not Path("MARK").exists()
    assert said.stdout.split() == ["[]", "[]"]
    assert "ScenarioError" in said.stderr


COMMANDS = (
    "from podusv_cli.cli.installed_commands import installed_commands\n"
    "print([*installed_commands()])\n"
)
NAMES = (
    "from podusv_cli.core.plugins import installed_plugins\n"
    "print([p.name for p in installed_plugins()])\n"
)


def test_a_package_in_one_s_own_folder_is_still_found():
    Path("lab").mkdir()
    install(Path("lab"))
    assert begun("-c", NAMES, cwd="lab").stdout == "['my-lab']\n"


@pytest.mark.parametrize("is_editable", [False, True])
def test_a_package_of_an_environment_is_found_wherever_that_lies(is_editable):
    """Beside the marks of a run, too; of an editable one the code lies elsewhere, by a .pth."""
    Path("project").mkdir()
    Path("project/manifest.json").write_text("{}")
    venv.create("project/.venv", symlinks=True)
    (packages,) = Path("project/.venv/lib").glob("python*/site-packages")
    install(packages)
    if is_editable:
        Path("project/src").mkdir()
        (packages / "my_lab").rename("project/src/my_lab")
        (packages / "my_lab.pth").write_text(os.path.abspath("project/src"))
    libraries = os.pathsep.join([str(ROOT), *filter(None, sys.path)])
    said = begun(
        "-c",
        NAMES,
        cwd="project",
        python=os.path.abspath("project/.venv/bin/python"),
        path=libraries,
    )
    assert said.stdout == "['my-lab']\n", said.stderr
