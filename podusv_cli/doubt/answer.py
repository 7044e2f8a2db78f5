"""What is said of a claim: its verdict, what the verdict hangs on, and a word for both."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.core.phrases import as_yaml
from podusv_cli.doubt.alone import TriedChoice, Turn
from podusv_cli.doubt.events import Event
from podusv_cli.doubt.judged import Judged
from podusv_cli.doubt.together import Draws, Explained, counted, explained
from podusv_cli.expressions.verdict import Verdict
from podusv_cli.scenario.model import Scenario

KNIFE, FRAGILE = 1e-3, 0.1  # of a choice's scale, within which a verdict turns
LEVEL = 0.95  # of the bound on the share of draws that turn a verdict where none does
WORDS = (
    "knife's edge", "fragile", "under conditions", "in combination only",
    "robust where it can tell", "robust",
)  # fmt: skip


Spread = tuple[float, float, float]  # 5, 50 and 95 %; NaN where no draw has the number


class ClaimNumber(NamedTuple):
    """A number of a claim, and where a comparison of it turns.

    It is compared with a limit; against another number it is the ratio of the two. `edges` are the
    limit, or 1, as far as the claim's tolerance moves it; an equality has two.
    """

    left: str
    right: str
    edges: tuple[float, ...]

    @property
    def text(self) -> str:
        """The number as the claim has it."""
        return f"({self.left}) / ({self.right})" if self.right else self.left

    def of(self, numbers: Mapping[str, float]) -> float:
        """The number among those of a verdict; NaN where it is missing."""
        left, right = (numbers.get(text, math.nan) for text in (self.left, self.right))
        with np.errstate(all="ignore"):
            return float(np.divide(left, right)) if self.right else left

    def spread(self, claim: str, worlds: Sequence[Judged]) -> Spread:
        """Its spread over the draws that have it."""
        drawn = np.array([self.of(world.numbers.get(claim, {})) for world in worlds])
        finite = drawn[np.isfinite(drawn)]
        low, middle, high = np.quantile(finite if len(finite) else math.nan, (0.05, 0.5, 0.95))
        return float(low), float(middle), float(high)

    def margin(self, numbers: Mapping[str, float], spread: Spread) -> float:
        """Its distance from the nearest edge, in half-widths of the spread; infinite at 0."""
        low, _, high = spread
        away = min(abs(self.of(numbers) - edge) for edge in self.edges)
        return away / (0.5 * (high - low)) if high > low else math.inf


def compared(expect: str, tolerance: float = 0.0) -> list[ClaimNumber]:
    """What an expression compares; a condition such as `finished(run)` is 1 or 0."""
    tree = ast.parse(expect, mode="eval").body
    links = []
    for node in (node for node in ast.walk(tree) if isinstance(node, ast.Compare)):
        sides = pairwise([node.left, *node.comparators])
        links += [_link(*pair, sign, tolerance) for pair, sign in zip(sides, node.ops, strict=True)]
    return links or [ClaimNumber(ast.unparse(tree), "", (0.5,))]


# By how many tolerances the right side may be larger or smaller where a comparison turns.
SIDES: dict[type[ast.cmpop], tuple[float, ...]] = {
    ast.Eq: (-1.0, 1.0), ast.LtE: (1.0,), ast.GtE: (-1.0,),
}  # fmt: skip


def _link(left: ast.expr, right: ast.expr, sign: ast.cmpop, tolerance: float) -> ClaimNumber:
    """The tolerance is that of the right side, as `docs/claims.md` has it."""
    factors = tuple(1.0 + side * tolerance for side in SIDES.get(type(sign), (0.0,)))
    with suppress(ValueError):  # not a plain number
        limit = float(ast.literal_eval(right))
        edges = (limit + (factor - 1.0) * abs(limit) for factor in factors)
        return ClaimNumber(ast.unparse(left), "", tuple(edges))
    with suppress(ValueError):
        limit = float(ast.literal_eval(left))
        return ClaimNumber(ast.unparse(right), "", tuple(limit / factor for factor in factors))
    return ClaimNumber(ast.unparse(left), ast.unparse(right), factors)


@dataclass(frozen=True)
class Answer:
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
    acted: int  # of which so many change a number of the claim
    silent: int  # of which so many have a value at which nobody can tell
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


def _word(answer: Answer, turns: Sequence[Turn], turned: int) -> str:
    if answer.verdict.answer is None:
        return ""
    nearest = min((turn.share for turn in turns), default=math.nan)
    judged = answer.kept + answer.turned > 0 or not answer.failed
    dumb = answer.silent + answer.unknown > 0 or not judged
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
    answers: Sequence[Answer]
    tried: Tried


def answers(
    verdicts: Sequence[Verdict], tried: Tried, events: Mapping[str, Event | None] | None = None
) -> list[Answer]:
    """An answer on every verdict; `events` are those nearest to a claim's windows, by its name."""
    known = events or {}
    return [replace(_answer(verdict, tried), event=known.get(verdict.name)) for verdict in verdicts]


def labels_of(claim: Any) -> frozenset[str]:
    """The names in a claim's expressions, of runs among them."""
    texts = filter(None, (claim.expect, getattr(claim, "given", "")))
    nodes = (node for text in texts for node in ast.walk(ast.parse(text.strip(), mode="eval")))
    return frozenset(node.id for node in nodes if isinstance(node, ast.Name))


def _answer(verdict: Verdict, tried: Tried) -> Answer:
    claim, base, worlds = verdict.name, tried.base, tried.worlds
    labels = labels_of(verdict.claim)
    moved = [
        alone for alone in tried.alone
        if alone.possible and alone.choice.labels & labels and not alone.choice.is_contrast(labels)
    ]  # fmt: skip
    turns = sorted(
        (t for alone in moved for t in alone.turns(claim, base)), key=lambda turn: turn.share
    )
    acting = {alone.choice.name: alone.acts(claim, base) for alone in tried.alone}
    turned, known = counted(claim, worlds, base)
    failed = sum(bool(world.failed) for world in worlds)
    number, spread = _nearest(verdict, base, worlds)
    return Answer(
        verdict, tuple(t for t in turns if not t.choice.task),
        tuple(t for t in turns if t.choice.task),
        tuple(explained(tried.draws, turned, known, acting)),
        int((known & ~turned).sum()), int(turned.sum()), int((~known).sum()) - failed, failed,
        len(moved), sum(acting[alone.choice.name] for alone in moved),
        sum(alone.silences(claim) for alone in moved if not alone.choice.task), base.numbers[claim],
        number, spread,
    )  # fmt: skip


def _nearest(
    verdict: Verdict, base: Judged, worlds: Sequence[Judged]
) -> tuple[ClaimNumber, Spread]:
    """The number of a claim that is nearest to its limit, in half-widths of its draws."""
    numbers = compared(verdict.claim.expect, verdict.claim.tolerance)
    spreads = {n: n.spread(verdict.name, worlds) for n in numbers}
    own = base.numbers[verdict.name]
    number = min(spreads, key=lambda n: n.margin(own, spreads[n]))
    return number, spreads[number]


def place(turn: Turn) -> str:
    """Where a verdict turns: `start.psi +7e-06 rad`, or the word that turns it."""
    choice, unit = turn.choice, f" {turn.choice.unit}" if turn.choice.unit else ""
    if not choice.range:
        return f"{choice.name}: {as_yaml(turn.value)} ({as_yaml(choice.own)})"
    if turn.share < 0.01 or not choice.own:
        return f"{choice.name} {turn.value - choice.own:+.2g}{unit}"
    way = "from" if turn.value > choice.own else "down from"
    return f"{choice.name} {way} {turn.value:.3g}{unit} ({choice.own:.3g})"


def as_json(answer: Answer) -> dict[str, Any]:
    """An answer as plain data."""
    return {
        **answer.verdict.as_json(), "word": answer.word,
        "word_for_neighbours": answer.word_for_neighbours,
        "draws": {n: getattr(answer, n) for n in ("kept", "turned", "unknown", "failed")},
        "choices": {"moved": answer.tried, "acted": answer.acted, "silent": answer.silent},
        "turns": [turn_as_json(turn) for turn in (*answer.turns, *answer.neighbours)],
        "explained": [
            {"key": e.choice.name, "part": e.part, "inside": e.inside, "outside": e.outside}
            for e in answer.explained
        ],
        "number": answer.number.text, "edges": list(answer.number.edges), "spread": answer.spread,
        "event": answer.event and answer.event._asdict(),
    }  # fmt: skip


def turn_as_json(turn: Turn) -> dict[str, Any]:
    """A turn as plain data; a share of None where there is no distance."""
    return {
        "key": turn.choice.name, "own": turn.choice.own, "turns_at": turn.value, "held": turn.held,
        "unit": turn.choice.unit, "distance": turn.distance,
        "share": turn.share if math.isfinite(turn.share) else None, "task": turn.choice.task,
    }  # fmt: skip
