"""Faults planted in podusv, each with a test that has to fail with it: what the tests prove.

    python -m benchmarks.mutants [--room NAME] [--only N] [--list] [--sound] [-n WORKERS]

One fault of `mutant_table.py` at a time is planted in a temporary copy of the checkout, and its
test runs there. Fault and test are searched for by their text, so code and tests may move to other
files. Exit code 1 where a fault survives that is not marked so, or where fault or test is missing.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

from benchmarks.mutant_table import SURVIVES, TABLE

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGE, TESTS = "podusv_cli", "tests"
CODE = {".py", ".js"}
LIMIT = 600  # s; a test that takes longer with a fault has noticed it
KILLED, SURVIVED, EXPECTED = "killed", "SURVIVED", "survives as marked"
GONE, AMBIGUOUS, UNTESTED = "GONE", "AMBIGUOUS", "NO SUCH TEST"
PASSES, FAILS = "passes", "FAILS WITHOUT IT"
FINE = {KILLED, EXPECTED, PASSES}
WITH_FAULT, WITHOUT = {0: SURVIVED, 1: KILLED}, {0: PASSES, 1: FAILS}  # by pytest's exit code


@dataclass(frozen=True)
class Mutant:
    """A fault: a text that stands once in the package, the text in its place, and its test.

    `test` are words for pytest's option -k, the first of them the name of a test function.
    """

    number: int
    room: str
    old: str
    new: str
    test: str
    survives: bool  # today: no test is known that fails with it

    def __str__(self) -> str:
        """Number, room and change, on one line."""
        change = " ".join(f"{self.old} -> {self.new or '(nothing)'}".split())
        return f"{self.number:3d} {self.room:13s} {change}"


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant: a word, the time [s], and what pytest printed."""

    mutant: Mutant
    word: str
    seconds: float = 0.0
    output: str = ""

    def __str__(self) -> str:
        """One line; more where it is not as it should be."""
        line = f"{self.word:18s} {self.seconds:5.1f} s  {self.mutant}"
        return line if self.word in FINE else f"{line}\n{self.output[-1500:]}{self.mutant.test}"


def mutants() -> list[Mutant]:
    """All of the table, numbered from 1 in its order."""
    rows = [(room, row) for room, rows in TABLE.items() for row in rows]
    return [
        Mutant(number, room, old, new, test.removeprefix(SURVIVES), test.startswith(SURVIVES))
        for number, (room, (old, new, test)) in enumerate(rows, 1)
    ]


def copied(folder: Path) -> Path:
    """A copy of the checkout's files in this folder: those of git, and new ones not ignored."""
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listing, cwd=CHECKOUT, check=True, capture_output=True).stdout
    for name in filter(None, names.decode().split("\0")):
        source, target = CHECKOUT / name, folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if os.path.lexists(source):  # else it was deleted since the last commit
            shutil.copy2(source, target, follow_symlinks=False)
    return folder


def holding(folder: Path, text: str) -> list[Path]:
    """The file of every occurrence of a text in the code of a folder."""
    code = (path for path in sorted(folder.rglob("*")) if path.suffix in CODE)
    counts = {path: path.read_text().count(text) for path in code}
    return [path for path, count in counts.items() for _ in range(count)]


def tried(mutant: Mutant, copy: Path, cache: Path, *, planted: bool) -> Outcome:
    """What the mutant's test says in a copy of the checkout, with the fault in it or without."""
    places = holding(copy / PACKAGE, mutant.old)
    tests = holding(copy / TESTS, f"def {mutant.test.split()[0]}(")
    if len(places) != 1:
        return Outcome(mutant, AMBIGUOUS if places else GONE)
    if not tests:
        return Outcome(mutant, UNTESTED)
    place, began = places[0], time.monotonic()
    sound = place.read_text()
    try:
        place.write_text(sound.replace(mutant.old, mutant.new) if planted else sound)
        code, output = _pytest(tests, mutant.test, copy, cache)
    finally:
        place.write_text(sound)
    word = (WITH_FAULT if planted else WITHOUT).get(code, UNTESTED)
    word = EXPECTED if mutant.survives and word == SURVIVED else word
    return Outcome(mutant, word, time.monotonic() - began, output)


def _pytest(files: list[Path], words: str, copy: Path, cache: Path) -> tuple[int, str]:
    """Exit code and output of pytest; 1 where it takes too long, or a signal ends it."""
    environment = os.environ | {"PYTHONPATH": str(copy), "PODUSV_CACHE": str(cache)}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    command += ["-m", "not browser"]  # slow ones, too
    try:
        done = subprocess.run(
            [*command, *map(str, files), "-k", words],
            cwd=copy,
            env=environment,
            capture_output=True,
            text=True,
            timeout=LIMIT,
        )
    except subprocess.TimeoutExpired:
        return 1, f"longer than {LIMIT} s\n"
    return done.returncode if done.returncode >= 0 else 1, done.stdout + done.stderr


def outcomes(chosen: list[Mutant], workers: int, *, planted: bool) -> Iterator[Outcome]:
    """The outcome of each mutant in their order, several at a time, each in a copy of its own."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        cache, free = Path(folder, "cache"), Queue[Path]()
        for number in range(workers):
            free.put(copied(Path(folder, str(number))))

        def attempt(mutant: Mutant) -> Outcome:
            copy = free.get()
            try:
                return tried(mutant, copy, cache, planted=planted)
            finally:
                free.put(copy)

        yield from pool.map(attempt, chosen)


def main() -> int:
    """Print a line a mutant and a count; the exit code."""
    parser = argparse.ArgumentParser(description="plant faults and see whether tests fail")
    parser.add_argument("--room", choices=TABLE, help="only the faults of this room")
    parser.add_argument("--only", type=int, metavar="N", help="only the fault with this number")
    parser.add_argument("--list", action="store_true", help="list the faults and their tests")
    parser.add_argument("--sound", action="store_true", help="run the tests without the faults")
    parser.add_argument("-n", type=int, default=2, metavar="WORKERS", help="at a time; default 2")
    options = parser.parse_args()
    chosen = [
        mutant
        for mutant in mutants()
        if options.room in (None, mutant.room) and options.only in (None, mutant.number)
    ]
    if options.list:
        print(*(f"{mutant}\n    {mutant.test}" for mutant in chosen), sep="\n")
        return 0
    began, bad = time.monotonic(), 0
    for outcome in outcomes(chosen, options.n, planted=not options.sound):
        print(outcome, flush=True)
        bad += outcome.word not in FINE
    print(f"{len(chosen)} faults, {bad} not as they should be, {time.monotonic() - began:.0f} s")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
