"""A rudder behind a pod's propeller: its loads by hand, its allocation, and a turning circle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import podusv
from podusv_cli.components.actuators.pod import Pods
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.kernel import bundle, call
from podusv_cli.scenario.load import load

PROPELLER = {
    "x": -0.6,
    "T_nn": 0.02,
    "T_nn_astern": 0.011,
    "T_nV": 0.03,
    "n_max": 20.0,
    "n_max_astern": 10.0,
    "n_rate": 40.0,
    "n_lag": 0.2,
    "angle_limit": 0.7,
    "angle_rate": 1.0,
    "angle_lag": 0.1,
}
LIFT, STALL = 0.013, 0.4
RUDDER = {**PROPELLER, "rudder": {"lift": LIFT, "stall": STALL}}
HULL = {
    "length": 1.4,
    "beam": 0.3,
    "m": 25.0,
    "I_z": 2.1,
    "X_udot": -2.0,
    "Y_vdot": -11.0,
    "N_rdot": -1.3,
    "X_u": -1.1,
    "X_uu": -2.2,
    "Y_v": -5.0,
    "Y_vv": -30.0,
    "N_r": -1.9,
    "N_rr": -0.6,
    "Y_r": 0.2,
    "N_v": -0.1,
}


def actuator(**changes):
    return Pods(pods=({**RUDDER, **changes},))


def loads(n, delta, u=0.0, v=0.0, r=0.0):
    own, tau = actuator(), np.zeros(3)
    call(
        own.replay,
        x=np.array([0.0, 0.0, 0.0, u, v, r]),
        demand=np.array([n, delta]),
        k=bundle(own.constants()),
        table=own.table(),
        tau=tau,
    )
    return tau


@pytest.mark.parametrize(
    ("n", "delta", "normal"),
    [
        (10.0, 0.0, 0.0),
        (10.0, 0.3, 1.3 * 0.3),
        (10.0, -0.3, -1.3 * 0.3),
        (10.0, 0.6, 1.3 * 0.4),
        (20.0, -0.7, -5.2 * 0.4),
        (-10.0, 0.3, 0.0),
        (0.0, 0.3, 0.0),
    ],
)
def test_the_force_is_normal_to_the_rudder_and_grows_up_to_the_stall(n, delta, normal):
    """Ahead 0.02 n^2 less what the water's speed of 0.5 m/s takes, astern 0.011 n^2 more."""
    thrust = (0.02 if n > 0.0 else 0.011) * abs(n) * n - 0.03 * abs(n) * 0.5
    across = normal * math.cos(delta)
    expected = [thrust - normal * math.sin(delta), across, -0.6 * across]
    assert loads(n, delta, u=0.5, v=0.2) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("u", [0.0, 0.6])
def test_demands_in_reach_are_made_with_thrust_for_the_drag(u):
    """Away from full thrust and stall; the side force is what the arm makes of the moment."""
    own, x = actuator(), np.array([0.0, 0.0, 0.0, u, 0.0, 0.0])
    for tau_u, tau_r in ((1.0, 0.0), (2.0, 0.15), (3.0, -0.3), (5.0, 0.6)):
        made = own.settled(x, np.array([tau_u, tau_r]))
        assert made == pytest.approx([tau_u, tau_r / -0.6, tau_r], rel=1e-3, abs=1e-6)


def test_what_a_rudder_cannot_make_is_said():
    own = actuator()
    tried = (
        (0.0, (3.0, 0.2), 0.0),
        (0.0, (-1.0, 0.2), 1.0),
        (0.0, (3.0, 9.0), 1.0),
        (0.0, (1.0, 0.153), 0.0),
        (-0.6, (1.0, 0.153), 1.0),  # going astern, when a slower stream makes the thrust
    )
    for u, demand, saturated in tried:
        signals, x = np.zeros(len(own.signals)), np.array([0.0, 0.0, 0.0, u, 0.0, 0.0])
        call(
            own.drive,
            x=x,
            state=np.array([12.0, 0.0]),
            demand=np.array(demand),
            k=bundle(own.constants()),
            table=own.table(),
            tau=np.zeros(3),
            rate=np.zeros(2),
            signals=signals,
        )
        assert signals[0] == saturated
    assert own.settled(np.zeros(6), np.array([-1.0, 0.2])) == pytest.approx(
        [-1.0, 0.0, 0.0], abs=0.1
    )


def turning(t, s):
    """The hull's equations of motion by hand, with the propeller and the rudder as they lag."""
    _, _, psi, u, v, r, n, delta = s
    h, normal = HULL, LIFT * n * n * min(max(delta, -STALL), STALL)
    thrust = 0.02 * n * n - 0.03 * n * u
    m11, m22, m33 = 27.0, 36.0, 3.4
    surge = thrust - normal * math.sin(delta) + m22 * v * r + (h["X_u"] + h["X_uu"] * abs(u)) * u
    side = normal * math.cos(delta)
    sway = side - m11 * u * r + (h["Y_v"] + h["Y_vv"] * abs(v)) * v + h["Y_r"] * r
    yaw = -0.6 * side - (m22 - m11) * u * v + (h["N_r"] + h["N_rr"] * abs(r)) * r + h["N_v"] * v
    c, i = math.cos(psi), math.sin(psi)
    return [
        c * u - i * v,
        i * u + c * v,
        r,
        surge / m11,
        sway / m22,
        yaw / m33,
        min(max((9.0 - n) / 0.2, -40.0), 40.0),
        min(max((-0.5 - delta) / 0.1, -1.0), 1.0),
    ]


def test_a_circle_in_open_water_is_that_of_the_equations_by_hand():
    run = podusv.simulate(
        {
            "name": "circle",
            "vessel": HULL,
            "actuator": {"kind": "pod", "pods": [RUDDER]},
            "path": {"kind": "line"},
            "disturbance": {"kind": "none"},
            "start": {"u": 0.4},
            "controller": {"kind": "schedule", "rows": "t,n_1,delta_1\n0,9,-0.5\n1,9,-0.5\n"},
            "simulation": {"duration": 40.0, "step": 0.01},
        }
    )
    start = [0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0]
    ended = solve_ivp(turning, (0.0, 40.0), start, rtol=1e-10, atol=1e-12, max_step=0.05)
    last = [run[name][-1] for name in ("x", "y", "u", "v", "r")]
    assert last == pytest.approx(ended.y[[0, 1, 3, 4, 5], -1], abs=2e-4)
    assert np.ptp(run["psi"]) > 2.0 * math.pi
    assert run["r"][-1] > 0.0  # force to port at the stern: a turn to starboard
    assert run["u"][-1] < 0.9 * run["u"].max()  # a turn takes speed


def test_the_rudders_of_cybership2_have_the_published_force_at_rest():
    """(L_d - L_dd |delta|) delta u_rud^2 of Skjetne 2005: its slope, and its largest value."""
    ship = load("podusv:pod/rudders.yaml").scenario
    rudder, other = (pod.rudder for pod in ship.actuator.pods)
    stream = 0.5**2 * 8.0 * 3.65034e-3 / (math.pi * 1000.0 * 0.06**2)  # u_rud^2 / n^2
    assert rudder == other
    assert rudder.lift == pytest.approx(6.43306 * stream, rel=2e-3)
    largest = 6.43306**2 / (4.0 * 5.83594) * stream
    assert rudder.lift * rudder.stall == pytest.approx(largest, rel=3e-3)


def test_a_rudder_that_stops_its_boat_is_refused():
    """At a = 0.7 rad lift a sin a is 0.451 of the lift: thrust is left for 0.99, none for 1.3."""
    wide = {**RUDDER, "T_nn": 0.45, "T_nn_astern": 0.45, "angle_limit": 0.7}

    def pods(lift):
        return Pods(kind="pod", pods=[{**wide, "rudder": {"lift": lift, "stall": 0.7}}])

    straight = pods(0.99).settled(np.zeros(6), np.array([1e4, 0.0]))
    assert straight == pytest.approx([0.45 * RUDDER["n_max"] ** 2, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"at 0.7 rad drags 0.586 n\^2, and a"):
        pods(1.3)


def test_a_rudder_that_cannot_turn_is_refused_and_a_failure_takes_its_force(tmp_path):
    with pytest.raises(
        ScenarioError, match="has a rudder that cannot turn; give it an angle_limit"
    ):
        podusv.run({"actuator": {"kind": "pod", "pods": [{**RUDDER, "angle_limit": 0.0}]}})
    half = {"kind": "pod", "pods": [RUDDER], "failure": {"time": 0, "effectiveness": 0.5, "pod": 0}}
    own = Pods(**half)
    signals, tau = np.zeros(len(own.signals)), np.zeros(3)
    given = {"k": bundle(own.constants() | {"failure_effectiveness": 0.5, "failure_pod": 0.0})}
    given |= {"table": own.table(), "state": np.array([10.0, 0.3]), "tau": tau, "signals": signals}
    call(own.drive, x=np.zeros(6), demand=np.zeros(2), rate=np.zeros(2), **given)
    whole = tau.copy()
    call(own.lose, **given)
    assert tau == pytest.approx(0.5 * whole)
