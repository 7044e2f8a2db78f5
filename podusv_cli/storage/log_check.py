"""What every log of a run holds, whoever wrote it: without it nothing can be drawn or compared."""

from __future__ import annotations

import numpy as np

from podusv_cli.core.errors import LawError
from podusv_cli.core.recording import Recording
from podusv_cli.engine.check import called
from podusv_cli.engine.simulate import ClosedLoop, by_name, names
from podusv_cli.paths.base import TARGET
from podusv_cli.storage.log_layout import misfit

NEEDED = (
    "time", "x", "y", "psi", "u", "v", "r", "x_d", "y_d", "tau_u_cmd", "tau_r_cmd", "tau_u",
    "tau_r",
)  # fmt: skip
_TERMS = ("z_e", "psi_e", "u_e", "r_e", "y_u", "y_r", "W_u", "W_r", "b_u", "b_r")
_BOUNDS = ("V", "window_start", "V_lambda", "V_Delta", "V_bound", "v_bound")
# What a signal is of no use without.
BESIDE = {
    "V": (*(f"V_{term}" for term in _TERMS), *_BOUNDS),
    "V_dot": _BOUNDS,
    "n": ("delta",),
    "n_part": ("delta",),
    "power": ("delta",),
}
LARGEST = 1e300  # the engine takes anything beyond for divergence and does not log it


def check_declared(loop: ClosedLoop) -> None:
    """LawError where the arrays that a loop will log do not fit each other."""
    columns = names(loop)
    row = by_name(columns, np.zeros((1, len(columns))))
    logged = {name: array for name, array in row.items() if name not in TARGET[2:]}
    if wrong := misfit(logged | loop.controller.fixed_signals()):
        raise LawError(f"{called(loop.controller)}: its log cannot be written: {wrong}")


def fault(log: Recording) -> str:
    """What is wrong with the log of a run, in words; empty where nothing is."""
    wanted = [*NEEDED, *(name for one, rest in BESIDE.items() if one in log for name in rest)]
    lacking = [name for name in wanted if name not in log]
    if lacking:
        return f"it has no {lacking[0]}"
    wild = [name for name in NEEDED if not np.all(np.abs(log[name]) <= LARGEST)]
    if wild:
        return f"{wild[0]} holds something that is no finite number"
    return "" if np.all(np.diff(log["time"]) > 0.0) else "its times do not increase"
