"""A row of a batch has the metrics that the run has alone, whatever number is drawn."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, ROOMS, corrected, example, kinds, needed_by
from rotation import one_in
from scenario_samples import loaded

import podusv
from benchmarks.variants import variants
from podusv_cli.components.actuators.saturated_full import SaturatedFull
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.network import Network
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.metrics.metric import Accumulator, Metric, gathered
from podusv_cli.metrics.table import METRICS, metrics_probe
from podusv_cli.scenario.address import ValueRefused, has, with_values
from podusv_cli.scenario.load import load_text, values
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.yaml_tree import route

SECTIONS = {"paths": "path", "disturbances": "disturbance", "actuators": "actuator"}
SECTIONS |= {room: room.removesuffix("s") for room in ("measurements", "estimators", "controllers")}
PARTS = [(SECTIONS[room], name, kind) for room in ROOMS for name, kind in kinds(room).items()]
TASK = loaded(
    """
name: task
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: saturated}
controller: {kind: pid}
start: {x: -2.0, y: -1.0, u: 0.3}
simulation: {step: 0.01, duration: 6.0}
"""
).scenario
TRIALS = {
    "zigzag": {"execute": 0.5, "switch": 0.05, "thrust": 3.0, "lever": 1.0},
    "stopping": {"execute": 0.5, "thrust": 4.0, "astern": 4.0},
    "turning_circle": {"execute": 0.5, "thrust": 4.0, "lever": 2.0},
}
SENSORS = {"measurement": example(kinds("measurements")["sensors"])}


def with_part(section: str, kind: Any) -> Scenario:
    """The task with this part; an estimator gets sensors, and a law of poses what it needs."""
    beside = SENSORS if section == "estimator" else {}
    fields = TRIALS.get(kind.model_fields["kind"].default, {})
    part = example(kind, **fields)
    if section == "controller":
        beside = needed_by(part, SaturatedFull())
    return TASK.model_copy(update={**beside, section: part})


def changed(scenario: Scenario, key: str, old: float) -> Scenario | None:
    """The scenario with another number, None where it is refused or changes the structure."""
    new = old + 1 if isinstance(old, int) else 1.07 * old + 0.01
    try:
        found = with_values(scenario, {route(key): new})
        found.closed_loop().check_fit(found.simulation.step)
        same = found.plan().structure == scenario.plan().structure
    except (ValueRefused, LawError, ValueError):
        return None
    return found if same else None


def alone(scenario: Scenario) -> dict[str, float]:
    """The metrics of one run."""
    probe = scenario.probe()
    run = simulate(scenario.closed_loop(), scenario.time_grid(), probe=probe)
    assert run.seen is not None
    return probe.summary(run.seen)


@pytest.mark.parametrize(
    ("section", "kind"), one_in(3, [(s, k) for s, _, k in PARTS]), ids=[n for _, n, _ in PARTS]
)
def test_every_key_that_can_be_drawn_gives_the_metrics_of_the_run_alone(
    section: str, kind: Any
) -> None:
    # With every number written out, as they are in the table of the batch.
    base = load_text(resolved_yaml(with_part(section, kind)), "resolved.yaml").scenario
    numbers = {
        key: old
        for key, old in values(base).items()
        if has(base, key) and isinstance(old, int | float) and not isinstance(old, bool)
    }
    first = kind is PARTS[0][-1]  # all keys with this part; of those that others share, a few
    shared = [key for key in numbers if not key.startswith(section)]
    left_out = {key for place, key in enumerate(shared) if (place + len(kind.__name__)) % 11}
    tried = numbers if first else {k: old for k, old in numbers.items() if k not in left_out}
    runs = {key: one for key, old in tried.items() if (one := changed(base, key, old))}
    assert len(runs) > len(tried) / 2
    table = {
        key: [values(runs[row])[key] if row == key else numbers[key] for row in runs]
        for key in runs
    }
    batch = podusv.simulate_many(base, table, side_by_side=False)
    assert set(batch["status"]) <= {"finished", "diverged"}
    for row, run in enumerate(runs.values()):
        expected = alone(run)
        found = batch.loc[row, list(expected)].to_numpy(float)
        np.testing.assert_array_equal(found, list(expected.values()), err_msg=list(runs)[row])


@pytest.mark.parametrize(("key", "metric"), [("standoff", "e_steady"), ("execute", "transfer")])
def test_constants_of_metrics_that_follow_from_the_law_are_those_of_the_run(
    key: str, metric: str
) -> None:
    """Side by side too. The error beyond the standoff comes from the distances of the log."""
    kinds_ = kinds("controllers")
    base = with_part("controller", kinds_["pid" if key == "standoff" else "turning_circle"])
    numbers = np.linspace(0.1, 2.0, 11)
    table = {f"controller.{key}": numbers}
    one, eight = (podusv.simulate_many(base, table, side_by_side=way) for way in (False, True))
    np.testing.assert_array_equal(one[metric], eight[metric])
    assert one[metric].nunique() == len(numbers)
    if key == "standoff":
        run = podusv.simulate(base, {"controller.standoff": 2.0})
        late = run["z_e"][int(0.8 * 600) :]
        mean = np.trapezoid(abs(late - 2.0)) / (len(late) - 1)
        assert one[metric].iloc[-1] == pytest.approx(mean, rel=1e-9)


@kernel
def last_speed(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Keep the speed relative to that of the path."""
    seen[0] = s[3] - k.path_speed


def speed_excess(size: Any) -> dict[str, Metric]:
    """All metrics and one of a plug-in, whose constant is a number of the path."""
    own = Accumulator(last_speed, size, lambda layout: {"path_speed": layout.loop.path.speed})
    return METRICS | {
        "excess": Metric("excess", "m/s", "speed beyond the path's", own, gathered(0))
    }


def two_speeds() -> list[ClosedLoop]:
    """Loops that differ in the speed of the path."""
    loop = TASK.closed_loop()
    return [replace(loop, path=type(loop.path)(speed=speed)) for speed in (0.5, 0.75)]


def test_a_metric_of_a_plugin_has_the_constants_of_each_run() -> None:
    loops, grid = two_speeds(), TASK.time_grid()
    known = speed_excess(lambda layout: 1)
    settings = {"steady_fraction": 0.2, "settling_radius": 1.0, "known": known}
    probe = metrics_probe(Plan(loops[0], grid), **settings)
    batch = simulate_many(loops, grid, probe=probe)
    u = batch.state[:, 3]
    np.testing.assert_array_equal(probe.summaries(batch.seen)["excess"], u - [0.5, 0.75])


def test_a_metric_whose_size_depends_on_a_drawn_number_refuses_the_run() -> None:
    loops, grid = two_speeds(), TASK.time_grid()
    known = speed_excess(lambda layout: 1 if layout.loop.path.speed < 0.6 else 2)
    settings = {"steady_fraction": 0.2, "settling_radius": 1.0, "known": known}
    batch = simulate_many(loops, grid, probe=metrics_probe(Plan(loops[0], grid), **settings))
    assert batch.status.tolist() == ["finished", "invalid"]
    expected = "metric excess: its accumulator gathers 2 numbers in this run and 1 in others"
    assert batch.cause[1].startswith(expected)


# --- many runs that differ in some numbers, as docs/performance.md shows them

ROOT = Path(__file__).parents[2]


def test_the_documented_monte_carlo_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "docs" / "performance.md").read_text()
    (code,) = re.findall(r"```python\n(.*?simulate_many.*?)```", text, re.DOTALL)
    few = code.replace("(1000, 6)", "(4, 6)").replace('"configs/', f'"{ROOT}/configs/')
    assert few.count("(4, 6)") == few.count(f"{ROOT}/configs/mu_2017") == 1
    exec(few, {})  # noqa: S102
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "4 of 4 finished"
    low, middle, high = map(float, lines[1].removeprefix("iae [").rstrip("]").split())
    assert 375 < low < middle < high < 395  # as the text says of a thousand


def test_variants_change_what_they_name_and_nothing_else() -> None:
    loop = corrected()
    (first, two) = variants(loop, {"controller.network.spread": [0.5, 0.9], "start.psi": [1, 2]})
    assert isinstance(two.controller, AdaptiveNeural)
    assert two.controller.network == Network(spread=0.9)
    assert two.start == (-10.0, -10.0, 2.0, 0.0, 0.0, 0.0)
    back = variants(first, {"controller.network.spread": [0.7], "start.psi": [0.0]})
    assert back == [loop]
    heavy = variants(loop, {"vessel.m": [30.0]})[0]
    assert (heavy.vessel.m, heavy.nominal) == (30.0, NONLINEAR)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"controller.k_zee": [1.0]}, "controller.k_zee: no number of this closed loop"),
        ({"controller.network": [1.0]}, "controller.network: no number"),
        ({"controller.k_ze.x": [1.0]}, r"controller.k_ze.x: no number"),
        ({"rudder.k": [1.0]}, "rudder.k: no number"),
        ({"start.z": [1.0]}, "start.z: no number"),
        ({"vessel": [1.0]}, "vessel: no number"),
        ({"controller.k_ze": [-1.0]}, "greater than or equal to 0"),
        ({"vessel.m": [20.0], "start.x": [1.0, 2.0]}, "one number a run"),
        ({}, "one number a run"),
    ],
)
def test_variants_that_cannot_be_are_refused(parameters: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        variants(corrected(), parameters)
