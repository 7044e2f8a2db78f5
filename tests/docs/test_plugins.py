"""Components in files outside the package: found, run, recorded; not needed to look at runs."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sys
from pathlib import Path

import h5py
import pytest
import yaml
from command_samples import BASE, Command, one_line, write
from loop_counts import loop_counts
from plugin_parts import MORE
from plugin_samples import LAW, SCENARIO, TWO, put
from process_samples import offered_for

import podusv as podusv_python
from podusv_cli import plugin
from podusv_cli.core.plugins import from_file
from podusv_cli.scenario.load import load, load_text
from podusv_cli.scenario.model import Scenario, scenario_class
from podusv_cli.scenario.schema import json_schema

QUIET = ("--no-figures", "-q")
DIGEST = hashlib.sha256(LAW.encode()).hexdigest()


def digits(place: str) -> str:
    """The 8 hex digits at the end of a run folder's name."""
    return place.strip()[-8:]


def test_a_file_s_law_runs_compiled_and_its_run_says_which_file(podusv):
    assert podusv("run", put(), "--out", "r", *QUIET).code == 0
    with h5py.File("r/log.h5") as log:
        assert (log["e_ct"].attrs["units"], log["drift"].attrs["units"]) == (b"m", b"m s")
        assert set(log["tau_u_cmd"][...]) == {0.5}
    assert json.loads(Path("r/metrics.json").read_text())["metrics"]["law_ns"] > 0
    own = {"file": str(Path("laws/my_law.py").resolve()), "sha256": DIGEST}
    assert json.loads(Path("r/provenance.json").read_text())["plugins"] == [own]
    (named,) = yaml.safe_load(Path("r/resolved.yaml").read_text())["plugins"].items()
    assert named == ("plugins/my_law.py", {"version": "", "sha256": DIGEST})
    assert Path("r/plugins/my_law.py").read_text() == LAW


def test_each_of_two_equal_files_is_named_where_it_lies(podusv):
    for folder in ("one", "two"):
        Path(folder).mkdir()
        shutil.move("laws", folder) if put() else None
        shutil.move("a.yaml", folder)
    for folder in ("one", "two"):
        (plugin,) = load(f"{folder}/a.yaml").scenario.plugged
        assert plugin.path == str(Path(folder, "laws/my_law.py").resolve())


@pytest.mark.parametrize("when", ["before", "after"])
def test_an_old_name_of_a_decorator_works_and_says_the_new_one(when):
    new = f"warn_{when}_run"
    with pytest.warns(
        DeprecationWarning, match=rf"^podusv_cli\.plugin\.{when} is called {new} now$"
    ):
        old = getattr(plugin, when)
    assert old is getattr(plugin, new)
    assert old("a", about="path", meaning="m")(iter).when == when
    assert when not in plugin.__all__


def test_a_file_is_named_on_the_command_line_too(podusv):
    text = SCENARIO.replace("plugins: [laws/my_law.py]\n", "")
    shutil.move("laws/my_law.py", "own.py") if put(text) else None
    assert podusv("run", "a.yaml", *QUIET).code == 2
    for command in ("validate", "run", "compare", "verify"):
        options = ("--no-figures",) if command in ("run", "compare") else ()
        assert podusv(command, "a.yaml", "--plugin", "own.py", *options).code in (0, 3), command


def test_the_file_is_looked_for_beside_the_scenario(podusv, tmp_path):
    put()
    Path("inner").mkdir()
    shutil.move("laws", "inner")
    shutil.move("a.yaml", "inner/a.yaml")
    assert podusv("validate", "inner/a.yaml").code == 0
    write("b.yaml", "extends: inner/a.yaml\n")
    assert podusv("validate", "b.yaml").code == 0


def test_workers_of_a_comparison_know_it(podusv):
    assert podusv("compare", put(TWO), "--out", "c", *QUIET).code == 0
    for label, force in (("soft", 0.25), ("stiff", 0.5)):
        with h5py.File(f"c/{label}/log.h5") as log:
            assert set(log["tau_u_cmd"][...]) == {force}
        assert Path(f"c/{label}/plugins/my_law.py").read_text() == LAW
    (own,) = json.loads(Path("c/provenance.json").read_text())["plugins"]
    assert own["sha256"] == DIGEST


def test_validate_says_ok_only_when_the_law_of_a_study_has_passed_too(podusv):
    study = SCENARIO + "sweep: {draws: 2, vary: {start.x: {uniform: [-6, -5]}}}\n"
    name = put(study, LAW.replace("        rate[0] = signals[0]\n", ""))
    said = podusv("validate", name)
    assert (said.code, said.out) == (2, "")
    assert "it leaves the rate of drift unwritten" in one_line(said.err)


def test_a_run_repeats_itself_without_the_original(podusv):
    podusv("run", put(), "--out", "r", *QUIET)
    shutil.move("r", "moved")
    shutil.rmtree("laws")
    assert "identical" in podusv("rerun", "moved", "--trust").out
    assert podusv("run", "moved/resolved.yaml", "--trust", "--out", "again", *QUIET).code == 0
    assert Path("again/log.h5").read_bytes() == Path("moved/log.h5").read_bytes()
    assert podusv("diff", "moved", "again").code == 0


@pytest.mark.slow
def test_a_finished_run_is_looked_at_without_reading_its_file(podusv):
    podusv("compare", put(TWO), "--out", "c", *QUIET)
    trap = LAW + '\nfrom pathlib import Path\nPath("touched").touch()\n'
    for place in Path("c").glob("*/plugins/my_law.py"):
        place.unlink()
        manifest = place.parents[1] / "manifest.json"
        whole = json.loads(manifest.read_text())
        del whole["files"]["plugins/my_law.py"]
        manifest.write_text(json.dumps(whole))
    Path("laws/my_law.py").write_text(trap)
    assert podusv("plot", "c/soft", "c/pid", "--out", "p", "--figure", "trajectory").code == 0
    assert Path("p/trajectory.png").exists()
    said = podusv("diff", "c/soft", "c/stiff")
    assert said.code == 3
    assert "controller.gain 0.25 -> 0.5" in said.out
    said = podusv("compare", "c/soft", "c/pid", "--out", "d", "--json", "--figure", "errors")
    assert said.code == 0
    assert json.loads(said.out)["comparison"]["law_ns"]["soft"] is None
    assert "0.25" in Path("d/report.html").read_text()
    assert not Path("touched").exists()
    assert podusv("rerun", "c/soft", "--trust").code == 2


LOOKS = {
    "plot": ("plot", "--figure", "trajectory", "--out", "looked"),
    "diff": ("diff",),
    "compare": ("compare", "--figure", "errors", "--out", "looked"),
}


@pytest.mark.parametrize(
    "words",
    [
        pytest.param(words, id=n, marks=[pytest.mark.long] * (n != "plot"))
        for n, words in LOOKS.items()
    ],
)
def test_looking_at_finished_runs_makes_no_scenario_and_no_loop(podusv, monkeypatch, words):
    podusv("compare", put(TWO), "--out", "c", *QUIET)
    shutil.rmtree("laws")
    calls, (command, *options) = loop_counts(monkeypatch), words
    assert podusv(command, "c/soft", "c/pid", *options).code in (0, 3)
    assert not calls
    podusv("rerun", "c/pid", "--trust")
    assert calls["Scenario"] > 0
    assert calls["ClosedLoop"] > 0


def without_about(folder):
    """A run folder as podusv wrote it before there was about.json."""
    (Path(folder) / "about.json").unlink()
    path = Path(folder) / "manifest.json"
    whole = json.loads(path.read_text())
    del whole["files"]["about.json"]
    path.write_text(json.dumps(whole))


@pytest.mark.long
def test_a_run_of_before_is_looked_at_where_its_components_are_at_hand(podusv):
    podusv("compare", put(TWO), "--out", "c", *QUIET)
    shutil.move("laws/my_law.py", "own.py")
    pictures = []
    for folder in ("with", "without"):
        given = ("--out", folder, "--plugin", "own.py", "--figure", "errors")
        assert podusv("plot", "c/pid", "c/soft", *given).code == 0
        pictures.append({path.name: path.read_bytes() for path in Path(folder).iterdir()})
        if folder == "with":
            without_about("c/pid")
            without_about("c/soft")
    assert pictures[0] == pictures[1]
    assert podusv("plot", "c/pid", "--figure", "errors", "--out", "alone").code == 0
    assert podusv("diff", "c/soft", "c/pid").code == 3
    assert "identical" in podusv("rerun", "c/soft", "--trust").out
    for words in (("plot", "c/soft"), ("compare", "c/soft", "c/pid", "--out", "d")):
        said = podusv(*words)
        assert (said.code, said.out) == (2, "")
        assert "c/soft: an older podusv wrote it without about.json" in one_line(said.err)
        assert "unknown kind 'cross_track'" in said.err
        assert "podusv rerun c/soft --trust --out NEW" in one_line(said.err)
    Path("own.py").write_text(LAW + "\n")
    assert podusv("plot", "c/soft", "--plugin", "own.py", "--figure", "errors").code == 2


def test_a_run_says_about_itself_what_its_plug_in_would_say(podusv):
    podusv("run", put(), "--out", "r", *QUIET)
    told = json.loads(Path("r/about.json").read_text())
    assert told["values"]["controller"] == {"kind": "cross_track", "gain": 0.5}
    (gain,) = (one for one in told["law"] if one["key"] == "gain")
    assert (gain["value"], gain["unit"]) == ("0.5", "N/m")


def test_an_edit_is_noticed_by_the_code_cache_and_in_the_name(podusv):
    first = podusv("run", put(), *QUIET)
    put(law=LAW.replace("PUSH = 1.0", "PUSH = 2.0"))
    second = podusv("run", "a.yaml", *QUIET)
    with h5py.File(Path(second.out.strip()) / "log.h5") as log:
        assert set(log["tau_u_cmd"][...]) == {1.0}
    assert digits(first.out) != digits(second.out)
    said = podusv("diff", first.out.strip(), second.out.strip())
    assert said.code == 3
    assert "plugins" in said.out
    assert DIGEST[:30] in said.out


def test_a_changed_copy_is_not_run_as_if_it_were_the_same(podusv):
    podusv("run", put(), "--out", "r", *QUIET)
    Path("r/plugins/my_law.py").write_text(LAW + "\n")
    said = podusv("run", "r/resolved.yaml", "--trust", *QUIET)
    assert said.code == 2
    assert "r/plugins/my_law.py is not the one" in said.err


def test_a_law_without_constants_says_that_it_has_none(podusv):
    """It had ", and those of the nominal vessel"."""
    law = re.sub("    gain: float = .*\n", "", LAW).replace("k.gain", "k.gain_u")
    said = podusv("run", put(SCENARIO.replace(", gain: 0.5", ""), law), *QUIET)
    assert said.code == 2
    assert re.search(
        r"no attribute 'gain_u'.*; it has (those of the nominal vessel|none)", said.err
    )


LOADING = (
    "run",
    "compare",
    "validate",
    "verify",
    "margins",
    "optimum",
    "export",
    "tune",
    "sweep run",
)


@pytest.mark.parametrize("command", LOADING)
def test_a_scenario_in_a_folder_of_podusv_runs_no_file_without_trust(podusv, command):
    """Whether it is named itself or is what another file extends."""
    trap = f"{LAW}\nfrom pathlib import Path\nPath('ran').write_text('')\n"
    put(law=trap)
    for folder, mark in (("r", "manifest.json"), ("s", "study.json"), ("t", "tune.json")):
        Path(folder).mkdir()
        shutil.copytree("laws", f"{folder}/laws")
        Path(folder, mark).write_text("{}")
        shutil.copy("a.yaml", f"{folder}/tuned.yaml")
    Path("mine.yaml").write_text("extends: t/tuned.yaml\n")
    for file in ("r/tuned.yaml", "s/tuned.yaml", "t/tuned.yaml", "mine.yaml"):
        said = podusv(*command.split(), file)
        assert (said.code, said.out) == (2, "")
        assert "laws/my_law.py; read it, then allow it with --trust" in said.err
    assert not Path("ran").exists()
    if command == "validate":
        assert podusv("validate", "mine.yaml", "--trust").code == 0
        assert Path("ran").exists()


def test_scenarios_of_one_process_know_only_their_own_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = load(put()).scenario
    assert own.controller.label == "cross_track"
    assert load_text(BASE, "b.yaml").scenario.plugged == ()
    with pytest.raises(Exception, match="unknown kind 'cross_track'"):
        load_text(SCENARIO.replace("plugins: [laws/my_law.py]\n", ""), "a.yaml")
    ((_, module),) = from_file("elsewhere/my_law.py", LAW).offers
    assert type(own.controller) is module.CrossTrack
    assert scenario_class(()) is Scenario


PID = "podusv_cli.components.controllers.pid"
FAULTY = {
    "def (": "a.yaml:2:11: plugins: laws/my_law.py cannot be imported: SyntaxError: invalid "
    "syntax (my_law.py, line 1)",
    "import no_such_module": "laws/my_law.py cannot be imported: ModuleNotFoundError: No module "
    "named 'no_such_module' (my_law.py, line 1)",
    f"from {PID} import Pid\nclass Mine(Pid):\n    gain = 1.0\n": "gain = 1.0",
    "raise SystemExit(0)": "laws/my_law.py cannot be imported: SystemExit: 0 (my_law.py, line 1)",
    f"from {PID} import Pid\n\n\nclass Mine(Pid): pass\n": "a.yaml:2:10: "
    f"plugins: my_law.py, line 4, class Mine: its kind pid is that of {PID}, "
    "too; take another name",
    LAW.replace('Literal["cross_track"]', "str"): "class CrossTrack: its kind is no fixed word; "
    'write kind: Literal["mine"] = "mine"',
}


@pytest.mark.parametrize("law", FAULTY)
def test_a_file_that_is_no_plug_in_is_refused_in_a_line(podusv, law):
    for command in ("run", "compare", "validate"):
        said = podusv(command, put(law=law))
        assert (said.code, said.out) == (2, "")
        if "gain = 1.0" in law and "Pid" in law:
            assert "(my_law.py, line 2)" in one_line(said.err)
        else:
            assert FAULTY[law] in one_line(said.err)


NAMED = {
    "plugins: [nothing.py]": "'nothing.py' cannot be read: no such file or directory",
    "plugins: 5": "plugins: must be a list of files like my_law.py and installed packages, found 5",
    "plugins: [{}]": "like my_law.py and installed packages, found an empty mapping",
    "plugins: [my_lab]": "'my_lab' is no file (these end in .py) and no installed package",
    "plugins: {laws/my_law.py: {sha: abc}}": "unknown key; did you mean 'sha256'?",
    "plugins: {laws/my_law.py: {sha256: abc}}": "is not the one that was used; without sha256",
}


@pytest.mark.parametrize("text", NAMED)
def test_what_plugins_may_name(podusv, text):
    said = podusv("validate", put(SCENARIO.replace("plugins: [laws/my_law.py]", text)))
    assert said.code == 2
    assert NAMED[text] in said.err


def test_a_file_may_stand_alone_or_twice(podusv):
    for entry in ("laws/my_law.py", "[laws/my_law.py, ./laws/my_law.py]", "{laws/my_law.py: {}}"):
        said = podusv("validate", put(SCENARIO.replace("[laws/my_law.py]", entry)))
        assert said.code == 0, said.err


# --- what a plug-in offers is known wherever podusv's own is

CLAIM = """
claims:
  C1: {says: s, source: t, expect: 'min(cross_track.gap) < 0 and cross_track.largest_east > 1'}
"""


@pytest.fixture
def scenario(podusv: Command) -> str:
    """A scenario whose plug-in has a law, a metric, a derived signal, a figure and a finding."""
    return put(SCENARIO + CLAIM, LAW + MORE)


def test_the_schema_has_kinds_and_findings_of_plug_ins(podusv: Command, scenario: str) -> None:
    told = json.loads(podusv("schema", "--plugin", "laws/my_law.py").out)
    assert "gain" in told["definitions"]["CrossTrack"]["properties"]
    assert "wide-gap" in told["properties"]["silence"]["items"]["enum"]
    assert "CrossTrack" not in json.loads(podusv("schema").out)["definitions"]


def test_a_class_of_a_plug_in_may_have_the_name_of_one_of_podusv() -> None:
    law = LAW.replace("class CrossTrack", "class Vessel")
    vessels = json_schema((), (from_file("namesake.py", law),))["definitions"]
    (own,) = (made for name, made in vessels.items() if name.endswith("__vessel__Vessel"))
    assert "otter" in own["properties"]["preset"]["anyOf"][0]["enum"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("podusv run --plugin {} a.yaml --set controller.kind=cr", {"controller.kind=cross_track"}),
        ("podusv plot --plugin {} x --figure ga", {"gaps"}),
        ("podusv explain --plugin {} wide", {"wide-gap"}),
        ("podusv explain --plugin no.py near-t", {"near-target"}),
    ],
)
def test_a_shell_completes_what_plug_ins_offer(
    scenario: str, tmp_path: Path, typed: str, offered: set[str]
) -> None:
    script = "import sys\nfrom podusv_cli import cli\ncli.main()"
    line = typed.format(Path("laws/my_law.py").resolve())
    assert set(offered_for(line, tmp_path, script)) == offered


def test_commands_tell_of_them(podusv: Command, scenario: str) -> None:
    given = ("--plugin", "laws/my_law.py")
    assert "The gap over time" in podusv("list", *given).out
    assert "shows gap" in podusv("explain", "gaps", *given).out
    assert "cross-track error less" in podusv("explain", "gap", *given).out
    assert podusv("explain", "gaps").code == 2
    assert "largest_east" in podusv("verify", scenario).out


def test_claims_use_its_metric_and_derived_signal(podusv: Command, scenario: str) -> None:
    said = podusv("compare", scenario, "--out", "c", "--no-figures")
    assert "C1  reproduced" in said.out


OF_LOG = """
from podusv_cli.plugin import Metric

eastmost = Metric("eastmost", "m", "largest y", of_log=lambda log: log["y"].max())
broken = Metric("broken", "m", "none", of_log=lambda log: log["nothing"].max())
"""


def test_a_metric_may_be_a_function_of_the_log(podusv: Command) -> None:
    text = SCENARIO + CLAIM.replace(
        "min(cross_track.gap) < 0 and cross_track.largest_east > 1",
        "cross_track.eastmost == max(cross_track.y)",
    )
    scenario = put(text, LAW + OF_LOG)
    said = podusv("compare", scenario, "--out", "c", "--no-figures", "--metric", "eastmost")
    assert "C1  reproduced" in said.out
    run = podusv_python.open_run("c/cross_track")
    assert run.metrics["eastmost"] == run["y"].max()
    assert "broken" not in run.metrics
    assert "metric broken" in said.err  # costs nothing else
    assert podusv_python.simulate(scenario).metrics["eastmost"] == run.metrics["eastmost"]


def test_a_study_keeps_no_logs_and_leaves_out_metrics_that_need_them(podusv: Command) -> None:
    sweep = "\nsweep: {draws: 2, seed: 1, vary: {start.x: {uniform: [-6.0, -4.0]}}}\n"
    scenario = put(SCENARIO + sweep, LAW + OF_LOG)
    study = podusv_python.sweep(scenario, {"simulation.duration": 1.0}, figures=False)
    assert "iae" in study.table
    assert "eastmost" not in study.table
    claims = {
        "sweep.claims.S1": {
            "says": "s",
            "source": "p",
            "expect": "median(cross_track.eastmost) > 0",
        }
    }
    with pytest.raises(podusv_python.PodusvError, match="eastmost"):
        podusv_python.sweep(scenario, claims, out="t")


@pytest.mark.usefixtures("scenario")
def test_python_knows_them() -> None:
    run = podusv_python.simulate("a.yaml")
    assert run.metrics["largest_east"] == pytest.approx(2.0, abs=0.2)
    assert (run["gap"] == run["e_ct"] - run["z_e"]).all()
    assert len(run.plot("gaps").axes) == 1
    assert any("wide-gap" in line for line in run.warnings)
    assert "largest_east" in podusv_python.verify("a.yaml").loc["cross_track"].index
    many = podusv_python.simulate_many("a.yaml", {"controller.gain": [0.5, 1.0]})
    assert many["largest_east"].notna().all()
    assert f"{run.metrics['largest_east']:.5g} m" in run._repr_html_()


def test_every_name_that_plugins_are_promised_is_there():
    for name in (*plugin.__all__, *plugin.FIGURES):
        assert getattr(plugin, name) is not None


def test_a_module_beside_a_plug_in_is_noticed_and_one_that_is_installed_is_not(podusv, monkeypatch):
    """The run folder keeps no module that a plug-in imports, so that nobody else can run it."""
    monkeypatch.syspath_prepend(Path.cwd())
    write("pushing_helper.py", "GAIN = 0.5\n")
    other = LAW.replace("import numpy as np\n", "import numpy as np\nimport pushing_helper\n", 1)
    said = {}
    for name, text in {"alone": LAW, "beside": other}.items():
        write(f"{name}.py", text)
        write(f"{name}.yaml", SCENARIO.replace("laws/my_law.py", f"{name}.py"))
        said[name] = podusv("validate", f"{name}.yaml").out
    monkeypatch.delitem(sys.modules, "pushing_helper")
    assert "unkept-module" not in said["alone"]
    assert "beside.py imports pushing_helper, and a run folder does not keep that file" in (
        " ".join(said["beside"].split())
    )
