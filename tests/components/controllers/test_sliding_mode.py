"""The law sliding_mode: its reaching laws, the bounds that they promise, and what it reaches."""

import itertools
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, ask, corrected, run, situations
from law_samples import STEADY, WRONG, rms, task

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.hand_point import hand_errors
from podusv_cli.components.controllers.sliding_mode import SlidingMode, reach, twist
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import bundle, call

LAYER, TWIST = SlidingMode(), SlidingMode(reaching="super_twisting")
LAWS = pytest.mark.parametrize("law", [LAYER, TWIST], ids=["layer", "twist"])
PATHS = pytest.mark.parametrize("path", [Line(speed=0.5, course=0.3), Circle(radius=16.67)])


def constants(law: SlidingMode) -> Any:
    return bundle(law.constants_with(NONLINEAR))


# --- the reaching laws


def against(s: Any) -> float:
    """s . reach(s) of both axes, without loads."""
    k = constants(LAYER)
    return float(sum(number * reach(number, 0.0, k) for number in s))


@pytest.mark.parametrize("share", [0.3, 0.95])
def test_the_missing_velocity_falls_as_the_bound_says_wherever_it_points(share):
    """V = |s|^2/2 under the worst load of length D: V' beyond phi, and below it."""
    eta, phi, k_v, D = LAYER.eta, LAYER.phi, LAYER.k_v, share * LAYER.eta
    lengths = phi * np.concatenate([np.linspace(0.05, 3, 60), [20.0, 50.0]])
    for length, angle in itertools.product(lengths, np.linspace(0, np.pi, 61)):
        fall = D * length - against([length * np.cos(angle), length * np.sin(angle)])
        beyond = -k_v * length**2 - (eta - D) * length
        inside = D * length - (k_v + eta / phi) * length**2
        assert fall <= (beyond if length >= phi else inside) + 1e-12


def test_a_bound_of_each_axis_alone_would_not_be_enough():
    """One axis in the layer, loads of 0.9 eta on both: V' is above what D = 0.9 eta says."""
    eta, phi, k_v, D = LAYER.eta, LAYER.phi, LAYER.k_v, 0.9 * LAYER.eta
    s = phi * np.array([1.5, 0.5])
    length = float(np.hypot(*s))
    assert D * s.sum() - against(s) > -k_v * length**2 - (eta - D) * length


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_the_missing_velocity_comes_into_the_ball_of_the_bound_and_stays(share):
    """Both axes, coupled by a yaw rate, with the load along s: the worst of its length."""
    D = share * LAYER.eta
    ball = 1.001 * D / (LAYER.k_v + LAYER.eta / LAYER.phi)
    k, s, lengths, step = constants(LAYER), np.array([0.8, -0.3]), [], 1e-3
    for _ in range(8000):
        turned = 0.4 * np.array([s[1], -s[0]])
        answer = np.array([reach(number, 0.0, k) for number in s])
        s = s + step * (turned - answer + D * s / np.hypot(*s))
        lengths.append(np.hypot(*s))
    inside = np.array(lengths) <= ball
    assert not inside[0]
    assert inside[np.argmax(inside) :].all()
    assert inside[-1]
    # |s|' <= -(eta - D) - k_v |s| until phi
    longest = np.log(1 + np.hypot(0.8, 0.3) * LAYER.k_v / (LAYER.eta - D)) / LAYER.k_v
    assert step * np.argmax(np.array(lengths) < LAYER.phi) < longest


@pytest.mark.parametrize("load", [-0.15, 0.02, 0.1])
def test_within_the_layer_the_rest_is_the_load_over_the_gain(load):
    k, s = constants(LAYER), 0.0
    for _ in range(5000):
        s += 2e-3 * (load - reach(s, 0.0, k))
    assert s == pytest.approx(load / (LAYER.k_v + LAYER.eta / LAYER.phi), rel=1e-6)
    assert abs(s) < LAYER.phi


def test_super_twisting_is_levant_s_where_nothing_is_rounded_off():
    sharp = SlidingMode(reaching="super_twisting", phi=1e-12, k_v=1e-9)
    k = constants(sharp)
    for s in (-0.5, -1e-3, 0.02, 3.0):
        known = sharp.lambda_1 * np.sqrt(abs(s)) * np.sign(s) + 0.07
        assert reach(s, 0.07, k) == pytest.approx(known, rel=1e-6)
        assert twist(s, k) == pytest.approx(sharp.lambda_2 * np.sign(s), rel=1e-6)


def test_super_twisting_takes_a_load_that_grows_below_its_bound():
    """d' = 0.6 lambda_2: s comes to 0 but for the rounding, and z follows the load."""
    k, s, z, step = constants(TWIST), 0.3, 0.0, 1e-3
    slope = 0.6 * TWIST.lambda_2
    for i in range(40_000):
        d = slope * i * step
        s, z = s + step * (d - reach(s, z, k)), z + step * twist(s, k)
    # lambda_2 s/(|s| + phi) = d' leaves s = phi 0.6/0.4
    assert s == pytest.approx(TWIST.phi * 1.5, rel=1e-2)
    assert z == pytest.approx(d - reach(s, 0.0, k), abs=1e-3)


def test_a_load_is_not_learnt_with_the_first_order_and_not_while_the_actuator_falls_short():
    assert twist(0.3, constants(LAYER)) == 0.0
    for x, memory, target in situations(TWIST, 20):
        answer, k = ask(TWIST, x, memory, target, NONLINEAR), constants(TWIST)
        full, tau = answer.rate.copy(), np.array([answer.tau[0], 0.0, answer.tau[1]])
        call(
            TWIST.after_saturation,
            t=0.0,
            memory=memory,
            demand=answer.tau,
            tau=tau,
            k=k,
            table=TWIST.table(),
            rate=answer.rate,
        )
        np.testing.assert_array_equal(answer.rate, full)
        short = tau - [TWIST.eta * NONLINEAR.m11, 0.0, 3 * TWIST.eta * NONLINEAR.m33 / TWIST.hand]
        call(
            TWIST.after_saturation,
            t=0.0,
            memory=memory,
            demand=answer.tau,
            tau=short,
            k=k,
            table=TWIST.table(),
            rate=answer.rate,
        )
        np.testing.assert_allclose(answer.rate, full * [1 / 2, 1 / 10, 1.0], rtol=1e-12)


def test_without_that_what_is_learnt_winds_up():
    class Deaf(SlidingMode):
        def wants_loads(self) -> bool:
            return False

    weak = Saturated(surge_limit=1.0)
    told, deaf = (
        run(corrected(controller=law, actuator=weak, disturbance=Calm()), 20.0)
        for law in (TWIST, Deaf(reaching="super_twisting"))
    )
    assert abs(told["twist_a"]).max() < 0.5 * abs(deaf["twist_a"]).max()


# --- the closed loop


@LAWS
def test_the_surface_moves_as_the_reaching_law_and_the_load_say(law):
    """|s| s' = s . (load - reach), over the plant; the frame turns s but not its length."""
    law = law.model_copy(update={"U": 50.0})
    k, vessel, small = constants(law), bundle(NONLINEAR.constants()), 1e-6
    b = np.array([0.7, -0.4, 0.3])
    push = np.array([b[0] / NONLINEAR.m11, b[1] / NONLINEAR.m22 + law.hand * b[2] / NONLINEAR.m33])
    for x, memory, at in situations(law, 30):
        target = np.array([*at[:4], 0.0, 0.0])
        found, rate = ask(law, x, memory, target, NONLINEAR), np.zeros(6)
        plant(x, np.array([found.tau[0], 0.0, found.tau[1]]), b, vessel, rate)

        def length(dt: float, state: Any = (x, memory, target, rate, found)) -> float:
            x, memory, target, rate, found = state
            now = target + dt * np.array([*target[2:4], 0, 0, 0, 0])
            h = hand_errors(x + dt * rate, memory[2] + dt * found.rate[2], now, k)
            return 0.5 * (h.s_a**2 + h.s_b**2)

        h = hand_errors(x, memory[2], target, k)
        s = np.array([h.s_a, h.s_b])
        answer = np.array([reach(h.s_a, memory[0], k), reach(h.s_b, memory[1], k)])
        measured = (length(small) - length(-small)) / (2 * small)
        assert measured == pytest.approx(float(s @ (-push - answer)), rel=5e-3, abs=5e-3)


@pytest.mark.parametrize("axis", [0, 1])
@LAWS
def test_its_loops_are_its_own_at_rest(law, axis):
    at, scale = (3, 5)[axis], (1.0, law.hand)[axis]
    k, axes = bundle(NONLINEAR.constants()), (Axis("surge", 25.8, 25.8, 0.0),) * 2

    def rates(d: Any) -> Any:
        x, memory, rate = np.zeros(6), np.zeros(3), np.zeros(6)
        x[at] += d[0]
        memory[axis] = d[1] * scale
        answer = ask(law, x, memory, np.zeros(6), NONLINEAR)
        plant(x, np.array([answer.tau[0], 0.0, answer.tau[1]]), np.zeros(3), k, rate)
        return np.array([rate[at], answer.rate[axis] / scale])

    steps = 1e-7 * np.eye(2)
    measured = np.transpose([(rates(d) - rates(-d)) / 2e-7 for d in steps])
    answer = law.velocity_loops(axes, np.zeros(3))[axis].matrix
    count = len(answer)  # z stays 0 with the first order
    np.testing.assert_allclose(answer, measured[:count, :count], rtol=1e-4, atol=1e-4)


@PATHS
def test_super_twisting_leaves_no_offset_under_constant_loads_whatever_it_was_told(path):
    for nominal in (NONLINEAR, WRONG):
        loop = corrected(
            controller=TWIST, actuator=Saturated(), disturbance=STEADY, path=path, nominal=nominal
        )
        assert run(loop, 400.0, step=0.02)["z_e"][-1] < 1e-6


@PATHS
def test_the_first_order_stays_within_its_bound(path):
    """|e| = |s|/kappa, |s| <= load/(k_v + eta/phi) on both axes; kappa is k_p to 1e-4 here."""
    loop = corrected(controller=LAYER, actuator=Saturated(), disturbance=STEADY, path=path)
    out = run(loop, 400.0, step=0.02)
    load = np.hypot(0.5 / NONLINEAR.m11, 0.5 / NONLINEAR.m22 + LAYER.hand * 0.5 / NONLINEAR.m33)
    bound = load / (LAYER.k_v + LAYER.eta / LAYER.phi) / LAYER.k_p
    assert 0.3 * bound < out["z_h"][-1] < bound * (1 + 1e-4)


def test_the_rounded_sign_has_the_slope_that_the_loop_is_given():
    s, phi = sp.symbols("s phi", positive=True)
    assert sp.limit(sp.diff(s / sp.sqrt(s + phi), s), s, 0) == 1 / sp.sqrt(phi)
    assert sp.limit(sp.diff(s / (s + phi), s), s, 0) == 1 / phi


# --- on the paper's task


@pytest.mark.parametrize(
    ("law", "iae", "line", "circle"), [(LAYER, 215.0, 0.02, 0.025), (TWIST, 214.0, 0.012, 0.018)]
)
def test_it_tracks_the_paper_s_task_without_a_standoff(law, iae, line, circle):
    out = task(law)
    assert np.trapezoid(out["z_e"], out["time"]) < iae
    assert rms(out, 60, 100) < line
    assert rms(out, 150, 310) < circle
    assert abs(out["tau_u_cmd"]).max() < 60


@LAWS
def test_a_measurement_held_for_a_tenth_of_a_second_does_not_make_it_chatter(law):
    held, free = task(law, hold_every=10), task(law)
    late = free["time"] > 150
    assert rms(held, 150, 310) < rms(free, 150, 310) + 2e-3
    moves = [np.abs(np.diff(out["tau_r_cmd"][late])).sum() for out in (held, free)]
    assert moves[0] < 1.5 * moves[1]
