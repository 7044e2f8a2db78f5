"""Errors and virtual controls: (18)-(21), (30), Remark 5, and the readings of each."""

import math
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, Situation, corrected, last_state, run, situations
from hypothesis import given
from hypothesis import strategies as st

from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.tracking import PSI_D_HELD, PSI_D_RATE_HELD, Tracking, track
from podusv_cli.components.paths.line import Line
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.core.kinematics import direction

DIFFERENCE = {"rate": "difference", "difference_step": 0.01}


def seen_by(law: AdaptiveNeural, at: Situation) -> Tracking:
    return track(at.x, at.memory, at.target, bundle(law.constants_with(NONLINEAR)))


def motion(at: Situation) -> tuple[float, float]:
    """Rates of distance and direction of the target, from positions and earth velocities alone."""
    psi, u, v = at.x[2:5]
    offset = at.target[:2] - at.x[:2]
    own = [u * math.cos(psi) - v * math.sin(psi), u * math.sin(psi) + v * math.cos(psi)]
    (x_e, y_e), (x_e_dot, y_e_dot) = offset, at.target[2:4] - own
    distance = math.hypot(x_e, y_e)
    return (x_e * x_e_dot + y_e * y_e_dot) / distance, (x_e * y_e_dot - y_e * x_e_dot) / distance**2


def near_target(distance: float, psi: float = 0.1) -> Situation:
    """A moving target that far ahead, seen last in the direction 0.9 rad."""
    memory = np.zeros(60)
    memory[PSI_D_HELD] = 0.9
    x = np.array([0, 0, psi, 0.4, 0.1, 0.2])
    return Situation(x, memory, np.array([distance, 0, 0.3, 0.4, 0, 0]))


def test_the_sign_of_a_zero_is_no_direction():
    for x in (0.0, -0.0):
        for y in (0.0, -0.0):
            assert direction(x, y) == 0.0
            assert direction(2.0, y) == 0.0
            assert direction(-2.0, y) == math.pi
            assert direction(x, 2.0) == -direction(x, -2.0) == 0.5 * math.pi


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (-0.0, 0.0), (-0.0, -0.0)])
def test_a_target_that_rests_where_the_vessel_is_lies_in_no_direction(velocity):
    target = np.array([1.0, 2.0, *velocity, 0.0, 0.0])
    memory = AdaptiveNeural().start(np.array([1.0, 2.0, 0, 0, 0, 0]), target, NONLINEAR)
    assert memory[PSI_D_HELD] == 0.0


def around(law: AdaptiveNeural, count: int = 200) -> list[tuple[Situation, Tracking]]:
    return [(at, seen_by(law, at)) for at in situations(law, count)]


def test_distance_and_direction_are_18_to_20():
    for at, e in around(AdaptiveNeural(fold="none", standoff=0.0)):
        x_e, y_e = at.target[:2] - at.x[:2]
        printed = math.atan(y_e / x_e) + 0.5 * math.pi * (1 - np.sign(x_e)) * np.sign(y_e)
        assert e.psi_d == pytest.approx(printed, abs=1e-12)
        assert (e.distance * math.cos(e.psi_d), e.distance * math.sin(e.psi_d)) == pytest.approx(
            (x_e, y_e)
        )
        assert e.z_e == e.distance
        error = e.psi_d - at.x[2]
        assert -math.pi < e.psi_e <= math.pi
        assert math.cos(e.psi_e - error) == pytest.approx(1.0)


@pytest.mark.parametrize("fold", ["printed", "joint", "none"])
def test_virtual_controls_are_21_and_30_as_printed_while_nothing_is_folded(fold):
    law = AdaptiveNeural(fold=fold, standoff=0.0, k_ze=0.3, k_psie=0.7)
    facing = [(at, e) for at, e in around(law) if e.half_turn == 0.0]
    assert len(facing) > 50
    for at, e in facing:
        forward = at.target[2] * math.cos(e.psi_d) + at.target[3] * math.sin(e.psi_d)
        alpha_u = (0.3 * e.distance + forward - at.x[4] * math.sin(e.psi_e)) / math.cos(e.psi_e)
        assert e.alpha_u == pytest.approx(alpha_u, rel=1e-12)
        assert e.alpha_r == pytest.approx(motion(at)[1] + 0.7 * e.psi_e, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("fold", ["printed", "joint"])
def test_folding_brings_the_error_within_a_right_angle(fold):
    plain = around(AdaptiveNeural(fold="none"))
    folded = around(AdaptiveNeural(fold=fold))
    turned = 0
    for (_, before), (_, after) in zip(plain, folded, strict=True):
        assert abs(after.psi_e) < 0.5 * math.pi
        beyond = abs(before.psi_e) >= 0.5 * math.pi
        turned += beyond
        assert after.half_turn == (-math.copysign(math.pi, before.psi_e) if beyond else 0.0)
        assert after.psi_e == before.psi_e + after.half_turn
        assert (after.psi_d, after.distance, after.w) == (before.psi_d, before.distance, before.w)
    assert 50 < turned < 150


@pytest.mark.parametrize("fold", ["joint", "none"])
def test_virtual_controls_close_the_error_loops(fold):
    # z_e' = -k_ze z_e - (u - alpha_u) cos psi_e and psi_e' = -k_psie psi_e - (r - alpha_r).
    law = AdaptiveNeural(fold=fold, k_ze=0.3, k_psie=0.7, standoff=0.5)
    for at, e in around(law):
        distance_dot, psi_d_dot = motion(at)
        side = -1.0 if e.half_turn and fold == "joint" else 1.0
        assert e.z_e == side * (e.distance - 0.5)
        surge, yaw = (at.x[3] - e.alpha_u) * math.cos(e.psi_e), at.x[5] - e.alpha_r
        assert side * distance_dot == pytest.approx(-0.3 * e.z_e - surge, rel=1e-10, abs=1e-12)
        assert psi_d_dot - at.x[5] == pytest.approx(-0.7 * e.psi_e - yaw, rel=1e-10, abs=1e-12)


def test_folding_as_printed_drives_away_from_the_target():
    # With u = alpha_u the distance obeys z_e' = k_ze z_e + 2P instead of -k_ze z_e.
    law = AdaptiveNeural(fold="printed", k_ze=0.3, standoff=0.0)
    astern = [(at, e) for at, e in around(law) if e.half_turn]
    for at, e in astern:
        at.x[3] = e.alpha_u
        forward = at.target[2] * math.cos(e.psi_d) + at.target[3] * math.sin(e.psi_d)
        growth = 0.3 * e.distance + 2 * forward
        assert motion(at)[0] == pytest.approx(growth, rel=1e-10, abs=1e-12)


@given(psi_e=st.floats(-3.1, 3.1))
def test_standoff_shortens_the_distance_and_nothing_else(psi_e):
    if abs(math.cos(psi_e)) < 1e-3:
        return
    at = Situation(
        np.array([0, 0, -psi_e, 0.4, 0.1, 0.2]), np.zeros(60), np.array([4.0, 0, 0.5, 0, 0, 0])
    )
    near, far = (seen_by(AdaptiveNeural(standoff=s), at) for s in (0.0, 0.5))
    side = -1.0 if near.half_turn else 1.0
    assert far.z_e == near.z_e - side * 0.5
    change = -side * 0.1 * 0.5 / math.cos(near.psi_e)
    assert far.alpha_u - near.alpha_u == pytest.approx(change, rel=1e-9)
    assert far._replace(z_e=0.0, alpha_u=0.0) == near._replace(z_e=0.0, alpha_u=0.0)


@pytest.mark.parametrize(("distance", "held"), [(0.19, True), (0.2, True), (0.21, False)])
def test_the_direction_is_held_near_the_target(distance, held):
    law = AdaptiveNeural(hold_below=0.2)
    memory = np.zeros(60)
    memory[PSI_D_HELD] = 0.9
    at = Situation(
        np.array([0, 0, 0.1, 0.4, 0.1, 0.2]), memory, np.array([distance, 0, 0, 0.5, 0, 0])
    )
    e = seen_by(law, at)
    assert e.psi_d == (0.9 if held else 0.0)
    assert e.w == (0.0 if held else pytest.approx(motion(at)[1]))


def test_on_the_target_the_paper_s_rule_holds_even_with_hold_below_zero():
    memory = np.zeros(60)
    memory[PSI_D_HELD] = 0.9
    at = Situation(
        np.array([3.0, 4.0, 0.1, 0.4, 0.1, 0.2]), memory, np.array([3.0, 4, 0.5, 0, 0, 0])
    )
    e = seen_by(AdaptiveNeural(hold_below=0.0), at)
    assert (e.psi_d, e.w) == (0.9, 0.0)
    assert math.isfinite(e.alpha_u)


def sampled(law: AdaptiveNeural, before: float, direction: float, t: float = 1.0) -> float:
    """The difference quotient after a sample at time t that sees the target in that direction."""
    memory = np.zeros(60)
    memory[PSI_D_HELD] = before
    target = np.array([7 * math.cos(direction), 7 * math.sin(direction), 0, 0, 0, 0])
    call(
        law.sample,
        t=t,
        x=np.zeros(6),
        memory=memory,
        target=target,
        k=bundle(law.constants_with(NONLINEAR)),
        table=law.table(),
    )
    assert memory[PSI_D_HELD] == pytest.approx(direction)
    return float(memory[PSI_D_RATE_HELD])


def test_the_difference_is_remark_5_and_takes_the_short_way_round():
    law = AdaptiveNeural(**DIFFERENCE)
    assert sampled(law, 0.3, 0.32) == pytest.approx(2.0)
    assert sampled(law, math.pi - 0.01, -math.pi + 0.01) == pytest.approx(2.0)
    assert sampled(law, -math.pi + 0.01, math.pi - 0.01) == pytest.approx(-2.0)
    # The paper's example: from 0 to 359 degrees is one degree back.
    assert sampled(law, 0.0, math.radians(-1)) == pytest.approx(math.radians(-1) / 0.01)


@pytest.mark.parametrize(("first", "kick"), [("from_zero", 25 * math.pi), ("from_start", 0.0)])
def test_the_first_difference_at_the_printed_start(first, kick):
    law = AdaptiveNeural(first_difference=first, **DIFFERENCE)
    out = run(corrected(controller=law), 0.0, compiled=False)
    # pi/4 in 0.01 s is 78.5 rad/s.
    assert out["psi_d_rate_held"][0] == pytest.approx(kick, abs=1e-9)
    assert out["alpha_r"][0] == pytest.approx(kick + law.k_psie * math.pi / 4, abs=1e-9)


def test_a_difference_stays_what_it_is_between_two_samples():
    law = AdaptiveNeural(**DIFFERENCE | {"difference_step": 0.05})
    out = run(corrected(controller=law), 2.0, 0.01, compiled=False)
    held = out["psi_d_rate_held"]
    assert all(len(set(held[k : k + 5])) == 1 for k in range(0, 200, 5))
    directions = out["psi_d"][::5]
    np.testing.assert_allclose(held[5::5], np.diff(directions) / 0.05, rtol=1e-9, atol=1e-12)


def test_the_difference_approaches_the_exact_rate_at_first_order():
    def finish(**options: Any) -> Vector:
        # A filter that starts on alpha_r would start on the first difference, which has no past.
        loop = corrected(controller=AdaptiveNeural(filter_start="zero", **options), path=Line())
        return last_state(run(loop, 10.0), loop)[:6]

    exact, steps = finish(), [0.04, 0.02, 0.01]
    errors = [abs(finish(rate="difference", difference_step=h) - exact).max() for h in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.1)
