"""Draws depend on seed, stream, quantity and index alone; scenarios take them within ranges."""

from __future__ import annotations

import json
import random
from hashlib import sha256
from typing import Any

import numpy as np
import pytest
from conftest import example, failure_of, kinds, needed_by
from counting import counted
from rotation import one_in
from scenario_samples import loaded
from scipy.stats import qmc

import podusv
from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.actuators.ideal_full import IdealFull
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.measurements.sensors import Sensors
from podusv_cli.core.component import Component
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.random_words import in_unit_interval
from podusv_cli.scenario.address import ValueRefused, describe_key, with_values
from podusv_cli.scenario.load import load_text, values
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.sweep import Quantity, Sweep
from podusv_cli.scenario.yaml_tree import route
from podusv_cli.studies.making.draws import (
    draw_scenario,
    drawing,
    draws,
    seeds,
    table,
    uniforms,
    words,
)

VARY = """
sweep:
  vary:
    vessel.m: {times: {uniform: [0.7, 1.3]}}
    damping: {keys: [vessel.X_u, vessel.X_uu], times: {lognormal: {sigma: 0.2, within: [0.5, 2]}}}
    vessel.x_g: {uniform: [0.0, 0.1]}
    start.y: {plus: {normal: {sigma: 3.0, within: [-9.0, 9.0]}}}
    start.psi: {angle: all}
    path.points[1][0]: {plus: {triangular: [-1, 0, 1]}}
    controller.network.nodes[1]: {integers: [2, 4]}
    controller.coupling: {choice: [printed, corrected]}
    log.every: {seed: true}
"""
LAW = """
vessel: {preset: paper_nonlinear}
path: {kind: waypoints, points: [[0, 0], [10, 0], [20, 5]]}
disturbance: {kind: harmonic}
actuator: {kind: ideal}
controller: {kind: adaptive_neural}
"""


def scenario(more: str = "") -> Scenario:
    return loaded(LAW + more).scenario


def swept(more: str = VARY) -> Sweep:
    sweep = scenario(more).sweep
    assert sweep is not None
    return sweep


FIRST_WORDS = [9367100778188857890, 6281397578495945554]  # seed 1, quantity vessel.m


def test_a_draw_is_the_first_word_of_its_own_block() -> None:
    """As numpy documents it: `advance` counts blocks of four words."""
    key = int.from_bytes(
        sha256(json.dumps([7, "sweep", "vessel.m"]).encode()).digest()[:16], "little"
    )
    one_by_one = [int(np.random.Philox(key=key).advance(i).random_raw()) for i in range(40)]
    assert words(7, "vessel.m", 0, 40).tolist() == one_by_one
    far = 10**12 + 3
    assert words(7, "vessel.m", far, 2).tolist() == [
        int(np.random.Philox(key=key).advance(i).random_raw()) for i in (far, far + 1)
    ]


def test_draws_are_those_of_the_first_release() -> None:
    """Numbers that were computed once; whoever changes them changes every study."""
    assert words(1, "vessel.m", 0, 2).tolist() == FIRST_WORDS
    assert seeds(1, "vessel.m", 0, 1).tolist() == [FIRST_WORDS[0] >> 11]
    u = uniforms(1, "vessel.m", 0, 1)[0]
    assert u == ((FIRST_WORDS[0] >> 12) + 0.5) / 2**52


def test_uniform_draws_never_reach_the_ends() -> None:
    """Of 53 bits, u + 1/2 would round to 1 where all are set."""
    ends = in_unit_interval(np.array([0, 2**64 - 1], np.uint64))
    assert ends.tolist() == [2.0**-53, 1 - 2.0**-53]


@pytest.mark.parametrize("design", ["random", "sobol"])
def test_draws_do_not_depend_on_chunks_order_or_other_quantities(design: str) -> None:
    sweep = swept().model_copy(update={"design": design})
    whole = list(draws(sweep, 0, 50))
    parts = [(first, min(7, 50 - first)) for first in range(0, 50, 7)]
    random.Random(1).shuffle(parts)
    pieces = {
        first + i: draw for first, n in parts for i, draw in enumerate(draws(sweep, first, n))
    }
    assert [pieces[i] for i in range(50)] == whole
    if design == "random":
        fewer = {n: q for n, q in reversed(sweep.vary.items()) if n != "damping"}
        less = list(draws(sweep.model_copy(update={"vary": fewer}), 0, 50))
        assert less == [{n: draw[n] for n in fewer} for draw in whole]


def test_other_seeds_streams_and_names_give_other_draws() -> None:
    same = uniforms(1, "a", 0, 100)
    for other in (
        uniforms(2, "a", 0, 100),
        uniforms(1, "b", 0, 100),
        uniforms(1, "a", 0, 100, "tune"),
    ):
        assert not np.isin(same, other).any()
    assert abs(np.corrcoef(uniforms(1, "a", 0, 5000), uniforms(1, "b", 0, 5000))[0, 1]) < 0.05


def test_sobol_points_are_scipy_s_with_the_digits_of_each_quantity_shifted() -> None:
    """Which leaves them as evenly spread as they are."""
    plain = (qmc.Sobol(2, scramble=False, bits=32).random(64) * 2.0**32).astype(np.uint64)
    vary, shifts = {n: {"uniform": (0.0, 1.0)} for n in ("x", "y")}, set()
    for seed, stream in ((1, "sweep"), (2, "sweep"), (1, "tune")):
        sweep = Sweep.model_validate({"design": "sobol", "seed": seed, "vary": vary})
        points = table(sweep, 0, 64, stream)
        digits = np.column_stack([points["x"], points["y"]]) * 2.0**32
        (both,) = np.unique(plain ^ digits.astype(np.uint64), axis=0).tolist()
        shifts |= {0, *both}
    assert len(shifts) == 7  # none is without, and no two are alike


def test_a_draw_changes_what_it_names_and_nothing_else() -> None:
    one, vary = scenario(), swept().vary
    draw = {
        "vessel.m": 1.25,
        "damping": 0.5,
        "start.y": 2.0,
        "start.psi": -1.0,
        "path.points[1][0]": -0.5,
        "controller.network.nodes[1]": 4,
        "controller.coupling": "printed",
    }
    made = draw_scenario(one, vary, draw)
    before, after = one.model_dump(), made.model_dump()
    assert after["vessel"] == before["vessel"] | {
        "m": 1.25 * one.vessel.m,
        "X_u": 0.5 * one.vessel.X_u,
        "X_uu": 0.5 * one.vessel.X_uu,
    }
    assert after["start"] == before["start"] | {"y": 2.0, "psi": -1.0}
    assert after["path"]["points"] == ((0.0, 0.0), (9.5, 0.0), (20.0, 5.0))
    assert after["controller"]["network"]["nodes"] == (3, 4, 3)
    assert after["controller"]["coupling"] == "printed"
    left = set(before) - {"vessel", "start", "path", "controller"}
    assert {name: after[name] for name in left} == {name: before[name] for name in left}
    assert made.nominal == one.nominal == one.vessel  # no law knows
    assert draw_scenario(one, vary, {}) == one


def test_the_nominal_vessel_is_a_key_like_others() -> None:
    vary = {"nominal.m": Quantity.model_validate({"times": {"uniform": (0.5, 2.0)}})}
    made = draw_scenario(scenario(), vary, {"nominal.m": 1.5})
    assert made.nominal.m == 1.5 * made.vessel.m
    assert made.vessel == scenario().vessel


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (
            {"vessel.m": -1.0},
            "sweep.vary.vessel.m: vessel.m = -23.8; must be a number above 0 [kg]",
        ),
        ({"damping": -2.0}, "sweep.vary.damping: vessel.X_u = 1.44; must be a number not above 0"),
        (
            {"controller.network.nodes[1]": 0},
            "needs at least one node, got [3, 0, 3], with controller.network",
        ),
        ({"controller.coupling": "odd"}, "controller.coupling = odd; must be printed or corrected"),
        ({"path.points[1][0]": 1e400}, "path.points[1][0] = inf; must be a number"),
        ({"vessel.x_g": 9.0}, "vessel: the mass matrix is not positive definite: m11 = "),
        ({"vessel.m": 1.0, "vessel.x_g": 9.0}, ", with vessel.m = 23.8, vessel.x_g = 9"),
    ],
)
def test_a_draw_out_of_range_names_quantity_value_key_and_range(draw: Any, words: str) -> None:
    with pytest.raises(ValueRefused) as told:
        draw_scenario(scenario(), swept().vary, draw)
    assert words in str(told.value)


def test_applying_a_draw_takes_few_calls() -> None:
    single, sweep = scenario(), swept()
    several = [{n: d[n] for n in d if n != "log.every"} for d in draws(sweep, 0, 20)]
    put = drawing(single, {name: sweep.vary[name] for name in several[0]})
    put(several[0])
    _, calls = counted(lambda: [put(draw) for draw in several])
    assert calls / 20 < 260  # 0.1 ms


def test_a_table_of_many_draws_takes_few_calls() -> None:
    sweep = swept()
    _, few = counted(lambda: table(sweep, 0, 10))
    _, many = counted(lambda: table(sweep, 0, 100_000))
    assert many == few  # no Python for each draw


AROUND = {
    "disturbances": "disturbance",
    "measurements": "measurement",
    "estimators": "estimator",
    "actuators": "actuator",
    "paths": "path",
    "controllers": "controller",
}


def with_kind(folder: str, kind: type[Component]) -> Scenario:
    """The paper's task with this component, behind whatever it needs and may have."""
    around = {}
    if issubclass(kind, Actuator):
        around = {"command": {"delay": 0.1}, "failure": failure_of(kind, 3.0)}
    part = example(kind, **around)
    estimates = isinstance(part, Estimator) and not isinstance(part, NoEstimator)
    seen = {"measurement": Sensors()} if estimates else {}
    needed = needed_by(part, IdealFull()) if isinstance(part, Controller) else {}
    task = podusv.load("podusv:mu_2017/corrected.yaml").alone()
    return task.model_copy(update={**seen, **needed, AROUND[folder]: part})


def awkward(own: float) -> list[float]:
    """Values off the grid of steps, below all ranges, far beyond, and at the end of many."""
    numbers = [own + 0.0037, 3.0 * own + 0.02, -own - 1.0, own * 1e9, 0.0]
    return [int(number) for number in numbers] if isinstance(own, int) else numbers


def answers(scenario: Scenario, key: str, number: float) -> tuple[str, str]:
    """What loading a scenario says of a number, and what a study's draw of it does."""
    said = ["", ""]
    try:
        load_text(resolved_yaml(scenario), "x.yaml", [f"{key}={number!r}"])
    except ScenarioError as error:
        said[0] = str(error)
    try:
        with_values(scenario, {route(key): number})
    except ValueRefused as error:
        said[1] = str(error)
    return said[0], said[1]


def asked(scenario: Scenario, section: str, *, times: bool) -> list[tuple[str, float]]:
    """Every number of a section that can be drawn, or every time, with awkward values."""
    found = []
    for key, own in values(scenario).items():
        steps = route(key)
        if steps[0] != section or isinstance(own, bool) or not isinstance(own, (int, float)):
            continue
        if not times or describe_key(scenario, steps).unit == "s":
            found += [(key, number) for number in awkward(own)]
    return found


CASES = [(folder, kind) for folder in AROUND for kind in kinds(folder).values()]


@pytest.mark.parametrize("times", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("folder", "kind"), one_in(3, CASES), ids=lambda one: getattr(one, "__name__", one)
)
def test_a_draw_is_refused_where_loading_the_scenario_with_it_is(folder, kind, times):
    given = with_kind(folder, kind)
    for key, number in asked(given, AROUND[folder], times=times):
        loading, drawing = answers(given, key, number)
        assert bool(loading) == bool(drawing), (key, number, loading, drawing)
