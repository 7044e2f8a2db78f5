"""Signals: what a logged number is called and what it means, and those of the closed loop itself.

A law or an actuator declares its own signals in its own file. A recording carries the signals that
it holds, so that logs, figures and claims need no table of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from podusv_cli.core.errors import LawError

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")  # usable as a variable in logs and claims
NAME_IN_WORDS = "is at most 64 letters, digits and '_', starting with a letter"


def check_words(kind: str, name: str, *texts: str) -> None:
    """Raises ValueError where no log or table can hold the name, or a text beside it.

    `kind` is what messages call it: signal or metric.
    """
    if not NAME.fullmatch(name):
        raise ValueError(f"the name of a {kind} {NAME_IN_WORDS}, found {name!r}")
    for text in texts:
        if not text.isprintable():
            raise ValueError(f"{name}: {text!r} has a character that no log can hold")


@dataclass(frozen=True)
class Signal:
    """A logged quantity.

    `symbol` is LaTeX as matplotlib reads it, by default the name with a subscript. `axes` names the
    dimensions after `time`; a `fixed` signal does not run over time and has these alone. `wrapped`
    is an angle that jumps by 2 pi and means the same.
    """

    name: str
    unit: str
    meaning: str
    symbol: str = ""
    axes: tuple[str, ...] = ()
    wrapped: bool = False
    fixed: bool = False

    def __post_init__(self) -> None:
        """Check the name; make a symbol of it where none is given: `e_ct` becomes `e_{ct}`."""
        check_words("signal", self.name, self.unit, self.meaning, self.symbol)
        head, *rest = self.name.split("_")
        below = ",".join(rest)
        written = f"{head}_{{{below}}}" if len(below) > 1 else self.name
        # The one way to set a field of a frozen value
        object.__setattr__(self, "symbol", self.symbol or written)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of all axes of the logged array, `time` first where it runs over time."""
        return self.axes if self.fixed else ("time", *self.axes)


STATE = (
    Signal("x", "m", "vessel position, north"),
    Signal("y", "m", "vessel position, east"),
    Signal("psi", "rad", "heading, from north towards east, not wrapped", r"\psi"),
    Signal("u", "m/s", "surge velocity"),
    Signal("v", "m/s", "sway velocity"),
    Signal("r", "rad/s", "yaw rate"),
)
# What a law asks of the actuator, in this order.
DEMAND = (
    Signal("tau_u_cmd", "N", "surge force that the law asked for", r"\tau_{u,\mathrm{cmd}}"),
    Signal("tau_r_cmd", "N m", "yaw moment that the law asked for", r"\tau_{r,\mathrm{cmd}}"),
)
# What a law of a fully actuated vessel asks for as well. It stands behind the others, so that laws
# of both kinds write the same places.
SWAY_DEMAND = Signal(
    "tau_v_cmd", "N", "sway force that the law asked for", r"\tau_{v,\mathrm{cmd}}"
)
DEMAND_SIZE = len(DEMAND) + 1  # numbers that the loop keeps for a demand
# What a path may ask of a vessel that can push sideways.
HEADING = (
    Signal("heading_d", "rad", "heading that the path asks for, not wrapped", r"\psi_d"),
    Signal("heading_d_dot", "rad/s", "rate of the heading that the path asks for", r"\dot\psi_d"),
    Signal("heading_d_ddot", "rad/s2", "acceleration of that heading", r"\ddot\psi_d"),
)
# Numbers of a target: position, velocity and acceleration (x, y each), the vessel's distance to it,
# and from PSI_D on a heading, 0 of a path that has none.
PSI_D = 7
TARGET_SIZE = PSI_D + len(HEADING)
# What the actuator does to the hull.
TAU = (
    Signal("tau_u", "N", "surge force on the hull", r"\tau_u"),
    Signal("tau_v", "N", "sway force on the hull", r"\tau_v"),
    Signal("tau_r", "N m", "yaw moment on the hull", r"\tau_r"),
)
LOOP = (
    Signal("time", "s", "time since the start of the run", "t"),
    *STATE,
    Signal("x_d", "m", "target position, north"),
    Signal("y_d", "m", "target position, east"),
    Signal("z_e", "m", "distance to the target (18)"),
    *DEMAND,
    *TAU,
    Signal("b_u", "N", "disturbance force in surge"),
    Signal("b_v", "N", "disturbance force in sway"),
    Signal("b_r", "N m", "disturbance moment in yaw"),
)


def by_name(declared: Iterable[tuple[Callable[[], str], Iterable[Signal]]]) -> dict[str, Signal]:
    """Signals of the parts of one log, by name.

    `declared` are pairs of what a part is called and its signals. Raises LawError where two have
    the same name; what a part is called is only asked then. The numbers of one vector, which have
    the same signal in the same part, come once.
    """
    owners: dict[str, tuple[Callable[[], str], Signal]] = {}
    for part, signals in declared:
        for signal in signals:
            if not isinstance(signal, Signal):
                raise LawError(
                    f"{part()}: it declares {signal!r}, which is no Signal; write "
                    f'Signal("{signal}", unit, meaning)'
                )
            other, known = owners.setdefault(signal.name, (part, signal))
            if (other, known) != (part, signal):
                raise LawError(
                    f"{part()}: it logs {signal.name!r}, {describe_signal(signal)}, "
                    f"and {other()} logs {describe_signal(known)} under this name; "
                    "give one of them another name"
                )
    return {name: signal for name, (_, signal) in owners.items()}


def describe_signal(signal: Signal) -> str:
    """`distance to the target (18) [m]`."""
    along = f" along {', '.join(signal.axes)}" if signal.axes else ""
    return f"{signal.meaning} [{signal.unit}]{along}"
