"""Signals that are not logged but follow from logged ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from podusv_cli.kernels import Vector
from podusv_cli.recording import Recording


@dataclass(frozen=True)
class Derived:
    """A signal computed from logged ones."""

    needs: tuple[str, ...]
    compute: Callable[[Recording], Vector]


def _activation(log: Recording) -> Vector:
    nu = np.column_stack([log["u"], log["v"], log["r"]])
    scaled = (nu[:, None, :] - log["rbf_center"]) / log["rbf_width"]
    return np.asarray(np.exp(-0.5 * np.sum(scaled**2, axis=2)).max(axis=1))


DERIVED: dict[str, Derived] = {
    "x_e": Derived(("x_d", "x"), lambda log: log["x_d"] - log["x"]),
    "y_e": Derived(("y_d", "y"), lambda log: log["y_d"] - log["y"]),
    "y_u": Derived(("beta_u", "alpha_u"), lambda log: log["beta_u"] - log["alpha_u"]),
    "y_r": Derived(("beta_r", "alpha_r"), lambda log: log["beta_r"] - log["alpha_r"]),
    "W_norm_u": Derived(("W_hat_u",), lambda log: np.linalg.norm(log["W_hat_u"], axis=1)),
    "W_norm_r": Derived(("W_hat_r",), lambda log: np.linalg.norm(log["W_hat_r"], axis=1)),
    "activation": Derived(("rbf_center", "rbf_width", "u", "v", "r"), _activation),
}
