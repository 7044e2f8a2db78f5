"""Runs of a study made of given numbers, for tests of claims, tables and figures."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from podusv_cli.core.about import Claim
from podusv_cli.metrics.table import METRICS
from podusv_cli.studies.counting.claims import ParsedStudyClaim, judge, parse
from podusv_cli.studies.counting.verdict import StudyVerdict
from podusv_cli.studies.telling import summary as tables


def summary(runs: Any) -> pd.DataFrame:
    return pd.DataFrame(tables.summary(runs, 0.95, METRICS))


def pairs(runs: Any, margin: float = 0.01, **given: Any) -> pd.DataFrame:
    return pd.DataFrame(tables.pairs(runs, margin, 0.95, METRICS, **given))


def sensitivity(runs: Any, draws: Any) -> pd.DataFrame:
    return pd.DataFrame(tables.sensitivity(runs, draws, 0.95, METRICS))


@dataclass(frozen=True)
class Made:
    """Runs with these metrics by law and name, over (cell, draw); iae of inf is a failed run."""

    values: Mapping[str, Mapping[str, Any]]
    cells: Sequence[str] = ("",)
    wanted: int = 0
    undone: Mapping[str, Any] = field(default_factory=dict)  # masks
    broke: Mapping[str, Any] = field(default_factory=dict)
    poor: Mapping[str, Any] = field(default_factory=dict)  # finished, but no success

    @property
    def laws(self) -> list[str]:
        return list(self.values)

    @property
    def metrics(self) -> list[str]:
        return list(dict.fromkeys(name for metrics in self.values.values() for name in metrics))

    def metric(self, law: str, name: str) -> Any:
        nothing = np.full(self.done(law).shape, math.nan)
        values = np.atleast_2d(self.values[law].get(name, nothing))
        return np.where(self.finished(law), values, math.nan)  # as a run that diverged has it

    def finished(self, law: str) -> Any:
        return ~np.isposinf(np.atleast_2d(self.values[law]["iae"]))

    def success(self, law: str) -> Any:
        return self.finished(law) & ~np.broadcast_to(
            self.poor.get(law, False), self.done(law).shape
        )

    def done(self, law: str) -> Any:
        shape = np.atleast_2d(self.values[law]["iae"]).shape
        return ~np.broadcast_to(self.undone.get(law, False), shape)

    def broken(self, law: str) -> Any:
        shape = np.atleast_2d(self.values[law]["iae"]).shape
        return np.broadcast_to(self.broke.get(law, False), shape)


def study(cells: Sequence[str] = ("",), **iae: Any) -> Made:
    """Runs with the IAE of each law."""
    shape = np.atleast_2d(next(iter(iae.values()))).shape
    return Made({law: {"iae": values} for law, values in iae.items()}, cells, shape[-1])


def claim(
    expect: str, laws: Sequence[str], tolerance: float = 0.0, name: str = "S1"
) -> ParsedStudyClaim:
    stated = Claim(says="One is better.", source="ours", expect=expect, tolerance=tolerance)
    return ParsedStudyClaim(name, stated, parse(expect, laws, METRICS))


def judged(runs: Made, *expected: str, tolerance: float = 0.0, level: float = 0.95) -> Any:
    """Verdicts on claims put like this; a single one alone."""
    claims = [claim(text, runs.laws, tolerance, f"S{i}") for i, text in enumerate(expected, 1)]
    verdicts: list[StudyVerdict] = judge(claims, runs, level, METRICS)
    return verdicts if len(verdicts) > 1 else verdicts[0]
