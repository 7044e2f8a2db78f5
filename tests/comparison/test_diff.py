"""`podusv diff`: what two runs differ in, to the last bit and in words."""

import json
import math
import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from command_samples import commanded
from hypothesis import given
from hypothesis import strategies as st
from known_signals import ABOUT
from rerun_samples import copied, made, replaced
from storage_samples import recording

from podusv_cli.cli.diff import deviation_in_words
from podusv_cli.comparison.log_difference import Deviation, compare, differing
from podusv_cli.comparison.run_difference import scenario_changes, version_changes
from podusv_cli.core import json_text
from podusv_cli.core.errors import StorageError
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.storage import manifest

FINITE = st.floats(allow_nan=False, allow_infinity=False)


def deviation(one: float, other: float) -> Deviation:
    return Deviation("x", 0.0, one, other, 1.0)


# --- numbers


@given(FINITE, st.integers(1, 5))
def test_units_in_the_last_place_are_counted_also_across_zero(start, count):
    number = start
    for _ in range(count):
        number = math.nextafter(number, math.inf)
    if math.isfinite(number):
        assert deviation(start, number).ulps == deviation(number, start).ulps == count


@pytest.mark.parametrize("name", ["psi_d", "psi_e", "psi_d_held"])
def test_wrapped_angles_are_the_shorter_way_round_apart(name):
    angle = np.zeros(50)
    one, other = np.array(angle), np.array(angle)
    one[10], other[10] = 3.13, -3.12  # across the seam
    one[20], other[20] = 0.3, 0.2
    difference = compare(changed(**{name: one}), changed(**{name: other}))
    (largest,) = difference.largest
    assert (largest.time, largest.gap) == (0.2, pytest.approx(0.1))
    assert difference.first is not None
    assert difference.first.gap == pytest.approx(2.0 * math.pi - 6.25)
    assert compare(changed(psi=one), changed(psi=other)).largest[0].gap == pytest.approx(6.25)


def test_zeros_of_either_sign_are_no_distance_apart_but_differ():
    assert deviation(0.0, -0.0).ulps == 0
    assert deviation_in_words(deviation(0.0, -0.0)).endswith("(the sign of zero)")
    assert differing(np.array([0.0]), np.array([-0.0]))[0]


def test_what_is_not_finite_is_infinitely_far_from_what_is():
    assert deviation(math.nan, 1.0).ulps is None
    for bad in (math.nan, math.inf):
        assert deviation(bad, 1.0).gap == deviation(1.0, bad).relative == math.inf
    payload = struct.unpack("<d", struct.pack("<Q", 0xFFF8_0000_0000_0001))[0]
    assert not differing(np.array([math.nan]), np.array([payload]))[0]


# --- logs


def changed(**signals: Any) -> Recording:
    """The small recording with some of its signals replaced."""
    base = recording()
    return replace(base, signals=base.signals | signals)


def bumped(name: str, place: Any, by: float) -> Any:
    array = np.array(recording()[name])
    array[place] += by
    return array


def test_signals_of_others_have_their_own_unit_and_period():
    about = {"bearing_2": Signal("bearing_2", "deg", "a law's own", wrapped=True)}
    one, other = np.full(50, 3.13), np.full(50, -3.12)
    pair = (replace(changed(bearing_2=array), about=ABOUT | about) for array in (one, other))
    (largest,) = compare(*pair).largest
    assert largest.gap == pytest.approx(2.0 * math.pi - 6.25)
    assert "-> -3.12 deg (" in deviation_in_words(largest)


@given(st.sampled_from(["x", "z_e", "tau_u_cmd"]), st.integers(0, 49), st.integers(0, 62))
def test_any_flipped_bit_of_any_signal_is_found(name, row, bit):
    array = np.array(recording()[name])
    array.view(np.int64)[row] ^= 1 << bit
    difference = compare(recording(), changed(**{name: array}))
    assert not difference.same
    assert difference.first is not None
    assert (difference.first.signal, difference.first.time) == (name, recording()["time"][row])


def test_the_first_difference_is_the_earliest_and_the_largest_the_widest():
    other = changed(
        x=bumped("x", 30, 5.0),
        W_hat_u=bumped("W_hat_u", (12, 3), 1e-9),
        z_e=bumped("z_e", [20, 40], [1.0, -2.0]),
    )
    difference = compare(recording(), other)
    assert difference.first
    assert (difference.first.signal, difference.first.time) == ("W_hat_u[3]", 0.12)
    assert difference.first.one == recording()["W_hat_u"][12, 3]
    largest = {d.signal: (d.time, d.gap) for d in difference.largest}
    assert largest == {
        "x": (0.30, pytest.approx(5.0)),
        "W_hat_u[3]": (0.12, pytest.approx(1e-9)),
        "z_e": (0.40, pytest.approx(2.0)),
    }


def test_logs_of_one_length_are_compared_at_the_times_that_both_have():
    """More than half of the times differ: two grids, not one that is damaged."""
    base = recording()
    t, rows = base["time"], len(base["time"])
    twice = changed(time=2.0 * t)
    difference = compare(base, twice)
    assert difference.rows == (rows, rows, rows // 2)
    assert "time" not in {d.signal for d in difference.largest}
    for apart, shared in ((rows // 2, rows), (rows // 2 + 1, rows // 2 - 1)):
        moved = np.array(t)
        moved[rows - apart :] += 0.5 * t[1]
        assert compare(base, changed(time=moved)).rows == (rows, rows, shared)


def test_what_does_not_run_over_time_comes_first():
    base = recording()
    centres = np.array(base["rbf_center"])
    centres[2, 1] += 1.0
    other = replace(changed(x=bumped("x", 0, 1.0)), fixed={**base.fixed, "rbf_center": centres})
    first = compare(base, other).first
    assert first
    assert (first.signal, first.time) == ("rbf_center[2,1]", None)


def test_logs_of_other_steps_are_compared_at_the_times_of_both():
    base = recording()
    thin = replace(base, signals={name: array[::2] for name, array in base.signals.items()})
    difference = compare(base, thin)
    assert difference.rows == (50, 25, 25)
    assert not difference.largest
    assert not difference.same
    shorter = replace(base, signals={name: array[:7] for name, array in base.signals.items()})
    assert compare(shorter, base).rows == (7, 50, 7)


def test_one_wrong_time_does_not_set_the_rows_adrift():
    difference = compare(recording(), changed(time=bumped("time", 9, 1e-6)))
    assert difference.rows == (50, 50, 50)
    assert [d.signal for d in difference.largest] == ["time"]


def test_signals_of_another_size_or_of_one_log_alone_are_named():
    base = recording()
    other = replace(
        base, signals={k: v for k, v in changed(u=base["x"]).signals.items() if k != "z_e"}
    )
    difference = compare(base, other)
    assert (difference.only_one, difference.only_other) == (("z_e",), ("u",))
    assert compare(base, recording(nodes=4)).reshaped == ("W_hat_u", "rbf_center")
    assert not difference.same


def test_how_a_run_ended_counts():
    difference = compare(recording(), recording(status="diverged", message="at t = 1"))
    assert difference.endings == {"status": ("finished", "diverged"), "message": ("", "at t = 1")}
    assert not difference.same


# --- causes


def test_every_key_of_the_scenario_counts():
    one = "name: a\ncontroller: {kind: pid, K_Pu: 1.0}\nvessel: {m: 2.0, source: tank}\n"
    other = "name: b\ncontroller: {kind: pid, K_Pu: 2.0}\nvessel: {m: 2.0}\nlog: {every: 1}\n"
    assert scenario_changes(one, other) == {
        "name": ("a", "b"),
        "controller.K_Pu": (1.0, 2.0),
        "vessel.source": ("tank", None),
        "log.every": (None, 1),
    }


def test_lists_differ_entry_by_entry():
    one = "disturbance:\n- {kind: wind, speed: 1.0}\n- {kind: waves, gamma: {a: [1, 2]}, seed: 1}\n"
    other = one.replace("seed: 1", "seed: 2")
    assert scenario_changes(one, other) == {"disturbance[1].seed": (1, 2)}
    longer = other + "- {kind: step}\n"
    assert scenario_changes(other, longer) == {"disturbance[2].kind": (None, "step")}
    assert scenario_changes("a: [1, 2]\n", "a: [1, 3]\n") == {"a": ((1, 2), (1, 3))}


def test_versions_count_and_moments_do_not():
    one = {"podusv": "1", "packages": {"numba": "1"}, "argv": ["a"], "started": "x", "git": None}
    other = {"podusv": "1", "packages": {"numba": "2"}, "argv": [], "started": "y", "git": {"c": 1}}
    assert version_changes(one, other) == {"packages.numba": ("1", "2")}
    deep = [{"a": {"b": {"c": number}}} for number in (1, 2)]
    assert version_changes(*deep) == {"a.b.c": (1, 2)}


def test_a_log_without_a_readable_scenario_is_damaged():
    for text in ("a: [1", "- 1\n"):
        with pytest.raises(StorageError, match="the scenario in a log is damaged"):
            scenario_changes("a: 1\n", text)


# --- the command


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return made(tmp_path_factory.mktemp("diff") / "first")


@pytest.fixture
def podusv(monkeypatch, capsys):
    return commanded(monkeypatch, capsys)


def test_a_copy_is_identical(run, tmp_path, podusv):
    said = podusv("diff", run, copied(run, tmp_path / "copy"))
    assert said == (0, "identical: scenario, metrics, log.h5 byte for byte\n", "")


@pytest.mark.parametrize(("name", "code"), [("law_ns", 0), ("iae", 3)])
def test_metrics_count_but_for_what_a_clock_measured(name, code, run, tmp_path, podusv):
    def change(content: bytes) -> bytes:
        told = json.loads(content)
        told["metrics"][name] = 12.5
        return json_text.encode(told)

    said = podusv("diff", run, copied(run, tmp_path / "copy", metrics_json=change))
    assert said.code == code
    assert f"\n{name} " in said.out
    assert ("identical" in said.out) == (code == 0)


def test_another_gain_moves_metrics_and_signals(run, tmp_path, podusv):
    other = made(tmp_path / "other", "controller.K_Pu=900")
    said = podusv("diff", run, other)
    assert said.code == 3
    assert "    controller.K_Pu 1100.0 -> 900.0\n" in said.out
    told = json.loads(podusv("diff", run, other, "--json").out)
    assert told["identical"] is False
    (pair,) = told["pairs"]
    numbers = [json.loads((f / "metrics.json").read_text())["metrics"]["iae"] for f in (run, other)]
    assert pair["metrics"]["iae"]["values"] == numbers
    change = numbers[1] / numbers[0] - 1
    assert pair["metrics"]["iae"]["relative"] == pytest.approx(change)
    assert pair["scenario"] == {"controller.K_Pu": [1100.0, 900.0]}


def test_comparisons_are_held_together_run_by_run(run, tmp_path, podusv):
    for name, labels in (("one", ("a", "b")), ("two", ("b", "c"))):
        for label in labels:
            copied(run, tmp_path / name / label)
        manifest.write(tmp_path / name, "finished")
    said = podusv("diff", tmp_path / "one", tmp_path / "two")
    assert said.code == 3
    assert said.out == (
        "b\nidentical: scenario, metrics, log.h5 byte for byte\n"
        f"only in {tmp_path / 'one'}: a\nonly in {tmp_path / 'two'}: c\n"
    )


def test_the_scenario_that_counts_is_the_one_in_the_log(run, tmp_path, podusv):
    other = copied(run, tmp_path / "copy", resolved_yaml=replaced("K_Pu: 1100.0", "K_Pu: 1.0"))
    assert podusv("diff", run, other).code == 0


def test_metrics_of_runs_of_unequal_length_are_warned_of(run, tmp_path, podusv):
    longer = made(tmp_path / "longer", "simulation.duration=0.6")
    said = podusv("diff", run, longer)
    warned = "the first run ends at 0.5 s, the second at 0.6 s: their metrics are about different"
    assert warned in " ".join(said.out.split())
    assert "ends at" not in podusv("diff", run, copied(run, tmp_path / "same")).out
