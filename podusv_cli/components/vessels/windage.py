"""What of a vessel the wind acts on."""

from __future__ import annotations

from podusv_cli.core.component import Component, value


class Windage(Component):
    """Projected areas above the water, and coefficients of Blendermann (1994)."""

    source: str = value("", "", "where the numbers come from")
    A_F: float = value(..., "m2", "frontal projected area", gt=0)
    A_L: float = value(..., "m2", "lateral projected area", gt=0)
    s_L: float = value(0.0, "m", "centroid of the lateral area ahead of the body origin")
    CD_t: float = value(0.9, "", "drag coefficient of wind from the side", gt=0)
    CD_l_bow: float = value(
        0.55, "", "drag coefficient of wind from ahead, of the frontal area", gt=0
    )
    CD_l_stern: float = value(
        0.6, "", "drag coefficient of wind from astern, of the frontal area", gt=0
    )
    delta: float = value(0.6, "", "cross-force parameter", ge=0, le=1)
