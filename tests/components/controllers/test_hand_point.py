"""The laws of a hand point: linearisation, zero dynamics, offsets, windup."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, ask, corrected, run, situations
from law_samples import STEADY, WRONG, rms, task

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adrc import Adrc
from podusv_cli.components.controllers.hand_point import hand_errors
from podusv_cli.components.controllers.hand_position import HandPosition
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.scenario.load import load

ROOT = Path(__file__).parents[3]

PATHS = [Line(speed=0.5, course=0.3), Circle(radius=16.67, speed=0.5)]
every_law = pytest.mark.parametrize("kind", [HandPosition, Adrc])
either = pytest.mark.parametrize("reference", ["origin", "target"])


def within(out: Any, name: str, start: float, end: float = np.inf) -> Vector:
    return np.asarray(out[name][(out["time"] >= start) & (out["time"] < end)])


def steady(law: Any, **parts: Any) -> ClosedLoop:
    return corrected(controller=law, actuator=Saturated(), disturbance=STEADY, **parts)


# --- derivation


def test_surge_and_yaw_push_the_hand_point_along_and_across_the_bow():
    t, l = sp.symbols("t l")  # noqa: E741 - the source's letter
    x, y, psi, u, v, r = (sp.Function(name)(t) for name in ("x", "y", "psi", "u", "v", "r"))
    motion = {
        x.diff(t): u * sp.cos(psi) - v * sp.sin(psi),
        y.diff(t): u * sp.sin(psi) + v * sp.cos(psi),
        psi.diff(t): r,
    }
    hand = sp.Matrix([x + l * sp.cos(psi), y + l * sp.sin(psi)])
    velocity = hand.diff(t).subs(motion)
    to_body = sp.Matrix([[sp.cos(psi), sp.sin(psi)], [-sp.sin(psi), sp.cos(psi)]])
    w = v + l * r
    assert sp.simplify(to_body * velocity - sp.Matrix([u, w])) == sp.zeros(2, 1)
    pushed = to_body * velocity.diff(t).subs(motion)
    known = sp.Matrix([u.diff(t) - r * w, w.diff(t) + r * u])
    assert sp.simplify(pushed - known) == sp.zeros(2, 1)


def test_behind_a_pod_a_moment_moves_the_hand_point_less_or_the_other_way():
    l, a, m22, m33, tau = sp.symbols("l a m22 m33 tau", positive=True)  # noqa: E741
    across = -tau / a / m22 + l * tau / m33  # v' + l r' with the sway force -tau/a
    assert sp.simplify(across - (l / m33 - 1 / (a * m22)) * tau) == 0
    assert sp.simplify(across.subs(l, m33 / (a * m22))) == 0
    ship = {a: 0.499, m22: NONLINEAR.m22, m33: NONLINEAR.m33}
    assert (across / tau).subs(ship | {l: 0.3}) < 0.5 * 0.3 / NONLINEAR.m33


def test_moved_exactly_behind_a_pod_the_hand_point_leaves_a_heading_that_needs_speed():
    """m22 v' + m33 r'/a has no moment in it; the hand point moves north at V, linearised."""
    l, a, m11, m22, m33, d, d_r, V = sp.symbols("l a m11 m22 m33 d d_r V", positive=True)  # noqa: E741
    psi, r = sp.symbols("psi r")
    u, w = V * sp.cos(psi), -V * sp.sin(psi)
    v, w_rate = w - l * r, -V * sp.cos(psi) * r
    forces = -m11 * u * r - d * v + ((m11 - m22) * u * v - d_r * r) / a
    r_rate = (m22 * w_rate - forces) / (m22 * l - m33 / a)
    matrix = sp.Matrix([r, r_rate]).jacobian([psi, r]).subs({psi: 0, r: 0})
    need = (m22 - m11) * V + d * l + ((m22 - m11) * V * l - d_r) / a
    assert sp.simplify(matrix.trace() + need / (m22 * l - m33 / a)) == 0
    ship = {
        m11: NONLINEAR.m11,
        m22: NONLINEAR.m22,
        d: -NONLINEAR.Y_v,
        d_r: -NONLINEAR.N_r,
        a: 0.499,
    }
    slowest = [float(sp.solve(need.subs(ship | {l: ahead}), V)[0]) for ahead in (0.3, 1.0)]
    np.testing.assert_allclose(slowest, [0.28, 0.12], atol=0.005)


def missing(x: Vector, psi_f: float, target: Vector, k: Any) -> Vector:
    """What the hand point lacks, north and east."""
    h = hand_errors(x, psi_f, target, k)
    c, s = np.cos(x[2]), np.sin(x[2])
    return np.array([c * h.s_a - s * h.s_b, s * h.s_a + c * h.s_b])


@either
def test_with_known_loads_what_the_hand_point_lacks_decays_at_k_v(reference):
    """(V_c - h')' = -k_v (V_c - h') along the flow, V_c and its rate by central differences."""
    law = Adrc(reference=reference, U=50.0, k_v=0.7)
    k, vessel, small = bundle(law.constants_with(NONLINEAR)), bundle(NONLINEAR.constants()), 1e-5
    for at in situations(law, 50):
        rate = np.zeros(6)
        # The course of a target that turns is taken to go on turning, so let it go straight.
        target = np.array([*at.target[:4], 0.0, 0.0])
        found = ask(law, at.x, at.memory, target, NONLINEAR)
        plant(at.x, np.array([found.tau[0], 0.0, found.tau[1]]), at.memory[3:6], vessel, rate)
        target_rate = np.array([*target[2:4], 0.0, 0.0, 0.0, 0.0])

        def moved(dt: float, here: Any = (at, target, rate, target_rate, found)) -> Vector:
            at, target, rate, target_rate, found = here
            psi_f = at.memory[6] + dt * found.rate[6]
            return missing(at.x + dt * rate, psi_f, target + dt * target_rate, k)

        measured = (moved(small) - moved(-small)) / (2 * small)
        np.testing.assert_allclose(measured, -0.7 * moved(0.0), rtol=2e-3, atol=2e-3)


def test_the_heading_that_is_left_is_stable_if_sway_is_heavier_than_surge():
    """psi' = (V sin(chi - psi) - v)/l and the sway equation with r = psi', linearised."""
    V, l, m11, m22, d, psi, v = sp.symbols("V l m11 m22 d psi v", positive=True)  # noqa: E741
    r = (V * sp.sin(-psi) - v) / l
    rates = sp.Matrix([r, (-m11 * V * r - d * v) / m22])
    matrix = rates.jacobian([psi, v]).subs({psi: 0, v: 0})
    assert sp.simplify(matrix.det() - V * d / (m22 * l)) == 0
    assert sp.simplify(matrix.trace() + V / l * (1 - m11 / m22) + d / m22) == 0


# --- what is promised


@pytest.mark.parametrize("path", PATHS)
@every_law
def test_constant_loads_leave_no_offset_whatever_the_law_was_told(kind, path):
    for nominal in (NONLINEAR, WRONG):
        out = run(steady(kind(), path=path, nominal=nominal), 800.0, step=0.02)
        assert within(out, "z_e", 790).max() < 1e-9


@every_law
def test_as_published_the_hand_point_comes_to_the_target_and_the_origin_stays_behind(kind):
    out = run(steady(kind(reference="target"), path=PATHS[0]), 250.0)
    assert within(out, "z_h", 249).max() < 1e-9
    np.testing.assert_allclose(within(out, "z_e", 249), kind().hand, atol=1e-9)


def test_the_source_s_integral_does_not_wind_up():
    class Deaf(HandPosition):
        def wants_loads(self) -> bool:
            return False

    weak = Saturated(surge_limit=1.0)
    told, deaf = (
        run(corrected(controller=law, actuator=weak, disturbance=Calm()), 20.0)
        for law in (HandPosition(), Deaf())
    )
    assert abs(told["integral_a"]).max() < 0.5 * abs(deaf["integral_a"]).max()


# --- on the paper's task


@pytest.mark.parametrize(
    ("kind", "iae", "most"), [(HandPosition, 225.0, 0.03), (Adrc, 217.0, 0.02)]
)
def test_they_track_the_paper_s_task_without_a_standoff(kind, iae, most):
    out = task(kind())
    assert np.trapezoid(out["z_e"], out["time"]) < iae
    for start, end in ((60, 100), (150, np.inf)):
        assert rms(out, start, end) < most


def test_held_for_a_tenth_of_a_second_hand_position_swings_for_more_than_a_minute():
    """From the start, far away; `adrc` does not."""
    for kind, swings in ((HandPosition, True), (Adrc, False)):
        out = run(corrected(controller=kind(), actuator=Saturated()), 110.0, hold_every=10)
        assert (within(out, "z_e", 60, 80).max() > 0.5) == swings
        assert within(out, "z_e", 100).max() < 0.2


@pytest.mark.parametrize(("hand", "answer"), [(0.3, 0.455), (0.163, 0.0), (0.1, -0.633)])
def test_behind_a_thrust_at_the_stern_a_moment_moves_the_hand_point_less_or_backwards(hand, answer):
    """w' = (l/m33 - 1/(a m22)) tau_r, as a part of l tau_r/m33, by the plant; a = 0.5 m."""
    k, rates = bundle(NONLINEAR.constants()), []
    for sway in (0.0, -1.0 / 0.5):
        rate = np.zeros(6)
        plant(np.zeros(6), np.array([0.0, sway, 1.0]), np.zeros(3), k, rate)
        rates.append(rate[4] + hand * rate[5])
    assert rates[1] / rates[0] == pytest.approx(answer, abs=5e-3)
    lost = 1 - NONLINEAR.m33 / (hand * 0.5 * NONLINEAR.m22)
    assert rates[1] / rates[0] == pytest.approx(lost, rel=1e-9)


BEHIND_PODS = load(ROOT / "configs/pod/kept.yaml").scenario.actuator


@pytest.mark.parametrize(
    ("law", "least", "most"), [(Adrc(), 0.5, 2.0), (Adrc(hand=0.6, T_f=5.0), 0.005, 0.02)]
)
def test_behind_pods_a_longer_hand_point_is_needed(law, least, most):
    loop = corrected(
        controller=law,
        actuator=BEHIND_PODS,
        disturbance=STEADY,
        path=PATHS[1],
        start=(15.67, 0.0, np.pi / 2, 0.5, 0.0, 0.0),
    )
    assert least < within(run(loop, 200.0, step=0.02), "z_e", 140).max() < most


@pytest.mark.parametrize("axis", [0, 1])
def test_the_loops_of_hand_position_are_its_own(axis):
    """The rates of (nu, I) at rest by central differences; I_b per hand length."""
    law, at = HandPosition(), (3, 5)[axis]
    k, scale = bundle(NONLINEAR.constants()), (1.0, law.hand)[axis]
    axes = (Axis("surge", NONLINEAR.m11, NONLINEAR.m11, 0.0),) * 2

    def rates(d: Vector) -> Vector:
        x, rate = np.zeros(6), np.zeros(6)
        x[at] += d[0]
        memory = np.zeros(3)
        memory[axis] = d[1] * scale
        found = ask(law, x, memory, np.zeros(6), NONLINEAR)
        plant(x, np.array([found.tau[0], 0.0, found.tau[1]]), np.zeros(3), k, rate)
        return np.array([rate[at], found.rate[axis] / scale])

    steps = 1e-6 * np.eye(2)
    measured = np.transpose([(rates(d) - rates(-d)) / 2e-6 for d in steps])
    loop = law.velocity_loops(axes, np.zeros(3))[axis]
    np.testing.assert_allclose(loop.matrix, measured, atol=1e-6)
