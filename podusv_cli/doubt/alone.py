"""One choice at a time: which values turn a verdict, and where the nearest of them lies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.judged import Judge, Judged, moved

NEAR = 1e-4  # of the scale: how near the search looks before it looks at rounding
BETWEEN = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85)  # of the range, for verdicts that turn and turn back
SHARP = 1.02  # ratio of distances to which a turn is known
BY_SEED = 0.1
EDGES = (1e-12, 1.0 - 1e-12)  # shares of a distribution that are its ends


@dataclass(frozen=True)
class TriedValue:
    """A value of one choice, and what the claims say there."""

    value: Any
    judged: Judged


@dataclass(frozen=True)
class Turn:
    """Where a verdict turns: the nearest value that turns it, and the farthest before it.

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
        """Where a claim's verdict turns: for words each that does, for numbers on each side."""
        turned = [t for t in self.trials if t.judged.turned(claim, base)]
        if not self.choice.range:
            return [Turn(self.choice, t.value, self.choice.own, 0.0) for t in turned]
        sides = ([t for t in turned if (t.value > self.choice.own) == up] for up in (True, False))
        return [self._nearest(side) for side in sides if side]

    def _nearest(self, turned: Sequence[TriedValue]) -> Turn:
        own = self.choice.own
        first = min(turned, key=lambda t: abs(t.value - own))
        inside = [
            t.value for t in self.trials
            if not t.judged.failed and (t.value > own) == (first.value > own)
            and abs(t.value - own) < abs(first.value - own)
        ]  # fmt: skip
        held = max(inside, key=lambda value: abs(value - own), default=own)
        return Turn(self.choice, first.value, held, abs(first.value - own))


def explored(choice: Choice, judge: Judge, base: Judged) -> TriedChoice:
    """Try the values of a choice, and find where verdicts turn."""
    if not choice.range:
        return TriedChoice(
            choice, tuple(TriedValue(v, judge(moved(choice, v))) for v in choice.values)
        )
    trials = {end: judge(moved(choice, end)) for end in ends(choice)}
    acting = [
        claim for claim in base.answers if any(_acts(j, claim, base) for j in trials.values())
    ]
    if acting:
        for end in list(trials):
            _searched(choice, end, judge, base, trials)
    return TriedChoice(choice, tuple(TriedValue(*trial) for trial in trials.items()))


def _acts(judged: Judged, claim: str, base: Judged) -> bool:
    return not judged.failed and not judged.same(claim, base)


def ends(choice: Choice) -> list[float]:
    """The two ends of the range, without the choice's own value."""
    assert choice.range
    way, own = choice.range.alone, choice.own
    drawn = way.distribution.at(np.array(EDGES)).tolist()
    return [end for end in (way.value(own, number) for number in drawn) if end != own]


def _searched(
    choice: Choice, end: float, judge: Judge, base: Judged, trials: dict[float, Judged]
) -> None:
    """Look between the own value and an end, and bisect what turns, into `trials`."""

    def tried(distance: float) -> Judged:
        value = choice.own + math.copysign(distance, end - choice.own)
        if value not in trials:
            trials[value] = judge(moved(choice, value))
        return trials[value]

    assert choice.range
    scale = choice.range.scale
    whole, last = abs(end - choice.own), math.ulp(choice.own or scale)
    near, *further = sorted({NEAR * scale, *(share * whole for share in BETWEEN), whole})
    for distance in (near, *further):
        tried(distance)
    for claim in base.answers:
        pairs = pairwise([last, near, *further])
        held, turned = next((p for p in pairs if tried(p[1]).turned(claim, base)), (0.0, 0.0))
        if not turned or (turned == near and tried(last).turned(claim, base)):
            continue
        while turned / held > SHARP:
            middle = math.sqrt(turned * held)
            turned, held = (middle, held) if tried(middle).turned(claim, base) else (turned, middle)
