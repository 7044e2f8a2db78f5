"""One choice at a time: which values turn a verdict, and where the nearest of them lies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.compared import ClaimNumber
from podusv_cli.doubt.judged import Judge, Judged, world_with

NEAR = 1e-4  # of the scale: how near the search looks before it looks at rounding
BETWEEN = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85)  # of the range, for verdicts that turn and turn back
SHOWING = (0.5, 1.0)  # of the range, where a number that changes none shows that it does not act
LOOKS = 12  # steps of golden section: to a 300th of the way between two places
STEEPER = 3.0  # times as steep as between the places may a number fall to its edge
GOLDEN = 0.5 * (3.0 - math.sqrt(5.0))  # of an interval: the part that a golden section cuts off
SHARP = 1.02  # ratio of distances to which a turn is known
BY_SEED = 0.1  # in scales; the distance of another seed, which is no number that moves
EDGES = (1e-12, 1.0 - 1e-12)  # shares of a distribution that are its ends


@dataclass(frozen=True)
class TriedValue:
    """A value of one choice, and what the claims say there."""

    value: Any
    judged: Judged


@dataclass(frozen=True)
class Turn:
    """Where a verdict turns: the nearest value that turns it, and the last before that keeps it.

    `distance` is that of the value from the scenario's own; 0 for words.
    """

    choice: Choice
    value: Any
    held: Any
    distance: float

    @property
    def share(self) -> float:
        """The distance over the choice's scale; infinite where there is none, as of words.

        Another seed has that of `BY_SEED`, since nothing tells it from the scenario's own.
        """
        if self.choice.range:
            return self.distance / self.choice.range.scale
        return BY_SEED if self.choice.name.endswith("seed") else math.inf

    @property
    def near(self) -> bool:
        """Whether its distance says more than its value: beside the scenario's own, or from 0."""
        return self.share < 0.01 or not self.choice.own

    @property
    def by_rounding(self) -> bool:
        """Whether one unit in the last place turns it."""
        return self.distance > 0.0 and self.held == self.choice.own and self.share < NEAR


@dataclass(frozen=True)
class TriedChoice:
    """All that was tried of one choice."""

    choice: Choice
    trials: tuple[TriedValue, ...]

    @property
    def possible(self) -> bool:
        """Whether the scenario can take any of the values."""
        return any(not trial.judged.failed for trial in self.trials)

    def silences(self, claim: str) -> bool:
        """Whether a value leaves a claim without an answer."""
        judged = (trial.judged for trial in self.trials if not trial.judged.failed)
        return any(world.answers.get(claim) is None for world in judged)

    def acts(self, claim: str, base: Judged) -> bool:
        """Whether any value changes a number of the claim."""
        return any(not t.judged.failed and not t.judged.same(claim, base) for t in self.trials)

    def turns(self, claim: str, base: Judged) -> list[Turn]:
        """Where a claim's verdict turns: at words, or at the nearest number on each side.

        Each word that turns it is listed.
        """
        turned = [t for t in self.trials if t.judged.contradicts(claim, base)]
        if not self.choice.range:
            return [Turn(self.choice, t.value, self.choice.own, 0.0) for t in turned]
        sides = ([t for t in turned if (t.value > self.choice.own) == up] for up in (True, False))
        # Numbers at which the answer is the scenario's own.
        holding = [
            t.value for t in self.trials if t.judged.answers.get(claim) is base.answers[claim]
        ]
        return [self._nearest(side, holding) for side in sides if side]

    def _nearest(self, turned: Sequence[TriedValue], holding: Sequence[float]) -> Turn:
        """The turn nearest to the scenario's own value, among `turned` trials of one side.

        `holding` are values with the same answer; the farthest of them before the turn bounds it.
        """
        own = self.choice.own
        first = min(turned, key=lambda t: abs(t.value - own))
        inside = [
            value
            for value in holding
            if (value > own) == (first.value > own) and abs(value - own) < abs(first.value - own)
        ]
        held = max(inside, key=lambda value: abs(value - own), default=own)
        return Turn(self.choice, first.value, held, abs(first.value - own))


def explore_choice(
    choice: Choice, judge: Judge, base: Judged, numbers: Mapping[str, Sequence[ClaimNumber]]
) -> TriedChoice:
    """Try the values of a choice, and find where verdicts turn.

    `base` is the world as it is; `numbers` are those that each claim compares, by its name.
    """
    if not choice.range:
        return TriedChoice(
            choice, tuple(TriedValue(v, judge(world_with(choice, v))) for v in choice.values)
        )
    sides = [_Side(choice, end, judge, base) for end in ends(choice)]
    # Most numbers act on no claim, which two looks a side show.
    acting = any(
        _acts(side.judge_at(share * side.whole), claim, base)
        for side in sides
        for share in SHOWING
        for claim in base.answers
    )
    for side in sides if acting else ():
        places = side.tried_between()
        for claim in base.answers:
            for number in numbers[claim]:
                _look_nearer(side, places, claim, number)
        for claim in base.answers:
            _bisect(side, claim)
    return TriedChoice(
        choice, tuple(TriedValue(*t) for side in sides for t in side.trials.values())
    )


def _acts(judged: Judged, claim: str, base: Judged) -> bool:
    """Whether a world changes any number of the claim."""
    return not judged.failed and not judged.same(claim, base)


def ends(choice: Choice) -> list[float]:
    """The two ends of the range, one where the other is the choice's own value."""
    assert choice.range
    way, own = choice.range.alone, choice.own
    drawn = way.distribution.at(np.array(EDGES)).tolist()
    return [end for end in (way.value(own, number) for number in drawn) if end != own]


class _Side:
    """The values between the scenario's own and an end of the range, by their distance from it."""

    def __init__(self, choice: Choice, end: float, judge: Judge, base: Judged) -> None:
        """The values of a choice between its own and `end`; `base` is judged at its own."""
        assert choice.range
        self.choice, self.end, self.judge, self.base = choice, end, judge, base
        self.scale, self.whole = choice.range.scale, abs(end - choice.own)
        self.trials = {
            self.whole: (end, judge(world_with(choice, end)))
        }  # a value and what is said

    def judge_at(self, distance: float) -> Judged:
        """What the claims say with the choice at this `distance` from the scenario's own value."""
        if distance not in self.trials:
            value = self.choice.own + math.copysign(distance, self.end - self.choice.own)
            self.trials[distance] = value, self.judge(world_with(self.choice, value))
        return self.trials[distance][1]

    def turns_at(self, distance: float, claim: str) -> bool:
        """Whether a verdict is the opposite with the choice at this distance from its own value."""
        return self.judge_at(distance).contradicts(claim, self.base)

    def tried_between(self) -> list[float]:
        """Try the places that every side has, and give all that were tried."""
        for distance in (NEAR * self.scale, *(share * self.whole for share in BETWEEN)):
            self.judge_at(distance)
        return sorted(self.trials)


def _look_nearer(side: _Side, places: list[float], claim: str, number: ClaimNumber) -> None:
    """Look by golden section where a number is nearer to its limit than at the places beside it.

    `places` are distances from the scenario's own value, in order. It ends with a turn, or where
    the number would have to fall more steeply than it may.
    """
    unknown = side.base.answers[claim] is None  # so that nothing can turn it
    if unknown or any(side.turns_at(distance, claim) for distance in side.trials):
        return
    edges = number.turning(side.base.numbers[claim])

    def away(distance: float) -> float:
        """How far the claim's number is from its limit at this distance; inf where unknown."""
        judged = side.judge_at(distance) if distance else side.base
        far = min(abs(number.of(judged.numbers.get(claim, {})) - edge) for edge in edges)
        return far if math.isfinite(far) else math.inf

    # A dip between neighbours may hide a turn that the places miss.
    for a, b, c in zip([0.0, *places], places, places[1:], strict=False):
        if away(a) > away(b) <= away(c) and away(b) < away(0.0):
            _golden(side, claim, away, (a, b, c))


def _golden(
    side: _Side, claim: str, away: Callable[[float], float], around: tuple[float, float, float]
) -> None:
    """Narrow `around` (distances a < b < c) to where the claim's number is nearest its limit.

    By the golden section, with `away` for how far the number is from its limit at a distance. It
    stops where a verdict turns, or where a turn would need a steeper fall.
    """
    a, b, c = around
    for _ in range(LOOKS):
        slopes = (away(a) - away(b)) / (b - a), (away(c) - away(b)) / (c - b)
        if away(b) > STEEPER * max(slopes[0] * (c - b), slopes[1] * (b - a)):
            return
        # Into the longer of the two parts.
        new = b - GOLDEN * (b - a) if b - a > c - b else b + GOLDEN * (c - b)
        if side.turns_at(new, claim):
            return
        low, high = sorted((b, new))
        a, b, c = (a, low, high) if away(low) < away(high) else (low, high, c)


def _bisect(side: _Side, claim: str) -> None:
    """Find where a verdict turns first, and add the tries to the side.

    It is found to the ratio SHARP. The search ends early if one unit in the last place turns it.
    """
    # A number that is 0 has no last place; that of its scale stands for it.
    near, last = NEAR * side.scale, math.ulp(side.choice.own or side.scale)
    pairs = pairwise([last, *sorted(side.trials)])
    held, turned = next((p for p in pairs if side.turns_at(p[1], claim)), (0.0, 0.0))
    if not turned or (turned <= near and side.turns_at(last, claim)):
        return
    while turned / held > SHARP:
        # By the geometric mean, as distances reach over many decades.
        middle = math.sqrt(turned * held)
        turned, held = (middle, held) if side.turns_at(middle, claim) else (turned, middle)
