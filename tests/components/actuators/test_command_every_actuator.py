"""Command path and failure around every kind of actuator."""

import math
from typing import Any, Literal

import numpy as np
import pytest
from conftest import SMOOTH_START, corrected, example, kinds, run

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.paths.line import Line
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, bundle, is_kernel, kernel

every_kind = pytest.mark.parametrize("kind", kinds("actuators").values(), ids=kinds("actuators"))
PATH = {
    "delay": 0.2,
    "dead_zone_u": 0.3,
    "dead_zone_r": 0.05,
    "resolution_u": 0.1,
    "resolution_r": 0.02,
}


class Half(Actuator):
    """An actuator as a plug-in may bring it: it gives half of the demand, with a lag."""

    kind: Literal["half"] = "half"
    lag: float = value(0.5, "s", "time constant", gt=0)

    @property
    def states(self):
        """The force."""
        from podusv_cli.core.signal import Signal

        return (Signal("force", "N", "force of the test's actuator"),)

    @staticmethod
    @kernel
    def drive(
        t: float,
        x: Vector,
        state: Vector,
        demand: Vector,
        k: Any,
        table: Vector,
        tau: Vector,
        rate: Vector,
        signals: Vector,
    ) -> None:
        """Half of the surge force only."""
        rate[0] = (0.5 * demand[0] - state[0]) / k.lag
        tau[0], tau[1], tau[2] = state[0], 0.0, 0.0


BOTH = ("command", "failure")
# The code for pods with one of the parts takes seconds to compile. With both, the kernel that fails
# is inside the one that is commanded, and other actuators have either alone.
TAKEN = [
    pytest.param(kind, parts, marks=[pytest.mark.slow] * (kind is Pods and parts != BOTH))
    for kind in (Half, *kinds("actuators").values())
    for parts in (BOTH[:1], BOTH[1:], BOTH)
]


@pytest.mark.parametrize(("kind", "parts"), TAKEN)
def test_every_actuator_takes_both_and_computes_the_same_bits_either_way(kind, parts):
    actuator = staged(kind, parts)
    loop = corrected(actuator=actuator, controller=Pid(), path=Line(), start=SMOOTH_START)
    machine, plain = (run(loop, 1.0, compiled=compiled) for compiled in (True, False))
    assert machine.status == "finished"
    assert ("tau_u_in" in machine.signals) == ("command" in parts)
    for name in plain.signals:
        np.testing.assert_array_equal(machine[name], plain[name], err_msg=name)


def staged(kind: Any, parts: tuple[str, ...]) -> Any:
    """An actuator of this kind with these parts around it."""
    pod = {"pod": 0} if kind is Pods else {}
    given = {"command": PATH, "failure": {"time": 0.5, "effectiveness": 0.5, **pod}}
    return kind.model_validate(
        example(kind).model_dump() | {name: given[name] for name in parts}, strict=False
    )


@every_kind
def test_without_them_the_kernel_is_the_actuator_s_own(kind):
    actuator = example(kind)
    assert actuator.drive_with() is kind.drive
    assert actuator.signals_with == actuator.signals
    assert not {name for name in actuator.constants() if name.startswith(("command", "failure"))}


@every_kind
def test_equal_kinds_have_the_same_kernel(kind):
    for parts in (BOTH[:1], BOTH[1:], BOTH):
        one, other = staged(kind, parts), staged(kind, parts)
        assert one.drive_with() is other.drive_with()
        assert is_kernel(one.drive_with())


@every_kind
@pytest.mark.parametrize("demand", [(math.nan, 0.5), (0.5, math.nan), (math.inf, math.inf)])
def test_a_demand_that_is_no_number_is_not_hidden(kind, demand):
    actuator = staged(kind, BOTH)
    tau, signals = np.full(3, np.nan), np.full(len(actuator.signals_with), np.nan)
    rate, k = np.full(len(actuator.states), np.nan), bundle(actuator.constants())
    asked = np.array([*demand, 0.0, 0.0])
    with np.errstate(invalid="ignore"):
        actuator.drive_with()(
            0.0, np.zeros(6), actuator.rest(), asked, k, actuator.table(), tau, rate, signals
        )
    assert not np.isfinite(signals[:2]).all()


@every_kind
def test_what_the_healthy_actuator_can_do_is_as_before(kind):
    plain, actuator = example(kind), staged(kind, BOTH)
    assert actuator.limits() == plain.limits()
    np.testing.assert_array_equal(actuator.input_matrix(), plain.input_matrix())
