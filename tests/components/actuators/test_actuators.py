"""Actuators: limits, their flag, and demands that are no numbers."""

import math
from typing import Any, Literal

import numpy as np
import pytest
from conftest import Constant, adrift, example, kinds, run
from hypothesis import given
from hypothesis import strategies as st

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.actuators.ideal_full import IdealFull
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.actuators.saturated_full import SaturatedFull
from podusv_cli.core.kernel import Vector, bundle, call, kernel

every_kind = pytest.mark.parametrize("kind", kinds("actuators").values(), ids=kinds("actuators"))


def drive(
    actuator: Actuator, surge: float, yaw: float, sway: float = 0.0
) -> tuple[Vector, Vector, Vector]:
    """(tau_u, tau_v, tau_r), signals and rate of the state for a demand."""
    tau, signals = np.full(3, np.nan), np.full(len(actuator.signals), np.nan)
    state, rate = actuator.rest(), np.full(len(actuator.states), np.nan)
    x, k = np.array([0, 0, 0, 0.5, 0, 0]), bundle(actuator.constants())
    demand = np.array([surge, yaw, sway])
    call(
        actuator.drive,
        t=1.0,
        x=x,
        state=state,
        demand=demand,
        k=k,
        table=actuator.table(),
        tau=tau,
        rate=rate,
        signals=signals,
    )
    return tau, signals, rate


@given(surge=st.floats(-1e6, 1e6), yaw=st.floats(-1e6, 1e6))
def test_limits_hold_on_each_axis_by_itself(surge, yaw):
    tau, (flag,), _ = drive(Saturated(), surge, yaw)
    np.testing.assert_array_equal(tau, [np.clip(surge, -8, 8), 0, np.clip(yaw, -2.5, 2.5)])
    assert flag == (1.0 if abs(surge) > 8 or abs(yaw) > 2.5 else 0.0)


def test_a_demand_at_the_limit_is_not_saturated():
    assert drive(Saturated(surge_limit=3.0, yaw_limit=1.0), -3.0, 1.0)[1] == 0.0


@given(surge=st.floats(allow_nan=False), yaw=st.floats(allow_nan=False))
def test_the_ideal_actuator_does_what_it_is_told(surge, yaw):
    np.testing.assert_array_equal(drive(Ideal(), surge, yaw)[0], [surge, 0.0, yaw])


@given(surge=st.floats(-1e6, 1e6), yaw=st.floats(-1e6, 1e6), sway=st.floats(-1e6, 1e6))
def test_three_limits_hold_each_by_itself(surge, yaw, sway):
    limits = SaturatedFull(surge_limit=2.0, yaw_limit=1.5, sway_limit=0.7)
    tau, (flag,), _ = drive(limits, surge, yaw, sway)
    expected = [np.clip(surge, -2, 2), np.clip(sway, -0.7, 0.7), np.clip(yaw, -1.5, 1.5)]
    np.testing.assert_array_equal(tau, expected)
    assert flag == (1.0 if abs(surge) > 2 or abs(yaw) > 1.5 or abs(sway) > 0.7 else 0.0)


def test_who_pushes_sideways_has_rank_three_and_who_does_not_has_two():
    np.testing.assert_array_equal(IdealFull().input_matrix(), [[1, 0, 0], [0, 0, 1], [0, 1, 0]])
    assert [kind().input_rank() for kind in (IdealFull, SaturatedFull, Ideal)] == [3, 3, 2]


@every_kind
@pytest.mark.parametrize("demand", [(math.nan, 0.5), (0.5, math.nan), (math.nan, math.nan)])
def test_a_demand_that_is_no_number_never_becomes_a_finite_load(kind, demand):
    tau, _, rate = drive(example(kind), *demand)
    # At once, or with the lag that the state's rate stands for.
    assert not np.isfinite(np.concatenate([tau, rate])).all()


class HiddenNaN(Constant):
    """No number between the instants of a step of 0.01 s, where nobody logs it."""

    kind: Literal["hidden_nan"] = "hidden_nan"

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
        """Right at t = 0 and 0.01, wrong at 0.015."""
        tau[0] = math.nan if 0.012 < t < 0.018 else 1.0
        tau[1] = 0.0


@pytest.mark.parametrize("compiled", [True, False])
def test_a_limit_does_not_hide_what_is_no_number_inside_a_step(compiled):
    out = run(adrift(actuator=Saturated(), controller=HiddenNaN()), 0.1, compiled=compiled)
    assert out.status == "diverged"
    assert len(out["time"]) == 2
