"""The sections of a scenario that are plain settings, and the names that it may use."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from podusv_cli.core.component import Component, value
from podusv_cli.core.earth import MOST, Plane
from podusv_cli.metrics.windows import Radii, Windows

LONGEST_NAME = 80  # letters
NAME = rf"^[A-Za-z0-9][A-Za-z0-9_.-]{{0,{LONGEST_NAME - 1}}}$"
NAME_IN_WORDS = (
    "of letters, digits, '_', '.' and '-', starting with a letter or digit, at most 80 long"
)
LABEL = re.compile(r"[a-z][a-z0-9_]{0,29}")  # usable as a name in claims and as a folder
LABEL_IN_WORDS = "a name here is at most 30 of a-z, 0-9 and _, starting with a letter"
CLAIM = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,29}")
CLAIM_IN_WORDS = (
    "a claim's name is at most 30 of letters, digits, '_' and '-', starting with a letter"
)


Window = Annotated[tuple[float, float], Field(strict=False)]  # from and to [s]


class Start(Component):
    """The vessel's state at t = 0."""

    x: float = value(0.0, "m", "north")
    y: float = value(0.0, "m", "east")
    psi: float = value(0.0, "rad", "heading, from north towards east")
    u: float = value(0.0, "m/s", "surge velocity")
    v: float = value(0.0, "m/s", "sway velocity")
    r: float = value(0.0, "rad/s", "yaw rate")


class Origin(Component):
    """Where x = y = 0 is on earth, for routes and logs in latitude and longitude."""

    lat: float = value(..., "deg", "latitude, north", ge=-MOST["lat"], le=MOST["lat"])
    lon: float = value(..., "deg", "longitude, east", ge=-MOST["lon"], le=MOST["lon"])

    @property
    def plane(self) -> Plane:
        """The plane of x and y."""
        return Plane(self.lat, self.lon)


class Simulation(Component):
    """How the closed loop is integrated."""

    step: float = value(0.01, "s", "step of the classical Runge-Kutta method", gt=0)
    duration: float = value(310.0, "s", "simulated time, a whole number of steps", gt=0)
    compiled: bool = value(True, "", "machine code, or (slowly, same result) plain Python")

    @property
    def outlier(self) -> str:
        """The key, of step and duration, that is further from the usual."""
        usual = Simulation()
        longer, finer = self.duration / usual.duration, usual.step / self.step
        return "simulation.duration" if longer > finer else "simulation.step"


class Control(Component):
    """When the law acts."""

    period: float = value(
        0.0,
        "s",
        "0: continuously; else the law is evaluated once a period, a whole number of "
        "steps, and its output held",
        ge=0,
    )
    update: Literal["after", "before"] = value(
        "after",
        "",
        "of sampled control: whether the law's memory (weights, integrals, filters) "
        "takes a sample after the demand is formed from it, or before; it is integrated over a "
        "period with the sample held",
    )


class Log(Component):
    """What is written to log.h5."""

    every: int = value(
        1,
        "steps",
        "every n-th step is logged; metrics always see every step, claims about signals need 1",
        ge=1,
    )
    monitor: bool = value(
        True,
        "",
        "whether the Lyapunov function of the adaptive laws, its rate and its bounds are logged",
    )
    compress: bool = value(
        False, "", "whether the log's arrays are compressed (gzip), which takes longer"
    )


class MetricSettings(Component):
    """Windows and thresholds of the metrics."""

    steady_fraction: float = value(
        0.2, "", "the last part of the run that counts as settled", gt=0, le=1
    )
    settling_radius: float = value(
        1.0, "m", "settled when the distance to the target stays below this", gt=0
    )
    windows: dict[str, Window] = value(
        {},
        "s",
        "parts of the run as [from, to], by name: `line` adds the metrics error_line_rms "
        "and error_line_max",
    )
    radii: dict[str, float] = value(
        {}, "m", "further settling radii, by name: `near` adds the metric settling_time_near"
    )

    def windows_and_radii(self) -> tuple[Windows, Radii]:
        """Windows and radii, as metrics take them."""
        return tuple(self.windows.items()), tuple(self.radii.items())

    def conflicts(self) -> Iterator[tuple[str, str]]:
        """Key and message for every name, window and radius that cannot be."""
        for section, names in (("windows", self.windows), ("radii", self.radii)):
            for name in names:
                if not LABEL.fullmatch(name):
                    yield f"metrics.{section}.{name}", LABEL_IN_WORDS
        for name, (start, end) in self.windows.items():
            if not 0 <= start < end:
                text = f"must start at 0 s or later and end after that, found {start:g} to {end:g}"
                yield f"metrics.windows.{name}", text
        for name, radius in self.radii.items():
            if radius <= 0:
                yield f"metrics.radii.{name}", f"must be above 0 m, found {radius:g}"


class Required(Component):
    """What is required of a plug-in, a Python file or an installed package."""

    version: str = value("", "", "the package's version; any where empty")
    sha256: str = value("", "", "the digest of its text; any where empty")
