"""Several disturbances: their loads add up, and each keeps its own signals."""

import numpy as np
import pytest
from conftest import NONLINEAR, adrift, corrected, load_at, run

from podusv_cli.core.errors import LawError
from podusv_cli.disturbances.current import Current
from podusv_cli.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.disturbances.total import Total

SEA = HarmonicDisturbance()
MORE = HarmonicDisturbance(b_u=Harmonic(mean=3.0), scale=0.5)
FLOW = Current(speed=0.2, speed_std=0.05, direction=1.0)
STATE = np.array([1.0, -2.0, 0.7, 0.8, -0.1, 0.2])


@pytest.mark.parametrize("parts", [(SEA,), (SEA, MORE), (FLOW, SEA), (SEA, FLOW, MORE)])
def test_the_loads_add_up(parts):
    each = sum(load_at(part, 12.3, STATE) for part in parts)
    np.testing.assert_array_equal(load_at(Total(parts=parts), 12.3, STATE), each)


def test_signals_come_in_the_order_of_the_list():
    log = run(adrift(disturbance=Total(parts=(SEA, FLOW))), 1.0)
    alone = run(adrift(disturbance=FLOW), 1.0)
    np.testing.assert_array_equal(log["V_c"], alone["V_c"])
    assert [signal.name for signal in Total(parts=(SEA, FLOW)).signals] == ["V_c", "beta_c"]


def test_machine_code_computes_what_plain_python_does():
    loop = corrected(disturbance=Total(parts=(SEA, FLOW, MORE)))
    fast, slow = (run(loop, 0.5, compiled=compiled) for compiled in (True, False))
    for name in ("b_u", "b_v", "b_r", "x", "y", "psi"):
        np.testing.assert_array_equal(fast[name], slow[name])


def test_two_currents_are_one_too_many():
    with pytest.raises(LawError, match="V_c"):
        corrected(disturbance=Total(parts=(FLOW, Current(seed=2)))).about()


def test_a_bound_is_the_sum_of_bounds_or_unknown():
    assert Total(parts=(SEA, FLOW)).bounds() is None
    together = np.add(SEA.bounds(), MORE.bounds())
    np.testing.assert_allclose(Total(parts=(SEA, MORE)).bounds(), together)


def test_the_kernel_of_a_sum_is_the_same_function_for_the_same_kinds():
    one, other = Total(parts=(SEA, FLOW)), Total(parts=(MORE, Current(seed=9)))
    assert one.kernel_with(NONLINEAR) is other.kernel_with(NONLINEAR)
    assert one.kernel_with(NONLINEAR) is not Total(parts=(FLOW, SEA)).kernel_with(NONLINEAR)
