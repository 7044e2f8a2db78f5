"""The share of a wave's amplitude that a hull reflects, by the length of the wave.

The shares are those that give the mean drift force of strip theory at zero speed, F = rho g R^2
a^2 W/2 on the width W that meets the wave: the beam in head sea, the length in beam sea. The
forces are those of the model C/S Arctic Drillship (length 2.578 m, beam 0.444 m) and of R/V
Gunnerus (33.9 m, 9.6 m) at scale 1, as tabulated by VERES for MCSimPython 0.1.6,
vessel_data/CSAD/vessel_json.json and vessel_data/gunnerus/vessel.json, key `driftfrc`. Entries
are the geometric mean of both hulls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import by_lines, exponential, logarithm


class ReflectionCurve(NamedTuple):
    """Reflected shares over wave number times a length of the hull."""

    size: tuple[float, ...]
    share: tuple[float, ...]


# Over k L. The two hulls differ by up to 1.3 from 0.5 to 8, and by up to 1.8 above.
BOW_AND_STERN = ReflectionCurve(
    (0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 22.0),
    (0.0021, 0.0081, 0.026, 0.0562, 0.102, 0.244, 0.438, 0.641, 0.799, 0.892, 0.821, 0.566, 0.470),
)
# Over k B; over k L the two hulls would differ by 3. They differ by up to 1.24 from 0.1 on.
SIDES = ReflectionCurve(
    (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 3.9),
    (0.0014, 0.0044, 0.0144, 0.0395, 0.0761, 0.142, 0.279, 0.509, 0.768, 0.866, 0.929),
)


def interpolate_shares(curve: ReflectionCurve, size: Vector) -> Vector:
    """The shares (n,) at these sizes (n,), which are k L or k B of the curve, without unit.

    Between two points a power law; below the first that of the first two; above the last its share.
    """
    x, y = logarithm(np.array(curve.size)), logarithm(np.array(curve.share))
    return exponential(by_lines(np.minimum(logarithm(size), x[-1]), x, y))
