"""The shape of log.h5, format 1, as writer and reader share it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import SIGNALS

FORMAT = 1
CONVENTIONS = "CF-1.11"
PROVENANCE, RESOLVED = "provenance", "resolved_yaml"
CHUNK_BYTES = 2**20  # HDF5's default chunk cache

# Axes besides time, each a dataset of the integers 0, 1, ..., with what they count.
AXES = {
    "node": "network node",
    "input": "network input: u, v, r",
    "window": "part of the run: the whole, its settled end",
    "pod": "pod, in the scenario's order",
}

# Arrays that do not run over time, and their axes.
FIXED_AXES = {
    "rbf_center": ("node", "input"),
    "rbf_width": ("input",),
    "W_star_u": ("node",),
    "W_star_r": ("node",),
    "window_start": ("window",),
    "V_lambda": ("window",),
    "V_Delta": ("window",),
    "V_bound": ("window",),
    "v_bound": ("window",),
}


def axes(name: str) -> tuple[str, ...]:
    """Names of a signal's axes, `time` first where it has one. KeyError for an unknown signal."""
    return FIXED_AXES.get(name, ("time", *SIGNALS[name].axes))


def misfit(arrays: Mapping[str, Vector]) -> str:
    """Why arrays of these names and shapes make no log; empty where they do."""
    lengths: dict[str, int] = {}
    for name, array in arrays.items():
        wanted = axes(name)
        if array.ndim != len(wanted):
            return f"{name} has the shape {array.shape}, and its axes are {', '.join(wanted)}"
        for axis, size in zip(wanted, array.shape, strict=True):
            if lengths.setdefault(axis, size) != size:
                return f"{name} has {size} values along {axis}, where others have {lengths[axis]}"
    return ""


def chunk(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Rows that are compressed together, with everything in them; the last chunk is nearly full."""
    most = max(1, CHUNK_BYTES // (8 * math.prod(shape[1:])))
    return (-(-shape[0] // -(-shape[0] // most)), *shape[1:])
