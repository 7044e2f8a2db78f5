"""The largest steady load that hull and thrusters hold at rest, by where it comes from.

The plots of IMCA M 140 and DNV-ST-0111 show it (both recalled, not read). A load is held where
thrusters that have followed a constant demand balance it: surge force, sway force and yaw moment.
All is static: no motion, no lag, no margin for waves and gusts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.wind import Wind
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector

HEALTHY = "all thrusters"
AT_REST = np.zeros(6)
BALANCED = 5e-4  # of the load's force, and of its moment: what may be left
TURNED = 5e-5  # of the load's force times the length: moment that may be left, too
ROUNDS = 8  # of a demand that makes up for what is left
ACCURACY = 1e-3  # of the largest load
ENDLESS = 1e12  # N; an actuator that gives half of this has no limit
FIRST, DOUBLINGS = 2.0**-10, 40  # of the search for a load that is as large as full thrust ahead
LEAST, MOST = 2.0**-10, 2.0**20  # of that load: less is none, more has no limit


class Acting(NamedTuple):
    """A load (b_u, b_v, b_r) and the state (6,), relative to the water, that thrusters feel."""

    b: Vector
    x: Vector


LoadOf = Callable[[float, float], Acting]  # of its size, and where it comes from [rad]


class LoadKind(NamedTuple):
    """A load that has a size: the unit of this, and how the load follows."""

    unit: str
    words: str
    on: Callable[[Vessel, Disturbance], LoadOf]


@dataclass(frozen=True)
class Capability:
    """What is held from each of `angles` (n,) [rad], 0 from ahead, pi/2 from starboard.

    `held` has for all thrusters, and without each of them, sizes (n,) in `unit`; NaN where those
    that are left cannot be allocated.
    """

    load: str
    unit: str
    angles: Vector
    held: Mapping[str, Vector]


def _current(vessel: Vessel, own: Disturbance) -> LoadOf:
    """Of a current, whose size is its speed [m/s]; the angle is where it comes from."""

    def acting(speed: float, angle: float) -> Acting:
        """The load of a current of this speed [m/s] from this angle [rad], on a hull at rest."""
        flow = Current(speed=speed, direction=angle + math.pi)
        # A hull at rest goes through the water against the flow
        x = np.array([0.0, 0.0, 0.0, speed * math.cos(angle), speed * math.sin(angle), 0.0])
        return Acting(flow.loads(vessel, [0.0], [AT_REST])[0], x)

    return acting


def _wind(vessel: Vessel, own: Disturbance) -> LoadOf:
    """Of a wind without gusts, whose size is its mean speed at 10 m [m/s].

    Height where it acts and density are those of the scenario's own wind, if it has one. Raises
    UsageError for a vessel without windage.
    """
    one = next((part for part in own.each() if isinstance(part, Wind)), Wind(speed=1.0))
    fault = next(Wind(speed=1.0).conflicts(vessel, 1.0), None)  # without gusts any step will do
    if fault:
        raise UsageError(fault[1])

    def acting(speed: float, angle: float) -> Acting:
        """The load of a wind of this speed [m/s] from this angle [rad], on a hull at rest."""
        wind = Wind(speed=speed, direction=angle, at=one.at, density=one.density)
        return Acting(wind.loads(vessel, [0.0], [AT_REST])[0], AT_REST)

    return acting


def _force(vessel: Vessel, own: Disturbance) -> LoadOf:
    """Of a force through the body origin, whose size is in N; `vessel` and `own` do not matter."""

    def acting(size: float, angle: float) -> Acting:
        """The force from this angle [rad], on a hull at rest."""
        return Acting(-size * np.array([math.cos(angle), math.sin(angle), 0.0]), AT_REST)

    return acting


LOADS = {
    "current": LoadKind("m/s", "speed of the current", _current),
    "wind": LoadKind("m/s", "mean wind speed at 10 m", _wind),
    "force": LoadKind("N", "force through the body origin", _force),
}


def capability(
    vessel: Vessel,
    actuator: Actuator,
    load: str,
    angles: Vector,
    *,
    own: Disturbance,
    progress: Callable[[str, float], None] | None = None,
) -> Capability:
    """The largest `load`, a key of `LOADS`, that is held from each of these angles [rad].

    `own` is the scenario's disturbance, which only tells at what height a wind acts. `progress` is
    told the name of a set of thrusters and the fraction that is done. Raises UsageError for an
    actuator without limits, one without thrust ahead, and for wind on a vessel without windage.
    """
    kind = LOADS[load]
    acting = kind.on(vessel, own)
    usual = _usual(acting, _full_thrust(actuator))
    held: dict[str, Vector] = {}
    sets: dict[str, Actuator | None] = {HEALTHY: actuator}
    sets |= {f"without {key}": rest for key, rest in actuator.without_each().items()}
    for name, thrusters in sets.items():
        held[name] = sizes = np.full(len(angles), math.nan if thrusters is None else 0.0)
        if thrusters is None:
            continue
        for i, angle in enumerate(angles.tolist()):
            # The search starts from the angle before; the first one's "before" is the last, still 0
            sizes[i] = _largest(thrusters, acting, angle, vessel.length, (sizes[i - 1], usual))
            if progress:
                progress(name, (i + 1.0) / len(angles))
    return Capability(load, kind.unit, angles, held)


def _full_thrust(actuator: Actuator) -> float:
    """The largest surge force ahead [N]. Raises UsageError where there is none, or no limit."""
    demand = ENDLESS * np.eye(len(actuator.limits()))[0]
    thrust = float(actuator.settled(AT_REST, demand)[0])
    if thrust > 0.5 * ENDLESS:
        raise UsageError(
            f"the actuator {actuator.label} has no limits, so it holds every load; choose one that "
            "has, as with --set actuator.kind=saturated_full"
        )
    if thrust <= 0.0:
        raise UsageError(
            f"the actuator {actuator.label} gives no thrust ahead, so it holds nothing"
        )
    return thrust


def _usual(acting: LoadOf, thrust: float) -> float:
    """The size at which the load from 45 deg is first as large as full `thrust` [N], by doubling.

    From ahead alone a hull may have no resistance. The largest size tried where none is enough.
    """
    sizes = [FIRST * 2.0**i for i in range(DOUBLINGS)]
    enough = (s for s in sizes if np.hypot(*acting(s, 0.25 * math.pi).b[:2]) >= thrust)
    return next(enough, sizes[-1])


def _largest(
    actuator: Actuator, acting: LoadOf, angle: float, length: float, near: tuple[float, float]
) -> float:
    """The largest size that is held from an angle [rad], sought from that of the angle before.

    `near` has that, and the usual size; `length` [m] is the hull's. Up to `ACCURACY`; 0 where less
    than `LEAST` is held, infinite where the load does nothing that has to be balanced. Doubled
    while it is held, halved while nothing is, then by bisection.
    """
    before, usual = near
    # From the angle before nothing may have been held, or everything
    low, high = 0.0, max(min(before, usual), LEAST * usual)
    while holds(actuator, acting(high, angle), length):
        low, high = high, 2.0 * high
        if low > MOST * usual:
            return math.inf
    while low == 0.0 and high > LEAST * usual:
        if holds(actuator, acting(0.5 * high, angle), length):
            low = 0.5 * high
        else:
            high *= 0.5
    while low > 0.0 and high - low > ACCURACY * high:
        middle = 0.5 * (low + high)
        if holds(actuator, acting(middle, angle), length):
            low = middle
        else:
            high = middle
    return low


def holds(actuator: Actuator, load: Acting, length: float) -> bool:
    """Whether some constant demand balances the load on a hull of this length [m].

    As an integrator does, the demand makes up for what the thrusters leave, as long as that helps.
    """
    b, demands = load.b, [0, 2, 1][: len(actuator.limits())]  # a demand is (tau_u, tau_r, tau_v)
    force = math.hypot(b[0], b[1])
    most = BALANCED * np.array([force, force, abs(b[2])])
    most[2] += TURNED * force * length
    if not b.any():
        return True
    demand, before = -b[demands], math.inf
    for _ in range(ROUNDS):
        left = actuator.settled(load.x, demand) + b
        excess = float((np.abs(left) / most).max())
        # Held, or no round will do: what is over did not fall to half of what it was
        if excess <= 1.0 or excess > 0.5 * before:
            return excess <= 1.0
        demand, before = demand - left[demands], excess
    return False
