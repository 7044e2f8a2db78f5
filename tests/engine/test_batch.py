"""Many runs at once give what each gives alone, and none stands in another's way."""

from __future__ import annotations

import math
import re
import threading
import weakref
from _ctypes import FUNCFLAG_PYTHONAPI
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from conftest import Constant, adrift, corrected

from benchmarks.variants import variants
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.dsc import DynamicSurface
from podusv_cli.components.controllers.network import Network
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.paths.waypoints import Waypoints
from podusv_cli.core.component import value
from podusv_cli.core.errors import LawError
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import signatures
from podusv_cli.engine.running.batch import Batch, Lazily, simulate_many
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics.table import metrics_probe

GRID = TimeGrid(0.01, 2000)
SETTINGS = {"steady_fraction": 0.5, "settling_radius": 12.0}
COUNT = 7


def spread_out(**parts: Any) -> list[ClosedLoop]:
    """Loops that differ in every part, and in the tables of law and path."""
    loop = corrected(actuator=Saturated(), **parts)
    several = variants(
        loop,
        {
            "vessel.m": np.linspace(20, 30, COUNT),
            "nominal.X_u": np.linspace(-1, -0.5, COUNT),
            "disturbance.b_u.mean": np.linspace(0, 0.5, COUNT),
            "actuator.surge_limit": np.linspace(5, 9, COUNT),
            "controller.k_ze": np.linspace(0.05, 0.15, COUNT),
            "start.x": np.linspace(-15, -5, COUNT),
        },
    )
    return [
        replace(
            each,
            path=Waypoints(points=((0, 0), (10 + i, 1), *((20 + j, 6) for j in range(1 + i % 2)))),
            controller=each.controller.model_copy(update={"network": Network(spread=0.6 + i / 50)}),
        )
        for i, each in enumerate(several)
    ]


@pytest.mark.parametrize("workers", [1, 2, 5])
@pytest.mark.parametrize("law", [AdaptiveNeural(rate="difference"), DynamicSurface()])
def test_every_run_has_the_bits_and_metrics_of_a_run_alone(law: Any, workers: int) -> None:
    loops = spread_out(controller=law)
    probe = metrics_probe(Plan(loops[0], GRID), **SETTINGS)
    batch = simulate_many(loops, GRID, probe=probe, workers=workers)
    metrics = probe.summaries(batch.seen)
    for i, loop in enumerate(loops):
        alone = simulate(loop, GRID, probe=metrics_probe(Plan(loop, GRID), **SETTINGS))
        assert (batch.status[i], batch.reached[i]) == (alone.status, GRID.steps + 1)
        np.testing.assert_array_equal(batch.state[i], [alone[name][-1] for name in STATE])
        np.testing.assert_array_equal(batch.seen[i], alone.seen)
        assert alone.seen is not None
        expected = probe.summary(alone.seen)
        np.testing.assert_array_equal([metrics[name][i] for name in expected], [*expected.values()])
    assert len(set(metrics["iae"])) == COUNT  # the runs do differ


class Lost(Constant):
    """A law for tests: a demand that is no number any more from `until` on."""

    kind: Literal["lost"] = "lost"
    until: float = value(math.inf, "s", "end of the finite demand", allow_inf_nan=True)

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
        tau[0] = 1.0 if t < k.until else math.inf
        tau[1] = 0.0


def test_a_run_that_diverges_stops_no_other() -> None:
    loops = variants(adrift(controller=Lost()), {"controller.until": [30.0, 4.999, 30.0, 2.499]})
    probe = metrics_probe(Plan(loops[0], GRID), **SETTINGS)
    batch = simulate_many(loops, GRID, probe=probe)
    assert batch.status.tolist() == ["finished", "diverged", "finished", "diverged"]
    assert batch.reached.tolist() == [2001, 500, 2001, 250]
    broke = "at t = {} s: u is not finite"
    assert batch.cause.tolist() == ["", broke.format(5), "", broke.format(2.5)]
    np.testing.assert_array_equal(np.isfinite(batch.state).all(axis=1), batch.reached == 2001)
    for loop, row in zip(loops, batch.seen, strict=True):
        np.testing.assert_array_equal(row, simulate(loop, GRID, probe=probe).seen)


def test_a_march_lets_go_of_the_interpreters_lock() -> None:
    for prototype in (signatures.ADVANCE, signatures.RATES_ALONG):
        assert not prototype._flags_ & FUNCFLAG_PYTHONAPI


def interrupted(loops: list[ClosedLoop], grid: TimeGrid) -> Batch:
    """A batch of one worker whose user interrupts after two runs."""

    def press(fraction: float) -> None:
        if fraction >= 2 / len(loops):
            raise KeyboardInterrupt

    probe = metrics_probe(Plan(loops[0], grid), **SETTINGS)
    return simulate_many(loops, grid, probe=probe, workers=1, progress=press)


def test_an_interrupt_keeps_the_runs_that_are_done() -> None:
    loops, others = [corrected()] * 40, set(threading.enumerate())
    probe = metrics_probe(Plan(loops[0], TimeGrid(0.01, 100_000)), **SETTINGS)
    batch = interrupted(loops, TimeGrid(0.01, 100_000))
    done = batch.status == "finished"
    assert 2 <= done.sum() < 40
    assert set(batch.status) == {"finished", "interrupted"}
    iae = probe.summaries(batch.seen)["iae"]
    assert len(set(iae[done])) == 1
    never = batch.reached == 0
    assert never.any()
    assert np.isnan(iae[never]).all()
    assert np.isnan(batch.state[never]).all()
    for thread in set(threading.enumerate()) - others:
        thread.join(10.0)
        assert not thread.is_alive()


@pytest.mark.parametrize(
    "other",
    [
        corrected(controller=Pid()),
        corrected(path=Waypoints(points=((0, 0), (1, 1)))),
        corrected(actuator=Saturated()),
        corrected(controller=AdaptiveNeural(network=Network(nodes=(2, 3, 3)))),
        corrected(controller=AdaptiveNeural(rate="difference")),
    ],
)
def test_a_loop_of_another_structure_is_invalid(other: ClosedLoop) -> None:
    batch = simulate_many([corrected(), other], TimeGrid(0.01, 10))
    assert batch.status.tolist() == ["finished", "invalid"]
    assert re.fullmatch(r"it has another structure than the batch: .* not .*", batch.cause[1])
    # The same structure for every part of a study, whichever run is its first.
    turned = simulate_many([other, corrected()], TimeGrid(0.01, 10), like=corrected())
    assert turned.status.tolist() == ["invalid", "finished"]


def test_no_runs_are_an_empty_batch() -> None:
    probe = metrics_probe(Plan(corrected(), GRID), **SETTINGS)
    batch = simulate_many([], GRID, probe=probe)
    assert (len(batch.status), batch.seen.shape) == (0, (0, probe.size))
    assert probe.summaries(batch.seen)["iae"].shape == (0,)


class Faulty(Lost):
    """A law for tests: it raises an exception before the run where it is told to."""

    kind: Literal["faulty"] = "faulty"  # type: ignore[assignment]
    sound: float = value(1.0, "", "0: it raises")

    def start(self, x: Vector, target: Vector, nominal: Any) -> Vector:
        """Divide by zero, or not."""
        return super().start(x, target, nominal) * (1.0 / self.sound)


def test_no_run_that_fails_changes_a_bit_of_the_others() -> None:
    """Every twentieth run is no loop at all, raises, has another structure, or diverges."""
    sound = variants(corrected(), {"start.x": np.linspace(-15, -5, 100)})
    ends = {3: "invalid", 23: "crashed", 43: "invalid", 63: "diverged", 83: "crashed"}
    bad: dict[int, Any] = {
        3: ValueError("start.x: draw 3 is\nno number"),
        23: KeyError("gone"),
        43: adrift(),
        63: replace(corrected(), start=(0.0, 0.0, 0.0, 1e301, 0.0, 0.0)),
        83: SystemExit(7),
    }

    def make(position: int) -> ClosedLoop:
        made = bad.get(position, sound[position])
        if isinstance(made, BaseException):
            raise made
        return made

    grid, fractions = TimeGrid(0.01, 20), list[float]()
    probe = metrics_probe(Plan(sound[0], grid), **SETTINGS)
    whole = simulate_many(sound, grid, probe=probe, workers=1)
    mixed = simulate_many(
        Lazily(100, make), grid, probe=probe, workers=3, progress=fractions.append
    )
    others = [i for i in range(100) if i not in ends]
    assert {i: mixed.status[i] for i in ends} == ends
    assert set(mixed.status[others]) == {"finished"}
    assert not any(mixed.cause[others])
    for rows in ("seen", "state", "reached"):
        assert getattr(mixed, rows)[others].tobytes() == getattr(whole, rows)[others].tobytes()
    assert mixed.cause[3] == "start.x: draw 3 is no number"
    assert re.fullmatch(r"KeyError: 'gone' \(test_batch.py, line \d+\)", mixed.cause[23])
    assert mixed.cause[63] == "at t = 0 s: u is not finite"
    assert np.isnan(mixed.seen[[3, 23, 43, 83]]).all()
    assert fractions == [i / 100 for i in range(1, 101)]


def test_a_law_that_raises_before_the_run_ends_that_run() -> None:
    loops = variants(adrift(controller=Faulty()), {"controller.sound": [1.0, 0.0, 1.0]})
    batch = simulate_many(loops, TimeGrid(0.01, 10))
    assert batch.status.tolist() == ["finished", "crashed", "finished"]
    assert batch.cause[1].startswith("ZeroDivisionError: float division by zero (test_batch.py")


@pytest.mark.parametrize(("side_by_side", "limit"), [(False, 6), (True, 26)])
def test_lazy_loops_are_made_when_their_runs_begin_and_not_kept(
    side_by_side: bool, limit: int
) -> None:
    alive: weakref.WeakSet[Any] = weakref.WeakSet()
    most = 0

    def make(position: int) -> ClosedLoop:
        nonlocal most
        law = Pid(K_Pu=100.0 + position)
        alive.add(law)
        most = max(most, len(alive))
        return corrected(controller=law)

    like = corrected(controller=Pid())
    batch = simulate_many(
        Lazily(50, make), TimeGrid(0.01, 10), workers=2, like=like, side_by_side=side_by_side
    )
    assert set(batch.status) == {"finished"}
    assert most <= limit  # two threads' runs, the next ones, and what has not been collected


def test_an_interrupt_while_a_loop_is_made_keeps_what_is_done() -> None:
    def make(position: int) -> ClosedLoop:
        if position == 3:
            raise KeyboardInterrupt
        return corrected()

    grid, loops = TimeGrid(0.01, 10), Lazily(5, make)
    batch = simulate_many(loops, grid, workers=1, side_by_side=False)  # else they wait for others
    assert batch.status.tolist() == ["finished"] * 3 + ["interrupted"] * 2


def test_a_kernel_that_cannot_be_compiled_is_raised() -> None:
    class Broken(Constant):
        @staticmethod
        @kernel
        def law(t, x, memory, target, k, table, tau, rate, signals, work):  # type: ignore[no-untyped-def, override]
            tau[0] = k.nothing_of_this_name

    with pytest.raises(LawError):
        simulate_many([adrift(controller=Broken())] * 3, GRID)
