"""Sampled control whose memory takes a sample before the demand is formed."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from podusv_cli.engine.simulate import simulate
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


@pytest.mark.parametrize("count", [3, 30])
def test_the_predicted_growth_is_that_of_the_loop_integrated_by_hand(count):
    scenario = load_text(TEXT % "before", "a.yaml").scenario
    loop, h = loops(scenario, np.array([0.5, 0.0, 0.0]))[0], 0.01

    def period(e, m):
        """m' = F (e_held, m) first, then e' = -d e + g . (e_held, m)."""
        taken = solve_ivp(
            lambda t, y: loop.memory @ [e, *y], (0.0, count * h), m, rtol=1e-11, atol=1e-14
        )
        m = taken.y[:, -1]
        c = loop.feedback @ [e, *m]
        moved = solve_ivp(
            lambda t, y: -loop.damping * y + c, (0.0, count * h), [e], rtol=1e-11, atol=1e-14
        )
        return [*moved.y[:, -1], *m]

    size = len(loop.feedback)
    through = np.array([period(one[0], one[1:]) for one in np.eye(size)]).T
    growth = np.abs(np.linalg.eigvals(through)).max()
    assert sampled_growth(loop, h, count, update_first=True) == pytest.approx(growth, rel=1e-4)
