"""Whatever fails once the simulation is over costs itself and nothing else, and is told."""

import html
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import pytest
from command_samples import BASE, write
from old_results import draw_quickly

from podusv_cli.comparison import claims, outputs, report, table
from podusv_cli.core.errors import StorageError
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import open_run
from podusv_cli.theory import ideal_weights
from podusv_cli.workflows import compare, execute

ADAPTIVE = BASE.replace("{kind: pid, K_Pu: 100.0}", "{kind: adaptive_neural}")
TWO = ADAPTIVE + "controllers: {one: {}, other: {k_ue: 5.0}}\n"
CLAIM = "claims: {C1: {says: it is so, source: here, expect: one.iae <= other.iae}}\n"
DIVERGING = ("--set", "controller.Gamma_u=1e9", "--set", "actuator={kind: ideal}")
CORRECTED = Path(__file__).parents[2] / "configs/mu_2017/corrected.yaml"


def broken(*given: Any, **more: Any) -> NoReturn:
    """A bug."""
    raise ArithmeticError("planted\n here")


BUG = "could not be made: ArithmeticError: planted here (test_afterwards.py, line "
AFTER_A_RUN = {
    "the metrics": (execute, "summary"),
    "the law's cost": (execute, "law_costs"),
    "warnings": (execute, "postflight"),
    "theory.json with the signals that follow from others": (ideal_weights, "fit_weights"),
    "figures": (execute, "_draw_figures"),
}
AFTER_RUNS = {
    "the laws' times": (compare, "law_costs"),
    "the claims' verdicts": (claims, "judge"),
    "comparison.csv": (table, "as_csv"),
    "comparison.md": (table, "as_markdown"),
    "comparison.tex": (table, "as_latex"),
    "claims.md": (claims, "as_markdown"),
    "figures": (outputs, "draw_comparison"),
    "report.html": (report, "page"),
}


def missing(folder: str) -> list[dict[str, str]]:
    """What missing.json of a folder lists."""
    found = json.loads((Path(folder) / "missing.json").read_text())
    return found["missing"]  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("what", "options", "code"),
    [*((what, (), 0) for what in AFTER_A_RUN), ("the metrics", DIVERGING, 4)],
)
def test_the_log_is_kept_and_what_is_missing_is_told(podusv, monkeypatch, what, options, code):
    with monkeypatch.context() as patch:
        patch.setattr(*AFTER_A_RUN[what], broken)
        said = podusv(
            "run", write("a.yaml", ADAPTIVE), "--out", "x", "-q", "--no-figures", *options
        )
    assert (said.code, said.out) == (code, "x\n")
    (told,) = [line for line in said.err.splitlines() if "missing.json" in line]
    assert told.startswith(f"a.yaml: {what} {BUG}")
    (part,) = missing("x")
    assert part["what"] == what
    assert "in broken" in part["trace"]
    assert "Traceback" not in said.err
    assert len(open_run(Path("x")).recording["time"])
    assert podusv("compare", "x", "--no-figures", "--out", "y").code == (3 if code else 0)


@pytest.mark.slow
def test_one_figure_that_fails_costs_no_other(podusv, monkeypatch):
    monkeypatch.setitem(FIGURES, "errors", replace(FIGURES["errors"], family=broken))
    said = podusv("run", write("a.yaml", ADAPTIVE), "--out", "x", "-q")
    assert said.code == 0
    assert said.err.startswith(f"a.yaml: figure errors {BUG}")
    assert [path.name for path in Path("x/figures").iterdir()] == ["trajectory.png"]
    assert podusv("plot", "x", "--figure", "errors", "--figure", "loads").code == 3
    assert [path.name for path in Path("figures").iterdir()] == ["loads.png"]
    assert podusv("plot", "x", "--figure", "errors", "--out", "none").code == 3


def test_json_and_a_complete_run_say_what_is_missing(podusv, monkeypatch):
    words = ("run", write("a.yaml", ADAPTIVE), "--json", "--no-figures", "--out")
    assert json.loads(podusv(*words, "x").out)["missing"] == []
    assert not Path("x/missing.json").exists()
    monkeypatch.setattr(execute, "summary", broken)
    (told,) = json.loads(podusv(*words, "y").out)["missing"]
    assert told.startswith(f"the metrics {BUG}")


@pytest.mark.slow
@pytest.mark.parametrize("what", AFTER_RUNS)
def test_a_comparison_keeps_its_runs(podusv, monkeypatch, what):
    draw_quickly(monkeypatch)
    monkeypatch.setattr(*AFTER_RUNS[what], broken)
    said = podusv("compare", write("a.yaml", TWO + CLAIM), "--out", "x", "-q")
    assert (said.code, said.out) == (0, "x\n")
    told = [line for line in said.err.splitlines() if "missing.json" in line]
    assert len(told) == 1
    assert told[0].startswith(f"{what} {BUG}")
    assert manifest.check(Path("x")).status == "finished"
    assert [open_run(Path("x") / name).status for name in ("one", "other")] == ["finished"] * 2
    if what != "report.html":
        assert f"{what} {BUG}" in html.unescape(Path("x/report.html").read_text())


def test_what_a_run_of_a_comparison_lacks_is_told_of_the_run(podusv, monkeypatch):
    monkeypatch.setattr(ideal_weights, "fit_weights", broken)
    said = podusv("compare", write("a.yaml", TWO), "--out", "x", "-q", "--no-figures")
    assert said.code == 0
    for label in ("one", "other"):
        assert f"{label}: theory.json with the signals that follow from others {BUG}" in said.err
        assert not Path("x", label, "theory.json").exists()
    assert [part["what"].partition(":")[0] for part in missing("x")] == ["one", "other"]


def test_rerun_tells_what_the_repeated_run_lacks(podusv, monkeypatch):
    write("a.yaml", ADAPTIVE)
    assert podusv("run", "a.yaml", "--out", "x", "-q", "--no-figures").code == 0
    monkeypatch.setattr(ideal_weights, "fit_weights", broken)
    said = podusv("rerun", "x")
    assert said.code == 3
    assert said.err.startswith(f"x: theory.json with the signals that follow from others {BUG}")
    assert podusv("rerun", "x", "--json").err == said.err


def test_what_cannot_be_stored_stays_an_error(podusv, monkeypatch):
    def full(*given: Any) -> NoReturn:
        raise StorageError("the disk is full")

    monkeypatch.setattr(ideal_weights, "fit_weights", full)
    said = podusv("run", write("a.yaml", ADAPTIVE), "--out", "x", "-q", "--no-figures")
    assert (said.code, said.err) == (5, "the disk is full\n")
    assert not Path("x").exists()


@pytest.mark.parametrize(
    "override",
    [
        "simulation.step=0.5",
        "controller.k_psie=500",
        "controller.Gamma_u=1e5",
        "controller.gamma_r=1e5",
        "vessel.Y_vv=100",
    ],
)
def test_the_theory_of_a_run_that_leaves_all_numbers_is_made(podusv, override):
    said = podusv("run", CORRECTED, "--set", override, "--no-figures", "-q", "--out", "x")
    assert said.code == 4
    assert said.err.startswith(f"{CORRECTED}: diverged at t = ")
    assert said.err.count("\n") == 1
    assert json.loads(Path("x/theory.json").read_text())["windows"]["whole"]["largest_V"] != 0
