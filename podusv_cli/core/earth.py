"""Places on earth: latitude and longitude beside north and east of an origin."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import arctangents
from podusv_cli.core.recording import Allocate, Recording, blocks
from podusv_cli.core.signal import Signal

LAT = Signal("lat", "deg", "latitude, north")
LON = Signal("lon", "deg", "longitude, east")
PLACE = (LAT, LON)
MOST = {LAT.name: 90.0, LON.name: 180.0}  # deg, to either side
A, F = 6378137.0, 1.0 / 298.257223563  # WGS 84: semi-major axis [m], flattening
E2 = F * (2.0 - F)  # its squared eccentricity
MEAN_RADIUS = 6371e3  # m


@dataclass(frozen=True)
class Plane:
    """The plane that touches WGS 84 at an origin, a latitude and a longitude [deg].

    x is north and y is east in it [m]; heights are left out. A way along the earth from the origin
    is longer than its picture here: see `error_at`. Source: P. D. Groves, "Principles of GNSS,
    Inertial, and Multisensor Integrated Navigation Systems", 2nd ed. 2013, (2.112), (2.158).
    """

    lat: float
    lon: float

    @cached_property
    def _origin(self) -> tuple[float, float, float, float]:
        """Sine and cosine of its latitude; its distances from the axis and the equator [m]."""
        s, c = math.sin(math.radians(self.lat)), math.cos(math.radians(self.lat))
        across = A / math.sqrt(1.0 - E2 * s * s)
        return s, c, across * c, across * (1.0 - E2) * s

    def north_east(self, lat: Vector, lon: Vector) -> tuple[Vector, Vector]:
        """x and y (n,) [m] of latitudes `lat` and longitudes `lon` (n,) [deg], in any turn.

        In axes of the earth that turn with the origin's longitude: outward from the axis, east, and
        upward along it. North and the vertical follow by the origin's latitude.
        """
        s, c, out, up = self._origin
        phi, away = np.radians(lat), np.radians(lon - self.lon)
        across = A / np.sqrt(1.0 - E2 * np.sin(phi) ** 2)
        from_axis = across * np.cos(phi)
        outward = from_axis * np.cos(away) - out
        upward = across * (1.0 - E2) * np.sin(phi) - up
        return c * upward - s * outward, from_axis * np.sin(away)

    def places(self, north: Vector, east: Vector) -> tuple[Vector, Vector]:
        """Latitudes and longitudes (n,) [deg, -180 to 180] of places in the plane.

        `north` and `east` (n,) are x and y [m]; beyond the earth's rim the result is NaN. The point
        of the ellipsoid below (x, y) lies as far below the plane as the smaller root of a quadratic
        equation.
        """
        s, c, out, up = self._origin
        stretch = 1.0 / (1.0 - E2)  # makes a sphere of radius A of the ellipsoid's squares
        outward, upward = out - north * s, up + north * c
        square = c * c + s * s * stretch
        half = outward * c + upward * s * stretch
        rest = outward**2 + east**2 + upward**2 * stretch - A * A
        # Of the two forms of the root the one that takes no difference of numbers nearly alike
        with np.errstate(invalid="ignore"):
            rise = -rest / (half + np.sqrt(half * half - square * rest))
        outward, upward = outward + rise * c, upward + rise * s
        lat = np.degrees(arctangents(upward * stretch, np.sqrt(outward**2 + east**2)))
        lon = self.lon + np.degrees(arctangents(east, outward))
        return lat, (lon + 180.0) % 360.0 - 180.0


def error_at(distance: float) -> float:
    """By how much a way of so many metres from the origin is too short in the plane [m].

    d^3 / (6 R^2), the first term of d - R sin(d/R): 0.5 mm at 5 km, 0.5 m at 50 km.
    """
    return distance**3 / (6.0 * MEAN_RADIUS**2)


def add_places(recording: Recording, plane: Plane, allocate: Allocate) -> Recording:
    """The recording with latitude and longitude (rows,) [deg] of the vessel.

    `plane` has the origin of x and y; `allocate` makes the arrays. Block by block, as a log may
    exceed memory.
    """
    rows = len(recording["time"])
    added = {signal.name: allocate(rows) for signal in PLACE}
    for part in blocks(rows):
        places = plane.places(recording["x"][part], recording["y"][part])
        for values, degrees in zip(added.values(), places, strict=True):
            values[part] = degrees
    about = {**recording.about, LAT.name: LAT, LON.name: LON}
    return replace(recording, signals={**recording.signals, **added}, about=about)
