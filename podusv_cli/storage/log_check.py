"""Checks that a log holds the signals that figures and comparisons need."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.recording import Recording

NEEDED = (
    "time", "x", "y", "psi", "u", "v", "r", "x_d", "y_d", "tau_u_cmd", "tau_r_cmd", "tau_u",
    "tau_r",
)  # fmt: skip
_TERMS = ("z_e", "psi_e", "u_e", "r_e", "y_u", "y_r", "W_u", "W_r", "b_u", "b_r")
_BOUNDS = ("V", "window_start", "V_lambda", "V_Delta", "V_bound", "v_bound")
# Signals that a signal needs beside it.
BESIDE = {
    "V": (*(f"V_{term}" for term in _TERMS), *_BOUNDS),
    "V_dot": _BOUNDS,
    "n": ("delta",),
    "n_part": ("delta",),
    "power": ("delta",),
}
LARGEST = 1e300  # beyond it the engine calls a run diverged and logs no row


def fault(log: Recording) -> str:
    """The first fault of a log, in words; empty if there is none."""
    wanted = [*NEEDED, *(name for one, rest in BESIDE.items() if one in log for name in rest)]
    lacking = [name for name in wanted if name not in log]
    if lacking:
        return f"it has no {lacking[0]}"
    wild = [name for name in NEEDED if not np.all(np.abs(log[name]) <= LARGEST)]
    if wild:
        return f"{wild[0]} holds something that is no finite number"
    return "" if np.all(np.diff(log["time"]) > 0.0) else "its times do not increase"
