"""Write the LLVM bitcode of podusv's own kernels into the package: `make kernels`."""

from __future__ import annotations

import argparse
import os
import random
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from itertools import chain, permutations
from typing import Any

from podusv_cli.core import registry
from podusv_cli.core.errors import PodusvError
from podusv_cli.engine.loop.closed_loop import nothing
from podusv_cli.engine.machine import shipped, signatures
from podusv_cli.engine.machine.compile import Piece, adapter, lane_adapter
from podusv_cli.engine.machine.wide.scalar_ir import NotForLanes
from podusv_cli.engine.running import lanes
from podusv_cli.engine.step import rk4
from podusv_cli.export.law import ExportedLaw
from podusv_cli.identify.fit import march
from podusv_cli.interface.scenarios import load_scenario
from podusv_cli.process.workers import available_workers, run_all
from podusv_cli.scenario.load import Loaded, load
from podusv_cli.scenario.model import BASES
from podusv_cli.scenario.shipped import folder

CONFIGS = folder()
BOAT = CONFIGS / "own_vessel.yaml"
WINDAGE = {"vessel.windage": {"A_F": 0.2, "A_L": 0.5}}
POINTS = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]]
LEGS = {"path": {"kind": "legs", "points": POINTS}, "controller": {"kind": "los_pid"}}
SENSORS = {"measurement": {"kind": "sensors"}}
PODS = {"actuator": {"kind": "pod", "preset": "otter"}}
# What people put together, each for every kind of part.
TASKS: Sequence[Mapping[str, Any]] = [
    WINDAGE | task | seen | thrust
    for task in ({}, LEGS)
    for seen in ({}, SENSORS)
    for thrust in ({}, PODS)
]
# What a kind cannot do without.
NEEDS: Mapping[str, Mapping[str, Any]] = {
    "legs": {"points": POINTS},
    "legs_hold": {"points": POINTS},
    "waypoints": {"points": POINTS},
    "waves": {"height": 0.1, "period": 2.0},
    "wind": {"speed": 5.0},
    "current": {"speed": 0.1},
    "pod": {"preset": "otter"},
}
SEA = ("wind", "waves", "current")


def changes() -> Iterator[dict[str, Any]]:
    """What is changed in a boat of one's own: every kind of part, and sums of disturbances."""
    for task in TASKS:
        for section, base in BASES.items():
            for kind in registry.kinds(base.__module__.rpartition(".")[0], base):
                yield {**task, section: {"kind": kind, **NEEDS.get(kind, {})}}
        for count in range(2, len(SEA) + 1):
            for kinds in permutations(SEA, count):
                yield {**task, "disturbance": [{"kind": k, **NEEDS[k]} for k in kinds]}


def shipped_scenarios() -> Iterator[Loaded]:
    """All that podusv has; a layer is no scenario by itself."""
    for file in sorted(CONFIGS.rglob("*.yaml")):
        with suppress(PodusvError):
            yield load(str(file))


def scenarios_of_kinds() -> Iterator[Loaded]:
    """What `changes` makes and podusv does not refuse."""
    for change in changes():
        with suppress(PodusvError):
            yield load_scenario(str(BOAT), change, silent=True)


def pieces_of(scenarios: Iterable[Loaded]) -> dict[str, Piece]:
    """The kernels of these, by their digest: of runs alone, side by side, and of exported laws."""
    found = {}
    for each in scenarios:
        for plan in each.plans.values():
            found |= _by_digest(adapter(*function) for function in plan.functions)
            with suppress(TypeError):  # of runs that cannot go side by side
                found |= _by_digest(lanes.pieces(plan))
        for single in each.scenario.singles().values():
            with suppress(PodusvError):  # of laws that take no samples
                found |= _by_digest(ExportedLaw.of(single).pieces.values())
            with suppress(TypeError, PodusvError):  # of actuators that no log can stand in for
                found |= _by_digest(march.pieces(single.actuator))
    return found


def _by_digest(pieces: Iterable[Piece]) -> dict[str, Piece]:
    return {shipped.digest(p.function, p.prototype, p.compiler): p for p in pieces}


@cache
def pieces() -> dict[str, Piece]:
    """All kernels that come with podusv, by their digest."""
    whole = [
        Piece(rk4.advance, signatures.ADVANCE),
        Piece(rk4.evaluate_all, signatures.EVALUATE_ALL),
        Piece(rk4.rates_along, signatures.RATES_ALONG),
        adapter("probe", nothing, ()),  # of runs that nobody sees
        lane_adapter("probe", nothing, (), frozenset()),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of values that another kind has not
        return _by_digest(whole) | pieces_of(chain(shipped_scenarios(), scenarios_of_kinds()))


def bitcode(wanted: Mapping[str, Piece]) -> dict[str, bytes]:
    """What numba makes of these, on all cores; without those that no run can use."""
    names, count = sorted(wanted, key=lambda name: -wanted[name].size), available_workers()
    jobs = [partial(_made, {name: wanted[name] for name in names[i::count]}) for i in range(count)]
    outcomes = run_all(jobs)
    for outcome in outcomes:
        if outcome.failure:
            raise SystemExit(outcome.failure)
    return {name: code for outcome in outcomes for name, code in outcome.result.items()}


def _made(wanted: Mapping[str, Piece], report: Callable[[float], None]) -> dict[str, bytes]:
    found = {}
    for name, piece in wanted.items():
        with suppress(TypeError, NotForLanes):
            found[name] = piece.translator().bitcode(piece.function, piece.prototype)
    return found


def main() -> None:
    """Make them all, or look at those that are there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="how many are there; 1 if not all")
    parser.add_argument("--again", type=int, default=0, help="so many, drawn, are made anew")
    options = parser.parse_args()
    if os.environ.get("PYTHONHASHSEED") != "0":  # numba orders what it merges by hashes
        os.environ["PYTHONHASHSEED"] = "0"
        os.execv(sys.executable, [sys.executable, "-m", "benchmarks.ship_kernels", *sys.argv[1:]])
    sys.exit(check(options.again) if options.check else make())


def make() -> int:
    """Each of them once."""
    kernels = bitcode(pieces())
    shipped.write(dict(sorted(kernels.items())))
    print(f"{len(kernels)} kernels, {shipped.FILE.stat().st_size} bytes")
    return 0


def check(again: int) -> int:
    """Whether all are there, and whether some that are drawn come out as they are."""
    wanted = pieces()
    ready = {name: piece for name, piece in wanted.items() if piece.shipped_bitcode}
    drawn = random.sample(sorted(ready), min(again, len(ready)))
    made = bitcode({name: ready[name] for name in drawn})
    other = [ready[name].label for name in drawn if made[name] != ready[name].shipped_bitcode]
    print(f"{len(ready)} of {len(wanted)} kernels are in {shipped.FILE.name}", end="")
    print(f"; of {again} made anew {len(other)} differ: {', '.join(other)}" if again else "")
    if len(ready) < len(wanted):
        print("make kernels: writes it anew, in some minutes")
    return int(bool(other) or len(ready) < len(wanted))


if __name__ == "__main__":
    main()
