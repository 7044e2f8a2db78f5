"""Damaged runs, among others in a comparison: every command says so, and leaves nothing."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damages import OTHERS, PIPE
from damaging import damaged
from rerun_samples import copied, made, relogged
from storage_samples import deadline, files

from podusv_cli.core.errors import StorageError
from podusv_cli.storage import manifest
from podusv_cli.workflows import members

SCENARIO = """
name: whole
vessel: {preset: paper_nonlinear}
path: {kind: line_circle}
disturbance: {kind: harmonic}
actuator: {kind: saturated}
simulation: {duration: 0.1, compiled: false}
controller: {kind: adaptive_neural}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    place = tmp_path_factory.mktemp("damaged")
    os.mkfifo(place / PIPE)
    return made(place / "whole", text=SCENARIO)


# --- logs that are whole and yet not a run's


def _without(*names: str) -> Callable[[dict[str, Any]], None]:
    return lambda signals: [signals.pop(name) for name in names] and None


def _with(name: str, row: int, number: float) -> Callable[[dict[str, Any]], None]:
    return lambda signals: signals[name].__setitem__(row, number)


def _backwards(signals: dict[str, Any]) -> None:
    signals["time"] = np.ascontiguousarray(signals["time"][::-1])


UNSOUND = {
    "no position": (_without("x"), "it has no x"),
    "no demand": (_without("tau_r_cmd"), "it has no tau_r_cmd"),
    "no terms": (_without("V_W_u"), "it has no V_W_u"),
    "not a number": (_with("psi", 3, np.nan), "psi holds something that is no finite number"),
    "infinite time": (_with("time", -1, np.inf), "time holds something that is no finite"),
    "beyond the engine": (_with("y", 0, -1e305), "y holds something that is no finite number"),
    "backwards": (_backwards, "its times do not increase"),
    "twice": (_with("time", 3, 0.02), "its times do not increase"),
}


@pytest.mark.parametrize("case", UNSOUND)
def test_a_log_that_lacks_what_every_run_has(run, tmp_path, case):
    change, words = UNSOUND[case]
    other = copied(run, tmp_path / "other", log_h5=relogged(run, change))
    with pytest.raises(StorageError, match=words):
        members.from_folder(other)


def test_a_law_is_not_timed_with_the_memory_of_another(run, tmp_path):
    # In machine code it would read beyond the end of what it remembers.
    def shorter(signals: dict[str, Any]) -> None:
        for name in ("W_hat_u", "W_hat_r"):
            del signals[name]

    other = copied(run, tmp_path / "other", log_h5=relogged(run, shorter))
    assert members.from_folder(other)  # it can be drawn
    with pytest.raises(StorageError, match="W_hat_u does not have 27 values in a row"):
        members.comparable(other)


# --- comparisons


@pytest.fixture
def comparison(run, tmp_path):
    for label in ("a", "b"):
        copied(run, tmp_path / "two" / label)
    (tmp_path / "two/comparison.csv").write_text("metric,unit,b,a\niae,m s,1,2\n")
    manifest.write(tmp_path / "two", "finished")
    return tmp_path / "two"


def labels(folder: Path) -> list[str]:
    return [part.label for part in members.from_folder(folder)]


@pytest.mark.parametrize("what", [w for w in OTHERS if w != "hole"])
def test_a_damaged_table_of_a_comparison(comparison, what):
    table = comparison / "comparison.csv"
    table.unlink()
    OTHERS[what](table)
    with deadline(), pytest.raises(StorageError, match=r"comparison\.csv"):
        members.from_folder(comparison)


@pytest.mark.parametrize("content", [b"\xff", b"a" * 200_000, b"a" * 20_000_000])
def test_a_table_of_another_program(comparison, content):
    (comparison / "comparison.csv").write_bytes(content)
    manifest.write(comparison, "finished")
    with pytest.raises(StorageError, match=r"comparison\.csv"):
        members.from_folder(comparison)


def test_a_run_that_a_comparison_has_lost_is_missed(comparison):
    (comparison / "a/log.h5").unlink()
    with pytest.raises(StorageError, match=r"a/log\.h5 is missing"):
        members.from_folder(comparison)


def test_links_among_runs_do_not_count(run, comparison):
    (comparison / "c").symlink_to(run)
    assert labels(comparison) == ["b", "a"]
    (comparison / "manifest.json").unlink()
    assert labels(comparison) == ["a", "b"]


def test_a_log_that_is_no_file_is_no_reason_to_overlook_its_run(comparison):
    (comparison / "manifest.json").unlink()
    (comparison / "a/log.h5").unlink()
    os.mkfifo(comparison / "a/log.h5")
    with pytest.raises(StorageError, match=r"log\.h5"):
        members.from_folder(comparison)


# --- commands


WAYS = [
    "cut log.h5 5000", "!hdf5 external", "!text metrics.json nan", "!text theory.json same",
    "!yaml extends", "become manifest.json pipe",
]  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_every_command_says_so_in_a_line_and_leaves_nothing(run, tmp_path, podusv, way):
    folder = run.with_name("commanded")
    damaged(run, folder, way)
    before = files(folder) if "pipe" not in way else {}
    for words in (["plot", folder], ["plot", run, folder], ["compare", run, folder],
                  ["rerun", folder], ["diff", run, folder]):  # fmt: skip
        with deadline():
            said = podusv(*words)
        assert (said.code, said.out) == (5, ""), (words, said)
        assert said.err.count("\n") == 1, said.err
        assert str(folder) in said.err
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]
    assert before == (files(folder) if "pipe" not in way else {})


def test_a_run_folder_is_no_scenario_damaged_or_not(run, podusv):
    folder = run.with_name("commanded")
    damaged(run, folder, "become log.h5 pipe")
    for path in (run, folder):
        said = podusv("validate", path)
        assert said.code == 2
        assert said.err.count("\n") == 1
