"""The same closed loop as one writes it in Python without podusv: classes, numpy, scipy.

The law is adaptive_neural with the scenario's options and a grid of nodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.step.grid import TimeGrid

Array = npt.NDArray[np.float64]


class Ship:
    """Kinematics and kinetics in three degrees of freedom."""

    def __init__(self, p: Any) -> None:
        """For a vessel's parameters."""
        self.p = p
        self.inverse_inertia = np.linalg.inv([[p.m11, 0, 0], [0, p.m22, p.m23], [0, p.m32, p.m33]])

    def rates(self, eta: Array, nu: Array, load: Array) -> Array:
        """Rates of (x, y, psi, u, v, r)."""
        p, (u, v, r) = self.p, nu
        c, s = math.cos(eta[2]), math.sin(eta[2])
        V, R = abs(v), abs(r)
        momentum = p.m22 * v + p.m23 * r
        coriolis = np.array([-momentum * r, p.m11 * u * r, momentum * u - p.m11 * u * v])
        damping = np.array(
            [
                (p.X_u + p.X_uu * abs(u) + p.X_uuu * u * u) * u,
                (p.Y_v + p.Y_vv * V + p.Y_rv * R) * v + (p.Y_r + p.Y_vr * V + p.Y_rr * R) * r,
                (p.N_v + p.N_vv * V + p.N_rv * R) * v + (p.N_r + p.N_vr * V + p.N_rr * R) * r,
            ]
        )
        acceleration = self.inverse_inertia @ (load - coriolis + damping)
        return np.concatenate([[u * c - v * s, u * s + v * c, r], acceleration])


class Law:
    """Adaptive neural backstepping; memory is b_hat_u, b_hat_r, W_u, W_r, beta_u, beta_r."""

    def __init__(self, law: AdaptiveNeural, vessel: Any) -> None:
        """For a law's gains and what it knows of the vessel."""
        self.k, self.p = law, vessel
        self.centers, self.widths = law.network.center_array(), law.network.width_array()

    def track(self, s: Array, target: Array) -> tuple[float, float, float, float]:
        """z_e, psi_e, alpha_u, alpha_r, folded jointly."""
        (x_e, y_e), (u, v) = target[:2] - s[:2], s[3:5]
        distance, psi_d = math.hypot(x_e, y_e), math.atan2(y_e, x_e)
        psi_e = math.remainder(psi_d - s[2], 2 * math.pi)
        P = target[2] * math.cos(psi_d) + target[3] * math.sin(psi_d)
        Q = -target[2] * math.sin(psi_d) + target[3] * math.cos(psi_d)
        w = (Q + u * math.sin(psi_e) - v * math.cos(psi_e)) / distance
        z_e = distance - self.k.standoff
        if abs(psi_e) >= math.pi / 2:
            psi_e -= math.copysign(math.pi, psi_e)
            z_e, P = -z_e, -P
        alpha_u = (self.k.k_ze * z_e + P - v * math.sin(psi_e)) / math.cos(psi_e)
        return z_e, psi_e, alpha_u, w + self.k.k_psie * psi_e

    def __call__(self, s: Array, memory: Array, target: Array) -> tuple[Array, Array]:
        """The demand (tau_u, tau_r) and the rates of the memory."""
        k, p, n = self.k, self.p, len(self.centers)
        b_hat, W, beta = memory[:2], memory[2 : 2 + 2 * n].reshape(2, n), memory[-2:]
        gain, inertia = np.array([k.k_ue, k.k_re]), np.array([p.m11, p.m33])
        Gamma, sigma = np.array([k.Gamma_u, k.Gamma_r]), np.array([k.sigma_u, k.sigma_r])
        gamma, leakage = np.array([k.gamma_u, k.gamma_r]), np.array([k.sigma_bu, k.sigma_br])
        z_e, psi_e, alpha_u, alpha_r = self.track(s, target)
        alpha, A = np.array([alpha_u, alpha_r]), np.array([k.A_u, k.A_r])
        phi = np.exp(-0.5 * np.sum(((s[3:6] - self.centers) / self.widths) ** 2, axis=1))
        beta_rate = (A + np.abs(alpha)) * (alpha - beta)
        error = s[[3, 5]] - beta
        lemma = error / (4 * k.partial)
        cross = np.array([z_e * math.cos(psi_e), psi_e])
        tau = -gain * error - inertia * (W @ phi) - b_hat * lemma + inertia * beta_rate + cross
        W_rate = Gamma[:, None] * (np.outer(error * inertia, phi) - sigma[:, None] * W)
        b_hat_rate = gamma * (error * lemma - leakage * b_hat)
        return tau, np.concatenate([b_hat_rate, W_rate.ravel(), beta_rate])


class Loop:
    """The right-hand side for any integrator: s is the ship's state, then the law's memory."""

    def __init__(self, loop: ClosedLoop) -> None:
        """For the parts of a closed loop with the law adaptive_neural."""
        if not isinstance(loop.controller, AdaptiveNeural):
            raise TypeError(f"{loop.controller} is not written out here")
        self.parts: Any = loop
        self.ship, self.law = Ship(loop.vessel), Law(loop.controller, loop.nominal)
        held = 2  # numbers of podusv's memory that this law does not have
        self.start = np.concatenate([loop.start, Plan(loop, TimeGrid(1.0, 1)).first_memory[held:]])

    def target(self, t: float) -> Array:
        """Position and velocity on the straight part of the path."""
        return np.array([self.parts.path.speed * t, 0.0, self.parts.path.speed, 0.0])

    def load(self, t: float) -> Array:
        """(52)."""
        sea = self.parts.disturbance
        return np.array(
            [
                a.mean + a.sin * math.sin(a.sin_rate * t) + a.cos * math.cos(a.cos_rate * t)
                for a in (sea.b_u, sea.b_v, sea.b_r)
            ]
        )

    def __call__(self, t: float, s: Array) -> Array:
        """Rates of s."""
        demand, memory_rate = self.law(s[:6], s[6:], self.target(t))
        limits = np.array([self.parts.actuator.surge_limit, self.parts.actuator.yaw_limit])
        tau_u, tau_r = np.clip(demand, -limits, limits)
        load = np.array([tau_u, 0.0, tau_r]) + self.load(t)
        return np.concatenate([self.ship.rates(s[:3], s[3:6], load), memory_rate])


def rk4(rates: Callable[[float, Array], Array], s: Array, h: float, steps: int) -> Array:
    """States at all instants, shape (steps + 1, states)."""
    log = [s]
    for k in range(steps):
        t = k * h
        k1 = rates(t, s)
        k2 = rates(t + h / 2, s + h / 2 * k1)
        k3 = rates(t + h / 2, s + h / 2 * k2)
        k4 = rates(t + h, s + h * k3)
        s = s + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        log.append(s)
    return np.array(log)
