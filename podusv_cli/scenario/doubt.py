"""The key `doubt`: what the source of a scenario's claims leaves open, and how that may differ."""

from __future__ import annotations

from podusv_cli.core.component import Component, value
from podusv_cli.scenario.sweep import Quantity


class Doubt(Component):
    """What `podusv doubt` moves to see whether the verdicts on claims turn."""

    printed: tuple[str, ...] = value(
        (), "", "keys, sections or laws whose values the source states; they are not moved"
    )
    vary: dict[str, Quantity] = value(
        {}, "", "ranges in place of the default ones, by key; see podusv docs doubt"
    )
    hulls: tuple[str, ...] = value(
        (), "", "presets of `vessel` to be tried in place of the scenario's own"
    )
    draws: int = value(300, "", "worlds in which all numbers are drawn at once", ge=1, le=10**6)
    seed: int = value(
        1, "", "a draw depends on the seed, the key and its index alone", ge=0, lt=2**63
    )
