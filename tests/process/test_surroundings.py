"""What other programs set for themselves: a notebook's backend, numba's options, Python's -OO."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import podusv
from podusv_cli.cli import progress

INLINE = "module://matplotlib_inline.backend_inline"
PATIENCE = 300  # s
SHORT = ("--set", "simulation.duration=2.0")
OWN = "podusv:own_vessel.yaml"


def told(folder, *words, options=(), **settings):
    """The command line in a process of its own, with these settings."""
    return subprocess.run(
        [sys.executable, *options, "-m", "podusv_cli", *words],
        cwd=folder,
        text=True,
        capture_output=True,
        timeout=PATIENCE,
        env={**os.environ, **settings},
        check=False,
    )


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    place = tmp_path_factory.mktemp("place")
    assert told(place, "run", OWN, "--out", "r", "--no-figures", "-q", *SHORT).returncode == 0
    return place


NO_MODULE = {"MPLBACKEND": INLINE}, {"MPLBACKEND": "no_backend"}


@pytest.mark.long
@pytest.mark.parametrize("settings", NO_MODULE, ids=lambda s: s["MPLBACKEND"])
def test_a_notebook_s_backend_keeps_no_figure_from_being_drawn(place, settings):
    done = told(place, "plot", "r", "--figure", "trajectory", **settings)
    assert (done.returncode, done.stderr) == (0, "")
    assert Path(place, "figures/trajectory.png").exists()
    done = told(place, "margins", OWN, "--out", "m", "--force", **settings)
    assert done.returncode == 0, done.stderr
    assert Path(place, "m/figures/sensitivities.png").exists()


DRAWN = f"""
import podusv
from podusv_cli.cli import progress
run = podusv.run("{OWN}", {{"simulation.duration": 2.0}}, out="python", force=True)
assert (run.folder / "figures/trajectory.png").exists()
"""


@pytest.mark.long
def test_python_draws_where_a_notebook_s_backend_is_not_installed(place):
    if find_spec("matplotlib_inline"):
        pytest.skip("matplotlib_inline is installed")
    settings = {**os.environ, "MPLBACKEND": INLINE}
    done = subprocess.run(
        [sys.executable, "-c", DRAWN],
        cwd=place,
        env=settings,
        text=True,
        capture_output=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr


LAW = """
from typing import Literal
from podusv_cli.plugin import Controller, kernel, value

class Push(Controller):
    \\"\\"\\"Pushes.\\"\\"\\"
    kind: Literal["push"] = "push"
    gain: float = value(1.5, "N", "the force", gt=0)

    @staticmethod
    @kernel
    def law(x, k, tau):
        tau[0] = k.gain * (1.0 - x[3]) + {number}
        tau[1] = -x[5]
""".replace('\\"', '"')


@pytest.mark.long
@pytest.mark.parametrize("name", ["NUMBA_DISABLE_JIT", "NUMBA_DEBUGINFO", "NUMBA_ENABLE_PROFILING"])
def test_numba_s_settings_are_those_of_other_programs(tmp_path, name):
    """Kernels are compiled anew in each: the law's number is another one, and so is the cache."""
    (tmp_path / "push.py").write_text(LAW.format(number=0.25))
    (tmp_path / "a.yaml").write_text(
        f"extends: {OWN}\nplugins: [push.py]\ncontroller: {{kind: push}}\ncontrollers: null\n"
        "claims: null\nsimulation: {duration: 2.0}\n"
    )
    words = ("run", "a.yaml", "--no-figures", "-q", "--out")
    for out, settings in (("plain", {}), ("set", {name: "1"})):
        own = {"PODUSV_CACHE": str(tmp_path / f"cache_{out}"), **settings}
        done = told(tmp_path, *words, out, **own)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "plain/log.h5").read_bytes() == (tmp_path / "set/log.h5").read_bytes()


@pytest.mark.long
def test_python_without_docstrings_is_refused_in_a_sentence(tmp_path):
    done = told(tmp_path, "run", OWN, options=("-OO",))
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("python -OO (PYTHONOPTIMIZE=2) removes the docstrings")
    assert len(done.stderr.splitlines()) == 1
    command = [sys.executable, "-OO", "-c", "import podusv"]
    done = subprocess.run(command, cwd=tmp_path, text=True, capture_output=True, check=False)
    assert done.stderr.splitlines()[-1].startswith("ImportError: python -OO (PYTHONOPTIMIZE=2)")
    assert told(tmp_path, "run", OWN, "-q", "--no-figures", *SHORT, options=("-O",)).returncode == 0


def test_what_is_imported_here_has_its_docstrings():
    assert podusv.simulate.__doc__


def test_a_pipe_is_told_of_code_that_is_compiled_for_long(monkeypatch, capsys):
    now = iter([0.0, 0.5, 1.5, 2.5, 9.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(now))
    tell = progress.compiling(None, wanted=True)
    for part in (0.0, 0.2, 0.4, 0.7, 1.0):
        tell(part)
    assert capsys.readouterr() == ("", "compiling, once\n")
    assert progress.compiling(None) is None
