"""Contract tests for components, metrics and figures of your own, with pytest.

    LAW = Path(__file__).with_name("my_law.py")

    @pytest.mark.parametrize(("check", "part"), contract(LAW))
    def test_contract(check, part):
        check(part)

Each check raises AssertionError, or LawError with file, line and what to write.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.actuators.ideal_full import IdealFull
from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.measurements.base import Measurement
from podusv_cli.components.measurements.exact import Exact
from podusv_cli.components.measurements.sensors import Sensors
from podusv_cli.components.paths.base import TARGET
from podusv_cli.components.paths.base import Path as AnyPath
from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.poses import Poses
from podusv_cli.core import derived_signals as derived
from podusv_cli.core import plugins, registry
from podusv_cli.core.component import Component
from podusv_cli.core.kernel import Vector, bundle, call
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.plugins import Plugin
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import DEMAND, DEMAND_SIZE, PSI_D, TARGET_SIZE, Signal
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.check import check_law
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.figures.sheet import Sheet
from podusv_cli.figures.shown import dress_runs
from podusv_cli.figures.style import house_style, image
from podusv_cli.metrics.metric import Metric
from podusv_cli.metrics.table import metrics_probe, metrics_with
from podusv_cli.scenario.about import about_of
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.model import BASES
from podusv_cli.testing.seeing import ESTIMATOR_CHECKS, MEASUREMENT_CHECKS, usual_vessel

Check = Callable[[Any], None]
STATES = 50  # random ones
STEP, STEPS = 0.01, 50  # of the runs
SCENARIO = """
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: ideal}
controller: {kind: pid}
"""
ROOMS = {f"{section}s": (section, base) for section, base in BASES.items()}


def contract(file: Path, fields: Mapping[str, Mapping[str, Any]] | None = None) -> list[Any]:
    """Every check with every component, metric and figure of a plug-in file, for a test.

    `fields` are by kind the fields that a component cannot do without. Raises LawError for a file
    that is no plug-in.
    """
    import pytest  # which only tests need

    own = plugins.from_file(str(file), file.read_text("utf-8"))
    made = [
        (component, component_kind(component), checks(component))
        for component in components(own, fields or {})
    ]
    made += [(member, member.name, METRIC_CHECKS) for member in _members(own, "metrics", Metric)]
    made += [(member, member.name, FIGURE_CHECKS) for member in _members(own, "figures", Sheet)]
    return [
        pytest.param(check, part, id=f"{name}-{check.__name__}")
        for part, name, asked in made
        for check in asked
    ]


def checks(component: Component) -> tuple[Check, ...]:
    """All checks of a component: those of every kind, then those of its own."""
    more = ((Measurement, MEASUREMENT_CHECKS), (Estimator, ESTIMATOR_CHECKS))
    return CHECKS + tuple(
        check for base, own in more if isinstance(component, base) for check in own
    )


def _members(own: Plugin, room: str, kind: type[Any]) -> list[Any]:
    """What a plug-in offers to a room that is of this kind."""
    return [thing for thing in own.members(room) if isinstance(thing, kind)]


def components(own: Plugin, fields: Mapping[str, Mapping[str, Any]]) -> Iterator[Component]:
    """Every component of a plug-in file, with its defaults but for `fields`, by kind."""
    for room, (_, base) in ROOMS.items():
        package = f"podusv_cli.components.{room}"
        known = registry.kinds(package, base)
        for kind, made in registry.kinds(package, base, (own,)).items():
            if kind not in known:
                yield made(**fields.get(kind, {}))


def component_kind(component: Component) -> str:
    """The component's kind."""
    return str(type(component).model_fields["kind"].default)


def keeps_its_declaration(component: Component) -> None:
    """Check that signals, memory and constants are as declared, and every output is written."""
    check_law(Plan(loop_with(component), TimeGrid(STEP, STEPS)))


def is_finite(component: Component) -> None:
    """At random states every output is written and finite, and nothing that is only to be read."""
    for seed in range(STATES):
        for out in evaluate_component(component, seed):
            assert np.isfinite(out).all(), f"at random state {seed} it writes {out}"


def remembers_nothing(component: Component) -> None:
    """The same state gives the same bits, whatever was evaluated in between."""
    first = [evaluate_component(component, seed) for seed in range(STATES)]
    # In the other order, as a memory of the state before would show.
    again = [evaluate_component(component, seed) for seed in reversed(range(STATES))][::-1]
    for seed, (one, other) in enumerate(zip(first, again, strict=True)):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b, f"random state {seed}")


def runs_alike_compiled_and_plain(component: Component) -> None:
    """A run in machine code has the numbers of one in plain Python."""
    # Not to the bit: a component of one's own may call `math`, whose last digits may differ.
    _compare(run_with(component, True), run_with(component, False), rtol=1e-9, atol=1e-12)


def repeats_itself(component: Component) -> None:
    """Two runs are the same to the last bit."""
    _compare(run_with(component, True), run_with(component, True), rtol=0.0, atol=0.0)


CHECKS: tuple[Check, ...] = (
    keeps_its_declaration,
    is_finite,
    remembers_nothing,
    runs_alike_compiled_and_plain,
    repeats_itself,
)


def has_a_number(metric: Metric) -> None:
    """A run that reaches its end has a number; NaN is for events that never happened."""
    number = gathered_number(metric, True)
    assert math.isfinite(number) or metric.happens, f"it is {number} for a run that finished"


def gathers_alike_compiled_and_plain(metric: Metric) -> None:
    """Gathered in machine code, the number is that of plain Python."""
    np.testing.assert_allclose(
        gathered_number(metric, True), gathered_number(metric, False), rtol=1e-9, atol=1e-12
    )


METRIC_CHECKS: tuple[Check, ...] = (has_a_number, gathers_alike_compiled_and_plain)


def gathered_number(metric: Metric, compiled: bool) -> float:
    """The metric of a short run with PID, gathered in machine code or in plain Python."""
    loop, grid = loop_with(Pid()), TimeGrid(STEP, STEPS)
    # A plug-in of this metric alone; the digest only has to differ from others'
    alone = Plugin(metric.name, f"{id(metric)}", offers=(("metrics", metric),))
    probe = metrics_probe(
        Plan(loop, grid), steady_fraction=0.2, settling_radius=1.0, known=metrics_with((alone,))
    )
    run = simulate(loop, grid, probe=probe, compiled=compiled)
    assert run.seen is not None
    if metric.of_log:
        return float(metric.of_log(run))
    return probe.summary(run.seen)[metric.name]


def draws_any_number_of_runs(sheet: Sheet) -> None:
    """A figure of one run or three, one column wide or two, can be drawn."""
    for count, columns in ((1, 1), (1, 2), (3, 1), (3, 2)):
        assert picture(sheet, count, columns)


def draws_the_same_bytes_twice(sheet: Sheet) -> None:
    """The same runs give the same file."""
    assert picture(sheet, 2, 2) == picture(sheet, 2, 2)


FIGURE_CHECKS: tuple[Check, ...] = (draws_any_number_of_runs, draws_the_same_bytes_twice)


def picture(sheet: Sheet, count: int, columns: int) -> bytes:
    """The figure of `count` equal runs, `columns` wide, as PNG.

    They have a wave for signals that no law of podusv logs.
    """
    loop, scenario = loop_with(Pid()), load_text(SCENARIO, "contract.yaml").scenario
    run = simulate(loop, TimeGrid(STEP, STEPS))
    known = {name for name in sheet.signals if derived.has(run, name)}
    waves = {name: np.sin(run["time"]) for name in sheet.signals if name not in known}
    about = {name: Signal(name, "1", "a wave") for name in waves}
    run = replace(run, signals={**run.signals, **waves}, about={**run.about, **about})
    shown = dress_runs([PastRun(f"run {n}", about_of(scenario), run) for n in range(count)])
    with house_style():
        return image(sheet.family(shown, columns), "png")


def _compare(one: Recording, other: Recording, *, rtol: float, atol: float) -> None:
    """Raises AssertionError unless both runs finish with signals alike within rtol and atol."""
    assert one.status == other.status == "finished", one.message or other.message
    for name in one.signals:
        np.testing.assert_allclose(
            one[name], other[name], rtol=rtol, atol=atol, err_msg=f"signal {name}"
        )


def loop_with(component: Component) -> ClosedLoop:
    """A closed loop of podusv's own parts, with this one in its place.

    A law that asks for a sway force or a heading gets an actuator or a path that has it.
    """
    parts: dict[str, Any] = {
        "path": Line(),
        "disturbance": Calm(),
        "actuator": Ideal(),
        "controller": Pid(),
        # Where the true state is seen, there is nothing to estimate.
        "measurement": Sensors() if isinstance(component, Estimator) else Exact(),
    }
    place = next(name for name, base in ROOMS.values() if isinstance(component, base))
    if isinstance(component, Controller) and component.asks_sway():
        parts["actuator"] = IdealFull()
    if isinstance(component, Controller) and component.wants_heading():
        parts["path"] = Poses(poses=((0.0, 0.0, 0.0), (5.0, 2.0, 0.5)))
    return ClosedLoop(
        vessel=usual_vessel(),
        nominal=usual_vessel(),
        start=(-5.0, -2.0, 0.1, 0.3, 0.0, 0.0),
        **parts | {place: component},
    )


def run_with(component: Component, compiled: bool) -> Recording:
    """A short run of a loop with this component, compiled or in plain Python."""
    return simulate(loop_with(component), TimeGrid(STEP, STEPS), compiled=compiled)


def evaluate_component(component: Component, seed: int) -> list[Vector]:
    """What the component's kernel writes at a random state, (numbers,) each; NaN for nothing.

    Up to 20 m, 1.5 m/s and 0.8 rad/s, with a target 1 to 20 m away. The same seed gives the same.
    """
    random = np.random.default_rng(seed)
    t = float(random.uniform(0.0, 300.0))
    x = random.uniform(-1.0, 1.0, 6) * [20.0, 20.0, 3.0, 1.5, 0.5, 0.8]
    bearing, distance = random.uniform(-np.pi, np.pi), random.uniform(1.0, 20.0)
    place = x[:2] + distance * np.array([np.cos(bearing), np.sin(bearing)])
    motion = random.uniform(-1.0, 1.0, 4) * [0.7, 0.7, 0.1, 0.1]
    heading = np.zeros(TARGET_SIZE - len(TARGET))
    if isinstance(component, Controller) and component.wants_heading():
        heading[1:] = random.uniform(-1.0, 1.0, 3) * [3.0, 0.1, 0.01]
    target = np.concatenate([place, motion, heading])
    x, target = _to_read(x), _to_read(target)
    for base, ask in CALLS:
        if isinstance(component, base):
            return ask(component, t, x, target, random)
    raise TypeError(f"{component_kind(component)} is no part of a closed loop")


def _to_read(given: Vector) -> Vector:
    """The same numbers; ValueError where a kernel writes one of them."""
    given = given.copy()
    given.flags.writeable = False
    return given


def _law(law: Any, t: float, x: Vector, target: Vector, random: Any) -> list[Vector]:
    """All that a law's kernels write at time t [s] and state x (6,): demand, rates, signals.

    Its memory is near that at the start. What it may only read is write-protected, and scratch is
    NaN, so that reading it shows.
    """
    memory, k = law.start(x, target, usual_vessel()), bundle(law.constants_with(usual_vessel()))
    memory = memory + random.normal(0.0, 0.1, len(memory))
    # NaN in every place, so that one that is left unwritten is no finite number in the end.
    demands = len(DEMAND) + law.asks_sway()
    outputs = [np.full(size, np.nan) for size in (demands, len(memory), len(law.signals))]
    if law.takes_samples():
        call(law.sample, t=t, x=x, memory=memory, target=target, k=k, table=law.table())
    tau, rate, signals = outputs
    call(
        law.law,
        t=t,
        x=x,
        memory=_to_read(memory),
        target=target,
        k=k,
        table=law.table(),
        tau=tau,
        rate=rate,
        signals=signals,
        work=np.full(law.workspace(), np.nan),
    )
    return outputs


def _path(path: Any, t: float, x: Vector, target: Vector, random: Any) -> list[Vector]:
    """All that a path's kernels write at time t [s] and state x (6,): target, and place on it."""
    out, place = np.full(TARGET_SIZE, np.nan), np.zeros(len(path.places))
    out[len(TARGET) : PSI_D if path.heads else TARGET_SIZE] = 0.0  # what no path writes
    k, table = bundle(path.constants_with(0.0)), path.table()
    if path.follows:
        call(path.locate, t=t, x=x, s=x, place=place, k=k, table=table)
    call(path.evaluate, t=t, x=x, place=_to_read(place), k=k, table=table, target=out)
    return [out, place]


def _sea(sea: Any, t: float, x: Vector, target: Vector, random: Any) -> list[Vector]:
    """All that a disturbance's kernel writes at time t [s] and state x (6,): load and signals."""
    out, hull = np.full(3 + len(sea.signals), np.nan), usual_vessel()
    call(
        sea.evaluate,
        t=t,
        x=x,
        k=bundle(sea.constants_with(hull)),
        table=sea.table_for(hull, t),
        b=out,
        again=0.0,
        stage=0.0,
    )
    return [out]


def _actuator(actuator: Any, t: float, x: Vector, target: Vector, random: Any) -> list[Vector]:
    """All that an actuator's kernel writes at time t [s]: loads, rates, signals.

    For a drawn demand, from rest.
    """
    state, demand = _to_read(actuator.rest()), _to_read(random.normal(0.0, 5.0, DEMAND_SIZE))
    outputs = [np.full(size, np.nan) for size in (3, len(state), len(actuator.signals))]
    k = bundle(actuator.constants())
    tau, rate, signals = outputs
    call(
        actuator.drive,
        t=t,
        x=x,
        state=state,
        demand=demand,
        k=k,
        table=actuator.table(),
        tau=tau,
        rate=rate,
        signals=signals,
    )
    return outputs


def _measurement(sensors: Any, t: float, x: Vector, target: Vector, random: Any) -> list[Vector]:
    """All that a measurement's kernel writes at an instant that is drawn: `seen` (numbers,).

    At state x (6,), in calm water.
    """
    seen = sensors.first(x, STEP)
    k, table = bundle(sensors.constants_with(STEP, 0)), sensors.table_for(STEP, STEPS)
    call(
        sensors.sense,
        t=t,
        instant=float(random.integers(STEPS)),
        x=x,
        b=np.zeros(3),
        k=k,
        table=table,
        seen=seen,
    )
    return [seen]


def _estimator(estimator: Any, t: float, x: Vector, target: Vector, random: Any) -> list[Vector]:
    """All that an estimator's kernels write: its state after a correction, and its rates.

    All is measured and delivered, near the truth.
    """
    state, k = estimator.start(x, usual_vessel()), bundle(estimator.constants_with(usual_vessel()))
    seen = np.concatenate([x + random.normal(0.0, 0.1, 6), np.ones(12)])
    tau, rate, table = random.normal(0.0, 5.0, 3), np.full(len(state), np.nan), estimator.table()
    call(estimator.correct, t=t, seen=seen, state=state, k=k, table=table)
    call(estimator.follow, t=t, seen=seen, tau=tau, state=state, k=k, table=table, rate=rate)
    return [state, rate]


CALLS = (
    (Controller, _law),
    (AnyPath, _path),
    (Disturbance, _sea),
    (Actuator, _actuator),
    (Measurement, _measurement),
    (Estimator, _estimator),
)
