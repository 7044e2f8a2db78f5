"""Laws for poses: proofs along runs, a plain-Python loop, a program of others, mirror images."""

import math

import numpy as np
import pytest
from conftest import REQUIRED, corrected, run, vessel
from pose_samples import BOAT, HELD, POSES, marched, quintic
from scipy.optimize import fsolve

from podusv_cli.components.actuators.saturated_full import SaturatedFull
from podusv_cli.components.controllers.pose_backstepping import PoseBackstepping
from podusv_cli.components.controllers.pose_pid import PosePid
from podusv_cli.components.controllers.pose_sliding_mode import PoseSlidingMode
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.paths.poses import Poses
from podusv_cli.core.kernel import bundle, call
from podusv_cli.core.signal import TARGET_SIZE

HULL = vessel("cybership2")
M = np.array([[HULL.m11, 0, 0], [0, HULL.m22, HULL.m23], [0, HULL.m32, HULL.m33]])
AWAY = "start={x: 1.0, y: -0.7, psi: -0.6, u: 0.1, v: -0.05, r: 0.1}"


def test_backstepping_stays_at_rounding_level_on_a_path_that_it_begins_on():
    """From on the path z_1 = z_2 = 0 for ever: M alpha' - f(nu) is what the motion takes."""
    log = marched(BOAT + POSES + HELD)
    assert log["z_e"].max() < 1e-9
    assert np.abs(log["psi"] - log["heading_d"]).max() < 1e-9
    assert np.abs(log["tau_v"]).max() > 0.05  # the motion does need sway
    np.testing.assert_array_equal(log["tau_v"], log["tau_v_cmd"])


def test_backstepping_goes_round_an_ellipse_that_it_begins_on():
    """Three rounds of pi a b: a heading that grows by whole turns, with Coriolis forces."""
    rate, a, b = 2 * math.pi / 60.0, 3.0, 2.0
    path = "path: {kind: ellipse, length: 6.0, breadth: 4.0, period: 60.0}\n"
    start = f"start={{x: 3.0, psi: {math.pi / 2!r}, u: {b * rate!r}, r: {rate * a / b!r}}}"
    log = marched(BOAT + path + HELD, start, "simulation.duration=180")
    assert log["z_e"].max() < 1e-6
    assert log["psi"][-1] == pytest.approx(math.pi / 2 + 6 * math.pi, abs=1e-6)
    x, y = log["x"][:3001], log["y"][:3001]
    area = 0.5 * np.abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
    assert area == pytest.approx(math.pi * a * b, rel=1e-5)


def test_a_lyapunov_function_falls_as_the_proof_says():
    """V = |z_1|^2 / 2 + z_2' M z_2 / 2 falls by z_1' K_p z_1 + z_2' K_d M z_2, off the path.

    With gains 0.2, 0.3, 0.6 that is between 2 0.2 V and 2 0.6 V.
    """
    step = 0.002
    over = (f"simulation.step={step}", "simulation.duration=6")
    log = marched(BOAT + POSES + HELD, AWAY, *over)
    a, b, psi_t = log["z_1u"], log["z_1v"], log["psi_t"]
    c, s = np.cos(log["psi"]), np.sin(log["psi"])
    x_t, y_t = np.gradient(log["x_d"], step), np.gradient(log["y_d"], step)
    alpha = np.stack([c * x_t + s * y_t - 0.2 * a, c * y_t - s * x_t - 0.2 * b])
    z_2 = np.stack([log["u"], log["v"], log["r"]]) - np.stack(
        [*alpha, log["heading_d_dot"] - 0.3 * psi_t]
    )
    momentum = M @ z_2
    V = 0.5 * (a**2 + b**2 + psi_t**2) + 0.5 * (z_2 * momentum).sum(0)
    fall = 0.2 * (a**2 + b**2) + 0.3 * psi_t**2 + 0.6 * (z_2 * momentum).sum(0)
    inner = slice(5, -5)
    np.testing.assert_allclose(np.gradient(V, step)[inner], -fall[inner], rtol=1e-4, atol=1e-7)
    assert (np.diff(V) < 0.0).all()
    least, most = (V[0] * np.exp(-2.0 * gain * log["time"]) for gain in (0.6, 0.2))
    assert (most * (1 + 1e-6) >= V).all()
    assert (least * (1 - 1e-6) <= V).all()


@pytest.mark.parametrize(("period", "delay"), [(0.06, 0.0), (0.14, 0.1), (0.2, 0.06)])
def test_a_sampled_delayed_loop_is_that_of_plain_python(period, delay):
    """An own RK4 with its own hull, quintic, PID, zero-order hold and delay.

    Between samples the integrals go on with the last sample's error, less what the loads that act
    lack of the demand: for the first seconds of a delay all of it.
    """
    log = marched(
        BOAT + POSES + "controller: {kind: pose_pid, w_x: 0.4, w_y: 0.5, w_r: 0.9}\n",
        "start={x: 0.5, y: -0.4, psi: -0.3}",
        f"control.period={period}",
        f"actuator.command.delay={delay}",
    )
    h, steps, every, late = 0.02, 600, round(period / 0.02), round(delay / 0.02)
    p = HULL
    D = -np.array([[p.X_u, 0, 0], [0, p.Y_v, p.Y_r], [0, p.N_v, p.N_r]])
    W = np.diag([0.4, 0.5, 0.9])

    def rate(s, tau):
        """Of the state and the three integrals, with the sample held."""
        u, v, r = s[3:6]
        f = np.array(
            [
                (p.m22 * v + p.m23 * r) * r + (p.X_u + p.X_uu * abs(u) + p.X_uuu * u * u) * u,
                -p.m11 * u * r
                + (p.Y_v + p.Y_vv * abs(v) + p.Y_rv * abs(r)) * v
                + (p.Y_r + p.Y_vr * abs(v) + p.Y_rr * abs(r)) * r,
                p.m11 * u * v
                - (p.m22 * v + p.m23 * r) * u
                + (p.N_v + p.N_vv * abs(v) + p.N_rv * abs(r)) * v
                + (p.N_r + p.N_vr * abs(v) + p.N_rr * abs(r)) * r,
            ]
        )
        c, sn = math.cos(s[2]), math.sin(s[2])
        moved = [c * u - sn * v, sn * u + c * v, r]
        learnt = error - np.linalg.solve(K_p, turned.T @ (tau - asked))
        return np.concatenate([moved, np.linalg.solve(M, tau + f), learnt])

    s, demand = np.array([0.5, -0.4, -0.3, *[0.0] * 6]), []
    K_p = np.diag(np.diag(M)) @ W @ W
    for k in range(steps + 1):
        here = [log[name][k] for name in ("x", "y", "psi", "int_x", "int_y", "int_psi")]
        assert [*s[:3], *s[6:]] == pytest.approx(here, abs=1e-10), k
        if k % every == 0:
            place, speed, growth = quintic(k * h, (0, 0, 0.2), (2, 1, 1.0))
            c, sn = math.cos(s[2]), math.sin(s[2])
            turned = np.array([[c, sn, 0], [-sn, c, 0], [0, 0, 1]])
            error, nu_d = s[:3] - place, turned @ speed
            asked = (
                -turned @ (K_p @ error + K_p @ W @ s[6:] / 10)
                - 2 * np.diag(np.diag(M)) @ W @ (s[3:6] - nu_d)
                + M @ (turned @ growth)
                + D @ nu_d
            )
        demand.append(asked)
        tau = demand[k - late] if k >= late else np.zeros(3)
        k1 = rate(s, tau)
        k2 = rate(s + h / 2 * k1, tau)
        k3 = rate(s + h / 2 * k2, tau)
        k4 = rate(s + h * k3, tau)
        s = s + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


# A supply vessel of 76.2 m as MSS has it, in t, m, s: inertia and damping in its Bis system.
LENGTH, MASS, GRAVITY = 76.2, 6000.0, 9.81
BIS = np.diag([1.0, 1.0, LENGTH])
PACE = math.sqrt(LENGTH / GRAVITY)


def of_bis(inertia, damping):
    """Dimensional matrices of a hull from those of the Bis system."""
    return MASS * BIS @ inertia @ BIS, MASS / PACE * BIS @ damping @ BIS


def test_the_pid_gives_the_supply_vessel_s_numbers():
    """Fossen's supply vessel in a current: overshoots, errors and peaks of a program of others.

    A step of (5 m, 5 m, 50 deg) through a setpoint filter of 10 s, current 0.5 m/s to 20 deg.
    """
    M, D = of_bis(
        np.array([[1.1274, 0, 0], [0, 1.8902, -0.0744], [0, -0.0744, 0.1278]]),
        np.array([[0.0358, 0, 0], [0, 0.1183, -0.0124], [0, -0.0041, 0.0308]]),
    )
    np.testing.assert_allclose(
        [M[0, 0], M[1, 1], M[1, 2], M[2, 2]], [6764.4, 11341.2, -34015.7, 4452378.0], rtol=2e-5
    )
    law = PosePid(w_x=0.1, w_y=0.1, w_r=0.2)
    linear = {"X_u": -D[0, 0], "Y_v": -D[1, 1], "Y_r": -D[1, 2], "N_v": -D[2, 1], "N_r": -D[2, 2]}
    inertia = {"m11": M[0, 0], "m22": M[1, 1], "m23": M[1, 2], "m32": M[2, 1], "m33": M[2, 2]}
    k = bundle(law.constants() | inertia | linear)
    goal, current, to = np.array([5.0, 5.0, math.radians(50.0)]), 0.5, math.radians(20.0)

    def rates(s, log):
        eta, nu, memory, wanted = s[:3], s[3:6], s[6:9], s[9:12]
        target = np.zeros(TARGET_SIZE)
        target[:2], target[7] = wanted[:2], wanted[2]
        tau, rate, signals = np.zeros(3), np.zeros(3), np.zeros(3)
        call(
            law.law,
            t=0.0,
            x=s[:6],
            memory=memory,
            target=target,
            k=k,
            tau=tau,
            rate=rate,
            signals=signals,
        )
        loads = tau[[0, 2, 1]]
        if log is not None:
            log.append(loads)
        c, sn = math.cos(eta[2]), math.sin(eta[2])
        flow = current * np.array([math.cos(to - eta[2]), math.sin(to - eta[2]), 0.0])
        moved = [c * nu[0] - sn * nu[1], sn * nu[0] + c * nu[1], nu[2]]
        grown = np.linalg.solve(M, loads - D @ (nu - flow))
        return np.concatenate([moved, grown, rate, (goal - wanted) / 10.0])

    s, h, rows, loads = np.zeros(12), 0.05, [], []
    for _ in range(10_001):
        rows.append(s)
        k1 = rates(s, loads)
        k2 = rates(s + h / 2 * k1, None)
        k3 = rates(s + h / 2 * k2, None)
        s = s + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(s + h * k3, None))
    states, loads = np.array(rows), np.abs(np.array(loads))
    beyond = states[:, :3].max(0) - goal
    assert beyond[:2] == pytest.approx([1.4243, 0.5471], abs=1e-4)
    assert math.degrees(beyond[2]) == pytest.approx(6.4168, abs=1e-4)
    assert np.abs(goal - states[4000, :3])[:2] == pytest.approx([0.493, 0.026], abs=1e-3)
    assert loads.max(0) == pytest.approx([77.6, 101.7, 25080.0], rel=1e-3)


def shown_pose(log):
    """Errors (3, n) in the earth's frame, and velocities (3, n)."""
    e = np.stack([log["x"] - log["x_d"], log["y"] - log["y_d"], log["psi"] - log["heading_d"]])
    return e, np.stack([log["u"], log["v"], log["r"]])


def test_what_pid_gives_off_a_pose_is_lost_to_damping_alone():
    """V = nu' M nu / 2 + e' K_p e / 2 falls by nu' (K_d + D(nu)) nu, without the integral.

    Coriolis forces do no work; the power of damping is that of f at the same motion.
    """
    step, w = 0.002, np.array([0.4, 0.5, 0.9])
    law = "controller: {kind: pose_pid, w_x: 0.4, w_y: 0.5, w_r: 0.9, integral: 0.0}\n"
    stay = "path: {kind: poses, poses: [[0, 0, 0.2]]}\n"
    over = (f"simulation.step={step}", "simulation.duration=20")
    log = marched(BOAT + stay + law, AWAY, *over)
    e, nu = shown_pose(log)
    u, v, r = nu
    d = np.diag(M)
    V = 0.5 * (nu * (M @ nu)).sum(0) + 0.5 * ((d * w * w)[:, None] * e * e).sum(0)
    p = HULL
    lost = -(p.X_u + p.X_uu * abs(u) + p.X_uuu * u * u) * u * u
    lost -= (p.Y_v + p.Y_vv * abs(v) + p.Y_rv * abs(r)) * v * v
    lost -= (p.Y_r + p.Y_vr * abs(v) + p.Y_rr * abs(r)) * r * v
    lost -= (p.N_v + p.N_vv * abs(v) + p.N_rv * abs(r)) * v * r
    lost -= (p.N_r + p.N_vr * abs(v) + p.N_rr * abs(r)) * r * r
    fall = ((2.0 * d * w)[:, None] * nu * nu).sum(0) + lost
    inner = slice(5, -5)
    np.testing.assert_allclose(np.gradient(V, step)[inner], -fall[inner], rtol=1e-4, atol=1e-6)
    assert (np.diff(V) <= 0.0).all()
    assert V[-1] < 1e-3 * V[0]


def test_the_integral_of_backstepping_adds_what_it_stores_to_the_lyapunov_function():
    """V + k_i |zeta|^2 / 2 falls by z_1' K_p z_1 + z_2' K_d M z_2, whatever k_i is."""
    step, k_i = 0.002, 0.3
    law = f"controller: {{kind: pose_backstepping, k_p: 0.2, k_psi: 0.2, k_d: 0.6, k_i: {k_i}}}\n"
    over = (f"simulation.step={step}", "simulation.duration=6")
    log = marched(BOAT + POSES + law, AWAY, *over)
    z_1 = np.stack([log["z_1u"], log["z_1v"], log["psi_t"]])
    zeta = np.stack([log["zeta_u"], log["zeta_v"], log["zeta_r"]])
    c, s = np.cos(log["psi"]), np.sin(log["psi"])
    x_t, y_t = np.gradient(log["x_d"], step), np.gradient(log["y_d"], step)
    wanted = np.stack([c * x_t + s * y_t, c * y_t - s * x_t, log["heading_d_dot"]])
    z_2 = np.stack([log["u"], log["v"], log["r"]]) - (wanted - 0.2 * z_1 - k_i * zeta)
    V = 0.5 * (z_1**2 + k_i * zeta**2 + z_2 * (M @ z_2)).sum(0)
    fall = (0.2 * z_1**2 + 0.6 * z_2 * (M @ z_2)).sum(0)
    inner = slice(5, -5)
    # Where a velocity changes its sign, |v| v has a corner, and a central difference errs with it.
    np.testing.assert_allclose(np.gradient(V, step)[inner], -fall[inner], rtol=1e-4, atol=1e-4)


LEARNING = {
    "pose_pid": "controller: {kind: pose_pid, w_x: 0.6, w_y: 0.6, w_r: 0.6}\n",
    "pose_backstepping": "controller: {kind: pose_backstepping, k_p: 0.3, k_psi: 0.3, k_i: 0.1}\n",
}
LOAD = "disturbance: {kind: current, speed: 0.1, direction: 2.0}\n"


@pytest.mark.parametrize("law", LEARNING)
def test_a_constant_current_leaves_no_error_at_a_pose(law):
    """With the integral; without it an error that the load over the stiffness gives."""
    stay = "path: {kind: poses, poses: [[0, 0, 0.2]]}\n"
    sea = BOAT.replace("disturbance: {kind: none}\n", LOAD)
    over = ("simulation.duration=400", "simulation.step=0.05")
    log = marched(sea + stay + LEARNING[law], *over)
    assert log["z_e"].max() > 0.01
    assert log["z_e"][-1] < 1e-6
    none = {"pose_pid": "controller.integral=0.0", "pose_backstepping": "controller.k_i=0.0"}[law]
    assert marched(sea + stay + LEARNING[law], *over, none)["z_e"][-1] > 1e-3


@pytest.mark.parametrize("law", LEARNING)
@pytest.mark.parametrize(("load", "limit"), [("b_u", "surge_limit"), ("b_v", "sway_limit")])
def test_what_is_learnt_does_not_grow_behind_a_limit_that_the_load_exceeds(law, load, limit):
    """Half a newton does not hold the hull in 1 N: the error times the time is wound up."""
    stay = "path: {kind: poses, poses: [[0, 0, 0.2]]}\n"
    gust = f"disturbance: {{kind: step, {load}: 1.0}}\n"
    boat = BOAT.replace("disturbance: {kind: none}\n", gust).replace(
        "ideal_full", f"saturated_full, {limit}: 0.5"
    )
    log = marched(boat + stay + LEARNING[law], "simulation.duration=300", "simulation.step=0.05")
    learnt = {"pose_pid": ("int_x", "int_y"), "pose_backstepping": ("zeta_u", "zeta_v")}[law]
    wound_up = 0.5 * log["z_e"][-1] * 300.0
    assert np.hypot(*(log[name] for name in learnt)).max() < 0.2 * wound_up


SLIDING = (
    "controller: {kind: pose_sliding_mode, k_p: 0.3, k_psi: 0.4, k_d: 0.5, load_u: 0.6, "
    "load_v: 0.8, load_r: 0.4, phi: 0.03, phi_r: 0.04}\n"
)
STAY = "path: {kind: hold, psi: 0.2}\n"


def test_a_sliding_mode_leaves_the_error_that_its_layer_gives():
    """At rest K tanh(s/phi) + k_d M s = b with s = K_p z_1, solved by bisection with scipy."""
    load = "disturbance={kind: step, b_u: 0.35, b_v: -0.6, b_r: 0.2}"
    log = marched(BOAT + STAY + SLIDING, load, "simulation.duration=120")
    bounds, layers = np.array([0.6, 0.8, 0.4]), np.array([0.03, 0.03, 0.04])
    loads, gains = np.array([0.35, -0.6, 0.2]), np.array([0.3, 0.3, 0.4])
    s = fsolve(lambda s: bounds * np.tanh(s / layers) + 0.5 * M @ s - loads, loads / 40.0)
    found = [log[name][-1] for name in ("z_1u", "z_1v", "psi_t")]
    np.testing.assert_allclose(found, s / gains, rtol=1e-6)
    np.testing.assert_allclose([log[name][-1] for name in ("s_u", "s_v", "s_r")], s, rtol=1e-6)


def test_the_missing_velocity_falls_as_the_proof_says_under_loads_within_the_bounds():
    """V = s' M s / 2 falls by k_d s' M s + sum K |s tanh(s/phi)| - s' b, off the path too."""
    step, load = 0.002, np.array([0.3, -0.4, 0.1])
    sea = "disturbance={kind: step, b_u: 0.3, b_v: -0.4, b_r: 0.1}"
    over = (f"simulation.step={step}", "simulation.duration=4")
    log = marched(BOAT + POSES + SLIDING, AWAY, sea, *over)
    s = np.stack([log["s_u"], log["s_v"], log["s_r"]])
    bounds = np.array([0.6, 0.8, 0.4])[:, None] * np.tanh(s / np.array([0.03, 0.03, 0.04])[:, None])
    V = 0.5 * (s * (M @ s)).sum(0)
    fall = (0.5 * s * (M @ s) + s * bounds - s * load[:, None]).sum(0)
    inner = slice(5, -5)
    np.testing.assert_allclose(np.gradient(V, step)[inner], -fall[inner], rtol=1e-3, atol=1e-5)
    # So V' <= -2 k_d V + c, where c is the most that the loads can win within the layers.
    width = np.linspace(0.0, 0.2, 20_001)
    c = sum(
        (abs(b) * width - K * width * np.tanh(width / phi)).max()
        for b, K, phi in zip(load, (0.6, 0.8, 0.4), (0.03, 0.03, 0.04), strict=True)
    )
    assert (V[0] * np.exp(-log["time"]) + c >= V).all()
    assert c < 0.01 * V[0]


@pytest.mark.parametrize("kind", [PosePid, PoseBackstepping, PoseSlidingMode])
def test_a_run_to_port_is_the_mirror_image_of_one_to_starboard_for_poses(kind):
    poses = np.array(REQUIRED["poses"]["poses"])
    limits = SaturatedFull(surge_limit=50.0, yaw_limit=5.0, sway_limit=50.0)
    runs = []
    for side in (1.0, -1.0):
        flip = np.array([1.0, side, side])
        path = Poses(poses=tuple(map(tuple, poses * flip)))
        start = (-3.0, side * 2.0, side * 0.3, 0.2, side * 0.1, side * 0.05)
        loop = corrected(
            controller=kind(), actuator=limits, path=path, start=start, disturbance=Calm()
        )
        runs.append(run(loop, 10.0))
    for name in ("x", "y", "psi", "u", "v", "r", "tau_u", "tau_v", "tau_r", "heading_d"):
        side = 1.0 if name in ("x", "u", "tau_u") else -1.0
        np.testing.assert_allclose(runs[0][name], side * runs[1][name], atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    "law",
    [
        "{kind: pose_backstepping, k_i: 0.02}",
        "{kind: pose_sliding_mode}",
        # K_p is of north and east, as in its source.
        pytest.param("{kind: pose_pid}", marks=pytest.mark.xfail(strict=True)),
    ],
)
def test_a_task_that_is_turned_is_done_alike(law):
    """North has no part in the equations: errors and demands, with a sampled and delayed law."""
    logs = []
    for turn in (0.0, 2.1):
        c, s = math.cos(turn), math.sin(turn)
        poses = [
            [c * x - s * y, s * x + c * y, psi + turn] for x, y, psi in ((0, 0, 0.2), (2, 1, 1))
        ]
        logs.append(
            marched(
                BOAT + POSES + f"controller: {law}\n",
                f"path.poses={poses}",
                f"start={{x: {0.3 * c}, y: {0.3 * s}, psi: {0.3 + turn}}}",
                f"disturbance={{kind: current, speed: 0.05, direction: {0.6 + turn}}}",
                "control.period=0.14",
                "actuator.command={delay: 0.1}",
                "simulation.duration=12.04",
            )
        )
    for name in ("z_1u", "z_1v", "psi_t", "tau_u_cmd", "tau_v_cmd", "tau_r_cmd"):
        np.testing.assert_allclose(logs[1][name], logs[0][name], rtol=0.0, atol=1e-11)
