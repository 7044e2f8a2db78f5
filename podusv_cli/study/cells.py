"""The cells of a study: every combination of the values of its grid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from podusv_cli.core.errors import UsageError
from podusv_cli.scenario.model import Scenario


@dataclass(frozen=True)
class Cell:
    """A combination of values of the grid: its position, a label, and the scenario with them."""

    index: int
    label: str
    scenario: Scenario


def cells(scenario: Scenario) -> Iterator[Cell]:
    """The cells of a scenario with the key `sweep`. Raises UsageError for a grid."""
    if scenario.sweep and scenario.sweep.grid:
        raise UsageError("sweep.grid is not supported yet; make a study for each of its values")
    yield Cell(0, "", scenario)
