"""Runs that a scenario cannot be given its draw for, found before anything is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random

from podusv_cli.scenario.address import ValueRefused
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.studies.making.check import singles
from podusv_cli.studies.making.draws import drawing, draws
from podusv_cli.studies.making.plan import StudyPlan

MOST_TRIED = 2000  # runs, about a second


@dataclass(frozen=True)
class Invalid:
    """How many runs cannot take their draw, the first such draw, and why it cannot."""

    count: int
    first: int
    reason: str
    tried: int
    wanted: int

    def in_words(self) -> str:
        """How many runs are invalid, of those that were tried, and the first."""
        share = self.count / self.tried
        more = "" if self.tried == self.wanted else f", of {self.wanted:,}"
        first = f"; draw {self.first}: {self.reason}" if self.count else ""
        return f"invalid runs: {self.count:,} of {self.tried:,} tried ({share:.2%}){more}{first}"


def check_draws(made: StudyPlan) -> Invalid:
    """The first draws of a study, each in as many laws and cells as there is time for."""
    runs = [single for cell in made.cells for single in singles(cell.scenario).values()]
    return invalid_runs(runs, made.sweep)


def invalid_runs(scenarios: Sequence[Scenario], sweep: Sweep, most: int = MOST_TRIED) -> Invalid:
    """Try draws in the scenarios of each law and cell, `most` runs at most; how many are refused.

    The draws come first: of 100 laws and cells, 2000 draws in one each say more of what is drawn
    than 20 draws in all. Which ones a draw meets is random, since every fourth point of a Sobol'
    sequence is in the same half.
    """
    count = min(sweep.draws, most)
    each = min(len(scenarios), most // count)
    pick, reasons = Random(sweep.seed), list[tuple[int, str]]()
    drawn = [drawing(scenario, sweep.vary) for scenario in scenarios]
    for number, draw in enumerate(draws(sweep, 0, count)):
        for place in sorted(pick.sample(range(len(scenarios)), each)):
            try:
                drawn[place](draw)
            except ValueRefused as error:
                reasons.append((number, str(error)))
    first = reasons[0] if reasons else (0, "")
    return Invalid(len(reasons), *first, count * each, len(scenarios) * sweep.draws)
