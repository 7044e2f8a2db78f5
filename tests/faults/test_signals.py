"""Ctrl-C, SIGTERM, a lost terminal at every stage: it stops, says why, keeps what it has.

What does not stop sleeps or computes for many minutes: it would be waited for in vain.
"""

import os
import pty
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from command_samples import (
    BASE,
    LONG,
    MOSTLY_SIGINT,
    PATIENCE,
    ROOT,
    SIGNALS,
    TWO,
    commanded,
    gone,
    send,
    under_way,
    wait_for,
    write,
)
from storage_samples import files

from podusv_cli.process.workers import INTERRUPTED, Outcome
from podusv_cli.storage import manifest
from podusv_cli.storage.run_folder import open_run
from podusv_cli.verification import step_halving
from podusv_cli.workflows import compare, execute

INTERRUPTS = pytest.mark.parametrize(("number", "code"), MOSTLY_SIGINT)
SLOW_MODULE = """
import time
open("imported", "w").close()
time.sleep(600)
"""
# The command line with something in its way: `patch` replaces a function by one that begins with
# a file called `reached`, then does what `instead` says.
PATCHED = """
import sys, time
from pathlib import Path
from podusv_cli import cli
from podusv_cli.process import interrupts
from podusv_cli.workflows import execute

def patch(room, name, instead):
    old = getattr(room, name)
    def new(*given, **more):
        Path("reached").touch()
        return instead(old, *given, **more)
    setattr(room, name, new)

{patches}
sys.argv[0] = "podusv"
cli.main()
"""
# For `patches`: a file called `moved` once more than that fraction of the run is simulated.
MOVING = """
def told(old, *given, progress=None, **more):
    def tell(fraction):
        if fraction > {fraction}:
            Path("moved").touch()
        if progress:
            progress(fraction)
    return old(*given, progress=tell, **more)
patch(execute, "run", told)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def ended(process: object, number: signal.Signals, times: int = 1) -> tuple[int, str, str]:
    """Interrupt a process; its exit code as a shell reports it, stdout, stderr."""
    send(process, number, times)
    out, err = process.communicate(timeout=PATIENCE)
    assert gone(process)
    code = process.returncode
    return (code if code >= 0 else 128 - code), out, err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module", "number", "code"),
    [("typer", *SIGNALS[1]), ("h5py", *SIGNALS[0]), ("yaml", *SIGNALS[1])],
)
def test_while_importing(folder, module, number, code):
    """typer before there is a command, h5py by each worker, yaml by the command.

    On a busy machine, or with nothing compiled, the signal may come before a worker has begun.
    """
    early, late = "interrupted\n", "interrupted before any run finished; nothing was written\n"
    says = {"typer": ("",), "h5py": (early, late), "yaml": (early,)}[module]
    (folder / "first").mkdir()
    (folder / "first" / f"{module}.py").write_text(SLOW_MODULE)
    config = write("two.yaml", TWO)
    with under_way("compare", config, "--out", "x", first=str(folder / "first")) as process:
        wait_for("imported")
        *ending, said = ended(process, number)
    assert ending == [code, ""]
    assert said in says
    assert not Path("x").exists()


def lose_the_terminal(*words: str, until: str) -> None:
    """Run podusv on a terminal of its own, which goes away once there is a file of this name."""
    process, terminal = pty.fork()
    if process == 0:
        os.environ |= {"PYTHONPATH": str(ROOT), "TERM": "xterm"}
        os.execv(sys.executable, [sys.executable, "-m", "podusv_cli", *words])
    try:
        shown = b""
        while "\u2501".encode() not in shown:  # the bar
            shown += os.read(terminal, 65536)
        wait_for(until)
        os.close(terminal)
        end = time.monotonic() + PATIENCE
        while os.waitpid(process, os.WNOHANG) == (0, 0):
            assert time.monotonic() < end
            time.sleep(0.05)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process, signal.SIGKILL)


@pytest.mark.long
def test_a_lost_terminal_ends_a_run_and_keeps_it():
    """As a lost ssh does; nothing that is still to be printed stands in the way."""
    words = ("run", write("long.yaml", LONG), "--out", "x", "--no-figures")
    lose_the_terminal(*words, until="long.yaml")
    assert manifest.check(Path("x")).status == "interrupted"
    assert 0 < open_run(Path("x")).recording["time"][-1] < 1e5


@pytest.mark.slow
def test_a_lost_terminal_ends_a_comparison_and_keeps_it():
    scenarios = write("short.yaml", BASE), write("long.yaml", LONG)
    words = ("compare", *scenarios, "--out", "x", "--no-figures")
    lose_the_terminal(*words, until=".x.podusv-*.part/new/short/manifest.json")
    assert manifest.check(Path("x")).status == "interrupted"
    assert manifest.check(Path("x/short")).status == "finished"


@pytest.mark.slow
@pytest.mark.parametrize(("ignored", "code"), [(False, 129), (True, 0)])
def test_a_hangup_ends_it_but_not_under_nohup(ignored, code):
    patches = 'patch(execute, "run", lambda old, *given, **more: old(*given, **more))'
    if ignored:
        patches = f"import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN); {patches}"
    config = write("a.yaml", LONG.replace("1e5", "1e3") if ignored else LONG)
    words = ("run", config, "--out", "x", "--no-figures")
    with under_way(*words, script=PATCHED.format(patches=patches)) as process:
        wait_for("reached")
        process.send_signal(signal.SIGHUP)
        assert process.wait(60) == code
    assert manifest.check(Path("x")).status == ("finished" if ignored else "interrupted")


@pytest.mark.slow
@INTERRUPTS
def test_twice_ends_what_does_not_listen_and_its_workers(number, code):
    patches = """
import multiprocessing, signal
interrupts.SAME_INTERRUPT = 0.5
def deaf(old, *given):
    multiprocessing.get_context("fork").Process(target=time.sleep, args=(600,)).start()
    while True:
        time.sleep(0.1)
        if signal.getsignal(signal.SIGINT).number:
            Path("heard").touch()
patch(execute, "_write", deaf)
"""
    script = PATCHED.format(patches=patches)
    with under_way("run", write("a.yaml", BASE), "--out", "x", script=script) as process:
        wait_for("reached")
        process.send_signal(number)
        wait_for("heard")
        time.sleep(1.5)  # longer than an echo
        assert process.poll() is None
        process.send_signal(number)
        out, err = process.communicate(timeout=PATIENCE)
        assert gone(process)
    assert (process.returncode, out) == (code, "")
    assert err == "podusv: interrupted again; unfinished results are lost\n"
    assert not Path("x").exists()


@pytest.mark.slow
@INTERRUPTS
def test_in_a_law_that_never_returns(number, code):
    """Machine code hears nothing: the run is kept up to there, the law is left behind."""
    patches = MOVING.format(fraction=0.0) + 'import faulty_laws; faulty_laws.install("endless")'
    script = PATCHED.format(patches=patches)
    words = ("run", write("a.yaml", BASE), "--out", "x", "--no-figures")
    with under_way(*words, script=script, first=str(Path(__file__).parent)) as process:
        wait_for("moved")
        got, out, err = ended(process, number)
    assert (got, out) == (code, "pid interrupted: x\n")
    assert err.startswith("a.yaml: interrupted after t = ")
    assert open_run(Path("x")).recording["time"][-1] < 0.5


# --- interrupts of runs and comparisons

COMPARE = ("compare", "--out", "x", "--no-figures")


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    return commanded(monkeypatch, capsys)


def test_nothing_finished_leaves_nothing(podusv, monkeypatch):
    lost = Outcome(failure=INTERRUPTED, interrupted=True)
    monkeypatch.setattr(compare, "run_all", lambda jobs, *rest: [lost] * len(jobs))
    said = podusv("compare", "--no-figures", write("two.yaml", TWO), "--out", "x")
    assert said == (130, "", "interrupted before any run finished; nothing was written\n")
    assert [path.name for path in Path().iterdir()] == ["two.yaml"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "code", "times"), [(signal.SIGINT, 130, 3), (signal.SIGTERM, 143, 1)]
)
def test_an_interrupted_comparison_keeps_what_it_has(podusv, number, code, times):
    write("short.yaml", BASE)
    write("long.yaml", LONG)
    with under_way(*COMPARE, "short.yaml", "long.yaml") as process:
        wait_for(".x.podusv-*.part/new/short/manifest.json")
        send(process, number, times)
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == code, err
        assert gone(process)
    assert "long: interrupted after t = " in err
    assert "Traceback" not in err
    assert "compared 2 runs: x" in out
    assert manifest.check(Path("x")).status == "interrupted"
    assert manifest.check(Path("x/short")).status == "finished"
    assert manifest.check(Path("x/long")).status == "interrupted"
    assert not list(Path().glob(".x*"))


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), MOSTLY_SIGINT)
def test_an_interrupt_while_drawing_costs_the_figures_only(podusv, number, code):
    config = write("two.yaml", TWO)
    with under_way("compare", config, "--out", "x") as process:
        wait_for(".x.podusv-*.part/new/comparison.csv")
        send(process, number, 1)
        out, err = process.communicate(timeout=PATIENCE)
        assert process.returncode == code, err
        assert gone(process)
    assert "compared 2 runs: x" in out
    assert err == "interrupted; the runs made so far are compared, without figures\n"
    assert manifest.check(Path("x")).status == "interrupted"
    assert manifest.check(Path("x/soft")).status == "finished"
    assert "two (interrupted)</h1>" in Path("x/report.html").read_text()
    assert not Path("x/figures").exists()


def soon(number: signal.Signals, work: Callable[..., object]) -> Callable[..., object]:
    """The work, with a signal to this process after it has begun."""

    def begun(*args: object, **options: object) -> object:
        threading.Timer(0.1, os.kill, (os.getpid(), number)).start()
        return work(*args, **options)

    return begun


@pytest.mark.parametrize(("number", "code"), [*SIGNALS, (signal.SIGHUP, 129)])
def test_an_interrupted_run_is_kept(podusv, number, code, monkeypatch):
    monkeypatch.setattr(execute, "run", soon(number, execute.run))
    said = podusv("run", write("long.yaml", LONG), "--out", "x")
    assert said.code == code
    assert said.err.startswith("long.yaml: interrupted after t = ")
    assert manifest.check(Path("x")).status == "interrupted"
    assert 0 < open_run(Path("x")).recording["time"][-1] < 2e5


def test_an_interrupted_run_takes_no_finished_ones_place(podusv, monkeypatch):
    assert podusv("run", write("short.yaml", BASE), "--out", "x", "--no-figures").code == 0
    old = files(Path("x"))
    monkeypatch.setattr(execute, "run", soon(signal.SIGINT, execute.run))
    said = podusv("run", write("long.yaml", LONG), "--out", "x", "--force")
    assert (said.code, said.out) == (130, "pid interrupted: x-2\n")
    assert files(Path("x")) == old
    assert manifest.check(Path("x-2")).status == "interrupted"


def test_a_fault_after_an_interrupt_is_told(podusv, monkeypatch):
    def faulty(*args: object) -> None:
        raise TypeError("no such thing")

    monkeypatch.setattr(execute, "run", soon(signal.SIGINT, execute.run))
    monkeypatch.setattr(execute, "_write", faulty)
    said = podusv("run", write("long.yaml", LONG), "--out", "x")
    assert said == (130, "", "podusv: interrupted, and then TypeError: no such thing\n")
    assert not Path("x").exists()


@pytest.mark.parametrize(("number", "code"), SIGNALS)
@pytest.mark.parametrize("stage", ["_draw_figures", "_cost", "_write"])
def test_a_run_that_is_interrupted_after_its_simulation_is_whole(
    podusv, number, code, stage, monkeypatch
):
    write_all = execute._write

    def written(*given: Any) -> object:
        """What is being written is written to its end."""
        os.kill(os.getpid(), number)
        return write_all(*given)

    slow = soon(number, lambda *given: time.sleep(60))
    monkeypatch.setattr(execute, stage, written if stage == "_write" else slow)
    said = podusv("run", write("short.yaml", BASE), "--out", "x")
    assert said.code == code
    assert said.err.startswith("short.yaml: interrupted after the simulation; log.h5 is complete")
    assert manifest.check(Path("x")).status == "interrupted"
    assert open_run(Path("x")).recording.status == "finished"
    assert not Path("x/figures").exists()


def test_an_interrupted_verification_says_that_nothing_was_written(podusv, monkeypatch):
    monkeypatch.setattr(step_halving, "to_end", soon(signal.SIGINT, step_halving.to_end))
    said = podusv("verify", write("long.yaml", LONG), "--out", "x.json")
    text = "long.yaml: interrupted before all steps were simulated; nothing was written\n"
    assert said == (130, "", text)
    assert not Path("x.json").exists()


def test_run_and_rerun_tell_an_interruption_in_the_same_words(podusv, monkeypatch):
    simulate = execute.run

    def interrupted(*args: object, **options: object) -> object:
        os.kill(os.getpid(), signal.SIGINT)
        return simulate(*args, **options)

    assert podusv("run", write("short.yaml", BASE), "--out", "x", "--no-figures").code == 0
    monkeypatch.setattr(execute, "run", interrupted)
    run = podusv("run", "short.yaml", "--out", "y", "--no-figures")
    rerun = podusv("rerun", "x")
    assert (run.code, rerun.code) == (130, 130)
    assert run.err.startswith("short.yaml: ")
    assert rerun.err == run.err.replace("short.yaml", "x")
