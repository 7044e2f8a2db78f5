"""`podusv new` writes files that work as they are; `podusv_cli.testing` finds what is wrong."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_samples import ROOT
from plugin_samples import LAW

from podusv_cli import testing


def pytest_of(test: str) -> str:
    """What pytest says of a test file in this folder, from outside the repository."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", test],
        capture_output=True, text=True, timeout=300, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    return done.stdout + done.stderr


@pytest.mark.parametrize(
    "what",
    ["law", *(pytest.param(what, marks=pytest.mark.slow) for what in ("path", "disturbance"))],
)
def test_what_is_written_runs_and_passes_its_own_test(podusv, what):
    said = podusv("new", what, "our_own")
    assert said.code == 0
    assert "next: podusv" in said.out
    command = "compare" if what == "law" else "run"
    shorter = ("--set", "simulation.duration=5", "--no-figures", "--out", "r", "-q")
    assert podusv(command, "our_own.yaml", *shorter).code == 0
    assert "5 passed" in pytest_of("test_our_own.py")
    assert podusv("explain", "our_own", "--plugin", "our_own.py").code == 0
    assert "  our_own" in podusv("list", "--plugin", "our_own.py").out


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
    "signals[0] = target[1] - x[1]": (
        "signals[0] = math.sqrt(-1.0 - x[0] * x[0])", "math domain"
    ),
    "tau[0], tau[1] = push(k)": ("tau[0], tau[1] = push.calls(k)", "no attribute"),
}  # fmt: skip


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
