"""Command path and failure around any actuator: delay, dead zone, resolution, loss of thrust."""

import math
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import pytest
from conftest import PAPER, POD, SMOOTH_START, Constant, adrift, corrected, last_state, run
from continuous import continuous
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import lambertw

from podusv_cli.components.actuators.command import Command, EffectivenessLoss
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.paths.line import Line
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, bundle, kernel
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.step.grid import TimeGrid

START = (0.0, 0.0, 0.0, 0.4, 0.0, 0.0)
K = 60.0  # kg/s, of `Brake`


class Brake(Constant):
    """A law for tests: tau_u = -k (u - u_d)."""

    kind: Literal["brake"] = "brake"
    k: float = value(K, "kg/s", "gain")
    u_d: float = value(0.0, "m/s", "speed that is wanted")

    @staticmethod
    @kernel
    def law(
        t: float,
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
        """The demand."""
        tau[0] = k.k * (k.u_d - x[3])
        tau[1] = 0.0


def braked(delay: float, **parts: Any) -> ClosedLoop:
    """The linear loop m u' = -d u - k u(t - delay); surge alone."""
    law, path = parts.pop("controller", Brake()), Command(delay=delay)
    vessel = {"vessel": PAPER, "nominal": PAPER, "start": START, "controller": law}
    return adrift(**vessel | {"actuator": Ideal(command=path)} | parts)


def linear() -> tuple[float, float]:
    """Damping and gain over inertia, d/m and k/m [1/s]."""
    return -PAPER.X_u / PAPER.m11, K / PAPER.m11


def margin() -> tuple[float, float]:
    """The delay at which the loop of `braked` oscillates [s], and its frequency [rad/s].

    j w + a + b exp(-j w delay) = 0: cos(w delay) = -a/b, w = sqrt(b^2 - a^2).
    """
    a, b = linear()
    w = math.sqrt(b * b - a * a)
    return math.acos(-a / b) / w, w


def exact(t: Vector, delay: float) -> Vector:
    """u of `braked`, by the series of 1/(s + a + b exp(-s delay)) in powers of exp(-s delay)."""
    (a, b), u = linear(), np.zeros_like(t)
    for j in range(int(t[-1] / delay) + 1):
        late = np.maximum(t - j * delay, 0.0)
        u += np.where(t >= j * delay, (-b * late) ** j / math.factorial(j) * np.exp(-a * late), 0.0)
    return START[3] * u


def test_the_plant_of_these_tests_is_linear_in_surge():
    assert PAPER.X_uu == PAPER.X_uuu == 0.0


@pytest.mark.parametrize(("part", "grows"), [(0.97, False), (1.03, True)])
def test_a_linear_loop_oscillates_from_its_delay_margin_on(part, grows):
    delay, w = margin()
    step = part * delay / 100
    out = run(braked(100 * step), 4000 * step, step)
    (a, b), tau = linear(), 100 * step
    root = -a + lambertw(-b * tau * np.exp(a * tau)) / tau
    assert (root.real > 0.0) == grows
    t, u = out["time"][1000:], out["u"][1000:]
    up = t[1:][(u[:-1] < 0.0) & (u[1:] >= 0.0)]
    assert 2.0 * np.pi / np.diff(up).mean() == pytest.approx(abs(root.imag), rel=0.02)
    assert abs(root.imag) == pytest.approx(w, rel=0.05)
    late, early = np.abs(u[-1000:]).max(), np.abs(u[:1000]).max()
    assert (late > early) == grows


def test_a_delay_is_integrated_with_fourth_order():
    delay, errors = 0.2, []
    for steps in (4, 8, 16):
        out = run(braked(delay), 2.0, delay / steps)
        errors.append(np.abs(out["u"] - exact(out["time"], delay)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(abs(orders - 4.0) < 0.25)
    assert errors[-1] < 1e-7


def test_a_delay_of_one_step_is_integrated_with_fourth_order():
    errors = []
    for step in (0.1, 0.05):
        out = run(braked(step), 2.0, step)
        errors.append(np.abs(out["u"] - exact(out["time"], step)).max())
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 12


def test_the_whole_loop_with_a_delay_converges_with_fourth_order():
    def end(step: float) -> Vector:
        loop = corrected(
            actuator=Ideal(command=Command(delay=0.2)),
            controller=VelocityVector(),
            path=Line(),
            start=SMOOTH_START,
        )
        return last_state(run(loop, 4.0, step, log_every=round(1 / step)), loop)

    ends = [end(step) for step in (0.04, 0.02, 0.01)]
    coarse, fine = (np.abs(a - b).max() for a, b in pairwise(ends))
    assert math.log2(coarse / fine) == pytest.approx(4.0, abs=0.5)


def test_before_the_first_command_the_demand_is_zero_and_then_it_is_the_law_s():
    out = run(braked(0.25), 2.0)
    np.testing.assert_array_equal(out["tau_u_in"][:25], 0.0)
    np.testing.assert_array_equal(out["tau_u_in"][25:], out["tau_u_cmd"][:-25])
    np.testing.assert_array_equal(out["tau_u"], out["tau_u_in"])


def test_a_held_command_is_delayed_exactly():
    out = run(braked(0.07), 3.0, hold_every=5)
    (a, _), m = linear(), PAPER.m11
    np.testing.assert_array_equal(out["tau_u_in"][7:], out["tau_u_cmd"][:-7])
    u = np.zeros_like(out["u"])  # exact for a force that is constant during a step
    u[0] = START[3]
    for k, force in enumerate(out["tau_u_in"][:-1]):
        u[k + 1] = u[k] * math.exp(-a * 0.01) + force / (m * a) * -math.expm1(-a * 0.01)
    np.testing.assert_allclose(out["u"], u, rtol=1e-10)


def test_a_delay_longer_than_the_run_lets_no_command_arrive():
    out = run(braked(50.0), 1.0)
    np.testing.assert_array_equal(out["tau_u"], 0.0)


def test_a_delay_of_zero_gives_the_bits_of_no_delay():
    now, none = run(braked(0.0), 2.0), run(braked(0.0, actuator=Ideal()), 2.0)
    for name in none.signals:
        np.testing.assert_array_equal(now[name], none[name])


def test_a_dead_zone_leaves_the_known_offset():
    u_d, zone = 0.5, 3.0
    loop = braked(0.0, controller=Brake(u_d=u_d), actuator=Ideal(command=Command(dead_zone_u=zone)))
    d = -PAPER.X_u
    assert run(loop, 60.0)["u"][-1] == pytest.approx((K * u_d - zone) / (d + K), rel=1e-9)


@given(demand=st.floats(-1e3, 1e3), zone=st.floats(0, 10))
def test_the_output_of_a_dead_zone_starts_at_zero(demand, zone):
    given_u = passed(Command(dead_zone_u=zone), demand)
    assert given_u == math.copysign(max(0.0, abs(demand) - zone), demand)


@given(demand=st.floats(-1e6, 1e6), resolution=st.floats(1e-3, 10))
def test_a_rounded_demand_is_the_nearest_multiple(demand, resolution):
    given_u = passed(Command(resolution_u=resolution), demand)
    assert given_u == round(demand / resolution) * resolution
    assert abs(given_u - demand) <= 0.5 * resolution * (1 + 1e-9) + 1e-9 * abs(demand)


def test_the_rounding_error_of_a_run_is_at_most_half_a_resolution():
    path = Command(resolution_u=0.5, resolution_r=0.1)
    out = run(corrected(actuator=Ideal(command=path), controller=Pid()), 20.0)
    for axis, resolution in (("u", 0.5), ("r", 0.1)):
        error = np.abs(out[f"tau_{axis}_in"] - out[f"tau_{axis}_cmd"])
        assert 0.4 * resolution < error.max() <= 0.5 * resolution * (1 + 1e-9)


def passed(path: Command, demand: float) -> float:
    """What an ideal actuator is given of a surge demand."""
    tau, signals = np.zeros(3), np.zeros(2)
    actuator = Ideal(command=path)
    asked = np.array([demand, 0.0, 0.0, 0.0])  # the last is when the step began
    k = bundle(actuator.constants())
    actuator.drive_with()(
        0.0, np.zeros(6), np.zeros(0), asked, k, np.zeros(1), tau, np.zeros(0), signals
    )
    assert tau[0] == signals[0]
    return float(tau[0])


def test_half_of_the_loads_is_left_from_the_step_of_the_failure_on():
    law = Constant(surge=2.0, yaw=1.0)
    out = run(
        adrift(
            controller=law, actuator=Ideal(failure=EffectivenessLoss(time=0.995, effectiveness=0.5))
        ),
        2.0,
    )
    np.testing.assert_array_equal(out["tau_u"], np.where(out["time"] < 0.995, 2.0, 1.0))
    np.testing.assert_array_equal(out["tau_r"], np.where(out["time"] < 0.995, 1.0, 0.5))
    assert "tau_u_in" not in out.signals


def test_a_failure_at_an_instant_costs_no_order():
    (a, _), m = linear(), PAPER.m11
    actuator = Ideal(failure=EffectivenessLoss(time=1.0, effectiveness=0.25))
    out = run(braked(0.0, controller=Constant(surge=6.0), actuator=actuator), 2.0, 0.1)
    t, u = out["time"], START[3]
    early = u * np.exp(-a * t) + 6.0 / (m * a) * -np.expm1(-a * t)
    late = np.maximum(t - 1.0, 0.0)
    after = early[10] * np.exp(-a * late) + 1.5 / (m * a) * -np.expm1(-a * late)
    np.testing.assert_allclose(out["u"], np.where(t <= 1.0, early, after), rtol=1e-9)


@pytest.mark.parametrize(("pod", "side"), [(0, -1.0), (1, 1.0)])
def test_the_pod_that_works_on_turns_the_hull(pod, side):
    y = 0.25
    pair = tuple({**POD, "y": at, "angle_limit": 0.0} for at in (-y, y))
    failure = {"time": 5.0, "pod": pod, "effectiveness": 0.4}
    loop = adrift(actuator=Pods(pods=pair, failure=failure), controller=Constant(surge=4.0))
    out = run(loop, 5.0)  # the last instant is the first of the failure
    np.testing.assert_allclose(out["tau_r"][:-1], 0.0, atol=1e-12)
    healthy = out["thrust"][-2, pod]
    assert healthy == pytest.approx(2.0, rel=1e-3)
    assert out["thrust"][-1, pod] == pytest.approx(0.4 * healthy, rel=1e-4)
    assert out["thrust"][-1, 1 - pod] == pytest.approx(healthy, rel=1e-4)
    # The pod on port pushes the bow to starboard: N = -y T.
    assert out["tau_r"][-1] == pytest.approx(side * 0.6 * healthy * y, rel=1e-4)
    assert out["tau_u"][-1] == pytest.approx(1.4 * healthy, rel=1e-4)


def test_the_sway_force_of_a_pod_that_failed_is_lost_with_its_thrust():
    failure = {"time": 0.0, "pod": 0, "effectiveness": 0.0}
    loop = adrift(actuator=Pods(pods=(POD,), failure=failure), controller=Constant(surge=4, yaw=1))
    out = run(loop, 5.0)
    for name in ("tau_u", "tau_v", "tau_r", "thrust"):
        np.testing.assert_array_equal(out[name], 0.0)
    assert np.abs(out["delta"][-1]).max() > 0.1


def test_a_law_that_asks_is_told_the_loads_that_act():
    law = Pid(anti_windup="auxiliary")
    dead = Ideal(command=Command(dead_zone_u=1e6, dead_zone_r=1e6))
    told = run(corrected(actuator=dead, controller=law), 5.0)
    deaf = run(corrected(actuator=dead, controller=Pid()), 5.0)
    np.testing.assert_array_equal(told["tau_u"], 0.0)
    assert np.abs(told["tau_u_cmd"][-1]) < np.abs(deaf["tau_u_cmd"][-1])


def test_a_delay_that_is_no_multiple_of_the_step_is_refused():
    with pytest.raises(ValueError, match=r"delayed by 0\.025 s, no"):
        run(braked(0.025), 1.0)


def test_a_delay_has_no_ordinary_differential_equation():
    with pytest.raises(ValueError, match="delay"):
        continuous(braked(0.2), 1.0)


def test_runs_that_differ_in_their_delays_have_one_structure():
    grid = TimeGrid(0.01, 100)
    assert Plan(braked(0.0), grid).structure == Plan(braked(0.2), grid).structure
