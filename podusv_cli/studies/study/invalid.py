"""Draws that a scenario cannot take, found before anything is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from podusv_cli.scenario.address import ValueRefused
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.studies.study.check import singles
from podusv_cli.studies.study.draws import drawn, draws
from podusv_cli.studies.study.plan import Plan

MOST_TRIED = 2000  # scenarios with a draw in them, about a second


@dataclass(frozen=True)
class Invalid:
    """How many of the first draws cannot be taken, the first of them, and why it cannot."""

    count: int
    first: int
    reason: str
    checked: int
    wanted: int

    def in_words(self) -> str:
        """How many draws are invalid, of those that were checked, and the first."""
        share = self.count / max(1, self.checked)
        more = "" if self.checked == self.wanted else f"; the first of {self.wanted:,}"
        first = f"; draw {self.first}: {self.reason}" if self.count else ""
        return f"invalid draws: {self.count:,} of {self.checked:,} ({share:.2%}){more}{first}"


def check_draws(made: Plan) -> Invalid:
    """The first draws of a study, taken by every law in every cell."""
    runs = [one for cell in made.cells for one in singles(cell.scenario).values()]
    return invalid_draws(runs, made.sweep, max(1, MOST_TRIED // len(runs)))


def invalid_draws(scenarios: Sequence[Scenario], sweep: Sweep, count: int) -> Invalid:
    """So many draws at most, taken by every scenario: one for each law and cell."""
    checked, reasons = min(count, sweep.draws), dict[int, str]()
    for number, draw in enumerate(draws(sweep, 0, checked)):
        for one in scenarios:
            try:
                drawn(one, sweep.vary, draw)
            except ValueRefused as error:
                reasons.setdefault(number, str(error))
    first = min(reasons, default=0)
    return Invalid(len(reasons), first, reasons.get(first, ""), checked, sweep.draws)
