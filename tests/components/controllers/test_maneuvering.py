"""The law maneuvering: proof along runs, a plain-Python loop, invariance, limits and refusals."""

import math

import numpy as np
import pytest
import sympy as sp
from conftest import corrected, run, vessel
from pose_samples import BOAT, POSES, loaded_pose, marched

from podusv_cli.components.actuators.ideal_full import IdealFull
from podusv_cli.components.controllers.maneuvering import Maneuvering
from podusv_cli.components.paths.ellipse import Ellipse
from podusv_cli.core.errors import LawError, ScenarioError
from podusv_cli.theory.loop_margins import loop_margins

HULL = vessel("cybership2")
M = np.array([[HULL.m11, 0, 0], [0, HULL.m22, HULL.m23], [0, HULL.m32, HULL.m33]])
ROUND, A, B = 60.0, 3.0, 2.0
PACE = 2 * math.pi / ROUND  # rad of the ellipse's angle per second of its time
ELLIPSE = f"path: {{kind: ellipse, length: {2 * A}, breadth: {2 * B}, period: {ROUND}}}\n"
GAINS = "k_p: 0.2, k_psi: 0.3, k_d: 0.6"
LAW = f"controller: {{kind: maneuvering, {GAINS}}}\n"
AWAY = "start={x: 3.5, y: -0.7, psi: 0.9, u: 0.1, v: -0.05, r: 0.1}"


def on_path(speed):
    """The start that lies on the ellipse and moves along it at this speed [m/s]."""
    return f"start={{x: {A}, psi: {math.pi / 2!r}, u: {speed!r}, r: {speed * A / B**2!r}}}"


def curve(s):
    """Place with heading (3,) on the ellipse at its time s, and two derivatives."""
    c, n, w = math.cos(PACE * s), math.sin(PACE * s), PACE
    square = (A * n) ** 2 + (B * c) ** 2
    heading = math.atan2(B * c, -A * n)
    first = w * A * B / square
    second = -w * w * A * B * 2 * n * c * (A * A - B * B) / square**2
    return (
        np.array([A * c, B * n, heading]),
        np.array([-A * w * n, B * w * c, first]),
        np.array([-A * w * w * c, -B * w * w * n, second]),
    )


def forces(nu):
    """Damping and Coriolis forces of CyberShip II at nu, written out anew."""
    u, v, r = nu
    p = HULL
    return np.array(
        [
            (p.m22 * v + p.m23 * r) * r + (p.X_u + p.X_uu * abs(u) + p.X_uuu * u * u) * u,
            -p.m11 * u * r
            + (p.Y_v + p.Y_vv * abs(v) + p.Y_rv * abs(r)) * v
            + (p.Y_r + p.Y_vr * abs(v) + p.Y_rr * abs(r)) * r,
            (p.m11 - p.m22) * u * v
            - p.m23 * r * u
            + (p.N_v + p.N_vv * abs(v) + p.N_rv * abs(r)) * v
            + (p.N_r + p.N_vr * abs(v) + p.N_rr * abs(r)) * r,
        ]
    )


@pytest.mark.parametrize("update", ["tracking", "gradient", "filtered"])
@pytest.mark.parametrize("speed", [0.0, 0.13])
def test_it_stays_at_rounding_level_on_a_path_that_it_begins_on(speed, update):
    law = LAW.replace(GAINS, f"{GAINS}, speed: {speed}, update: {update}")
    log = marched(BOAT + ELLIPSE + law, on_path(speed or B * PACE), "simulation.duration=60")
    assert log["z_e"].max() < 1e-6  # what RK4 leaves with a step of 0.02 s
    assert np.abs(log["psi_t"]).max() < 1e-6
    assert np.abs(log["tau_v"]).max() > 0.05  # the motion does need sway
    finer = marched(
        BOAT + ELLIPSE + law,
        on_path(speed or B * PACE),
        "simulation.duration=20",
        "simulation.step=0.0025",
    )
    assert finer["z_e"].max() < 1e-10
    if speed:
        assert np.hypot(log["u"], log["v"]) == pytest.approx(speed, abs=1e-6)
    else:
        np.testing.assert_allclose(log["path_time"], log["time"], atol=1e-6)


MU = {"tracking": 0.0, "gradient": 0.4}


@pytest.mark.parametrize("update", MU)
@pytest.mark.parametrize("speed", [0.0, 0.13])
def test_a_lyapunov_function_falls_with_the_path_s_time_as_the_proof_says(speed, update):
    """By z_1' K_p z_1 + k_d z_2' M z_2 + mu (eta_d^s' R z_1)^2 / |p_d^s|, off the path."""
    step = 0.002
    law = LAW.replace(GAINS, f"{GAINS}, mu: 0.4, speed: {speed}, update: {update}")
    over = (f"simulation.step={step}", "simulation.duration=6")
    log = marched(BOAT + ELLIPSE + law, AWAY, *over)
    z_1 = np.stack([log["z_1u"], log["z_1v"], log["psi_t"]])
    slopes = np.array([curve(s)[1] for s in log["path_time"]]).T
    c, n = np.cos(log["psi"]), np.sin(log["psi"])

    def turned(eta):
        return np.stack([c * eta[0] + n * eta[1], c * eta[1] - n * eta[0], eta[2]])

    K_p = np.array([[0.2], [0.2], [0.3]])
    alpha = turned(slopes) * log["path_rate_d"] - K_p * z_1
    z_2 = np.stack([log["u"], log["v"], log["r"]]) - alpha
    V = 0.5 * (z_1 * z_1).sum(0) + 0.5 * (z_2 * (M @ z_2)).sum(0)
    gradient = (turned(slopes) * z_1).sum(0)
    pace = np.hypot(slopes[0], slopes[1])
    fall = (K_p * z_1 * z_1).sum(0) + 0.6 * (z_2 * (M @ z_2)).sum(0)
    fall += MU[update] * gradient**2 / pace
    np.testing.assert_allclose(
        log["path_rate"] - log["path_rate_d"], MU[update] * gradient / pace, atol=1e-12
    )
    inner = slice(5, -5)
    np.testing.assert_allclose(np.gradient(V, step)[inner], -fall[inner], rtol=2e-4, atol=1e-6)
    assert (V[0] * np.exp(-2.0 * 0.2 * log["time"]) * (1 + 1e-6) >= V).all()


def test_the_rate_of_the_wanted_velocity_is_that_of_its_source():
    """alpha' by sympy for any curve and speed, beside sigma + alpha^s s' of the programs."""
    t, w, k, k_psi = sp.symbols("t w k k_psi")
    psi, u, v, r = (sp.Function(name)(t) for name in ("psi", "u", "v", "r"))
    s = sp.Function("s")(t)
    north, east = sp.Function("north")(t), sp.Function("east")(t)
    x_d, y_d, psi_d, speed = (sp.Function(name) for name in ("x_d", "y_d", "psi_d", "v_s"))
    R = sp.Matrix([[sp.cos(psi), -sp.sin(psi), 0], [sp.sin(psi), sp.cos(psi), 0], [0, 0, 1]])
    S = sp.Matrix([[0, -1, 0], [1, 0, 0], [0, 0, 0]])
    K = sp.diag(k, k, k_psi)
    nu, v_s = sp.Matrix([u, v, r]), speed(s, t)
    eta_d = sp.Matrix([x_d(s), y_d(s), psi_d(s)])
    by_s = eta_d.diff(s)
    z_1 = R.T * (sp.Matrix([north, east, psi]) - eta_d)
    alpha = -K * z_1 + R.T * by_s * v_s
    motion = R * nu
    s_rate = v_s + w
    rates = {north.diff(t): motion[0], east.diff(t): motion[1], psi.diff(t): r, s.diff(t): s_rate}
    whole = alpha.diff(t).subs(rates)
    tau = sp.Symbol("tau")
    v_by_t = speed(s, tau).diff(tau).subs(tau, t)
    v_by_s = v_s.diff(s)
    sigma = K * (r * S * z_1 - nu) - r * S * R.T * by_s * v_s + R.T * by_s * v_by_t
    slope = K * R.T * by_s + R.T * eta_d.diff(s, 2) * v_s + R.T * by_s * v_by_s
    numbers = {
        x_d: sp.Lambda(w, 3 * sp.cos(w)),
        y_d: sp.Lambda(w, 2 * sp.sin(w)),
        psi_d: sp.Lambda(w, w + w**2 / 7),
        speed: sp.Lambda((w, tau), (1 + tau / 5) / (2 + sp.sin(w))),
    }
    values = {psi: 0.7, u: 0.3, v: -0.1, r: 0.2, north: 2.0, east: -1.0, s: 0.4, t: 1.3}
    for row in whole - sigma - slope * s_rate:
        for name, law in numbers.items():
            row = row.replace(name, law)
        number = row.doit().subs(values | {w: 0.35, k: 0.2, k_psi: 0.3}).evalf()
        assert abs(number) < 1e-12


@pytest.mark.parametrize(
    ("period", "delay", "update"),
    [(0.06, 0.0, "gradient"), (0.14, 0.1, "filtered"), (0.2, 0.06, "gradient")],
)
def test_a_sampled_delayed_loop_at_its_own_path_time_is_that_of_plain_python(period, delay, update):
    """An own RK4 with matrices: sigma and alpha^s, zero-order hold, delay and a learnt load."""
    law = (
        f"kind: maneuvering, {GAINS}, mu: 0.4, lag: 0.7, gamma: 0.5, speed: 0.13, update: {update}"
    )
    log = marched(
        BOAT + ELLIPSE + f"controller: {{{law}}}\n",
        AWAY,
        "disturbance={kind: step, b_u: 0.2, b_v: -0.1, b_r: 0.05}",
        f"control.period={period}",
        f"actuator.command.delay={delay}",
    )
    h, steps, every, late = 0.02, 600, round(period / 0.02), round(delay / 0.02)
    S = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]])
    K, load = np.diag([0.2, 0.2, 0.3]), np.array([0.2, -0.1, 0.05])

    def asked(s):
        """Demand, and the rates of the law's memory, at a sample."""
        eta, nu, when, extra, learnt = s[:3], s[3:6], s[6], s[7], s[8:11]
        c, n, r = math.cos(eta[2]), math.sin(eta[2]), nu[2]
        R = np.array([[c, -n, 0], [n, c, 0], [0, 0, 1]])
        place, first, second = curve(when)
        off = eta - place
        off[2] = math.remainder(off[2], 2 * math.pi)
        z_1 = R.T @ off
        pace = math.hypot(*first[:2])
        v_s, v_by_s = 0.13 / pace, -0.13 * (first[:2] @ second[:2]) / pace**3
        gradient = 0.4 * (first @ off) / pace
        w = gradient if update == "gradient" else extra
        z_2 = nu - R.T @ first * v_s + K @ z_1
        sigma = K @ (r * S @ z_1 - nu) - r * S @ R.T @ first * v_s
        by_s = K @ R.T @ first + R.T @ second * v_s + R.T @ first * v_by_s
        tau = M @ (sigma + by_s * (v_s + w) - 0.6 * z_2) - forces(nu) - z_1 - R.T @ learnt
        return tau, (v_s, gradient, 0.5 * R @ z_2, R)

    def rate(s, tau):
        u, v, r = s[3:6]
        c, n = math.cos(s[2]), math.sin(s[2])
        lacking = (tau - wanted) / (0.6 * np.diag(M))
        v_s, gradient, learns, turn = held
        w = gradient if update == "gradient" else s[7]
        memory = [v_s + w, (gradient - s[7]) / 0.7, *(learns - 0.5 * (turn @ lacking))]
        motion = np.linalg.solve(M, tau + load + forces(s[3:6]))
        return np.concatenate([[c * u - n * v, n * u + c * v, r], motion, memory])

    s, demands = np.array([3.5, -0.7, 0.9, 0.1, -0.05, 0.1, *[0.0] * 5]), []
    names = (
        "x",
        "y",
        "psi",
        "u",
        "v",
        "r",
        "path_time",
        "path_extra",
        "load_x",
        "load_y",
        "load_n",
    )
    for i in range(steps + 1):
        assert [*s] == pytest.approx([log[name][i] for name in names], abs=1e-10), i
        if i % every == 0:
            wanted, held = asked(s)
        demands.append(wanted)
        tau = demands[i - late] if i >= late else np.zeros(3)
        k1 = rate(s, tau)
        k2 = rate(s + h / 2 * k1, tau)
        k3 = rate(s + h / 2 * k2, tau)
        s = s + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(s + h * k3, tau))


@pytest.mark.parametrize("period", [0.0, 0.1, 0.2])
def test_a_task_that_is_turned_is_done_alike(period):
    """North has no part in the equations, at 10 and 5 Hz with a delay either."""
    logs = []
    for turn in (0.0, 2.1):
        c, n = math.cos(turn), math.sin(turn)
        logs.append(
            marched(
                BOAT + ELLIPSE + LAW.replace(GAINS, f"{GAINS}, gamma: 0.3, speed: 0.1"),
                f"path.angle={turn}",
                f"start={{x: {3.5 * c + 0.7 * n}, y: {3.5 * n - 0.7 * c}, psi: {0.9 + turn}}}",
                f"disturbance={{kind: current, speed: 0.05, direction: {0.6 + turn}}}",
                *([f"control.period={period}", "actuator.command={delay: 0.1}"] if period else []),
            )
        )
    names = ("z_1u", "z_1v", "psi_t", "path_time", "tau_u_cmd", "tau_v_cmd", "tau_r_cmd")
    for name in names:
        np.testing.assert_allclose(logs[1][name], logs[0][name], rtol=0.0, atol=1e-10)


def test_the_path_waits_for_a_vessel_that_is_late_but_not_for_tracking():
    """From rest 90 degrees of the ellipse behind, tracking runs away and the gradient does not."""
    behind = f"start={{x: 0.0, y: {-B}, psi: 0.0}}"
    lead = {}
    for update in ("tracking", "gradient"):
        law = LAW.replace(GAINS, f"{GAINS}, speed: 0.1, update: {update}")
        log = marched(BOAT + ELLIPSE + law, behind, "simulation.duration=60")
        lead[update] = log["path_time"][-1]
        assert log["z_e"][-1] < 0.05
    assert lead["gradient"] < lead["tracking"] - 5.0


def test_a_steady_load_is_learnt_on_the_way_and_leaves_an_error_without():
    """A load that stays in the earth's frame: a current does not, as the vessel turns in it."""
    step = "disturbance={kind: step, b_u: 0.3, b_v: -0.2}"  # of the hull, which keeps its heading
    stay = "path: {kind: hold, psi: 0.0}\n"
    left = {}
    for gamma in (0.0, 1.0):
        law = LAW.replace(GAINS, f"{GAINS}, gamma: {gamma}")
        log = marched(BOAT + stay + law, step, "simulation.duration=500", "start.psi=0.0")
        left[gamma] = log["z_e"][-1]
        if gamma:
            assert (log["load_x"][-1], log["load_y"][-1]) == pytest.approx((0.3, -0.2), abs=1e-6)
    # At rest M k_d K_p z_1 + z_1 = b, to the last digit of sway and yaw together.
    stiff = M @ np.diag([0.2, 0.2, 0.3]) * 0.6 + np.eye(3)
    off = np.linalg.solve(stiff, [0.3, -0.2, 0.0])
    assert left[0.0] == pytest.approx(math.hypot(*off[:2]), rel=1e-6)
    assert left[1.0] < 1e-6


def test_what_is_learnt_does_not_grow_behind_a_limit_on_the_way():
    gust = "disturbance={kind: step, b_v: 1.0}"
    boat = BOAT.replace("ideal_full", "saturated_full, sway_limit: 0.5")
    law = LAW.replace(GAINS, f"{GAINS}, gamma: 1.0")
    log = marched(
        boat + "path: {kind: hold}\n" + law, gust, "start.psi=0.0", "simulation.duration=60"
    )
    assert log["z_e"][-1] > 1.0
    assert abs(log["load_y"][-1]) < 5.0
    free = marched(
        boat.replace("sway_limit: 0.5", "sway_limit: 5.0") + "path: {kind: hold}\n" + law,
        gust,
        "start.psi=0.0",
        "simulation.duration=200",
    )
    assert free["load_y"][-1] == pytest.approx(1.0, abs=0.01)


def test_a_new_speed_is_taken_up_along_the_path_alone():
    law = LAW.replace(GAINS, f"{GAINS}, speed: 0.1, speed_after: 0.2, speed_change: 30")
    log = marched(BOAT + ELLIPSE + law, on_path(0.1), "simulation.duration=90")
    assert np.hypot(log["u"], log["v"])[-1] == pytest.approx(0.2, rel=1e-4)
    assert np.abs(log["across"]).max() < 1e-5
    assert log["z_e"].max() < 1e-5


def test_poses_are_reached_by_their_timetable_where_no_speed_is_asked_for():
    log = marched(BOAT + POSES + LAW)
    assert log["z_e"].max() < 1e-9
    np.testing.assert_allclose(log["path_time"], log["time"], atol=1e-9)


class Forgetful(Maneuvering):
    """Keeps a time, and has nowhere to keep it."""

    def slots(self):
        return ()


def test_a_law_that_keeps_a_path_time_without_a_memory_is_refused():
    path = Ellipse(length=6.0, breadth=4.0, period=60.0)
    loop = corrected(controller=Forgetful(), actuator=IdealFull(), path=path)
    with pytest.raises(LawError, match="has no memory for it; give slots"):
        run(loop, 1.0)


def test_a_path_without_a_timetable_is_refused_and_margins_are_too():
    legs = "path: {kind: legs, points: [[0, 0], [5, 5]]}\n"
    with pytest.raises(ScenarioError, match="maneuvering wants a heading"):
        marched(BOAT + legs + LAW)
    single = loaded_pose(BOAT + ELLIPSE + LAW)
    single.ready()
    plan = single.plan()
    with pytest.raises(LawError, match="its target moves as the law wants"):
        loop_margins(plan.loop, plan.grid)


@pytest.mark.parametrize(
    ("law", "says"),
    [
        ("speed: 0.1", "has a speed of its own, and poses stands still at its poses; leave"),
        ("speed_after: 0.2, speed_change: 10", "and no speed before; give `speed`, too"),
    ],
)
def test_a_speed_along_a_path_that_rests_or_a_later_one_alone_is_refused(law, says):
    with pytest.raises(ScenarioError, match=says):
        loaded_pose(BOAT + POSES + LAW.replace("kind: maneuvering", f"kind: maneuvering, {law}"))
