"""The instants of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

ROUNDED = 1e-6  # steps; more than rounding can make of a whole number of them


@dataclass(frozen=True)
class TimeGrid:
    """Instants k * step for k = 0 .. steps; `log_every`, `hold_every` in steps, 0 for no hold.

    With `update_first` a held law takes a sample into its memory before it forms the demand.
    """

    step: float
    steps: int
    log_every: int = 1
    hold_every: int = 0
    update_first: bool = False

    def last_part(self, fraction: float) -> float:
        """The first instant of the last part of the run that is this fraction of it [s]."""
        return math.ceil((1.0 - fraction) * self.steps - ROUNDED) * self.step

    @property
    def rows(self) -> int:
        """How many instants are logged: every `log_every`-th from the start."""
        return self.steps // self.log_every + 1
