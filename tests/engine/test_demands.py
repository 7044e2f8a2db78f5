"""A sway force is held, delayed and lost like the other two demands."""

from typing import Literal

import numpy as np
import pytest
from conftest import adrift, run

from podusv_cli.components.actuators.ideal_full import IdealFull
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.kernel import Vector, kernel

LATE = {"command": {"delay": 0.3}}
OPTIONS = ({}, LATE, {**LATE, "failure": {"time": 1.0, "effectiveness": 0.25}})


class Sideways(Controller):
    """A law for tests: each demand is another function of time."""

    kind: Literal["sideways"] = "sideways"

    def asks_sway(self) -> bool:
        """Always."""
        return True

    @staticmethod
    @kernel
    def law(t: float, x: Vector, tau: Vector) -> None:
        """Three demands."""
        tau[0], tau[1], tau[2] = 1.0 + t, 2.0 - t, 3.0 * t - x[4]


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("hold", [0, 5])
@pytest.mark.parametrize("options", OPTIONS, ids=["at once", "late", "late and lost"])
def test_a_third_demand_is_held_delayed_and_lost_like_the_others(options, hold, compiled):
    actuator = IdealFull.model_validate(options, strict=False)
    loop = adrift(controller=Sideways(), actuator=actuator)
    log = run(loop, 2.0, 0.1, hold_every=hold, compiled=compiled)
    names = ("tau_u", "tau_r", "tau_v")
    asked, got = (np.array([log[name + end] for name in names]) for end in ("_cmd", ""))
    late = 3 if "command" in options else 0
    expected = np.zeros_like(asked)
    expected[:, late:] = asked[:, : asked.shape[1] - late]
    expected[:, 10:] *= 0.25 if "failure" in options else 1.0
    np.testing.assert_array_equal(got, expected)
    assert len(np.unique(asked[2])) == (5 if hold else 21)


def test_each_demand_has_a_resolution_and_a_dead_zone_of_its_own():
    path = {"resolution_u": 0.5, "resolution_r": 0.25, "resolution_v": 0.125}
    zones = {"dead_zone_u": 0.25, "dead_zone_r": 0.125, "dead_zone_v": 0.5}
    actuator = IdealFull.model_validate({"command": path | zones}, strict=False)
    log = run(adrift(controller=Sideways(), actuator=actuator), 2.0, 0.1)
    for axis in "urv":
        rounded = np.round(log[f"tau_{axis}_cmd"] / path[f"resolution_{axis}"])
        rounded *= path[f"resolution_{axis}"]
        left = np.sign(rounded) * np.maximum(np.abs(rounded) - zones[f"dead_zone_{axis}"], 0.0)
        np.testing.assert_array_equal(log[f"tau_{axis}"], left)
        np.testing.assert_array_equal(log[f"tau_{axis}_in"], left)
