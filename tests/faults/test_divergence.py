"""Runs that go wrong, each in its own way: an exit code, the first bad step, a log to look at."""

import inspect
import sys
import threading
from pathlib import Path

import faulty_laws
import numpy as np
import pytest
from command_samples import BASE, commanded, write
from conftest import Constant, adrift, corrected, run

from podusv_cli.components.controllers.base import Slots
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.core.errors import LawError
from podusv_cli.core.signal import Signal
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running import thread as march
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.engine.running.check import check_law
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import open_run

QUICK = 0.4  # s of computing; what a law may take in these tests


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(march, "PATIENCE", QUICK)
    return commanded(monkeypatch, capsys)


@pytest.fixture
def law():
    """Puts a faulty law in the PID's place, until the test is over."""
    restore = []
    yield lambda name: restore.append(faulty_laws.install(name))
    for back in restore:
        back()


WAYS = {
    "undefined": ("true", "0.49", "diverged at t = 0.5 s: v is not finite; last logged"),
    "slow": ("true", "0.48", "diverged at t = 0.49 s: it is not over after 0.4 s of computing; "),
    "raising": ("false", "0.48", "diverged at t = 0.49 s: KeyError: 'no gain for this speed' "),
    "unstable": ("true", "", "diverged at t = "),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WAYS)
def test_a_law_that_fails_on_the_way_leaves_its_log(podusv, law, name):
    compiled, last, says = WAYS[name]
    law(name)
    write("a.yaml", BASE.replace("saturated", "ideal", 1))
    options = ("--no-figures", "--set", f"simulation.compiled={compiled}")
    said = podusv("run", "a.yaml", "--out", "x", *options)
    assert said.code == 4
    assert said.out == "pid diverged: x\n"
    *warnings, ending = said.err.splitlines()
    assert ending.startswith(f"a.yaml: {says}")
    assert all(line.startswith("warning[outside-envelope]: ") for line in warnings)
    assert bool(warnings) == (name == "unstable")
    run = open_run(Path("x"))
    assert manifest.check(Path("x")).status == run.recording.status == "diverged"
    if last:
        assert f"{run.recording['time'][-1]:.6g}" == last
    assert all(np.isfinite(signal).all() for signal in run.recording.signals.values())


REFUSED = {
    "too_long": "law pid (pid.py, line {line}), evaluated once before the run: IndexError: "
    "index 2 is out of bounds for axis 0 with size 2 (faulty_laws.py, line ",
    "too_short": "law pid (pid.py, line {line}): it leaves tau_r_cmd unwritten\n",
    "slow_at_once": "law pid (pid.py, line {line}), evaluated once before the run: it is not "
    "over after 0.4 s of computing\n",
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_law_that_is_not_what_it_says_is_refused_before_the_run(podusv, law, name):
    law(name)
    said = podusv("run", write("a.yaml", BASE), "--out", "x")
    assert (said.code, said.out) == (2, "")
    line = inspect.getsourcelines(Pid)[1]
    assert said.err.startswith(REFUSED[name].replace("{line}", str(line)))
    assert said.err.count("\n") == 1
    assert not Path("x").exists()


def test_a_memory_of_another_size_is_refused():
    class Forgetful(Constant):
        def slots(self) -> Slots:
            return ((Signal("integrals", "m", "two integrals", axes=("axis",)), 2),)

    with pytest.raises(LawError, match=r"memory of shape \(0,\), its slots are \(2,\)"):
        check_law(Plan(adrift(controller=Forgetful()), TimeGrid(0.01, 1)))


def test_what_a_law_raises_is_not_taken_for_the_end_of_its_thread():
    class Leaving(Constant):
        @staticmethod
        def law(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def, override]
            sys.exit(7)

    out = run(adrift(controller=Leaving()), 1.0, compiled=False)
    assert out.status == "diverged"
    assert out.message.startswith("diverged at t = 0 s: SystemExit: 7 (test_divergence.py, line ")


@pytest.mark.slow
def test_in_a_batch_one_law_that_does_not_return_costs_no_other_run(law, monkeypatch):
    class Stubborn(Constant):
        law = staticmethod(faulty_laws.slow_when_told)

    monkeypatch.setattr(march, "PATIENCE", QUICK)
    loops = [adrift(controller=Stubborn(surge=surge)) for surge in (1.0, 2.0, 3.0)]
    batch = simulate_many(loops, TimeGrid(0.01, 100), workers=2)
    assert batch.status.tolist() == ["finished", "hung", "finished"]
    assert batch.reached.tolist() == [101, 49, 101]
    cause = f"at t = 0.49 s: it is not over after {QUICK:g} s of computing"
    assert batch.cause.tolist() == ["", cause, ""]


def test_a_law_that_returns_after_it_was_abandoned_goes_no_step_further(monkeypatch):
    released, times = threading.Event(), []

    class Late(Constant):
        @staticmethod
        def law(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def, override]
            times.append(t)
            while t == 0.05 and not released.is_set():
                pass
            tau[:] = 0.0

    monkeypatch.setattr(march, "PATIENCE", QUICK)
    before = set(threading.enumerate())
    out = run(adrift(controller=Late()), 1000.0, compiled=False)
    assert out.message.startswith("diverged at t = 0.04 s: it is not over after 0.4 s")
    released.set()
    for thread in set(threading.enumerate()) - before:
        thread.join(10.0)
        assert not thread.is_alive()
    assert max(times) <= 0.06


@pytest.mark.slow
def test_computing_counts_and_not_the_clock(monkeypatch):
    """A process that was stopped for an hour, or a busy machine, is no law that hangs."""
    import time

    class Waiting(Constant):
        @staticmethod
        def law(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def, override]
            if t == 0.05:
                time.sleep(1.0)
            tau[:] = 0.0

    monkeypatch.setattr(march, "PATIENCE", 0.3)
    assert run(adrift(controller=Waiting()), 0.1, compiled=False).status == "finished"


def test_what_a_law_raises_in_several_lines_is_told_in_one():
    class Talkative(Constant):
        @staticmethod
        def law(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def, override]
            if t == 0.05:
                raise RuntimeError("first\n  second")
            tau[:] = 0.0

    message = run(adrift(controller=Talkative()), 0.1, compiled=False).message
    assert "RuntimeError: first second (" in message


@pytest.mark.filterwarnings("error")
def test_numbers_that_overflow_are_left_for_the_run_to_tell():
    class Overflowing(Constant):
        @staticmethod
        def law(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def, override]
            tau[:] = np.float64(1e200) * np.float64(1e200)

    far = corrected(start=(1e200, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert Plan(far, TimeGrid(0.01, 1)).first_memory.size
    check_law(Plan(adrift(controller=Overflowing()), TimeGrid(0.01, 1)))
    assert run(adrift(controller=Overflowing()), 1.0, compiled=False).status == "diverged"
