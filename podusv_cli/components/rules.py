"""The rules by which defaults follow from hull, actuator and loop: words and formulas.

Each gives the model ship's number times what the facts of a hull are over its own, so the model
ship keeps its numbers. A component names the rule of each of its keys in its `rules`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from podusv_cli.components.facts import F0, N0, STEERING0, THROTTLE0, Facts
from podusv_cli.core.component import Rule

OBSERVED = 0.5  # of 1/period, the largest bandwidth of an observer


def times(words: str, factor: Callable[[Facts], float]) -> Rule:
    """The rule: the model ship's number times a factor, whose formula is `words`."""
    return Rule(f"{{:g}} times {words}", lambda facts, default: default * factor(facts))


def _observer(words: str, factor: Callable[[Facts], float]) -> Rule:
    """The rule for a pole of an observer: times a `factor`, as far as a slow sampling allows.

    `words` are the factor's formula, for `explain`.
    """

    def of(facts: Facts, default: float) -> float:
        """The pole [1/s] that suits a boat; `default` is that of the model ship."""
        most = OBSERVED / facts.period if facts.period else math.inf
        return min(default * factor(facts), most)

    return Rule(f"{{:g}} times {words}, at most {OBSERVED:g}/period", of)


def noise(place: int) -> Rule:
    """The rule for a noise: what the sensor has of the state's number `place`, in its unit."""
    return Rule(
        "noise and bias of the sensor itself, {:g} where it has none",
        lambda facts, default: facts.noise[place] or default,
        exact=True,
    )


def reach(facts: Facts) -> float:
    """How far ahead a hull has to aim: its length, or what it goes while it turns.

    Over that of the model ship, as all facts with small letters.
    """
    return max(facts.lam, facts.s / facts.g_r)


SPEED = times("U/U0", lambda f: f.s)
ACCELERATION = times("a_F/a0", lambda f: f.a_f)
MOMENT = times("N/N0", lambda f: f.N / N0)
FORCE = times("F/F0", lambda f: f.F / F0)
LENGTH = times("L/L0", lambda f: f.lam)
YAW = times("g_r", lambda f: f.g_r)
YAW_SQUARED = times("g_r^2", lambda f: f.g_r * f.g_r)
YAW_TIME = times("1/g_r", lambda f: 1.0 / f.g_r)
SURGE = times("g_u", lambda f: f.g_u)
PACE = times("g_p = min(g_r, g_u)", lambda f: f.g_p)
PACE_SQUARED = times("g_p^2", lambda f: f.g_p * f.g_p)
PACE_TIME = times("1/g_p", lambda f: 1.0 / f.g_p)
YAW_RATE = times("min(r_top/r0, w_N/w0)", lambda f: min(f.r_f, f.w_f))
TURN = times("r_top/r0", lambda f: f.r_f)
SLOWNESS = times("U0/U", lambda f: 1.0 / f.s)
STEERING = times(
    "q/q0, q = steering per yaw rate in a circle at 0.5 U", lambda f: f.steering / STEERING0
)
THROTTLE = times("e/e0, e = throttle per speed at 0.5 U", lambda f: f.throttle / THROTTLE0)
AHEAD = times("max(L/L0, (U/U0)/g_r)", reach)
YAW_REACH = times("g_r max(L/L0, (U/U0)/g_r)", lambda f: f.g_r * reach(f))
YAW_PER_REACH = times("g_r/max(L/L0, (U/U0)/g_r)", lambda f: f.g_r / reach(f))
HAND = times("g_h", lambda f: f.g_h)
HAND_SQUARED = times("g_h^2", lambda f: f.g_h * f.g_h)
HAND_TIME = times("1/g_h", lambda f: 1.0 / f.g_h)
OBSERVED_U = _observer("g_u", lambda f: f.g_u)
OBSERVED_V = _observer("max(g_r, (U/U0)/(L/L0))", lambda f: max(f.g_r, f.s / f.lam))
OBSERVED_R = _observer("g_r", lambda f: f.g_r)
OBSERVER = {"omega_u": OBSERVED_U, "omega_v": OBSERVED_V, "omega_r": OBSERVED_R}
