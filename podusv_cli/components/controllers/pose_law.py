"""What laws of poses have in common: three demands, a heading, loads that an estimator finds."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Literal, Self

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.kernel import Vector, kernel, specialise, taking

Law = Callable[..., None]
LAW = ("t", "x", "memory", "target", "k", "table", "tau", "rate", "signals", "work")
LOAD_AT = 6  # placeholder: where the state that the law is given has loads, north, east and in yaw


@kernel
def _inner(
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
    """Placeholder of a law's kernel."""


# x is the whole state of an estimator; other arguments as those of `Controller.law`.
def _fed_forward(
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
    """The law, less the loads that the estimator has found: tau - R^T b_est."""
    _inner(t, x, memory, target, k, table, tau, rate, signals, work)
    c, s = cos_sin(x[2])
    north, east = x[LOAD_AT], x[LOAD_AT + 1]
    tau[0] -= c * north + s * east
    tau[1] -= x[LOAD_AT + 2]
    tau[2] -= c * east - s * north


@cache
def with_load(law: Law, at: int) -> Law:
    """A kernel of `law` less the loads at the place `at` of the estimator's state.

    The same one for the same law and place.
    """
    name = f"{law.__qualname__}_with_load"
    made: Law = specialise(_fed_forward, name, _inner=taking(law, LAW), LOAD_AT=at)
    return made


class PoseLaw(Controller):
    """A law for position and heading of a vessel that can push sideways."""

    load: Literal["unknown", "estimated"] = value(
        "unknown",
        "",
        "estimated: the loads that the estimator finds are fed forward (passive_observer, ekf)",
    )

    def asks_sway(self) -> bool:
        """Whether its demand has a sway force: always."""
        return True

    def wants_heading(self) -> bool:
        """Whether it reads a heading: always."""
        return True

    def wants_load_estimate(self) -> bool:
        """Whether the loads that an estimator finds are taken off: with `load: estimated`."""
        return self.load == "estimated"

    def without_load_estimate(self) -> Self:
        """The same law with `load: unknown`."""
        return self.model_copy(update={"load": "unknown"})
