"""Damaged results: the manifest tells, or else the reader does; soon, in a line, and from no other
file."""

import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from counts import count
from damages import FOREIGN, HDF5, OTHERS, PIPE, TEXTS, YAML
from damaging import __file__ as DAMAGING
from rerun_samples import made
from storage_samples import ENVIRONMENT, deadline

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
JSON = ("metrics.json", "provenance.json", "theory.json")
UNREAD = ("scenario.yaml", "metrics.csv")
READ = ("log.h5", "resolved.yaml", *JSON)
FEW = ("log.h5", "resolved.yaml", "theory.json", "metrics.csv")  # one of each sort
LENGTHY = ("comments", "lines", "many", "wide", "keys")  # take seconds to read


def unless_lengthy(ways: Iterable[str]) -> list[Any]:
    """All ways; those that take long are slow tests."""
    return [pytest.param(way, marks=[pytest.mark.slow] * (way in LENGTHY)) for way in ways]


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
            [sys.executable, DAMAGING, str(run)], text=True, env={**ENVIRONMENT, "PYTHONPATH": way},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

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


def check(way: str, found: Outcome, *allowed: str) -> None:
    """Whether the outcome is one that is allowed, with little work and small."""
    assert found.word in allowed, (way, found)
    assert found.code == (0 if found.word == "same" else 5), (way, found)
    assert found.calls < CALLS, (way, found)
    assert found.mebibytes < MEMORY, (way, found)
    assert found.said.isprintable(), (way, found)  # on one line, too
    assert len(found.said) < 400, (way, found)


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
        found = opened(way)
        words.add(found.word)
        assert found.word in ("refused", "same", "WRONG"), (way, found)
        assert found.code in (0, 5), (way, found)
        assert found.calls < CALLS, (way, found)
        assert found.mebibytes < MEMORY, (way, found)
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


@pytest.mark.parametrize("which", unless_lengthy(TEXTS))
def test_json_that_podusv_does_not_write(opened, which):
    check(which, opened(f"text manifest.json {which}"), "refused")
    large = which in ("wide", "keys")
    for name in JSON[-1:] if large else count(JSON[-1:], JSON):
        way = f"!text {name} {which}"
        check(way, opened(way), "same" if large else "refused")


WRONG = [
    *(f"metrics.json metrics {value}" for value in ("[]", "1", "null", "drop")),
    *(f"metrics.json metrics.iae {value}" for value in ("true", '"1"', "[1]", "{}", '"nan"')),
    *(f"theory.json windows {value}" for value in ("[]", "1", "null", '{"a": 1}', "drop")),
    *(f"theory.json conditions {value}" for value in ("1", "[1]", '[{"holds": false}]', "drop")),
    "theory.json conditions [{}]", "theory.json windows.whole.largest_V []",
    'theory.json windows.whole.corrected.bound "a"', "theory.json assumptions [[]]",
]  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_values_of_another_type(opened, what):
    check(what, opened(f"!entry {what}"), "refused")


@pytest.mark.parametrize("which", unless_lengthy(YAML))
def test_a_scenario_that_podusv_does_not_write(opened, which):
    check(which, opened(f"!yaml {which}"), "same" if which == "comments" else "refused")


@pytest.mark.parametrize(
    "way", [*(f"hdf5 {which}" for which in HDF5), *(f"foreign {which}" for which in FOREIGN)]
)
def test_a_log_of_another_program(opened, way):
    check(way, opened(f"!{way}"), "refused")
