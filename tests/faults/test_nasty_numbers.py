"""Every numeric key of every shipped scenario takes numbers that nobody would give it.

Whatever comes of it is told in words: no traceback, no exit code 1, and in time.
"""

import io
import os
import random
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from multiprocessing import get_context
from typing import Any, NamedTuple

import pytest
import yaml
from command_samples import ROOT
from counts import count

from podusv_cli import cli
from podusv_cli.process.workers import available_workers
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.storage import provenance
from podusv_cli.workflows.execute import warm_up

VALUES = (
    "0",
    "-0.0",
    "5e-324",
    "1e-300",
    "1e-9",
    "-1.0",
    "1e9",
    "1e30",
    "1e150",
    "1e200",
    "1.7e308",
    "-1e308",
)
SHORT = "simulation.duration=0.5"
EXTENDED = ("claims.yaml", "ablation_laws.yaml")  # no scenarios in themselves
PARTS = [
    *(ROOT / "configs/mu_2017" / name for name in EXTENDED),
    *(ROOT / "configs").rglob("base.yaml"),
    *(ROOT / "configs").glob("bench*/**/*.yaml"),
]
MOST = count(16, 10**9)  # commands
COMPARED, DRAWN = 100, 10  # one command in so many compares, or draws figures as well
SECONDS = count(10**9, 10)  # of the processor; no test of `make test` takes the time
HANGS = 600.0  # s
FINE = (0, 2, 3, 4)


class Try(NamedTuple):
    """A scenario with one number in it."""

    config: str
    key: str
    value: str


class Found(NamedTuple):
    """What a command came to."""

    words: tuple[str, ...]
    code: object
    err: str
    seconds: float


DIVERGING = Try("configs/mu_2017/printed_from_zero.yaml", "simulation.duration", "0.5")


def tries() -> Iterator[Try]:
    """All of them; of scenarios that differ in words alone, one."""
    seen = set()
    for path in sorted((ROOT / "configs").rglob("*.yaml")):
        if path in PARTS:
            continue
        tree = yaml.safe_load(resolved_yaml(load(path).scenario.alone()))
        for words in ("name", "description", "claims", "controllers", "silence", "metrics"):
            tree.pop(words, None)
        if (text := str(tree)) not in seen:
            seen.add(text)
            config = str(path.relative_to(ROOT))
            yield from (Try(config, key, value) for key in numeric(tree) for value in VALUES)


def numeric(tree: Any, above: tuple[str, ...] = ()) -> Iterator[str]:
    """Dotted paths of all numbers."""
    if isinstance(tree, dict | list):
        pairs = tree.items() if isinstance(tree, dict) else enumerate(tree)
        for key, inner in pairs:
            yield from numeric(inner, (*above, str(key)))
    elif isinstance(tree, int | float) and not isinstance(tree, bool):
        yield ".".join(above)


def words(number: int, one: Try) -> tuple[str, ...]:
    """The command for a try."""
    compares = number % COMPARED == 0 and bool(load(ROOT / one.config).scenario.controllers)
    short = () if one.key == "simulation.duration" else ("--set", SHORT)
    change = ("--set", f"{one.key}={one.value}")
    drawn = () if number % DRAWN == 0 and not compares else ("--no-figures",)
    command = "compare" if compares else "run"
    return (command, str(ROOT / one.config), *short, *change, "-q", "--force", *drawn, "--out")


def careless() -> None:
    """For processes whose results are thrown away: sync nothing, ask nobody."""
    os.fsync = lambda _: None
    provenance.collect = lambda *_: {}


def attempt(given: tuple[str, ...]) -> Found:
    """Run a command in this process."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
    code, began = None, time.process_time()
    sys.argv = ["podusv", *given, f"out-{os.getpid()}"]
    with redirect_stdout(out), redirect_stderr(err):
        try:
            cli.main()
        except SystemExit as ended:
            code = ended.code
    err.seek(0)
    return Found(given, code, err.read(), time.process_time() - began)


def fault(found: Found) -> str:
    """What is wrong with how a command ended; empty where nothing is."""
    if found.code not in FINE or "Traceback" in found.err:
        return f"{found.code}: {found.err[-1500:]}"
    if not found.err and found.code:
        return f"{found.code} without a word"
    lacks = [line for line in found.err.splitlines() if "could not be made" in line]
    if lost := [line for line in lacks if "figure " not in line]:  # no axis is as long as a float
        return lost[0]
    return f"{found.seconds:.1f} s" if found.seconds > SECONDS else ""


@pytest.mark.slow
def test_no_number_ends_in_a_traceback(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    every = list(tries())
    chosen = [DIVERGING, *random.Random(1).sample(every, min(MOST, len(every)))]
    for config in sorted({one.config for one in chosen}):
        warm_up(Case.of(load(ROOT / config).scenario.alone()))  # here, and not in every process
    commands = [words(number, one) for number, one in enumerate(chosen)]
    fork = get_context("fork")
    with ProcessPoolExecutor(available_workers(), mp_context=fork, initializer=careless) as pool:
        found = list(pool.map(attempt, commands, chunksize=4, timeout=HANGS + 0.5 * len(commands)))
    wrong = [f"podusv {' '.join(one.words)}\n{told}" for one in found if (told := fault(one))]
    assert not wrong, "\n\n".join(wrong[:20])
    assert {one.code for one in found} >= {0, 2, 4}
