"""Two ways to one answer, at numbers that nobody chose: they agree to the last bit.

A pair is a function of a drawn scenario and an empty folder. `make test` takes a few draws of each,
`make test-long` some, `make test-all` hundreds.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from any_scenarios import KINDS, STEPS, Drawn
from exported_laws import Unit

import podusv
from podusv_cli.core.errors import ScenarioError, UsageError
from podusv_cli.core.kernel import LANES
from podusv_cli.export import link
from podusv_cli.export.check import check
from podusv_cli.export.law import ExportedLaw
from podusv_cli.interface.results import Run
from podusv_cli.scenario.address import ValueRefused, has, with_values
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load_text, values
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.yaml_tree import route
from podusv_cli.studies.making.check import gathered_metrics
from podusv_cli.workflows import export as exporting
from podusv_cli.workflows import rerun as repeating
from podusv_cli.workflows import studies
from podusv_cli.workflows.execute import Stopwatch, simulate_case
from podusv_cli.workflows.request import Request

Pair = Callable[[Drawn, Path], None]
PAIRS: dict[str, Pair] = {}
FEW, MANY = len(KINDS), 240  # draws of a pair in `make test-long`, and in `make test-all`
DRAWS = {"exported_law": 2, "plain_python": 4, "rerun_folder": 4}  # of those that take longer


def pair(test: Pair) -> Pair:
    """Add a pair."""
    PAIRS[test.__name__] = test
    return test


def same(one: Any, other: Any, what: str) -> None:
    """Whether numbers have the same bits; any NaN is like another."""
    np.testing.assert_array_equal(np.asarray(one, float), np.asarray(other, float), what)


def same_log(one: Mapping[str, Any], other: Mapping[str, Any], every: int = 1) -> None:
    """Whether two logs have the same signals, the first in every n-th row of the second."""
    assert set(one) == set(other)
    for name, rows in one.items():
        same(rows, other[name][::every], name)


def same_metrics(scenario: Scenario, one: Any, other: Any) -> None:
    """Whether two runs have the same metrics, of those that are gathered on the way."""
    names = gathered_metrics(scenario).keys() & other.keys()
    assert names <= {*one.keys()}
    assert len(names) > 10
    for name in names:
        same(one[name], other[name], name)


def signals(run: Run) -> Mapping[str, Any]:
    """Everything that is logged."""
    return run.recording.signals


def marched(scenario: Scenario) -> Mapping[str, Any]:
    """What a run logs, without what is made of its log."""
    return simulate_case(Case.of(scenario), Stopwatch()).signals


@pair
def every_step_logged(drawn: Drawn, place: Path) -> None:
    """What is left out of a log changes nothing else."""
    some = drawn.scenario()
    whole = podusv.load(some, {"log.every": 1})
    assert len(marched(whole)["time"]) == drawn.steps + 1
    same_log(marched(some), marched(whole), some.log.every)
    same_metrics(some, podusv.simulate(some).metrics, podusv.simulate(whole).metrics)


@pair
def plain_python(drawn: Drawn, place: Path) -> None:
    """Machine code and the kernels as they are written."""
    drawn.steps = drawn.whole(5, 12)
    scenario = drawn.scenario()
    same_log(marched(scenario), marched(podusv.load(scenario, {"simulation.compiled": False})))


@pair
def resolved_scenario(drawn: Drawn, place: Path) -> None:
    """A scenario, and its file with every value in it."""
    scenario = drawn.scenario()
    again = load_text(resolved_yaml(scenario), "resolved.yaml").scenario
    assert again == scenario
    same_log(marched(scenario), marched(again))


@pair
def number_of_a_draw(drawn: Drawn, place: Path) -> None:
    """A number in a scenario's file, and the same in a draw: refused by both, or the same run.

    The file has a number in place of every null, since a null would follow the number.
    """
    text = resolved_yaml(drawn.scenario())
    scenario = load_text(text, "resolved.yaml").scenario
    numbers = {
        key: own
        for key, own in values(scenario).items()
        if isinstance(own, (int, float)) and not isinstance(own, bool) and has(scenario, key)
    }
    for key in drawn.random.choice([*numbers], 4):
        own, factor = numbers[key], drawn.random.choice([-1.0, drawn.between(0.3, 3.0)])
        number = type(own)(own * factor or drawn.between(-2.0, 2.0))
        try:
            loaded = load_text(text, "resolved.yaml", [f"{key}={number!r}"]).scenario
        except ScenarioError:
            with pytest.raises(ValueRefused):
                with_values(scenario, {route(key): number})
        else:
            changed = with_values(scenario, {route(key): number})
            same_log(marched(loaded), marched(changed))


@pair
def rerun_folder(drawn: Drawn, place: Path) -> None:
    """A run folder, read and made again; and the run in memory."""
    scenario = drawn.scenario()
    run = podusv.run(scenario, out=place / "run", figures=False)
    assert repeating.rerun(place / "run", Request()).identical
    same_log(signals(podusv.simulate(scenario)), signals(run))
    same_metrics(scenario, podusv.simulate(scenario).metrics, run.metrics)


@pair
def side_by_side(drawn: Drawn, place: Path) -> None:
    """Runs in lanes, one by one in a batch, and one of them by itself."""
    scenario = drawn.scenario()
    given = columns(drawn, drawn.whole(3, LANES + 2))
    wide = podusv.simulate_many(scenario, given, side_by_side=True)
    pd.testing.assert_frame_equal(wide, podusv.simulate_many(scenario, given, side_by_side=False))
    row = wide.loc[drawn.whole(0, len(wide) - 1)]
    alone = podusv.simulate(scenario, {key: row[key] for key in given})
    same_metrics(scenario, row, alone.metrics)


def columns(drawn: Drawn, count: int) -> dict[str, list[Any]]:
    """Parameters of so many runs: the quantities of the study, and their own numbers."""
    given: dict[str, list[Any]] = {
        "vessel.m": [drawn.between(20.0, 60.0) for _ in range(count)],
        "start.psi": [drawn.between(-math.pi, math.pi) for _ in range(count)],
    }
    for name, quantity in drawn.vary().items():
        if "choice" in quantity:
            given[name] = drawn.random.choice(quantity["choice"], count).tolist()
    return given


@pair
def session_and_run(drawn: Drawn, place: Path) -> None:
    """A run step by step, that goes back at times, and the run that it leaves."""
    scenario = drawn.scenario()
    demands = len(scenario.actuator.limits())
    session = podusv.open_session(scenario, period=drawn.seconds(drawn.whole(1, 9)))
    left = drawn.whole(1, 60)
    while session.status == "running" and left:
        before = session.state()
        session.step(drawn.random.normal(0.0, 3.0, demands))
        if drawn.whole(0, 4) == 0:
            session.restore(before)
            session.step(drawn.random.normal(0.0, 3.0, demands))
        left -= 1
    run, log = session.close(place / "run", figures=False), session.log
    rows = {name: values[: len(log["time"])] for name, values in signals(run).items()}
    assert len(signals(run)["time"]) - len(log["time"]) in (0, 1)  # the last instant of one left
    same_log(log, rows)
    if session.status == "finished":
        known = gathered_metrics(run.scenario)
        same_metrics(run.scenario, {name: session.metric(name) for name in known}, run.metrics)
    for name in ("energy", "effort_r", "peak_tau_u"):  # of no window
        same(session.metric(name), run.metrics[name], name)
    assert repeating.rerun(place / "run", Request()).identical


REWARDS = ("energy", "effort_u", "peak_tau_u", "iae", "e_ct_integral")


@pair
def rewards_and_metric(drawn: Drawn, place: Path) -> None:
    """Rewards alone and side by side to the bit, and their sum with the metric of the run."""
    gym = pytest.importorskip("podusv.gym", reason="Gymnasium is not installed: podusv[gym]")
    scenario = drawn.scenario(sweep={"draws": 50, "vary": drawn.vary()})
    once = podusv.open_session(scenario, period=drawn.step)
    demands = len(scenario.actuator.limits())
    once.step((1.0, 0.1, -0.3)[:demands])
    known = [name for name in REWARDS if math.isfinite(once.metric(name))]
    reward = str(drawn.random.choice(known))
    given: dict[str, Any] = {
        "reward": reward,
        "limits": (9.0, 3.0, 5.0)[:demands],
        "period": drawn.seconds(drawn.whole(1, 9)),
    }
    count, seed = drawn.whole(3, LANES + 1), drawn.whole(0, 40)
    many = gym.VectorEnv(scenario, count=count, **given)
    ones = [gym.Env(scenario, **given) for _ in range(count)]
    seen, _ = many.reset(seed=seed)
    same(seen, [env.reset(seed=seed + i)[0] for i, env in enumerate(ones)], "first")
    gained, over = np.zeros(count), False
    while not over:
        actions = drawn.random.normal(0.0, 4.0, (count, demands))
        seen, rewards, dead, cut, _ = many.step(actions)
        alone = [env.step(action) for env, action in zip(ones, actions, strict=True)]
        for at, together in enumerate((seen, rewards, dead, cut)):
            same(together, [answer[at] for answer in alone], f"{reward} {at}")
        gained += rewards
        over = bool(cut.any())
    run = ones[0].session.close(place / "run", figures=False)
    assert -gained[0] == pytest.approx(run.metrics[reward], rel=1e-9, abs=1e-12)


@pair
def exported_law(drawn: Drawn, place: Path) -> None:
    """A sampled law in the run, by itself, as C and as an FMU."""
    drawn.held = max(drawn.held, 1)
    scenario = drawn.scenario()
    if scenario.controller.wants_load_estimate():
        with pytest.raises(UsageError, match="takes the load that an estimator finds"):
            ExportedLaw.of(scenario)
        return
    law = ExportedLaw.of(scenario)
    rows = law.samples(podusv.simulate(law.scenario).recording)
    by_itself = law.by_itself(rows)
    if not law.needs_loads:  # else they may change between two samples
        same(by_itself, rows, "by itself")
    if not shutil.which("cc"):
        return
    path = place / "scenario.yaml"
    path.write_text(resolved_yaml(scenario))
    products = exporting.Products(platforms=[link.this_machine()])
    folder = exporting.export(path, Request(out=place / "law"), products)
    assert [checked.differs for checked in check(folder)] == [""] * (1 + bool(find_spec("fmpy")))
    unit = Unit(folder / "law.fmu", place / "unit")
    inputs = len(unit.inputs)
    same(unit.read()[:inputs], unit.starts, "start")
    same(unit.starts, rows[0, 1 : 1 + inputs], "first sample")
    for row in by_itself:
        said = row[1 + len(law.inputs(rows)[0]) :]
        same(unit.step(row[0], row[1 : 1 + inputs]), said, f"t = {row[0]}")


@pair
def row_of_a_study(drawn: Drawn, place: Path) -> None:
    """A study's table, its draw as a scenario, and the run of that."""
    vary = drawn.vary()
    scenario = drawn.scenario(sweep={"draws": 4, "seed": drawn.whole(0, 99), "vary": vary})
    study = podusv.sweep(scenario, out=place / "study", figures=False, workers=1)
    number = drawn.whole(0, 3)
    label = next(iter(scenario.labels()))
    made = studies.draw(place / "study", label, number, 0, place / "one.yaml")
    run = podusv.simulate(made)
    row = study.table.set_index("draw").loc[number]
    assert row["status"] == run.status
    same_metrics(scenario, row, run.metrics)
    for name in vary:
        if "times" not in vary[name] and "plus" not in vary[name]:
            same(row[name], value_at(podusv.load(made), name), name)


def value_at(scenario: Scenario, key: str) -> Any:
    """The value at a dotted key."""
    whole: Any = scenario
    for step in key.split("."):
        whole = getattr(whole, step)
    return whole


def test_the_draws_are_no_convenient_numbers():
    """Among those of `make test-long` every time divides another one here, and does not there."""
    scenarios = [Drawn(seed).scenario() for seed in range(4 * FEW)]
    grids = [scenario.time_grid() for scenario in scenarios]
    held = [grid for grid in grids if grid.hold_every]
    late = [(scenario.actuator.delay(), scenario.control.period) for scenario in scenarios]
    for found in (
        {grid.hold_every > 0 for grid in grids},
        {one.steps % one.hold_every > 0 for one in held},
        {grid.steps % grid.log_every > 0 for grid in grids},
        {one.update_first for one in held},
        {0.0 < delay < period for delay, period in late},
        {0.0 < period < delay for delay, period in late},
        {scenario.path.follows for scenario in scenarios},
        {bool(scenario.controller.trial()) for scenario in scenarios},
        {scenario.measurement.is_exact for scenario in scenarios},
    ):
        assert found == {True, False}
    assert len({grid.step for grid in grids}) == len(STEPS)


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        pytest.param(n, i, marks=[pytest.mark.long] * ((at + i // 2) % 6 != 2))
        for at, n in enumerate(PAIRS)
        for i in range(at % 2, DRAWS.get(n, FEW), 2)
    ],
)
def test_both_ways_have_the_same_bits(name, seed, tmp_path):
    PAIRS[name](Drawn(seed), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [(n, i) for n in PAIRS for i in range(MANY)])
def test_both_ways_have_the_same_bits_in_many_draws(name, seed, tmp_path):
    PAIRS[name](Drawn(seed), tmp_path)
