"""Many runs at once give what each gives alone, and none stands in another's way."""

from __future__ import annotations

import math
import re
import threading
import time
from _ctypes import FUNCFLAG_PYTHONAPI
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from conftest import NONLINEAR, Constant, adrift, corrected

from podusv_cli.actuators.saturated import Saturated
from podusv_cli.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.controllers.dsc import DynamicSurface
from podusv_cli.controllers.network import Network
from podusv_cli.controllers.pid import Pid
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.engine import signatures
from podusv_cli.engine.batch import Batch, simulate_many
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import STATE, ClosedLoop, simulate
from podusv_cli.engine.variants import variants
from podusv_cli.metrics.table import observer
from podusv_cli.paths.waypoints import Waypoints

ROOT = Path(__file__).resolve().parent.parent
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
    watching = observer(loops[0], GRID, **SETTINGS)
    batch = simulate_many(loops, GRID, observer=watching, workers=workers)
    metrics = watching.summaries(batch.seen)
    for i, loop in enumerate(loops):
        alone = simulate(loop, GRID, observer=observer(loop, GRID, **SETTINGS))
        assert (batch.status[i], batch.reached[i]) == (alone.status, GRID.steps + 1)
        np.testing.assert_array_equal(batch.state[i], [alone[name][-1] for name in STATE])
        np.testing.assert_array_equal(batch.seen[i], alone.seen)
        assert alone.seen is not None
        expected = watching.summary(alone.seen)
        np.testing.assert_array_equal([metrics[name][i] for name in expected], [*expected.values()])
    assert len(set(metrics["iae"])) == COUNT  # the runs do differ


class Lost(Constant):
    """A law for tests: a demand that is no number any more from `until` on."""

    kind: Literal["lost"] = "lost"
    until: float = value(math.inf, "s", "end of the finite demand", allow_inf_nan=True)

    @staticmethod
    @kernel
    def law(
        t: float, x: Vector, memory: Vector, target: Vector, k: Any, table: Vector,
        tau: Vector, rate: Vector, signals: Vector, work: Vector,
    ) -> None:  # fmt: skip
        """1 N, then infinity."""
        tau[0] = 1.0 if t < k.until else math.inf
        tau[1] = 0.0


def test_a_run_that_diverges_stops_no_other() -> None:
    loops = variants(adrift(controller=Lost()), {"controller.until": [30.0, 4.999, 30.0, 2.499]})
    watching = observer(loops[0], GRID, **SETTINGS)
    batch = simulate_many(loops, GRID, observer=watching)
    assert batch.status.tolist() == ["finished", "diverged", "finished", "diverged"]
    assert batch.reached.tolist() == [2001, 500, 2001, 250]
    np.testing.assert_array_equal(np.isfinite(batch.state).all(axis=1), batch.reached == 2001)
    for loop, row in zip(loops, batch.seen, strict=True):
        np.testing.assert_array_equal(row, simulate(loop, GRID, observer=watching).seen)


def test_a_march_lets_go_of_the_interpreters_lock() -> None:
    for prototype in (signatures.ADVANCE, signatures.RATES_ALONG):
        assert not prototype._flags_ & FUNCFLAG_PYTHONAPI


@pytest.mark.benchmark
def test_other_threads_go_on_while_one_marches() -> None:
    runs = threading.Thread(
        target=simulate_many, args=([corrected(controller=Pid())], TimeGrid(0.01, 1_000_000))
    )
    simulate_many([corrected(controller=Pid())], GRID)  # compiled by now
    runs.start()
    naps = 0
    while runs.is_alive():
        time.sleep(0.001)
        naps += 1
    # Hundreds; about two for each of some ten blocks where a march keeps the lock.
    assert naps > 60


def test_progress_comes_to_one() -> None:
    fractions: list[float] = []
    simulate_many([adrift()] * 4, TimeGrid(0.01, 10), progress=fractions.append)
    assert fractions == [0.25, 0.5, 0.75, 1.0]


def interrupted(loops: list[ClosedLoop], grid: TimeGrid) -> Batch:
    """A batch of one worker whose user interrupts after two runs."""

    def press(fraction: float) -> None:
        if fraction >= 2 / len(loops):
            raise KeyboardInterrupt

    watching = observer(loops[0], grid, **SETTINGS)
    return simulate_many(loops, grid, observer=watching, workers=1, progress=press)


def test_an_interrupt_keeps_the_runs_that_are_done() -> None:
    loops = [corrected()] * 40
    watching = observer(loops[0], TimeGrid(0.01, 100_000), **SETTINGS)
    batch = interrupted(loops, TimeGrid(0.01, 100_000))
    done = batch.status == "finished"
    assert 2 <= done.sum() < 40
    assert set(batch.status) == {"finished", "interrupted"}
    iae = watching.summaries(batch.seen)["iae"]
    assert len(set(iae[done])) == 1
    never = batch.reached == 0
    assert never.any()
    assert np.isnan(iae[never]).all()
    assert np.isnan(batch.state[never]).all()
    assert not [t for t in threading.enumerate() if t.name.startswith("ThreadPoolExecutor")]


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
def test_another_structure_is_refused(other: ClosedLoop) -> None:
    with pytest.raises(ValueError, match=r"run 1 has another structure than run 0: .* not .*"):
        simulate_many([corrected(), other], GRID)


def test_no_runs_are_an_empty_batch() -> None:
    batch = simulate_many([], GRID)
    assert (len(batch.status), batch.seen.shape) == (0, (0, 1))
    assert observer(corrected(), GRID, **SETTINGS).summaries(batch.seen)["iae"].shape == (0,)


def test_a_fault_in_one_run_is_raised() -> None:
    class Faulty(Constant):
        def start(self, x: Vector, target: Vector, nominal: Any) -> Vector:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        simulate_many([adrift(controller=Faulty())] * 3, GRID)


def test_the_documented_monte_carlo_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "docs" / "performance.md").read_text()
    (code,) = re.findall(r"```python\n(.*?simulate_many.*?)```", text, re.DOTALL)
    few = code.replace("(1000, 6)", "(4, 6)").replace('"configs/', f'"{ROOT}/configs/')
    assert few.count("(4, 6)") == few.count(f"{ROOT}/configs/paper") == 1
    exec(few, {})  # noqa: S102
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "4 of 4 finished"
    low, middle, high = map(float, lines[1].removeprefix("iae [").rstrip("]").split())
    assert 375 < low < middle < high < 395  # as the text says of a thousand


def test_variants_change_what_they_name_and_nothing_else() -> None:
    loop = corrected()
    (one, two) = variants(loop, {"controller.network.spread": [0.5, 0.9], "start.psi": [1, 2]})
    assert isinstance(two.controller, AdaptiveNeural)
    assert two.controller.network == Network(spread=0.9)
    assert two.start == (-10.0, -10.0, 2.0, 0.0, 0.0, 0.0)
    back = variants(one, {"controller.network.spread": [0.7], "start.psi": [0.0]})
    assert back == [loop]
    heavy = variants(loop, {"vessel.m": [30.0]})[0]
    assert (heavy.vessel.m, heavy.nominal) == (30.0, NONLINEAR)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"controller.k_zee": [1.0]}, "controller.k_zee: no number of this closed loop"),
        ({"controller.network": [1.0]}, "controller.network: no number"),
        ({"controller.k_ze.x": [1.0]}, r"controller.k_ze.x: no number"),
        ({"rudder.k": [1.0]}, "rudder.k: no number"),
        ({"start.z": [1.0]}, "start.z: no number"),
        ({"vessel": [1.0]}, "vessel: no number"),
        ({"controller.k_ze": [-1.0]}, "greater than or equal to 0"),
        ({"vessel.m": [20.0], "start.x": [1.0, 2.0]}, "one number a run"),
        ({}, "one number a run"),
    ],
)
def test_variants_that_cannot_be_are_refused(parameters: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        variants(corrected(), parameters)
