"""Signals that follow from logged ones, where the log does not have them itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal


@dataclass(frozen=True)
class Derived:
    """A signal computed from logged ones."""

    signal: Signal
    needs: tuple[str, ...]
    compute: Callable[[Recording], Vector]


def _node_distance(log: Recording) -> Vector:
    nearest = np.full(len(log["time"]), np.inf)
    for center in log["rbf_center"]:
        parts = (
            (log[name] - c) / w for name, c, w in zip("uvr", center, log["rbf_width"], strict=True)
        )
        nearest = np.minimum(nearest, sum(part**2 for part in parts))
    return np.asarray(np.sqrt(nearest))


def _activation(log: Recording) -> Vector:
    return np.asarray(np.exp(-0.5 * _node_distance(log) ** 2))


def _v_dot_bound(log: Recording) -> Vector:
    part = np.searchsorted(log["window_start"], log["time"], side="right") - 1
    return np.asarray(-2.0 * log["V_lambda"][part] * log["V"] + log["V_Delta"][part])


def has(log: Recording, name: str) -> bool:
    """Whether the log has the signal, or what it takes to compute it."""
    if name in log:
        return True
    return name in DERIVED and all(part in log for part in DERIVED[name].needs)


def signal(log: Recording, name: str) -> Vector:
    """A signal as logged, else computed; KeyError where there is neither."""
    return log[name] if name in log else DERIVED[name].compute(log)


def about(log: Recording, name: str) -> Signal:
    """What a signal that the log has, or gives, is."""
    return log.about[name] if name in log else DERIVED[name].signal


def _difference(signal: Signal, minuend: str, subtrahend: str) -> Derived:
    return Derived(signal, (minuend, subtrahend), lambda log: log[minuend] - log[subtrahend])


def _norm(signal: Signal, weights: str) -> Derived:
    return Derived(signal, (weights,), lambda log: np.linalg.norm(log[weights], axis=1))


X_E = Signal("x_e", "m", "target ahead of the vessel, north (18); derived, not logged")
Y_E = Signal("y_e", "m", "target ahead of the vessel, east (18); derived, not logged")
Y_U = Signal("y_u", "m/s", "error of the surge filter, beta_u - alpha_u")
Y_R = Signal("y_r", "rad/s", "error of the yaw filter, beta_r - alpha_r")
W_NORM_U = Signal("W_norm_u", "m/s2", "norm of the surge network weights", r"|\hat W_u|")
W_NORM_R = Signal("W_norm_r", "rad/s2", "norm of the yaw network weights", r"|\hat W_r|")
V_DOT_BOUND = Signal(
    "V_dot_bound", "1/s", "what V_dot should stay below (49), corrected; derived, not logged",
    r"-2\lambda V+\Delta",
)  # fmt: skip
NODE_DISTANCE = Signal(
    "node_distance", "1", "distance of (u, v, r) to the nearest network centre, in widths", "d"
)
ACTIVATION = Signal("activation", "1", "largest output of a network node (14)", r"\max\Phi")
NETWORK = ("rbf_center", "rbf_width", "u", "v", "r")
_ROWS = (
    _difference(X_E, "x_d", "x"),
    _difference(Y_E, "y_d", "y"),
    _difference(Y_U, "beta_u", "alpha_u"),
    _difference(Y_R, "beta_r", "alpha_r"),
    _norm(W_NORM_U, "W_hat_u"),
    _norm(W_NORM_R, "W_hat_r"),
    Derived(V_DOT_BOUND, ("V_dot", "V_Delta"), _v_dot_bound),
    Derived(NODE_DISTANCE, NETWORK, _node_distance),
    Derived(ACTIVATION, NETWORK, _activation),
)
DERIVED: dict[str, Derived] = {row.signal.name: row for row in _ROWS}
