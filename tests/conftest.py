"""Values and measurements that the tests of the numerical rooms share."""

import gc
import os
import signal
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path as File
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import pytest
import yaml
from command_samples import commanded, write
from hypothesis import HealthCheck, settings
from old_results import among_old_results
from policy_samples import content, symmetric

import podusv_cli
from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.actuators.ideal_full import IdealFull
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.base import Controller, Slots
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.disturbances.harmonic import HarmonicDisturbance
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.measurements.base import Measurement
from podusv_cli.components.paths.base import TARGET, Path
from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.line_circle import LineCircle
from podusv_cli.components.paths.poses import Poses
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core import registry
from podusv_cli.core.component import Component, value
from podusv_cli.core.kernel import Vector, bundle, call, kernel
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import TARGET_SIZE
from podusv_cli.engine.loop.closed_loop import STATE, ClosedLoop
from podusv_cli.engine.running import replay
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics import cost
from podusv_cli.process.interrupts import SIGNALS

PACKAGE = File(podusv_cli.__file__).parent
ROOMS: dict[str, Any] = {
    "paths": Path,
    "disturbances": Disturbance,
    "actuators": Actuator,
    "controllers": Controller,
    "measurements": Measurement,
    "estimators": Estimator,
}
# CyberShip II's two propellers as one that turns, on the centre line.
POD: dict[str, float] = {
    "x": -0.499,
    "T_nn": 7.30068e-3,
    "T_nn_astern": 1.020512e-2,
    "n_max": 33.0,
    "n_max_astern": 33.0,
    "n_rate": 60.0,
    "n_lag": 0.2,
    "angle_rate": 1.0,
    "angle_lag": 0.2,
}
# What a component needs that has no default; a new kind without an entry fails its contract test.
REQUIRED: dict[str, dict[str, Any]] = {
    "legs": {"points": ((0.0, 0.0), (10.0, 1.0), (18.0, 6.0), (20.0, 15.0))},
    "legs_hold": {"points": ((0.0, 0.0), (10.0, 1.0), (18.0, 6.0), (20.0, 15.0))},
    "waypoints": {"points": ((0.0, 0.0), (10.0, 1.0), (18.0, 6.0), (20.0, 15.0))},
    "poses": {"poses": ((0.0, 0.0, 0.0), (10.0, 1.0, 0.5), (18.0, 6.0, -0.5))},
    "stations": {"poses": ((0.0, 0.0, 0.0), (10.0, 1.0, 0.5), (18.0, 6.0, -0.5))},
    "pod": {"pods": (POD,)},
    "wind": {"speed": 8.0},
    "waves": {"height": 0.1, "period": 1.5},
    "file": {"rows": "0, 1, 0.5, 0\n10, -1, 0.2, 0.1\n"},
    "wind_file": {"rows": "0, 8, 0.5\n10, 6, 0.2\n"},
    "current_file": {"rows": "0, 0.2, 0.5\n10, 0.1, 0.9\n"},
    "schedule": {"rows": "0, 1, 0\n200, 2, 0.5\n"},
    "policy": {"content": content(symmetric())},
}
# Slow enough an adaptation for a law that is evaluated only now and then.
GENTLE = AdaptiveNeural(Gamma_u=1.0, Gamma_r=1.0, gamma_u=10.0, gamma_r=10.0)
# Behind a target that goes north, facing it, and moving: nothing is folded or passes through zero.
SMOOTH_START = (-8.0, -4.0, 0.1, 0.4, 0.05, 0.02)
PRINTED_START = (-10.0, -10.0, 0.0, 0.0, 0.0, 0.0)


def pytest_configure(config: pytest.Config) -> None:
    """Keep what tests compile out of the user's cache, in one that all checkouts share.

    Its pieces are named by what they were made from, so a new clone finds those of another one.
    """
    unhurried = [HealthCheck.too_slow]  # no speed is asked of a property
    settings.register_profile("podusv", deadline=None, suppress_health_check=unhurried)
    settings.load_profile("podusv")
    caches = File(os.environ.get("XDG_CACHE_HOME") or File.home() / ".cache")
    os.environ.setdefault("PODUSV_CACHE", str(caches / "podusv-tests"))
    cost.replayer = partial(replay.replayer, evaluations=200)  # no test holds the time to anything
    os.fsync = os.fstat  # nobody cuts the power, and each would wait for the disk


def vessel(name: str) -> Vessel:
    """The vessel of that parameter file."""
    return Vessel(
        preset=name, **yaml.safe_load((PACKAGE / f"components/vessels/{name}.yaml").read_text())
    )


VESSELS = {
    path.stem: vessel(path.stem) for path in sorted((PACKAGE / "components/vessels").glob("*.yaml"))
}
PAPER, NONLINEAR = VESSELS["paper"], VESSELS["paper_nonlinear"]


def kinds(room: str) -> dict[str, type[Component]]:
    """Everything registered in a room, by kind."""
    return registry.kinds(f"podusv_cli.components.{room}", ROOMS[room])


def example(kind: type[Component], **fields: Any) -> Any:
    """A component of this class with its defaults, and what it cannot do without."""
    return kind(**REQUIRED.get(kind.model_fields["kind"].default, {}) | fields)


def target_at(path: Path, t: float) -> Vector:
    """Position, velocity and acceleration of the target at time t [s]."""
    target = np.full(TARGET_SIZE, np.nan)
    k, table = _numbers(path)
    call(path.evaluate, t=t, k=k, table=table, target=target)
    return target[: len(TARGET)]


@cache
def _numbers(path: Path) -> tuple[Any, Vector]:
    return bundle(path.constants()), path.table()


def load_at(disturbance: Disturbance, t: float, x: Vector | None = None) -> Vector:
    """(b_u, b_v, b_r) at time t [s]."""
    b = np.full(3 + len(disturbance.signals), np.nan)
    state = np.zeros(6) if x is None else x
    k, table = disturbance.constants_with(NONLINEAR), disturbance.table_for(NONLINEAR, 400.0)
    evaluate = disturbance.kernel_with(NONLINEAR)
    call(evaluate, t=t, x=state, k=bundle(k), table=table, b=b, again=0.0, stage=0.0)
    return b[:3]


class Answer(NamedTuple):
    """What a law returns for one state."""

    tau: Vector
    rate: Vector
    signals: dict[str, float]


def ask(law: Controller, x: Vector, memory: Vector, target: Vector, nominal: Vessel) -> Answer:
    """Evaluate a law once, as plain Python; what it does not write stays NaN."""
    tau, rate = np.full(2 + law.asks_sway(), np.nan), np.full(len(memory), np.nan)
    signals, work = np.full(len(law.signals), np.nan), np.full(law.workspace(), np.nan)
    k = bundle(law.constants_with(nominal))
    call(
        law.law,
        t=1.0,
        x=x,
        memory=memory,
        target=target,
        k=k,
        table=law.table(),
        tau=tau,
        rate=rate,
        signals=signals,
        work=work,
    )
    return Answer(tau, rate, dict(zip((s.name for s in law.signals), signals, strict=True)))


class Situation(NamedTuple):
    """Arguments of one evaluation of a law; the target has a heading where the law wants one."""

    x: Vector
    memory: Vector
    target: Vector


def situations(law: Controller, count: int, seed: int = 1) -> Iterator[Situation]:
    """Random states, targets and memories, all far from the singularity at the target."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        x = random.uniform(-1, 1, 6) * [20, 20, 7, 1.5, 0.5, 0.8]
        bearing, distance = random.uniform(-np.pi, np.pi), random.uniform(1, 20)
        ahead = [x[0] + distance * np.cos(bearing), x[1] + distance * np.sin(bearing)]
        target = np.concatenate([ahead, random.uniform(-1, 1, 4) * [0.7, 0.7, 0.1, 0.1]])
        if law.wants_heading():
            target = np.append(target, [0.0, *random.uniform(-1, 1, 3) * [3, 0.1, 0.01]])
        memory = law.start(x, target, NONLINEAR)
        yield Situation(x, memory + random.normal(0, 0.3, len(memory)), target)


def needed_by(law: Controller, full: Actuator) -> dict[str, Any]:
    """The path with a heading that a law reads, and `full` where it asks for a sway force."""
    path = {"path": example(Poses)} if law.wants_heading() else {}
    return {**path, "actuator": full} if law.asks_sway() else path


def failure_of(kind: type[Actuator], time: float) -> dict[str, Any]:
    """What fails at a time [s] of an actuator of this class; of pods, the first."""
    (failure, _) = get_args(kind.model_fields["failure"].annotation)
    named = {"time": time, "pod": 0}
    return {name: number for name, number in named.items() if name in failure.model_fields}


def corrected(**parts: Any) -> ClosedLoop:
    """The corrected closed loop without limits, from the printed start, with parts replaced.

    A law that asks for a sway force, or reads a heading, gets the actuator and path that it needs.
    """
    defaults: dict[str, Any] = {
        "vessel": NONLINEAR,
        "path": LineCircle(),
        "disturbance": HarmonicDisturbance(),
        "actuator": Ideal(),
        "controller": AdaptiveNeural(),
        "start": PRINTED_START,
    }
    law = parts.get("controller", defaults["controller"])
    chosen = defaults | needed_by(law, IdealFull()) | parts
    return ClosedLoop(**{"nominal": chosen["vessel"]} | chosen)


def adrift(**parts: Any) -> ClosedLoop:
    """A vessel in calm water with a constant demand (zero), with parts replaced."""
    return corrected(**{"controller": Constant(), "path": Line(), "disturbance": Calm()} | parts)


def run(loop: ClosedLoop, duration: float, step: float = 0.01, **options: Any) -> Recording:
    """Simulate for `duration` [s]; `log_every` and `hold_every` go to the grid."""
    periods = {name: options.pop(name) for name in ("log_every", "hold_every") if name in options}
    return simulate(loop, TimeGrid(step, round(duration / step), **periods), **options)


def last_state(recording: Recording, loop: ClosedLoop) -> Vector:
    """Vessel's state and law's memory in the last row."""
    names = [*STATE, *dict.fromkeys(part.name for part, _ in loop.controller.slots())]
    return np.concatenate([np.ravel(recording[name][-1]) for name in names])


class Constant(Controller):
    """A law for tests: the same demand whatever happens."""

    kind: Literal["constant"] = "constant"
    surge: float = value(0.0, "N", "surge force")
    yaw: float = value(0.0, "N m", "yaw moment")

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
        """The demand."""
        tau[0] = k.surge
        tau[1] = k.yaw

    def start(self, x: Vector, target: Vector, nominal: Vessel) -> Vector:
        """No memory."""
        return np.zeros(0)

    def slots(self) -> Slots:
        """No memory."""
        return ()


@pytest.fixture(scope="module")
def tidy():
    """What other tests left is not looked through for garbage while a test takes the time."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    """The command line, in a folder of its own with one sound scenario."""
    from scenario_samples import SOUND  # which has this module's vessels

    monkeypatch.chdir(tmp_path)
    write("a.yaml", SOUND)
    return commanded(monkeypatch, capsys, columns=80)


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """Where old results are, once they are made."""
    return tmp_path_factory.mktemp("before")


@pytest.fixture
def beside_old_results(before, tmp_path, monkeypatch, capsys):
    """The command line in a folder with finished results, the same for every test of a file."""
    return among_old_results(before, tmp_path, monkeypatch, capsys)


@pytest.fixture(autouse=True)
def own_handlers():
    """A command that was interrupted leaves its process deaf to signals; the tests go on in it.

    Signals that are ignored where the tests begin (`nohup make test &`) are not ignored in them.
    """
    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number in SIGNALS:
        usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
        signal.signal(number, usual)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(autouse=True)
def papers_apart(request):
    """Runs of whole papers are left in no checkout; a module's own fixture sees to its folder."""
    if request.node.get_closest_marker("papers"):
        folder = request.getfixturevalue("tmp_path")
        request.getfixturevalue("monkeypatch").chdir(folder)
