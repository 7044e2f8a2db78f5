"""Positions and headings of logs in podusv's frame: north and east [m], turns to starboard."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import Signal

Quantities = Mapping[str, Vector]

LAT = Signal("lat", "deg", "latitude, north")
LON = Signal("lon", "deg", "longitude, east")
A, F = 6378137.0, 1.0 / 298.257223563  # WGS 84: semi-major axis [m], flattening
LEFT = ("v", "r", "tau_v", "tau_r")  # of a body's axes forward, left, up: what has the other sign


def radii(lat: float) -> tuple[float, float]:
    """Radii of curvature [m] of WGS 84 at a latitude [rad]: along the meridian, across it.

    Source: P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation
    Systems", 2nd ed. 2013, (2.105), (2.106).
    """
    e2 = F * (2.0 - F)
    root = 1.0 - e2 * math.sin(lat) ** 2
    return A * (1.0 - e2) / root**1.5, A / math.sqrt(root)


def local_plane(quantities: Quantities) -> tuple[Quantities, list[str]]:
    """x and y [m] of `lat` and `lon` [deg], where there are no others; what was done.

    The plane touches the ellipsoid at the first fix. A receiver without a fix gives 0, 0.
    """
    rest = {name: values for name, values in quantities.items() if name not in (LAT.name, LON.name)}
    if "x" in rest or "y" in rest or len(quantities) != len(rest) + 2:
        return rest, []
    lat, lon = quantities[LAT.name].copy(), quantities[LON.name].copy()
    none = (lat == 0.0) & (lon == 0.0)
    lat[none] = lon[none] = np.nan
    fixes = np.flatnonzero(np.isfinite(lat) & np.isfinite(lon))
    if not len(fixes):
        return rest, []
    origin = lat[fixes[0]], lon[fixes[0]]
    north, east = radii(math.radians(origin[0]))
    away = (lon - origin[1] + 180.0) % 360.0 - 180.0
    rest["x"] = np.radians(lat - origin[0]) * north
    rest["y"] = np.radians(away) * east * math.cos(math.radians(origin[0]))
    lost = f"; {none.sum()} rows without a fix (0, 0) are left out" if none.any() else ""
    place = f"latitude {origin[0]:.7f}, longitude {origin[1]:.7f} deg"
    return rest, [f"x and y are north and east of the first fix, {place}{lost}"]


def from_frame(quantities: Quantities, frame: str) -> Quantities:
    """Quantities of podusv's frame from those of `frame`: as they are, or from east, north, up."""
    return quantities if frame == "ned" else {**quantities, **_from_enu(quantities)}


def _from_enu(quantities: Quantities) -> Quantities:
    """x was east, y north; psi from east to north; a body's axes forward, left, up."""
    changed = {name: -quantities[name] for name in LEFT if name in quantities}
    if "psi" in quantities:
        changed["psi"] = 0.5 * math.pi - quantities["psi"]
    if "x" in quantities and "y" in quantities:
        changed |= {"x": quantities["y"], "y": quantities["x"]}
    return changed
