"""All of CyberShip II's thrusters: signs by geometry, and the sway force that they have at rest."""

import itertools
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

import podusv
from podusv_cli.components.actuators.pod import Pods
from podusv_cli.core.kernel import bundle, call
from podusv_cli.scenario.load import load

# Loads of two propellers, the bow tunnel and two rudders, as public simulators of the ship have it.
B = np.array(
    [[1, 1, 0, 0, 0], [0, 0, 1, 1, 1], [0.078, -0.078, 0.466, -0.549, -0.549]], dtype=float
)
RACE = 0.5**2 * 8.0 / (math.pi * 1000.0)  # u_rud^2 d^2 / T at rest


def ship(**options) -> Pods:
    own = load("podusv:dp/thrusters.yaml").scenario.actuator
    return own.changed({"sway_weight": 1.0, **options})


def loads(n: list[float], delta: list[float]) -> np.ndarray:
    """Loads at rest of thrusters that run at n [1/s] with rudders at delta [rad]."""
    own, state = ship(), np.array([*n, *delta])
    return own._drive_once(np.zeros(6), state, np.zeros(2))[0]


def most_sway(n: float, d: float, *, turns: bool) -> float:
    """The largest sway force [N] at rest without surge force, and maybe a moment left over.

    A linear programme over T1, T2, T3, L1, L2 for each choice of the propellers' senses, by the
    published coefficients; a rudder's force is a part of the thrust ahead, astern it has none.
    """
    ahead, astern, bow = 3.65034e-3 * n * n, 5.10256e-3 * n * n, 1.56822e-4 * n * n
    delta = min(6.43306 / (2.0 * 5.83594), math.radians(35.0))
    part = (6.43306 - 5.83594 * delta) * delta * RACE / (d * d)
    still = B[[0]] if turns else B[[0, 2]]
    found = []
    for sides in itertools.product((True, False), repeat=2):
        rows = [
            [-part * sides[i] * (j == i) + sign * (j == 3 + i) for j in range(5)]
            for i in range(2)
            for sign in (1.0, -1.0)
        ]
        bounds = [(0.0, ahead) if side else (-astern, 0.0) for side in sides]
        answer = linprog(
            -B[1],
            A_ub=rows,
            b_ub=np.zeros(4),
            A_eq=still,
            b_eq=np.zeros(len(still)),
            bounds=[*bounds, (-bow, bow), (None, None), (None, None)],
        )
        found.append(-answer.fun)
    return max(found)


def test_each_thruster_pushes_as_its_place_on_the_hull_says():
    T, bow = 3.65034e-3 * 400.0, 1.56822e-4 * 400.0
    np.testing.assert_allclose(loads([20, 0, 0], [0, 0, 0]), B[:, 0] * T, atol=1e-12)
    np.testing.assert_allclose(loads([0, 20, 0], [0, 0, 0]), B[:, 1] * T, atol=1e-12)
    np.testing.assert_allclose(loads([0, 0, 20], [0, 0, 0]), B[:, 2] * bow, atol=1e-12)
    for i in range(2):
        n = [20.0 * (i == 0), 20.0 * (i == 1), 0.0]
        change = loads(n, [0.1, 0.1, 0.0]) - loads(n, [0.0, 0.0, 0.0])
        lift = 4.15e-3 * 400.0 * 0.1
        across = lift * math.cos(0.1)
        assert change[1] == pytest.approx(across)
        drag = -lift * math.sin(0.1)
        assert change[2] == pytest.approx(B[2, 3 + i] * across + B[2, i] * drag)


def test_papers_give_the_ship_2_newtons_of_sway_and_its_thrusters_give_less():
    """Without surge force 0.50 to 1.42 N; where the heading is held as well, 0.13 to 1.38 N."""
    assert most_sway(25.0, 0.08, turns=True) == pytest.approx(0.500, abs=5e-4)
    assert most_sway(33.0, 0.06, turns=True) == pytest.approx(1.417, abs=5e-4)
    assert most_sway(25.0, 0.08, turns=False) == pytest.approx(0.130, abs=5e-4)
    assert most_sway(33.0, 0.06, turns=False) == pytest.approx(1.384, abs=5e-4)


def test_the_allocation_finds_the_most_sway_that_the_preset_has():
    """By a search over speeds and a rudder angle that knows of no allocation.

    The preset's rudder drags, too, so that it has less than the published coefficients alone.
    """
    own = ship()

    def stern(p):
        lift = 4.15e-3 * p[0] ** 2 * p[1]
        X = 3.65034e-3 * p[0] ** 2 - lift * math.sin(p[1])  # the other propeller takes it off
        return X, lift * math.cos(p[1])

    def moment(p):
        X, Y = stern(p)
        return 2.0 * 0.078 * X - 0.549 * Y + 0.466 * p[2]

    bounds = [(0.0, 33.0), (0.0, 0.2756), (-0.17078, 0.17078)]
    zero = {"type": "eq", "fun": moment}
    best = minimize(
        lambda p: -stern(p)[1] - p[2], [30.0, 0.2, 0.1], bounds=bounds, constraints=zero
    )
    most = -best.fun
    assert best.success
    for part, met in ((0.995, True), (1.01, False)):
        tau = own.settled(np.zeros(6), np.array([0.0, 0.0, part * most]))
        assert np.allclose(tau, [0.0, part * most, 0.0], atol=2e-3) == met


speed, angle = st.floats(-31.0, 31.0), st.floats(-0.27, 0.27)


@settings(max_examples=25)
@given(n=st.tuples(speed, speed, speed), delta=st.tuples(angle, angle))
def test_what_running_thrusters_make_the_allocation_makes_again(n, delta):
    """Ahead and astern: a propeller astern has no rudder force, and is not allotted one."""
    tau = loads(n, [*delta, 0.0])
    again = ship().settled(np.zeros(6), 0.98 * tau[[0, 2, 1]])
    np.testing.assert_allclose(again, 0.98 * tau, atol=4e-3)


def test_a_failed_bow_thruster_leaves_propellers_and_rudders():
    own = ship(failure={"time": 0.0, "pod": 2})
    state = np.array([20.0, 20.0, 20.0, 0.1, 0.1, 0.0])
    signals, tau = np.zeros(len(own.signals)), np.zeros(3)
    given = {"state": state, "k": bundle(own.constants()), "table": own.table(), "tau": tau}
    call(own.drive, x=np.zeros(6), demand=np.zeros(3), rate=np.zeros(6), signals=signals, **given)
    call(own.lose, signals=signals, **given)
    np.testing.assert_allclose(tau, loads([20, 20, 0], [0.1, 0.1, 0.0]), atol=1e-12)


def test_a_mount_is_written_only_where_a_pod_has_one():
    """Logs from before the key keep their bytes; what is written reads back to the same pods."""
    own = ship()
    written = [pod.model_dump() for pod in own.pods]
    assert ["mount" in pod for pod in written] == [False, False, True]
    again = yaml.safe_load(yaml.safe_dump(own.model_dump(mode="json")))
    assert Pods.model_validate(again, strict=False) == own


def test_thrusters_march_side_by_side_with_the_bits_that_they_have_alone():
    """Mounts differ between the runs, one of which is 0 and has no key that is written."""
    scenario = podusv.load("podusv:dp/thrusters.yaml", {"simulation.duration": 6.0}).alone()
    drawn = {
        "actuator.pods.2.mount": np.linspace(-1.6, 1.6, 9),
        "actuator.pods.0.mount": np.linspace(0.0, 0.4, 9),
        "vessel.m": np.linspace(22.0, 26.0, 9),
    }
    alone, together = (
        podusv.simulate_many(scenario, drawn, workers=1, side_by_side=way) for way in (False, True)
    )
    assert set(alone["status"]) == {"finished"}
    assert len(set(alone["iae"])) == 9
    pd.testing.assert_frame_equal(alone, together, check_exact=True)


def test_two_demands_take_rudders_for_pods_that_turn():
    """As ever, so that runs of two demands keep their bits: 0.13 of 0.2 N m, as the page says."""
    own = load("podusv:pod/rudders.yaml").scenario.actuator
    assert own.settled(np.zeros(6), np.array([0.0, 0.2]))[2] == pytest.approx(0.132, abs=5e-4)


@pytest.mark.long
def test_the_four_corners_are_wider_with_the_ship_s_own_thrusters_as_the_page_says():
    page = Path(__file__).parents[3].joinpath("docs/actuators.md").read_text()
    for law, words in (("pid", "grows from {} to {} m"), ("backstepping", "from {} to {} m.")):
        circles = [
            podusv.simulate(load(f"podusv:dp/{name}.yaml").scenario.singles()[law]).metrics[
                "watch_circle"
            ]
            for name in ("four_corners", "thrusters")
        ]
        assert words.format(*(f"{circle:.2f}" for circle in circles)) in page
