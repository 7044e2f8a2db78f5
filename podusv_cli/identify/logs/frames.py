"""Positions and headings of logs in podusv's frame: north and east [m], turns to starboard."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from podusv_cli.core.earth import LAT, LON, Plane
from podusv_cli.core.kernel import Vector

Quantities = Mapping[str, Vector]

LEFT = ("v", "r", "tau_v", "tau_r")  # of a body's axes forward, left, up: what has the other sign


def local_plane(quantities: Quantities, plane: Plane | None) -> tuple[Quantities, list[str]]:
    """x and y [m] of `lat` and `lon` [deg], where there are no others; what was done.

    Without a plane it is that which touches the earth at the first fix. A receiver without a fix
    gives 0, 0.
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
    first = float(lat[fixes[0]]), float(lon[fixes[0]])
    beside = plane or Plane(*first)
    rest["x"], rest["y"] = beside.north_east(lat, lon)
    lost = f"; {none.sum()} rows without a fix (0, 0) are left out" if none.any() else ""
    what = "the scenario's origin" if plane else "the first fix"
    place = f"latitude {beside.lat:.7f}, longitude {beside.lon:.7f} deg"
    return rest, [f"x and y are north and east of {what}, {place}{lost}"]


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
