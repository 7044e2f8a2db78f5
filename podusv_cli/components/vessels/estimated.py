"""A hull's numbers from its dimensions, by formulas that were published for ships.

They stand in for numbers that nobody measured. `SCATTER` says how far they are off on the hulls of
podusv whose numbers are known (podusv docs start has the table).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

WATER = 1000.0  # kg/m3
GRAVITY = 9.81  # m/s2
GYRATION = 0.25  # radius over length: smaller vessels, Fossen (2021) in clarke83.m of MSS
BLOCK = 0.5  # displaced volume over length, beam and draught of a hull; podusv's choice
SLENDER = 0.1  # beam of one hull of a catamaran over its length; podusv's choice
DISPLACEMENT = 0.4  # largest Froude number of displacement vessels, Faltinsen (2005)
HOERNER = (
    # Half the beam over the draught, and the cross-flow drag coefficient of such a section: points
    # of Hoerner's curve as in Hoerner.m of MSS, the steep part between 0.45 and 0.5 with its ends.
    (0.0, 0.177, 0.353, 0.452, 0.493, 0.558, 0.646, 0.834, 0.988, 1.31, 1.64, 2.31, 3.01, 4.0),
    (1.97, 1.97, 1.90, 1.79, 1.21, 1.08, 1.00, 0.880, 0.828, 0.760, 0.691, 0.631, 0.587, 0.559),
)
# The root mean square of the logarithm of estimate over known number on those hulls.
SCATTER = {
    "I_z": 0.44,
    "X_udot": 0.86,
    "Y_vdot": 1.2,
    "N_rdot": 0.86,
    "surge_damping": 0.64,
    "sway_damping": 1.3,
    "yaw_damping": 1.3,
}


class Hull(NamedTuple):
    """Dimensions of a boat of one hull, or of two alike: lengths [m], mass [kg], thrust [N].

    `thrust` is all that its propellers have ahead, `speed` what it makes of it [m/s]; `hull_beam`
    is the beam of one hull of a catamaran.
    """

    length: float
    beam: float
    mass: float
    thrust: float
    hulls: int = 1
    speed: float = math.nan
    hull_beam: float = math.nan

    @property
    def narrow(self) -> float:
        """The beam of one hull [m]."""
        if self.hulls == 1:
            return self.beam
        return SLENDER * self.length if math.isnan(self.hull_beam) else self.hull_beam

    @property
    def draught(self) -> float:
        """That of hulls of block coefficient BLOCK with this mass [m]."""
        return self.mass / (WATER * BLOCK * self.hulls * self.length * self.narrow)

    @property
    def slow(self) -> float:
        """The speed up to which a hull of this length displaces water and does not plane [m/s]."""
        return DISPLACEMENT * math.sqrt(GRAVITY * self.length)

    @property
    def top_speed(self) -> float:
        """The speed at full thrust [m/s]; where it is not known, `slow`."""
        return self.slow if math.isnan(self.speed) else self.speed

    @property
    def cruise(self) -> float:
        """Half of the top speed, and of `slow` at most [m/s]: most of the thrust is left."""
        return 0.5 * min(self.top_speed, self.slow)


def estimate_vessel(hull: Hull) -> dict[str, float]:
    """Numbers of `Vessel` by name; the linear damping in sway and yaw is that at `hull.cruise`.

    - `I_z`: a radius of gyration of 0.25 L.
    - `X_udot`: 2.7 rho V^(5/3) / L^2 for each hull of volume V (Soeding 1982, as in
      addedMassSurge.m of MSS).
    - `Y_vdot`, `N_rdot`: strip theory with the added mass of a plate as deep as the draught,
      rho pi T^2 / 2 a length (Newman 1977, table 4.3), constant along the hull; the terms that do
      not depend on the beam in Clarke, Gedling and Hine (1983). Of two hulls yaw also moves each
      in surge.
    - `X_u`: a time constant of L seconds (clarke83.m of MSS); `X_uu`: full thrust gives top speed.
      Where that `X_u` would need more than full thrust at top speed, it is thrust over speed, and
      `X_uu` is 0.
    - `Y_v`, `N_r`: Clarke, Gedling and Hine (1983), regressions over model tests of ships, times
      the speed. What they have of coupling between sway and yaw is left out.
    - `Y_vv`, `N_rr`: cross-flow drag over the length with Hoerner's coefficient (Fossen 2021,
      section 6.4), one axis at a time.
    """
    # SI units; `apart` is from the centre line to a hull's, `wide` is beam over draught
    length, beam, draught, hulls = hull.length, hull.narrow, hull.draught, hull.hulls
    apart = 0.5 * (hull.beam - beam) if hulls > 1 else 0.0
    surge = 2.7 * WATER * (hull.mass / (WATER * hulls)) ** (5.0 / 3.0) / length**2 * hulls
    sway = 0.5 * math.pi * WATER * draught**2 * length * hulls
    linear = (hull.mass + surge) / length
    top = hull.top_speed
    rest = max(hull.thrust - linear * top, 0.0)
    lift, wide = sway * hull.cruise / length, beam / draught
    drag = 0.5 * WATER * draught * length * hulls * float(np.interp(0.5 * wide, *HOERNER))
    return {
        "I_z": hull.mass * (GYRATION * length) ** 2,
        "X_udot": -surge,
        "Y_vdot": -sway,
        "N_rdot": -(sway * length**2 / 12.0 + surge * apart**2),
        "X_u": -min(linear, hull.thrust / top),
        "X_uu": -rest / top**2 if rest else 0.0,
        "Y_v": -lift * (1.0 + 0.4 * BLOCK * wide),
        "N_r": -lift * length**2 * max(0.25 + 0.039 * wide - 0.56 * beam / length, 0.05),
        "Y_vv": -drag,
        "N_rr": -drag * length**3 / 32.0,
    }
