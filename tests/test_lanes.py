"""Runs side by side: every run has the bits that it has alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from podusv_cli.actuators.ideal import Ideal
from podusv_cli.actuators.saturated import Saturated
from podusv_cli.controllers.base import Controller
from podusv_cli.core.registry import kinds
from podusv_cli.engine.batch import Batch, simulate_many
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.lanes import why_alone
from podusv_cli.engine.simulate import ClosedLoop
from podusv_cli.engine.variants import variants
from podusv_cli.metrics.table import observer
from podusv_cli.scenario.load import load

ROOT = Path(__file__).resolve().parent.parent
LAWS = ("adaptive_neural", "dsc", "backstepping", "pid")
GRID = TimeGrid(0.01, 400)
COUNT = 11  # a whole bundle, and one with lanes left over
SCENARIO = load(ROOT / "configs" / "paper" / "corrected.yaml").scenario


def loop(law: str) -> ClosedLoop:
    """The task of the paper with a law."""
    kind = kinds("podusv_cli.controllers", Controller)[law]
    return replace(SCENARIO.closed_loop(), controller=kind())


def scattered(base: ClosedLoop, seed: int) -> list[ClosedLoop]:
    """Random starts, vessels and seas, of which some saturate, fold and diverge."""
    draws = np.random.default_rng(seed)
    return variants(
        base,
        {
            "start.x": draws.uniform(-5.0, 5.0, COUNT),
            "start.psi": draws.uniform(-3.0, 3.0, COUNT),
            "start.u": np.where(np.arange(COUNT) % 4 == 1, 1e150, draws.uniform(0, 1, COUNT)),
            "vessel.m": draws.uniform(15.0, 40.0, COUNT),
            "disturbance.scale": np.where(np.arange(COUNT) % 5 == 2, 3e5, 1.0),
        },
    )


def both(loops: list[ClosedLoop], grid: TimeGrid = GRID) -> tuple[Batch, Batch]:
    """The batch side by side and run by run."""
    watching = observer(loops[0], grid, steady_fraction=0.2, settling_radius=1.0)
    alone = simulate_many(loops, grid, observer=watching, side_by_side=False)
    return simulate_many(loops, grid, observer=watching, side_by_side=True), alone


def same(one: Batch, other: Batch) -> None:
    """The same bits everywhere."""
    assert one.status.tolist() == other.status.tolist()
    assert one.cause.tolist() == other.cause.tolist()
    assert one.reached.tolist() == other.reached.tolist()
    np.testing.assert_array_equal(one.state, other.state)
    np.testing.assert_array_equal(one.seen, other.seen)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("actuator", [Ideal(), Saturated()])
def test_runs_side_by_side_have_the_bits_that_they_have_alone(
    law: str, actuator: Ideal | Saturated
) -> None:
    """Also those that diverge, at different instants."""
    base = replace(loop(law), actuator=actuator)
    watching = observer(base, GRID, steady_fraction=0.2, settling_radius=1.0)
    assert why_alone(base, watching) == ""
    together, alone = both(scattered(base, 7))
    same(together, alone)
    assert {"finished", "diverged"} <= set(alone.status)
    assert len(set(alone.reached)) > 2
