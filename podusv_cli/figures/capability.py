"""A polar figure of the loads that a vessel holds at rest."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from podusv_cli.core import escaping
from podusv_cli.figures.looks import nth_style
from podusv_cli.figures.style import legend, new_figure
from podusv_cli.theory.capability import Capability

HEIGHT = 4.2  # inches
PLACE = (0.1, 0.1, 0.8, 0.72)  # of the disc, in parts of the page


def polar(found: Capability, words: str, columns: int = 1) -> Figure:
    """The largest load by where it comes from, the bow on top and starboard on the right.

    `found` has sizes (n,) at angles (n,) [rad]. A closed curve for all thrusters, and one for those
    that are left without each; `words` say what the radius is. `columns` is the width in columns of
    a page.
    """
    figure = new_figure(columns, HEIGHT)
    axes = cast("PolarAxes", figure.add_axes(PLACE, projection="polar"))
    axes.set_theta_zero_location("N")
    # Angles grow clockwise, as headings do.
    axes.set_theta_direction(-1)
    # The first point once more, so that the curve closes.
    around = np.append(found.angles, 2.0 * math.pi)
    for place, (name, sizes) in enumerate(found.held.items()):
        color, linestyle, _ = nth_style(place)
        axes.plot(
            around,
            np.append(sizes, sizes[0]),
            color=color,
            linestyle=linestyle,
            label=escaping.figure(name),
        )
    axes.set_xlabel(words)
    axes.set_rlim(0.0)
    legend(figure)
    return figure
