"""Allocation: what is asked for is made where it can be, and nothing else does better where not."""

import math
from itertools import product
from typing import Any

import numpy as np
import pytest
import yaml
from conftest import PACKAGE, POD
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_samples import marched
from pydantic import ValidationError
from scipy.optimize import lsq_linear, minimize

from podusv_cli.components.actuators.allocation import EFFORT, PREFERENCE, allocate
from podusv_cli.components.actuators.allocation_single import one_pod
from podusv_cli.components.actuators.base import whole_demand
from podusv_cli.components.actuators.pod import Pod, Pods
from podusv_cli.core.kernel import Vector, bundle, call

LIMIT = math.radians(35.0)
AHEAD, ASTERN = 8.0, 5.0
force = st.floats(-12, 12)
unit = st.floats(-1, 1)


def one(X: float, Y: float, priority: float = 0.0, low: float = -LIMIT, high: float = LIMIT) -> Any:
    """(T, delta, X, Y) that the closed form gives."""
    out = np.full(2, np.nan)
    one_pod(X, Y, low, high, ASTERN, AHEAD, priority, out)
    T, delta = out
    assert -ASTERN * (1 + 1e-12) <= T <= AHEAD * (1 + 1e-12)
    assert low <= delta <= high
    return T, delta, T * math.cos(delta), T * math.sin(delta)


@given(
    T=st.floats(-ASTERN, AHEAD), delta=st.floats(-LIMIT, LIMIT), priority=st.sampled_from([0, 1])
)
def test_what_one_pod_can_make_it_makes(T, delta, priority):
    X, Y = T * math.cos(delta), T * math.sin(delta)
    assert one(X, Y, priority)[2:] == pytest.approx((X, Y), abs=1e-9)
    if abs(T) > 1e-6:
        assert one(X, Y, priority)[:2] == pytest.approx((T, delta), abs=1e-6)


def grid_of_forces(ahead: bool) -> Vector:
    """All that one pod can make with thrust of one sense, closely enough."""
    T = np.linspace(0, AHEAD if ahead else -ASTERN, 401)
    delta = np.linspace(-LIMIT, LIMIT, 401)
    return np.array([np.outer(T, np.cos(delta)), np.outer(T, np.sin(delta))])


GRIDS = {ahead: grid_of_forces(ahead) for ahead in (True, False)}


@given(X=force, Y=force, priority=st.sampled_from([0.0, 1.0]))
def test_the_preferred_axis_is_met_as_far_as_can_be_and_then_the_other(X, Y, priority):
    """Against all forces on a grid, first by the one distance, then by the other."""
    wanted, made = np.array([X, Y]), np.array(one(X, Y, priority)[2:])
    first, second = (1, 0) if priority == 0.0 else (0, 1)
    apart = np.abs(GRIDS[X >= 0.0] - wanted[:, None, None])
    mine = np.abs(made - wanted)
    coarse = 0.06  # of the grid
    assert mine[first] <= apart[first].min() + 1e-9
    as_good = apart[first] <= mine[first] + 1e-9
    if as_good.any():
        assert mine[second] <= apart[second][as_good].min() + coarse


def test_going_astern_the_angle_stays_within_its_limits_and_does_not_jump_by_half_a_turn():
    """With a yaw moment that is kept, only the sign of the angle changes where the thrust does."""
    answers = [one(X, 0.3) for X in np.linspace(3, -3, 601)]
    T, delta = (np.array([answer[i] for answer in answers]) for i in (0, 1))
    np.testing.assert_allclose([answer[3] for answer in answers], 0.3, atol=1e-9)
    jumps = np.abs(np.diff(delta))
    assert np.sort(jumps)[-2] < 0.02
    assert jumps.max() == pytest.approx(2 * LIMIT, abs=0.01)
    assert (np.sign(delta) == np.sign(T)).all()


@given(X=force, Y=force, low=st.floats(-LIMIT, LIMIT), width=st.floats(0.01, 0.5))
def test_a_narrow_reach_of_angles_is_kept_to(X, Y, low, width):
    for priority in (0.0, 1.0):
        one(X, Y, priority, low, min(LIMIT, low + width) + 1e-9)


def several(places: Any, **options: Any) -> Pods:
    """Pods at (x, y, angle limit), of different strength."""
    return Pods(
        pods=tuple(
            Pod(**POD | {"x": x, "y": y, "angle_limit": limit, "T_nn": (2 + i) * 1e-3})
            for i, (x, y, limit) in enumerate(places)
        ),
        **options,
    )


def allocated(pods: Pods, demand: Vector, state: Vector | None = None) -> tuple[Vector, Vector]:
    """Thrusts and angles for a demand of two or three, at rest."""
    demand = whole_demand(demand)
    count = len(pods.pods)
    T, delta, at = np.zeros(count), np.zeros(count), state if state is not None else pods.rest()
    k, table = bundle(pods.constants()), pods.table()
    allocate(at, demand, np.zeros(count), k, table, T, delta)
    return T, delta


class Problem:
    """The allocation as a problem for scipy: its cost, from the configuration's numbers alone."""

    def __init__(self, pods: Pods, demand: Vector) -> None:
        p = pods.pods
        self.ahead = np.array([pod.T_nn * pod.n_max**2 for pod in p])
        self.astern = np.array([pod.T_nn_astern * pod.n_max_astern**2 for pod in p])
        self.angle = np.array([pod.angle_limit for pod in p])
        self.most = np.maximum(self.ahead, self.astern)
        x, y = np.array([pod.x for pod in p]), np.array([pod.y for pod in p])
        size = np.array([self.most.sum(), self.most.sum(), (self.most * np.hypot(x, y)).sum()])
        weight = [1.0, pods.sway_weight, PREFERENCE]
        if pods.priority == "surge":
            weight = [PREFERENCE, pods.sway_weight, 1.0]
        rows = np.sqrt(weight) / size
        self.B_X = rows[:, None] * np.array([np.ones_like(x), np.zeros_like(x), -y])
        self.B_Y = rows[:, None] * np.array([np.zeros_like(x), np.ones_like(x), x])
        u, r, v = whole_demand(demand)
        self.tau = rows * np.clip([u, v, r], -size, size)

    def cost(self, q: Vector) -> float:
        """Of (thrusts, angles)."""
        return self.cost_and_slope(q)[0]

    def cost_and_slope(self, q: Vector) -> tuple[float, Vector]:
        """The cost and its derivatives."""
        T, delta = np.split(q, 2)
        along = self.B_X * np.cos(delta) + self.B_Y * np.sin(delta)
        across = self.B_Y * np.cos(delta) - self.B_X * np.sin(delta)
        short = along @ T - self.tau
        effort = EFFORT * T / self.most**2
        slope = np.concatenate([short @ along + effort, (short @ across) * T])
        return float(0.5 * short @ short + 0.5 * effort @ T), slope

    def best(self, random: Any) -> float:
        """The least cost that TNC finds from starts in every combination of senses."""
        bounds = [*zip(-self.astern, self.ahead, strict=True), *((-a, a) for a in self.angle)]
        options: Any = {"maxfun": 500, "ftol": 1e-15, "gtol": 1e-10}
        found, count = math.inf, len(self.most)
        for senses in product([True, False], repeat=count):
            T = np.where(senses, self.ahead, -self.astern) * random.uniform(0.1, 0.9, count)
            start = np.concatenate([T, self.angle * random.uniform(-1, 1, count)])
            answer = minimize(
                self.cost_and_slope, start, jac=True, bounds=bounds, method="TNC", options=options
            )
            found = min(found, float(answer.fun))
        return found


LAYOUTS = {
    "twin": [(-0.5, -0.1, LIMIT), (-0.5, 0.1, LIMIT)],
    "bow and stern": [(0.6, 0.0, math.pi / 2), (-0.5, 0.0, math.pi / 2)],
    "pod between fixed": [(-0.5, 0.2, 0.0), (-0.6, 0.0, LIMIT), (-0.5, -0.2, 0.0)],
    "one aside": [(-0.5, 0.2, LIMIT)],
}


@settings(max_examples=8)
@given(
    layout=st.sampled_from(sorted(LAYOUTS)),
    surge=unit,
    yaw=unit,
    size=st.sampled_from([0.3, 1.5]),
    sway=st.sampled_from([0.0, 0.1]),
    priority=st.sampled_from(["yaw", "surge"]),
)
def test_no_other_thrusts_and_angles_cost_less(layout, surge, yaw, size, sway, priority):
    assert_no_other_costs_less(layout, surge, yaw, size, sway, priority)


def test_a_search_along_a_step_ends_where_the_step_is_level():
    """With 30 trials three steps came back to the first: -0.01 rad in place of -0.27 rad."""
    assert_no_other_costs_less("one aside", 0.875, 1.0, 0.3, 0.0, "surge")


def assert_no_other_costs_less(layout, surge, yaw, size, sway, priority):
    pods = several(LAYOUTS[layout], sway_weight=sway, priority=priority)
    demand = np.array([surge * size * 8, yaw * size * 3])
    assert_best(pods, demand)
    if pods.takes_sway:
        assert_best(pods, np.append(demand, (surge - yaw) * size * 3))


def assert_best(pods, demand):
    problem = Problem(pods, demand)
    mine = problem.cost(np.concatenate(allocated(pods, demand)))
    assert mine <= problem.best(np.random.default_rng(1)) * (1 + 1e-6) + 1e-11


@settings(max_examples=40)
@given(surge=unit, yaw=unit, size=st.sampled_from([0.3, 1.0, 3.0]))
def test_differential_thrust_is_bounded_least_squares(surge, yaw, size):
    """Fixed propellers leave a convex problem in the thrusts, which scipy solves exactly."""
    pods = several([(-0.5, -0.4, 0.0), (-0.5, 0.4, 0.0), (0.2, 0.1, 0.0)])
    demand = np.array([surge * size * 10, yaw * size * 4])
    problem = Problem(pods, demand)
    lines = np.vstack([problem.B_X, math.sqrt(EFFORT) * np.diag(1 / problem.most)])
    goal = np.concatenate([problem.tau, np.zeros(3)])
    bounds = (-problem.astern, problem.ahead)
    best = lsq_linear(lines, goal, bounds, method="bvls", tol=1e-14)
    T, delta = allocated(pods, demand)
    np.testing.assert_allclose(T, best.x, atol=1e-4 * problem.most.max())
    assert not delta.any()


@given(surge=unit, yaw=unit, sway=unit)
def test_a_ferry_shares_three_demands_between_bow_and_stern_by_halves_and_lever(surge, yaw, sway):
    """X_i = X/2, Y_1 + Y_2 = Y, x (Y_1 - Y_2) = N: of two pods that turn every way."""
    ferry = Pods.model_validate(ferry_pods() | {"sway_weight": 1.0}, strict=False)
    X, N, Y = surge * 400.0, yaw * 600.0, sway * 400.0
    T, delta = allocated(ferry, np.array([X, N, Y]))
    bow, stern = 0.5 * Y + N / 3.6, 0.5 * Y - N / 3.6
    np.testing.assert_allclose(T * np.cos(delta), [0.5 * X] * 2, atol=0.01)
    np.testing.assert_allclose(T * np.sin(delta), [bow, stern], atol=0.01)


def ferry_pods():
    """What the preset milliampere has."""
    return yaml.safe_load((PACKAGE / "components/actuators/milliampere.yaml").read_text())


def test_pods_take_a_sway_force_with_a_weight_of_it_where_they_can_push_every_way():
    weighed, ferry = {"sway_weight": 1.0}, ferry_pods()
    every_way = Pods.model_validate(ferry | weighed, strict=False)
    assert every_way.takes_sway
    assert every_way.input_rank() == 3
    np.testing.assert_allclose(every_way.input_matrix(), np.eye(3)[[0, 2, 1]], atol=1e-3)
    assert not Pods.model_validate(ferry, strict=False).takes_sway
    fixed = several([(-0.5, -0.4, 0.0), (-0.5, 0.4, 0.0)], **weighed)
    assert not fixed.takes_sway
    assert not several(LAYOUTS["one aside"], **weighed).takes_sway
    with pytest.raises(ValidationError, match="a dead zone of a sway force, and takes none"):
        several([(-0.5, -0.4, 0.0), (-0.5, 0.4, 0.0)], command={"dead_zone_v": 1.0})


def tunnelled(**options: Any) -> Pods:
    """Two fixed propellers at the stern and a tunnel in the bow, which pushes to starboard."""
    fixed = {"T_nn": 4e-3, "T_nn_astern": 4e-3, "angle_limit": 0.0}
    places = ({"x": -0.5, "y": -0.4}, {"x": -0.5, "y": 0.4}, {"x": 0.6, "mount": math.pi / 2})
    return Pods(pods=tuple(Pod(**POD | fixed | place) for place in places), **options)


@given(surge=unit, yaw=unit, sway=unit)
def test_a_tunnel_and_two_propellers_make_three_demands_as_three_equations_say(surge, yaw, sway):
    """X = T_1 + T_2, N = 0.4 (T_1 - T_2) + 0.6 T_3, Y = T_3."""
    ship = tunnelled(sway_weight=1.0)
    assert ship.takes_sway
    demand = np.array([surge * 2.0, yaw * 0.5, sway * 1.5])
    rows = np.array([[1.0, 1.0, 0.0], [0.4, -0.4, 0.6], [0.0, 0.0, 1.0]])
    T, delta = allocated(ship, demand)
    np.testing.assert_allclose(T, np.linalg.solve(rows, demand), atol=1e-3)
    assert not delta.any()


def test_a_tunnel_pushes_to_starboard_and_turns_the_bow_there():
    """Loads of running thrusters, with the water's flow along the tunnel that takes thrust away."""
    ship, n = tunnelled(), np.array([10.0, 10.0, 20.0])
    tau = ship._drive_once(np.zeros(6), np.concatenate([n, np.zeros(3)]), np.zeros(2))[0]
    T = 4e-3 * n * n
    np.testing.assert_allclose(tau, [T[0] + T[1], T[2], 0.6 * T[2]], atol=1e-12)
    ship = Pods.model_validate(
        ship.model_dump() | {"pods": [one | {"T_nV": 0.01} for one in ship.model_dump()["pods"]]},
        strict=False,
    )
    v, r = 0.3, 0.2
    x = np.array([0.0, 0.0, 0.0, 0.0, v, r])
    state = np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])
    slowed = ship._drive_once(x, state, np.zeros(2))[0]
    assert slowed[1] == pytest.approx(T[2] - 0.01 * 20.0 * (v + 0.6 * r))


def test_a_failed_tunnel_pushes_no_more():
    ship = tunnelled(failure={"time": 0.0, "pod": 2})
    tau, signals = np.array([1.0, 1.6, 0.96]), np.zeros(len(ship.signals))
    signals[4 + 2 * 3 : 4 + 3 * 3] = [0.5, 0.5, 1.6]
    k = bundle(ship.constants())
    call(ship.lose, state=np.zeros(6), k=k, table=ship.table(), tau=tau, signals=signals)
    np.testing.assert_allclose(tau, [1.0, 0.0, 0.0], atol=1e-12)


def test_tunnels_alone_cannot_push_ahead():
    tunnels = [Pod(**POD | {"x": x, "angle_limit": 0.0, "mount": math.pi / 2}) for x in (-1, 1)]
    with pytest.raises(ValidationError, match="cannot make surge"):
        Pods(pods=tuple(tunnels))


def test_pods_mounted_at_an_angle_make_what_straight_ones_make_with_it():
    """Two pods that turn by 90 deg reach the same forces however they are mounted."""
    demand = np.array([3.0, -0.7, 1.1])
    for mount in (0.0, 0.4, -1.2):
        pods = several(LAYOUTS["bow and stern"], sway_weight=1.0)
        turned = tuple(pod.model_copy(update={"mount": mount}) for pod in pods.pods)
        T, delta = allocated(pods.model_copy(update={"pods": turned}), demand)
        X, Y = T * np.cos(delta + mount), T * np.sin(delta + mount)
        assert X.sum() == pytest.approx(3.0, abs=1e-3)
        assert Y.sum() == pytest.approx(1.1, abs=1e-3)
        assert np.array([0.6, -0.5]) @ Y == pytest.approx(-0.7, abs=1e-3)


def test_a_sway_force_that_is_no_number_is_not_lost_between_limits_of_pods():
    ferry = Pods.model_validate(ferry_pods() | {"sway_weight": 1.0}, strict=False)
    _, rate = ferry._drive_once(np.zeros(6), ferry.rest(), np.array([0.0, 0.0, math.nan]))
    assert not np.isfinite(rate).all()


FERRY = """
vessel: {preset: milliampere}
actuator: {kind: pod, preset: milliampere, sway_weight: 1.0}
path: {kind: poses, poses: [[0, 0, 0.4]]}
disturbance: {kind: step, b_u: 50.0, b_v: -120.0, b_r: 60.0}
controller: {kind: pose_pid, w_x: 0.3, w_y: 0.3, w_r: 0.4}
start: {x: 0.5, psi: 0.4}
simulation: {step: 0.05, duration: 400.0}
"""


def test_a_ferry_in_a_load_comes_to_its_pose_with_the_thrusts_of_halves_and_lever():
    """T = 500 n |n|; X = -50 N, Y = 120 N, N = -60 N m."""
    log = marched(FERRY)
    assert log["z_e"][-1] < 1e-4
    assert abs(log["psi"][-1] - 0.4) < 1e-5
    bow, stern = 60.0 - 60.0 / 3.6, 60.0 + 60.0 / 3.6
    n, delta = log["n_part"][-1], log["delta"][-1]
    T = 500.0 * n * abs(n)
    np.testing.assert_allclose(T * np.cos(delta), [-25.0, -25.0], atol=0.05)
    np.testing.assert_allclose(T * np.sin(delta), [bow, stern], atol=0.05)


@given(surge=unit, yaw=unit)
def test_what_several_pods_can_make_they_make(surge, yaw):
    pods = several(LAYOUTS["bow and stern"])
    demand = np.array([surge * 2.0, yaw * 0.8])
    k, T, delta = bundle(pods.constants()), np.zeros(2), np.zeros(2)
    met = allocate(pods.rest(), demand, np.zeros(2), k, pods.table(), T, delta)
    X, Y = T * np.cos(delta), T * np.sin(delta)
    assert met
    assert X.sum() == pytest.approx(demand[0], abs=1e-4)
    assert (np.array([0.6, -0.5]) @ Y) == pytest.approx(demand[1], abs=1e-4)


def test_an_axis_far_out_of_reach_does_not_take_what_the_preferred_one_needs():
    pods = several(LAYOUTS["twin"])
    T, delta = allocated(pods, np.array([36e3, 0.5]))
    x, y = np.array([-0.5, -0.5]), np.array([-0.1, 0.1])
    N = x @ (T * np.sin(delta)) - y @ (T * np.cos(delta))
    assert pytest.approx(0.5, abs=0.01) == N
    assert T.sum() > 0.9 * Problem(pods, np.zeros(2)).ahead.sum()


def test_with_a_horizon_only_what_rates_allow_is_asked_for():
    turn, change = POD["angle_rate"] * 0.1, POD["n_rate"] * 0.1
    for pods in (several(LAYOUTS["twin"], horizon=0.1), Pods(pods=(Pod(**POD),), horizon=0.1)):
        count = len(pods.pods)
        state = np.array([10.0] * count + [0.2] * count)
        T, delta = allocated(pods, np.array([7.0, -3.0]), state)
        assert delta == pytest.approx(0.2 + turn)
        ahead = np.array([pod.T_nn for pod in pods.pods]) * (10.0 + change) ** 2
        assert (ahead * (1 + 1e-9) >= T).all()
        free = pods.model_copy(update={"horizon": 0.0})
        assert np.abs(allocated(free, np.array([7.0, -3.0]), state)[1]).max() > 0.2 + 2 * turn


ZEROS = (0.0, -0.0)


@pytest.mark.parametrize("priority", [0.0, 1.0])
@pytest.mark.parametrize("X", ZEROS)
@pytest.mark.parametrize("Y", ZEROS)
def test_one_pod_that_is_asked_for_nothing_does_not_turn(X, Y, priority):
    assert one(X, Y, priority)[:2] == (0.0, 0.0)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("horizon", [0.0, 0.3])
@pytest.mark.parametrize("astern", [0.0, POD["n_max_astern"]])
def test_no_pod_is_asked_for_an_angle_out_of_its_reach(layout, horizon, astern):
    """Nor does the sign of a thrust of zero turn it by half a turn."""
    free = several(LAYOUTS[layout], horizon=horizon)
    own = tuple(pod.model_copy(update={"n_max_astern": astern}) for pod in free.pods)
    pods = free.model_copy(update={"pods": own})
    limit, count = np.array([pod.angle_limit for pod in own]), len(own)
    turned = np.minimum(limit, 0.7) if horizon else 0.0 * limit
    state = np.concatenate([np.zeros(count), turned])
    turn = POD["angle_rate"] * horizon if horizon else math.inf
    for surge, yaw in product([*ZEROS, -1e-9, -1.0, -50.0, 50.0], [*ZEROS, -0.2, 0.2, -9.0]):
        _, delta = allocated(pods, np.array([surge, yaw]), state)
        assert (np.abs(delta) <= limit * (1 + 1e-12)).all()
        assert (np.abs(delta - turned) <= turn + 1e-12).all()
