"""The runs of a study, as its statistics, tables and claims need them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from podusv_cli.core.kernel import Vector
from podusv_cli.metrics.metric import Metric

Mask = NDArray[Any]  # of booleans
# Columns of the table of all runs, ahead of the drawn quantities and behind them.
AXES, ENDING = ("law", "cell", "draw"), ("status", "success")
FAILED = ("failed_run", "failed_cause")  # in runs.h5, which runs have a cause, and the causes
SEAL = "sha256"  # of `status`, `until` and the metrics, in the order of the file
SEAL_OF_THE_REST = "sha256_rest"  # of axes, causes and drawn quantities; the first tables have none
DRAWN = "drawn"  # the group of drawn quantities
OWN = (*AXES, *FAILED, "status", "until", DRAWN, SEAL, SEAL_OF_THE_REST)  # are no metrics


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


def worst(about: Metric, values: Vector, failed: Mask) -> Vector:
    """A metric with the worst, +inf, for failed runs and for the time of what never happened."""
    never = np.isnan(values) if about.happens else False
    return np.where(failed | never, np.inf, values)
