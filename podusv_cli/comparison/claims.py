"""Verdicts on the claims of a scenario, always with the numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from podusv_cli.comparison.expressions import Sources
from podusv_cli.comparison.parsing import ExpressionError, parse
from podusv_cli.config.scenario import Claim, Scenario

Answer = Literal["reproduced", "not reproduced", "cannot tell"]
ANSWERS: dict[bool | None, Answer] = {
    True: "reproduced",
    False: "not reproduced",
    None: "cannot tell",
}


@dataclass(frozen=True)
class Verdict:
    """What the runs say of a claim; `numbers` holds every quantity that was compared."""

    name: str
    claim: Claim
    answer: Answer
    numbers: dict[str, float]

    def shown(self) -> str:
        """The numbers in a line."""
        return ", ".join(f"{text} = {number:.4g}" for text, number in self.numbers.items())

    def as_json(self) -> dict[str, object]:
        """The verdict as plain data, undefined numbers as None."""
        numbers = {text: v if math.isfinite(v) else None for text, v in self.numbers.items()}
        return {
            "claim": self.name,
            **self.claim.model_dump(),
            "verdict": self.answer,
            "numbers": numbers,
        }


def misfits(scenario: Scenario) -> list[tuple[str, str]]:
    """Key and sentence for every claim whose expression cannot be understood."""
    found = []
    for name, claim in scenario.claims.items():
        try:
            parse(claim.expect, scenario.labels())
        except ExpressionError as error:
            found.append((f"claims.{name}.expect", str(error)))
    return found


def judge(claims: Mapping[str, Claim], runs: Sources) -> list[Verdict]:
    """A verdict on every claim."""
    verdicts = []
    for name, claim in claims.items():
        numbers: dict[str, float] = {}
        holds = parse(claim.expect, runs).holds(runs, claim.tolerance, numbers)
        verdicts.append(Verdict(name, claim, ANSWERS[holds], numbers))
    return verdicts


def as_markdown(verdicts: Sequence[Verdict]) -> str:
    """The verdicts as a table, choices and remarks below it."""
    rows = [
        f"| {v.name} | {v.claim.says} ({v.claim.source}) | **{v.answer}** | "
        f"`{v.claim.expect}`, tolerance {v.claim.tolerance:g} | {v.shown()} |"
        for v in verdicts
    ]
    remarks = [f"- {v.name}: {v.claim.remark}" for v in verdicts if v.claim.remark]
    head = ["| | claim | verdict | put as | numbers |", "|---|---|---|---|---|"]
    return "\n".join([*head, *rows, *(["", *remarks] if remarks else []), ""])
