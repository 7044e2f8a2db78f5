"""Shipped scenarios and a sweep, spoilt at random: sound, or told in words with little work."""

import random
import re
import resource
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from command_samples import ROOT
from counting import counted
from counts import count
from storage_samples import deadline

from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core.errors import ScenarioError
from podusv_cli.scenario.load import load
from podusv_cli.studies.making.cells import cells
from podusv_cli.studies.making.check import singles, sweep_faults
from podusv_cli.studies.making.invalid import invalid_runs

CONFIGS = ROOT / "configs"
MEBIBYTE = 1024 if sys.platform == "linux" else 1024**2  # in units of ru_maxrss
SEED = 20260301
CALLS, MEMORY = 10_000_000, 200  # each; a sound study of 14 laws takes 4.1 million; MiB
ODD = [
    *("no", "yes", "017", "1:30", "1e-3", "1_000", "0x1F", "1e999", "-1e999", ".nan", ".inf"),
    *("~", "null", "[]", "{}", "[[]]", "*a", "&a 1", "!!python/object:x {}", "'", '"', "|", ">"),
    *("0", "-0.0", "-1", "1e-320", "1e300", "9" * 40, "9" * 5000, "true", "[1, 2, 3]", "{a: b}"),
    *("%", "@", "\t", "#", "---", "...", "<<: {a: 1}", "? a", "- ", "é", "\ufeff", "\x00", "\x85"),
    *('"\\ud800"', '"\\U99999999"', "\U0001f6a2", "\u202e", "a" * 3000, "../../etc/passwd", "/"),
    *("kind", "extends", "controllers", "claims", "__class__", "{kind: pid}", "{preset: paper}"),
]
MANY = [part * 3000 for part in ("[", "{a: ", "- ", "? ", "(", "not ", " ", "1,")]
Mutation = Callable[[random.Random, bytearray], None]


def flip_a_bit(draw: random.Random, data: bytearray) -> None:
    data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)


def cut_out(draw: random.Random, data: bytearray) -> None:
    at = draw.randrange(len(data))
    del data[at : at + draw.choice([1, 9, 40, len(data)])]


def put_in(draw: random.Random, data: bytearray) -> None:
    at = draw.randrange(len(data))
    data[at:at] = draw.choice(draw.choice([ODD, MANY])).encode("utf-8", "surrogatepass")


def move_a_line(draw: random.Random, data: bytearray) -> None:
    """A line, also of another scenario, is copied elsewhere and perhaps indented otherwise."""
    lines = bytes(data).splitlines(keepends=True)
    other = draw.choice(sorted(CONFIGS.rglob("*.yaml"))).read_bytes().splitlines(keepends=True)
    line = b" " * draw.randrange(5) + draw.choice([*lines, *other])
    lines.insert(draw.randrange(len(lines)), line)
    data[:] = b"".join(lines)


def instead_of(pattern: bytes) -> Mutation:
    """Give the first group of one place that matches an odd value."""

    def mutation(draw: random.Random, data: bytearray) -> None:
        places = list(re.finditer(pattern, bytes(data)))
        if places:
            first, last = draw.choice(places).span(1)
            data[first:last] = draw.choice(ODD).encode("utf-8", "surrogatepass")

    return mutation


OF_VALUES = [instead_of(rb": ([^][{},#:\n]+)"), instead_of(rb"(-?\d[\d.]*)")]
MUTATIONS = [flip_a_bit, cut_out, put_in, move_a_line, instead_of(rb": ([^\n]*)"), *OF_VALUES * 2]


def mutated(draw: random.Random, text: bytes, mutations: Sequence[Mutation], most: int) -> bytes:
    """The text after one to so many mutations."""
    data = bytearray(text)
    for _ in range(draw.randrange(1, most + 1)):
        if data:
            draw.choice(mutations)(draw, data)
    return bytes(data)


def verdict(path: Path) -> str:
    """`ok`, or the lines that every command would print instead of running it."""
    try:
        loaded = load(path, (), [sweep_faults])
        parse_claims(loaded)
        made = [cell.scenario for cell in cells(loaded, sweep_faults)]
        if sweep := loaded.scenario.sweep:
            runs = [single for scenario in made for single in singles(scenario).values()]
            invalid_runs(runs, sweep, 20 * len(runs))
    except ScenarioError as error:
        return str(error)
    return "ok"


def check(path: Path, data: bytes) -> str:
    """What is said of the text; asserts what holds for every text."""
    path.write_bytes(data)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with deadline():
        said, calls = counted(lambda: verdict(path))
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory) / MEBIBYTE
    assert calls < CALLS, f"{calls} calls for {data!r}"
    assert grown < MEMORY, f"{grown:.0f} MiB for {data!r}"
    assert said.strip(), f"nothing said of {data!r}"
    assert all(line.isprintable() for line in said.splitlines()), f"{said!r} for {data!r}"
    return said


# Every key of a sweep, and every way to draw.
SWEEP = b"""\
extends: corrected.yaml
controllers: {proposed: {kind: adaptive_neural}, pid: {kind: pid}}
simulation: {duration: 1.0}
sweep:
  seed: 1
  draws: 50
  design: random
  laws: [proposed, pid]
  vary:
    vessel.m: {times: {uniform: [0.7, 1.3]}}
    damping: {keys: [vessel.X_u, vessel.Y_v], times: {lognormal: {sigma: 0.1, within: [0.6, 1.6]}}}
    start.x: {plus: {normal: {mean: 1.0, sigma: 3.0, within: [-9, 9]}}}
    start.y: {triangular: [-20, -10, 0]}
    start.psi: {angle: all}
    path.reading: {choice: [velocity, sine]}
    path.switch: {plus: {integers: [-3, 3]}}
    controller.k_ze: {choice: [0.1, 0.2]}
  grid:
    disturbance.scale: [0.5]
    path: [{speed: 0.4}, {kind: line_circle, amplitude: 0.4}]
  success: finished and z_e_steady <= 1.5
  level: 0.95
  keep: {failed: 3, worst: {iae: 2}, draws: [0, 1]}
  claims:
    S1: {says: a, source: b, expect: share(proposed.iae < pid.iae) >= 0.95, tolerance: 0.01}
"""
# Keys with which something is found to be wrong: soon, and in the long run.
TOLD = {
    "scenarios": (
        ("vessel", "path", "disturbance", "simulation", "controller", "controllers", "claims"),
        (
            "start",
            "actuator.pods",
            "vessel.m",
            "vessel.preset",
            "path.kind",
            "actuator.kind",
            "actuator.pods[0].x",
            "controller.network",
            "metrics",
            "log",
        ),
    ),
    "sweeps": (
        ("sweep", "sweep.vary"),
        (
            "sweep.vary.damping.times.lognormal",
            "sweep.laws",
            "sweep.grid",
            "sweep.keep",
            "sweep.vary.vessel.m",
            "sweep.claims.S1",
            "sweep.success",
            "path",
        ),
    ),
}


@pytest.mark.slow
@pytest.mark.usefixtures("tidy")
@pytest.mark.parametrize("what", TOLD)
def test_spoilt_files_are_told_and_nothing_else(tmp_path, what):
    shutil.copytree(CONFIGS, tmp_path / "configs")
    draw, paper = random.Random(SEED), tmp_path / "configs/mu_2017"
    files, tries, mutations = (
        sorted((tmp_path / "configs").rglob("*.yaml")),
        count(200, 10_000),
        MUTATIONS,
    )
    if what == "sweeps":
        (paper / "sweep.yaml").write_bytes(SWEEP)
        files, tries = [paper / "sweep.yaml"], count(30, 2000)
        mutations = [*MUTATIONS, *OF_VALUES * 15]
    assert verdict(paper / f"{'sweep' if what == 'sweeps' else 'corrected'}.yaml") == "ok"
    said = []
    for file in draw.choices(files, k=tries):
        text = mutated(draw, file.read_bytes(), mutations, 2 if what == "sweeps" else 4)
        said.append(check(file.with_name("spoilt.yaml"), text))
    assert tries / 30 < said.count("ok") < tries / 1.5  # it is neither always spoilt nor never
    told = set(re.findall(r": ([a-z][\w.\[\]]*): ", "\n".join(said)))
    reached = {key[:end] for key in told for end in range(1, len(key) + 1)}
    soon, late = TOLD[what]
    assert reached >= {*soon, *count((), late)}
