"""What every path offers.

A path gives a target at each time. A path that is *followed* (`follows`) has no timetable: its
target is the point of the path beside the vessel, and the distance to it says nothing about time.
Where the vessel is on such a path are numbers of the loop's state, which `locate` sets at every
instant, so that they are logged. Where such a path `waits`, its target goes on by itself once the
vessel has come, so the distance to it counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.paths.fillet import Fillet
from podusv_cli.core.component import KernelPart
from podusv_cli.core.kernel import Vector, absent, arguments_of, bundle, call, kernel
from podusv_cli.core.plugins import TEXT
from podusv_cli.core.signal import TARGET_SIZE, Signal

Point = tuple[float, float]

ARGUMENTS = ("t", "x", "place", "k", "table", "target")  # of `evaluate`
TARGET = ("x_d", "y_d", "x_d_dot", "y_d_dot", "x_d_ddot", "y_d_ddot")


@cache
def read_at_place(evaluate: Callable[..., None]) -> Any:
    """A kernel that is a path's `evaluate` at the time [s] that stands first in `place`.

    It takes `ARGUMENTS` but the time. Its source is written out with the arguments that are needed.
    """
    passed = ("place[0]" if name == "t" else name for name in arguments_of(evaluate, ARGUMENTS))
    text = f"def at_place({', '.join(ARGUMENTS[1:])}):\n    evaluate({', '.join(passed)})"
    scope: dict[str, Any] = {"evaluate": evaluate, "__name__": evaluate.__module__, TEXT: text}
    exec(compile(text, "a path at its own time", "exec"), scope)  # noqa: S102
    return kernel(scope["at_place"])


@dataclass(frozen=True)
class Break:
    """A time [s] at which the target's position, velocity or acceleration jumps."""

    time: float
    what: Literal["position", "velocity", "acceleration"]


class Path(KernelPart):
    """A target moving in the plane.

    `evaluate(t, x, place, k, table, target)` is a kernel that writes position [m], velocity [m/s]
    and acceleration [m/s2] at time t [s] into `target`, in the order of `TARGET`. A path that is
    followed reads the vessel's state x as the law is given it, and `place`, one number for each
    signal of `places`; `locate(t, x, s, place, k, table)` sets these at every instant, with the
    true state s.

    Where the law is to see another target than the log has, `evaluate_shown` is called in place of
    `evaluate`, with a further argument `shown`, which it fills as well.
    """

    noun: ClassVar[str] = "path"
    follows: ClassVar[bool] = False
    waits: ClassVar[bool] = False  # True: it follows, and its target waits until the vessel comes
    places: ClassVar[tuple[Signal, ...]] = ()
    heads: ClassVar[bool] = False  # True: `evaluate` writes a heading behind the distance, too
    rests: ClassVar[bool] = False  # True: its timetable stands still at some time

    evaluate: ClassVar[Callable[..., None]] = staticmethod(absent("evaluate"))
    evaluate_shown: ClassVar[Callable[..., None]] = staticmethod(absent("evaluate_shown"))
    locate: ClassVar[Callable[..., None]] = staticmethod(absent("locate"))

    @property
    def goes_beside(self) -> bool:
        """Whether the target is beside the vessel, so that the distance to it says nothing."""
        return self.follows and not self.waits

    def targets(self, times: Iterable[float]) -> Vector:
        """The target (n, 6) at each of these times [s], a row of `TARGET` each.

        Of a path that is followed, for a vessel that is on it and as fast as it asks for.
        """
        return self.whole_targets(times)[:, : len(TARGET)]

    def whole_targets(self, times: Iterable[float]) -> Vector:
        """The targets at these `times` [s], (n, 10), with what stands behind `TARGET`.

        That is the distance, left 0, and psi_d [rad] with its two rates, 0 of a path without them.
        """
        times = list(times)
        rows, k, table = np.zeros((len(times), TARGET_SIZE)), bundle(self.constants()), self.table()
        for t, row in zip(times, rows, strict=True):
            call(self.evaluate, t=t, k=k, table=table, target=row)
        return rows

    def constants_with(self, standoff: float) -> dict[str, float]:
        """The constants for a law that keeps this distance [m] to its target on purpose."""
        return self.constants()

    def waypoints(self) -> tuple[Point, ...]:
        """Points [m], north and east, that the path is made from; none for most paths."""
        return ()

    def circles(self) -> tuple[tuple[float, float, float], ...]:
        """Where waypoints count as reached: centre north and east, and radius [m]; mostly none."""
        return ()

    def passed_by(self, share: float) -> dict[str, float]:
        """Where this share of the way lies behind the vessel, from 0 to 1: numbers of its `places`.

        It does where they are reached, the first that differs decides; at most two, or metrics
        raise LawError. Share 1 is the end of the path; a path without one has no numbers.
        """
        return {}

    def runs_on_from(self) -> float:
        """Time [s] at which the target leaves the given course and goes on; never for most."""
        return math.inf

    def breaks(self) -> tuple[Break, ...]:
        """Times at which the target is not smooth, in order."""
        return ()

    def fillet_for_law(self) -> Fillet | None:
        """What rounds the corners that the law sees; None where it sees the target itself."""
        return None
