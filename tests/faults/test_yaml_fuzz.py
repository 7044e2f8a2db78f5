"""Shipped scenarios, spoilt at random: each is sound or a scenario error, with little work."""

import random
import re
import resource
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import islice
from pathlib import Path

import pytest
from counting import counted
from counts import count
from storage_samples import deadline

import podusv_cli
from podusv_cli.comparison.claims import parse_claims
from podusv_cli.core.errors import ScenarioError
from podusv_cli.scenario.load import load
from podusv_cli.studies.study.cells import cells
from podusv_cli.studies.study.check import singles, sweep_faults
from podusv_cli.studies.study.invalid import invalid_draws

CONFIGS = Path(podusv_cli.__file__).parents[1] / "configs"
MEBIBYTE = 1024 if sys.platform == "linux" else 1024**2  # in units of ru_maxrss
SEED = 20260301
CALLS, MEMORY = 3_000_000, 200  # each; MiB
ODD = [
    *("no", "yes", "017", "1:30", "1e-3", "1_000", "0x1F", "1e999", "-1e999", ".nan", ".inf"),
    *("~", "null", "[]", "{}", "[[]]", "*a", "&a 1", "!!python/object:x {}", "'", '"', "|", ">"),
    *("0", "-0.0", "-1", "1e-320", "1e300", "9" * 40, "9" * 5000, "true", "[1, 2, 3]", "{a: b}"),
    *("%", "@", "\t", "#", "---", "...", "<<: {a: 1}", "? a", "- ", "é", "\ufeff", "\x00", "\x85"),
    *('"\\ud800"', '"\\U99999999"', "\U0001f6a2", "\u202e", "a" * 3000, "../../etc/passwd", "/"),
    *("kind", "extends", "controllers", "claims", "__class__", "{kind: pid}", "{preset: paper}"),
]
Mutation = Callable[[random.Random, bytearray], None]


def _spot(draw: random.Random, data: bytearray) -> int:
    return draw.randrange(len(data) + 1)


def flip_a_bit(draw: random.Random, data: bytearray) -> None:
    if data:
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)


def cut_out(draw: random.Random, data: bytearray) -> None:
    at = _spot(draw, data)
    del data[at : at + draw.randrange(1, 40)]


def cut_off(draw: random.Random, data: bytearray) -> None:
    del data[_spot(draw, data) :]


def put_in(draw: random.Random, data: bytearray) -> None:
    at = _spot(draw, data)
    data[at:at] = draw.choice(ODD).encode("utf-8", "surrogatepass")


def put_in_many(draw: random.Random, data: bytearray) -> None:
    at = _spot(draw, data)
    data[at:at] = draw.choice([b"[", b"{a: ", b"- ", b"? ", b"(", b"not ", b" ", b"1,"]) * 3000


def copy_a_part(draw: random.Random, data: bytearray) -> None:
    at, to = _spot(draw, data), _spot(draw, data)
    data[to:to] = data[at : at + draw.randrange(1, 400)]


def _lines(change: Callable[[random.Random, list[bytes], int], None]) -> Mutation:
    def mutation(draw: random.Random, data: bytearray) -> None:
        lines = bytes(data).splitlines(keepends=True)
        if lines:
            change(draw, lines, draw.randrange(len(lines)))
            data[:] = b"".join(lines)

    return mutation


def _indent(draw: random.Random, lines: list[bytes], at: int) -> None:
    lines[at] = b" " * draw.randrange(1, 5) + lines[at]


def _swap(draw: random.Random, lines: list[bytes], at: int) -> None:
    other = draw.randrange(len(lines))
    lines[at], lines[other] = lines[other], lines[at]


def _give_another_value(draw: random.Random, lines: list[bytes], at: int) -> None:
    odd = draw.choice(ODD).encode("utf-8", "surrogatepass")
    lines[at] = re.sub(rb":[^:\n]*", lambda _: b": " + odd, lines[at], count=1)


def _give_another_inner_value(draw: random.Random, lines: list[bytes], at: int) -> None:
    """Of lists and mappings on one line: pods, gains, vessels."""
    inner = list(re.finditer(rb"\w+: ([^][{},#\n]+)", lines[at]))
    if inner:
        first, last = draw.choice(inner).span(1)
        odd = draw.choice(ODD).encode("utf-8", "surrogatepass")
        lines[at] = lines[at][:first] + odd + lines[at][last:]


def _give_another_number(draw: random.Random, lines: list[bytes], at: int) -> None:
    """Of lists, too."""
    numbers = list(re.finditer(rb"-?\d[\d.]*", lines[at]))
    if numbers:
        first, last = draw.choice(numbers).span()
        odd = draw.choice(ODD).encode("utf-8", "surrogatepass")
        lines[at] = lines[at][:first] + odd + lines[at][last:]


def _bring_in_another(draw: random.Random, lines: list[bytes], at: int) -> None:
    """A line of any shipped scenario."""
    lines.insert(at, draw.choice(_shipped_lines()))


def _twice(draw: random.Random, lines: list[bytes], at: int) -> None:
    lines.insert(at, lines[at])


MUTATIONS: list[Mutation] = [
    flip_a_bit, cut_out, cut_off, put_in, put_in_many, copy_a_part,
    *map(_lines, (_indent, _swap, _give_another_value, _give_another_value, _twice)),
    *map(_lines, (_give_another_inner_value, _give_another_inner_value, _bring_in_another)),
]  # fmt: skip
# Keys with which something is found to be wrong: soon, and in the long run.
SOON = ("vessel", "path", "disturbance", "simulation", "controller", "controllers", "claims",
        "extends")  # fmt: skip
LATE = ("start", "actuator.pods", "vessel.m", "vessel.X_udot", "vessel.preset", "path.kind",
        "disturbance.kind", "actuator.preset", "actuator.kind", "actuator.pods[0].x",
        "actuator.pods[0].T_nn", "controller.anti_windup", "controller.network", "metrics",
        "log")  # fmt: skip


@cache
def _shipped_lines() -> list[bytes]:
    files = sorted(CONFIGS.rglob("*.yaml"))
    return [line for file in files for line in file.read_bytes().splitlines(keepends=True)]


def spoilt(seed: int) -> Iterator[tuple[Path, bytes]]:
    """For ever: a shipped scenario and its text after one to four mutations."""
    draw = random.Random(seed)
    files = sorted(CONFIGS.rglob("*.yaml"))
    while True:
        file = draw.choice(files)
        yield file.relative_to(CONFIGS), mutated(draw, file.read_bytes())


def mutated(
    draw: random.Random, text: bytes, mutations: Sequence[Mutation] = MUTATIONS, most: int = 4
) -> bytes:
    """The text after one to so many mutations."""
    data = bytearray(text)
    for _ in range(draw.randrange(1, most + 1)):
        draw.choice(mutations)(draw, data)
    return bytes(data)


def verdict(path: Path) -> str:
    """`ok`, or the lines that every command would print instead of running it."""
    try:
        loaded = load(path, (), [sweep_faults])
        parse_claims(loaded)
        made = [cell.scenario for cell in cells(loaded, sweep_faults)]
        if sweep := loaded.scenario.sweep:
            runs = [one for scenario in made for one in singles(scenario).values()]
            invalid_draws(runs, sweep, min(sweep.draws, 20))
    except ScenarioError as error:
        return str(error)
    return "ok"


def check(folder: Path, name: Path, data: bytes) -> str:
    """What is said of the text; asserts what holds for every text."""
    path = folder / name.parent / "spoilt.yaml"
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


@pytest.mark.slow
@pytest.mark.usefixtures("tidy")
def test_spoilt_scenarios_are_told_and_nothing_else(tmp_path):
    whole = verdict(CONFIGS / "paper" / "corrected.yaml")  # imports and tables are made once
    assert whole == "ok"
    shutil.copytree(CONFIGS, tmp_path / "configs")
    tries = count(200, 10_000)
    said = [check(tmp_path / "configs", *one) for one in islice(spoilt(SEED), tries)]
    assert tries / 30 < said.count("ok") < tries / 1.5  # it is neither always spoilt nor never
    told = set(re.findall(r": ([a-z][\w.\[\]]*): ", "\n".join(said)))
    reached = {key[:end] for key in told for end in range(1, len(key) + 1)}
    assert reached >= {*SOON, *(LATE if tries > 200 else ())}


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
OF_VALUES = [
    *MUTATIONS, *[_lines(_give_another_inner_value)] * 10, *[_lines(_give_another_number)] * 20
]  # fmt: skip
TOLD_OF_SWEEPS = (
    "sweep", "sweep.vary", "sweep.vary.damping.times.lognormal", "sweep.laws", "sweep.grid",
    "sweep.vary.vessel.m", "sweep.keep", "sweep.claims.S1", "sweep.success", "path",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.usefixtures("tidy")
def test_spoilt_sweeps_are_told_and_nothing_else(tmp_path: Path) -> None:
    shutil.copytree(CONFIGS, tmp_path / "configs")
    name, draw, tries = Path("paper", "sweep.yaml"), random.Random(SEED), count(30, 2000)
    assert check(tmp_path / "configs", name, SWEEP) == "ok"
    texts = (mutated(draw, SWEEP, OF_VALUES, most=2) for _ in range(tries))
    said = [check(tmp_path / "configs", name, text) for text in texts]
    assert tries / 30 < said.count("ok") < tries / 1.5
    told = set(re.findall(r": ([a-z][\w.\[\]]*): ", "\n".join(said)))
    reached = {key[:end] for key in told for end in range(1, len(key) + 1)}
    assert reached >= {*TOLD_OF_SWEEPS[:2], *(TOLD_OF_SWEEPS if tries > 30 else ())}
