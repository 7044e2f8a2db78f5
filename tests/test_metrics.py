"""Metrics against their definitions, computed the long way from a full log."""

import numpy as np
import pytest
from conftest import SMOOTH_START, corrected, example

from podusv_cli.actuators.pod import Pods
from podusv_cli.actuators.saturated import Saturated
from podusv_cli.controllers.backstepping import Backstepping
from podusv_cli.controllers.pid import Pid
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import simulate
from podusv_cli.metrics.cost import law_costs
from podusv_cli.metrics.table import METRICS
from podusv_cli.metrics.watching import observer, summarise


def gathered(loop, *, steps=4000, log_every=1, radius=2.0, steady_fraction=0.25, compiled=True):
    grid = TimeGrid(0.01, steps, log_every)
    seeing = observer(loop, grid, steady_fraction=steady_fraction, settling_radius=radius)
    recording = simulate(loop, grid, observer=seeing, compiled=compiled)
    return recording, summarise(recording.seen, grid.step)


@pytest.fixture(scope="module")
def limited():
    return gathered(corrected(actuator=Saturated()))


def test_metrics_follow_their_definitions(limited):
    log, got = limited
    t, z_e = log["time"], log["z_e"]
    steady = t >= 0.75 * t[-1]
    outside = t[z_e > 2.0]
    expected = {
        "iae": np.trapezoid(z_e, t),
        "ise": np.trapezoid(z_e**2, t),
        "itae": np.trapezoid(t * z_e, t),
        "rmse": np.sqrt(np.trapezoid(z_e**2, t) / t[-1]),
        "z_e_steady": np.trapezoid(z_e[steady], t[steady]) / (0.25 * t[-1]),
        "settling_time": outside[-1] + 0.01,
        "peak_tau_u": np.abs(log["tau_u_cmd"]).max(),
        "peak_tau_r": np.abs(log["tau_r_cmd"]).max(),
        "effort_u": np.trapezoid(log["tau_u"] ** 2, t),
        "effort_r": np.trapezoid(log["tau_r"] ** 2, t),
        "energy": np.trapezoid(
            np.abs(log["tau_u"] * log["u"]) + np.abs(log["tau_r"] * log["r"]), t
        ),
        "tv_tau_u": np.abs(np.diff(log["tau_u_cmd"][steady])).sum(),
        "tv_tau_r": np.abs(np.diff(log["tau_r_cmd"][steady])).sum(),
        "saturated_fraction": np.trapezoid(log["saturated"], t) / t[-1],
    }
    assert {name: got[name] for name in expected} == pytest.approx(expected, rel=1e-12)
    assert 0 < got["saturated_fraction"] < 1


def test_a_thinned_log_leaves_metrics_as_they_are(limited):
    _, thin = gathered(corrected(actuator=Saturated()), log_every=50)
    assert thin == limited[1]


def test_metrics_in_plain_python_agree():
    loop = corrected(start=SMOOTH_START)
    _, compiled = gathered(loop, steps=100)
    _, plain = gathered(loop, steps=100, compiled=False)
    assert plain == pytest.approx(compiled, rel=1e-9, nan_ok=True)


def test_settling_that_never_happens_is_no_number():
    _, got = gathered(corrected(), steps=200, radius=0.01)
    assert np.isnan(got["settling_time"])


def test_settled_from_the_start_is_zero():
    _, got = gathered(corrected(), steps=200, radius=100.0)
    assert got["settling_time"] == 0.0


def test_every_metric_is_computed_and_documented(limited):
    log, got = limited
    (cost,) = law_costs([(corrected(), log)])
    _, of_pods = gathered(corrected(actuator=example(Pods)), steps=10)
    assert set(METRICS) == set(got | cost | of_pods)
    assert set(of_pods) > set(got)
    assert all(metric.unit and metric.meaning for metric in METRICS.values())


def test_full_derivatives_cost_more_than_pid():
    """A replay that timed nothing would not tell the cheapest law from the dearest."""
    dear, cheap = corrected(controller=Backstepping()), corrected(controller=Pid())
    costs = law_costs([(loop, gathered(loop, steps=500)[0]) for loop in (dear, cheap)])
    assert costs[0]["law_ns"] > 1.3 * costs[1]["law_ns"] > 0
