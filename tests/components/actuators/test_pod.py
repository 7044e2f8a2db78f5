"""Pods as mechanics: thrust and its inverse, lags and rates, equilibria, symmetry, bad input."""

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, POD, SMOOTH_START, Constant, adrift, corrected, run
from drawn_samples import drawn, shown
from hypothesis import given
from hypothesis import strategies as st
from loop_samples import gathered, order
from pod_samples import TWIN, pods
from pydantic import ValidationError

from podusv_cli.components.actuators import allocation_qp
from podusv_cli.components.actuators.allocation import allocate
from podusv_cli.components.actuators.pod import Pods, follow
from podusv_cli.components.actuators.propeller import inflow, speed_for, thrust
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.paths.line import Line
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.figures.drawing import FIGURES

DRAG = 0.72 * 0.5 + 1.32742 * 0.25 + 5.86643 * 0.125  # the paper's vessel at 0.5 m/s [N]


def state_of(actuator: Pods, n: float, delta: float) -> Vector:
    count = len(actuator.pods)
    return np.array([n] * count + [delta] * count)


def loads(actuator: Pods, state: Vector, x: Vector, demand: tuple[float, float] = (0, 0)) -> Any:
    """(tau, rate, signals by name) of a state of pods and vessel."""
    tau, rate = np.full(3, np.nan), np.full(len(state), np.nan)
    signals = np.full(len(actuator.signals), np.nan)
    k, table = bundle(actuator.constants()), actuator.table()
    call(
        actuator.drive,
        t=0.0,
        x=x,
        state=state,
        demand=np.array(demand, float),
        k=k,
        table=table,
        tau=tau,
        rate=rate,
        signals=signals,
    )
    assert np.isfinite(np.concatenate([tau, rate, signals])).all()
    return tau, rate, dict(zip((s.name for s in actuator.signals), signals, strict=True))


NORMAL = partial(st.floats, allow_subnormal=False)  # 1e-323 N is beyond a root's arithmetic


@given(
    T=NORMAL(-8, 8),
    u=st.floats(-1, 1),
    v=st.floats(-1, 1),
    T_nV=NORMAL(0, 0.5),
    astern=st.none() | NORMAL(0, 0.5),
    form=st.sampled_from(["physical", "printed"]),
)
def test_the_inverse_gives_the_thrust_back(T, u, v, T_nV, astern, form):
    actuator = pods({"T_nV": T_nV, "T_nV_astern": astern}, thrust_form=form)
    k, table, x = bundle(actuator.constants()), actuator.table(), np.array([0, 0, 0, u, v, 0.1])
    flow = inflow(x, table, 0.3, k)
    n = speed_for(T, flow, table, k)
    assert thrust(n, flow, table, k) == pytest.approx(T, abs=1e-12, rel=1e-9)
    assert n * T >= 0.0


def test_physical_thrust_falls_with_speed_and_the_printed_one_rises():
    ahead = np.array([0, 0, 0, 0.5, 0, 0])
    for form, sign in (("physical", -1), ("printed", 1)):
        actuator = pods({"T_nV": 2e-3}, thrust_form=form)
        tau, _, _ = loads(actuator, state_of(actuator, 20.0, 0.0), ahead)
        assert tau[0] == pytest.approx(POD["T_nn"] * 400 + sign * 2e-3 * 20 * 0.5)


def test_astern_a_propeller_loses_thrust_by_a_coefficient_of_its_own():
    """CyberShip II's: at 20/s and 0.5 m/s 0.0015 N less ahead, 0.456 N more astern."""
    actuator = pods({"T_nV": 1.52468e-4, "T_nV_astern": 4.55822e-2})
    ahead = np.array([0, 0, 0, 0.5, 0, 0])
    for n, slope in ((20.0, 1.52468e-4), (-20.0, 4.55822e-2)):
        tau, _, _ = loads(actuator, state_of(actuator, n, 0.0), ahead)
        at_rest, _, _ = loads(actuator, state_of(actuator, n, 0.0), np.zeros(6))
        assert tau[0] - at_rest[0] == pytest.approx(-slope * 20.0 * 0.5)


def test_the_advance_speed_is_that_of_the_water_along_the_pod():
    actuator = pods({"T_nV": 2e-3, "y": 0.1})
    x, delta = np.array([0, 0, 0, 0.5, 0.2, 0.3]), 0.4
    velocity = [0.5 - 0.1 * 0.3, 0.2 - 0.499 * 0.3]  # nu + r x (x_p, y_p)
    V_a = velocity @ np.array([math.cos(delta), math.sin(delta)])
    assert inflow(x, actuator.table(), delta, bundle(actuator.constants())) == pytest.approx(-V_a)


def test_at_rest_nothing_is_undefined():
    actuator = pods({"T_nV": 2e-3})
    tau, rate, signals = loads(actuator, np.zeros(2), np.zeros(6))
    assert not tau.any()
    assert not rate.any()
    assert signals["saturated"] == 0.0


@given(n=st.floats(-33, 33), delta=st.floats(-0.6, 0.6))
def test_loads_are_those_of_the_force_at_its_place(n, delta):
    for kept in (True, False):
        pair = pods(*TWIN, neglect_sway_force=not kept)
        tau, _, signals = loads(pair, state_of(pair, n, delta), np.zeros(6))
        T = (3.65e-3 if n > 0 else POD["T_nn_astern"]) * n * abs(n)
        assert signals["thrust"] == pytest.approx(T)
        # Both alike: as one of twice the thrust on the centre line (9).
        expected = [math.cos(delta), kept * math.sin(delta), -0.499 * math.sin(delta)]
        np.testing.assert_allclose(tau, 2 * T * np.array(expected), atol=1e-12)


def test_bollard_pull_of_cybership_ii():
    """facts: 4.0 N ahead and 5.7 N astern each, about."""
    one = pods({"T_nn": 3.65034e-3, "T_nn_astern": 5.10256e-3})
    ahead, astern = (loads(one, state_of(one, n, 0.0), np.zeros(6))[0][0] for n in (33, -33))
    assert ahead == pytest.approx(3.975, abs=1e-3)
    assert astern == pytest.approx(-5.557, abs=1e-3)


def step_response(lag: float, rate: float, goal: float, t: Vector) -> Vector:
    """A lag of which the rate is limited: a ramp until the lag is slower than it, then e^-t."""
    left = min(goal, rate * lag)  # of the way when the ramp ends
    ramp = (goal - left) / rate
    return np.where(t < ramp, rate * t, goal - left * np.exp(-(t - ramp) / lag))


@pytest.mark.parametrize("rate", [60.0, 1e9])
def test_speed_and_angle_follow_their_lags_and_rates_exactly(rate):
    T, angle = 4.0, 0.5
    law = Constant(surge=T * math.cos(angle), yaw=-0.499 * T * math.sin(angle))
    actuator = pods({"n_rate": rate, "n_lag": 0.25, "angle_rate": rate / 60, "angle_lag": 0.125})
    out = run(adrift(actuator=actuator, controller=law), 2.0, 0.0005)
    n = math.sqrt(T / POD["T_nn"])
    # The corner where the ramp ends lies between two steps.
    np.testing.assert_allclose(
        out["n"][:, 0], step_response(0.25, rate, n, out["time"]), atol=2e-5 * n
    )
    np.testing.assert_allclose(
        out["delta"][:, 0], step_response(0.125, rate / 60, angle, out["time"]), atol=2e-5
    )
    assert out["rate_limited"][0] == (1.0 if rate < 1e9 else 0.0)
    assert out["rate_limited"][-1] == 0.0


def test_port_is_starboard_in_the_mirror():
    """Everything to starboard changes sign: y, psi, v, r, yaw moment, sway force, angles."""
    both = []
    for side in (1.0, -1.0):
        law = Constant(surge=1.5, yaw=side * 1.9)
        start = (0.0, side * 2.0, side * 0.3, 0.4, side * 0.1, side * 0.2)
        both.append(run(adrift(actuator=pods(*TWIN), controller=law, start=start), 20.0))
    one, other = both
    for name in ("x", "u", "tau_u"):
        np.testing.assert_allclose(one[name], other[name], atol=1e-6)
    for name in ("y", "psi", "v", "r", "tau_v", "tau_r"):
        np.testing.assert_allclose(one[name], -other[name], atol=1e-6)
    np.testing.assert_allclose(one["n"], other["n"][:, ::-1], atol=1e-5)
    np.testing.assert_allclose(one["delta"], -other["delta"][:, ::-1], atol=1e-6)


def test_away_from_limits_the_loop_is_of_fourth_order():
    fast = pods({"n_rate": 1e6, "angle_rate": 1e6, "n_max": 1e3, "angle_limit": 1.5})
    law = Pid(K_Pu=20.0, K_Iu=1.0, K_Du=0.0, K_Pr=2.0, K_Ir=0.1, K_Dr=0.0, anti_windup="auxiliary")
    loop = corrected(actuator=fast, controller=law, path=Line(), start=SMOOTH_START)
    ends = []
    for step in (0.004, 0.002, 0.001, 0.0005):
        out = run(loop, 1.0, step)
        assert not out["angle_limited"].any()
        assert not out["speed_limited"].any()
        ends.append(np.concatenate([np.ravel(out[name][-1]) for name in ("x", "psi", "r", "n")]))
    assert order(ends) == pytest.approx(4.0, abs=0.2)


def test_a_demand_out_of_reach_is_an_event_and_no_accident():
    for actuator in (pods(), pods(*TWIN)):
        loop = adrift(actuator=actuator, controller=Constant(surge=1e9, yaw=-1e12))
        log, got = gathered(loop, steps=500)
        assert log.status == "finished"
        assert log["saturated"].all()
        assert got["saturated_fraction"] == 1.0
        assert 0.0 < got["at_speed_limit"] <= 1.0
        assert got["at_angle_limit"] == 1.0
        assert np.abs(log["delta"]).max() <= math.radians(35.0)
        assert np.abs(log["n"]).max() <= 33.0


def test_energy_counts_the_work_of_the_force_to_the_side():
    """Turned pods push sideways, and a hull that drifts takes work from them there, too."""
    log, got = gathered(corrected(actuator=pods(*TWIN)), steps=2000)
    work = [0.0, 0.0, 0.0]
    for i in range(1, len(log["time"])):
        for axis, (load, speed) in enumerate((("tau_u", "u"), ("tau_v", "v"), ("tau_r", "r"))):
            ends = [abs(log[load][j] * log[speed][j]) for j in (i - 1, i)]
            work[axis] += 0.5 * sum(ends) * (log["time"][i] - log["time"][i - 1])
    assert got["energy"] == pytest.approx(sum(work), rel=1e-9)
    assert work[1] > 0.01 * got["energy"]


def test_energy_and_travel_are_those_of_the_log():
    actuator = pods(*({**pod, "power_nnn": 2e-4} for pod in TWIN))
    log, got = gathered(corrected(actuator=actuator), steps=2000)
    power = 2e-4 * np.abs(log["n"]) ** 3
    np.testing.assert_allclose(log["power"], power)
    assert got["energy_pod"] == pytest.approx(np.trapezoid(power.sum(axis=1), log["time"]))
    assert got["angle_travel"] == pytest.approx(np.abs(np.diff(log["delta"], axis=0)).sum())
    assert got["angle_travel"] > 1.0
    for metric, flag in (("at_rate_limit", "rate_limited"), ("at_angle_limit", "angle_limited")):
        assert got[metric] == pytest.approx(np.trapezoid(log[flag], log["time"]) / log["time"][-1])


@pytest.mark.parametrize(
    ("several", "words"),
    [
        ([{"x": 0.0}], "no authority over yaw"),
        ([{"x": 0.0}, {"x": 0.0}], "no authority over yaw"),
        ([{"angle_limit": 0.0}], "no authority over yaw"),
        ([{"angle_limit": 0.0, "y": 0.3}], "apart from each other"),
        ([{"angle_limit": 0.0, "y": 0.3}, {"angle_limit": 0.0, "y": 0.3}], "at different y"),
        ([{}] * 5, "has 5 pods; 1 to 4"),
        ([{"n_max": -1.0}], "n_max"),
        ([{"T_nn": -1e-3}], "T_nn"),
        ([{"T_nV": -1e-3}], "T_nV"),
        ([{"angle_limit": 2.0}], "angle_limit"),
        ([{"angle_rate": 0.0}], "angle_rate"),
        ([{"n_lag": 0.0}], "n_lag"),
        ([], "has 0 pods"),
        *(
            ([{key: 1e308}, {}], "no more than 1e\\+15 can be computed with; take smaller")
            for key in ("x", "y", "T_nn", "T_nn_astern", "n_max", "n_max_astern")
        ),
    ],
)
def test_pods_that_cannot_be_are_refused(several, words):
    with pytest.raises(ValidationError, match=words):
        Pods(pods=tuple({**POD, **own} for own in several))


def test_fixed_propellers_need_no_numbers_of_an_angle_and_move_as_with_any():
    pair = [{"x": -2.0, "y": side, "angle_limit": 0.0} for side in (-0.9, 1.1)]
    without = {"angle_rate": None, "angle_lag": None}
    full, bare = pods(*pair), pods(*({**own, **without} for own in pair))
    assert bare.lags() == full.lags() == (0.2, 0.2)
    slow = pods(*({**own, "angle_lag": 0.01} for own in pair))
    assert bare.shortest_lag() == slow.shortest_lag() == 0.2  # nothing turns
    state, command = np.array([3.0, -5.0, 0.0, 0.0]), np.array([20.0, 9.0, 0.0, 0.0])
    rates = np.empty((2, 4))
    for rate, actuator in zip(rates, (bare, full), strict=True):
        follow(state, command, bundle(actuator.constants()), actuator.table(), rate)
    assert np.array_equal(rates[0], rates[1])
    assert rates[0, :2] == pytest.approx([60.0, 60.0])  # the limit of 17/0.2 and 14/0.2 1/s2


@pytest.mark.parametrize("name", ["angle_rate", "angle_lag"])
def test_a_pod_that_turns_needs_the_numbers_of_its_angle(name):
    with pytest.raises(ValidationError, match=f"{name}.*angle_limit: 0"):
        pods({name: None})


@pytest.mark.parametrize("demand", [(math.nan, 1.0), (5.0, 1.0)])
@pytest.mark.parametrize("gain", [0.0, math.nan, math.inf])
def test_what_is_no_number_is_no_allocation_and_none_is_searched_for(demand, gain, monkeypatch):
    tried: list[int] = []

    def pull(*arguments: Any) -> None:
        tried.append(1)
        solved(*arguments)

    solved = allocation_qp.pull
    monkeypatch.setattr(allocation_qp, "pull", pull)
    pair = pods(*TWIN)
    T, delta, k = np.zeros(2), np.zeros(2), bundle(pair.constants())
    gains = np.full(2, gain)
    with np.errstate(all="ignore"):
        allocate(pair.rest(), np.array(demand), gains, k, pair.table(), T, delta)
    if gain == 0.0:
        known = math.isfinite(demand[0])
        assert np.isfinite(T).tolist() == np.isfinite(delta).tolist() == [known] * 2
    assert len(tried) < 200


def test_the_paper_s_vessel_has_the_drag_of_the_hand_calculation():
    k = NONLINEAR.constants()
    assert -(k["X_u"] + k["X_uu"] * 0.5 + k["X_uuu"] * 0.25) * 0.5 == pytest.approx(DRAG)


def test_the_figure_shows_what_each_pod_did_over_what_it_was_asked_for():
    log = run(corrected(actuator=pods(*TWIN)), 5.0)
    panels = np.reshape(drawn("pods", shown(("pods", log))).axes, (2, 2))
    for row, name in zip(panels, ("n", "delta"), strict=True):
        for pod, axes in enumerate(row):
            asked, done = (np.asarray(line.get_ydata()) for line in axes.lines)
            np.testing.assert_array_equal(asked, log[f"{name}_cmd"][:, pod])
            np.testing.assert_array_equal(done, log[name][:, pod])
    assert not FIGURES["pods"].fits(shown(("ideal", run(corrected(), 0.1))))


@pytest.mark.parametrize(
    "one",
    [
        pods(*TWIN),
        pods({"T_nV": 0.05}),
        pods(*({**own, "T_nV": 0.02} for own in TWIN), horizon=0.05),
        pods(horizon=0.02),
    ],
)
def test_settled_force_and_moment_are_where_lags_and_limits_end(one):
    x, demand, step = np.array([0, 0, 0, 0.5, 0.1, 0.05]), np.array([3.0, 0.8]), 0.02
    state = one.rest()
    for _ in range(400):
        tau, rate, _ = loads(one, state, x, (3.0, 0.8))
        state = state + step * rate
    # Two pods with a horizon may end at other angles, of which the sway force alone tells.
    both = [0, 2] if one.horizon else [0, 1, 2]
    np.testing.assert_allclose(one.settled(x, demand)[both], tau[both], atol=1e-5)
