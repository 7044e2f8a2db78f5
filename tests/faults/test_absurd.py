"""Absurd numbers are refused at once, in a sentence; on what is merely large one can insist."""

import shutil
import tracemalloc
from collections import namedtuple
from pathlib import Path
from typing import Any

import h5py
import pytest
from command_samples import BASE, Command, write
from counting import counted
from scenario_samples import loaded
from storage_samples import deadline

from podusv_cli.scenario import limits
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.limits import estimate
from podusv_cli.scenario.load import load
from podusv_cli.workflows import compare, execute

LAW = BASE.replace("{kind: pid, K_Pu: 100.0}", "{kind: adaptive_neural}")
pytestmark = pytest.mark.usefixtures("tidy")

CALLS, BYTES = 500_000, 20e6  # that a refusal may take
HUGE = 10**30  # beyond 64 bits

NONE_OF_THEIR_OWN = "no more than 9e+15 have times of their own"
WRONG = {
    "simulation.step=0": "simulation.step: must be a number above 0 [s], found 0",
    "simulation.step=-0.01": "simulation.step: must be a number above 0 [s], found -0.01",
    "simulation.step=1e400": "simulation.step: 1e400 is too large; numbers must be finite",
    "simulation.step=1e-300": "simulation.step: 1 s in steps of 1e-300 s are 1e+300 steps; "
    + NONE_OF_THEIR_OWN,
    "simulation.step=5e-324": "simulation.step: 1 s in steps of 4.94066e-324 s are inf steps; "
    + NONE_OF_THEIR_OWN,
    "simulation.step=2.0": "simulation.duration: 1 s is no whole number of steps of 2 s; try 2",
    "simulation.duration=0": "simulation.duration: must be a number above 0 [s], found 0",
    "simulation.duration=-1": "simulation.duration: must be a number above 0 [s], found -1",
    "simulation.duration=1e300": "simulation.duration: 1e+300 s in steps of 0.01 s are 1e+302 "
    f"steps; {NONE_OF_THEIR_OWN}",
    "control.period=1e300": "control.period: 1e+300 s in steps of 0.01 s are 1e+302 steps; "
    + NONE_OF_THEIR_OWN,
    "log.every=0": "log.every: must be a whole number not below 1 [steps], found 0",
    "log.every=-5": "log.every: must be a whole number not below 1 [steps], found -5",
    "log.every=101": "log.every: the run has 100 steps, so that its first instant alone would be "
    "logged; must be at most 100",
    f"log.every={HUGE}": "log.every: the run has 100 steps, so that its first instant alone would "
    "be logged; must be at most 100",
    "log.compress=true simulation.duration=5e3": "log.compress: the log would hold 420 MB, more "
    "than the 270 MB that can be compressed; leave it uncompressed or log less often (every: 2)",
    "controller.network.nodes=[100,100,100]": "controller.network: has 1,000,000 nodes, at most "
    "10,000 are possible",
}
STEPS = "simulate less or take a longer step"
ROWS = ", more than the 4 GB that podusv reads back: about "
INSIST = ", or insist with --allow-large"
LARGE = {
    "simulation.duration=1e12": "simulation.duration: 1e+12 s in steps of 0.01 s are 1e+14 steps, "
    f"more than 1e+08: about 39 years, 220 MB of memory and 84 PB of disk; {STEPS}",
    "simulation.step=1e-9": "simulation.step: 1 s in steps of 1e-09 s are 1e+09 steps, more than "
    f"1e+08: about 3.4 h, 220 MB of memory and 840 GB of disk; {STEPS}",
    "simulation.duration=1e5": f"log.every: the log would hold 8.4 GB in 1e+07 rows{ROWS}2.1 min, "
    "220 MB of memory and 8.4 GB of disk; log less often (every: 3)",
    "controller.network.nodes=[30,30,11] simulation.duration=270": "log.every: the log would hold "
    f"4.3 GB in 2.7e+04 rows{ROWS}59 s, 220 MB of memory and 4.3 GB of disk; log less often "
    "(every: 2)",
}


@pytest.fixture(autouse=True)
def begun(podusv):
    """A scenario of our own, and everything imported that a refusal needs."""
    write("a.yaml", LAW)
    assert podusv("validate", "a.yaml").code == 0


@pytest.fixture
def idle(monkeypatch):
    """Nothing is simulated, whatever is not refused."""
    for module in (compare, execute):
        monkeypatch.setattr(module, "warm_up", lambda _: pytest.fail("begun"))


def refused(podusv: Command, *words: str) -> str:
    """What is said of a scenario that is refused at once, leaving nothing behind."""
    tracemalloc.start()
    try:
        with deadline():
            said, calls = counted(lambda: podusv(*words))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (said.code, said.out) == (2, "")
    assert calls < CALLS
    assert peak < BYTES
    assert {path.name for path in Path().iterdir()} <= {"a.yaml", "b", "b.yaml"}
    return said.err


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize("override", WRONG, ids=lambda override: override[:40])
def test_what_is_wrong_stays_wrong_whoever_insists(podusv, override):
    told = refused(podusv, "run", "a.yaml", *given(override), "--allow-large")
    assert told.endswith(f": {WRONG[override]}\n")
    assert told.count("\n") == 1
    assert told.startswith(("--set ", "a.yaml:"))


def given(overrides: str) -> list[str]:
    """The options for these overrides."""
    return [word for override in overrides.split() for word in ("--set", override)]


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize("command", ["run", "compare", "validate"])
@pytest.mark.parametrize("overrides", LARGE)
def test_what_is_too_large_is_refused_with_an_estimate(podusv, overrides, command):
    full = LARGE[overrides].startswith("log.every")
    told = refused(podusv, command, "a.yaml", *given(overrides))
    assert told.count("\n") == 1
    assert told.startswith(("--set ", "a.yaml: "))
    # A comparison reads its logs back: there is nothing to insist on.
    insist = "" if full and command == "compare" else INSIST
    assert told.endswith(f": {LARGE[overrides]}{insist}\n")


def test_verify_has_nothing_to_insist_with(podusv):
    told = refused(podusv, "verify", "a.yaml", *given("simulation.duration=1e12"))
    assert told.endswith(STEPS + "\n")


def test_validate_shows_what_a_large_run_takes(podusv):
    said = podusv("validate", "a.yaml", *given("simulation.duration=1e5"), "--allow-large")
    assert (said.code, said.err) == (0, "")
    assert "a run takes about 2.1 min, 220 MB of memory and 8.4 GB of disk\n" in said.out


@pytest.fixture
def modest(podusv, monkeypatch):
    """A hundred steps are many, and so are a thousand bytes."""
    monkeypatch.setattr(limits, "MOST_STEPS", 99)
    monkeypatch.setattr(limits, "MOST_CONTENT", 1000)


@pytest.mark.usefixtures("modest")
def test_a_user_who_insists_gets_a_large_run(podusv):
    write("b.yaml", BASE + "log: {every: 50}\n")
    plain = ("b.yaml", "--set", "simulation.compiled=false", "--no-figures")
    for command, other in (("run", "compare"), ("compare", "run")):
        assert "more than" in refused(podusv, command, *plain)
        assert podusv(command, *plain, "--out", other, "--allow-large").code == 0
        said = podusv("rerun", other)
        assert (said.code, said.out) == (2, "")
        assert "resolved.yaml:" in said.err
        assert said.err.endswith(f"{INSIST}\n")
        assert podusv("rerun", other, "--allow-large").code == 0
        shutil.rmtree(other)


@pytest.mark.usefixtures("modest")
@pytest.mark.parametrize("command", ["compare", "rerun"])
def test_logs_that_cannot_be_read_back_are_not_made_for_it(podusv, command):
    plain = ("--set", "simulation.compiled=false", "--no-figures", "--out", "b", "-q")
    assert podusv("run", "a.yaml", *plain, "--allow-large").code == 0
    told = refused(podusv, command, "b" if command == "rerun" else "a.yaml", "--allow-large")
    assert "more than the 1 kB that podusv reads back" in told
    assert told.endswith(")\n")


# Each sets the width of a row or the number of rows in another way.
SHAPES: list[dict[str, Any]] = [
    {"kind": "adaptive_neural", "every": 1, "monitor": "true", "period": 0},
    {"kind": "full_backstepping", "every": 3, "monitor": "true", "period": 0},
    {"kind": "dsc", "every": 4, "monitor": "false", "period": 0.02},
    {"kind": "pid", "every": 1, "monitor": "true", "period": 0.02},
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: " ".join(map(str, shape.values())))
@pytest.mark.parametrize("actuator", ["{kind: ideal}", "{kind: pod, preset: milliampere}"])
def test_the_estimate_has_the_rows_and_bytes_of_the_log(actuator, shape):
    text = f"""
vessel: {{preset: paper}}
path: {{kind: line}}
disturbance: {{kind: none}}
actuator: {actuator}
controller: {{kind: {shape["kind"]}}}
simulation: {{duration: 0.1, compiled: false}}
control: {{period: {shape["period"]}}}
log: {{every: {shape["every"]}, monitor: {shape["monitor"]}}}
"""
    scenario = loaded(text).scenario
    case = Case.of(scenario)
    recording = execute.simulate_case(case, execute.Stopwatch())
    recording, _ = execute.add_derived(case, recording)
    expected = estimate(scenario, case.plan)
    assert expected.steps == 10
    assert expected.rows == len(recording["time"])
    assert expected.content == sum(array.nbytes for array in recording.signals.values())


def test_a_time_grid_has_no_numbers_that_machine_code_does_not_know():
    grid = loaded(LAW + f"log: {{every: {HUGE}}}\n").scenario.time_grid()
    assert (grid.rows, grid.log_every) == (1, 101)


@pytest.fixture
def crowded(monkeypatch):
    """A disk with so many bytes free."""
    usage = namedtuple("usage", "free")
    return lambda free: monkeypatch.setattr(shutil, "disk_usage", lambda place: usage(free))


@pytest.mark.parametrize("command", ["run", "compare"])
@pytest.mark.usefixtures("idle")
def test_what_the_disk_has_no_room_for_is_not_begun(podusv, crowded, command):
    crowded(2e9)
    said = podusv(command, "a.yaml", *given("simulation.duration=2e4"), "--out", "x")
    assert said.code == 5
    assert said.err == (
        "cannot make x: it takes 3.6 GB of disk or more, and 2 GB are free; log less often "
        "(log.every), or elsewhere (--out)\n"
    )
    assert {path.name for path in Path().iterdir()} == {"a.yaml"}


def test_a_disk_that_may_do_is_tried(podusv, crowded):
    """How small a log gets when it is compressed, nobody knows before."""
    write("a.yaml", f"{LAW}log: {{compress: true}}\n".replace("1.0}", "0.1, compiled: false}"))
    scenario = load("a.yaml").scenario
    size = estimate(scenario, scenario.plan())
    crowded(size.bytes_needed)
    assert size.bytes_needed < size.disk
    assert podusv("run", "a.yaml", "-q", "--no-figures", "--out", "x").code == 0
    with h5py.File("x/log.h5") as log:
        assert log["x"].compression == "gzip"
