"""Every signal that podusv logs: one table for logs, metrics, axes and documentation.

Symbols are LaTeX as matplotlib reads it. `axes` names the dimensions after `time`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Signal:
    """A logged quantity; `wrapped` is an angle that jumps by 2 pi and means the same."""

    name: str
    symbol: str
    unit: str
    meaning: str
    axes: tuple[str, ...] = ()
    wrapped: bool = False


# fmt: off
_ROWS = (
    Signal("time", "t", "s", "time since the start of the run"),
    Signal("x", "x", "m", "vessel position, north"),
    Signal("y", "y", "m", "vessel position, east"),
    Signal("psi", r"\psi", "rad", "heading, from north towards east, not wrapped"),
    Signal("u", "u", "m/s", "surge velocity"),
    Signal("v", "v", "m/s", "sway velocity"),
    Signal("r", "r", "rad/s", "yaw rate"),
    Signal("x_d", "x_d", "m", "target position, north"),
    Signal("y_d", "y_d", "m", "target position, east"),
    Signal("x_e", "x_e", "m", "target ahead of the vessel, north (18); derived, not logged"),
    Signal("y_e", "y_e", "m", "target ahead of the vessel, east (18); derived, not logged"),
    Signal("z_e", "z_e", "m", "distance to the target (18)"),
    Signal(
        "psi_d", r"\psi_d", "rad", "direction of the target (19), in (-pi, pi]", wrapped=True
    ),
    Signal(
        "psi_e", r"\psi_e", "rad", "heading error that the law acts on, after folding", wrapped=True
    ),
    Signal("alpha_u", r"\alpha_u", "m/s", "virtual surge velocity (21)"),
    Signal("alpha_r", r"\alpha_r", "rad/s", "virtual yaw rate (30)"),
    Signal("beta_u", r"\beta_u", "m/s", "filtered virtual surge velocity (22)"),
    Signal("beta_r", r"\beta_r", "rad/s", "filtered virtual yaw rate (31)"),
    Signal("y_u", "y_u", "m/s", "error of the surge filter, beta_u - alpha_u"),
    Signal("y_r", "y_r", "rad/s", "error of the yaw filter, beta_r - alpha_r"),
    Signal("u_e", "u_e", "m/s", "surge velocity error (23)"),
    Signal("r_e", "r_e", "rad/s", "yaw rate error (32)"),
    Signal("tau_u_cmd", r"\tau_{u,\mathrm{cmd}}", "N", "surge force that the law asked for"),
    Signal("tau_r_cmd", r"\tau_{r,\mathrm{cmd}}", "N m", "yaw moment that the law asked for"),
    Signal("tau_u", r"\tau_u", "N", "surge force on the hull"),
    Signal("tau_v", r"\tau_v", "N", "sway force on the hull"),
    Signal("tau_r", r"\tau_r", "N m", "yaw moment on the hull"),
    Signal("b_u", "b_u", "N", "disturbance force in surge"),
    Signal("b_v", "b_v", "N", "disturbance force in sway"),
    Signal("b_r", "b_r", "N m", "disturbance moment in yaw"),
    Signal("b_hat_u", r"\hat b_u", "N", "estimated bound of b_u (28)"),
    Signal("b_hat_r", r"\hat b_r", "N m", "estimated bound of b_r (37)"),
    Signal("W_hat_u", r"\hat W_u", "m/s2", "surge network weights (27)", ("node",)),
    Signal("W_hat_r", r"\hat W_r", "rad/s2", "yaw network weights (36)", ("node",)),
    Signal(
        "W_norm_u", r"|\hat W_u|", "m/s2", "norm of the surge network weights"
    ),
    Signal(
        "W_norm_r", r"|\hat W_r|", "rad/s2", "norm of the yaw network weights"
    ),
    Signal(
        "activation", r"\max\Phi", "1", "largest output of a network node (14)"
    ),
    Signal(
        "node_distance", "d", "1",
        "distance of (u, v, r) to the nearest network centre, in widths",
    ),
    Signal("f_hat_u", r"\hat f_u", "m/s2", "network's estimate of f_u (25)"),
    Signal("f_hat_r", r"\hat f_r", "rad/s2", "network's estimate of f_r (34)"),
    Signal(
        "psi_d_held", r"\psi_d^-", "rad", "target direction at the law's last sample", wrapped=True
    ),
    Signal("psi_d_rate_held", r"\dot\psi_d^-", "rad/s", "difference quotient held by the law"),
    Signal("integral_u", r"\int u_p", "m", "integral of the surge velocity error (PID)"),
    Signal("integral_r", r"\int r_p", "rad", "integral of the yaw rate error (PID)"),
    Signal("lag_u", "u_{p,f}", "m/s", "lagged surge velocity error (PID derivative)"),
    Signal("lag_r", "r_{p,f}", "rad/s", "lagged yaw rate error (PID derivative)"),
    Signal("xi_u", r"\xi_u", "m/s", "shortfall of surge force as a velocity (anti-windup)"),
    Signal("xi_r", r"\xi_r", "rad/s", "shortfall of yaw moment as a yaw rate (anti-windup)"),
    Signal("saturated", "sat", "1", "1 while the actuator limits what the law asked for"),
    Signal("V", "V", "1", "Lyapunov function (46), the sum of its ten terms"),
    Signal("V_dot", r"\dot V", "1/s", "rate of V along the closed loop, by the chain rule"),
    Signal("V_z_e", "V_{z_e}", "m2", "z_e^2/2, term of V; z_e less the standoff"),
    Signal("V_psi_e", r"V_{\psi_e}", "rad2", "psi_e^2/2, term of V"),
    Signal("V_u_e", "V_{u_e}", "J", "m11 u_e^2/2, term of V"),
    Signal("V_r_e", "V_{r_e}", "J", "m33 r_e^2/2, term of V"),
    Signal("V_y_u", "V_{y_u}", "m2/s2", "y_u^2/2, term of V"),
    Signal("V_y_r", "V_{y_r}", "rad2/s2", "y_r^2/2, term of V"),
    Signal("V_W_u", "V_{W_u}", "J", "|W_hat_u - W_star_u|^2/(2 Gamma_u), term of V"),
    Signal("V_W_r", "V_{W_r}", "J", "|W_hat_r - W_star_r|^2/(2 Gamma_r), term of V"),
    Signal("V_b_u", "V_{b_u}", "J", "(b_hat_u - b_u max)^2/(2 gamma_u), term of V"),
    Signal("V_b_r", "V_{b_r}", "J", "(b_hat_r - b_r max)^2/(2 gamma_r), term of V"),
    Signal(
        "V_dot_bound", r"-2\lambda V+\Delta", "1/s",
        "what V_dot should stay below (49), corrected; derived, not logged",
    ),
    Signal("W_star_u", "W_u^*", "m/s2", "ideal weights of the surge network, fitted to the run"),
    Signal("W_star_r", "W_r^*", "rad/s2", "ideal weights of the yaw network, fitted to the run"),
    Signal("window_start", "t_0", "s", "start of the part of the run whose extremes enter V_Delta"),
    Signal("V_lambda", r"\lambda", "1/s", "rate lambda of (49), corrected"),
    Signal("V_Delta", r"\Delta", "1/s", "Delta of (49), corrected, from extremes of that part"),
    Signal("V_bound", r"\Delta/2\lambda", "1", "ultimate bound of V, corrected"),
    Signal("v_bound", r"|v|_{\max}", "m/s", "bound of the sway speed (51), with all damping"),
    Signal("n", "n", "1/s", "propeller speed", ("pod",)),
    Signal("n_part", "n", "1", "propeller speed, in parts of full speed", ("pod",)),
    Signal("delta", r"\delta", "rad", "propulsion angle", ("pod",)),
    Signal("n_cmd", r"n_\mathrm{cmd}", "1/s", "propeller speed that was asked for", ("pod",)),
    Signal(
        "n_part_cmd",
        r"n_\mathrm{cmd}",
        "1",
        "propeller speed that was asked for, in parts of full speed",
        ("pod",),
    ),
    Signal(
        "delta_cmd", r"\delta_\mathrm{cmd}", "rad", "propulsion angle that was asked for", ("pod",)
    ),
    Signal("thrust", "T", "N", "thrust of the propeller (8)", ("pod",)),
    Signal("power", "P", "W", "power that the propeller takes", ("pod",)),
    Signal("speed_limited", "n lim", "1", "1 while a propeller is asked for its largest speed"),
    Signal("angle_limited", r"\delta lim", "1", "1 while a pod is asked for its largest angle"),
    Signal("rate_limited", "rate lim", "1", "1 while a speed or an angle changes at its limit"),
    Signal("rbf_center", "c", "1", "network centres in (u, v, r) [m/s, m/s, rad/s]"),
    Signal("rbf_width", r"\sigma", "1", "Gaussian widths in (u, v, r) [m/s, m/s, rad/s]"),
)
# fmt: on

SIGNALS: dict[str, Signal] = {row.name: row for row in _ROWS}
