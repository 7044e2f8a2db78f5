"""All choices at once: how many draws keep a verdict, and which choices explain the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from podusv_cli.core import random_words
from podusv_cli.core.kernel import Vector
from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.judged import Judged, World, together

STREAM = "doubt"
PERMUTATIONS = 400  # 20 of them lie beyond a band of LEVEL
LEVEL = 0.95  # of the band that chance stays within


class Explained(NamedTuple):
    """Where the draws that turn a verdict are: shares of turned draws in a part and elsewhere."""

    choice: Choice
    part: str  # `above`, `below`, `far from` or `near` the choice's own value
    inside: float
    outside: float


@dataclass(frozen=True)
class Draws:
    """Worlds with all choices drawn at once: `shares` in (0, 1), shape (draw, choice)."""

    choices: Sequence[Choice]
    shares: Vector
    values: Sequence[Sequence[Any]]  # of a draw, in the order of the choices

    def world(self, draw: int) -> World:
        """The world of a draw."""
        return together(self.choices, self.values[draw])


def draw_worlds(choices: Sequence[Choice], seed: int, count: int) -> Draws:
    """`count` draws of all numbers and rows among the choices but those that make another task.

    Numbers in which laws of one kind differ stay, too. A draw depends on the seed, the choice's
    name and the draw's number alone.
    """
    moving = [c for c in choices if (c.range or c.rows) and not (c.task or c.beside)]
    # Without any choice the list is empty, and the array would have one axis alone
    shares = np.array(
        [random_words.uniforms((seed, STREAM, choice.name), 0, count) for choice in moving]
    ).reshape(len(moving), count)
    columns = [_values(choice, u) for choice, u in zip(moving, shares, strict=True)]
    return Draws(moving, shares.T, [[column[i] for column in columns] for i in range(count)])


def _values(choice: Choice, shares: Vector) -> list[Any]:
    """The values of a choice at these shares (draws,) of its distribution."""
    if choice.rows:
        return list(choice.rows.distribution.at(shares).tolist())
    assert choice.range
    way = choice.range.together
    return [way.value(choice.own, d) for d in way.distribution.at(shares).tolist()]


def explain_turns(
    draws: Draws,
    turned: npt.NDArray[np.bool_],
    known: npt.NDArray[np.bool_],
    acting: Mapping[str, bool],
) -> list[Explained]:
    """The parts of choices in which more draws turn than chance would have, the clearest first.

    `turned` and `known` are (draws,); only draws in which the claim's answer is known count.
    `acting` says by name which choices change the number. The band is that of the clearest of all
    choices after the turned draws are shuffled.
    """
    rows = [i for i, choice in enumerate(draws.choices) if acting.get(choice.name, False)]
    turned, shares = turned[known], draws.shares[known][:, rows]
    if not rows or not turned.any() or turned.all():
        return []
    # Above the own value's share of 0.5, and in the outer quarters: far from it.
    parts = np.stack([shares > 0.5, abs(shares - 0.5) > 0.25])  # (part, draw, choice)
    differences = _differences(parts, turned)
    # A fixed key: the same draws always give the same answer.
    shuffle = np.random.Generator(np.random.Philox(key=1)).permutation
    chance = [abs(_differences(parts, shuffle(turned))).max() for _ in range(PERMUTATIONS)]
    clear = [tuple(at) for at in np.argwhere(abs(differences) > np.quantile(chance, LEVEL))]
    order = sorted(clear, key=lambda at: -abs(differences[at]))
    return [_describe_part(draws.choices[rows[c]], p, parts[p, :, c], turned) for p, c in order]


def _differences(parts: Any, turned: Any) -> Any:
    """Share of turned draws inside each part less that outside it; (part, choice).

    `parts` is (part, draw, choice), `turned` (draw,).
    """
    inside, outside = parts.sum(axis=1), (~parts).sum(axis=1)
    with np.errstate(all="ignore"):
        here, there = ((half * turned[:, None]).sum(axis=1) for half in (parts, ~parts))
        return np.nan_to_num(here / inside - there / outside)


def _describe_part(choice: Choice, part: int, inside: Any, turned: Any) -> Explained:
    """How answers turn in one part of a choice and outside it, named by where more of them turn.

    `part` is its number in `explain_turns`; `inside` and `turned` are masks (draws,).
    """
    shares = float(turned[inside].mean()), float(turned[~inside].mean())
    more = shares[0] > shares[1]
    word = (("below", "above"), ("near", "far from"))[part][more]
    return Explained(choice, word, *(shares if more else shares[::-1]))


def count_turns(
    claim: str, worlds: Sequence[Judged], base: Judged
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Which draws turn a claim's verdict, and in which its answer is known; both (draws,)."""
    turned = np.array([world.contradicts(claim, base) for world in worlds], bool)
    known = np.array([world.answers.get(claim) is not None for world in worlds], bool)
    return turned, known
