"""Scenarios and processes for tests of commands from outside."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import typer

import podusv_cli
from podusv_cli import cli

ROOT = Path(podusv_cli.__file__).parents[1]
BASE = """
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: saturated}
start: {x: -5.0, y: -2.0, u: 0.3}
simulation: {duration: 1.0}
controller: {kind: pid, K_Pu: 100.0}
silence: [saturated, never-settles] # the gains are large on purpose, and runs are short
"""
TWO = BASE + "controllers: {stiff: {K_Pu: 200.0}, soft: {K_Pu: 5.0}}\n"
LONG = BASE.replace("duration: 1.0", "duration: 1e5, step: 1e-3") + "log: {every: 1000}\n"


PATIENCE = 120  # s; ends what hangs, however busy the machine is, and says nothing of speed


class Said(NamedTuple):
    """What a command left behind."""

    code: object
    out: str
    err: str


Command = Callable[..., Said]
COMMAND_LINE = cache(typer.main.get_command)  # made of all signatures, which takes its time


def commanded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, columns: int = 100
) -> Command:
    """The command line in this process, on a terminal that wide."""
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(typer.main, "get_command", COMMAND_LINE)

    def run(*words: Any) -> Said:
        monkeypatch.setattr(sys, "argv", ["podusv", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return Said(ended.value.code, *capsys.readouterr())

    return run


def write(name: str, text: str) -> str:
    """A scenario file; its name."""
    Path(name).write_text(text)
    return name


@contextmanager
def under_way(*words: str, script: str = "", first: str = "") -> Iterator[subprocess.Popen[str]]:
    """`podusv`, or a script, in a session of its own; nothing of it is left behind.

    `first` is a folder whose modules are found before all others.
    """
    what = ["-c", script] if script else ["-m", "podusv_cli"]
    process = subprocess.Popen(
        [sys.executable, *what, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": f"{first}:{ROOT}"},
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def wait_for(pattern: str) -> None:
    """Wait until a file of this name is there."""
    end = time.monotonic() + PATIENCE
    while not list(Path().glob(pattern)):
        assert time.monotonic() < end, f"there is no {pattern}"
        time.sleep(0.01)


def send(process: subprocess.Popen[str], number: signal.Signals, times: int) -> None:
    """As a terminal does it: SIGINT to all processes; SIGTERM to the first alone."""
    for _ in range(times):
        if number == signal.SIGINT:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        time.sleep(0.2)


SIGNALS = [(signal.SIGINT, 130), (signal.SIGTERM, 143)]
# For tests with a process of their own; where it makes a difference they take both.
MOSTLY_SIGINT = [SIGNALS[0], pytest.param(*SIGNALS[1], marks=pytest.mark.slow)]


def gone(process: subprocess.Popen[str]) -> bool:
    """Whether nothing is left of a process and all that it started."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.02)
    return False


def one_line(text: str) -> str:
    """The text, which has to be one line for people."""
    assert text.count("\n") == 1, text
    assert "Traceback" not in text
    return text.removesuffix("\n")
