"""The Lyapunov function (46) of the adaptive laws along a run, and its rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from podusv_cli.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.engine.replay import Replayed
from podusv_cli.engine.simulate import ClosedLoop
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


@dataclass(frozen=True)
class Estimates:
    """Squared errors of the estimates, and the product of each with its rate."""

    W_u: Vector
    W_r: Vector
    b_u: Vector
    b_r: Vector
    W_u_rate: Vector
    W_r_rate: Vector
    b_u_rate: Vector
    b_r_rate: Vector


def estimates(log: Recording, now: Replayed, ideal: IdealWeights, b: Pair) -> Estimates:
    """Errors of the estimated weights and bounds against the ideal weights and true bounds."""
    b_u, b_r = log["b_hat_u"] - b.u, log["b_hat_r"] - b.r
    W_u, W_r = log["W_hat_u"] - ideal.W_u, log["W_hat_r"] - ideal.W_r
    return Estimates(
        _dot(W_u, W_u), _dot(W_r, W_r), b_u**2, b_r**2,
        _dot(W_u, now.rates["W_hat_u"]), _dot(W_r, now.rates["W_hat_r"]),
        b_u * now.rates["b_hat_u"], b_r * now.rates["b_hat_r"],
    )  # fmt: skip


def _dot(a: Vector, b: Vector) -> Vector:
    return np.asarray(np.einsum("ij,ij->i", a, b))


def norms(weights: Vector) -> Vector:
    """Euclidean norm of the weights, shape (rows, nodes), at every row."""
    return np.sqrt(_dot(weights, weights))


def lyapunov(
    loop: ClosedLoop, law: PolarBackstepping, e: Errors, errors: Estimates
) -> dict[str, Vector]:
    """V (46), its terms, and V' by the chain rule, named as in the log; each of shape (rows,).

    An estimate with adaptation gain 0 has no term in V.
    """
    m11, m33 = loop.vessel.m11, loop.vessel.m33
    parts = {
        "V_z_e": (1.0, e.z_e**2, e.z_e * e.z_e_dot),
        "V_psi_e": (1.0, e.psi_e**2, e.psi_e * e.psi_e_dot),
        "V_u_e": (m11, e.u_e**2, e.u_e * e.u_e_dot),
        "V_r_e": (m33, e.r_e**2, e.r_e * e.r_e_dot),
        "V_y_u": (1.0, e.y_u**2, e.y_u * e.y_u_dot),
        "V_y_r": (1.0, e.y_r**2, e.y_r * e.y_r_dot),
        "V_W_u": (_inverse(law.Gamma_u), errors.W_u, errors.W_u_rate),
        "V_W_r": (_inverse(law.Gamma_r), errors.W_r, errors.W_r_rate),
        "V_b_u": (_inverse(law.gamma_u), errors.b_u, errors.b_u_rate),
        "V_b_r": (_inverse(law.gamma_r), errors.b_r, errors.b_r_rate),
    }
    terms = {name: 0.5 * weight * square for name, (weight, square, _) in parts.items()}
    rate = sum(weight * product for weight, _, product in parts.values())
    return {"V": np.asarray(sum(terms.values())), "V_dot": np.asarray(rate), **terms}


def _inverse(gain: float) -> float:
    return 1.0 / gain if gain else 0.0


def remainders(
    loop: ClosedLoop, law: PolarBackstepping, log: Recording, now: Replayed, e: Errors
) -> tuple[Vector, Vector]:
    """The remainders rho_u [N] and rho_r [N m] in the error equations of u_e and r_e:

    m11 u_e' = -k_ue u_e - m11 What_u . Phi - b_hat_u phi(u_e) + b_u + s z_e cos psi_e + rho_u,
    and likewise for yaw. rho_u is m11 f_u for the nominal vessel without limits; saturation, wrong
    nominal inertia and errors of the law's derivatives add to it.
    """
    s, m, nominal = now.signals, loop.vessel, loop.nominal
    sign = 1.0 if law.coupling == "corrected" else -1.0
    gain_u = law.k_ue + log["b_hat_u"] / (4.0 * law.partial)
    gain_r = law.k_re + log["b_hat_r"] / (4.0 * law.partial)
    known_u = (
        s["b_u"] + sign * e.z_e * np.cos(e.psi_e) - gain_u * e.u_e - nominal.m11 * s["f_hat_u"]
    )
    known_r = s["b_r"] + sign * e.psi_e - gain_r * e.r_e - nominal.m33 * s["f_hat_r"]
    return m.m11 * e.u_e_dot - known_u, m.m33 * e.r_e_dot - known_r
