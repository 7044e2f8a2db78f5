"""The Lyapunov function (46) of the adaptive laws along a run, and its rate."""

from __future__ import annotations

import numpy as np

from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import cosine_and_sine, total
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.running.replay import Replayed
from podusv_cli.theory.bounds import Pair
from podusv_cli.theory.ideal_weights import IdealWeights
from podusv_cli.theory.rates import Errors

V = Signal("V", "1", "Lyapunov function (46), the sum of its ten terms")
V_DOT = Signal("V_dot", "1/s", "rate of V along the closed loop, by the chain rule", r"\dot V")
TERMS = (
    Signal("V_z_e", "m2", "z_e^2/2, term of V; z_e less the standoff", "V_{z_e}"),
    Signal("V_psi_e", "rad2", "psi_e^2/2, term of V", r"V_{\psi_e}"),
    Signal("V_u_e", "J", "m11 u_e^2/2, term of V", "V_{u_e}"),
    Signal("V_r_e", "J", "m33 r_e^2/2, term of V", "V_{r_e}"),
    Signal("V_y_u", "m2/s2", "y_u^2/2, term of V", "V_{y_u}"),
    Signal("V_y_r", "rad2/s2", "y_r^2/2, term of V", "V_{y_r}"),
    Signal("V_W_u", "J", "|W_hat_u - W_star_u|^2/(2 Gamma_u), term of V", "V_{W_u}"),
    Signal("V_W_r", "J", "|W_hat_r - W_star_r|^2/(2 Gamma_r), term of V", "V_{W_r}"),
    Signal("V_b_u", "J", "(b_hat_u - b_u max)^2/(2 gamma_u), term of V", "V_{b_u}"),
    Signal("V_b_r", "J", "(b_hat_r - b_r max)^2/(2 gamma_r), term of V", "V_{b_r}"),
)


def _dot(a: Vector, b: Vector) -> Vector:
    """The products a . b at every row (rows,) of arrays (rows, n)."""
    return total((a * b).T)


def norms(weights: Vector) -> Vector:
    """Euclidean norm of the weights, shape (rows, nodes), at every row."""
    return np.sqrt(_dot(weights, weights))


def lyapunov(
    loop: ClosedLoop,
    law: PolarBackstepping,
    log: Recording,
    now: Replayed,
    e: Errors,
    ideal: IdealWeights,
    b: Pair,
) -> dict[str, Vector]:
    """V (46), its terms, and V' by the chain rule, named as in the log; each of shape (rows,).

    Over the rows of `log`, with the loop's rates there (`now`) and the errors `e`. The errors of
    the estimates are against the ideal weights and the true bounds `b`. An estimate with adaptation
    gain 0 has no term in V.
    """
    m11, m33, rates = loop.vessel.m11, loop.vessel.m33, now.rates
    b_u, b_r = log["b_hat_u"] - b.u, log["b_hat_r"] - b.r
    W_u, W_r = log["W_hat_u"] - ideal.W_u, log["W_hat_r"] - ideal.W_r
    parts = {
        "V_z_e": (1.0, e.z_e**2, e.z_e * e.z_e_dot),
        "V_psi_e": (1.0, e.psi_e**2, e.psi_e * e.psi_e_dot),
        "V_u_e": (m11, e.u_e**2, e.u_e * e.u_e_dot),
        "V_r_e": (m33, e.r_e**2, e.r_e * e.r_e_dot),
        "V_y_u": (1.0, e.y_u**2, e.y_u * e.y_u_dot),
        "V_y_r": (1.0, e.y_r**2, e.y_r * e.y_r_dot),
        "V_W_u": (_inverse(law.Gamma_u), _dot(W_u, W_u), _dot(W_u, rates["W_hat_u"])),
        "V_W_r": (_inverse(law.Gamma_r), _dot(W_r, W_r), _dot(W_r, rates["W_hat_r"])),
        "V_b_u": (_inverse(law.gamma_u), b_u**2, b_u * rates["b_hat_u"]),
        "V_b_r": (_inverse(law.gamma_r), b_r**2, b_r * rates["b_hat_r"]),
    }
    terms = {name: 0.5 * weight * square for name, (weight, square, _) in parts.items()}
    rate = sum(weight * product for weight, _, product in parts.values())
    return {"V": np.asarray(sum(terms.values())), "V_dot": np.asarray(rate), **terms}


def _inverse(gain: float) -> float:
    """1 over an adaptation gain; 0 for a gain of 0, whose estimate has no term in V."""
    return 1.0 / gain if gain else 0.0


def remainders(
    loop: ClosedLoop, law: PolarBackstepping, log: Recording, now: Replayed, e: Errors
) -> tuple[Vector, Vector]:
    """The remainders rho_u [N] and rho_r [N m] in the error equations of u_e and r_e:

    m11 u_e' = -k_ue u_e - m11 What_u . Phi - b_hat_u phi(u_e) + b_u + s z_e cos psi_e + rho_u,
    and likewise for yaw. rho_u is m11 f_u for the nominal vessel without limits; saturation, wrong
    nominal inertia and errors of the law's derivatives add to it. Both (rows,), over the rows of
    `log`, with the loop's rates there (`now`) and the errors `e`.
    """
    s, m, nominal = now.signals, loop.vessel, loop.nominal
    sign = 1.0 if law.coupling == "corrected" else -1.0
    gain_u = law.k_ue + log["b_hat_u"] / (4.0 * law.partial)
    gain_r = law.k_re + log["b_hat_r"] / (4.0 * law.partial)
    known_u = (
        s["b_u"]
        + sign * e.z_e * cosine_and_sine(e.psi_e)[0]
        - gain_u * e.u_e
        - nominal.m11 * s["f_hat_u"]
    )
    known_r = s["b_r"] + sign * e.psi_e - gain_r * e.r_e - nominal.m33 * s["f_hat_r"]
    return m.m11 * e.u_e_dot - known_u, m.m33 * e.r_e_dot - known_r
