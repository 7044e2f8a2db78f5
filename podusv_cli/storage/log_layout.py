"""The shape of log.h5, format 1, as writer and reader share it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from podusv_cli.core.signal import Signal

FORMAT = 1
CONVENTIONS = "CF-1.11"
PROVENANCE, RESOLVED = "provenance", "resolved_yaml"
CHUNK_BYTES = 2**20  # HDF5's default chunk cache

# Axes besides time that podusv brings along, with what they count; each is a dataset of the
# integers 0, 1, ...
AXES = {
    "node": "network node",
    "input": "network input: u, v, r",
    "window": "part of the run: the whole, its settled end",
    "pod": "pod, in the scenario's order",
}

# What logs written before signals were described in them have beside time, and which are wrapped.
OLD_AXES = {
    "rbf_center": "node input", "rbf_width": "input", "W_star_u": "node", "W_star_r": "node",
    "window_start": "window", "V_lambda": "window", "V_Delta": "window", "V_bound": "window",
    "v_bound": "window", "W_hat_u": "time node", "W_hat_r": "time node",
    **dict.fromkeys(
        ("n", "n_part", "delta", "n_cmd", "n_part_cmd", "delta_cmd", "thrust", "power"), "time pod"
    ),
}  # fmt: skip
OLD_WRAPPED = ("psi_d", "psi_e", "psi_d_held")


def meaning_of_axis(axis: str) -> str:
    """What an axis counts; of one that a law brings, its name."""
    return AXES.get(axis, axis)


def description(signal: Signal) -> dict[str, str]:
    """What a log's variable says of its signal."""
    words = {"units": signal.unit, "long_name": signal.meaning, "symbol": signal.symbol}
    wrapped = {"wrapped": "modulo 2 pi"} if signal.wrapped else {}
    return words | {"axes": " ".join(signal.dimensions)} | wrapped


def described(name: str, words: Mapping[str, str]) -> Signal:
    """The signal that a log's variable says it is. ValueError for what no signal can be called."""
    axes = words.get("axes", OLD_AXES.get(name, "time")).split()
    over_time = axes[:1] == ["time"]
    return Signal(
        name, words["units"], words["long_name"], words["symbol"], tuple(axes[over_time:]),
        wrapped="wrapped" in words or ("axes" not in words and name in OLD_WRAPPED),
        fixed=not over_time,
    )  # fmt: skip


def chunk(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Rows that are compressed together, with everything in them; the last chunk is nearly full."""
    most = max(1, CHUNK_BYTES // (8 * math.prod(shape[1:])))
    return (-(-shape[0] // -(-shape[0] // most)), *shape[1:])
