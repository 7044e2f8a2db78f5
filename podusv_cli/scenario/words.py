"""What a study draws, in words."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from podusv_cli.scenario.distributions import Distribution
from podusv_cli.scenario.sweep import POSTERIOR, Quantity


def in_words(quantity: Quantity) -> str:
    """How a quantity is drawn, and what becomes of the scenario's own value."""
    if quantity.seed:
        return "a new seed for every draw"
    if quantity.rows:
        count = len(quantity.lines.rows)
        if quantity.identified:
            of = f"the {count} rows of {quantity.identified}/{POSTERIOR}, hulls"
            return f"one of {of}, all equally likely"
        return f"one of {count} rows, all equally likely"
    drawn = of_distribution(quantity.distribution)
    if quantity.times:
        return f"the scenario's own value times a factor: {drawn}"
    return f"the scenario's own value plus a summand: {drawn}" if quantity.plus else drawn


def of_distribution(distribution: Distribution) -> str:
    """A distribution in words, such as `uniform from 0.7 to 1.3`."""
    (name,) = distribution.given_keys
    content = getattr(distribution, name)
    return WORDS[name](content) + _cut(getattr(content, "within", None))


def _cut(bounds: tuple[float, float] | None) -> str:
    """The words for bounds that cut a distribution off; "" without them."""
    return f", only from {bounds[0]:g} to {bounds[1]:g}" if bounds else ""


WORDS: dict[str, Callable[[Any], str]] = {
    "uniform": lambda x: f"uniform from {x[0]:g} to {x[1]:g}",
    "log_uniform": lambda x: f"log-uniform from {x[0]:g} to {x[1]:g}",
    "normal": lambda x: f"normal with mean {x.mean:g} and standard deviation {x.sigma:g}",
    "lognormal": lambda x: (
        f"lognormal with median {x.median:g}, standard deviation of the logarithm {x.sigma:g}"
    ),
    "triangular": lambda x: f"triangular from {x[0]:g} to {x[2]:g}, likeliest at {x[1]:g}",
    "choice": lambda x: f"one of {', '.join(map(str, x))}, all equally likely",
    "integers": lambda x: f"a whole number from {x[0]} to {x[1]}, all equally likely",
    "angle": lambda x: "any direction, all equally likely",
}
