"""The extended state observer: what it finds, how fast, and that limits do not disturb it."""

from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, VESSELS, ask, corrected, run, situations

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.observer import OBSERVED, ObservingController
from podusv_cli.components.controllers.velocity_loop import Axis
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.components.vessels.plant import plant
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.kernel import bundle, call
from podusv_cli.core.registry import kinds

MEANS = (0.4, -0.3, 0.2)
STEADY = HarmonicDisturbance(
    b_u=Harmonic(mean=MEANS[0]), b_v=Harmonic(mean=MEANS[1]), b_r=Harmonic(mean=MEANS[2])
)
QUIET = {MomentumVector: MomentumVector(gamma=0.0)}  # it would tell the observer what it learns
SPEED = {"Alos": 0.4, "VelocityVector": 0.4, "MomentumVector": 0.4, "Adrc": 0.0}  # for loops
CYBERSHIP, MILLIAMPERE = VESSELS["cybership2"], VESSELS["milliampere"]  # m23 and m32 differ in one
OBSERVING = list(kinds("podusv_cli.components.controllers", ObservingController).values())


def mass_matrix(vessel: Vessel) -> Any:
    sway, yaw = (vessel.m22, vessel.m23), (vessel.m32, vessel.m33)
    return np.array([[vessel.m11, 0.0, 0.0], [0.0, *sway], [0.0, *yaw]])


@pytest.mark.parametrize("vessel", [NONLINEAR, CYBERSHIP], ids=lambda vessel: vessel.preset)
@pytest.mark.parametrize("kind", OBSERVING)
def test_limits_do_not_disturb_the_observer(kind, vessel):
    # With the true model the acceleration M^-1 (b - b_hat) that is missing under a constant load b
    # goes as (1 + omega t) e^(-omega t), whatever the actuator makes of the demand: no windup.
    law, M = QUIET.get(kind, kind()), mass_matrix(vessel)
    loop = corrected(controller=law, vessel=vessel, actuator=Saturated(), disturbance=STEADY)
    out = run(loop, 14.0, step=0.005)
    assert out["saturated"].mean() > 0.4
    wt = np.outer(out["time"], [law.omega_u, law.omega_v, law.omega_r])
    missing = (1.0 + wt) * np.exp(-wt) * np.linalg.solve(M, MEANS)
    answer = np.transpose([out[f"b_obs_{name}"] for name in "uvr"])
    np.testing.assert_allclose(answer, MEANS - missing @ M.T, atol=1e-5)
    np.testing.assert_allclose(answer[-1], MEANS, atol=1e-5)


def test_without_the_loads_that_act_it_would_wind_up():
    class Deaf(VelocityVector):
        def wants_loads(self) -> bool:
            return False

    tight = Saturated(surge_limit=2.0)
    told = run(corrected(controller=VelocityVector(), actuator=tight, disturbance=STEADY), 8.0)
    deaf = run(corrected(controller=Deaf(), actuator=tight, disturbance=STEADY), 8.0)
    assert abs(told["b_obs_u"]).max() < 0.41
    assert abs(deaf["b_obs_u"]).max() > 2.0


@pytest.mark.parametrize("vessel", [NONLINEAR, MILLIAMPERE], ids=lambda vessel: vessel.preset)
@pytest.mark.parametrize("kind", OBSERVING)
def test_its_rates_are_those_of_the_vessel_and_a_double_pole(kind, vessel):
    law = kind()
    omega = np.array([law.omega_u, law.omega_v, law.omega_r])
    k, rate = bundle(law.constants_with(vessel)), np.zeros(6)
    for at in situations(law, 50):
        at.memory[6:] = 0.0  # what a law keeps beside the observer
        answer = ask(law, *at, vessel)
        tau = np.array([answer.tau[0], 0.7, 0.5 * answer.tau[1]])  # what an actuator made of it
        call(
            law.after_saturation,
            t=1.0,
            memory=at.memory,
            demand=answer.tau,
            tau=tau,
            k=k,
            table=law.table(),
            rate=answer.rate,
        )
        plant(at.x, tau, at.memory[3:6], bundle(vessel.constants()), rate)
        error = at.x[3:] - at.memory[:3]
        np.testing.assert_allclose(answer.rate[:3], rate[3:] + 2 * omega * error, rtol=1e-9)
        learnt = mass_matrix(vessel) @ (omega**2 * error)
        np.testing.assert_allclose(answer.rate[3:6], learnt, rtol=1e-12)


def test_the_pole_is_double():
    s, omega, m = sp.symbols("s omega m", positive=True)
    error = sp.Matrix([[-2 * omega, 1 / m], [-m * omega**2, 0]])
    assert sp.expand((s * sp.eye(2) - error).det() - (s + omega) ** 2) == 0


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("kind", OBSERVING)
def test_its_loops_are_the_law_s_own(kind, axis):
    """The rates of (nu, nu_hat, b_hat/m) by central differences, on the target."""
    speed = SPEED[kind.__name__]
    law, at, inertia = kind(), (3, 5)[axis], (NONLINEAR.m11, NONLINEAR.m33)[axis]
    k, target = bundle(NONLINEAR.constants()), np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0])
    surge, yaw = NONLINEAR.m11, NONLINEAR.m33
    axes = Axis("surge", surge, surge, 0.0), Axis("yaw", yaw, yaw, 0.0)

    def rates(d: Any) -> Any:
        x, rate = np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0]), np.zeros(6)
        memory = law.start(x, target, NONLINEAR)
        x[at] += d[0]
        memory[[at - 3, at]] += d[1], d[2] * inertia
        answer = ask(law, x, memory, target, NONLINEAR)
        plant(x, np.array([answer.tau[0], 0.0, answer.tau[1]]), np.zeros(3), k, rate)
        return np.array([rate[at], answer.rate[at - 3], answer.rate[at] / inertia])

    steps = 1e-6 * np.eye(3)
    measured = np.transpose([(rates(d) - rates(-d)) / 2e-6 for d in steps])
    loop = law.velocity_loops(axes, np.zeros(3))[axis]
    np.testing.assert_allclose(loop.matrix, measured, atol=1e-6)


def test_what_it_observes_is_logged_with_units():
    assert [signal.unit for signal in OBSERVED] == ["m/s", "m/s", "rad/s", "N", "N", "N m"]


def test_a_law_with_the_observer_may_have_no_linear_loops():
    axes = (Axis("surge", 1.0, 1.0, 0.0),) * 2
    assert ObservingController().velocity_loops(axes, np.zeros(3)) == []
