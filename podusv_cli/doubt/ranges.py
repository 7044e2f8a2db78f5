"""How far the values of a scenario move.

Alone a value goes as far as an author might have chosen it; all together as far as each may be off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.core.kernel import bundle
from podusv_cli.scenario.distributions import Distribution
from podusv_cli.scenario.keys import Key, limits
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Quantity

GRAVITY = 9.81  # m/s2


class DoubtRange(NamedTuple):
    """How a number moves, as a study draws it: one at a time, and with all others.

    `scale` is what its distance from the scenario's own is measured by, in the unit of the number.
    """

    alone: Quantity
    together: Quantity
    scale: float


Way = Callable[[float, Scenario, Key], DoubtRange | None]  # how a number of this key moves


def _by_factor(alone: float, together: float) -> Way:
    """A way to move a number by a factor up to `alone` or its inverse, inside the key's bounds.

    `together` is the factor where all choices are drawn. A number that is 0 has no such way.
    """

    def range_of_factor(own: float, scenario: Scenario, key: Key) -> DoubtRange | None:
        """Factors of the scenario's value `own`, for the choice alone and for all together.

        None if the value is 0, or the key's bounds leave no range on one side of 0.
        """
        ends = [_inside([own / f, own * f], key) for f in (alone, together)]
        if not own or any(low * high <= 0.0 for low, high in ends):
            return None
        ways = [tuple(sorted((low / own, high / own))) for low, high in ends]
        drawn = [Quantity(times=Distribution(log_uniform=(low, high))) for low, high in ways]
        return DoubtRange(drawn[0], drawn[1], abs(own))

    return range_of_factor


def _by_summand(scale: Callable[[Scenario], float], alone: float, together: float) -> Way:
    """A way to move a number by a summand up to a share of a scale, inside the key's bounds.

    `scale` gives the size from the scenario. `alone` is the share where only this choice moves,
    `together` where all are drawn.
    """

    def range_of_summand(own: float, scenario: Scenario, key: Key) -> DoubtRange | None:
        """Summands to the scenario's value `own`, in shares of `scale`; None where that is 0."""
        if not (unit := scale(scenario)):
            return None
        ends = [
            _inside([own - share * unit, own + share * unit], key) for share in (alone, together)
        ]
        drawn = [Quantity(plus=Distribution(uniform=(low - own, high - own))) for low, high in ends]
        return DoubtRange(drawn[0], drawn[1], unit)

    return range_of_summand


def _place(own: float, scenario: Scenario, key: Key) -> DoubtRange | None:
    """A summand of a coordinate [m]; a factor of a length that has bounds, as a radius."""
    way = _by_factor(2.0, 1.05) if limits(key.field) else _by_summand(_length, 5.0, 0.5)
    return way(own, scenario, key)


def _load(own: float, scenario: Scenario, key: Key) -> DoubtRange | None:
    """A factor; where there is no load along this axis, up to what drifts the hull at the speed."""
    if own or key.name not in DRIFTS:
        return LOAD(own, scenario, key)
    return _by_summand(DRIFTS[key.name], 1.0, 1.0)(own, scenario, key)


def _inside(ends: list[float], key: Key) -> tuple[float, float]:
    """The least and the largest of `ends`, cut off at the key's bounds."""
    bounds = limits(key.field)
    low, high = sorted(ends)
    return max(low, bounds.get("ge", low)), min(high, bounds.get("le", high))


def _speed(scenario: Scenario) -> float:
    """The path's speed; where it has none, that at which the hull's Froude number is 0.1."""
    own = getattr(scenario.path, "speed", 0.0)
    return abs(own) or 0.1 * math.sqrt(GRAVITY * scenario.vessel.length)


def _length(scenario: Scenario) -> float:
    return scenario.vessel.length


def _radian(scenario: Scenario) -> float:
    return 1.0


def _turning(scenario: Scenario) -> float:
    """The yaw rate that goes with the speed on a circle of a hull's length."""
    return _speed(scenario) / scenario.vessel.length


def _surge_drift(scenario: Scenario) -> float:
    """The surge force that drifts the hull, without thrust, at the path's speed [N]."""
    return abs(surge_force(_speed(scenario), 0.0, 0.0, bundle(scenario.vessel.constants())))


def _sway_drift(scenario: Scenario) -> float:
    """The sway force that does so across the hull [N]."""
    return abs(sway_force(0.0, _speed(scenario), 0.0, bundle(scenario.vessel.constants())))


def _yaw_drift(scenario: Scenario) -> float:
    """The yaw moment that turns the hull, lying still, as fast as `_turning` [N m]."""
    return abs(yaw_moment(0.0, 0.0, _turning(scenario), bundle(scenario.vessel.constants())))


DRIFTS = {"b_u": _surge_drift, "b_v": _sway_drift, "b_r": _yaw_drift}
LOAD = _by_factor(2.0, 1.2)
LIMIT = _by_factor(10.0, 1.25)
# How the numbers of a section move, by their unit; "" is for all other units.
RANGES: dict[str, dict[str, Way]] = {
    "vessel": {"": _by_factor(1.5, 1.1)},
    "nominal": {"": _by_factor(1.5, 1.1)},
    "start": {
        "m": _by_summand(_length, 5.0, 0.5),
        "rad": _by_summand(_radian, math.pi, 0.2),
        "m/s": _by_summand(_speed, 1.0, 0.1),
        "rad/s": _by_summand(_turning, 1.0, 0.1),
    },
    "path": {"m": _place, "rad": _by_summand(_radian, math.pi, 0.2), "": _by_factor(2.0, 1.05)},
    "disturbance": {
        "rad": _by_summand(_radian, math.pi, math.pi),
        "N": _load,
        "N m": _load,
        "": LOAD,
    },
    "actuator": {"N": LIMIT, "N m": LIMIT, "": _by_factor(2.0, 1.25)},
    "measurement": {"": _by_factor(3.0, 1.25)},
    "estimator": {"": _by_factor(3.0, 1.25)},
    "controller": {"": _by_factor(3.0, 1.25)},
}


def _whole(own: float) -> tuple[float, ...]:
    """Shares of the Coriolis terms to try, none and all, but for the scenario's `own`."""
    return tuple(share for share in (0.0, 1.0) if share != own)


SAMPLED = 0.1  # s; of a law that its source has at every instant
# Keys that have values of their own to be tried, from the scenario's own.
TRIED: dict[str, Callable[[Any], tuple[Any, ...]]] = {
    "simulation.step": lambda own: (own / 2.0,),
    "simulation.duration": lambda own: (own / 2.0, own * 1.5),
    "control.period": lambda own: (own / 2.0, own * 2.0) if own else (SAMPLED,),
    "vessel.coriolis": _whole,
    "nominal.coriolis": _whole,
}
