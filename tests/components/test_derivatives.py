"""The derivatives of the virtual controls in the full law, (40) and (44), against sympy."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, PAPER, Situation, situations
from mpmath import mp

from podusv_cli.components.controllers.full_backstepping import (
    FullBackstepping,
    alpha_r_rate,
    alpha_u_rate,
)
from podusv_cli.components.controllers.tracking import track
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import Vector, bundle

GAINS = {"k_ze": 0.3, "k_psie": 0.7, "standoff": 0.5}
STATE = sp.symbols("x y psi u v r x_d y_d x_d_dot y_d_dot x_d_ddot y_d_ddot")
TAU_U, SIDE, HALF_TURN = sp.symbols("tau_u side half_turn")


def flow(p: Vessel) -> list[Any]:
    """Rates of STATE[:10] by (3) and (12), with the nonlinear damping of that vessel."""
    _, _, psi, u, v, r, _, _, x_d_dot, y_d_dot, x_d_ddot, y_d_ddot = STATE
    drag_u = (p.X_u + p.X_uu * sp.Abs(u) + p.X_uuu * u**2) * u
    drag_v = (p.Y_v + p.Y_vv * sp.Abs(v)) * v
    drag_r = (p.N_r + p.N_rr * sp.Abs(r)) * r
    u_dot = (p.m22 * v * r + drag_u + TAU_U) / p.m11
    v_dot = (-p.m11 * u * r + drag_v) / p.m22
    r_dot = ((p.m11 - p.m22) * u * v + drag_r) / p.m33
    own = [u * sp.cos(psi) - v * sp.sin(psi), u * sp.sin(psi) + v * sp.cos(psi), r]
    return [*own, u_dot, v_dot, r_dot, x_d_dot, y_d_dot, x_d_ddot, y_d_ddot]


@cache
def reference(preset: str) -> Callable[..., tuple[Any, Any]]:
    """Rates of alpha_u (21) and alpha_r (30) along that flow, with 40 digits."""
    rates = flow({"paper": PAPER, "paper_nonlinear": NONLINEAR}[preset])

    def along(quantity: Any) -> Any:
        return sum(sp.diff(quantity, s) * rate for s, rate in zip(STATE, rates, strict=False))

    x, y, psi, _, v, _, x_d, y_d, x_d_dot, y_d_dot, _, _ = STATE
    psi_d = sp.atan2(y_d - y, x_d - x)
    psi_e = psi_d - psi + HALF_TURN
    z_e = SIDE * (sp.sqrt((x_d - x) ** 2 + (y_d - y) ** 2) - GAINS["standoff"])
    forward = SIDE * (x_d_dot * sp.cos(psi_d) + y_d_dot * sp.sin(psi_d))
    alpha_u = (GAINS["k_ze"] * z_e + forward - v * sp.sin(psi_e)) / sp.cos(psi_e)
    alpha_r = along(psi_d) + GAINS["k_psie"] * psi_e
    arguments = (*STATE, TAU_U, SIDE, HALF_TURN)
    return sp.lambdify(arguments, [along(alpha_u), along(alpha_r)], "mpmath")  # type: ignore


def both(law: FullBackstepping, p: Vessel, at: Situation, tau_u: float) -> tuple[Any, Any, float]:
    """The kernels' rates, sympy's, and the half turn of the folding."""
    k = bundle(law.constants_with(p))
    e = track(at.x, at.memory, at.target, k)
    found = (alpha_u_rate(e, at.x, at.target, k), alpha_r_rate(e, at.x, at.target, k, tau_u))
    side = -1 if law.fold == "joint" and e.half_turn else 1
    with mp.workdps(40):
        turn = mp.pi * round(e.half_turn / np.pi)
        numbers = (*at.x, *at.target, tau_u, side, turn)
        expected = [float(rate) for rate in reference(p.preset)(*numbers)]
    return found, expected, e.half_turn


@pytest.mark.parametrize("fold", ["none", "joint", "printed"])
@pytest.mark.parametrize("p", [PAPER, NONLINEAR], ids=["paper", "paper_nonlinear"])
def test_rates_are_those_along_the_nominal_flow(p, fold):
    law = FullBackstepping(fold=fold, **GAINS)
    turned = 0
    for at in situations(law, 60):
        found, expected, half_turn = both(law, p, at, tau_u=3.7)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
        turned += half_turn != 0.0
    assert turned == 0 if fold == "none" else 15 < turned < 45


def test_the_yaw_rate_feels_the_surge_force_that_was_just_asked_for():
    law = FullBackstepping(**GAINS)
    at = next(situations(law, 1))
    low, high = (both(law, NONLINEAR, at, tau_u) for tau_u in (0.0, 50.0))
    assert low[0][0] == high[0][0]
    assert low[0][1] != high[0][1]
    np.testing.assert_allclose(high[0], high[1], rtol=1e-12)


def candidate(law: FullBackstepping, x: Vector, target: Vector) -> float:
    """The part of (46) that does not adapt, with beta = alpha."""
    e = track(x, np.zeros(60), target, bundle(law.constants_with(NONLINEAR)))
    u_e, r_e = x[3] - e.alpha_u, x[5] - e.alpha_r
    kinetic = NONLINEAR.m11 * u_e**2 + NONLINEAR.m33 * r_e**2
    return float(0.5 * (e.z_e**2 + e.psi_e**2 + kinetic))
