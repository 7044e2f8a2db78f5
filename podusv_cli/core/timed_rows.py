"""Rows of numbers over time, as text with commas."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from podusv_cli.core.kernel import Vector

LARGEST = 900_000  # characters: the resolved scenario, which has the rows, must be readable


def timed_rows(text: str, noun: str, layouts: Mapping[int, str]) -> Vector:
    """The rows, each with as many numbers as one of `layouts`, which says what they are.

    # starts a comment, and a first line of words is a header. `noun` is what the text is called.
    Raises ValueError, which does not repeat the text: a file may hold what its reader may not see.
    """
    if len(text) > LARGEST:
        raise ValueError(f"{noun} is longer than {LARGEST:,} characters; leave rows out")
    rows = _numbers(text, noun, layouts)
    if len(rows) < 2:
        raise ValueError(f"{noun} needs at least two lines, has {len(rows)}")
    if not np.all(np.isfinite(rows)):
        raise ValueError(f"{noun} holds a number that is not finite")
    if np.any(np.diff(rows[:, 0]) <= 0.0):
        raise ValueError(f"the times of {noun} do not increase from line to line")
    return rows


def _numbers(text: str, noun: str, layouts: Mapping[int, str]) -> Vector:
    lines = [line.partition("#")[0].strip() for line in text.removeprefix("\ufeff").splitlines()]
    filled = [(number, line.split(",")) for number, line in enumerate(lines, 1) if line]
    if filled and filled[0][1][0].strip(' "')[:1].isalpha():
        del filled[0]
    for number, cells in filled:
        if len(cells) not in layouts or len(cells) != len(filled[0][1]):
            wanted = " or ".join(f"{count} ({what})" for count, what in layouts.items())
            raise ValueError(
                f"line {number} of {noun} has {len(cells)} numbers; every line must have {wanted}"
            )
    try:
        numbers = np.array([cells for _, cells in filled], dtype=float)
    except ValueError:
        raise ValueError(f"{noun} holds something that is no number") from None
    return numbers.reshape(len(filled), len(filled[0][1]) if filled else next(iter(layouts)))
