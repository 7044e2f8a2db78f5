"""A loop is planned once: what follows from it is asked once, and handed down from its loading."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import wraps
from pathlib import Path

import pytest
from conftest import corrected

from podusv_cli.cli.validate import validate
from podusv_cli.components.disturbances.harmonic import HarmonicDisturbance
from podusv_cli.core.plugins import ROOMS
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.engine.step.layout import Parts, Vectors
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import BASES, Scenario
from podusv_cli.workflows import run
from podusv_cli.workflows.compare import compare

ROOT = Path(__file__).parents[2] / "configs"
SHORT = ["simulation.duration=2"]
MADE = ((Scenario, "plan"), (Scenario, "closed_loop"), (Plan, "__init__"), (ClosedLoop, "about"))
ASKED = dict.fromkeys(("metrics_of", "drive_with", "path", "measurement"), 1)


@pytest.fixture
def counting(monkeypatch):
    """Have calls of a class's method counted under a name."""
    counts = Counter()

    def count(owner, method, name):
        real = getattr(owner, method)

        @wraps(real)
        def counted(*given, **named):
            counts[name] += 1
            return real(*given, **named)

        monkeypatch.setattr(owner, method, counted)

    def start(*more):
        for owner, method in MADE:
            count(owner, method, method)
        for owner, method, name in more:
            count(owner, method, name)
        return counts

    return start


@pytest.mark.parametrize(
    ("config", "controller", "of_law", "loops"),
    [
        ("fossen_2003/cybership2.yaml", "paper", 1, 4),  # whose laws are all checked
        ("own_vessel.yaml", "", 2, 1),  # once by the law itself, for its memory
        ("mu_2017/corrected.yaml", "", 2, 1),  # which has the stability monitor
    ],
)
def test_a_run_plans_each_loop_once(config, controller, of_law, loops, tmp_path, counting):
    """From the file to the folder: checks, size, warnings, march, metrics, monitor, cost."""
    loaded = load(ROOT / config).scenario
    scenario = loaded.singles()[controller] if controller else loaded
    counts = counting(
        (Scenario, "metrics_of", "metrics_of"),
        (type(scenario.actuator), "drive_with", "drive_with"),
        *((type(getattr(scenario, at)), "constants_with", at) for at in ("path", "measurement")),
        (type(scenario.controller), "constants_with", "law"),
    )
    given = {"out": tmp_path / "run", "figures": False, "overrides": SHORT}
    run.run(ROOT / config, run.Request(controller=controller, **given))
    assert counts == {**dict.fromkeys((name for _, name in MADE), loops), **ASKED, "law": of_law}


def test_a_comparison_plans_the_loop_of_each_law_once(tmp_path, counting):
    """In the process that loads it; each run is handed its plan."""
    counts = counting()
    config = ROOT / "fossen_2003/cybership2.yaml"
    done = compare([config], run.Request(out=tmp_path / "all", figures=False, overrides=SHORT))
    assert len(done.result.runs) == 4
    assert counts == dict.fromkeys((name for _, name in MADE), 4)


@pytest.mark.parametrize(
    ("config", "loops"), [("own_vessel.yaml", 1), ("fossen_2003/cybership2.yaml", 4)]
)
def test_validate_plans_each_loop_once(config, loops, counting):
    counts = counting()
    validate(ROOT / config, SHORT)
    assert counts == dict.fromkeys((name for _, name in MADE), loops)


def test_every_kind_of_part_is_known_to_loop_plan_and_plugins():
    """What docs/architecture.md says that a new kind of part touches."""
    plan = load(ROOT / "own_vessel.yaml").scenario.plan()
    sections = {name.replace("law", "controller"): part for name, part in plan.loop.parts.items()}
    assert {name: getattr(plan.loop, name) for name in BASES} == sections
    assert {f"{section}s" for section in BASES} <= set(ROOMS)
    assert tuple(function.part for function in plan.functions) == Parts._fields
    for name in plan.loop.parts:
        assert name in plan.constants
        assert {name, f"{name}_table"} <= set(Vectors._fields)
        assert name in {function.owner for function in plan.functions}


@pytest.mark.parametrize(
    ("part", "other"),
    [
        ("controller", ["controller.kind=pid"]),
        ("controller", ["controller.standoff_reference=crab"]),
        ("path", ["path={kind: waypoints, points: [[0, 0], [9, 0], [9, 9]], speed: 0.2}"]),
        ("disturbance", ["disturbance={kind: current, speed: 0.1}"]),
        ("actuator", ["actuator.command.delay=0.1"]),
        ("measurement", ["measurement.kind=exact", "estimator.kind=none"]),
        ("estimator", ["estimator={kind: passive_observer}"]),
    ],
)
def test_a_plan_like_another_sees_every_part_of_another_structure(part, other):
    """What is taken from a plan whose parts are the same objects follows from those alone."""
    config = ROOT / "sea/sensors.yaml"
    usual = load(config, ["controller.kind=adaptive_neural", *SHORT]).scenario.alone()
    changed = load(config, ["controller.kind=adaptive_neural", *other, *SHORT]).scenario
    loops = [usual.closed_loop()]
    loops += [replace(loops[0], **{part: getattr(changed.closed_loop(), part)})]
    plan = Plan(loops[0], usual.time_grid())
    again = replace(loops[0], start=(1.0,) * 6)
    assert plan.like(again).structure == Plan(again, plan.grid).structure
    with pytest.raises(ValueError, match="another structure than the batch"):
        plan.like(loops[1])


class Stormy(HarmonicDisturbance):
    """It has a constant more where it is scaled up."""

    def constants(self):
        return super().constants() | ({"gust": 1.0} if self.scale > 1.0 else {})


@pytest.mark.parametrize("sea", [Stormy(frame="earth"), Stormy(scale=2.0)])
def test_a_sea_with_another_kernel_or_other_constants_is_of_another_structure(sea):
    """Where all parts of the loop but the sea are the same objects."""
    loop = corrected(disturbance=Stormy())
    plan = Plan(loop, TimeGrid(0.01, 10))
    assert plan.like(replace(loop, disturbance=Stormy(scale=0.5))).functions is plan.functions
    with pytest.raises(ValueError, match="another structure than the batch"):
        plan.like(replace(loop, disturbance=sea))
