"""Eigenvalues of the closed loop about steady motion on lines and circles, told right and wrong."""

import math
from itertools import product
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, VESSELS, ask, corrected, run
from counts import count
from law_samples import STEADY
from line_loops import furthest, moving_eigenvalues, places
from rotation import one_in

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adrc import Adrc
from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.vessels.plant import plant, surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.theory.lateral import momentum_vector_gains, momentum_vector_polynomial
from podusv_cli.theory.loop_margins import loop_margins

SPEED, LOAD = 0.5, np.array([0.5, 0.5, 0.5])  # m/s; N and N m
CAREFUL = VelocityVector(omega_v=0.2)
WARY = MomentumVector(trust=1.8, omega_v=0.3, gamma=0.0)
TURN = SPEED / 16.67  # rad/s; the paper's circle
CYBERSHIP = VESSELS["cybership2"]
DAMPING = ("X_u", "X_uu", "X_uuu"), ("Y_v", "Y_vv"), ("N_r", "N_rr")


def drawn(random: Any, spread: float = 0.3) -> Vessel:
    """The vessel with every inertia and damping changed by up to this."""
    a, b, c, *scales = random.uniform(1 - spread, 1 + spread, 6)
    v = NONLINEAR
    changes = {"X_udot": v.m - a * v.m11, "Y_vdot": v.m - b * v.m22, "N_rdot": v.I_z - c * v.m33}
    for names, scale in zip(DAMPING, scales, strict=True):
        changes |= {name: scale * getattr(v, name) for name in names}
    return v.model_copy(update=changes)


def steady_velocity(k: Any, turn: float = 0.0, loads: Vector = LOAD) -> tuple[float, float]:
    """(u, v) in balance across the bow, at the target's speed and turn; v by bisection."""
    low, high = -0.9 * SPEED, SPEED
    for _ in range(60):
        v = 0.5 * (low + high)
        u = np.sqrt(SPEED**2 - v * v)
        low, high = (v, high) if sway_force(u, v, turn, k) + loads[1] > 0 else (low, v)
    return float(np.sqrt(SPEED**2 - low * low)), low


def at_rest(
    law: Any, vessel: Vessel, told: Vessel, turn: float = 0.0, loads: Vector = LOAD
) -> Vector:
    """(x, memory) on the target, which goes north: in its frame nothing changes."""
    true, k = bundle(vessel.constants()), bundle(told.constants())
    u, v = steady_velocity(true, turn, loads)
    forces = surge_force, sway_force, yaw_moment
    tau = [-(f(u, v, turn, true) + b) for f, b in zip(forces, loads, strict=True)]
    tau[1] = 0.0
    observed = [-(f(u, v, turn, k) + t) for f, t in zip(forces, tau, strict=True)]
    x = np.array([0.0, 0.0, -np.arctan2(v, u), u, v, turn])
    memory = law.start(x, np.zeros(6), told)
    memory[3:6] = observed
    s = np.concatenate([x, memory])
    s[places(law, "phi_lag")] = turn / law.omega_v**2
    return s


def rates(
    law: Any, s: Vector, vessel: Vessel, told: Vessel, turn: float = 0.0, loads: Vector = LOAD
) -> Vector:
    """Of (x, memory) in the frame of the target: its position, its course, its turn [rad/s]."""
    x, memory, out = s[:6], s[6:], np.zeros(6)
    target = np.array([0.0, 0.0, SPEED, 0.0, 0.0, SPEED * turn])
    answer = ask(law, x, memory, target, told)
    tau = np.array([answer.tau[0], 0.0, answer.tau[1]])
    plant(x, tau, loads, bundle(vessel.constants()), out)
    out[:3] -= SPEED - turn * x[1], turn * x[0], turn
    all_rates = np.concatenate([out, answer.rate])
    all_rates[places(law, "psi_f")] -= turn  # a heading
    return all_rates


def growth(law: Any, vessel: Vessel, told: Vessel = NONLINEAR, turn: float = 0.0) -> float:
    """Largest real part of the eigenvalues [1/s]; checks that the state is one of rest."""
    loop = linearised(law, at_rest(law, vessel, told, turn), vessel, told, turn)
    return float(moving_eigenvalues(law, loop).real.max())


def linearised(law: Any, s: Vector, *terms: Any, **loads: Vector) -> Vector:
    """The matrix of the loop about a state of rest, by central differences."""
    assert abs(rates(law, s, *terms, **loads)).max() < 1e-9
    columns = [
        (rates(law, s + d, *terms, **loads) - rates(law, s - d, *terms, **loads)) / 2e-6
        for d in 1e-6 * np.eye(len(s))
    ]
    return np.transpose(columns)


def unstable(law: Any, count: int, heavier_sway: bool) -> tuple[int, int]:
    """How many drawn vessels are unstable, and how many of these have m11 < m22."""
    random, found = np.random.default_rng(5), []
    while len(found) < count:
        vessel = drawn(random)
        if vessel.m11 < vessel.m22 or not heavier_sway:
            found.append((growth(law, vessel) > 0.0, vessel.m11 < vessel.m22))
    bad = [heavier for grows, heavier in found if grows]
    return len(bad), sum(bad)


def test_velocity_vector_is_stable_on_every_drawn_vessel_whose_sway_is_heavier():
    assert unstable(VelocityVector(), count(60, 4500), heavier_sway=True) == (0, 0)


def test_with_lighter_sway_than_told_it_need_not_be_and_a_slower_observer_helps():
    vessels = count(100, 1500)
    bad, heavier = unstable(VelocityVector(), vessels, heavier_sway=False)
    assert 0.02 < bad / vessels < 0.1
    assert heavier == 0
    assert unstable(CAREFUL, vessels, heavier_sway=False) == (0, 0)


def test_told_its_own_hull_it_is_stable_whichever_inertia_is_the_larger():
    random = np.random.default_rng(6)
    vessels = [drawn(random) for _ in range(count(40, 1500))]
    assert any(vessel.m11 > vessel.m22 for vessel in vessels)
    assert all(growth(VelocityVector(), vessel, vessel) < 0.0 for vessel in vessels)


def test_on_the_circle_to_starboard_its_own_model_does_not_help_a_hull_of_lighter_sway():
    random, number = np.random.default_rng(6), count(100, 1500)
    vessels = [drawn(random) for _ in range(number)]
    grows = [vessel for vessel in vessels if growth(VelocityVector(), vessel, vessel, TURN) > 0.0]
    assert 0.03 < len(grows) / number < 0.15
    assert all(vessel.m11 > vessel.m22 for vessel in grows)
    assert all(growth(VelocityVector(), vessel, vessel, -TURN) < 0.0 for vessel in grows)


def test_hulls_of_heavier_sway_hardly_grow_on_the_circle():
    random = np.random.default_rng(5)
    vessels = [drawn(random) for _ in range(count(100, 2500))]
    growths = [growth(VelocityVector(), v, NONLINEAR, TURN) for v in vessels if v.m11 < v.m22]
    assert max(growths) < 0.05
    assert np.mean(np.array(growths) > 0.0) < 0.02


def test_momentum_vector_told_its_own_hull_is_stable_on_lines_and_circles():
    random = np.random.default_rng(6)
    vessels = [drawn(random) for _ in range(count(40, 1500))]
    for turn in (0.0, TURN, -TURN):
        assert all(growth(MomentumVector(), hull, hull, turn) < 0.0 for hull in vessels)


def test_told_the_nominal_hull_momentum_vector_needs_to_trust_it_less():
    random, number = np.random.default_rng(6), count(40, 1500)
    vessels = [drawn(random) for _ in range(number)]

    def share(law: Any) -> float:
        return sum(growth(law, hull) > 0.0 for hull in vessels) / number

    assert 0.02 < share(MomentumVector()) < 0.15
    assert share(WARY) < 0.01


def test_adrc_is_not_stable_on_all_of_them():
    """The hand point is short for a hull that turns, and damps sway, less than it was told."""
    bad, _ = unstable(Adrc(), count(100, 1500), heavier_sway=True)
    assert 0.01 < bad / count(100, 1500) < 0.15


@pytest.mark.parametrize(
    ("law", "vessel", "told", "line", "starboard", "port"),
    [
        (VelocityVector(), NONLINEAR, NONLINEAR, -0.194, -0.182, -0.199),
        (VelocityVector(), CYBERSHIP, CYBERSHIP, -0.117, 0.173, -0.137),
        (CAREFUL, CYBERSHIP, CYBERSHIP, -0.117, 0.173, -0.137),
        (VelocityVector(k_p=0.2), CYBERSHIP, CYBERSHIP, -0.117, -0.056, -0.115),
        (VelocityVector(), CYBERSHIP, NONLINEAR, 0.267, 0.434, 0.117),
        (CAREFUL, CYBERSHIP, NONLINEAR, -0.131, 0.107, -0.127),
        (MomentumVector(), NONLINEAR, NONLINEAR, -0.194, -0.124, -0.210),
        (MomentumVector(), CYBERSHIP, CYBERSHIP, -0.199, -0.146, -0.166),
        (MomentumVector(), CYBERSHIP, NONLINEAR, 0.443, 0.446, 0.427),
        (WARY, CYBERSHIP, NONLINEAR, -0.037, -0.049, -0.024),
    ],
)
def test_the_eigenvalues_are_those_of_the_table(law, vessel, told, line, starboard, port):
    """theory.md: on the line and on the paper's circle to either side."""
    growths = [growth(law, vessel, told, turn) for turn in (0.0, TURN, -TURN)]
    assert growths == pytest.approx([line, starboard, port], abs=6e-4)


@pytest.mark.parametrize(("vessel", "off"), [(NONLINEAR, 0.159), (CYBERSHIP, 0.225)])
def test_a_load_across_the_path_takes_the_loop_off_the_polynomial_of_calm_water(vessel, off):
    law, across = MomentumVector(), np.array([0.0, 0.5, 0.0])
    s = at_rest(law, vessel, vessel, loads=across)
    loop = linearised(law, s, vessel, vessel, loads=across)
    roots = np.roots(momentum_vector_polynomial(*momentum_vector_gains(law, vessel, SPEED)))
    assert furthest(roots, moving_eigenvalues(law, loop)) == pytest.approx(off, abs=2e-3)


@pytest.mark.parametrize(
    ("law", "turn", "lowest", "highest"),
    [
        (VelocityVector(), "starboard", 0.05, 0.1),
        (CAREFUL, "starboard", 0.05, 0.1),
        (VelocityVector(), "port", 0.0, 1e-4),
        (VelocityVector(k_p=0.2), "starboard", 0.0, 1e-4),
    ],
)
def test_a_known_hull_cycles_on_the_circle_where_an_eigenvalue_grows(law, turn, lowest, highest):
    """CyberShip II told its own model, constant loads, from 1 m inside the circle."""
    heading = np.pi / 2 if turn == "starboard" else -np.pi / 2
    out = run(
        corrected(
            controller=law,
            vessel=CYBERSHIP,
            actuator=Saturated(),
            disturbance=STEADY,
            path=Circle(radius=16.67, turn=turn),
            start=(15.67, 0.0, heading, 0.5, 0.0, 0.0),
        ),
        200.0,
        step=0.02,
    )
    assert lowest <= out["z_e"][out["time"] > 170].max() <= highest


@pytest.mark.parametrize(
    ("omega_v", "grows", "lowest", "highest"),
    [(2.0, True, 0.2, 0.4), (0.5, False, 0.1, 0.3), (0.2, False, 0.0, 1e-3)],
)
def test_such_a_hull_cycles_also_where_no_eigenvalue_grows(omega_v, grows, lowest, highest):
    """At 0.5 rad/s a limit cycle stands beside the stable state: eigenvalues do not tell."""
    law, vessel = VelocityVector(omega_v=omega_v), CYBERSHIP
    out = run(
        corrected(
            controller=law,
            vessel=vessel,
            nominal=NONLINEAR,
            actuator=Saturated(),
            path=Line(),
            disturbance=STEADY,
            start=(-2.0, 0.0, 0.0, 0.5, 0.0, 0.0),
        ),
        150.0,
        step=0.02,
    )
    assert (growth(law, vessel) > 0.0) is grows
    assert lowest <= out["z_e"][out["time"] > 100].max() <= highest


@pytest.mark.parametrize("law", [VelocityVector(), Adrc()])
def test_a_small_error_decays_at_the_rate_of_the_slowest_eigenvalue(law):
    """Measured on the envelope of a run that begins 1 mm off the state of rest."""
    rate = growth(law, NONLINEAR)
    s = at_rest(law, NONLINEAR, NONLINEAR)
    loop = corrected(
        controller=law, path=Line(), disturbance=STEADY, start=(0.0, 1e-3, *map(float, s[2:6]))
    )
    out = run(loop, 120.0)
    late = out["z_e"][(out["time"] > 60) & (out["time"] < 61)].max()
    later = out["z_e"][(out["time"] > 80) & (out["time"] < 81)].max()
    assert np.log(later / late) / 20.0 == pytest.approx(rate, rel=0.25)


@pytest.mark.parametrize(
    ("law", "turn"), one_in(2, [*product((VelocityVector(), Adrc()), (0.0, TURN, -TURN))])
)
def test_the_loop_s_own_right_hand_side_has_the_same_eigenvalue(law, turn):
    """`podusv margins` finds state of rest and derivatives by itself."""
    path, start = Line(), (0.0, 0.0, 0.0, SPEED, 0.0, 0.0)
    if turn:
        path = Circle(radius=16.67, turn="starboard" if turn > 0 else "port")
        start = (16.67, 0.0, math.copysign(np.pi / 2, turn), SPEED, 0.0, turn)
    loop = corrected(controller=law, path=path, disturbance=STEADY, start=start)
    found = loop_margins(loop, TimeGrid(0.01, 2000)).poles.real.max()
    assert found == pytest.approx(growth(law, NONLINEAR, turn=turn), rel=1e-6)
