"""Draws: the numbers of a study's runs, and a scenario with one draw's numbers in it.

Every quantity has a stream of its own (`core.random_words`). So a draw depends on the study's seed,
the stream, the quantity's name and i, and on nothing else: not on other quantities, on how many
draws there are, or on who asks for which of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any
from warnings import catch_warnings

import numpy as np
import numpy.typing as npt

from podusv_cli.core import random_words
from podusv_cli.core.kernel import Vector
from podusv_cli.core.random_words import Words, in_unit_interval
from podusv_cli.scenario.address import ValueRefused, content, steps_at, with_values
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Quantity, Sweep
from podusv_cli.scenario.yaml_tree import Route

Draw = Mapping[str, float | int | str]  # by quantity
SEED_BITS = 53  # so that a seed is exact as a float, too
SOBOL_BITS = 32  # of a point, the most that scipy goes forward by; the shift has more
SWEEP = "sweep"  # the stream of a sweep's own draws


def words(seed: int, quantity: str, first: int, count: int, stream: str = SWEEP) -> Words:
    """Random 64-bit words (count,) of draws first, first + 1, ... of a quantity, by its name.

    They depend on `seed`, `stream`, the name and the draw's number alone.
    """
    return random_words.words((seed, stream, quantity), first, count)


def uniforms(seed: int, quantity: str, first: int, count: int, stream: str = SWEEP) -> Vector:
    """Draws (count,) of a quantity from number `first` on, uniform in (0, 1) without the ends."""
    return in_unit_interval(words(seed, quantity, first, count, stream))


def seeds(seed: int, quantity: str, first: int, count: int, stream: str = SWEEP) -> Words:
    """Draws (count,) of a seed from number `first` on: whole numbers below 2^53."""
    return words(seed, quantity, first, count, stream) >> np.uint64(64 - SEED_BITS)


def table(sweep: Sweep, first: int, count: int, stream: str = SWEEP) -> dict[str, npt.NDArray[Any]]:
    """Draws first, first + 1, ... of every quantity, by its name; each (count,)."""
    shares = _sobol if sweep.design == "sobol" else _random
    drawn_shares = shares(sweep, first, count, stream)
    # A draw may overflow to infinity, which the scenario's ranges then refuse with a message.
    with np.errstate(over="ignore"):  # the scenario's ranges tell
        return {
            name: seeds(sweep.seed, name, first, count, stream)
            if quantity.seed
            else quantity.distribution.at(drawn_shares[name])
            for name, quantity in sweep.vary.items()
        }


def draws(sweep: Sweep, first: int, count: int, stream: str = SWEEP) -> Iterator[Draw]:
    """Draws first, first + 1, ... one by one, as Python's own numbers and words."""
    columns = {name: c.tolist() for name, c in table(sweep, first, count, stream).items()}
    return ({name: column[i] for name, column in columns.items()} for i in range(count))


def _random(sweep: Sweep, first: int, count: int, stream: str) -> dict[str, Vector]:
    """Independent shares (count,) in (0, 1) by quantity."""
    return {name: uniforms(sweep.seed, name, first, count, stream) for name in sweep.vary}


def _sobol(sweep: Sweep, first: int, count: int, stream: str) -> dict[str, Vector]:
    """Sobol' points (count,) in (0, 1) by quantity, from point number `first` on.

    Each dimension is shifted by its own random digits. The shift is a digital one (XOR): it
    randomizes the points and keeps how evenly they lie.
    """
    from scipy.stats import qmc  # takes 60 MB

    if not sweep.vary:
        return {}
    sequence = qmc.Sobol(len(sweep.vary), scramble=False, bits=SOBOL_BITS)
    if first:  # scipy cannot go forward by nothing
        sequence.fast_forward(first)
    with catch_warnings(category=UserWarning, action="ignore"):  # of counts but powers of 2
        # Back to whole numbers, exact in 32 bits, since the shift works on binary digits.
        points = (sequence.random(count) * 2.0**SOBOL_BITS).astype(np.uint64)
    shifts = [words(sweep.seed, name, 0, 1, f"{stream} shift") for name in sweep.vary]
    return {
        # A point's digits move to the top of the word; the shift's further digits fill up the rest.
        name: in_unit_interval((points[:, i] << np.uint64(64 - SOBOL_BITS)) ^ shift)
        for i, (name, shift) in enumerate(zip(sweep.vary, shifts, strict=True))
    }


def draw_scenario(scenario: Scenario, vary: Mapping[str, Quantity], draw: Draw) -> Scenario:
    """The scenario of one law with the numbers of a draw; see `drawing`."""
    return drawing(scenario, {name: vary[name] for name in draw})(draw)


def drawing(scenario: Scenario, vary: Mapping[str, Quantity]) -> Callable[[Draw], Scenario]:
    """A function from a draw to the scenario of one law with the numbers of the draw in it.

    `vary` has the quantities that a draw has. `vessel.m` does not change `nominal`, which the law
    knows. The function raises ValueRefused where a number is out of range. Places and the
    scenario's own values are looked up only once here, not for each draw.
    """
    targets = [
        (steps, name, quantity, _own(scenario, quantity, steps), place)
        for name, quantity in vary.items()
        for place, steps in enumerate(map(steps_at, quantity.targets(name)))
    ]

    def scenario_of(draw: Draw) -> Scenario:
        """The scenario with a draw's values put in.

        Raises ValueRefused, which names the quantity.
        """
        new = {
            steps: quantity.value(own, draw[name], place)
            for steps, name, quantity, own, place in targets
        }
        try:
            return with_values(scenario, new)
        except ValueRefused as error:
            by = next((f"sweep.vary.{t[1]}: " for t in targets if t[0] == error.steps), "")
            raise ValueRefused(f"{by}{error}") from error

    return scenario_of


def _own(scenario: Scenario, quantity: Quantity, steps: Route) -> Any:
    """What the scenario has at a key, needed only by quantities that add to it or scale it."""
    return content(scenario, steps) if quantity.relative else None
