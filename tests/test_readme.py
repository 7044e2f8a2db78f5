"""The scenarios and commands of README and docs pages, run from top to bottom as they stand.

A block whose first line is `# NAME` is a file. In a `console` block `$` precedes a command, which
ends with exit code 0 unless a comment says otherwise; the lines below it are in what it prints,
in this order, and `...` stands for what is left out.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from command_samples import PATIENCE, ROOT, Command, Said, commanded
from conftest import PACKAGE

from podusv_cli.storage.run_folder import open_run

LAW = "docs/write_your_law.md"
LARGEST = 10.0  # N m; four times the yaw moment that the actuator of README's scenario delivers


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and text of every fenced block."""
    return re.findall(r"^```(\w+)\n(.*?)^```", (ROOT / page).read_text(), re.M | re.S)


def write_files(page: str) -> None:
    """Every file of a page, into the working folder."""
    for _, text in blocks(page):
        if named := re.match(r"# (\S+\.(?:yaml|py))\n", text):
            Path(named[1]).write_text(text)


def dialogues(page: str) -> Iterator[tuple[list[str], int, str]]:
    """Words, exit code and shown output of every command of a page's console blocks."""
    for language, text in blocks(page):
        if language == "console":
            for part in re.split(r"^\$ ", text, flags=re.M)[1:]:
                command, _, shown = part.partition("\n")
                code = re.search(r"# exit code (\d+)", command)
                yield shlex.split(command, comments=True)[1:], int(code[1]) if code else 0, shown


def pattern(shown: str) -> str:
    """A regular expression for output of these words, however it is wrapped."""
    gaps = [re.escape(" ".join(part.split())) for part in shown.split("...")]
    return " ?.* ?".join(gaps).replace(r"\ ", " ")


@pytest.fixture
def podusv(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """The command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return commanded(monkeypatch, capsys)


@pytest.fixture
def extended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """The command line of a copy of the package, in the same folder, in a process of its own."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(PACKAGE, "podusv_cli", ignore=shutil.ignore_patterns("__pycache__"))

    def run(*words: str) -> Said:
        done = subprocess.run(
            [sys.executable, "-m", "podusv_cli", *words], capture_output=True, text=True,
            env={**os.environ, "PYTHONPATH": str(tmp_path), "COLUMNS": "100"}, timeout=PATIENCE,
        )  # fmt: skip
        return Said(done.returncode, done.stdout, done.stderr)

    return run


def check(page: str, podusv: Command) -> None:
    """Type every command of a page and look for the output that it shows."""
    for words, code, shown in dialogues(page):
        plain = ["--no-figures"] * (words[0] in ("run", "compare"))
        said = podusv(*words, *plain)
        printed = " ".join((said.err + said.out).split())
        assert said.code == code, (words, printed)
        assert re.search(pattern(shown), printed), (words, printed)


@pytest.mark.parametrize("page", ["README.md", "docs/tutorial.md"])
def test_commands_of_a_page_print_what_it_shows(page: str, podusv: Command) -> None:
    write_files(page)
    assert len(list(dialogues(page))) > 2
    check(page, podusv)


def test_the_law_of_the_page_works_as_it_stands(extended: Command) -> None:
    write_files(LAW)
    Path("pursuit.py").rename("podusv_cli/controllers/pursuit.py")
    check(LAW, extended)


def test_the_first_scenario_follows_ahead_and_demands_what_is_available(podusv: Command) -> None:
    write_files("README.md")
    assert podusv("run", "mine.yaml", "--out", "x", "--no-figures").code == 0
    run = open_run(Path("x"))
    late = run.recording["time"] > 90.0
    assert run.recording["u"][late].min() > 0.4
    assert np.abs(run.recording["z_e"][late] - 0.5).max() < 0.05
    assert run.metrics["peak_tau_r"] < LARGEST
