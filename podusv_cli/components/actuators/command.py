"""What any actuator may have around it: a command path with delay and dead zone, and a failure.

From the law to the hull: the demand is delayed (by the engine, `engine.step.delay_line`), rounded
to its resolution, goes through the dead zone, and is what the actuator is given. Where the actuator
has failed, a part of its loads is left.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from podusv_cli.core.component import Component, value
from podusv_cli.core.finding import Sentences, warn_before_run
from podusv_cli.core.kernel import Vector, kernel, scratch, specialise, tail, taking
from podusv_cli.core.signal import DEMAND_SIZE, Signal

Drive = Callable[..., None]
DRIVE = ("t", "x", "state", "demand", "k", "table", "tau", "rate", "signals")  # its arguments
LOSE = ("state", "k", "table", "tau", "signals")  # those of `lose`

GIVEN = (
    Signal("tau_u_in", "N", "surge force that the actuator is given", r"\tau_{u,\mathrm{in}}"),
    Signal("tau_r_in", "N m", "yaw moment that the actuator is given", r"\tau_{r,\mathrm{in}}"),
)
GIVEN_SWAY = Signal(
    "tau_v_in", "N", "sway force that the actuator is given", r"\tau_{v,\mathrm{in}}"
)
BEGAN = DEMAND_SIZE  # behind the demand there is when the present step began [s]
DRIVEN = BEGAN + 1  # numbers of both
LOGGED = len(GIVEN)
SWAY = LOGGED  # where a demand and the signals have the sway force
WHOLE = 1.5 * 2.0**52  # a number below 2^51 that is added to it, and taken off, is rounded
LARGEST = 2.0**51  # a count beyond it has no fraction worth rounding


class Command(Component):
    """How the law's demand reaches the actuator: delayed, rounded, and with a dead zone."""

    delay: float = value(
        0.0,
        "s",
        "time from the law to the actuator, a whole number of steps; the demand is zero "
        "until the first command arrives",
        ge=0,
    )
    resolution_u: float = value(
        0.0, "N", "the surge force is rounded to the nearest multiple of this; 0: not rounded", ge=0
    )
    resolution_r: float = value(
        0.0,
        "N m",
        "the yaw moment is rounded to the nearest multiple of this; 0: not rounded",
        ge=0,
    )
    dead_zone_u: float = value(
        0.0, "N", "a surge force up to this gives nothing, a larger one what is above it", ge=0
    )
    dead_zone_r: float = value(
        0.0, "N m", "a yaw moment up to this gives nothing, a larger one what is above it", ge=0
    )


class FullCommand(Command):
    """The same for a demand with a sway force."""

    resolution_v: float = value(
        0.0, "N", "the sway force is rounded to the nearest multiple of this; 0: not rounded", ge=0
    )
    dead_zone_v: float = value(
        0.0, "N", "a sway force up to this gives nothing, a larger one what is above it", ge=0
    )


class EffectivenessLoss(Component):
    """A loss of effectiveness at a time."""

    time: float = value(
        ...,
        "s",
        "when the effectiveness is lost: with the first step that begins then or later",
        ge=0,
    )
    effectiveness: float = value(
        0.0, "", "the part of the loads (of a pod: of its thrust) that is left", ge=0, le=1
    )


# Both in N or N m. Adding WHOLE and taking it off rounds in one addition, to the even of two.
@kernel
def round_to(demand: float, resolution: float) -> float:
    """The nearest multiple of the resolution, of two the even one; as it is for resolution 0."""
    if resolution > 0.0:
        count = demand / resolution
        if abs(count) < LARGEST:
            return ((count + WHOLE) - WHOLE) * resolution
    return demand


# Both in N or N m, the zone not below 0.
@kernel
def beyond(demand: float, zone: float) -> float:
    """What is beyond the dead zone, which starts at zero; what is no number stays so."""
    if abs(demand) <= zone:
        return 0.0
    return demand - zone if demand > 0.0 else demand + zone


# Arguments as those of `Actuator.drive`. `specialise` puts the actuator's kernel in its place; this
# body is never compiled.
def _inner(
    t: float,
    x: Vector,
    state: Vector,
    demand: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
) -> None:
    """Stands for an actuator's `drive`."""


def _lose(state: Vector, k: Any, table: Vector, tau: Vector, signals: Vector) -> None:
    """Stands for an actuator's `lose`."""


# demand (DRIVEN,), the last number when the step began [s]; writes given (DRIVEN,).
@kernel
def shape_demand(demand: Vector, k: Any, given: Vector) -> None:
    """The demand with surge and yaw rounded and the dead zone taken off, the rest as it is."""
    for i in range(DRIVEN):
        given[i] = demand[i]
    given[0] = beyond(round_to(demand[0], k.command_resolution_u), k.command_dead_zone_u)
    given[1] = beyond(round_to(demand[1], k.command_resolution_r), k.command_dead_zone_r)


# Arguments as those of `Actuator.drive`; `demand` has one more number, when the step began [s].
def _drive_commanded(
    t: float,
    x: Vector,
    state: Vector,
    demand: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
) -> None:
    """`drive` with the demand rounded and the dead zone taken off; its signals come first."""
    given = scratch(DRIVEN)
    shape_demand(demand, k, given)
    signals[0], signals[1] = given[0], given[1]
    _inner(t, x, state, given, k, table, tau, rate, tail(signals, LOGGED))


# Arguments as those of `Actuator.drive`; `demand` has one more number, when the step began [s].
def _drive_fully_commanded(
    t: float,
    x: Vector,
    state: Vector,
    demand: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
) -> None:
    """The same with a sway force."""
    given = scratch(DRIVEN)
    shape_demand(demand, k, given)
    given[SWAY] = beyond(round_to(demand[SWAY], k.command_resolution_v), k.command_dead_zone_v)
    signals[0], signals[1], signals[SWAY] = given[0], given[1], given[SWAY]
    _inner(t, x, state, given, k, table, tau, rate, tail(signals, SWAY + 1))


# Arguments as those of `Actuator.drive`; `demand` has one more number, when the step began [s].
def _failing(
    t: float,
    x: Vector,
    state: Vector,
    demand: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
) -> None:
    """`drive`, and what is left of its loads in steps that begin after the failure."""
    _inner(t, x, state, demand, k, table, tau, rate, signals)
    if demand[BEGAN] >= k.failure_time:
        _lose(state, k, table, tau, signals)


@cache
def with_command_path(drive: Drive, *, sway: bool = False) -> Drive:
    """A kernel with the command path before `drive`; the same one for the same arguments.

    `sway` says whether the demand has a sway force. The kernel takes the arguments `DRIVE`, and its
    demand has one more number, when the step began [s].
    """
    inner, outer = taking(drive, DRIVE), _drive_fully_commanded if sway else _drive_commanded
    made: Drive = specialise(outer, f"{drive.__qualname__}_commanded", _inner=inner)
    return made


@cache
def failing(drive: Drive, lose: Drive) -> Drive:
    """A kernel with the failure behind `drive`; the same one for the same kernels."""
    inner, lost = taking(drive, DRIVE), taking(lose, LOSE)
    made: Drive = specialise(_failing, f"{drive.__qualname__}_failing", _inner=inner, _lose=lost)
    return made


@warn_before_run(
    "late-failure",
    about="actuator.failure",
    meaning="the failure never happens",
    condition="the failure's time is not before the end of the run",
    remedy="let the failure happen earlier, or simulate longer",
)
def late_failure(case: Any) -> Sentences:
    """Warn where the run ends before the actuator fails; `case` is the run's case."""
    failure, end = case.scenario.actuator.failure, case.scenario.simulation.duration
    if failure and failure.time >= end:
        yield (
            f"the failure at {failure.time:g} s never happens, since the run ends at {end:g} s; "
            "take an earlier time, or simulate longer"
        )


@warn_before_run(
    "late-command",
    about="actuator.command",
    meaning="no command reaches the actuator",
    condition="the delay is not shorter than the run",
    remedy="take a shorter delay, or simulate longer",
)
def late_command(case: Any) -> Sentences:
    """Warn where the run ends before the first command reaches the actuator.

    `case` is the run's case.
    """
    delay, end = case.scenario.actuator.delay(), case.scenario.simulation.duration
    if delay >= end:
        yield (
            f"with a delay of {delay:g} s no command reaches the actuator in the {end:g} s of the "
            "run; take a shorter delay, or simulate longer"
        )
