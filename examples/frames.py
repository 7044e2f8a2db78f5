"""Draw frames, angles and forces of docs/model.md.

python examples/frames.py docs/images/frames.png

Every point of the drawing follows from the numbers below, by the equations of the page.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc, FancyArrowPatch

from podusv_cli.figures.looks import nth_style
from podusv_cli.figures.style import house_style, image, new_figure

VESSEL, TARGET = np.array([3.0, 2.5]), np.array([7.5, 8.0])  # x north, y east
PSI, DELTA = np.deg2rad(22.0), np.deg2rad(28.0)
PSI_D = np.arctan2(*(TARGET - VESSEL)[::-1])  # (19): atan2(y_d - y, x_d - x)
OUTLINE = np.array([(-1.2, -0.45), (0.5, -0.45), (1.3, 0.0), (0.5, 0.45), (-1.2, 0.45)])
STERN = (-1.2, 0.0)
BLACK, BLUE, RED, GREEN = "#333333", nth_style(0)[0], nth_style(1)[0], nth_style(2)[0]


def ahead(angle: float) -> np.ndarray:
    """The unit vector in a direction, from north towards east [rad]."""
    return np.array([np.cos(angle), np.sin(angle)])


def in_earth(point: tuple[float, float]) -> np.ndarray:
    """A point of the body frame in the earth frame: (1) to (3) at rest."""
    return VESSEL + point[0] * ahead(PSI) + point[1] * ahead(PSI + np.pi / 2)


def arrow(axes: Axes, start: np.ndarray, end: np.ndarray, color: str, style: str = "-|>") -> None:
    """An arrow between two points of the earth frame."""
    axes.add_patch(
        FancyArrowPatch(
            start[::-1],
            end[::-1],
            arrowstyle=style,
            mutation_scale=9,
            color=color,
            lw=1.1,
            shrinkA=0,
            shrinkB=0,
        )
    )


def word(axes: Axes, place: np.ndarray, text: str, color: str = BLACK) -> None:
    """A symbol, in the middle of a place."""
    axes.text(place[1], place[0], text, color=color, ha="center", va="center")


def angle(axes: Axes, at: np.ndarray, radius: float, low: float, high: float, color: str) -> None:
    """An arc from one direction to another, with the second's arrow at its end."""
    axes.add_patch(
        Arc(
            at[::-1],
            2 * radius,
            2 * radius,
            theta1=90.0 - np.rad2deg(high),
            theta2=90.0 - np.rad2deg(low),
            color=color,
            lw=1.0,
        )
    )
    tip = at + radius * ahead(high)
    arrow(axes, tip - 0.01 * ahead(high + np.pi / 2), tip, color)


def draw_earth(axes: Axes) -> None:
    """The frame that is fixed to the earth, and what the target lies ahead of the vessel in it."""
    origin = np.zeros(2)
    for end, text in (((8.6, 0.0), r"$x$, north"), ((0.0, 9.6), r"$y$, east")):
        arrow(axes, origin, np.array(end), BLACK)
        word(axes, np.array(end) + (0.35 if end[0] else -0.45), text)
    corner = np.array([TARGET[0], VESSEL[1]])
    for point in (VESSEL, TARGET):
        axes.plot([corner[1], point[1]], [corner[0], point[0]], ":", color=BLACK, lw=0.9)
    word(axes, (corner + TARGET) / 2 + [0.3, 0.0], r"$y_e = y_d - y$")
    word(axes, np.array([6.5, 1.35]), r"$x_e = x_d - x$")
    word(axes, TARGET + np.array([0.45, 1.0]), r"target $(x_d, y_d)$")
    axes.plot(*TARGET[::-1], "+", color=BLACK, ms=9)


def draw_vessel(axes: Axes) -> None:
    """The hull, its axes and velocities, and the line of sight with its angles."""
    hull = np.array([in_earth(point) for point in (*OUTLINE, OUTLINE[0])])
    axes.fill(hull[:, 1], hull[:, 0], facecolor="#dddddd", edgecolor=BLACK, lw=0.9)
    arrow(axes, VESSEL, in_earth((3.0, 0.0)), BLUE)
    word(axes, in_earth((3.3, 0.0)), r"$u$", BLUE)
    arrow(axes, VESSEL, in_earth((0.0, 1.5)), BLUE)
    word(axes, in_earth((0.0, 1.8)), r"$v$", BLUE)
    arrow(axes, VESSEL, TARGET, GREEN)
    word(axes, VESSEL + 0.72 * (TARGET - VESSEL) + [-0.35, 0.3], r"$z_e$", GREEN)
    angle(axes, VESSEL, 2.1, 0.0, PSI, BLUE)
    word(axes, VESSEL + 2.4 * ahead(PSI / 2), r"$\psi$", BLUE)
    angle(axes, VESSEL, 3.6, 0.0, PSI_D, GREEN)
    word(axes, VESSEL + 3.95 * ahead(0.72 * PSI_D), r"$\psi_d$", GREEN)
    angle(axes, VESSEL, 2.6, PSI, PSI_D, GREEN)
    word(axes, VESSEL + 2.2 * ahead((PSI + PSI_D) / 2), r"$\psi_e$", GREEN)
    word(axes, in_earth((-0.2, -0.95)), r"$(x, y)$")


def draw_forces(axes: Axes) -> None:
    """Force and moment that a law asks for, and the thrust of a pod at the stern."""
    arrow(axes, in_earth((0.0, 0.0)), in_earth((1.15, 0.0)), RED)
    word(axes, in_earth((0.95, -0.72)), r"$\tau_u$", RED)
    angle(axes, VESSEL, 0.75, PSI + 2.2, PSI + 3.9, RED)
    word(axes, VESSEL + 1.3 * ahead(PSI + 2.1), r"$\tau_r, r$", RED)
    stern = in_earth(STERN)
    axes.plot(
        [stern[1], in_earth((-2.9, 0.0))[1]],
        [stern[0], in_earth((-2.9, 0.0))[0]],
        "--",
        color=BLACK,
        lw=0.7,
    )
    thrust = ahead(PSI + DELTA)
    arrow(axes, stern - 1.7 * thrust, stern, RED)
    word(axes, stern - 1.95 * thrust, r"$T$", RED)
    angle(axes, stern, 1.25, PSI + np.pi, PSI + np.pi + DELTA, RED)
    word(axes, stern - 1.5 * ahead(PSI + DELTA / 2), r"$\delta$", RED)


def main() -> None:
    """Draw all of it."""
    with house_style():
        figure = new_figure(1, 3.1)
        axes = figure.subplots()
        for draw in (draw_earth, draw_vessel, draw_forces):
            draw(axes)
        axes.set(xlim=(-0.4, 10.5), ylim=(-0.75, 9.2), aspect="equal")
        axes.set_axis_off()
        Path(sys.argv[1]).write_bytes(image(figure, "png"))


if __name__ == "__main__":
    main()
