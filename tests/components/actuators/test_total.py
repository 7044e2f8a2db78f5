"""Several disturbances: their loads add up, and each keeps its own signals."""

import numpy as np
import pytest
from conftest import NONLINEAR, adrift, corrected, load_at, run
from scenario_samples import SOUND, told

from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.disturbances.waves import Waves
from podusv_cli.components.measurements.sensors import Sensor, Sensors
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import bundle, call

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


def test_swell_and_a_wind_sea_add_up():
    """Their signals are those of both; what is of second order in psi_w is not."""
    swell, wind_sea = (
        Waves(height=h, period=p, direction=d, components=8, seed=s, motion=0.1)
        for h, p, d, s in ((0.05, 2.0, 0.3, 1), (0.03, 0.9, 2.0, 2))
    )
    both = Total(parts=(swell, SEA, FLOW, wind_sea))
    names = [signal.name for signal in both.signals]
    assert len(names) == len(set(names)) == 7 + 2
    assert set(corrected(disturbance=both).about()) >= set(names)
    wanted = Total(parts=(SEA, FLOW, swell)), wind_sea
    loads = [all_of(part, 12.3) for part in (both, *wanted)]
    for name in ("b_u", "b_v", "b_r", *names):
        parts = loads[1][name] + loads[2].get(name, 0.0)
        assert loads[0][name] == pytest.approx(parts, rel=1e-12), name
    log = run(
        adrift(disturbance=both, measurement=Sensors(position=Sensor(period=0.01))),
        0.2,
        compiled=False,
    )
    np.testing.assert_allclose(log["x_m"], log["x"] + log["x_w"], rtol=0, atol=1e-15)


def all_of(part, t):
    """Load and signals by name."""
    b = np.full(3 + len(part.signals), np.nan)
    k, table = bundle(part.constants_with(NONLINEAR)), part.table_for(NONLINEAR, 400.0)
    evaluate = part.kernel_with(NONLINEAR)
    call(evaluate, t=t, x=STATE, k=k, table=table, b=b, again=0.0, stage=0.0)
    names = ("b_u", "b_v", "b_r", *(signal.name for signal in part.signals))
    return dict(zip(names, b.tolist(), strict=True))


def test_a_scenario_may_have_two_seas_and_not_two_currents():
    seas = "[{kind: waves, height: 0.05, period: 2}, {kind: waves, height: 0.03, period: 1}]"
    assert not told(SOUND.replace("{kind: none}", seas))
    (line,) = told(SOUND.replace("{kind: none}", "[{kind: current}, {kind: current}]"))
    assert "disturbance[1]: logs V_c, as disturbance[0] does; keep one of them" in line


def test_a_bound_is_the_sum_of_bounds_or_unknown():
    assert Total(parts=(SEA, FLOW)).bounds() is None
    together = np.add(SEA.bounds(), MORE.bounds())
    np.testing.assert_allclose(Total(parts=(SEA, MORE)).bounds(), together)


def test_the_kernel_of_a_sum_is_the_same_function_for_the_same_kinds():
    one, other = Total(parts=(SEA, FLOW)), Total(parts=(MORE, Current(seed=9)))
    assert one.kernel_with(NONLINEAR) is other.kernel_with(NONLINEAR)
    assert one.kernel_with(NONLINEAR) is not Total(parts=(FLOW, SEA)).kernel_with(NONLINEAR)
