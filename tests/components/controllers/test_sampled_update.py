"""Sampled control whose memory takes a sample before the demand is formed."""

import numpy as np
import pytest
from conftest import GENTLE, SMOOTH_START, corrected
from scipy.integrate import solve_ivp

from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.findings.stability import loops, sampled_growth
from podusv_cli.scenario.load import load_text

TEXT = """
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: ideal}
controller: {kind: pid, K_Iu: 10.0}
control: {period: 0.1, update: %s}
simulation: {duration: 1.0, step: 0.01}
"""


def log(update):
    scenario = load_text(TEXT % update, "a.yaml").scenario
    return simulate(scenario.closed_loop(), scenario.time_grid())


def test_the_demand_has_the_integral_up_to_its_own_sample():
    """PID's surge integral at a sample: with the error of this sample, or of the one before."""
    for update in ("after", "before"):
        run = log(update)
        integral, error = run["integral_u"], run["u_e"]
        samples = slice(0, None, 10)
        taken = error[samples][1:] if update == "before" else error[samples][:-1]
        assert np.diff(integral[samples]) == pytest.approx(-0.1 * taken, rel=1e-12)
        if update == "before":  # it stands still in between
            assert np.ptp(integral[10:20]) == 0.0


def test_the_memory_takes_a_sample_by_a_method_of_the_fourth_order():
    """Over the period that ends, beta' = (A_u + |alpha|) (alpha - beta) with the sample's alpha."""
    loop, period = corrected(controller=GENTLE, start=SMOOTH_START), 0.4

    def off(count):
        grid = TimeGrid(period / count, count, hold_every=count, update_first=True)
        run = simulate(loop, grid)
        alpha, beta = run["alpha_u"][-1], run["beta_u"]
        fading = np.exp(-(GENTLE.A_u + abs(alpha)) * period)
        return beta[-1] - (alpha + (beta[0] - alpha) * fading)

    assert off(16) / off(32) == pytest.approx(2.0**4, rel=0.1)


def test_the_predicted_growth_converges_to_that_of_the_loop_integrated_by_hand():
    scenario = load_text(TEXT % "before", "a.yaml").scenario
    loop, T = loops(scenario, np.array([0.5, 0.0, 0.0]))[0], 0.3

    def moved(rates, start):
        return solve_ivp(rates, (0.0, T), start, rtol=1e-12, atol=1e-14).y[:, -1]

    def period(e, m):
        """m' = F (e_held, m) first, then e' = -d e + g . (e_held, m)."""
        m = moved(lambda t, y: loop.memory @ [e, *y], m)
        c = loop.feedback @ [e, *m]
        return [*moved(lambda t, y: -loop.damping * y + c, [e]), *m]

    size = len(loop.feedback)
    through = np.array([period(unit[0], unit[1:]) for unit in np.eye(size)]).T
    growth = np.abs(np.linalg.eigvals(through)).max()
    coarse, fine = (sampled_growth(loop, T / n, n, update_first=True) - growth for n in (16, 32))
    assert coarse / fine == pytest.approx(2.0**4, rel=0.1)
