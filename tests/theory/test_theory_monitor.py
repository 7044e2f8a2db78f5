"""The stability monitor: V' is the rate of V, V' is the sum of its terms, and faults are seen."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import (
    GENTLE,
    NONLINEAR,
    PAPER,
    POD,
    SMOOTH_START,
    VESSELS,
    corrected,
    run,
    situations,
    target_at,
)

from podusv_cli.components.actuators.pod import Pod, Pods
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.dsc import DynamicSurface
from podusv_cli.components.controllers.full_backstepping import FullBackstepping
from podusv_cli.components.controllers.network import activation
from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.components.disturbances.harmonic import HarmonicDisturbance
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import Vector, bundle, kernel
from podusv_cli.core.recording import Recording
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop
from podusv_cli.engine.loop.columns import by_name
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.replay import rates_replay
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.theory.ideal_weights import unloaded_accelerations
from podusv_cli.theory.lyapunov import TERMS
from podusv_cli.theory.monitor import Monitored, monitor_recording
from podusv_cli.theory.rates import error_rates

GAINS: dict[str, Any] = {"Gamma_u": 1.0, "Gamma_r": 1.0, "gamma_u": 10.0, "gamma_r": 10.0}
LAWS: list[PolarBackstepping] = [GENTLE, DynamicSurface(**GAINS), FullBackstepping(**GAINS)]
every_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.label)


def watched(loop: ClosedLoop, duration: float, step: float = 0.01, **options: Any) -> Monitored:
    """A run with its monitor."""
    grid = TimeGrid(step, round(duration / step))
    monitor = monitor_recording(Plan(loop, grid), run(loop, duration, step, **options))
    assert monitor
    return monitor


def smooth(law: PolarBackstepping, **parts: Any) -> ClosedLoop:
    """A loop in which nothing jumps, folds or has a corner."""
    chosen = {"path": Line(course=0.2, speed=0.5), "start": SMOOTH_START, "vessel": PAPER} | parts
    return corrected(controller=law, **chosen)


def simpson(y: Vector, h: float) -> float:
    return float(h / 3.0 * (y[0] + 4.0 * y[1:-1:2].sum() + 2.0 * y[2:-1:2].sum() + y[-1]))


@every_law
def test_rate_integrates_to_the_change_of_V_to_fourth_order(law):
    gaps = []
    for step in (0.02, 0.01, 0.005, 0.0025):
        log = watched(smooth(law), 8.0, step).recording
        change = log["V"][-1] - log["V"][0]
        gaps.append(abs(change - simpson(log["V_dot"], step)))
    orders = np.log2(np.array(gaps[:-1]) / gaps[1:])
    assert orders[-1] == pytest.approx(4.0, abs=0.5), (gaps, orders)


@pytest.mark.parametrize("anti_windup", ["none", "auxiliary"])
@pytest.mark.parametrize("places", [(0.0,), (-0.078, 0.078)], ids=["one pod", "two pods"])
def test_rate_integrates_to_the_change_of_V_behind_pods_too(anti_windup, places):
    """At limits and rates the integrand has corners, hence no order but closeness."""
    own = {"T_nV": 1e-3, "n_rate": 200.0, "angle_rate": 1.75, "n_lag": 0.1, "angle_lag": 0.1}
    actuator = Pods(pods=tuple(Pod(**POD | own | {"y": y}) for y in places))
    law = GENTLE.model_copy(update={"anti_windup": anti_windup})
    log = watched(smooth(law, vessel=NONLINEAR, actuator=actuator), 20.0, 0.005).recording
    assert log["saturated"].any()
    assert log["rate_limited"].any()
    change, travel = log["V"][-1] - log["V"][0], simpson(np.abs(log["V_dot"]), 0.005)
    assert change == pytest.approx(simpson(log["V_dot"], 0.005), abs=1e-5 * travel)


@pytest.mark.parametrize("name", ["paper", "cybership2"])
def test_unloaded_accelerations_are_those_of_the_hull_left_alone(name):
    """Also where inertia couples sway and yaw, and the actuator makes a sway force."""
    hull = VESSELS[name]
    actuator = Pods(pods=tuple(Pod(**POD | {"y": y}) for y in (-0.078, 0.078)))
    sea = HarmonicDisturbance(scale=3.0)
    loop = smooth(GENTLE, vessel=hull, actuator=actuator, disturbance=sea)
    log = run(loop, 3.0)
    now = rates_replay(Plan(loop, TimeGrid(0.01, 300)))(log)
    f_u, f_r = unloaded_accelerations(loop, now)
    assert np.median(np.abs(now.signals["tau_v"] + now.signals["b_v"])) > 0.3
    rate, nothing, k = np.zeros(6), np.zeros(3), bundle(hull.constants())
    for i in range(0, 301, 20):
        plant(np.array([log[state][i] for state in STATE]), nothing, nothing, k, rate)
        assert (f_u[i], f_r[i]) == pytest.approx((rate[3], rate[5]), rel=1e-9, abs=1e-12)


FOLDS = [
    {"fold": "joint"},
    {"fold": "printed"},
    {"fold": "none"},
    {"hold_below": 9.0},
    {"standoff": 0.0, "k_ze": 0.3},
    {"rate": "difference"},
    {"coupling": "printed"},
]


@pytest.mark.parametrize("options", FOLDS, ids=str)
@every_law
def test_rates_of_errors_are_derivatives_along_the_flow(law, options):
    law = law.model_copy(update=options)
    loop = corrected(controller=law, path=Circle(), vessel=VESSELS["cybership2"])
    for at in situations(law, 5):
        rows = moving(loop, law, at.x, at.memory)
        now = rates_replay(Plan(loop, TimeGrid(0.01, 1)), compiled=False)(rows)
        e = error_rates(rows, now, law)
        pairs = {
            "z_e": e.z_e,
            "psi_e": e.psi_e,
            "u_e": e.u_e,
            "r_e": e.r_e,
            "y_u": e.y_u,
            "y_r": e.y_r,
            "alpha_u": now.signals["alpha_u"],
            "alpha_r": now.signals["alpha_r"],
        }
        if isinstance(law, FullBackstepping):  # whose u_e is of alpha itself
            assert e.y_u[1] == e.y_u_dot[1] == 0.0
        for name, along in pairs.items():
            quotient = (along[2] - along[0]) / (2.0 * TINY)
            rate = getattr(e, f"{name}_dot")[1]
            assert rate == pytest.approx(quotient, rel=2e-4, abs=2e-4), name


TINY = 1e-5  # s


def moving(loop: ClosedLoop, law: PolarBackstepping, x: Vector, memory: Vector) -> Recording:
    """Three rows: a state, and where the flow comes from and goes to in a tiny time."""
    plan = Plan(loop, TimeGrid(0.01, 1))
    labels = plan.names[: 1 + plan.layout.states]
    t, s = 20.0, np.concatenate([target_at(loop.path, 20.0)[:2] + x[:2] * 0.5, x[2:], memory])

    def recorded(rows: Vector) -> Recording:
        return Recording("finished", law.label, by_name(labels, np.atleast_2d(rows), loop.about()))

    here = recorded(np.concatenate([[t], s]))
    rates = rates_replay(plan, compiled=False)(here).rates
    ds = np.concatenate([[1.0], *(np.ravel(rates[name]) for name in dict.fromkeys(labels[1:]))])
    row = np.concatenate([[t], s])
    return recorded(np.stack([row - TINY * ds, row, row + TINY * ds]))


def sum_of_terms(loop: ClosedLoop, monitor: Monitored) -> Vector:
    """V' of the corrected law as docs/theory.md derives it, from what was logged."""
    law, log, trace = loop.controller, monitor.recording, monitor.traces
    assert isinstance(law, PolarBackstepping)
    z_e, psi_e, u_e, r_e = log["z_e"] - law.standoff, log["psi_e"], log["u_e"], log["r_e"]
    y_u, y_r = log["beta_u"] - log["alpha_u"], log["beta_r"] - log["alpha_r"]
    A_u, A_r = law.filter_decay(log["alpha_u"], log["alpha_r"])
    known = loop.disturbance.bounds()
    assert known
    b_u, b_r, phi = known[0], known[2], 1.0 / (4.0 * law.partial)
    W_u, W_r = log["W_hat_u"] - log["W_star_u"], log["W_hat_r"] - log["W_star_r"]
    m11, m33, start = loop.vessel.m11, loop.vessel.m33, law.network.initial_weight
    return (
        -law.k_ze * z_e**2
        - law.k_psie * psi_e**2
        - law.k_ue * u_e**2
        - law.k_re * r_e**2
        - z_e * y_u * np.cos(psi_e)
        - psi_e * y_r
        - A_u * y_u**2
        - y_u * trace["alpha_u_dot"]
        - A_r * y_r**2
        - y_r * trace["alpha_r_dot"]
        + u_e * m11 * trace["epsilon_u"]
        + u_e * log["b_u"]
        - b_u * phi * u_e**2
        + r_e * m33 * trace["epsilon_r"]
        + r_e * log["b_r"]
        - b_r * phi * r_e**2
        - law.sigma_u * np.sum(W_u * (log["W_hat_u"] - start), axis=1)
        - law.sigma_r * np.sum(W_r * (log["W_hat_r"] - start), axis=1)
        - law.sigma_bu * (log["b_hat_u"] - b_u) * (log["b_hat_u"] - law.b_hat_u0)
        - law.sigma_br * (log["b_hat_r"] - b_r) * (log["b_hat_r"] - law.b_hat_r0)
    )


def mismatch(loop: ClosedLoop, monitor: Monitored) -> float:
    """Largest gap between V' along the run and the sum of its terms, relative to V'."""
    rate = monitor.recording["V_dot"]
    return float(np.max(np.abs(rate - sum_of_terms(loop, monitor))) / np.max(np.abs(rate)))


@pytest.mark.parametrize("law", LAWS[:2], ids=lambda law: law.label)
def test_rate_along_a_run_is_the_sum_of_its_terms(law):
    loop = smooth(law, vessel=NONLINEAR)
    assert mismatch(loop, watched(loop, 20.0)) < 1e-10


FAULTS = ["coupling", "k_ue", "k_re", "Gamma_u", "Gamma_r", "gamma_u", "gamma_r", "sigma_u"]


@pytest.mark.parametrize("sign", FAULTS)
def test_a_wrong_sign_planted_in_the_law_is_caught(sign):
    @kernel
    def wrong(
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        table: Vector,
        tau: Vector,
        rate: Vector,
        signals: Vector,
        work: Vector,
    ) -> None:
        turned = 1.0 - k.coupling if sign == "coupling" else -getattr(k, sign)
        k = k._replace(**{sign: turned})
        AdaptiveNeural.law(x, memory, target, k, table, tau, rate, signals, work)

    class Wrong(AdaptiveNeural):
        """The law with one wrong sign that no field tells of."""

        law = staticmethod(wrong)  # type: ignore[assignment]

    loop = smooth(Wrong(**GENTLE.model_dump()))
    recording = run(loop, 1.0, 0.02, compiled=False)
    monitor = monitor_recording(Plan(loop, TimeGrid(0.02, 50)), recording, compiled=False)
    assert monitor
    assert mismatch(loop, monitor) > 1e-5
    honest = replace(loop, controller=GENTLE)
    assert mismatch(honest, watched(honest, 1.0, 0.02)) < 1e-10


@every_law
def test_V_is_the_sum_of_its_terms_and_stays_below_its_bound(law):
    monitor = watched(smooth(law, vessel=NONLINEAR), 200.0)
    log = monitor.recording
    np.testing.assert_allclose(log["V"], sum(log[term.name] for term in TERMS), rtol=1e-13)
    for window in monitor.windows.values():
        bound = window.bound.corrected
        assert window.kept == 1.0  # V' <= -2 lambda V + Delta in every row
        envelope = log["V"][0] * np.exp(-2.0 * bound.lambda_ * log["time"]) + bound.value
        if window.since == 0.0:
            assert np.all(log["V"] <= envelope)
    assert monitor.windows["settled"].largest_V < monitor.windows["settled"].bound.corrected.value


def test_ideal_weights_are_what_makes_their_share_of_Delta_least():
    loop = smooth(GENTLE, vessel=NONLINEAR)
    monitor = watched(loop, 15.0)  # short enough for the fit to take every row
    log, law = monitor.recording, GENTLE
    phi = activation(law.network, np.column_stack([log["u"], log["v"], log["r"]]))
    for axis, m, sigma in (("u", NONLINEAR.m11, law.sigma_u), ("r", NONLINEAR.m33, law.sigma_r)):
        W, left = log[f"W_star_{axis}"], monitor.traces[f"epsilon_{axis}"]
        gradient = -(m**2) * (phi.T @ left) / len(left) + sigma * W
        assert np.abs(gradient).max() < 1e-9 * np.abs(sigma * W).max()


def test_vessel_with_coupled_sway_and_yaw_and_a_wrong_nominal_one():
    # What the proof does not know of is in `rest`, and V' stays below its bound all the same.
    loop = smooth(GENTLE, vessel=VESSELS["cybership2"], nominal=PAPER)
    monitor = watched(loop, 60.0)
    assert monitor.windows["whole"].kept == 1.0
    assert np.abs(monitor.traces["rest_r"] - PAPER.m33 * monitor.traces["epsilon_r"]).max() > 1e-2
    told = watched(smooth(GENTLE, vessel=PAPER), 60.0).traces  # where there is nothing else
    np.testing.assert_allclose(told["rest_r"], PAPER.m33 * told["epsilon_r"], atol=1e-10)


def test_sway_stays_below_its_bound():
    for vessel in VESSELS.values():
        loop = smooth(GENTLE, vessel=vessel)
        whole = watched(loop, 100.0).windows["whole"]
        assert whole.largest_v < whole.sway.value
        assert vessel is not PAPER or whole.sway.value <= whole.sway.printed * (1.0 + 1e-12)


def test_sampled_control_has_V_but_no_rate():
    loop, grid = smooth(GENTLE), TimeGrid(0.01, 100, hold_every=10)
    monitor = monitor_recording(Plan(loop, grid), run(loop, 1.0, hold_every=10))
    assert monitor
    assert "V" in monitor.recording
    assert "V_dot" not in monitor.recording
    assert monitor.windows["whole"].observed is None
    # V is of the state as it is, not as the law last saw it.
    z_e = monitor.recording["z_e"] - GENTLE.standoff
    np.testing.assert_allclose(monitor.recording["V_z_e"], z_e**2 / 2.0)


def test_a_run_that_diverges_is_monitored_as_far_as_it_went():
    law = AdaptiveNeural(
        coupling="printed",
        rate="difference",
        first_difference="from_zero",
        filter_start="zero",
        fold="printed",
        standoff=0.0,
    )
    loop = corrected(controller=law, vessel=PAPER)
    recording = run(loop, 5.0)
    assert recording.status == "diverged"
    monitor = monitor_recording(Plan(loop, TimeGrid(0.01, 500)), recording)
    assert monitor
    assert len(monitor.recording["V"]) == len(recording["time"])
    assert np.isfinite(monitor.recording["W_star_u"]).all()


def test_plain_and_compiled_monitor_agree():
    loop, grid = smooth(GENTLE), TimeGrid(0.05, 20)
    recording = run(loop, 1.0, 0.05)
    one, other = (monitor_recording(Plan(loop, grid), recording, compiled=c) for c in (True, False))
    assert one
    assert other
    for name in ("V", "V_dot", *(term.name for term in TERMS)):
        np.testing.assert_allclose(one.recording[name], other.recording[name], rtol=1e-9, atol=1e-9)


def test_what_a_limit_withholds_counts_as_disturbance():
    loop = smooth(GENTLE, actuator=Saturated(surge_limit=2.0, yaw_limit=0.5))
    monitor = watched(loop, 20.0)
    log = monitor.recording
    withheld = log["tau_u"] - log["tau_u_cmd"]
    assert np.abs(withheld).max() > 1.0
    expected = PAPER.m11 * monitor.traces["epsilon_u"] + withheld
    np.testing.assert_allclose(monitor.traces["rest_u"], expected, atol=1e-9)
    assert monitor.windows["whole"].kept == 1.0
