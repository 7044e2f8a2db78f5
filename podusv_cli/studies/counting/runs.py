"""The runs of a study: units of them as they are made, and all as statistics need them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from podusv_cli.core.about import MetricAbout
from podusv_cli.core.kernel import Vector

Mask = NDArray[Any]  # of booleans
# Columns of the table of all runs, ahead of the drawn quantities and behind them.
AXES, ENDING = ("law", "cell", "draw"), ("status", "success")
FAILED = ("failed_run", "failed_cause")  # in runs.h5, which runs have a cause, and the causes
SEAL = "sha256"  # of `status`, `until` and the metrics, in the order of the file
SEAL_OF_THE_REST = "sha256_rest"  # of axes, causes and drawn quantities; the first tables have none
DRAWN = "drawn"  # the group of drawn quantities
OWN = (*AXES, *FAILED, "status", "until", DRAWN, SEAL, SEAL_OF_THE_REST)  # are no metrics


# How a run can end. The position is the code in files; "missing" is a run that is not made yet.
STATUSES = ("finished", "diverged", "hung", "crashed", "invalid", "missing")
BROKEN = ("hung", "crashed", "invalid")  # no results of the law
NOT_MADE = STATUSES.index("missing")
Codes = NDArray[np.uint8]


@dataclass(frozen=True, order=True)
class Unit:
    """Draws `first` to `first + count - 1` of a law in a cell."""

    law: str
    cell: int
    first: int
    count: int

    @property
    def draws(self) -> range:
        """The numbers of the draws."""
        return range(self.first, self.first + self.count)

    def halves(self) -> tuple[Unit, Unit]:
        """The unit as two halves; repeated halving finds the run that crashes a process."""
        half = self.count // 2
        return (
            Unit(self.law, self.cell, self.first, half),
            Unit(self.law, self.cell, self.first + half, self.count - half),
        )


@dataclass(frozen=True)
class UnitResult:
    """What came of a unit; one number a draw.

    `metrics` by name, NaN where a run ended before one is defined. `status` holds positions in
    STATUSES, `until` the time that a run reached [s], `causes` why it did not finish, else "".
    """

    unit: Unit
    metrics: Mapping[str, Vector]
    status: Codes
    until: Vector
    causes: tuple[str, ...]


class StudyRuns(Protocol):
    """Arrays over (cell, draw); every law meets the same draws."""

    @property
    def laws(self) -> Sequence[str]:
        """Names of the laws."""

    @property
    def metrics(self) -> Sequence[str]:
        """Names of the metrics that runs have."""

    @property
    def cells(self) -> Sequence[str]:
        """A label for every cell; "" for the only cell of a study without a grid."""

    @property
    def wanted(self) -> int:
        """Draws of each cell that were asked for."""

    def metric(self, law: str, name: str) -> Vector:
        """A metric of every run; NaN where the run has none of this name."""

    def done(self, law: str) -> Mask:
        """Whether the run was tried and is to count; the arrays mean nothing where it was not."""

    def finished(self, law: str) -> Mask:
        """Whether the run reached its end."""

    def success(self, law: str) -> Mask:
        """Whether the run was a success; any other counts as failed, and as the worst."""

    def broken(self, law: str) -> Mask:
        """Whether the run crashed, hung or was invalid: no result of the law."""


def worst(about: MetricAbout, values: Vector, failed: Mask) -> Vector:
    """A metric with the worst for `failed` runs and for the time of what never happened.

    The worst is +inf, or -inf for a metric of which more is better (`about.margin`). A time that is
    NaN belongs to an event that never happened (`about.happens`). All arrays are (cells, draws).
    """
    never = np.isnan(values) if about.happens else False
    return np.where(failed | never, -np.inf if about.margin else np.inf, values)
