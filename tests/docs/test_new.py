"""`podusv new` writes files that work as they are; `podusv_cli.testing` finds what is wrong."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import xarray
import yaml
from command_samples import ROOT
from installed_sample import LAB, install
from plugin_samples import LAW

from podusv_cli import testing
from podusv_cli.storage.run_folder import open_run


def pytest_of(test: str) -> str:
    """What pytest says of a test file in this folder, from outside the repository."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", test],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    return done.stdout + done.stderr


PASSED = {
    "law": 5,
    "path": 5,
    "disturbance": 5,
    "measurement": 8,
    "estimator": 9,
    "metric": 2,
    "figure": 2,
}

SLOW = [pytest.param(what, marks=pytest.mark.slow) for what in list(PASSED)[1:]]


@pytest.mark.parametrize("what", ["law", *SLOW])
def test_what_is_written_runs_and_passes_its_own_test(podusv, what):
    said = podusv("new", what, "our_own")
    assert said.code == 0
    (command,) = re.findall("next: podusv (.*)", said.out)
    plain = ["--no-figures"] * (what != "figure")
    shorter = ("--set", "simulation.duration=5", *plain, "--out", "r", "-q")
    assert podusv(*command.split(), *shorter).code == 0
    assert Path("r/figures/our_own.png").exists() == (what == "figure")
    assert f"{PASSED[what]} passed" in pytest_of("test_our_own.py")
    assert podusv("explain", "our_own", "--plugin", "our_own.py").code == 0
    assert "  our_own" in podusv("list", "--plugin", "our_own.py").out


def test_the_law_that_is_written_tells_its_standoff_and_does_not_wind_up(podusv):
    podusv("new", "law", "our_own")
    changes = (
        "actuator={kind: saturated, surge_limit: 0.5, yaw_limit: 2.5}",
        "simulation.duration=30",
    )
    options = ("--controller", "our_own", "--no-figures", "--out", "r")
    said = podusv("run", "our_own.yaml", "--set", changes[0], "--set", changes[1], *options)
    assert said.code == 0
    assert "its memory does not wind up" in said.err
    out = open_run(Path("r"))
    assert out.metrics["iae_e"] < out.metrics["iae"] - 10.0  # 30 s with a standoff of 1 m
    assert abs(out.recording["integral_e"]).max() < 60.0


def test_a_vessel_is_written_with_a_task(podusv):
    said = podusv("new", "vessel", "our_own")
    assert "next: podusv run our_own_line.yaml" in said.out
    assert podusv("run", "our_own_line.yaml", "--no-figures", "--out", "r", "-q").code == 0
    assert "is a vessel of podusv" in podusv("new", "vessel", "otter").err


@pytest.mark.long
def test_a_paper_is_written_as_a_folder_that_compares_and_draws(podusv):
    said = podusv("new", "paper", "our_own")
    assert "next: podusv compare our_own/task.yaml" in said.out
    done = podusv("compare", "our_own/task.yaml", "--no-figures", "--out", "r")
    assert done.code == 0
    verdicts = json.loads(Path("r/claims.json").read_text())["claims"]
    assert [claim["claim"] for claim in verdicts] == ["A1", "A2", "A3"]
    assert "cannot tell" not in {claim["verdict"] for claim in verdicts}
    assert podusv("validate", "our_own/starts.yaml").code == 0
    assert "5 passed" in pytest_of("our_own/test_our_own.py")
    assert "our_own/our_own.py exists" in podusv("new", "paper", "our_own").err


METRIC = """
from podusv_cli.core.kernel import kernel
from podusv_cli.metrics.metric import Accumulator, Metric, gathered

@kernel
def watch(t, weight, s, row, k, seen):
    seen[0] = abs(s[1])

own = Metric("own", "m", "of its own", Accumulator(watch, lambda _: 1, lambda _: {}), RESULT)
"""
FIGURE = """
from podusv_cli.figures.panels import signals_over_time
from podusv_cli.figures.sheet import figure

COUNT = []
@figure("own", caption="of its own", signals=("e_ct",))
def own(runs, columns):
    COUNT.append(1)
    drawn = signals_over_time("e_ct")(runs, columns)
    drawn.axes[0].set_title(TITLE)
    return drawn
"""


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("text", "found"),
    [
        (METRIC.replace("RESULT", "gathered(0)"), []),
        (METRIC.replace("RESULT", "lambda seen, step: float('nan')"), ["has_a_number"]),
        (FIGURE.replace("TITLE", '"own"'), []),
        (FIGURE.replace("TITLE", "str(len(COUNT))"), ["draws_the_same_bytes_twice"]),
        (FIGURE.replace("TITLE", "runs[1].label"), ["draws_any_number_of_runs"]),
    ],
)
def test_a_mistake_in_a_metric_or_figure_breaks_the_contract(text, found):
    assert [failure.partition(":")[0] for failure in failures(text)] == found


def test_nothing_is_replaced_and_names_are_checked(podusv):
    podusv("new", "law", "mine")
    assert "mine.py exists" in podusv("new", "path", "mine").err
    assert podusv("new", "path", "mine").code == 5
    assert "did you mean 'law'" in podusv("new", "laws", "other").err
    assert "is a law of podusv" in podusv("new", "law", "pid").err
    for name in ("My-Law", "class", "1st"):
        assert podusv("new", "law", name).code == 2


WRONG = {
    "rate[0] = signals[0]": ("pass", "it leaves the rate of drift unwritten"),
    "signals[0] = target[1] - x[1]": ("signals[0] = math.sqrt(-1.0 - x[0] * x[0])", "math domain"),
    "tau[0], tau[1] = push(k)": ("tau[0], tau[1] = push.calls(k)", "no attribute"),
}


def failures(law: str) -> list[str]:
    """What the contract finds in a law."""
    Path("my_law.py").write_text(law)
    said = []
    for case in testing.contract(Path("my_law.py")):
        check, component = case.values
        try:
            check(component)
        except Exception as error:
            said.append(f"{check.__name__}: {error}")
    return said


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("here")
def test_a_sound_law_keeps_the_contract():
    assert failures(LAW) == []


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("line", WRONG)
def test_a_mistake_breaks_the_contract(line):
    assert line in LAW
    wrong, words = WRONG[line]
    law = LAW.replace(line, wrong).replace("import numpy", "import math\n\nimport numpy")
    assert any(words in failure for failure in failures(law))


@pytest.mark.usefixtures("here")
def test_hidden_memory_breaks_the_contract():
    law = LAW.replace("PUSH = 1.0", "PUSH = [1.0]").replace(
        "    return PUSH * k.gain", "    PUSH[0] += 1.0\n    return PUSH[0] * k.gain"
    )
    assert any("remembers_nothing" in failure for failure in failures(law))


# --- `examples/my_lab`, installed


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the package installed in `site`, and its scenario compared in `c`."""
    folder = tmp_path_factory.mktemp("lab")
    install(folder / "site")
    text = (LAB / "scenario.yaml").read_text().replace("duration: 20.0", "duration: 5.0")
    text = text.replace(", pid: {kind: pid}", "")  # not of the package
    (folder / "a.yaml").write_text(text)
    podusv(folder, "compare", "a.yaml", "--out", "c", "--figure", "track_error")
    return folder


def podusv(place: Path, *words: str, code: int = 0) -> str:
    """What a command prints where the package is installed."""
    done = subprocess.run(
        [sys.executable, "-m", "podusv_cli", *words],
        cwd=place,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": f"{place / 'site'}:{ROOT}", "COLUMNS": "100"},
        timeout=300,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.long
def test_a_comparison_has_its_law_path_vessel_metric_and_figure(place):
    rows = (place / "c/comparison.csv").read_text().splitlines()
    assert any(row.startswith("largest_east,m,") for row in rows)
    (claim,) = json.loads((place / "c/claims.json").read_text())["claims"]
    assert claim["verdict"] in ("reproduced", "not reproduced")
    assert (place / "c/figures/track_error.png").exists()
    assert "largest |y|, east or west" in (place / "c/report.html").read_text()
    (own,) = json.loads((place / "c/los/provenance.json").read_text())["plugins"]
    named = yaml.safe_load((place / "c/los/resolved.yaml").read_text())["plugins"]
    assert named == {"my-lab": {"version": "1.0", "sha256": own["sha256"]}}
    assert own["package"] == "my-lab"


@pytest.mark.slow
def test_commands_list_explain_and_draw_it(place):
    listed = podusv(place, "list")
    for name in ("los", "lawn", "skiff", "largest_east"):
        assert f"\n  {name}" in listed
    explained = " ".join(podusv(place, "explain", "lookahead").split())
    assert "nmi], default 3.0 " in explained
    assert "cross-track error" in podusv(place, "explain", "e_y")
    assert "identical" in podusv(place, "rerun", "c/los")


@pytest.mark.long
def test_its_command_is_one_of_podusvs(place):
    """In the help, with arguments of its own, and with podusv's exit codes and sentences."""
    reached = {}
    for law in ("los", "far"):
        log = xarray.open_dataset(place / "c" / law / "log.h5", engine="h5netcdf")
        reached[law] = float(abs(log["y"]).max())
    law = max(reached, key=reached.get)
    assert podusv(place, "widest", "c/los", "c/far") == f"c/{law}: {reached[law]:.3f} m\n"
    assert re.search(r"\n +widest +Say which of finished runs", podusv(place, "--help"))
    assert "RUN..." in podusv(place, "widest", "--help")
    assert "c/none" in podusv(place, "widest", "c/none", code=2)
    assert "No such command 'wides'" in podusv(place, "wides", code=2)


@pytest.mark.long
def test_a_bug_in_a_package_s_command_is_one_of_the_package(place):
    command = place / "site/my_lab/widest.py"
    text = command.read_text()
    command.write_text(text.replace("    reached = {", "    1 / 0\n    reached = {"))
    try:
        said = podusv(place, "widest", "c/los", code=1)
    finally:
        command.write_text(text)
    assert "This is a bug in my-lab. Please report it" in said


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "thing", "says"),
    [
        ("widest", "my_lab.nowhere:widest", "widest: my_lab.nowhere:widest is no command: Module"),
        ("widest", "my_lab.widest", "is no command: TypeError: it is a module, and a command is a"),
        ("run", "my_lab.widest:widest", "c/los"),  # podusv's own keeps its name
    ],
)
def test_what_is_no_command_is_said_when_it_is_called_and_the_help_stays(place, name, thing, says):
    points = place / "site/my_lab-1.0.dist-info/entry_points.txt"
    text = points.read_text()
    points.write_text(text.replace("widest = my_lab.widest:widest", f"{name} = {thing}"))
    try:
        helped = podusv(place, "--help")
        said = podusv(place, name, "c/los", code=2)
    finally:
        points.write_text(text)
    assert "Simulate a scenario and write a run folder" in helped
    assert says in " ".join(said.split())


@pytest.mark.slow
def test_another_state_of_the_package_is_not_taken_for_the_one_that_was_used(place):
    law = place / "site/my_lab/los.py"
    text = law.read_text()
    law.write_text(text + "\n")
    try:
        assert "my-lab 1.0 is not the one that was used" in podusv(place, "rerun", "c/los", code=2)
        podusv(place, "plot", "c/los", "--figure", "track_error", "--out", "q")
    finally:
        law.write_text(text)


@pytest.mark.slow
def test_its_runs_are_looked_at_where_it_is_not_installed(place, podusv):
    assert podusv("plot", place / "c", "--figure", "errors", "--out", "p").code == 0
    said = podusv("compare", place / "c/los", place / "c/far", "--out", "d", "--no-figures")
    assert said.code == 0
    assert "largest_east" in said.out
    said = podusv("diff", place / "c/los", place / "c/far")
    assert "controller.lookahead 3.0 -> 8.0" in said.out
    said = podusv("rerun", place / "c/los")
    assert said.code == 2
    assert "'my-lab' is no file (these end in .py) and no installed package" in said.err


@pytest.mark.long
def test_a_package_that_cannot_be_imported_is_named(place):
    figure = place / "site/my_lab/los.py"
    text = figure.read_text()
    figure.write_text("import no_such_module\n")
    try:
        said = podusv(place, "validate", "a.yaml", code=2)
    finally:
        figure.write_text(text)
    assert "installed package my-lab 1.0: entry point los = my_lab.los cannot be imported" in said
    assert "bug" not in said
