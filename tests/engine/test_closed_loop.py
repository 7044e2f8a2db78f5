"""The closed loop as mathematics: order of RK4, an independent integrator, symmetry, readings."""

from typing import Any

import numpy as np
import pytest
from conftest import GENTLE, PAPER, SMOOTH_START, corrected, example, kinds, last_state, run
from loop_samples import order
from scipy.integrate import solve_ivp

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.core.kernel import Vector
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.step.grid import TimeGrid

# A trial takes samples, so it is no differential equation; a schedule does not look at the target.
# Laws of poses have their mirror image in controllers/test_pose_laws.py.
CONTINUOUS = {n: k for n, k in kinds("controllers").items() if not example(k).takes_samples()}
MIRRORED = {
    name: kind
    for name, kind in kinds("controllers").items()
    if name != "schedule" and not example(kind).wants_heading()
}
# Without the kink at the edge of the boundary layer, which no order survives.
WITHIN_LAYER = {"sliding_mode": {"phi": 10.0}}
FAST = dict.fromkeys(("adaptive_neural", "dsc", "full_backstepping", "pid"), 0.002)  # s


def smooth(law: Any) -> ClosedLoop:
    return corrected(controller=law, path=Line(), start=SMOOTH_START)


def end(loop: ClosedLoop, step: float, **options: Any) -> Vector:
    return last_state(run(loop, 2.0, step, log_every=round(2.0 / step), **options), loop)


@pytest.mark.parametrize("kind", CONTINUOUS.values(), ids=CONTINUOUS)
def test_the_loop_is_integrated_at_fourth_order(kind):
    # The weights' loop turns at up to 90 rad/s: larger steps are not in the asymptotic range. At
    # such steps errors of the other laws are rounding. The vessel `paper` has no |v| v, which has
    # no second derivative where sway changes its sign.
    name = kind.model_fields["kind"].default
    law, step = example(kind, **WITHIN_LAYER.get(name, {})), FAST.get(name, 0.04)
    path = {} if law.wants_heading() else {"path": Line()}
    loop = corrected(controller=law, vessel=PAPER, start=SMOOTH_START, **path)
    ends = [end(loop, step / 2**i) for i in range(4)]
    assert order(ends) == pytest.approx(4.0, abs=0.2)


def test_a_sampled_law_is_integrated_at_fourth_order_to_another_solution():
    loop, steps = smooth(GENTLE), [0.02, 0.01, 0.005, 0.0025]
    sampled = [end(loop, h, hold_every=round(0.04 / h)) for h in steps]
    assert order(sampled) == pytest.approx(4.0, abs=0.2)
    continuous = [end(loop, h) for h in steps]
    assert (
        abs(sampled[-1] - sampled[-2]).max() < 1e-6 < 1e-2 < abs(sampled[-1] - continuous[-1]).max()
    )


def test_a_sampled_law_approaches_the_continuous_one_at_first_order():
    loop, h = smooth(GENTLE), 0.00125
    continuous = end(loop, h)
    gaps = [abs(end(loop, h, hold_every=n) - continuous).max() for n in (16, 8, 4)]
    assert np.log2(gaps[0] / gaps[2]) / 2 == pytest.approx(1.0, abs=0.1)


def right_hand_side(t: float, s: Vector) -> Vector:
    """The corrected loop on the straight part of (53), written from the paper once more.

    s: x, y, psi, u, v, r, b_hat (2), W_hat (2 x 27), beta (2); coupling +1, standoff 0.5 m.
    """
    psi, nu, b_hat, W_hat, beta = s[2], s[3:6], s[6:8], s[8:62].reshape(2, 27), s[62:]
    u, v, r = nu
    line = 0.5 * t - s[0] - 1j * s[1]
    z, psi_d = abs(line), np.angle(line)
    psi_e = np.angle(line * np.exp(-1j * psi))
    sine, cosine = np.sin(psi_e), np.cos(psi_e)
    alpha_u = (0.1 * (z - 0.5) + 0.5 * np.cos(psi_d) - v * sine) / cosine
    psi_d_dot = (-0.5 * np.sin(psi_d) + u * sine - v * cosine) / z
    alpha = np.array([alpha_u, psi_d_dot + 0.1 * psi_e])
    beta_dot = (5 + abs(alpha)) * (alpha - beta)
    axes = np.linspace(-1, 2.5, 3), np.linspace(-1, 1, 3), np.linspace(-1, 1, 3)
    centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(27, 3)
    Phi = np.exp(-0.5 * (((nu - centers) / (0.7 * np.array([1.75, 1, 1]))) ** 2).sum(axis=1))
    m, error = np.array([25.8, 2.76]), np.array([u, r]) - beta
    tau = -np.array([4, 40]) * error - m * (W_hat @ Phi) - b_hat * 2.5 * error + m * beta_dot
    tau += [(z - 0.5) * cosine, psi_e]
    b = 0.5 + np.array(
        [
            0.1 * np.sin(0.2 * t) + 0.3 * np.cos(0.5 * t),
            0.2 * np.sin(0.2 * t) + 0.1 * np.cos(0.4 * t),
            0.1 * np.sin(0.1 * t) + 0.1 * np.cos(0.2 * t),
        ]
    )
    nu_dot = np.array(
        [
            33.8 * v * r - 0.72 * u - 1.32742 * abs(u) * u - 5.86643 * u**3 + tau[0] + b[0],
            -25.8 * u * r - 0.8896 * v - 36.47287 * abs(v) * v + b[1],
            (25.8 - 33.8) * u * v - 1.9 * r - 0.75 * abs(r) * r + tau[1] + b[2],
        ]
    ) / [25.8, 33.8, 2.76]
    over_ground = (u + 1j * v) * np.exp(1j * psi)
    b_hat_dot = 1000 * (2.5 * error**2 - 0.01 * b_hat)
    W_hat_dot = 100 * (np.outer(m * error, Phi) - 0.1 * W_hat)
    pose = [over_ground.real, over_ground.imag, r]
    return np.concatenate([pose, nu_dot, b_hat_dot, W_hat_dot.ravel(), beta_dot])


def test_the_corrected_run_agrees_with_dop853_on_equations_written_out_anew():
    loop = corrected()
    first = np.concatenate([loop.start, Plan(loop, TimeGrid(0.01, 1)).first_memory[2:]])
    other = solve_ivp(
        right_hand_side,
        (0, 10),
        first,
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
        t_eval=np.arange(11.0),
    )
    ours = run(loop, 10.0, 0.001, log_every=1000)
    np.testing.assert_allclose(np.delete(last_state(ours, loop), [6, 7]), other.y[:, -1], atol=1e-8)
    # Half the step for the first seconds, where the printed gains leave 1.2e-8.
    ours = run(loop, 10.0, 0.0005, log_every=2000)
    np.testing.assert_allclose([ours[name] for name in STATE], other.y[:6], atol=2e-9)


def mirrored(sea: HarmonicDisturbance) -> HarmonicDisturbance:
    flip = {"mean": -1, "sin": -1, "cos": -1, "sin_rate": 1, "cos_rate": 1}

    def other(load: Harmonic) -> Harmonic:
        return Harmonic(**{name: sign * getattr(load, name) for name, sign in flip.items()})

    return HarmonicDisturbance(b_u=sea.b_u, b_v=other(sea.b_v), b_r=other(sea.b_r))


@pytest.mark.parametrize("kind", MIRRORED.values(), ids=MIRRORED)
def test_a_run_to_port_is_the_mirror_image_of_one_to_starboard(kind):
    parts = {"controller": example(kind), "actuator": Saturated(surge_limit=50.0, yaw_limit=5.0)}
    one = corrected(**parts, path=Circle(angle=0.4), start=(-3.0, -9.0, 0.3, 0.2, 0.1, 0.05))
    other = corrected(
        **parts,
        path=Circle(angle=-0.4, turn="port"),
        disturbance=mirrored(HarmonicDisturbance()),
        start=(-3.0, 9.0, -0.3, 0.2, -0.1, -0.05),
    )
    starboard, port = run(one, 10.0), run(other, 10.0)
    signs = {"y": -1, "psi": -1, "v": -1, "r": -1, "y_d": -1, "tau_r": -1, "b_v": -1, "b_r": -1}
    names = (*STATE, "x_d", "y_d", "tau_u", "tau_r", "b_u", "b_v", "b_r", "z_e")
    for name in filter(starboard.signals.__contains__, names):  # a trial has no z_e
        image = signs.get(name, 1) * port[name]
        np.testing.assert_allclose(starboard[name], image, atol=1e-9 * (1 + abs(image).max()))


AS_PRINTED: dict[str, Any] = {
    "k_psie": 0.01,
    "standoff": 0.0,
    "fold": "printed",
    "coupling": "printed",
    "rate": "difference",
    "first_difference": "from_zero",
    "filter_start": "zero",
}


def distance(out: Any) -> Vector:
    """Distance to the target over the last fifth of the run."""
    z_e = np.hypot(out["x_d"] - out["x"], out["y_d"] - out["y"])
    return z_e[-len(z_e) // 5 :]
