"""Colours, line styles and markers that every figure has, in their order."""

from __future__ import annotations

from typing import Any

# Okabe and Ito's palette and four of Tol's, with line styles and markers that tell the curves apart
# in grey print too.
LOOKS: tuple[tuple[str, Any, str], ...] = (
    ("#0072B2", "-", "o"),
    ("#D55E00", (0, (5, 1.5)), "s"),
    ("#009E73", (0, (1.2, 1.2)), "^"),
    ("#CC79A7", (0, (6, 1.5, 1.2, 1.5)), "D"),
    ("#56B4E9", (0, (3, 1, 1, 1, 1, 1)), "v"),
    ("#E69F00", (0, (9, 2)), "P"),
    ("#332288", (0, (2.5, 1.2)), "<"),
    ("#882255", (0, (8, 1.2, 3, 1.2)), ">"),
    ("#999933", (0, (4, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 1.2)), "X"),
    ("#7A4B12", (0, (1.2, 2.4)), "*"),
)
TARGET_LOOK: dict[str, Any] = {"color": "#444444", "linewidth": 0.8, "linestyle": "-"}


def nth_style(place: int) -> tuple[str, Any, str]:
    """Colour, line style and marker of the run in this place; the first 100 differ."""
    count = len(LOOKS)
    return LOOKS[place % count][0], *LOOKS[(place + place // count) % count][1:]
