"""Commands that answer in words: validate, explain, list, schema; exit codes, pipes, help."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import typer
import typer.core
from conftest import kinds
from process_samples import offered_for, python, said
from scenario_samples import SOUND, write

import podusv_cli
from podusv_cli import cli
from podusv_cli.cli import completion
from podusv_cli.cli.exit_codes import PLEASE_REPORT, with_exit_codes
from podusv_cli.core.errors import LawError, ScenarioError, StorageError
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario import model as scenario_model
from podusv_cli.scenario import shipped
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.presets import preset_about, preset_names, preset_text, with_presets

HEAVY = {
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "pandas",
    "matplotlib",
    "h5py",
    "pydantic",
    "yaml",
    "jinja2",
}


def podusv_process(*words: str, stdout: int = subprocess.PIPE) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own."""
    return python("-m", "podusv_cli", *words, stdout=stdout)


# --- validate


def test_a_sound_scenario_is_a_line_and_what_it_takes(podusv):
    said = podusv("validate", "a.yaml", "--set", "controller.k_ze=0.03")
    takes = "a run takes about 0.63 s, 160 MB of memory and 7.4 MB of disk"
    assert said == (0, f"a.yaml: ok (a, pid, 31000 steps)\n{takes}\n", "")


def test_every_fault_is_a_line_on_stderr(podusv):
    write("bad.yaml", SOUND + "start: {x: no, z: 1}\n")
    assert podusv("validate", "bad.yaml", "--set", "log.every=0") == (
        2,
        "",
        "bad.yaml:6:12: start.x: must be a number [m], found 'no'\n"
        "bad.yaml:6:16: start.z: unknown key (allowed: x, y, psi, u, v, r)\n"
        "--set log.every=0: log.every: must be a whole number not below 1 [steps], found 0\n",
    )


def test_the_laws_to_compare_are_named_and_claims_are_checked(podusv):
    several = SOUND + "controllers: {slow: {k_ze: 0.01}, fast: {k_ze: 1}}\nclaims:\n"
    write("b.yaml", several + "  C1: {says: s, source: p, expect: slow.iae > fast.iae}\n")
    ok, *_ = podusv("validate", "b.yaml").out.splitlines()
    assert ok == "b.yaml: ok (b, slow, fast, 31000 steps)"
    write("c.yaml", several + "  C1: {says: s, source: p, expect: lame.iae > fast.iae}\n")
    said = podusv("validate", "c.yaml")
    assert said.code == 2
    assert said.err.startswith("c.yaml:8:36: claims.C1.expect: ")


def test_verbose_shows_every_value_and_where_it_comes_from(podusv):
    said = podusv("validate", "a.yaml", "-v", "--set", "start.x=-5", "--set", "name=b")
    assert said.code == 0
    lines = said.out.splitlines()
    assert lines[0] == "a.yaml: ok (b, pid, 31000 steps)"
    assert "start.x: -5.0  # --set start.x=-5" in lines
    assert "start.y: 0.0  # default" in lines
    assert "path.kind: line  # a.yaml:2:14" in lines
    assert "vessel.m: 23.8  # vessel file paper.yaml" in lines
    head = next(i for i, line in enumerate(lines) if line.startswith("underactuated: "))
    assert all("  # " in line for line in lines[head + 1 :])
    sections = [re.split(r"[.:]", line)[0] for line in lines[head + 1 :]]
    first = [*dict.fromkeys(sections)]
    assert first[:3] == ["name", "description", "controller"]
    assert first[-2:] == ["vessel", "nominal"]
    assert sections.count("nominal") == 1  # it is the vessel
    other = podusv("validate", "a.yaml", "-v", "--set", "nominal.m=30").out
    assert other.count("\nnominal.m: 30") == 1


# --- explain, list, schema


def test_explain_shows_everything_about_a_key(podusv):
    assert podusv("explain", "controller.K_Pu") == (
        0,
        "controller.K_Pu  a number >= 0 [kg/s], default 1100.0\n"
        "    proportional gain in surge\n"
        "    in pid\n",
        "",
    )


def test_explain_shows_the_sections_without_a_key(podusv):
    out = podusv("explain").out
    first, *_ = out.splitlines()
    named = re.findall(r"\b(vessel|path|disturbance|actuator|controller)\b(?!\.)", first)
    assert named == ["vessel", "path", "disturbance", "actuator", "controller"]
    assert [line for line in out.splitlines() if line in Scenario.model_fields] == [
        "vessel",
        "nominal",
        "start",
        "origin",
        "path",
        "disturbance",
        "actuator",
        "measurement",
        "estimator",
        "controller",
        "simulation",
        "control",
        "log",
        "metrics",
        "sweep",
        "tune",
        "doubt",
        "identify",
    ]
    assert f" kinds: {', '.join(kinds('paths'))} disturbance " in " ".join(out.split())


@pytest.mark.parametrize("columns", ["20", "40", "300"])
def test_text_fits_the_terminal(podusv, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    out = podusv("explain", "metrics").out
    assert max(map(len, out.splitlines())) <= min(int(columns), 100)
    assert "the last part of the run" in " ".join(out.split())


def test_every_name_that_is_listed_is_explained(podusv):
    out = podusv("list").out
    names = re.findall(r"^  (\S+)", out, re.MULTILINE)
    assert {"otter", "near-target", "iae", "line", "none"} <= set(names)
    for name in names:
        said = podusv("explain", name)
        assert (said.code, said.err) == (0, ""), name
        assert re.search(rf"^(\w+\.)*{name}\b", said.out, re.MULTILINE), name


@pytest.mark.parametrize(
    ("part", "headings"),
    [
        ("vessel", ["vessel (preset, a vessel):"]),
        ("vessels", ["vessel (preset, a vessel):"]),
        ("laws", ["controller:"]),
        ("controller", ["controller:"]),
        ("actuators", ["actuator:", "actuator.pod (preset, a set of pods):"]),
        ("metric", ["metrics:"]),
        ("findings", ["findings (silence):"]),
    ],
)
def test_a_part_of_the_list_stands_in_the_whole_list(podusv, part, headings):
    said = podusv("list", part)
    assert (said.code, re.findall(r"^\S.*", said.out, re.MULTILINE)) == (0, headings)
    for section in re.split(r"^(?=\S)", said.out, flags=re.MULTILINE):
        assert section in podusv("list").out


def test_an_unknown_part_of_the_list_is_told_with_all_parts(podusv):
    said = podusv("list", "vesels")
    assert (said.code, said.out) == (2, "")
    assert "unknown part 'vesels'; did you mean 'vessels'? (allowed: controllers, " in said.err


def test_a_preset_is_explained_with_its_source_and_what_it_holds_for(podusv):
    vessel, pods = podusv("explain", "otter").out.split("otter  ")[1:]
    assert vessel.startswith("vessel (vessel.preset)\n")
    assert pods.startswith("set of pods (actuator.pod.preset)\n")
    for text, (_, presets) in zip((vessel, pods), with_presets().values(), strict=True):
        for key in ("source", "validity"):
            assert preset_text(presets, "otter", key) in " ".join(text.split())


# --- help and usage


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_and_option_has_help(name, podusv):
    command = typer.main.get_command(cli.app).commands[name]
    assert command.help
    assert all(getattr(option, "help", "") for option in command.params), name
    said = podusv(name, "--help")
    assert said.code == 0
    assert " ".join(command.help.split()) in " ".join(said.out.split())


def test_help_lists_every_command_below_a_heading(podusv):
    said = podusv("--help").out
    below = {}
    for line in said.splitlines():
        if heading := re.fullmatch(r"([A-Z][a-z ]+):", line):
            below[heading[1]] = []
        elif command := re.match(r"  (\w+)  +\S", line):
            below[[*below][-1]].append(command[1])
    assert {heading: tuple(below[heading]) for heading in cli.GROUPS} == cli.GROUPS
    assert {*cli.COMMANDS, "sweep"} == {name for names in cli.GROUPS.values() for name in names}


def test_list_begins_with_the_laws(podusv):
    hint, first, *_ = podusv("list").out.splitlines()
    assert hint.startswith("to begin with: podusv list laws")
    assert first == "controller:"


def test_a_command_is_a_function_of_its_name():
    assert {"validate", "explain", "list", "schema"} <= set(cli.COMMANDS)
    for name in cli.COMMANDS:
        assert callable(getattr(import_module(f"podusv_cli.cli.{name}"), name))


def test_version(podusv):
    assert podusv("--version") == (0, f"podusv {podusv_cli.__version__}\n", "")


@pytest.mark.parametrize(
    "words", [["validate"], ["valdate", "a.yaml"], ["validate", "a.yaml", "--x"]]
)
def test_wrong_usage_exits_with_2(podusv, words):
    said = podusv(*words)
    assert said.code == 2
    assert said.out == ""
    assert "Error: " in said.err
    assert "Traceback" not in said.err


# --- failures


def outcome(error: BaseException) -> object:
    """The exit code of a command that fails so."""

    def command() -> None:
        raise error

    with pytest.raises(typer.Exit) as ended:
        with_exit_codes(command)()
    return ended.value.exit_code


def test_a_foreseen_failure_is_its_message_and_exit_code(capsys):
    assert outcome(ScenarioError(["a.yaml:1:1: m: bad", "worse"])) == 2
    assert outcome(StorageError("results: disk full")) == 5
    assert outcome(OSError(28, "No space left on device", "results/log.h5")) == 5
    out, err = capsys.readouterr()
    assert out == ""
    assert err == (
        "a.yaml:1:1: m: bad\nworse\nresults: disk full\n"
        "podusv: [Errno 28] No space left on device: 'results/log.h5'\n"
    )


def test_an_interrupt_is_130_and_a_line(capsys):
    assert outcome(KeyboardInterrupt()) == 130
    assert outcome(KeyboardInterrupt("interrupted; nothing was written")) == 130
    assert capsys.readouterr() == ("", "interrupted\ninterrupted; nothing was written\n")


def test_a_bug_shows_its_trace_and_asks_for_a_report(capsys):
    assert outcome(ZeroDivisionError("oops")) == 1
    err = capsys.readouterr().err
    assert err.startswith("Traceback (most recent call last):\n")
    assert err.endswith(f"ZeroDivisionError: oops\n{PLEASE_REPORT.format('podusv')}\n")


@pytest.mark.long
def test_a_name_that_is_no_text_is_shown_escaped(tmp_path):
    path = os.fsencode(tmp_path) + b"/\xff.yaml"
    with open(path, "w", encoding="utf-8") as file:
        file.write(SOUND + "name: a\n")
    process = podusv_process("validate", os.fsdecode(path))
    assert (process.returncode, process.stderr) == (0, "")
    assert "/\\udcff.yaml: ok " in process.stdout


LOADED = """
import sys
from podusv_cli.cli import main
try:
    main()
except SystemExit:
    print(sorted(sys.modules))
"""


@pytest.mark.parametrize("words", [["--help"], ["--version"], ["validate", "--help"], ["nonsense"]])
def test_help_and_mistakes_import_nothing_heavy(words):
    process = python("-c", LOADED, *words)
    modules = set(ast.literal_eval(process.stdout.splitlines()[-1]))
    assert "podusv_cli.cli.validate" in modules
    # Typer itself takes pydantic to convert what is given to a command.
    expected = set() if words[0].startswith("--") else {"pydantic"} & modules
    assert HEAVY & modules == expected


# --- completion of commands and options in a shell

PODUSV = f"'{sys.executable}' -m podusv_cli"
needs_bash = pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash here")


@needs_bash
def test_completion_is_installed_once_for_the_shell_that_asks(tmp_path: Path) -> None:
    for _ in range(2):
        # Something after it keeps bash from giving its process away.
        out = said("bash", "-c", f"{PODUSV} --install-completion; true", home=tmp_path)
        assert "bash completion installed" in out
    (line,) = filter(None, (tmp_path / ".bashrc").read_text().splitlines())
    script = Path(line.removeprefix("source ").strip("'"))
    assert script.is_relative_to(tmp_path)
    assert "complete -o default" in script.read_text()


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("podusv ", {*cli.COMMANDS, "sweep"}),
        ("podusv sweep run --un", {"--until"}),
        *(
            pytest.param(*long, marks=pytest.mark.long)
            for long in (
                ("podusv sweep ", {"run", "status", "report", "merge", "draw", "export"}),
                ("podusv ver", {"verify"}),
                ("podusv run --al", {"--allow-large"}),
                ("podusv run --s", {"--set"}),
            )
        ),
    ],
)
def test_commands_and_options_are_offered_and_nothing_heavy_is_imported(
    tmp_path: Path, typed: str, offered: set[str]
) -> None:
    *found, modules = offered_for(typed, tmp_path, LOADED)
    assert set(found) == offered
    # Typer itself takes pydantic to understand what has been typed.
    assert HEAVY & set(ast.literal_eval(modules)) <= {"pydantic"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("podusv run a.yaml --set control.p", {"control.period="}),
        ("podusv run a.yaml --set actuator.kind=s", {"actuator.kind=saturated"}),
        ("podusv verify a.yaml --set vessel.preset=ot", {"vessel.preset=otter"}),
        ("podusv compare a.yaml --set log.mon", {"log.monitor=true", "log.monitor=false"}),
        ("podusv plot x --figure sta", {"stability"}),
        ("podusv explain ia", {"iae", "iae_e", "iae_of_optimum"}),
        ("podusv explain near-t", {"near-target"}),
        ("podusv explain controller.pid.K_P", {"controller.pid.K_Pu", "controller.pid.K_Pr"}),
        ("podusv init pod/k", {"pod/kept"}),
        ("podusv list me", {"measurements", "metrics"}),
        ("podusv sweep export x --format p", {"parquet"}),
        ("podusv sweep run a.yaml --set control.p", {"control.period="}),
    ],
)
def test_keys_kinds_figures_and_names_are_offered(
    tmp_path: Path, typed: str, offered: set[str]
) -> None:
    script = "import sys\nfrom podusv_cli import cli\ncli.main()"
    assert set(offered_for(typed, tmp_path, script)) == offered


FILE = """
plugins: [law.py]
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: [{kind: step}, {kind: wind, speed: 3.0}]
actuator: {kind: ideal}
controllers: {mine: {kind: pid}, other: {kind: dsc}}
"""


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("controllers.mine.K_P", {"controllers.mine.K_Pu=", "controllers.mine.K_Pr="}),
        ("controllers.other.K_P", set()),
        ("disturbance[0].b_", {f"disturbance[0].b_{axis}=" for axis in "uvr"}),
        ("path.r", set()),  # a circle has a radius, a line has none
        ("control.p", {"control.period="}),
    ],
)
def test_keys_of_the_scenario_that_is_named_are_offered_and_nothing_of_it_runs(
    tmp_path: Path, monkeypatch, typed: str, offered: set[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("law.py").write_text("open('ran', 'w')\n")
    Path("a.yaml").write_text(FILE)
    context = typer.Context(typer.core.TyperCommand("run"))
    for given in ({"config": "a.yaml"}, {"items": ["a.yaml"]}, {}):
        context.params, context.args = given, [] if given else ["a.yaml"]
        assert {word for word, _ in completion.keys(context, typed)} == offered
    assert not Path("ran").exists()


def test_a_scenario_that_cannot_be_read_leaves_all_keys(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text("vessel: [")
    context = typer.Context(typer.core.TyperCommand("run"))
    context.params = {"config": "a.yaml"}
    monkeypatch.setattr(completion, "all_keys", lambda context, typed: [(f"all {typed}", "")])
    assert completion.keys(context, "path.r") == [("all path.r", "")]


@pytest.mark.parametrize("word", cli.MEANT)
def test_a_command_of_another_name_is_pointed_to(podusv, word: str) -> None:
    said = podusv(word, "a.yaml")
    assert said.code == 2
    (named,) = set(re.findall(r"podusv (\w+)", cli.MEANT[word])[:1])
    assert named in cli.COMMANDS
    assert f"No such command '{word}': podusv {named} " in " ".join(said.err.split())


@pytest.mark.long
def test_what_was_completed_is_kept_until_podusv_changes(tmp_path: Path, monkeypatch) -> None:
    typed = "podusv run --set controller.k_z"
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path / "cache"))
    first, second = (offered_for(typed, tmp_path, LOADED) for _ in range(2))
    assert first[:-1] == second[:-1] != []
    assert "podusv_cli.scenario.model" in first[-1]
    assert "podusv_cli.scenario.model" not in second[-1]
    (kept,) = tmp_path.rglob("completion/all_keys.json")
    stale = {**json.loads(kept.read_text()), "state": "of an older podusv", "known": {}}
    kept.write_text(json.dumps(stale))
    assert offered_for(typed, tmp_path, LOADED)[:-1] == first[:-1]


def test_a_new_scenario_is_offered(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(shipped, "folder", lambda: tmp_path)
    before = completion._state()
    (tmp_path / "new.yaml").write_text("name: new\n")
    assert completion._state() != before


def test_what_lacks_a_plug_in_that_failed_is_not_kept(tmp_path: Path, monkeypatch) -> None:
    def fails(plugins: object) -> None:
        raise LawError("cannot be imported")

    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    monkeypatch.setattr(scenario_model, "scenario_class", fails)
    assert ("iae", METRICS["iae"].meaning) in completion.metrics(
        typer.Context(typer.core.TyperCommand("plot")), "ia"
    )
    assert not [*tmp_path.rglob("metrics.json")]
    monkeypatch.undo()
    monkeypatch.setenv("PODUSV_CACHE", str(tmp_path))
    completion.metrics(typer.Context(typer.core.TyperCommand("plot")), "ia")
    assert [*tmp_path.rglob("metrics.json")]


def test_a_listed_vessel_has_its_size_and_a_sentence_that_tells_it_from_its_neighbours(podusv):
    said = podusv("list", "vessels").out
    assert "otter  length 2.0 m, beam 1.08 m, mass 55.0 kg\n    Otter, a 2 m catamaran" in said
    for _, presets in with_presets().values():
        sentences = [preset_about(presets, name) for name in preset_names(presets)]
        assert all(sentences)
        assert len({*sentences}) == len(sentences)
