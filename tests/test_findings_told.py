"""Where warnings go, how they look there, and how they are silenced."""

import json
import re
from pathlib import Path

from command_samples import Said
from conftest import PACKAGE
from findings_samples import CONFIGS, PLAIN

from podusv_cli.core.finding import Finding
from podusv_cli.findings.finding import merged
from podusv_cli.scenario.load import load

SHORT = ("--set", "simulation.duration=1", "--set", "actuator={kind: ideal}", "--no-figures")
SWAYING = (
    "--set",
    "vessel.preset=paper",
    "--set",
    "silence=[path-bend, bound-growing, never-settles]",
)


def scenario_file(name: str) -> str:
    return str(CONFIGS / name)


def test_warnings_come_on_stderr_in_json_and_in_the_run_folder(podusv):
    bad = ("run", scenario_file("corrected.yaml"), *SWAYING, *SHORT)
    said: Said = podusv(*bad, "--out", "out", "--json")
    assert said.code == 0
    lines = said.err.splitlines()
    assert {line.partition(":")[0] for line in lines} == {
        "warning[sway-drift]", "warning[sway-unstable]"
    }  # fmt: skip
    printed = json.loads(said.out)["warnings"]
    assert [f"warning[{w['code']}]: {w['where']}: {w['text']}" for w in printed] == lines
    assert json.loads(Path("out/metrics.json").read_text())["warnings"] == printed
    assert podusv(*bad, "--out", "quiet", "-q").err == ""


def test_what_is_silenced_is_not_shown(podusv):
    bad = (
        "--set",
        "vessel.preset=paper",
        "--set",
        "silence=[sway-drift, sway-unstable, bound-growing, never-settles]",
    )
    assert podusv("run", scenario_file("corrected.yaml"), *bad, *SHORT, "--out", "o").err == ""
    said = podusv("validate", scenario_file("corrected.yaml"), *bad)
    assert "sway" not in said.out
    assert "path-bend" in said.out


def test_an_unknown_code_is_refused_with_a_suggestion(podusv):
    said = podusv("validate", "a.yaml", "--set", "silence=[path-jumps]")
    assert said.code == 2
    assert "did you mean 'path-jump'?" in said.err


def test_findings_that_not_all_runs_share_name_their_runs():
    shared, some, own = (Finding(code, "actuator", code) for code in ("a", "b", "c"))
    found = merged({"x": [shared, some], "y": [some, shared, own], "z": [shared, own, own]})
    assert [str(finding) for finding in found] == [
        "warning[a]: actuator: a", "warning[b]: x, y: actuator: b", "warning[c]: y, z: actuator: c",
    ]  # fmt: skip
    assert merged({"x": [shared], "there already": []})[0].runs == ("x",)
    assert merged({"x": [shared]}) == [shared]


def transcripts() -> list[tuple[str, list[str]]]:
    """Every `podusv validate` of docs/findings.md, with the lines shown below it."""
    text = (PACKAGE.parent / "docs" / "findings.md").read_text()
    blocks = re.findall(r"^    \$ podusv validate (\S+)\n((?:    .*\n)+)", text, re.MULTILINE)
    return [(config, shown.replace("\n    ", "\n")[4:].splitlines()) for config, shown in blocks]


def test_docs_show_what_a_terminal_shows(podusv, monkeypatch):
    monkeypatch.setattr("podusv_cli.cli.terminal.sys.stdout.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(PACKAGE.parent)
    assert len(transcripts()) == 2
    for config, shown in transcripts():
        assert podusv("validate", config).out.splitlines() == shown


def test_findings_are_wrapped_on_a_terminal_and_whole_in_a_pipe(podusv, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    validate, run = (
        (command, scenario_file("corrected.yaml"), *SWAYING, *SHORT[:4])
        for command in ("validate", "run")
    )
    whole = podusv(*validate).out.splitlines()[2:]
    assert podusv(*run, "--no-figures", "--out", "a").err.splitlines() == whole
    assert len(whole) == 2
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(
            f"podusv_cli.cli.terminal.sys.{stream}.isatty", lambda: True, raising=False
        )
    err = podusv(*run, "--no-figures", "--out", "b").err
    out = podusv(*validate).out
    for shown in (out[out.index("warning") :].splitlines(), err.splitlines()):
        assert max(map(len, shown)) <= 60 < len(shown) * 60 / 2
        assert " ".join(line.strip() for line in shown) == " ".join(whole)


def test_silencing_is_no_difference_between_runs_and_survives_resolving(podusv):
    loud = (*PLAIN, "silence=[path-jump, saturated]")
    assert load(CONFIGS / "corrected.yaml", loud).scenario.silence == ("path-jump", "saturated")
    run = ("run", scenario_file("corrected.yaml"), *SHORT)
    podusv(*run, "--out", "a")
    podusv(*run, "--set", "silence=[saturated]", "--out", "b")
    assert load("a/resolved.yaml").scenario.silence == ()
    assert load("b/resolved.yaml").scenario.silence == ("saturated",)
    assert "silence" not in podusv("compare", "a", "b", "--no-figures", "--out", "ab").err
