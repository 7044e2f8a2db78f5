"""The key `identify`: the logs of a boat, and which numbers of its hull they are to give."""

from __future__ import annotations

import math
import os.path
from itertools import combinations
from typing import Literal, Self

from pydantic import field_validator, model_validator

from podusv_cli.core.component import Component, Positive, value

DAMPING = {"surge": "X_", "sway": "Y_", "yaw": "N_"}
SENSORS = ("sigma_p", "sigma_psi", "sigma_u", "sigma_v", "sigma_r")  # of the ekf
WANDER, COMPASS = "wander", "compass"  # m, rad: errors that last; 0 where there is none
LASTING = (WANDER, COMPASS)
COMPASS_OFF = 0.1  # rad, by which a compass may be off
GROUPS = ("inertia", *(f"damping.{axis}" for axis in DAMPING))
THRUST_CURVE = "thrust_curve"  # dead band and exponent of the propellers' thrust


class LogFile(Component):
    """One log, of which all or a part is used."""

    file: str = value(..., "", "CSV, log.h5, ROS 2 bag, .ulg or .bin, beside the scenario")
    span: tuple[float, float] | None = value(
        None, "s", "[from, to]: the part of the log that is used, before `to`; null: all of it"
    )
    delay: float | None = value(
        None, "s", "by how much later than the log says its commands act; null: as the motion says"
    )
    role: Literal["fit", "judge"] = value(
        "fit", "", "fit: the numbers follow from it; judge: it shows how well they predict"
    )

    @model_validator(mode="after")
    def _forward(self) -> Self:
        """Raises ValueError for a span that does not begin before it ends."""
        if self.span and not self.span[0] < self.span[1]:
            raise ValueError(f"span: {self.span[0]:g} s is not before {self.span[1]:g} s")
        return self

    @property
    def name(self) -> str:
        """The file, with the part of it that is used."""
        if not self.span:
            return self.file
        return f"{self.file} from {self.span[0]:.10g} to {self.span[1]:.10g} s"

    def shares(self, other: LogFile) -> bool:
        """Whether both have a part of the same file."""
        if os.path.normpath(self.file) != os.path.normpath(other.file):
            return False
        (a, b), (c, d) = (log.span or (-math.inf, math.inf) for log in (self, other))
        return a < d and c < b


class Identify(Component):
    """Which logs there are, what their columns mean, and which numbers are looked for."""

    logs: tuple[LogFile, ...] = value(
        (), "", "the logs; podusv compare with a measured track needs none", strict=False
    )
    columns: dict[str, str] = value(
        {},
        "",
        "what a log calls a quantity, with its unit where that is not podusv's: "
        '{psi: "heading [deg]"}, with a minus before the name if its sign is the other one; a '
        "column called as podusv does needs no entry",
    )
    frame: Literal["ned", "enu"] = value(
        "ned",
        "",
        "axes of the logs: ned as podusv (x north, y east, psi from north towards east; "
        "v, r to starboard), or enu (x east, y north, psi from east towards north; v, r to port)",
    )
    free: tuple[str, ...] = value(
        GROUPS,
        "",
        "numbers of the vessel that are looked for, or groups of them: "
        f"{', '.join(GROUPS)}; all others stay as the vessel has them. {THRUST_CURVE}: dead band "
        "and exponent of the propellers' thrust over n, with its value at full n kept",
        strict=False,
    )
    prior: Positive = value(
        0.5, "", "relative standard deviation of the vessel's own numbers, before the logs are read"
    )
    priors: dict[str, Positive] = value({}, "", "the same of single numbers, in place of `prior`")
    noise: dict[str, float] = value(
        {},
        "m or rad or m/s or rad/s",
        "standard deviations of sensors that are known, by the "
        f"names of the ekf: {', '.join(SENSORS)}; all others follow from the logs. Beside them "
        f"{WANDER}, of a position's error that wanders, by default as the logs say, 0: none; "
        f"{COMPASS}, by how much a compass may be off, by default {COMPASS_OFF:g}, 0: not at all",
    )
    gusts: bool | None = value(
        None,
        "",
        "whether loads along the logs swing about a mean, as those of gusts, or wander; null: "
        "what the logs are likelier with",
    )
    current: float | None = value(
        None,
        "m/s",
        "standard deviation of the current north and east, which every log has its "
        "own of; null: a tenth of the speed at full thrust; 0: no current",
        ge=0,
    )
    step: Positive = value(
        0.05,
        "s",
        "longest step of the filter along a log; shorter by itself where the hull's damping asks "
        "for it",
    )
    draws: int = value(
        200, "", "hulls that are drawn from what the logs leave open", ge=2, le=10**5
    )
    seed: int = value(1, "", "of the draws", ge=0, lt=2**63)

    @field_validator("logs")
    @classmethod
    def _some_to_fit(cls, logs: tuple[LogFile, ...]) -> tuple[LogFile, ...]:
        """Raises ValueError where no log is for the fit, or one stretch of a log comes twice."""
        if logs and not any(log.role == "fit" for log in logs):
            raise ValueError("all logs are for judging; at least one has to have role: fit")
        for one, other in combinations(logs, 2):
            if one.shares(other):
                raise ValueError(
                    f"{one.name} and {other.name} have a part in common, which would count twice; "
                    "leave one of them out, or give them spans that do not overlap"
                )
        return logs

    @field_validator("noise")
    @classmethod
    def _of_sensors(cls, noise: dict[str, float]) -> dict[str, float]:
        """Raises ValueError for a name in `noise` that is no sensor's, and for what is no size."""
        for name, deviation in noise.items():
            if name not in (*SENSORS, *LASTING):
                allowed = ", ".join((*SENSORS, *LASTING))
                raise ValueError(f"{name} is no sensor's deviation (allowed: {allowed})")
            if not deviation >= 0.0 or (deviation == 0.0 and name not in LASTING):
                least = "at least 0" if name in LASTING else "above 0"
                raise ValueError(f"{name} is {deviation:g}; it has to be {least}")
        return noise
