"""What is measured: the loop of configs/mu_2017/corrected.yaml with every law and network."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.network import Network
from podusv_cli.core.registry import kinds
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics.table import Metrics, metrics_probe
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario

ROOT = Path(__file__).resolve().parent.parent
SCENARIO = ROOT / "configs" / "mu_2017" / "corrected.yaml"
RIVALS = ROOT / "configs" / "laws" / "rivals.yaml"  # all laws on the same task

LAWS = ("adaptive_neural", "dsc", "full_backstepping", "pid")

# The grid of the scenario has 27 nodes; an axis with one node needs widths.
NETWORKS = {
    "9 grid": Network(nodes=(1, 3, 3), widths=(2.0, 0.7, 0.7)),
    "27 grid": Network(),
    "49 grid": Network(nodes=(7, 7, 1), widths=(0.5, 0.3, 1.0)),
    "125 grid": Network(nodes=(5, 5, 5)),
    "27 listed": Network(
        centers=tuple(map(tuple, Network().center_array().tolist())),
        widths=tuple(Network().width_array().tolist()),
    ),
}


@dataclass(frozen=True)
class Case:
    """A law and a network (a key of NETWORKS, or none for a law without one)."""

    law: str
    network: str = ""

    @property
    def label(self) -> str:
        """Law and network in words."""
        return f"{self.law}, {self.network}" if self.network else self.law

    def loop(self) -> ClosedLoop:
        """The closed loop with this law."""
        return replace(_scenario().closed_loop(), controller=self.controller())

    def controller(self) -> Controller:
        """The law with those of the scenario's values that it shares."""
        kind = kinds("podusv_cli.components.controllers", Controller)[self.law]
        given = _scenario().controller.model_dump(exclude={"kind"})
        fields: dict[str, Any] = {name: given[name] for name in kind.model_fields.keys() & given}
        if self.network:
            fields["network"] = NETWORKS[self.network]
        return kind(**fields)


@cache
def _scenario() -> Scenario:
    return load(SCENARIO).scenario


def rivals() -> dict[str, ClosedLoop]:
    """The closed loop of every law of `configs/laws/rivals.yaml`, by its name there."""
    scenario = load(RIVALS).scenario
    return {
        name: replace(scenario.closed_loop(), controller=law)
        for name, law in scenario.controllers.items()
    }


def grid(steps: int | None = None, log_every: int = 1) -> TimeGrid:
    """The scenario's time grid, or another number of its steps."""
    whole = _scenario().time_grid()
    return TimeGrid(whole.step, whole.steps if steps is None else steps, log_every)


def run_probe(loop: ClosedLoop, over: TimeGrid) -> Metrics:
    """The probe of `podusv run`, which gathers all metrics."""
    settings = _scenario().metrics
    return metrics_probe(
        Plan(loop, over),
        steady_fraction=settings.steady_fraction,
        settling_radius=settings.settling_radius,
    )


CASES = [Case(law, net) for law in LAWS[:-1] for net in NETWORKS] + [Case("pid")]
