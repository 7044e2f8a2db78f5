"""What an actuator did, from what a log says that it was commanded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from log_files import written

from benchmarks import coverage, plain_logs
from podusv_cli.core.errors import UsageError
from podusv_cli.identify.intake import logs_of
from podusv_cli.identify.logs.commands import with_actuator_state, with_known_state
from podusv_cli.identify.logs.reading import LogTable
from podusv_cli.scenario.identify import LogFile
from podusv_cli.scenario.load import load

REVOLT = next(c for c in map(coverage.coverage_set, range(120)) if c.hull == "revolt")
BEFORE = coverage.known_before(replace(REVOLT, logged="commands"))


@pytest.fixture(scope="module")
def pods():
    """A propeller that turns: speed with a lag of 0.5 s, angle with 0.1 s and 0.25 rad/s."""
    pods = (
        "{x: -0.5, T_nn: 0.01, T_nn_astern: 0.01, n_max: 100, n_max_astern: 50, n_rate: 1e6, "
        "n_lag: 0.5, angle_limit: 1.5, angle_rate: 0.25, angle_lag: 0.1}"
    )
    return load(
        "podusv:trials/base.yaml",
        [
            "vessel={preset: cybership2}",
            "controller={kind: pid}",
            f"actuator={{kind: pod, pods: [{pods}]}}",
        ],
    ).scenario.actuator


@pytest.fixture(scope="module")
def sailed():
    """60 s of a ReVolt from rest, whose pods have lags of 1 s and 3 s; rows of 0.07 s."""
    rng = np.random.default_rng(11)
    boat = coverage.true_boat(BEFORE, REVOLT, rng)
    asked = coverage.speeds_and_angles(boat, 0.5, rng)
    motion = plain_logs.sail(boat, asked, 60.0, plain_logs.Sea())
    columns = plain_logs.log_columns(motion, plain_logs.Sensors(row=0.07, gnss_period=0.21), rng)
    return {name.replace("n_", "n_part_"): column for name, column in columns.items()}


def commands_from(sailed, begin, names=("n_part_cmd", "delta_cmd", "x", "y", "psi")):
    """What a log has that begins at a time [s]."""
    rows = sailed["time"] >= begin
    kept = {n: c[rows] for n, c in sailed.items() if n.startswith(names)}
    return LogTable("a.csv", sailed["time"][rows], kept)


def test_what_pods_did_follows_from_their_commands(pods):
    """A step goes as 1 - exp(-t / T); an angle turns no faster than its limit."""
    times = np.arange(0.0, 4.0, 0.1)
    ordered = {
        "n_cmd_1": np.where(times < 1.0, 0.0, 10.0),
        "delta_cmd_1": np.where(times < 1.0, 0.0, 0.5),
    }
    log = with_actuator_state(LogTable("a.csv", times, ordered), pods)
    after = np.maximum(times - 1.0, 0.0)
    assert log.columns["n_1"] == pytest.approx(10.0 * (1.0 - np.exp(-after / 0.5)), abs=0.15)
    turning = (after > 0.0) & (after < 1.8)
    assert log.columns["delta_1"][turning] == pytest.approx(0.25 * after[turning], abs=1e-9)
    assert "n_1, delta_1 follow from commands" in log.notes[0]
    own = replace(log, notes=())
    assert with_actuator_state(own, pods) is own


def test_a_log_counts_from_where_lags_forget_what_was_before(pods):
    """From rest a lag of 0.5 s is 1 % off after 0.5 ln 100 = 2.30 s: the next row is at 2.4 s.

    The angle is there earlier: 1.9 s at 0.25 rad/s, and 0.1 ln 5 s for the rest.
    """
    times = np.arange(7.0, 12.0, 0.1)
    ordered = {"n_cmd_1": np.full(len(times), 10.0), "delta_cmd_1": np.full(len(times), 0.5)}
    log = with_known_state(LogTable("a.csv", times, ordered), pods)
    assert log.times[0] == pytest.approx(9.4)
    assert log.columns["n_1"] == pytest.approx(10.0, rel=1e-12)
    assert log.notes[0].endswith("It counts from 9.4 s on, where they forget what was before.")


def test_a_log_that_begins_with_a_stop_does_not_say_that_propellers_stood(pods):
    """What turns at 10 as a log begins with 0 turns at 10 exp(-t / 0.5): 1 % of it after 2.3 s."""
    times = np.arange(0.0, 9.0, 0.1)
    ordered = {"n_cmd_1": np.where(times < 4.0, 0.0, 10.0), "delta_cmd_1": np.zeros(len(times))}
    log = with_known_state(LogTable("a.csv", times, ordered), pods)
    assert log.times[0] == pytest.approx(2.4)
    ordered["n_cmd_1"] = 0.0 * times
    assert with_known_state(LogTable("a.csv", times, ordered), pods).times[0] == 0.0


@pytest.mark.parametrize("begin", [0.0, 29.4])
def test_what_pods_did_is_that_of_another_program(sailed, begin):
    """A log from rest, which commands do not say, and one that begins under way."""
    log = with_known_state(commands_from(sailed, begin), BEFORE.actuator)
    late = log.times[0] - begin
    assert 3.0 * np.log(20.0) < late < 3.0 * np.log(500.0)  # of the slower lag
    for name in ("n_part_1", "n_part_3", "delta_2"):
        truth = np.interp(log.times, sailed["time"], sailed[name])
        assert log.columns[name] == pytest.approx(truth, abs=0.03 * np.abs(truth).max()), name


def test_pieces_that_end_before_lags_forget_are_left_out(sailed, tmp_path):
    """Pieces of 6 s and 54 s, then of 6 s each: 9 s and more are needed for angles."""

    def logs(gaps):
        rows = ~np.any([(sailed["time"] > g) & (sailed["time"] < g + 3.0) for g in gaps], axis=0)
        kept = commands_from({n: c[rows] for n, c in sailed.items()}, 0.0)
        path = written(tmp_path / "a.csv", {"time": kept.times, **kept.columns})
        return logs_of(path, LogFile(file="a.csv", delay=0.0), BEFORE)

    (log,) = logs([6.0])
    assert log.times[0] > 18.0
    assert any("a.csv from 0 s: left out, as too little comes" in line for line in log.warnings)
    with pytest.raises(UsageError, match="its pieces between gaps end before the actuator's lags"):
        logs(np.arange(6.0, 60.0, 9.0))
