"""Verdicts on the claims of a scenario, always with the numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from podusv_cli.comparison.conditions import Evidence
from podusv_cli.comparison.expressions import Sources
from podusv_cli.comparison.parsing import ExpressionError, parse, renamed
from podusv_cli.core.escaping import markdown, markdown_cell, markdown_code
from podusv_cli.core.signal import Signal
from podusv_cli.metrics.table import CLOCKED
from podusv_cli.scenario.explain import signals as registered
from podusv_cli.scenario.model import Claim, Scenario

Answer = Literal["reproduced", "not reproduced", "cannot tell"]
ANSWERS: dict[bool | None, Answer] = {
    True: "reproduced",
    False: "not reproduced",
    None: "cannot tell",
}


@dataclass(frozen=True)
class Stated:
    """A claim of one scenario: `called` has the labels of its runs in the comparison by the names
    that the scenario has for them.
    """

    name: str
    claim: Claim
    called: Mapping[str, str]


@dataclass(frozen=True)
class Verdict:
    """What the runs say of a claim.

    `numbers` holds every quantity that was compared, NaN where there is none; `reason` says why
    nothing can be told, "" where something can.
    """

    name: str
    claim: Claim
    answer: Answer
    numbers: dict[str, float]
    reason: str = ""

    @property
    def timed(self) -> bool:
        """Whether it rests on a clock's readings, which are others the next time."""
        return any(f".{name}" in self.claim.expect for name in CLOCKED)

    def shown(self) -> str:
        """The numbers in a line, and what is missing."""
        numbers = (
            f"{text} = {number:.4g}"
            for text, number in self.numbers.items()
            if not math.isnan(number)
        )
        return "; ".join(part for part in (", ".join(numbers), self.reason) if part)

    def as_json(self) -> dict[str, object]:
        """The verdict as plain data, undefined numbers as None."""
        numbers = {text: v if math.isfinite(v) else None for text, v in self.numbers.items()}
        return {
            "claim": self.name,
            **self.claim.model_dump(),
            "verdict": self.answer,
            "numbers": numbers,
            "reason": self.reason,
        }


def misfits(scenario: Scenario) -> list[tuple[str, str]]:
    """Key and sentence for every claim whose expression cannot be understood."""
    found, signals = [], _signals(single.about() for single in scenario.singles().values())
    for name, claim in scenario.claims.items():
        try:
            parse(claim.expect, scenario.labels(), signals)
        except ExpressionError as error:
            found.append((f"claims.{name}.expect", str(error)))
    return found


def judge(stated: Sequence[Stated], runs: Sources) -> list[Verdict]:
    """A verdict on every claim; in it, the claim is put with the runs' labels."""
    signals = _signals(run.about for run in runs.values())
    return [_verdict(said, runs, signals) for said in stated]


def _signals(runs: Iterable[Mapping[str, Signal]]) -> dict[str, Signal]:
    """What claims can be about: everything that podusv can log, and what these runs log."""
    return {signal.name: signal for signal in registered()} | {
        name: signal for about in runs for name, signal in about.items()
    }


def _verdict(said: Stated, runs: Sources, signals: Mapping[str, Signal]) -> Verdict:
    claim, found = said.claim, Evidence()
    holds = parse(claim.expect, runs, signals, said.called).holds(runs, claim.tolerance, found)
    reason = "; ".join(dict.fromkeys(found.doubts)) if holds is None else ""
    put = claim.model_copy(update={"expect": renamed(claim.expect, said.called)})
    return Verdict(said.name, put, ANSWERS[holds], found.numbers, reason)


def as_markdown(verdicts: Sequence[Verdict], timed: Sequence[Verdict] = (), place: str = "") -> str:
    """The verdicts as a table, choices and remarks below it; those `timed` are in `place`."""
    rows = [
        f"| {markdown_cell(v.name)} | "
        f"{markdown_cell(v.claim.says)} ({markdown_cell(v.claim.source)}) | "
        f"**{v.answer}** | {markdown_code(v.claim.expect)}, tolerance {v.claim.tolerance:g} | "
        f"{markdown_cell(v.shown())} |"
        for v in verdicts
    ]
    remarks = [
        f"- {markdown(v.name)}: {markdown(v.claim.remark)}" for v in verdicts if v.claim.remark
    ]
    remarks += [
        f"- {markdown(v.name)}: judged by times, which never repeat; see {place}" for v in timed
    ]
    head = ["| | claim | verdict | put as | numbers |", "|---|---|---|---|---|"]
    return "\n".join([*head, *rows, *(["", *remarks] if remarks else []), ""])
