"""Laws that fail, each in its own way, from t = 0.5 s on; `install` puts one in the PID's place."""

import math
from collections.abc import Callable
from typing import Any

from podusv_cli.components.controllers.pid import Pid
from podusv_cli.core.kernel import Vector, kernel, taking
from podusv_cli.engine.step.layout import SIGNATURES

BEGIN, END = 0.4999, 0.5001
MANY = 100_000_000
plain = taking(Pid.law, SIGNATURES["law"])


@kernel
def endless(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """It never returns."""
    plain(t, x, memory, target, k, table, tau, rate, signals, work)
    while t > BEGIN and tau[0] > -1e300:
        tau[0] = tau[0] + 1.0


@kernel
def undefined(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """Its demand in yaw is no number."""
    plain(t, x, memory, target, k, table, tau, rate, signals, work)
    if t > BEGIN:
        tau[1] = (tau[0] - tau[0]) / (tau[0] - tau[0])


@kernel
def raising(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """It raises, which only plain Python can."""
    plain(t, x, memory, target, k, table, tau, rate, signals, work)
    if t > BEGIN:
        raise KeyError("no gain for this speed")


@kernel
def unstable(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """It pushes the harder the faster it goes."""
    plain(t, x, memory, target, k, table, tau, rate, signals, work)
    tau[0] = 1e6 * x[3]


@kernel
def too_long(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """It writes a third demand."""
    plain(t, x, memory, target, k, table, tau, rate, signals, work)
    tau[2] = 0.0


@kernel
def too_short(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """It writes one demand only."""
    tau[0] = 0.0


@kernel
def slow(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """It takes seconds once, not for ever: in the tests' own process it must not stay."""
    plain(t, x, memory, target, k, table, tau, rate, signals, work)
    if BEGIN < t < END:
        for i in range(MANY):
            tau[0] = math.sin(tau[0] + i)


@kernel
def slow_when_told(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """The same for one demand only."""
    tau[0] = k.surge
    tau[1] = 0.0
    if BEGIN < t < END and k.surge == 2.0:
        for i in range(MANY):
            tau[1] = math.sin(tau[1] + i)


@kernel
def slow_at_once(
    t: float,
    x: Vector,
    memory: Vector,
    target: Vector,
    k: Any,
    table: Vector,
    tau: Vector,
    rate: Vector,
    signals: Vector,
    work: Vector,
) -> None:
    """It takes seconds from the start, in plain Python."""
    for i in range(10_000_000):
        tau[0] = math.sin(tau[0] + i)


def install(name: str) -> Callable[[], None]:
    """Put the law of this name in the PID's place; gives what puts the PID back."""
    own = Pid.__dict__["law"]
    Pid.law = staticmethod(globals()[name])  # type: ignore[method-assign]
    return lambda: setattr(Pid, "law", own)
