"""Damaged results: the manifest tells, or else the reader does; soon, in a line, and from no other
file.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from counts import count
from damages import FOREIGN, HDF5, OTHERS, PIPE, TEXTS, YAML
from damaging import __file__ as DAMAGING
from damaging import damaged
from rerun_samples import copied, made, relogged
from storage_samples import ENVIRONMENT, deadline, files

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
CALLS, MEMORY = 20_000_000, 300  # that opening a run may take; MiB
JSON = ("about.json", "metrics.json", "provenance.json", "theory.json")
UNREAD = ("scenario.yaml", "metrics.csv")
READ = ("log.h5", "resolved.yaml", *JSON)
FEW = ("log.h5", "theory.json")


class Outcome(NamedTuple):
    """What came of opening a damaged folder; negative `code` is a signal that ended the process."""

    word: str
    code: int
    said: str = ""
    calls: int = 0
    mebibytes: float = 0.0


class Opener:
    """Opens damaged copies of a run in a process that may die of it, and is then replaced."""

    def __init__(self, run: Path) -> None:
        self.run, self._process = run, self._started(run)

    def _started(self, run: Path) -> subprocess.Popen[str]:
        way = ":".join(map(str, Path(DAMAGING).parents[:3]))
        return subprocess.Popen(
            [sys.executable, DAMAGING, str(run)],
            text=True,
            env={**ENVIRONMENT, "PYTHONPATH": way},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def __call__(self, way: str, patience: int = 60) -> Outcome:
        if self._process.poll() is not None:
            self._process = self._started(self.run)
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(f"{way}\n")
        self._process.stdin.flush()
        try:
            with deadline(patience):
                answer = self._process.stdout.readline()
        except BaseException:
            self.close()
            raise
        return Outcome(*json.loads(answer)) if answer else Outcome("died", self._process.wait())

    def close(self) -> None:
        self._process.kill()
        self._process.communicate()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    place = tmp_path_factory.mktemp("damaged")
    os.mkfifo(place / PIPE)
    return made(place / "whole", text=SCENARIO)


@pytest.fixture(scope="module")
def opened(run):
    opener = Opener(run)
    yield opener
    opener.close()


def check(way: str, outcome: Outcome, *allowed: str) -> None:
    """Whether the outcome is one that is allowed, with little work and small."""
    assert outcome.word in allowed, (way, outcome)
    assert outcome.code == (0 if outcome.word == "same" else 5), (way, outcome)
    assert outcome.calls < CALLS, (way, outcome)
    assert outcome.mebibytes < MEMORY, (way, outcome)
    assert outcome.said.isprintable(), (way, outcome)  # on one line, too
    assert len(outcome.said) < 400, (way, outcome)


def size(run: Path, name: str = "log.h5") -> int:
    return (run / name).stat().st_size


def test_an_undamaged_run_is_opened(opened):
    assert opened("entry provenance.json argv [1]").word == "refused"
    assert opened("!entry provenance.json argv [1]").word == "same"


def test_a_log_cut_short_is_refused(opened, run):
    whole = size(run)
    step = 512 * count(max(1, whole // 512 // 8), 1)
    for length in [*range(0, whole, step), whole - 1]:
        for way in (f"cut log.h5 {length}", f"!cut log.h5 {length}"):
            check(way, opened(way), "refused")


def test_a_flipped_bit_is_told_by_the_manifest(opened):
    for name in ("manifest.json", *READ, *UNREAD):
        for seed in range(count(2, 300)):
            way = f"flip {name} {seed}"
            check(way, opened(way), "refused")


def test_a_flipped_bit_that_the_manifest_does_not_tell_ends_nothing(opened):
    """Only the manifest knows the numbers of a log; whoever alters both can write any number."""
    words = set()
    for seed in range(count(20, 2000)):
        way = f"!flip log.h5 {seed}"
        outcome = opened(way)
        words.add(outcome.word)
        assert outcome.word in ("refused", "same", "WRONG"), (way, outcome)
        assert outcome.code in (0, 5), (way, outcome)
        assert outcome.calls < CALLS, (way, outcome)
        assert outcome.mebibytes < MEMORY, (way, outcome)
    assert {"refused", "same"} <= words  # some bytes of the file mean nothing


@pytest.mark.parametrize("what", OTHERS)
def test_what_stands_in_place_of_a_file(opened, what):
    for name in count(FEW, (*READ, *UNREAD)):
        way = f"become {name} {what}"
        check(way, opened(way), "refused")
        harmless = name in UNREAD and what in ("empty", "zeros", "noise")
        check(f"!{way}", opened(f"!{way}"), "same" if harmless else "refused")
    if what != "nothing":  # without a manifest it is no run folder
        check(what, opened(f"become manifest.json {what}"), "refused")


@pytest.mark.parametrize("which", TEXTS)
def test_json_that_podusv_does_not_write(opened, which):
    for name in ("manifest.json", *count(JSON[-1:], JSON)):
        way = f"{'!' * (name in JSON)}text {name} {which}"
        check(way, opened(way), "refused")


WRONG = [
    "metrics.json metrics []",
    "metrics.json metrics drop",
    "metrics.json metrics.iae true",
    'metrics.json metrics.iae "1"',
    'theory.json windows {"a": 1}',
    "theory.json windows drop",
    'theory.json conditions [{"holds": false}]',
    "theory.json windows.whole.largest_V []",
    "about.json values {}",
    "about.json values.path 5",
    "about.json values.vessel drop",
    "about.json outages []",
    'about.json length "1"',
    "about.json law [5]",
    'about.json said {"disturbance.1": ""}',
    'theory.json windows.whole.corrected.bound "a"',
    "theory.json assumptions [[]]",
]


@pytest.mark.parametrize("what", WRONG)
def test_values_of_another_type(opened, what):
    check(what, opened(f"!entry {what}"), "refused")


@pytest.mark.parametrize("which", YAML)
def test_a_scenario_that_podusv_does_not_write(opened, which):
    check(which, opened(f"!yaml {which}"), "refused")


@pytest.mark.parametrize(
    "way", [*(f"hdf5 {which}" for which in HDF5), *(f"foreign {which}" for which in FOREIGN)]
)
def test_a_log_of_another_program(opened, way):
    check(way, opened(f"!{way}"), "refused")


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


@pytest.mark.parametrize("what", ["folder", "pipe", "empty", "noise"])
def test_a_damaged_table_of_a_comparison(comparison, what):
    table = comparison / "comparison.csv"
    table.unlink()
    OTHERS[what](table)
    with deadline(), pytest.raises(StorageError, match=r"comparison\.csv"):
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


@pytest.mark.parametrize(
    "way", ["cut log.h5 5000", "!text metrics.json nan", "become manifest.json pipe"]
)
def test_every_command_says_so_in_a_line_and_leaves_nothing(run, tmp_path, podusv, way):
    folder = run.with_name("commanded")
    damaged(run, folder, way)
    before = files(folder) if "pipe" not in way else {}
    for words in (
        ["plot", folder],
        ["plot", run, folder],
        ["compare", run, folder],
        ["rerun", folder],
        ["diff", run, folder],
    ):
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
