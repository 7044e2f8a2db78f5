"""A hull from logs in Python."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from podusv_cli.identify.answer import Identification
from podusv_cli.identify.outputs import Identified, rows_of_draws, vessel_keys


@dataclass(frozen=True, repr=False)
class IdentifiedHull:
    """A hull that logs gave, what is known of its errors, and the folder with all of it."""

    _done: Identified

    @property
    def folder(self) -> Path:
        """The folder of the result."""
        return self._done.folder

    @property
    def _answer(self) -> Identification:
        return self._done.answer

    def __repr__(self) -> str:
        """How many directions of the hull's numbers the logs determine, and if it is refused."""
        known, whole = self._answer.determined_count, len(self._answer.problem.hull)
        refused = ", refused" if self.refusal else ""
        return f"<podusv hull: {known} of {whole} directions determined{refused}, {self.folder}>"

    @property
    def refusal(self) -> str:
        """Why the hull is written as refused.yaml; "" where nothing speaks against it."""
        return self._done.refusal

    @property
    def vessel(self) -> dict[str, Any]:
        """The section `vessel` of a scenario."""
        return vessel_keys(self._answer)

    @cached_property
    def parameters(self) -> pd.DataFrame:
        """A row a number: before and after the logs, with 95 % intervals."""
        return pd.DataFrame([asdict(row) for row in self._answer.parameters])

    @cached_property
    def forces(self) -> pd.DataFrame:
        """A row a damping force at a speed of the logs, with 95 % intervals."""
        return pd.DataFrame([asdict(row) for row in self._answer.forces])

    @cached_property
    def scores(self) -> pd.DataFrame:
        """A row a log, a horizon and a way to predict: errors of free runs [m, rad]."""
        return pd.DataFrame([asdict(row) for row in self._answer.scores])

    @cached_property
    def draws(self) -> pd.DataFrame:
        """Hulls that the logs leave possible, a row each: the keys of `vessel` that differ."""
        return pd.DataFrame(rows_of_draws(self._answer))
