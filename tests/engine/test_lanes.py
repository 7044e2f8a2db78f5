"""Runs side by side: every run has the bits that it has alone."""

from __future__ import annotations

import gc
import math
import weakref
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from lane_samples import aligned, bits
from plugin_samples import LAW

from benchmarks.variants import variants
from podusv_cli.components.actuators.command import Command
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.harmonic import HarmonicDisturbance
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.disturbances.waves import Waves
from podusv_cli.components.estimators.passive_observer import PassiveObserver
from podusv_cli.components.measurements.base import FRESH, Measurement
from podusv_cli.components.measurements.sensors import MEASURED, Sensor, Sensors
from podusv_cli.core.kernel import LANES, Vector, kernel, shared
from podusv_cli.core.registry import kinds
from podusv_cli.core.signal import Signal
from podusv_cli.engine.loop.closed_loop import ClosedLoop, Probe
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine import compile, signatures
from podusv_cli.engine.machine.signatures import LANE_VECTOR
from podusv_cli.engine.machine.wide import object_code
from podusv_cli.engine.running import lanes
from podusv_cli.engine.running.batch import Batch, simulate_many
from podusv_cli.engine.running.lanes import why_alone
from podusv_cli.engine.running.thread import Work
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics.table import metrics_probe
from podusv_cli.scenario.load import load

ROOT = Path(__file__).parents[2]
SLOW = [pytest.param(law, marks=pytest.mark.slow) for law in ("dsc", "full_backstepping")]
GRID = TimeGrid(0.01, 400)
COUNT = 11  # a whole bundle, and one with lanes left over
SCENARIO = load(ROOT / "configs" / "mu_2017" / "corrected.yaml").scenario


STUDY = """
plugins: [my_law.py]
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: ideal}
controllers: {a: {kind: cross_track}, b: {kind: pid}}
start: {x: -1.0, y: -1.0}
simulation: {duration: 1.0}
sweep: {draws: 4, vary: {vessel.m: {uniform: [50.0, 60.0]}}}
"""


def loop(law: str) -> ClosedLoop:
    """The task of the paper with a law."""
    kind = kinds("podusv_cli.components.controllers", Controller)[law]
    return replace(SCENARIO.closed_loop(), controller=kind())


def scattered(base: ClosedLoop, seed: int) -> list[ClosedLoop]:
    """Random starts, vessels and seas, of which some saturate, fold and diverge."""
    draws = np.random.default_rng(seed)
    return variants(
        base,
        {
            "start.x": draws.uniform(-5.0, 5.0, COUNT),
            "start.psi": draws.uniform(-3.0, 3.0, COUNT),
            "start.u": np.where(np.arange(COUNT) % 4 == 1, 1e150, draws.uniform(0, 1, COUNT)),
            "vessel.m": draws.uniform(15.0, 40.0, COUNT),
            "disturbance.scale": np.where(np.arange(COUNT) % 5 == 2, 3e5, 1.0),
        },
    )


def both(loops: list[ClosedLoop], grid: TimeGrid = GRID) -> tuple[Batch, Batch]:
    """The batch side by side and run by run."""
    probe = metrics_probe(Plan(loops[0], grid), steady_fraction=0.2, settling_radius=1.0)
    alone = simulate_many(loops, grid, probe=probe, side_by_side=False)
    return simulate_many(loops, grid, probe=probe, side_by_side=True), alone


def same(one: Batch, other: Batch) -> None:
    """The same bits everywhere."""
    assert one.status.tolist() == other.status.tolist()
    assert one.cause.tolist() == other.cause.tolist()
    assert one.reached.tolist() == other.reached.tolist()
    np.testing.assert_array_equal(bits(one.state), bits(other.state))
    np.testing.assert_array_equal(bits(one.seen), bits(other.seen))


@pytest.mark.parametrize("law", ["adaptive_neural", "pid", *SLOW])
@pytest.mark.parametrize("actuator", [Ideal(), Saturated()])
def test_runs_side_by_side_have_the_bits_that_they_have_alone(
    law: str, actuator: Ideal | Saturated
) -> None:
    """Also those that diverge, at different instants."""
    base = replace(loop(law), actuator=actuator)
    probe = metrics_probe(Plan(base, GRID), steady_fraction=0.2, settling_radius=1.0)
    assert why_alone(Plan.with_probe(base, GRID, probe)) == ""
    together, alone = both(scattered(base, 7))
    same(together, alone)
    assert {"finished", "diverged"} <= set(alone.status)
    assert len(set(alone.reached)) > 2


@pytest.mark.slow  # the compiler takes half a minute
def test_options_of_a_law_and_of_its_sampling_march_side_by_side() -> None:
    """Held directions, samples, the observer of the sway load, anti-windup, a held demand."""
    law = kinds("podusv_cli.components.controllers", Controller)["dsc"]
    controller = law.model_validate(
        {
            "rate": "difference",
            "hold_below": 0.8,
            "standoff_reference": "crab",
            "anti_windup": "auxiliary",
            "difference_step": 0.02,
        }
    )
    base = replace(loop("dsc"), controller=controller, actuator=Saturated())
    near = variants(base, {"start.x": np.linspace(-0.9, 0.9, COUNT)})
    together, alone = both([*near, *scattered(base, 3)], TimeGrid(0.01, 300, hold_every=2))
    same(together, alone)


def test_runs_of_another_choice_march_beside_their_like() -> None:
    """A choice is the same in all runs side by side, so these are sorted by it."""
    bases = [loop("pid").controller.model_copy(update={"fold": f}) for f in ("joint", "none")]
    loops = [
        replace(one, controller=bases[i % 2]) for i, one in enumerate(scattered(loop("pid"), 5))
    ]
    same(*both(loops))


# Parts of a loop that runs side by side have to share: a delay, the periods of sensors, and where
# the tables of a list of loads begin, which nothing else tells of two currents.
OTHERS: list[tuple[str, list[Any]]] = [
    ("actuator", [Saturated(command=Command(delay=d)) for d in (0.03, 0.11, 0.0)]),
    (
        "measurement",
        [
            Sensors(position=Sensor(period=p, delay=d, noise=0.1))
            for p, d in ((0.07, 0.02), (0.03, 0.0))
        ],
    ),
    (
        "disturbance",
        [
            Total(parts=(Waves(height=0.2, period=1.5, components=n), HarmonicDisturbance()))
            for n in (8, 40)
        ],
    ),
    (
        "disturbance",
        [
            Total(parts=(Current(speed_std=0.1, interval=i), Waves(height=0.2, period=1.5)))
            for i in (0.1, 0.2)
        ],
    ),
]


@pytest.mark.parametrize(("part", "others"), OTHERS)
def test_runs_of_other_delays_march_beside_their_like(part: str, others: list[Any]) -> None:
    """And of other periods of sensors, and other tables: whatever lanes share sorts them."""
    base = replace(loop("pid"), actuator=Saturated(command=Command(delay=0.05)))
    scattered_loops = scattered(base, 5) + scattered(base, 6)
    loops = [
        replace(scattered_loop, **{part: others[i % len(others)]})
        for i, scattered_loop in enumerate(scattered_loops)
    ]
    together, alone = both(loops, replace(GRID, steps=60))
    assert why_alone(Plan.with_probe(loops[0], GRID, Probe())) == ""
    assert "invalid" not in alone.status
    same(together, alone)


class AllBut(Measurement):
    """The state as it is, without one of its numbers."""

    kind: Literal["all_but"] = "all_but"
    lacking: float = 3.0

    @property
    def signals(self) -> tuple[Signal, ...]:
        return tuple(state for state, has in zip(MEASURED, self.measured(), strict=True) if has)

    def measured(self) -> tuple[bool, ...]:
        return tuple(i != self.lacking for i in range(6))

    @staticmethod
    @kernel
    def sense(instant: float, x: Vector, k: Any, seen: Vector) -> None:
        for i in range(6):
            if float(i) != k.lacking:
                seen[i] = x[i]
                seen[FRESH + i] = 1.0


@kernel
def fourth_measured(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """Add up the number that is logged fourth of those measured: u, or v where u has no sensor."""
    seen[0] += weight * row[int(k.place) + 3]


class OfMeasured(Probe):
    """Knows where the row has the measured numbers."""

    def constants_for(self, loop: ClosedLoop) -> dict[str, float]:
        return {"place": float(Plan.with_probe(loop, GRID, Probe()).layout.sensed)}


def test_runs_of_other_quantities_measured_march_beside_their_like() -> None:
    """Where as many are: of six numbers u is not measured, or v is not."""
    loops = [
        replace(one, measurement=AllBut(lacking=3.0 + i % 2), estimator=PassiveObserver())
        for i, one in enumerate(scattered(loop("pid"), 5) + scattered(loop("pid"), 6))
    ]
    probe, grid = OfMeasured(fourth_measured), replace(GRID, steps=60)
    assert why_alone(Plan.with_probe(loops[0], grid, probe)) == ""
    together, alone = (
        simulate_many(loops, grid, probe=probe, side_by_side=chosen) for chosen in (True, False)
    )
    assert "invalid" not in alone.status, alone.cause
    same(together, alone)


@kernel
def of_the_first(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A probe that takes the first run's number for everybody's."""
    seen[0] += shared(s[0])


def test_what_cannot_march_side_by_side_marches_alone_and_says_why() -> None:
    """What is shared is known of podusv's own kernels only."""
    base, probe = loop("pid"), Probe(of_the_first)
    assert "test_lanes.py, line" in why_alone(Plan.with_probe(base, GRID, probe))
    assert "shared is for podusv's own kernels" in why_alone(Plan.with_probe(base, GRID, probe))
    loops, grid = scattered(base, 1), TimeGrid(0.01, 20)
    alone = simulate_many(loops, grid, probe=probe, side_by_side=False)
    same(simulate_many(loops, grid, probe=probe, side_by_side=True), alone)


@kernel
def signed(x: float, limit: float, out: Vector) -> float:
    """Branches, returns from within them and a loop that changes what they set."""
    if x < 0.0:
        out[0] = -1.0
        return -limit
    rest, count = x, 0.0
    for _ in range(3):
        if rest > limit and not rest > 2.0 * limit:
            rest -= limit
            count += 1.0
        elif rest > limit:
            rest = rest / 2.0 if count == 0.0 else math.sqrt(rest)
    out[0] = count if count > 0.0 else rest
    if math.isnan(rest):
        return 7.0
    return min(rest, limit)


@kernel
def watch(t: float, weight: float, s: Vector, row: Vector, k: Any, seen: Vector) -> None:
    """A probe that branches on the runs' numbers, and on one that they share."""
    if s[1] > 0.0:
        seen[1] += 1.0
        if 0.0 < s[0] <= 2.0 * k.limit or t > 5.0:
            seen[0] = signed(s[0], k.limit, row)
        else:
            seen[2], seen[3] = s[0], s[1]
    elif k.limit > 0.5:
        seen[0] = max(signed(-s[0], k.limit, row), math.atan2(s[0], s[1]))


@pytest.mark.parametrize("t", [0.0, 6.0])
def test_every_lane_goes_its_own_way_through_branches(t: float) -> None:
    """As the kernel does in plain Python, number by number."""
    side_by_side = compile.routine(
        compile.lane_adapter("probe", watch, ("limit",), frozenset({"limit"}))
    )
    draws = np.random.default_rng(4)
    for _ in range(20):
        s, row, seen = draws.normal(0.0, 2.0, (3, 4, LANES))
        limit = np.full((1, LANES), draws.uniform(0.2, 1.0))
        s[0, :2] = np.nan, 0.0
        wanted_row, wanted = row.copy(), seen.copy()
        for lane in range(LANES):
            own = [np.ascontiguousarray(part[:, lane]) for part in (s, wanted_row, wanted)]
            watch(t, 1.0, *own[:2], SimpleNamespace(limit=limit[0, lane]), own[2])
            wanted_row[:, lane], wanted[:, lane] = own[1], own[2]
        rooms = [aligned(part) for part in (s, row, limit, seen)]
        side_by_side(t, 1.0, *(room.ctypes.data_as(LANE_VECTOR) for room in rooms))
        np.testing.assert_array_equal(rooms[1], wanted_row.ravel())
        np.testing.assert_array_equal(rooms[3], wanted.ravel())


def test_the_law_that_podusv_new_writes_marches_side_by_side(podusv: Any) -> None:
    """An author begins with a law that does."""
    assert podusv("new", "law", "our_own").code == 0
    written = load(Path("our_own.yaml")).scenario.singles()["our_own"]
    assert why_alone(Plan.with_probe(written.closed_loop(), GRID, Probe())) == ""


WHILE = """        rest = signals[0]
        while rest > 1.0:
            rest *= 0.5
        tau[1] += rest
"""
SHARING = """        tau[0] += 0.0 * shared(x[0])
"""


def test_validate_says_which_runs_of_a_study_march_side_by_side(podusv: Any) -> None:
    """And why the others do not."""
    law = LAW.replace("import Vector, kernel\n", "import Vector, kernel, shared\n") + SHARING
    Path("my_law.py").write_text(law)
    Path("a.yaml").write_text(STUDY)
    said = podusv("validate", "a.yaml", "-v").out
    assert "b: runs march side by side" in said
    assert "a: runs march one by one: " in said
    assert "shared is for podusv's own kernels" in said


def test_a_law_with_a_while_marches_side_by_side(podusv: Any) -> None:
    """It ends at another time in every run."""
    Path("my_law.py").write_text(LAW + WHILE)
    Path("a.yaml").write_text(STUDY)
    base = load(Path("a.yaml")).scenario.singles()["a"].closed_loop()
    loops = variants(base, {"start.y": np.linspace(-30.0, 50.0, COUNT)})
    together, alone = both(loops, TimeGrid(0.01, 50))
    same(together, alone)
    assert why_alone(Plan.with_probe(base, GRID, Probe())) == ""


def test_an_interrupt_keeps_all_runs_that_marched_side_by_side() -> None:
    """The user interrupts when the first eight are done."""

    def press(fraction: float) -> None:
        raise KeyboardInterrupt

    loops = [loop("pid")] * 20
    batch = simulate_many(
        loops, TimeGrid(0.01, 20_000), workers=1, progress=press, side_by_side=True
    )
    assert batch.status.tolist() == ["finished"] * 8 + ["interrupted"] * 12
    assert np.isnan(batch.state[8:]).any(axis=1).sum() >= 4  # those that never began


def test_runs_that_hang_side_by_side_are_made_again_one_by_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So that one that hangs costs no other its result."""
    hangs = Work.hangs

    def wide(work: Work) -> bool:
        return len(work._under_way) > 2 or hangs(work)

    loops = scattered(loop("pid"), 9)
    grid = TimeGrid(0.01, 2_000)
    alone = simulate_many(loops, grid, side_by_side=False)
    monkeypatch.setattr(Work, "hangs", wide)
    same(simulate_many(loops, grid, side_by_side=True), alone)


@pytest.mark.parametrize("kind", [signatures.VECTOR, signatures.LANE_VECTOR])
def test_a_march_that_is_abandoned_writes_to_memory_that_nobody_else_has(kind: Any) -> None:
    vector = np.zeros(LANES)
    kept, places = weakref.ref(vector), signatures.pointers([vector], kind)
    del vector
    gc.collect()
    assert kept() is not None
    assert len(places) == 1


@pytest.mark.long
def test_any_failure_of_the_vectoriser_is_a_reason_to_march_one_by_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An llvmlite without one of the passes raised AttributeError in the middle of a study."""

    def without_a_pass(*given: Any) -> Any:
        raise AttributeError("no attribute 'add_always_inliner_pass'")

    monkeypatch.setattr(object_code.widening, "widen_module", without_a_pass)
    (piece,) = [p for p in lanes.pieces(Plan(loop("pid"), GRID)) if p.label.startswith("lanes_law")]
    code = object_code.object_code(piece.function, piece.prototype)
    assert code.symbol == ""
    assert b"cannot be widened: AttributeError: no attribute 'add_always" in code.content
    assert code.content.endswith(f"llvmlite {version('llvmlite')}".encode())
