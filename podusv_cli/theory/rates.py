"""Rates of tracking errors, virtual controls and filters along a run, by the chain rule."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import cosine_and_sine
from podusv_cli.core.recording import Recording
from podusv_cli.engine.running.replay import Replayed


@dataclass(frozen=True)
class SightLine:
    """The line of sight to the target at every row; `turn` is -1 while psi_e is folded, else 1."""

    turn: Vector
    side: Vector  # -1 where folding also reversed the line of sight (`fold: joint`)
    distance: Vector  # [m]
    distance_rate: Vector
    w: Vector  # psi_d' [rad/s]
    w_rate: Vector
    P: Vector  # target's velocity along psi_d before folding [m/s]
    P_rate: Vector


@dataclass(frozen=True)
class Errors:
    """Errors of the law and their rates along the run, each of shape (rows,)."""

    z_e: Vector
    psi_e: Vector
    u_e: Vector
    r_e: Vector
    y_u: Vector
    y_r: Vector
    z_e_dot: Vector
    psi_e_dot: Vector
    u_e_dot: Vector
    r_e_dot: Vector
    y_u_dot: Vector
    y_r_dot: Vector
    alpha_u_dot: Vector
    alpha_r_dot: Vector
    turn: Vector


def error_rates(log: Recording, now: Replayed, law: PolarBackstepping) -> Errors:
    """The errors of (18), (23), (32), (38), (42) and their rates at every row of a log.

    `now` has signals and rates of the loop there. Jumps at the samples of a held direction or
    difference are not in the rates.
    """
    signals, rates = now.signals, now.rates
    sight = _line_of_sight(log, now, law)
    psi_e, psi_e_dot = signals["psi_e"], sight.w - log["r"]
    z_e, z_e_dot = (sight.side * (sight.distance - law.standoff), sight.side * sight.distance_rate)
    alpha_u_dot = _alpha_u_rate(log, now, law, sight)
    # With another `rate` the law takes psi_d' for constant between samples
    alpha_r_dot = sight.w_rate * (law.rate == "analytic") + law.k_psie * psi_e_dot
    filtered = "beta_u" in rates
    beta_u_dot = rates["beta_u"] if filtered else alpha_u_dot
    beta_r_dot = rates["beta_r"] if filtered else alpha_r_dot
    nothing = np.zeros_like(psi_e)
    return Errors(
        z_e=z_e,
        psi_e=psi_e,
        u_e=signals["u_e"],
        r_e=signals["r_e"],
        y_u=log["beta_u"] - signals["alpha_u"] if filtered else nothing,
        y_r=log["beta_r"] - signals["alpha_r"] if filtered else nothing,
        z_e_dot=z_e_dot,
        psi_e_dot=psi_e_dot,
        u_e_dot=rates["u"] - beta_u_dot,
        r_e_dot=rates["r"] - beta_r_dot,
        y_u_dot=beta_u_dot - alpha_u_dot,
        y_r_dot=beta_r_dot - alpha_r_dot,
        alpha_u_dot=alpha_u_dot,
        alpha_r_dot=alpha_r_dot,
        turn=sight.turn,
    )


def _line_of_sight(log: Recording, now: Replayed, law: PolarBackstepping) -> SightLine:
    """The geometry of the line of sight and its rates, over the rows of a log (rows,).

    Where the law holds its direction, near the target, the line does not turn.
    """
    s, d, u, v = now.signals, now.rates, log["u"], log["v"]
    psi_e, psi_d, distance = s["psi_e"], s["psi_d"], s["z_e"]
    # psi_e is psi_d - psi, plus half a turn where it is folded: then this cosine is -1, else 1
    turn = np.where(cosine_and_sine(psi_e - psi_d + log["psi"])[0] < 0.0, -1.0, 1.0)
    cos_e, sin_e = (turn * part for part in cosine_and_sine(psi_e))
    x_e, y_e = s["x_d"] - log["x"], s["y_d"] - log["y"]
    x_e_dot, y_e_dot = s["x_d_dot"] - d["x"], s["y_d_dot"] - d["y"]
    distance_rate = (x_e * x_e_dot + y_e * y_e_dot) / distance
    P, Q = _along(psi_d, s["x_d_dot"], s["y_d_dot"])
    along, across = _along(psi_d, s["x_d_ddot"], s["y_d_ddot"])
    held = distance <= law.hold_below
    w = np.where(held, 0.0, (Q + u * sin_e - v * cos_e) / distance)
    spin = w - log["r"]
    bending = across - P * w + d["u"] * sin_e - d["v"] * cos_e + (u * cos_e + v * sin_e) * spin
    return SightLine(
        turn=turn,
        side=turn if law.fold == "joint" else np.ones_like(turn),
        distance=distance,
        distance_rate=distance_rate,
        w=w,
        w_rate=np.where(held, 0.0, (bending - w * distance_rate) / distance),
        P=P,
        P_rate=along + Q * w,
    )


def _along(psi_d: Vector, x: Vector, y: Vector) -> tuple[Vector, Vector]:
    """Components (rows,) of an earth-fixed vector (x, y) along and across the line of sight."""
    cos_d, sin_d = cosine_and_sine(psi_d)
    return x * cos_d + y * sin_d, y * cos_d - x * sin_d


def _alpha_u_rate(
    log: Recording, now: Replayed, law: PolarBackstepping, sight: SightLine
) -> Vector:
    """Rate of alpha_u (21), (rows,) [m/s2]; the paper's X_1 (40) with the true accelerations.

    Over the rows of `log`, with the loop's rates there (`now`) and the line of sight. By the chain
    rule through distance, target, sway and the angle psi_e, which turns at `spin`.
    """
    psi_e, alpha_u, v = now.signals["psi_e"], now.signals["alpha_u"], log["v"]
    (cos_e, sin_e), spin = cosine_and_sine(psi_e), sight.w - log["r"]
    approach = sight.side * (law.k_ze * sight.distance_rate + sight.P_rate)
    swing = (alpha_u * sin_e - v * cos_e) * spin
    return np.asarray((approach - now.rates["v"] * sin_e + swing) / cos_e)
