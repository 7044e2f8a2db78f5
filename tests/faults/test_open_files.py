"""`ulimit -n`: few open files are told before anything is computed, and cost no result."""

import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from command_samples import ROOT, TWO, write
from counts import count

from podusv_cli.cli.exit_codes import LEAST_OPEN_FILES
from podusv_cli.process.workers import run_all
from podusv_cli.storage import manifest

CONFIG = TWO.replace("duration: 1.0", "duration: 0.1, compiled: false")
COMMANDS = [("run", "two.yaml", "--out", "x"), ("compare", "two.yaml", "--out", "x")]


def podusv(
    words: Sequence[str], limit: int, most: int, folder: Path
) -> subprocess.CompletedProcess[str]:
    """A command that may have so many files open; `most` is what it may ask for."""
    return subprocess.run(
        [sys.executable, "-m", "podusv_cli", *words],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (limit, most)),
        env={**os.environ, "PYTHONPATH": str(ROOT)}, cwd=folder, capture_output=True, text=True,
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("two.yaml", CONFIG)
    return tmp_path


@pytest.mark.parametrize("limit", [8, 16, LEAST_OPEN_FILES - 1][:: count(2, 1)])
@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: words[0])
def test_too_few_open_files_are_told_before_anything_is_computed(folder, words, limit):
    done = podusv(words, limit, limit, folder)
    assert done.returncode == 5
    assert done.stderr == (
        f"at most {limit} files may be open at once, podusv needs {LEAST_OPEN_FILES}; "
        "allow more with `ulimit -n 1024`\n"
    )
    assert [path.name for path in folder.iterdir()] == ["two.yaml"]


@pytest.mark.parametrize(
    ("words", "limit", "most"),
    [(COMMANDS[0], 16, 4096), (COMMANDS[1], LEAST_OPEN_FILES, LEAST_OPEN_FILES)],
    ids=str,
)
def test_enough_open_files_or_leave_to_have_them_make_a_whole_result(folder, words, limit, most):
    more = () if count(0, 1) else ("--no-figures",)
    done = podusv([*words, *more], limit, most, folder)
    assert (done.returncode, "could not be made" in done.stderr) == (0, False), done.stderr
    assert manifest.check(folder / "x").status == "finished"


def test_an_error_of_the_system_in_a_job_is_a_line():
    def job(_: object) -> None:
        raise OSError(24, "Too many open files")

    (outcome,) = run_all([job])
    assert (outcome.failure, outcome.code) == ("[Errno 24] Too many open files", 5)
