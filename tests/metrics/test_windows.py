"""Windows and radii that a scenario names are numbers: none of them needs code of its own."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import corrected

from benchmarks import ship_kernels
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import compile, shipped
from podusv_cli.engine.running import lanes
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.interface.scenarios import load_scenario
from podusv_cli.metrics.metric import Accumulator, Metric
from podusv_cli.metrics.table import METRICS, metrics_probe, metrics_with
from podusv_cli.scenario.load import Loaded, load_text
from podusv_cli.storage.log_reader import read_log

BOAT = """
name: own
extends: podusv:own_vessel.yaml
simulation: {duration: 12.31}
"""
OWN = "metrics: {windows: {odd: [3.1371, 7.7719], b: [0.0051, 12.29]}, radii: {near: 3.3717}}\n"
MORE = (
    "metrics: {windows: {a: [1, 2], b: [2, 3], c: [0, 1], d: [4, 4.5]}, radii: {x: 1, y: 2, z: 9}}"
)
FOLLOWED = "path: {kind: legs, points: [[0, 0], [9, 0]]}\ncontroller: {kind: los_pid}\n"


def probes(scenario: Loaded) -> set[str]:
    """What the kernels of all that its runs gather are kept under, alone and side by side."""
    plans = scenario.plans.values()
    pieces = [compile.adapter(*plan.functions[-1]) for plan in plans]
    pieces += [lanes.pieces(plan)[-2] for plan in plans]
    return {shipped.digest(p.function, p.prototype, p.compiler) for p in pieces}


@pytest.mark.parametrize("task", ["", FOLLOWED])
def test_any_windows_and_radii_have_the_same_code(task: str) -> None:
    """None, three and seven of them, of other names and numbers."""
    found = [probes(load_text(BOAT + task + own, "own.yaml")) for own in ("", OWN, MORE)]
    assert found[0] == found[1] == found[2]
    assert len(found[0]) == 2
    assert "" not in found[0]


RUN = """
import sys
sys.modules["numba"] = None
from podusv_cli.__main__ import main
sys.argv = ["podusv", "run", *sys.argv[1:]]
main()
"""


@pytest.mark.long
def test_a_window_of_awkward_numbers_needs_no_numba_and_is_what_the_log_says(
    tmp_path: Path,
) -> None:
    scenario, folder = tmp_path / "own.yaml", tmp_path / "run"
    scenario.write_text(BOAT + OWN)
    if (
        not ship_kernels.pieces_of([load_scenario(str(scenario))]).keys()
        <= shipped._kernels().keys()
    ):
        pytest.skip("no kernels.xz with the kernels of this scenario")
    command = [sys.executable, "-c", RUN, str(scenario), "--no-figures", "--out", str(folder)]
    empty = os.environ | {"PODUSV_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(command, env=empty, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    log, numbers = (
        read_log(folder / "log.h5"),
        json.loads((folder / "metrics.json").read_text())["metrics"],
    )
    t, z_e = log["time"].tolist(), log["z_e"].tolist()
    for name, start, end in (("odd", 3.1371, 7.7719), ("b", 0.0051, 12.29)):
        rms, largest = over(t, z_e, start, end)
        assert numbers[f"error_{name}_rms"] == pytest.approx(rms, rel=1e-12)
        assert numbers[f"error_{name}_max"] == largest
    assert numbers["settling_time_near"] == pytest.approx(crossing(t, z_e, 3.3717), rel=1e-12)


def over(t: Sequence[float], z_e: Sequence[float], start: float, end: float) -> tuple[float, float]:
    """Rms by trapezoids, and the largest, of the instants from start to end, which round."""
    inside = [(a, z) for a, z in zip(t, z_e, strict=True) if start - 1e-9 <= a <= end + 1e-9]
    square = 0.0
    for (a, z), (b, y) in pairwise(inside):
        square += 0.5 * (b - a) * (z * z + y * y)
    return math.sqrt(square / (inside[-1][0] - inside[0][0])), max(z for _, z in inside)


def crossing(t: Sequence[float], z_e: Sequence[float], radius: float) -> float:
    """When z_e last came within the radius, by a straight line between two instants."""
    last = max(i for i, z in enumerate(z_e) if z > radius)
    share = (z_e[last] - radius) / (z_e[last] - z_e[last + 1])
    return t[last] + share * (t[last + 1] - t[last])


def test_windows_side_by_side_have_the_bits_that_they_have_alone() -> None:
    grid, loop = TimeGrid(0.01, 700), corrected(actuator=Saturated())
    loops = [replace(loop, start=(x, 0.0, 0.3, 0.0, 0.0, 0.0)) for x in range(-9, 2)]
    windows = (("a", (0.337, 4.449)), ("b", (5.0, 6.66)))
    known = metrics_with((), (windows, (("c", 7.7), ("d", 2.2))))
    settings = {"steady_fraction": 0.2, "settling_radius": 1.0, "known": known}
    probe = metrics_probe(Plan(loops[0], grid), **settings)
    wide, alone = (
        simulate_many(loops, grid, probe=probe, side_by_side=side) for side in (True, False)
    )
    np.testing.assert_array_equal(wide.seen, alone.seen)
    assert (probe.summaries(wide.seen)["error_b_max"] > 0).all()


def test_a_run_that_never_began_has_no_number_of_a_window() -> None:
    known = metrics_with((), ((("a", (0.337, 4.449)),), (("c", 7.7),)))
    plan = Plan(corrected(), TimeGrid(0.01, 700))
    probe = metrics_probe(plan, steady_fraction=0.2, settling_radius=1.0, known=known)
    numbers = probe.summary(probe.first())
    assert {"error_a_rms", "settling_time_c", "iae"} <= numbers.keys()
    assert all(map(math.isnan, numbers.values()))


@kernel
def counts(t: float, seen: Vector) -> None:
    """Count the instants from where it begins."""
    seen[0] += 1.0


@pytest.mark.parametrize("count", [1, 0])
def test_an_accumulator_begins_with_its_own_numbers_and_not_with_more(count: int) -> None:
    own = Accumulator(counts, lambda layout: count, lambda layout: {}, first=(40.5,))
    late = Accumulator(counts, lambda layout: 2, lambda layout: {}, first=(1.0, 2.0, 3.0))
    plan = Plan(corrected(), TimeGrid(0.01, 9))
    settings = {"steady_fraction": 0.2, "settling_radius": 1.0}
    metric = Metric("counted", "1", "x", own, lambda seen, step: float(seen[0]))
    probe = metrics_probe(plan, known={**METRICS, "counted": metric}, **settings)
    batch = simulate_many([plan.loop], plan.grid, probe=probe)
    assert probe.summaries(batch.seen).get("counted", [None])[0] == (50.5 if count else None)
    wrong = {"late": Metric("late", "1", "x", late, lambda seen, step: 0.0)}
    with pytest.raises(LawError, match="metric late: its accumulator begins with 3 numbers and"):
        metrics_probe(plan, known=wrong, **settings)
