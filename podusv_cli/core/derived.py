"""Signals that follow from logged ones, where the log does not have them itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording


@dataclass(frozen=True)
class Derived:
    """A signal computed from logged ones."""

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


DERIVED: dict[str, Derived] = {
    "x_e": Derived(("x_d", "x"), lambda log: log["x_d"] - log["x"]),
    "y_e": Derived(("y_d", "y"), lambda log: log["y_d"] - log["y"]),
    "y_u": Derived(("beta_u", "alpha_u"), lambda log: log["beta_u"] - log["alpha_u"]),
    "y_r": Derived(("beta_r", "alpha_r"), lambda log: log["beta_r"] - log["alpha_r"]),
    "W_norm_u": Derived(("W_hat_u",), lambda log: np.linalg.norm(log["W_hat_u"], axis=1)),
    "W_norm_r": Derived(("W_hat_r",), lambda log: np.linalg.norm(log["W_hat_r"], axis=1)),
    "V_dot_bound": Derived(("V_dot", "V_Delta"), _v_dot_bound),
    "node_distance": Derived(("rbf_center", "rbf_width", "u", "v", "r"), _node_distance),
    "activation": Derived(("rbf_center", "rbf_width", "u", "v", "r"), _activation),
}
