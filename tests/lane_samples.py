"""Numbers as registers have them, bit by bit."""

from __future__ import annotations

from typing import Any

import numpy as np

from podusv_cli.core.kernel import LANES, Vector


def bits(numbers: Vector) -> Any:
    """The bits of numbers, zeros with their sign; what is no number is all the same."""
    return np.where(np.isnan(numbers), np.nan, numbers).view(np.int64)


def aligned(content: Vector) -> Vector:
    """A copy that begins at a whole register."""
    room = np.zeros(content.size + LANES)
    room = room[-(room.ctypes.data // 8) % LANES :][: content.size]
    room[:] = content.ravel()
    return room
