"""The engine: what is logged, when the law acts, how a run ends, and both ways of running it."""

import math
import time
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from conftest import (
    GENTLE,
    NONLINEAR,
    SMOOTH_START,
    VESSELS,
    Constant,
    adrift,
    ask,
    corrected,
    load_at,
    run,
    target_at,
)
from hypothesis import given
from hypothesis import strategies as st

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.full_backstepping import FullBackstepping
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.disturbances.harmonic import HarmonicDisturbance
from podusv_cli.components.disturbances.total import Total
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.recording import Recording
from podusv_cli.core.steps import whole_steps
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop, Probe
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.running.thread import Work
from podusv_cli.engine.step.grid import TimeGrid


def same(one: Recording, other: Recording) -> bool:
    """Whether every number of two recordings is the same to the last bit."""
    assert one.signals.keys() == other.signals.keys()
    return all(np.array_equal(one[name], other[name]) for name in one.signals)


@kernel
def _integrate(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    seen[0] += weight
    seen[1] += weight * s[0]
    seen[2] += 1.0


WATCH = Probe(_integrate, 3)


def test_the_same_loop_gives_the_same_bits_whatever_the_blocks():
    loop = corrected(actuator=Saturated())
    once = run(loop, 60.0)
    assert same(once, run(loop, 60.0))
    assert same(once, run(loop, 60.0, progress=lambda _: time.sleep(0.01)))


class Current(Calm):
    """A disturbance for tests: one that looks at the state."""

    kind: Literal["current"] = "current"
    of_time: ClassVar[bool] = False

    @staticmethod
    @kernel
    def evaluate(t: float, x: Vector, k: Any, table: Vector, b: Vector) -> None:
        """Against the velocities."""
        b[0], b[1], b[2] = -20.0 * x[3], 0.0, 0.0


class Asked(HarmonicDisturbance):
    """(52), evaluated at every stage."""

    of_time: ClassVar[bool] = False


def test_a_load_that_depends_on_the_state_is_evaluated_at_every_stage():
    """The order of the method, which it loses where a stage takes over the load of another."""
    loop = adrift(disturbance=Current(), controller=Constant(surge=9.0))
    fine, half, whole = (run(loop, 32.0, h)["x"][-1] for h in (0.05, 0.8, 1.6))
    assert abs(whole - fine) > 12 * abs(half - fine) > 0


@pytest.mark.parametrize("hold_every", [0, 5])
def test_not_evaluating_a_load_twice_changes_no_bit(hold_every):
    loop = corrected(disturbance=HarmonicDisturbance())
    asked = run(replace(loop, disturbance=Asked()), 20.0, hold_every=hold_every)
    assert same(asked, run(loop, 20.0, hold_every=hold_every))


def test_a_disturbance_is_told_what_it_may_leave_out():
    """An evaluation that is one more at its time, and one whose signals nobody reads."""
    told = []

    class Telling(Calm):
        of_time: ClassVar[bool] = False

        @staticmethod
        def evaluate(t, x, k, table, b, again=0.0, stage=0.0):
            b[:3] = 0.0
            told.append((t, again, stage))

    whole = Total(parts=(Telling(), Calm()))
    run(adrift(disturbance=whole), 1.0, 0.5, compiled=False)
    a_step = [(0.25, 0.0, 1.0), (0.25, 1.0, 1.0), (0.5, 0.0, 1.0), (0.5, 1.0, 0.0)]
    assert told[:5] == [(0.0, 0.0, 0.0), *a_step]
    assert told[5:] == [(0.5 + t, again, stage) for t, again, stage in a_step]


def test_time_is_a_whole_number_of_steps():
    out = run(adrift(), 60.0, 0.1)
    np.testing.assert_array_equal(out["time"], [k * 0.1 for k in range(601)])


@given(steps=st.integers(0, 10**6), step=st.sampled_from([0.001, 0.01, 0.02, 0.1, 1 / 3]))
def test_whole_steps_are_found_and_nothing_else(steps, step):
    assert whole_steps(steps * step, step) == steps
    assert whole_steps((steps + 0.3) * step, step) is None


def test_every_row_is_one_instant():
    """Each column of a row belongs to the row's own time and state, not to a stage in between."""
    law = FullBackstepping()
    told, start = VESSELS["cybership2"], SMOOTH_START
    loop = corrected(controller=law, nominal=told, actuator=Saturated(), start=start)
    out = run(loop, 0.5, compiled=False)
    for i, t in enumerate(out["time"]):
        x = np.array([out[name][i] for name in STATE])
        target = target_at(loop.path, t)
        assert [out["x_d"][i], out["y_d"][i]] == target[:2].tolist()
        assert [out[name][i] for name in ("b_u", "b_v", "b_r")] == load_at(
            loop.disturbance, t
        ).tolist()
        memory = np.concatenate([np.ravel(out[part.name][i]) for part, _ in law.slots()])
        # The law knows the nominal vessel only: another one than is simulated here.
        said = ask(law, x, memory, target, told)
        assert [out["tau_u_cmd"][i], out["tau_r_cmd"][i]] == said.tau.tolist()
        assert {part.name: out[part.name][i] for part in law.signals} == said.signals
        assert out["tau_u"][i] == np.clip(said.tau[0], -8, 8)
        assert not np.array_equal(said.tau, ask(law, x, memory, target, NONLINEAR).tau)


def test_the_plant_is_the_vessel_whatever_the_law_is_told():
    start = (0.0, 0.0, 0.3, 1.0, 0.2, 0.1)
    for told in VESSELS.values():
        out = run(adrift(vessel=NONLINEAR, nominal=told, start=start), 2.0)
        assert same(out, run(adrift(vessel=NONLINEAR, start=start), 2.0))


@pytest.mark.parametrize("log_every", [7, 10, 64])
def test_thinning_the_log_drops_rows_and_changes_nothing(log_every):
    full = run(corrected(), 3.0, probe=WATCH)
    thin = run(corrected(), 3.0, probe=WATCH, log_every=log_every)
    assert len(thin["time"]) == 300 // log_every + 1
    for name in full.signals:
        np.testing.assert_array_equal(thin[name], full[name][::log_every])
    assert full.seen is not None
    np.testing.assert_array_equal(thin.seen, full.seen)


def test_an_observer_sees_every_instant_with_trapezoidal_weights():
    out = run(corrected(), 3.0, probe=WATCH, log_every=100)
    full = run(corrected(), 3.0)
    assert out.seen is not None
    integral = np.trapezoid(full["x"], full["time"])
    np.testing.assert_allclose(out.seen, [3.0, integral, 301], rtol=1e-12)


def test_sampled_control_is_the_law_at_samples_held_in_between():
    law = GENTLE
    loop = corrected(controller=law, start=SMOOTH_START)
    out = run(loop, 1.0, hold_every=20)
    for name in ("tau_u_cmd", "tau_r_cmd", "alpha_u", "alpha_r", "psi_e", "u_e", "f_hat_r"):
        assert all(len(set(out[name][k : k + 20])) == 1 for k in range(0, 100, 20))
    for i in range(0, 101, 20):
        x = np.array([out[name][i] for name in STATE])
        memory = np.concatenate([np.ravel(out[part.name][i]) for part, _ in law.slots()])
        said = ask(law, x, memory, target_at(loop.path, out["time"][i]), NONLINEAR)
        assert [out["tau_u_cmd"][i], out["tau_r_cmd"][i]] == pytest.approx(said.tau, rel=1e-12)
    # The memory goes on between samples, with the measurement held: beta' = decay (alpha - beta).
    alpha, beta = out["alpha_u"], out["beta_u"]
    decay = (law.A_u + abs(alpha[:-1])) * 0.01
    expected = alpha[:-1] + (beta[:-1] - alpha[:-1]) * np.exp(-decay)
    np.testing.assert_allclose(beta[1:], expected, rtol=1e-8)


@pytest.mark.parametrize("period", [0.015, 1e-12])
def test_a_difference_that_fits_no_step_is_refused(period):
    loop = corrected(controller=AdaptiveNeural(rate="difference", difference_step=period))
    with pytest.raises(ValueError, match=f"samples every {period:g} s, no whole number of steps"):
        simulate(loop, TimeGrid(0.01, 10), compiled=False)


def test_a_difference_within_a_held_measurement_is_refused():
    # The law would see in its memory what it has not been given to measure.
    loop = corrected(controller=AdaptiveNeural(rate="difference", difference_step=0.01))
    with pytest.raises(ValueError, match=r"0\.01"):
        simulate(loop, TimeGrid(0.01, 10, hold_every=10), compiled=False)


class Exploding(Constant):
    """A demand that is no number any more from t = 0.5 s on."""

    kind: Literal["exploding"] = "exploding"

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
        """1 N, then infinity."""
        tau[0] = 1.0 if t < 0.4999 else math.inf
        tau[1] = 0.0


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(("hold_every", "culprit"), [(0, "u"), (10, "tau_u_cmd")])
def test_divergence_is_reported_where_it_happens(hold_every, culprit, compiled):
    # Continuously, the last stage of the step to 0.5 s has seen it; sampled, only the law has.
    loop = adrift(controller=Exploding())
    out = run(loop, 5.0, hold_every=hold_every, compiled=compiled)
    assert out.status == "diverged"
    assert out.message.startswith(f"diverged at t = 0.5 s: {culprit} is not finite")
    assert f"time 0.49, x {out['x'][-1]:.4g}" in out.message
    assert len(out["time"]) == 50
    assert all(np.isfinite(signal).all() for signal in out.signals.values())
    whole = run(adrift(controller=Constant(surge=1.0)), 0.49)
    np.testing.assert_array_equal(out["x"], whole["x"])
    assert len(run(loop, 5.0, log_every=7, compiled=False)["time"]) == 8


@pytest.mark.parametrize("compiled", [True, False])
def test_a_run_that_leaves_the_numbers_ends_alike_in_both_ways(compiled):
    # Plain Python's sin, cos and ceil raise where machine code returns no number.
    law = AdaptiveNeural(rate="difference", first_difference="from_zero", k_psie=0.01)
    out = run(corrected(controller=law, start=(-10, -10, 0, 0, 0, 1e5)), 5.0, compiled=compiled)
    assert out.status == "diverged"
    assert "is not finite" in out.message


def test_an_interrupt_keeps_the_rows_so_far():
    def press(_: float) -> None:
        raise KeyboardInterrupt

    loop = corrected(controller=Pid())
    out = run(loop, 1e5, log_every=10, progress=press)
    assert out.status == "interrupted"
    assert 0 < len(out["time"]) < 1e6
    whole = run(loop, out["time"][-1], log_every=10)
    for name in out.signals:
        np.testing.assert_array_equal(out[name], whole[name])
    # As `Recording` promises: the message says how a run ended that did not finish.
    reached = float(out.message.removeprefix("interrupted after t = ").removesuffix(" s"))
    assert -0.001 < reached - out["time"][-1] < 0.1


def test_progress_grows_to_one_and_the_log_takes_no_notice():
    fractions: list[float] = []
    loop = corrected(disturbance=HarmonicDisturbance(scale=0.5))
    assert same(run(loop, 60.0, progress=fractions.append), run(loop, 60.0))
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_work_that_is_over_before_anybody_looks_reports_its_end():
    class AtOnce(Work):
        def start(self):
            self._run()

    heard = []
    AtOnce(lambda: 7).finish(heard.append)
    assert heard == [7]


def test_no_steps_is_the_start_alone():
    out = run(corrected(), 0.0)
    assert (out.status, out["time"].tolist(), out["x"].tolist()) == ("finished", [0.0], [-10.0])


def test_a_run_leaves_its_loop_as_it_was():
    loop = corrected()
    before = Plan(loop, TimeGrid(0.01, 1)).first_memory
    run(loop, 1.0)
    assert isinstance(loop, ClosedLoop)
    np.testing.assert_array_equal(Plan(loop, TimeGrid(0.01, 1)).first_memory, before)


def test_an_interrupt_after_the_last_step_does_not_cut_a_run_short():
    def press(fraction: float) -> None:
        if fraction == 1.0:
            raise KeyboardInterrupt

    out = run(corrected(), 1.0, progress=press)
    assert (out.status, len(out["time"])) == ("finished", 101)
