"""The true state."""

from __future__ import annotations

from typing import ClassVar, Literal

from podusv_cli.components.measurements.base import Measurement


class Exact(Measurement):
    """The law sees the true state at every time, as in most papers."""

    is_exact: ClassVar[bool] = True
    kind: Literal["exact"] = "exact"
