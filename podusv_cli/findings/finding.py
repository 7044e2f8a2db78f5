"""A finding, and the scenario as the checks see it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from podusv_cli.core.finding_codes import CODES
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.findings.reference import Reference, reference
from podusv_cli.paths.base import TARGET
from podusv_cli.scenario.model import Scenario


@dataclass(frozen=True)
class Finding:
    """Something that a user should know: a code of `codes.CODES`, a scenario key, a sentence.

    `runs` are labels of the runs that it is about, where the comparison has others as well.
    """

    code: str
    where: str
    text: str
    runs: tuple[str, ...] = ()

    def __str__(self) -> str:
        """One line, as a command shows it."""
        return f"warning[{self.code}]: {self.place}: {self.text}"

    @property
    def place(self) -> str:
        """Runs and key: `dsc, pid: actuator`; the key alone where no run is named."""
        return ": ".join(filter(None, (", ".join(self.runs), self.where)))

    def as_json(self) -> dict[str, str]:
        """What `--json` prints of a run and metrics.json holds."""
        return {"code": self.code, "where": self.where, "text": self.text}


def found(code: str, text: str, where: str = "") -> Finding:
    """A finding at its code's key, or at a key below or beside it."""
    return Finding(code, where or CODES[code].key, text)


def heard(findings: Iterable[Finding], scenario: Scenario) -> list[Finding]:
    """The findings that the scenario does not silence."""
    return [finding for finding in findings if finding.code not in scenario.silence]


@dataclass(frozen=True)
class Case:
    """A scenario of one law, with what several checks need of it, computed once."""

    scenario: Scenario

    @cached_property
    def reference(self) -> Reference:
        """What following the target means for this vessel."""
        return reference(self.scenario)

    @property
    def first_velocity(self) -> Vector:
        """(u, v, r) at t = 0."""
        start = self.scenario.start
        return np.array([start.u, start.v, start.r])

    @cached_property
    def first(self) -> dict[str, float]:
        """The law's signals at t = 0; NaN where it has no numbers, as right on the target."""
        loop = self.scenario.closed_loop()
        law, memory = loop.controller, loop.first_memory()
        x, target = np.array(loop.start), np.zeros(len(TARGET))
        loop.path.evaluate(0.0, bundle(loop.path.constants()), loop.path.table(), target)
        k, table = bundle(law.informed(loop.nominal)), law.table()
        signals, rate = np.zeros(len(law.signals)), np.zeros(len(memory))
        work = np.zeros(law.workspace())
        try:
            if law.sample_period() > 0:
                law.sample(0.0, x, memory, target, k, table)
            law.law(0.0, x, memory, target, k, table, np.zeros(2), rate, signals, work)
        except (
            Exception
        ):  # plain Python's; a law's mistakes are told when it is asked, before the run
            signals[:] = np.nan
        return dict(zip(law.signals, signals.tolist(), strict=True))
