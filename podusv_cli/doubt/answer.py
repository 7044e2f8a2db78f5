"""What is said of a claim: its verdict, what the verdict hangs on, and a word for both."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from podusv_cli.core.phrases import as_yaml
from podusv_cli.doubt.alone import TriedChoice, Turn
from podusv_cli.doubt.compared import ClaimNumber, Spread, compared_numbers
from podusv_cli.doubt.events import Event
from podusv_cli.doubt.judged import Judged
from podusv_cli.doubt.together import Draws, Explained, count_turns, explain_turns
from podusv_cli.expressions.verdict import Verdict
from podusv_cli.scenario.model import Scenario

KNIFE, FRAGILE = 1e-3, 0.1  # of a choice's scale, within which a verdict turns
LEVEL = 0.95  # of the bound on the share of draws that turn a verdict where none does
WORDS = (
    "knife's edge",
    "fragile",
    "under conditions",
    "in combination only",
    "robust where it can tell",
    "robust",
)


@dataclass(frozen=True)
class DoubtAnswer:
    """A claim's verdict and what it hangs on.

    `turns` are those of the same task, the nearest first; `neighbours` those by which the task is
    another. `kept`, `turned`, `unknown` and `failed` count draws of all choices at once: with the
    verdict, with the opposite, without an answer, and without a world.
    """

    verdict: Verdict
    turns: tuple[Turn, ...]
    neighbours: tuple[Turn, ...]
    explained: tuple[Explained, ...]
    kept: int
    turned: int
    unknown: int
    failed: int
    tried: int  # choices that were moved
    acted: int  # how many of them change a number of the claim
    silent: int  # how many of them have a value that leaves the claim open
    numbers: Mapping[str, float]  # of the claim, by their text
    number: ClaimNumber  # which of its numbers is nearest to its limit
    spread: Spread  # of this number over the draws
    event: Event | None = None  # nearest to a window of the claim, in the scenario itself

    @property
    def draws(self) -> int:
        """How many draws there are."""
        return self.kept + self.turned + self.unknown + self.failed

    @property
    def word(self) -> str:
        """What the verdict is for this task; "" where nobody can tell."""
        return _word(self, self.turns, self.turned)

    @property
    def word_for_neighbours(self) -> str:
        """What it is where the task may be another, too."""
        return _word(self, (*self.turns, *self.neighbours), self.turned)

    @property
    def bound(self) -> float:
        """The largest share of draws that may turn it, at 95 % confidence, where none does."""
        known = self.kept + self.turned
        return 1.0 - (1.0 - LEVEL) ** (1.0 / known) if known and not self.turned else math.nan

    @property
    def margin(self) -> float:
        """How far its number is from the limit, in half-widths of 5 to 95 % of the draws.

        Infinite where the draws do not change the number.
        """
        return self.number.margin(self.numbers, self.spread)


def _word(answer: DoubtAnswer, turns: Sequence[Turn], turned: int) -> str:
    """The word for an answer, "" where there is no verdict: the first that applies, worst first.

    `turns` are of single choices, `turned` counts draws of all at once.
    """
    if answer.verdict.answer is None:
        return ""
    nearest = min((turn.share for turn in turns), default=math.nan)
    judged = answer.kept + answer.turned > 0 or not answer.failed
    dumb = answer.silent + answer.unknown > 0 or not judged
    # In the order of WORDS; a comparison with NaN (no turn) is false.
    reached = (nearest <= KNIFE, nearest <= FRAGILE, bool(turns), turned > 0, dumb, True)
    return WORDS[reached.index(True)]


@dataclass(frozen=True)
class Tried:
    """What was tried: the scenario itself, each choice alone, and all choices at once."""

    base: Judged
    alone: Sequence[TriedChoice]
    draws: Draws
    worlds: Sequence[Judged]


@dataclass(frozen=True)
class DoubtReport:
    """What figures and page are about: a scenario, the answers on its claims, what was tried."""

    scenario: Scenario
    answers: Sequence[DoubtAnswer]
    tried: Tried


def answers(
    verdicts: Sequence[Verdict], tried: Tried, events: Mapping[str, Event | None] | None = None
) -> list[DoubtAnswer]:
    """An answer on every verdict; `events` are those nearest to a claim's windows, by its name."""
    known = events or {}
    return [replace(_answer(verdict, tried), event=known.get(verdict.name)) for verdict in verdicts]


def labels_of(claim: Any) -> frozenset[str]:
    """The names in a claim's expressions, of runs among them."""
    texts = filter(None, (claim.expect, getattr(claim, "given", "")))
    nodes = (node for text in texts for node in ast.walk(ast.parse(text.strip(), mode="eval")))
    return frozenset(node.id for node in nodes if isinstance(node, ast.Name))


def _answer(verdict: Verdict, tried: Tried) -> DoubtAnswer:
    """All that was found of one claim: single turns, draws together, and what explains them."""
    claim, base, worlds = verdict.name, tried.base, tried.worlds
    labels = labels_of(verdict.claim)
    # Choices that the claim's laws have, and that it does not compare.
    moved = [
        alone
        for alone in tried.alone
        if alone.possible and alone.choice.labels & labels and not alone.choice.is_contrast(labels)
    ]
    turns = sorted(
        (t for alone in moved for t in alone.turns(claim, base)), key=lambda turn: turn.share
    )
    acting = {alone.choice.name: alone.acts(claim, base) for alone in tried.alone}
    turned, known = count_turns(claim, worlds, base)
    failed = sum(bool(world.failed) for world in worlds)
    number, spread = _nearest(verdict, base, worlds)
    return DoubtAnswer(
        verdict=verdict,
        turns=tuple(t for t in turns if not t.choice.task),
        neighbours=tuple(t for t in turns if t.choice.task),
        explained=tuple(explain_turns(tried.draws, turned, known, acting)),
        kept=int((known & ~turned).sum()),
        turned=int(turned.sum()),
        # A world that failed has no answer either; it is counted apart.
        unknown=int((~known).sum()) - failed,
        failed=failed,
        tried=len(moved),
        acted=sum(acting[alone.choice.name] for alone in moved),
        silent=sum(alone.silences(claim) for alone in moved if not alone.choice.task),
        numbers=base.numbers[claim],
        number=number,
        spread=spread,
    )


def _nearest(
    verdict: Verdict, base: Judged, worlds: Sequence[Judged]
) -> tuple[ClaimNumber, Spread]:
    """The number of a claim that is nearest to its limit, and its spread over the draws.

    `base` is the scenario as it is, `worlds` are the draws. Distances are compared in half-widths
    of each number's spread.
    """
    numbers = compared_numbers(verdict.claim.expect, verdict.claim.tolerance)
    spreads = {n: n.spread(verdict.name, worlds) for n in numbers}
    own = base.numbers[verdict.name]
    number = min(spreads, key=lambda n: n.margin(own, spreads[n]))
    return number, spreads[number]


def place(turn: Turn) -> str:
    """Where a verdict turns: `start.psi +7e-06 rad`, or the word that turns it."""
    choice, unit = turn.choice, f" {turn.choice.unit}" if turn.choice.unit else ""
    if not choice.range:
        return f"{choice.name}: {as_yaml(turn.value)} ({as_yaml(choice.own)})"
    own = "" if turn.near else f" ({choice.own:.3g})"
    return f"{choice.name} {describe_turn(turn)}{unit}{own}"


def describe_turn(turn: Turn) -> str:
    """The number that turns a verdict, `down from 0.36`; near its own how far from it, `+7e-06`."""
    if turn.near:
        return f"{turn.value - turn.choice.own:+.2g}"
    return f"{'from' if turn.value > turn.choice.own else 'down from'} {turn.value:.3g}"


def as_json(answer: DoubtAnswer) -> dict[str, Any]:
    """An answer as plain data, as the doubt's JSON file has it."""
    return {
        **answer.verdict.as_json(),
        "word": answer.word,
        "word_for_neighbours": answer.word_for_neighbours,
        "draws": {n: getattr(answer, n) for n in ("kept", "turned", "unknown", "failed")},
        "choices": {"moved": answer.tried, "acted": answer.acted, "silent": answer.silent},
        "turns": [turn_as_json(turn) for turn in (*answer.turns, *answer.neighbours)],
        "explained": [
            {"key": e.choice.name, "part": e.part, "inside": e.inside, "outside": e.outside}
            for e in answer.explained
        ],
        "number": answer.number.text,
        "edges": list(answer.number.edges),
        "spread": answer.spread,
        "event": answer.event and answer.event._asdict(),
    }


def turn_as_json(turn: Turn) -> dict[str, Any]:
    """A turn as plain data; a share of None where there is no distance."""
    return {
        "key": turn.choice.name,
        "own": turn.choice.own,
        "turns_at": turn.value,
        "held": turn.held,
        "unit": turn.choice.unit,
        "distance": turn.distance,
        "share": turn.share if math.isfinite(turn.share) else None,
        "task": turn.choice.task,
    }
