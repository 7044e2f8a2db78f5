"""What the claims say in one world: a comparison with other values at some places."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from podusv_cli.doubt.choices import Choice, Place

World = Mapping[Place, Any]


@dataclass(frozen=True)
class Judged:
    """The answer on every claim by name, and its numbers by their text.

    `failed` says why there is no such world, as of a hull without mass; then nothing is judged.
    """

    answers: Mapping[str, bool | None]
    numbers: Mapping[str, Mapping[str, float]]
    failed: str = ""

    def same(self, claim: str, other: Judged) -> bool:
        """Whether a claim has the same numbers, bit for bit; two missing ones are the same."""
        return repr(self.numbers.get(claim)) == repr(other.numbers.get(claim))

    def contradicts(self, claim: str, base: Judged) -> bool:
        """Whether the answer on a claim is the opposite of the base's."""
        answer, first = self.answers.get(claim), base.answers[claim]
        return answer is not None and first is not None and answer is not first


Judge = Callable[[World], Judged]


def world_with(choice: Choice, value: Any) -> World:
    """The world in which one choice has another value."""
    return choice.at(value)


def together(choices: Sequence[Choice], values: Sequence[Any]) -> World:
    """The world in which several choices have other values."""
    pairs = zip(choices, values, strict=True)
    return {place: v for choice, value in pairs for place, v in choice.at(value).items()}
