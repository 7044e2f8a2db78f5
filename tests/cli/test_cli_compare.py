"""`podusv compare` on the command line: exit codes, what is told where, what is refused."""

import base64
import json
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from uuid import uuid4

import pytest
from command_samples import BASE, PATIENCE, TWO, Said, commanded, under_way, write

from podusv_cli.cli.grid import grid
from podusv_cli.cli.terminal import Warnings
from podusv_cli.core.finding import Finding
from podusv_cli.process.workers import Outcome
from podusv_cli.storage import manifest
from podusv_cli.workflows import compare


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    """`podusv compare` without figures, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return partial(commanded(monkeypatch, capsys), "compare", "--no-figures")


def claim(name: str, expect: str) -> str:
    """A scenario's section with one claim."""
    return f"claims:\n  {name}: {{says: s, source: p, expect: {expect!r}}}\n"


def claims_of(said: Said) -> dict[str, dict]:
    """Claims by name, of what `--json` printed."""
    return {verdict["claim"]: verdict for verdict in json.loads(said.out)["claims"]}


# --- what is told


def test_a_diverging_run_is_exit_code_3_and_hides_no_other(podusv):
    config = write("two.yaml", TWO)
    said = podusv(config, "--out", "x", "--set", "controllers.soft.T_d=1e-5")
    assert said.code == 3
    assert "soft: diverged at t = " in said.err
    row = next(line for line in said.out.splitlines() if line.endswith(" iae")).split()
    assert float(row[-3].rstrip("*")) > 0
    assert row[-2] == "-"
    assert "soft: diverged at t = " in Path("x/comparison.md").read_text()
    assert manifest.check(Path("x")).status == "finished"


@pytest.mark.slow
def test_runs_that_differ_in_more_are_warned_of_by_key(podusv):
    write("a.yaml", BASE)
    write("b.yaml", BASE.replace("y: -2.0", "y: -3.0"))
    said = podusv("a.yaml", "b.yaml", "--out", "x")
    assert said.code == 0
    assert said.err == (
        "warning: the runs differ in more than the controller:\n  start.y: a -2, b -3\n"
        "the numbers may not have converged; check them: podusv verify a.yaml\n"
    )
    assert "warning" not in podusv(write("two.yaml", TWO), "--out", "y").err


def test_json_has_the_documented_shape(podusv):
    config = write("two.yaml", TWO + claim("C1", "stiff.iae <= soft.iae"))
    said = podusv(config, "--out", "x", "--json")
    answer = json.loads(said.out)
    assert list(answer) == [
        "format",
        "status",
        "folder",
        "runs",
        "comparison",
        "failed",
        "differences",
        "claims",
        "missing",
    ]
    assert (answer["format"], answer["status"], answer["folder"]) == (1, "finished", "x")
    for run, label in zip(answer["runs"], ("stiff", "soft"), strict=True):
        keys = ["format", "status", "run", "controller", "metrics", "timing", "warnings"]
        assert list(run) == keys
        assert (run["status"], run["run"], run["controller"]) == ("finished", f"x/{label}", "pid")
        parts = {"compile_s", "engine_s", "write_s", "figures_s", "total_s"}
        assert parts <= set(run["timing"])
        iae = answer["comparison"]["iae"][label]
        assert iae == run["metrics"]["iae"] > 0
    assert answer["claims"][0]["verdict"] == "reproduced"


def test_quiet_is_the_folder_alone(podusv):
    assert podusv(write("two.yaml", TWO), "--out", "x", "-q") == (0, "x\n", "")


@pytest.mark.slow
def test_finished_folders_and_a_scenario_mix(podusv):
    podusv(write("two.yaml", TWO), "--out", "x")
    said = podusv("x", "x/soft", write("one.yaml", BASE), "--out", "y", "--json")
    answer = json.loads(said.out)
    assert said.code == 0
    where = [run["run"] for run in answer["runs"]]
    assert where == ["x/stiff", "x/soft", "x/soft", "y/one"]
    assert list(answer["comparison"]["iae"]) == ["stiff", "soft", "soft_2", "one"]


# --- claims of several scenarios


@pytest.mark.slow
def test_claims_speak_of_their_own_scenarios_runs(podusv):
    """The second scenario's `stiff` and `soft` are swapped, and run under other names."""
    swapped = BASE + "controllers: {soft: {K_Pu: 200.0}, stiff: {K_Pu: 5.0}}\n"
    write("a.yaml", TWO + claim("C1", "stiff.peak_tau_u > soft.peak_tau_u"))
    expect = "stiff.peak_tau_u > soft.peak_tau_u and finished(stiff)"
    write("b.yaml", swapped + claim("C2", expect))
    verdicts = claims_of(podusv("a.yaml", "b.yaml", "--out", "x", "--json"))
    assert verdicts["C1"]["verdict"] == "reproduced"
    assert verdicts["C2"]["verdict"] == "not reproduced"
    assert list(verdicts["C2"]["numbers"]) == [
        "stiff_2.peak_tau_u",
        "soft_2.peak_tau_u",
        "finished(stiff_2)",
    ]
    assert verdicts["C2"]["expect"].startswith("stiff_2.peak_tau_u > soft_2.peak_tau_u")


def test_claims_reach_runs_that_are_named_after_their_scenario(podusv):
    write("my-a.yaml", BASE + claim("C1", "pid.peak_tau_u > 1 and max(pid.u, 0, 1) > 0"))
    write("my-b.yaml", BASE)
    verdicts = claims_of(podusv("my-a.yaml", "my-b.yaml", "--out", "x", "--json"))
    assert verdicts["C1"]["verdict"] == "reproduced"
    assert list(verdicts["C1"]["numbers"]) == ["my-a.peak_tau_u", "max(my-a.u, 0, 1)"]


@pytest.mark.slow
def test_claims_are_not_about_finished_runs_of_the_same_name(podusv):
    config = write("two.yaml", TWO + claim("C1", "soft.peak_tau_u < 100"))
    podusv(config, "--out", "old", "--set", "controllers.soft.K_Pu=900")
    verdicts = claims_of(podusv("old/soft", config, "--out", "x", "--json"))
    assert verdicts["C1"]["verdict"] == "reproduced"
    assert list(verdicts["C1"]["numbers"]) == ["soft_2.peak_tau_u"]


@pytest.mark.slow
def test_claims_of_the_same_name_keep_apart(podusv):
    write("a.yaml", TWO + claim("C1", "finished(soft)"))
    write("b.yaml", TWO + claim("C1", "not finished(soft)"))
    verdicts = claims_of(podusv("a.yaml", "b.yaml", "a.yaml", "--out", "x", "--json"))
    assert {name: verdict["verdict"] for name, verdict in verdicts.items()} == {
        "a.C1": "reproduced",
        "b.C1": "not reproduced",
        "a.C1_2": "reproduced",
    }


def test_cannot_tell_says_why(podusv):
    config = write("two.yaml", TWO + claim("C1", "soft.iae < stiff.iae"))
    said = podusv(config, "--out", "x", "--set", "controllers.soft.T_d=1e-5")
    assert "C1  cannot tell" in said.out
    for text in (said.out, Path("x/claims.md").read_text()):
        assert "soft.iae: soft diverged at t = " in " ".join(text.split())
    stored = json.loads(Path("x/claims.json").read_text())["claims"][0]
    assert stored["reason"].startswith("soft.iae: soft diverged at t = ")


# --- what is refused


@pytest.mark.slow
def test_what_is_compared_is_not_overwritten(podusv):
    podusv(write("two.yaml", TWO), "--out", "x")
    before = manifest.check(Path("x"))
    for out in ("x", "x/", "./x/../x", "x/soft", "x/new", "."):
        for force in ([], ["--force"]):
            said = podusv("x", "--out", out, *force)
            assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
            assert said.err.startswith(f"--out {Path(out)}: x is to be compared")
    Path("link").symlink_to("x")
    for what in ("link/soft", "x/soft/scenario.yaml"):
        assert podusv(what, "--out", "x", "--force").code == 2
    assert manifest.check(Path("x")) == before
    assert not Path("x/new").exists()


def test_set_without_a_scenario_is_refused(podusv):
    podusv(write("two.yaml", TWO), "--out", "x")
    said = podusv("x/soft", "x/stiff", "--set", "start.x=1", "--out", "y")
    assert said.code == 2
    assert said.err == (
        "--set start.x=1: --set changes scenarios, and only finished runs are given\n"
    )
    assert not Path("y").exists()


def test_a_claim_without_meaning_is_a_scenario_error(podusv):
    config = write("two.yaml", TWO + claim("C1", "max(stiff.W_hat_u) < 1"))
    said = podusv(config, "--out", "x")
    line = len(TWO.splitlines()) + 2
    assert said.code == 2
    assert said.err.startswith(f"two.yaml:{line}:")
    assert "claims.C1.expect: " in said.err
    assert "W_norm_u" in said.err


def test_runs_that_all_die_are_reported(podusv, monkeypatch):
    lost = Outcome(failure="its process ended with exit code -9, 2 times")
    monkeypatch.setattr(compare, "run_all", lambda jobs, *rest: [lost] * len(jobs))
    config = write("two.yaml", TWO + claim("C1", "soft.iae < stiff.iae"))
    said = podusv(config, "--out", "x")
    assert said.code == 3
    assert said.err.splitlines() == [f"stiff: {lost.failure}", f"soft: {lost.failure}"]
    assert f"soft.iae: soft has no log: {lost.failure}" in said.out
    assert Path("x/comparison.csv").read_text().startswith("metric,unit,stiff,soft")


# --- on a terminal


FIVE = BASE.replace("duration: 1.0", "duration: 0.1, compiled: false") + (
    "controllers: {one: {}, another: {K_Pu: 60}, third: {K_Pu: 70}, the_fourth: {}, last: {}}\n"
)


@pytest.mark.slow
def test_five_runs_are_tables_below_each_other_on_a_narrow_terminal(podusv, monkeypatch):
    config = write("five.yaml", FIVE)
    whole = podusv(config, "--out", "x").out.splitlines()
    labels = ["one", "another", "third", "the_fourth", "last"]
    assert whole[0].split() == ["unit", *labels, "name"]
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("podusv_cli.cli.terminal.sys.stdout.isatty", lambda: True, raising=False)
    out = podusv(config, "--out", "y", "-v").out
    assert max(map(len, out.splitlines())) <= 80
    tables = [part.splitlines() for part in out.split("\n\n")]
    assert [word for lines in tables for word in lines[0].split()[1:]] == [*labels, "name"]
    words, count = whole[0].index("one"), len(tables[0])
    for lines in tables:
        assert [line[:words].rstrip() for line in lines[:count]] == [
            line[:words].rstrip() for line in whole[:count]
        ]
        starts = [lines[0].index(label) for label in lines[0].split()]
        assert all(line[start - 1] == " " for line in lines[:count] for start in starts)


def on_a_terminal(monkeypatch, width=80):
    monkeypatch.setenv("COLUMNS", str(width))
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(
            f"podusv_cli.cli.terminal.sys.{stream}.isatty", lambda: True, raising=False
        )


@pytest.mark.parametrize("laws", [1, 4, pytest.param(14, marks=pytest.mark.long)])
def test_a_terminal_shows_the_headlines_of_all_laws_beside_each_other(podusv, monkeypatch, laws):
    labels = [f"a_long_name_{i}" if i % 3 == 0 else f"law_{i}" for i in range(laws)]
    several = ", ".join(f"{label}: {{K_Pu: {i + 1.0}}}" for i, label in enumerate(labels))
    config = write("laws.yaml", f"{SHORT_BASE}controllers: {{{several}}}\n")
    on_a_terminal(monkeypatch)
    out = podusv(config, "--out", "x", "--force", "--no-figures").out
    assert max(map(len, out.splitlines())) <= 80
    table = re.split(r"\n(?:\* best of those|-v: every metric)", out)[0].splitlines()
    if laws < 5:  # a column each
        assert len(table) <= 9
        assert table[-1].startswith("share of time at the actuator's limits")
        assert len(table[-1].split()) == 7 + laws
    else:  # a line each
        assert [line.split()[0] for line in table[-laws:]] == labels
        assert {len(line.split()) for line in table[-laws:]} == {6}
    whole = podusv("x", "--out", "y", "-v", "--no-figures").out
    assert "squared surge force" in whole
    assert "squared" not in out


SHORT_BASE = BASE.replace("duration: 1.0", "duration: 0.1, compiled: false")


def test_metrics_that_are_asked_for_are_all_that_a_terminal_shows(podusv, monkeypatch):
    config = write("two.yaml", TWO.replace("duration: 1.0", "duration: 0.1"))
    on_a_terminal(monkeypatch)
    out = podusv(config, "--out", "x", "--metric", "rmse", "--metric", "iae").out
    first, second = (line.split("  ")[0] for line in out.splitlines()[1:3])
    assert (first, second) == (
        "distance to the target, rms [m]",
        "distance to the target, integrated [m s]",
    )


@pytest.mark.parametrize("others", [(), ("ise", "energy")])
@pytest.mark.parametrize("terminal", [False, True])
def test_a_metric_that_no_run_has_is_warned_of(podusv, monkeypatch, others, terminal):
    config = write("two.yaml", TWO.replace("duration: 1.0", "duration: 0.1"))
    if terminal:
        on_a_terminal(monkeypatch, 100)
    chosen = [word for name in ("path_done", *others) for word in ("--metric", name)]
    said = podusv(config, "--out", "x", "--no-figures", *chosen)
    assert said.code == 0
    assert "warning: no run here has path_done; tables are without it\n" in said.err
    assert "path_done" not in said.out
    rows = Path("x/comparison.tex").read_text().splitlines()[6:-2]
    assert len(rows) == len(others)
    lines = Path("x/comparison.md").read_text().splitlines()
    assert [line.split("`")[1] for line in lines if "`" in line] == [*others]


def test_findings_of_one_kind_are_one_line_where_runs_go_together(capsys):
    limited = [
        Finding("saturated", "actuator", f"{n} % limited", (run,)) for n, run in enumerate("abc")
    ]
    bend = Finding("path-bend", "path", "bends", ("b",))
    Warnings().all_of([*limited[:2], bend], ["a", "b", "c"])
    assert capsys.readouterr().err.splitlines() == [
        "warning[saturated]: a, b: actuator: in a, 0 % limited; -v shows it for each",
        "warning[path-bend]: b: path: bends",
    ]
    Warnings().all_of(limited, ["a", "b", "c"])
    assert capsys.readouterr().err.startswith("warning[saturated]: all 3 runs: actuator: in a, 0 %")
    Warnings().all_of(limited, [])
    assert capsys.readouterr().err.splitlines() == [*map(str, limited)]


def test_a_table_is_as_narrow_as_its_words_allow():
    head, rows = ["", "a_head", "b\n[m]"], [["one two three four five six", "1", "2.5"]]
    assert grid(head, rows, 50) == [
        "                             a_    b",
        "                             head  [m]",
        "one two three four five six  1     2.5",
    ]
    assert grid(head, rows, 34) == [
        "                          a_   b",
        "                          head [m]",
        "one two three four five",
        "six                       1    2.5",
    ]
    assert grid(head, rows, 20) == []


def test_the_last_line_tells_how_to_check_that_numbers_have_converged(podusv):
    config = write("one.yaml", BASE)
    said = podusv(config, "--out", "x", "--set", "description=two words")
    assert said.out.splitlines()[-2:] == ["compared 1 run: x", "report: x/report.html"]
    assert said.err.splitlines()[-1] == (
        "the numbers may not have converged; check them: "
        "podusv verify one.yaml --set 'description=two words'"
    )


def test_after_finished_runs_the_last_line_names_the_first_that_is_not_verified(
    podusv, monkeypatch, capsys
):
    own = f"name=kept_{uuid4().hex}"
    config = write("two.yaml", TWO)
    fine = ("--set", "simulation.step=0.0025", "--set", own)
    assert podusv(config, "--out", "x", *fine).code == 0
    for label in ("stiff", "soft"):
        file = Path("x") / label / "resolved.yaml"
        assert podusv("x", "--out", "y", "--force").err.endswith(f": podusv verify {file}\n")
        assert commanded(monkeypatch, capsys)("verify", str(file)).code == 0
    assert "may not have converged" not in podusv("x", "--out", "y", "--force").err


@pytest.mark.long
def test_numbers_that_verify_has_found_converged_are_not_doubted_again(podusv, monkeypatch, capsys):
    name = f"name=fine_{uuid4().hex}"  # what was verified is known to later sessions of tests
    fine = (write("fine.yaml", BASE), "--set", "simulation.step=0.0025", "--set", name)
    hint = "may not have converged"
    assert hint in podusv(*fine, "--out", "x").err
    verified = commanded(monkeypatch, capsys)("verify", *fine)
    assert verified.code == 0, verified.out
    assert hint not in podusv(*fine, "--out", "y").err
    assert hint not in podusv("y", "--out", "z").err
    assert hint in podusv(*fine, "--out", "w", "--set", "start.y=-1.9").err
    coarse = ("fine.yaml", "--set", f"{name}_coarse")
    assert commanded(monkeypatch, capsys)("verify", *coarse).code == 3
    assert hint in podusv(*coarse, "--out", "v").err


# --- controllers without a controller

SHORT = TWO.replace("duration: 1.0", "duration: 0.1")
ALONE = (
    SHORT.replace("controller: {kind: pid, K_Pu: 100.0}\n", "")
    .replace("{stiff: {", "{stiff: {kind: pid, ")
    .replace("soft: {", "soft: {kind: pid, ")
)


def test_controllers_need_no_controller(podusv, monkeypatch, capsys):
    assert "\ncontroller:" not in ALONE
    config, run = write("two.yaml", ALONE), commanded(monkeypatch, capsys)
    assert podusv(config, "--out", "x").out.splitlines()[-2] == "compared 2 runs: x"
    assert run("validate", config).out.startswith("two.yaml: ok (two, stiff, soft, 10 steps)\n")
    refused = (
        "two has several controllers; choose one with --controller (stiff, soft), or compare all: "
        "podusv compare\n"
    )
    assert run("run", config, "--no-figures") == (2, "", refused)
    said = run("run", config, "--controller", "soft", "--out", "y", "--no-figures")
    assert (said.code, said.err) == (0, "")
    assert Path("y/log.h5").read_bytes() == Path("x/soft/log.h5").read_bytes()
    said = run("run", config, "--controller", "sotf", "--no-figures")
    assert said.err == ("unknown controller 'sotf'; did you mean 'soft'? (allowed: stiff, soft)\n")


def test_the_only_one_of_the_controllers_is_run(podusv, monkeypatch, capsys):
    write("two.yaml", ALONE)
    config = write("one.yaml", "extends: two.yaml\ncontrollers: {soft: null}\n")
    said = commanded(monkeypatch, capsys)("run", config, "--out", "y", "--no-figures")
    assert (said.code, said.err) == (0, "")
    assert "K_Pu: 200.0" in Path("y/resolved.yaml").read_text()


# --- `podusv compare --figures`

# One stream, so that the order of its lines is that of printing.
BOTH = "import sys; sys.stderr = sys.stdout; from podusv_cli.cli import main; main()"
FIGURED = TWO.replace("duration: 1.0", "duration: 0.1")


def figures(folder: str) -> set[str]:
    """The figures in a folder."""
    return {path.name for path in Path(folder, "figures").iterdir()}


def figures_of_report(folder: str) -> set[str]:
    """The figures that the report embeds for a screen, encoded; each has one for a phone, too."""
    page = Path(folder, "report.html").read_text()
    on_phones = re.findall(r"srcset=\"data:image/png;base64,([^\"]+)", page)
    on_screens = re.findall(r"src=\"data:image/png;base64,([^\"]+)", page)
    assert len(on_phones) == len(on_screens)
    return set(on_screens)


@pytest.mark.slow
def test_only_what_is_asked_for_is_drawn_and_what_cannot_be_is_told(podusv):
    config = write("two.yaml", FIGURED)
    asked = ("--figures", "--figure", "errors", "--figure", "pods", "--format", "pdf, png")
    said = podusv(config, "--out", "x", "--workers", "1", *asked)
    assert said.code == 0
    assert "figure pods could not be made: no run logged any of n, " in said.err
    assert "traceback" not in said.err
    assert figures("x") == {"errors.pdf", "errors.png"}
    assert len(figures_of_report("x")) == 1


@pytest.mark.long
def test_the_report_has_the_figures_as_they_are_written_and_runs_have_none(podusv):
    config = write("two.yaml", FIGURED)
    said = podusv(config, "--out", "x", "--figures")
    assert (said.code, said.err.splitlines()[-1]) == (0, "to draw every figure: podusv plot x")
    assert figures("x") == {"errors.png", "trajectory.png"}
    written = {Path("x/figures", name).read_bytes() for name in figures("x")}
    assert {base64.b64decode(text) for text in figures_of_report("x")} == written
    assert not list(Path("x").glob("*/figures"))


@pytest.mark.slow
def test_the_command_for_every_figure_names_where_the_runs_lie(podusv, monkeypatch, capsys):
    run = commanded(monkeypatch, capsys)
    one, two = write("one.yaml", ALONE), write("two.yaml", FIGURED)
    said = run("run", one, "--controller", "soft", "--out", "a b")
    assert said.err.splitlines()[-1] == "to draw every figure: podusv plot 'a b'"
    assert figures("a b") == {"errors.png", "trajectory.png"}
    assert podusv(two, "--out", "x").code == 0
    said = podusv("x", "a b", "--out", "y", "--figures")
    assert "to draw every figure: podusv plot x/stiff x/soft 'a b'" in said.err
    for silent in ("--no-figures", "-q", "--json", "--figure=errors"):
        assert "every figure" not in run("compare", "x", "--out", "z", "--force", silent).err
    assert run("plot", "x", "--figure", "all", "--out", "all").code == 0
    assert run("plot", "x", "--out", "plain").code == 0
    drawn = {path.name for path in Path("all").iterdir()}
    assert drawn == {path.name for path in Path("plain").iterdir()} > figures("a b")


def test_a_report_without_figures_has_tables_and_the_animation_and_loads_no_matplotlib(podusv):
    config = write("two.yaml", SHORT)
    assert podusv(config, "--out", "x").code == 0
    page = Path("x/report.html").read_text()
    assert {"Comparison", "chase-data"} <= set(re.findall(r"Comparison|chase-data", page))
    assert not figures_of_report("x")
    assert not Path("x/figures").exists()
    code = "import sys, podusv_cli.comparison.outputs; print('matplotlib' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert said.stdout == "False\n"


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--figure", "error"), "unknown figure 'error'; did you mean 'errors'?"),
        (("--format", "jpg"), "unknown format 'jpg'; did you mean 'png'? (allowed: png, pdf, svg)"),
        (("--no-figures", "--figure", "errors"), "--figure errors and --no-figures contradict"),
    ],
)
def test_what_cannot_be_drawn_is_told_before_anything_is_simulated(podusv, words, text):
    config = write("two.yaml", FIGURED)
    said = podusv(config, "--figures", *words)
    assert said.code == 2
    assert said.err.startswith(text)
    assert not Path("results").exists()


@pytest.mark.slow  # imports everything anew
def test_the_report_is_named_after_everything_else(tmp_path):
    config = tmp_path / "two.yaml"
    config.write_text(FIGURED)
    words = ["compare", str(config), "--out", str(tmp_path / "x"), "--figure", "errors"]
    with under_way(*words, script=BOTH) as process:
        lines = process.communicate(timeout=PATIENCE)[0].splitlines()
    assert lines[-1] == f"report: {tmp_path}/x/report.html"
    assert "podusv verify" in lines[-2]


def test_the_table_here_may_be_of_some_metrics_alone(podusv):
    made = podusv(write("two.yaml", TWO), "--out", "c", "--metric", "ise", "--metric", "iae")
    rows = made.out.splitlines()
    assert [line.split()[-1] for line in rows[:3]] == ["name", "ise", "iae"]
    assert rows[3].startswith("*")
    assert len(Path("c/comparison.csv").read_text().splitlines()) > 10
    wrong = podusv("c", "--metric", "iaee", "--out", "d")
    assert (wrong.code, wrong.out, Path("d").exists()) == (2, "", False)
    assert "'iaee'" in wrong.err
