"""What a search may change: the gains of each law, with their ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.component import unit_of
from podusv_cli.core.phrases import did_you_mean
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.scenario.conflicts import of_numbers
from podusv_cli.scenario.keys import limits
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.tune import AROUND, Range, Tune
from podusv_cli.studies.making.plan import change_law

DIGITS = 4  # of a gain that is tried, so that a scenario shows all of them
BOUNDARY = 0.02  # of a range: a gain that is nearer to an end is at its bound
INSIDE = 0.3819660113  # place in a range at which it is tried, beside its ends
TRIED = 1.0123456789  # a factor, to see whether a number is one that a search may change


@dataclass(frozen=True)
class Gain:
    """A gain of a law: its key, the scenario's value, and what it may be.

    `words` has the values of a choice; else it lies in [low, high].
    """

    key: str
    own: Any
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    whole: bool = False
    words: tuple[Any, ...] = ()

    def value(self, number: float) -> Any:
        """A number of the sampler as the law gets it: in few digits, inside the range."""
        if self.whole:
            return int(number)
        return min(max(float(f"{number:.{DIGITS}g}"), self.low), self.high)

    def in_range(self, number: Any) -> bool:
        """Whether the search could come to this value."""
        return number in self.words if self.words else self.low <= number <= self.high

    def bound(self, number: Any) -> str:
        """The end of the range that a value is at: `lower`, `upper`, or "" where it is at none.

        The scenario's own value may lie outside, which is at no end.
        """
        if self.words or not self.low <= number <= self.high or self.high == self.low:
            return ""
        place = self.place(number)
        near = {"lower": place, "upper": 1.0 - place}
        return next((end for end, away in near.items() if away < BOUNDARY), "")

    @property
    def ends(self) -> tuple[Any, ...]:
        """The ends of its range, or all words."""
        return self.words or (self.value(self.low), self.value(self.high))

    def place(self, number: float) -> float:
        """Where a number is between the ends, from 0 to 1, on the scale of the search."""
        if self.log:
            return math.log(number / self.low) / math.log(self.high / self.low)
        return (number - self.low) / (self.high - self.low)

    def at(self, place: float) -> Any:
        """The gain at a place between the ends, from 0 to 1, or one of the words.

        It is the reverse of `place`.
        """
        if self.words:
            return self.words[int(place * len(self.words))]
        if self.log:
            return self.value(self.low * (self.high / self.low) ** place)
        return self.value(self.low + place * (self.high - self.low))


def gains(law: Controller, label: str, scenario: Scenario, tune: Tune) -> tuple[Gain, ...]:
    """The gains of a law that a search changes, in the order of its fields.

    `label` is the law's name in the scenario, `scenario` that of this law alone. An entry `law.key`
    of `tune.space` comes before `key`, and this before the common factor.
    """
    chosen = []
    for key, content in _numbers(law):
        wanted = tune.space.get(f"{label}.{key}", tune.space.get(key))
        if wanted is None and _is_gain(law, key, scenario):
            wanted = tune.space.get(AROUND)
        if wanted is not None:
            chosen += _of(wanted, key, content, type(law).model_fields[key])
    return tuple(chosen)


def units_of(law: Controller) -> dict[str, str]:
    """The unit of each number of a law."""
    return {key: unit_of(field) for key, field in type(law).model_fields.items()}


def keys(law: Controller) -> list[str]:
    """All keys of a law that `space` may name."""
    return [key for key, _ in _numbers(law)]


def _numbers(law: Controller) -> Iterator[tuple[str, Any]]:
    """Keys and contents of a law that are one value each."""
    for key in type(law).model_fields:
        content = getattr(law, key)
        if key != "kind" and isinstance(content, (bool, int, float, str)):
            yield key, content


def _is_gain(law: Controller, key: str, scenario: Scenario) -> bool:
    """Whether a number is a gain: positive, and not one that changes a run's structure."""
    own = getattr(law, key)
    if not isinstance(own, float) or own <= 0.0 or key in law.no_gains:
        return False
    # Downwards where the number is at its upper limit.
    changed = with_gains(law, {key: own * TRIED}) or with_gains(law, {key: own / TRIED})
    if changed is None:
        return False
    other = scenario.model_copy(update={"controller": changed})
    first, second = (Plan(s.closed_loop(), s.time_grid()).structure for s in (scenario, other))
    return not any(of_numbers(other)) and first == second


def with_gains(law: Controller, new: Mapping[str, Any]) -> Controller | None:
    """The law with other gains; None where it refuses them."""
    try:
        return change_law(law, new)
    except ValidationError:
        return None


def _of(wanted: float | Range, key: str, own: Any, field: Any) -> list[Gain]:
    """The gains to search at one key; `own` is the scenario's value there."""
    if isinstance(wanted, float):
        return [_around(wanted, key, own, field)]
    (way,) = wanted.given_keys
    return WAYS[way](getattr(wanted, way), key, own, field)


def _around(factor: float, key: str, own: Any, field: Any) -> Gain:
    """The range from own / factor to own * factor, cut to the limits of the law's `field`.

    `own` is the scenario's value of the gain `key`, which is positive.
    """
    low, high = float(own) / factor, float(own) * factor
    ends = limits(field)
    low = max(low, ends.get("ge", low), ends.get("gt", low))
    high = min(high, ends.get("le", high), ends.get("lt", high))
    return Gain(key, own, low, high, log=True)


WAYS: dict[str, Callable[[Any, str, Any, Any], list[Gain]]] = {
    "keep": lambda yes, key, own, field: [],
    "around": lambda factor, key, own, field: [_around(factor, key, own, field)],
    "log": lambda ends, key, own, field: [Gain(key, own, ends[0], ends[1], log=True)],
    "uniform": lambda ends, key, own, field: [Gain(key, own, ends[0], ends[1])],
    "integers": lambda ends, key, own, field: [Gain(key, own, ends[0], ends[1], whole=True)],
    "choice": lambda words, key, own, field: [Gain(key, own, words=tuple(words))],
}


def space_faults(laws: Mapping[str, Scenario], tune: Tune) -> Iterator[tuple[str, str]]:
    """Name and message of each entry of `space` that no law has, or cannot take."""
    for name, content in tune.space.items():
        label, dot, key = name.rpartition(".")
        if name == AROUND or not isinstance(content, Range):
            continue
        # A name with a dot is one law's; without, it is for all laws.
        named = {label: laws[label]} if dot and label in laws else {} if dot else dict(laws)
        having = {n: single for n, single in named.items() if key in keys(single.controller)}
        if not having:
            yield (
                name,
                f"unknown gain{did_you_mean(name, _known_gains(laws))}; "
                "write a key of a law, or law.key",
            )
        yield from (
            (name, text)
            for n, single in having.items()
            for text in _refusals_of(n, single, key, content)
        )


def _known_gains(laws: Mapping[str, Scenario]) -> list[str]:
    """All keys of gains, alone and with the law's name before them."""
    own = [key for law in laws.values() for key in keys(law.controller)]
    return [
        *dict.fromkeys(own),
        *(f"{n}.{key}" for n, law in laws.items() for key in keys(law.controller)),
    ]


def _refusals_of(label: str, scenario: Scenario, key: str, content: Range) -> Iterator[str]:
    """What is wrong with a range (`content`) for one law: the values that it does not take.

    `label` is the law's, `scenario` has it as its controller, and `key` is the gain.
    """
    law = scenario.controller
    own = getattr(law, key)
    if content.keep:
        return
    if content.around and (not isinstance(own, float) or own <= 0.0):
        yield f"{key} of {label} is {own!r}; a factor needs a number above 0, so write log: ..."
        return
    ends = content.choice or content.log or content.uniform or content.integers or ()
    (gain,) = _of(content, key, own, type(law).model_fields[key])
    for tried in (*ends, gain.at(INSIDE)):
        if taken := with_gains(law, {key: tried}):
            other = scenario.model_copy(update={"controller": taken})
            yield from (f"{key} of {label}: {text}" for _, text in of_numbers(other))
        # The place inside is not the user's number, so a law may refuse it.
        elif tried in ends:
            yield f"{label} does not take {key} = {tried!r}; see podusv explain controller.{key}"
