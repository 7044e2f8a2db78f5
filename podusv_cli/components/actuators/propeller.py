"""A propeller's thrust, by (8) or by a table, and its inverse, as kernels."""

from __future__ import annotations

import math
from typing import Any

from podusv_cli.components.actuators.thrust_curve import command_for, thrust_at
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.signal import Signal

POD = ("pod",)
SPEEDS = {  # by what n counts: actual and asked for
    "turns": (
        Signal("n", "1/s", "propeller speed", axes=POD),
        Signal("n_cmd", "1/s", "propeller speed that was asked for", r"n_\mathrm{cmd}", POD),
    ),
    "parts": (
        Signal("n_part", "1", "propeller speed, in parts of full speed", "n", POD),
        Signal(
            "n_part_cmd",
            "1",
            "propeller speed that was asked for, in parts of full speed",
            r"n_\mathrm{cmd}",
            POD,
        ),
    ),
}
DELTA = Signal("delta", "rad", "propulsion angle", r"\delta", POD)
DELTA_CMD = Signal(
    "delta_cmd", "rad", "propulsion angle that was asked for", r"\delta_\mathrm{cmd}", POD
)
THRUST = Signal("thrust", "N", "thrust of the propeller (8)", "T", POD)
POWER_TAKEN = Signal("power", "W", "power that the propeller takes", "P", POD)
LIMITED = (
    Signal("speed_limited", "1", "1 while a propeller is asked for its largest speed", "n lim"),
    Signal("angle_limited", "1", "1 while a pod is asked for its largest angle", r"\delta lim"),
    Signal("rate_limited", "1", "1 while a speed or an angle changes at its limit", "rate lim"),
)

PHYSICAL = 0.0

# A pod's numbers in the actuator's table, by position.
(
    X,
    Y,
    T_AHEAD,
    T_ASTERN,
    T_NV,
    T_NV_ASTERN,
    N_AHEAD,
    N_ASTERN,
    ANGLE,
    N_RATE,
    DELTA_RATE,
    N_LAG,
    DELTA_LAG,
    POWER,
    LIFT,
    STALL,
    DEAD_AHEAD,
    DEAD_ASTERN,
    STRETCH_AHEAD,
    STRETCH_ASTERN,
    CURVE_AHEAD,
    CURVE_ASTERN,
    MOUNT,
    WIDTH,
) = range(24)


# x (6) is relative to the water, delta [rad] the pod's angle, k.thrust_form that of (8). A rudder
# turns behind its propeller, whose axis stays. The sign is that of what the flow takes from thrust.
@kernel
def inflow(x: Vector, pod: Vector, delta: float, k: Any) -> float:
    """What T_nV is multiplied with in the thrust: a speed [m/s], with its sign.

    The physical form loses thrust with the advance speed V_a, the water's speed along the
    propeller's axis at the pod; the printed (8) gains with the vessel's speed V, both ways alike.
    Both are through the water: an actuator's x is so.
    """
    if k.thrust_form == PHYSICAL:
        ahead, aside = x[3] - pod[Y] * x[5], x[4] + pod[X] * x[5]
        cosine, sine = cos_sin(pod[MOUNT] + (0.0 if pod[LIFT] > 0.0 else delta))
        return float(-(ahead * cosine + aside * sine))
    return math.sqrt(x[3] * x[3] + x[4] * x[4])


# n is in 1/s; `pod` is its row of the table.
@kernel
def turning(n: float, pod: Vector) -> float:
    """How fast the propeller turns at n: not at all in its dead band, in full at full n.

    Without a dead band it is n to the last bit; what is no number stays none.
    """
    if n > pod[DEAD_AHEAD]:
        return float((n - pod[DEAD_AHEAD]) * pod[STRETCH_AHEAD])
    if n < -pod[DEAD_ASTERN]:
        return float((n + pod[DEAD_ASTERN]) * pod[STRETCH_ASTERN])
    return 0.0 * n


# n is in 1/s, flow [m/s] the advance speed; `pod` is its row of the table. `carried` [N] is the
# term of the flow.
@kernel
def thrust(n: float, flow: float, pod: Vector, k: Any) -> float:
    """Thrust [N] at the propeller speed n: T_nn |n| n + T_nV flow |n|, or as printed flow n.

    With a table, its thrust stands for the first term.
    """
    turns = turning(n, pod)
    gain = (pod[T_NV] if turns >= 0.0 else pod[T_NV_ASTERN]) * flow
    carried = gain * (abs(turns) if k.thrust_form == PHYSICAL else turns)
    if pod[CURVE_AHEAD] > 0.0:
        if turns >= 0.0:
            return float(thrust_at(turns, tail(pod, int(pod[CURVE_AHEAD]))) + carried)
        return float(carried - thrust_at(-turns, tail(pod, int(pod[CURVE_ASTERN]))))
    T_nn = pod[T_AHEAD] if turns >= 0.0 else pod[T_ASTERN]
    return float(T_nn * abs(turns) * turns + carried)


@kernel
def force(T: float, delta: float) -> tuple[float, float]:
    """Force [N] along and across a pod's mounting of the thrust T [N] at the angle delta [rad]."""
    cosine, sine = cos_sin(delta)
    return T * cosine, T * sine


# `pod` (WIDTH) is its row of the table.
@kernel
def on_hull(along: float, across: float, pod: Vector) -> tuple[float, float]:
    """Force [N] along and across the vessel of one along and across the pod as it is mounted."""
    if pod[MOUNT] == 0.0:
        return along, across
    cosine, sine = cos_sin(pod[MOUNT])
    return along * cosine - across * sine, along * sine + across * cosine


# n is in 1/s, flow [m/s] the advance speed; `pod` is its row of the table. `turns` is how fast it
# turns, of which DEAD and STRETCH make the command.
@kernel
def speed_for(T: float, flow: float, pod: Vector, k: Any) -> float:
    """A propeller speed n with thrust(n) = T [N]: never astern for T >= 0, never ahead for T < 0.

    In the water's flow a propeller that turns slowly brakes, so n jumps where T changes sign. So it
    does over a dead band.
    """
    if T >= 0.0:
        gain = pod[T_NV] * flow
        if pod[CURVE_AHEAD] > 0.0:
            return float(command_for(T, gain, tail(pod, int(pod[CURVE_AHEAD]))))
        turns = _positive_root(pod[T_AHEAD], gain, T)
        return float(turns / pod[STRETCH_AHEAD] + pod[DEAD_AHEAD]) if turns > 0.0 else turns
    gain = pod[T_NV_ASTERN] * flow
    along = -gain if k.thrust_form == PHYSICAL else gain
    if pod[CURVE_AHEAD] > 0.0:
        return float(-command_for(-T, along, tail(pod, int(pod[CURVE_ASTERN]))))
    turns = _positive_root(pod[T_ASTERN], along, -T)
    return -float(turns / pod[STRETCH_ASTERN] + pod[DEAD_ASTERN]) if turns > 0.0 else -turns


# a > 0 and c >= 0, so the root is real and n is not negative; of two forms the one without a
# difference of two numbers alike is taken.
@kernel
def _positive_root(a: float, b: float, c: float) -> float:
    """The larger n of a n^2 + b n = c >= 0, without cancellation."""
    root = math.sqrt(b * b + 4.0 * a * c)
    if b <= 0.0:
        return (root - b) / (2.0 * a)
    return 2.0 * c / (root + b)
