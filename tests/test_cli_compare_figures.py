"""`podusv compare --figures`: what is drawn, in which form, and what cannot be drawn."""

import re
from functools import partial
from pathlib import Path

import pytest
from command_samples import PATIENCE, TWO, commanded, under_way, write
from drawn_samples import no_figures_but

from podusv_cli.workflows import execute

# One stream, so that the order of its lines is that of printing.
BOTH = "import sys; sys.stderr = sys.stdout; from podusv_cli.cli import main; main()"
FIGURED = TWO.replace("duration: 1.0", "duration: 0.1")


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    """`podusv compare` without figures, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return partial(commanded(monkeypatch, capsys), "compare", "--no-figures")


def figures(folder: str) -> set[str]:
    """The figures in a folder."""
    return {path.name for path in Path(folder, "figures").iterdir()}


def figures_of_report(folder: str) -> int:
    """How many different figures the report embeds; some it shows twice."""
    page = Path(folder, "report.html").read_text()
    return len(set(re.findall(r"data:image/svg\+xml;base64,([^\"]+)", page)))


@pytest.mark.slow
def test_only_what_is_asked_for_is_drawn_and_what_cannot_be_is_told(podusv, monkeypatch):
    monkeypatch.setattr(execute, "_drawn", lambda *given: {})  # of each run
    config = write("two.yaml", FIGURED)
    asked = ("--figures", "--figure", "errors", "--figure", "pods", "--format", "pdf, png")
    said = podusv(config, "--out", "x", "--workers", "1", *asked)
    assert said.code == 0
    assert "figure pods could not be made: no run logged any of n, " in said.err
    assert "traceback" not in said.err
    assert figures("x") == {"errors.pdf", "errors.png"}
    assert figures_of_report("x") == 1


@pytest.mark.slow
def test_figures_are_png_and_the_report_has_them_all_the_same(podusv, monkeypatch):
    monkeypatch.setattr(execute, "_drawn", lambda *given: {})
    config = write("two.yaml", FIGURED)
    with no_figures_but("errors", "velocities"):
        assert podusv(config, "--out", "x", "--figures").code == 0
    assert figures("x") == {"errors.png", "velocities.png"}
    assert figures_of_report("x") == 2


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
    assert lines[-2].startswith("the numbers may not have converged")
