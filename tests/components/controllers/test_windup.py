"""Anti-windup: nothing where nothing saturates, and memories that stay small where it does."""

from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, PRINTED_START, corrected, kinds, run, situations
from pod_samples import TWIN, pods
from pydantic import ValidationError

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.full_backstepping import FullBackstepping
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.core.kernel import bundle, call, is_kernel
from podusv_cli.core.recording import Recording

CHOOSING = {
    name: kind for name, kind in kinds("controllers").items() if "anti_windup" in kind.model_fields
}
every_law = pytest.mark.parametrize("kind", CHOOSING.values(), ids=CHOOSING)
BOTH: Any = ("none", "auxiliary")


def both(kind: Any, duration: float, **parts: Any) -> list[Recording]:
    """Runs without and with anti-windup."""
    return [
        run(corrected(controller=kind(anti_windup=choice), **parts), duration) for choice in BOTH
    ]


@every_law
def test_where_everything_asked_for_acts_it_changes_nothing(kind):
    without, with_it = both(kind, 5.0)
    for name in without.signals:
        np.testing.assert_array_equal(without[name], with_it[name], err_msg=name)


@every_law
def test_a_law_that_does_not_ask_is_not_told(kind):
    loop = corrected(controller=kind())
    assert loop.controller.wants_loads() is False
    assert not {"xi_u", "xi_r"} & {part.name for part, _ in loop.controller.slots()}
    assert is_kernel(kind.after_saturation)


@every_law
def test_what_is_learnt_does_not_run_away_behind_a_limit(kind):
    """0.5 N can never hold the speed that is asked for."""
    weak = {"actuator": Saturated(surge_limit=0.5, yaw_limit=0.5)}
    without, with_it = both(kind, 60.0, **weak)
    memory = "integral_u" if kind is Pid else "b_hat_u"
    assert np.abs(with_it[memory]).max() < 0.3 * np.abs(without[memory]).max()
    if kind is not Pid:  # which asks for 1100 N for every m/s that it lacks, wound up or not
        assert np.abs(with_it["tau_u_cmd"][-1]) < 0.5 * np.abs(without["tau_u_cmd"][-1])


def test_pid_no_longer_overruns_the_target_and_goes_on_astern():
    without, with_it = both(Pid, 150.0, actuator=Saturated())
    late = without["time"] > 120.0
    assert without["u"][late].mean() < -0.3
    assert with_it["u"][late].mean() > 0.3


@pytest.mark.parametrize("kind", [AdaptiveNeural, FullBackstepping])
def test_behind_a_real_pod_it_decides_whether_the_law_tracks(kind):
    slow = {"n_rate": 200.0, "n_lag": 0.1, "angle_rate": 1.75, "angle_lag": 0.1}
    pair = pods(*({**pod, **slow} for pod in TWIN))
    without, with_it = both(kind, 100.0, actuator=pair, start=PRINTED_START)
    assert without["z_e"][-1] > 5.0
    assert with_it["z_e"][-1] == pytest.approx(0.5, abs=0.2)


def test_the_auxiliary_state_obeys_its_equation():
    """m11 xi_u' = -k_ue xi_u + (tau_u - tau_u_cmd), by trapezoids over the log."""
    law = AdaptiveNeural(anti_windup="auxiliary")
    log = run(corrected(controller=law, actuator=Saturated()), 20.0, 0.001)
    k = NONLINEAR.constants()
    axes = (
        ("xi_u", law.k_ue, k["m11"], "tau_u", "tau_u_cmd"),
        ("xi_r", law.k_re, k["m33"], "tau_r", "tau_r_cmd"),
    )
    for xi, gain, m, made, asked in axes:
        rate = (-gain * log[xi] + log[made] - log[asked]) / m
        grown = np.concatenate([[0.0], np.cumsum(0.0005 * (rate[1:] + rate[:-1]))])
        size = np.abs(log[xi]).max()
        assert size > 0.0
        np.testing.assert_allclose(log[xi], grown, atol=5e-3 * size)


def test_compensated_errors_obey_the_equations_without_limits():
    """The rates of bounds and weights see u_e - xi_u where those without see u_e."""
    law, plain = AdaptiveNeural(anti_windup="auxiliary"), AdaptiveNeural()
    k, k_plain = (bundle(one.constants_with(NONLINEAR)) for one in (law, plain))
    for at in situations(law, 20):
        xi = at.memory[-2:].copy()
        rates = []
        for one, numbers, x in (
            (law, k, at.x),
            (plain, k_plain, at.x - np.array([0, 0, 0, xi[0], 0, xi[1]])),
        ):
            tau, signals, work = np.zeros(2), np.zeros(len(one.signals)), np.zeros(one.workspace())
            rate = np.zeros(len(at.memory))
            call(
                one.law,
                t=0.0,
                x=x,
                memory=at.memory,
                target=at.target,
                k=numbers,
                table=one.table(),
                tau=tau,
                rate=rate,
                signals=signals,
                work=work,
            )
            rates.append((rate[2], signals[4], at.memory[2]))
        (told, u_e, b_hat), _ = rates
        u_c = u_e - xi[0]
        expected = law.gamma_u * (u_c * u_c / (4 * law.partial) - law.sigma_bu * b_hat)
        assert told == pytest.approx(expected, rel=1e-12)


def test_pid_without_a_proportional_gain_has_nothing_to_feed_back_over():
    Pid(K_Pu=0.0)
    with pytest.raises(ValidationError, match="above 0"):
        Pid(K_Pu=0.0, anti_windup="auxiliary")


@pytest.mark.parametrize("compiled", [True, False])
def test_sampled_control_settles_too(compiled):
    law = Pid(anti_windup="auxiliary")
    log = run(corrected(controller=law, actuator=Saturated()), 0.2, hold_every=5, compiled=compiled)
    # The first sample asks for far too much; conditioned, the integral stays where tau would fit.
    short = 8.0 - log["tau_u_cmd"][0]
    u_p = -log["u_e"][0]
    assert log["integral_u"][1] == pytest.approx(0.01 * (u_p + short / law.K_Pu), rel=1e-9)
