"""What podusv ships marches side by side, and every run has the bits that it has alone."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import REQUIRED, needed_by
from test_lanes import COUNT, ROOT, both, loop, same, scattered

from benchmarks.variants import variants
from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.actuators.ideal_full import IdealFull
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.paths.base import Path
from podusv_cli.core.component import Component
from podusv_cli.core.registry import kinds
from podusv_cli.engine.loop.closed_loop import ClosedLoop, Probe
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.lanes import why_alone
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.scenario.load import load

GRID = TimeGrid(0.01, 200)
LAWS = kinds("podusv_cli.components.controllers", Controller)
TESTED = (
    "adaptive_neural",
    "pid",
    "dsc",
    "full_backstepping",
)  # by `test_lanes`, with its actuators
QUICK = ("zigzag", "schedule")  # samples, and a table; the compiler takes seconds for others
SCENARIOS = (
    "sea/delay",
    "sea/dead_zone",
    "sea/sensors",
    "sea/state_4",
    "sea/pods",
    "sea/thruster_failure",
    "pod/kept",
    "pod/single",
)


def but_quick(names: Iterable[str], quick: Collection[str]) -> list[Any]:
    """All of these names, slow but for some."""
    return [n if n in quick else pytest.param(n, marks=pytest.mark.slow) for n in names]


def made(kind: type[Component]) -> Any:
    """A component with what it needs."""
    return kind(**REQUIRED.get(kind.model_fields["kind"].default, {}))


def spread(base: ClosedLoop) -> list[ClosedLoop]:
    """Random starts, of which some diverge."""
    draws = np.random.default_rng(11)
    fast = np.where(np.arange(COUNT) % 4 == 1, 1e150, draws.uniform(0.0, 1.0, COUNT))
    starts = {"x": draws.uniform(-5.0, 5.0, COUNT), "psi": draws.uniform(-3.0, 3.0, COUNT)}
    return variants(base, {f"start.{name}": n for name, n in (starts | {"u": fast}).items()})


@pytest.mark.parametrize("law", but_quick(sorted(set(LAWS) - set(TESTED)), QUICK))
def test_every_law_marches_side_by_side(law: str) -> None:
    """With the paper's task; also those that diverge, at different instants."""
    controller = made(LAWS[law])
    needed = needed_by(controller, IdealFull())
    base = replace(loop("pid"), controller=controller, **needed)
    together, alone = both(scattered(base, 7), GRID)
    same(together, alone)
    assert why_alone(Plan.with_probe(base, GRID, Probe())) == ""
    assert {"finished", "diverged"} <= set(alone.status)


@pytest.mark.parametrize("part", but_quick(("path", "disturbance", "actuator"), ("path",)))
def test_every_path_disturbance_and_actuator_can_march_side_by_side(part: str) -> None:
    """Each beside the others as they are."""
    base = loop("zigzag")
    rooms: dict[str, type[Component]] = {
        "path": Path,
        "disturbance": Disturbance,
        "actuator": Actuator,
    }
    for name, kind in kinds(f"podusv_cli.components.{part}s", rooms[part]).items():
        changed = replace(base, **{part: made(kind)})
        assert (name, why_alone(Plan.with_probe(changed, GRID, Probe()))) == (name, "")


def test_numbers_of_paths_and_currents_differ_from_run_to_run() -> None:
    """So do the pieces of a spline, and of a record, in which the runs are."""
    path, sea = (
        kinds("podusv_cli.components.paths", Path),
        kinds("podusv_cli.components.disturbances", Disturbance),
    )
    drifting = sea["current"](speed=0.1, speed_std=0.05, interval=0.1)  # type: ignore[call-arg]
    base = replace(loop("pid"), path=made(path["waypoints"]), disturbance=drifting)
    speeds = np.linspace(0.5, 60.0, COUNT)
    loops = variants(base, {"path.speed": speeds, "disturbance.interval": 0.01 * np.arange(1, 12)})
    ways = ("continue", "stop", "loop")
    mixed = [
        replace(one, path=one.path.model_copy(update={"after": ways[i % 3]}))
        for i, one in enumerate(loops * 3)
    ]
    same(*both(mixed, GRID))


@pytest.mark.parametrize("name", but_quick(SCENARIOS, ("sea/delay",)))
def test_a_sea_with_all_that_belongs_to_it_marches_side_by_side(name: str) -> None:
    """A scenario that podusv ships, from other starts."""
    scenario = load(ROOT / "configs" / f"{name}.yaml").scenario.singles()["adaptive_neural"]
    base = scenario.closed_loop()
    together, alone = both(spread(base), replace(scenario.time_grid(), steps=200))
    same(together, alone)
    assert why_alone(Plan.with_probe(base, GRID, Probe())) == ""
    assert {"finished", "diverged"} <= set(alone.status)
