"""Measurements as they are."""

from __future__ import annotations

from typing import Literal

from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.measurements.base import FRESH
from podusv_cli.core.kernel import Vector, kernel


class NoEstimator(Estimator):
    """The law works with each value as it was delivered last."""

    kind: Literal["none"] = "none"

    # seen as the sensors write it; changes state (6).
    @staticmethod
    @kernel
    def correct(seen: Vector, state: Vector) -> None:
        """Take over what is new."""
        for i in range(6):
            if seen[FRESH + i] != 0.0:
                state[i] = seen[i]

    @staticmethod
    @kernel
    def follow(rate: Vector) -> None:
        """Nothing moves between two deliveries."""
        for i in range(6):
            rate[i] = 0.0
