"""Corners that a law sees rounded: against the mean of the target's positions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from conftest import corrected
from findings_samples import finding
from pydantic import ValidationError
from rotation import one_in

from podusv_cli.components.controllers.base import Controller
from podusv_cli.components.paths.fillet import round_corner
from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.waypoints import Waypoints
from podusv_cli.core.errors import NotConvergedError
from podusv_cli.core.kernel import Vector, bundle, kernel
from podusv_cli.core.signal import Signal
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.theory.course import course as steady

CORNERS = ((0.0, 0.0), (4.0, 1.0), (5.0, 4.0), (1.0, 5.0))
SEEN = tuple(Signal(name, "m", name) for name in ("north", "east", "north_rate", "east_rate"))


def course(after: str, fillet: float = 3.0) -> Waypoints:
    return Waypoints(points=CORNERS, speed=0.5, legs="straight", after=after, fillet=fillet)  # type: ignore[arg-type]


def shown(path: Waypoints, t: float) -> Vector:
    """The target as the law sees it."""
    fillet, given = path.fillet_for_law(), np.zeros(6)
    assert fillet is not None
    target = path.targets([t])[0]
    round_corner(t, bundle(fillet.constants(0)), fillet.rows(), target, given)
    both = np.zeros((2, 6))
    path.evaluate_shown(t, bundle(path.constants()), path.table(), *both)
    np.testing.assert_array_equal(both, [target, given])
    return given


def mean(path: Waypoints, t: float) -> Vector:
    """The mean of the target's positions over the fillet's time about t, by small steps."""
    count = 6000
    middle = t + path.fillet * ((np.arange(count) + 0.5) / count - 0.5)
    return np.asarray(path.targets(middle)[:, :2].mean(axis=0))


class Witness(Controller):
    """Logs the target that it sees, and keeps the one of its last sample."""

    kind: Literal["witness"] = "witness"
    signals: ClassVar[tuple[Signal, ...]] = SEEN

    def slots(self) -> Any:
        return ((Signal("sampled", "m", "target's north at the last sample"), 1),)

    def takes_samples(self) -> bool:
        return True

    @staticmethod
    @kernel
    def sample(memory: Vector, target: Vector) -> None:
        memory[0] = target[0]

    @staticmethod
    @kernel
    def law(target: Vector, tau: Vector, rate: Vector, signals: Vector) -> None:
        tau[0] = tau[1] = rate[0] = 0.0
        for i in range(4):
            signals[i] = target[i]


@pytest.mark.parametrize("after", one_in(3, ["loop", "continue", "stop"]))
def test_the_law_sees_the_mean_of_the_target_over_the_time_of_the_fillet(after: str) -> None:
    path = course(after)
    end = path.breaks()[-1].time
    for t in np.linspace(path.fillet, 2.2 * end, 25):
        np.testing.assert_allclose(shown(path, t)[:2], mean(path, t), atol=2e-7)


def test_each_corner_is_its_own_where_legs_last_hardly_longer_than_the_fillet() -> None:
    """Between 1 and 1.5 fillets: half a fillet past a corner the next one has not begun."""
    path = Waypoints(points=CORNERS, speed=0.5, legs="straight", after="stop", fillet=5.8)
    lasting = np.diff([at.time for at in path.breaks()])
    assert 5.8 < lasting.min() < 1.5 * 5.8
    for t in np.linspace(path.fillet, 1.2 * path.breaks()[-1].time, 25):
        np.testing.assert_allclose(shown(path, t)[:2], mean(path, t), atol=1e-6)


def test_velocity_and_acceleration_are_those_of_the_rounded_target() -> None:
    path, h = course("stop"), 1e-5
    for known in path.breaks():
        for t in known.time + np.array([-1.6, -1.4, -0.3, 0.2, 1.3, 1.6]):
            before, here, after = (shown(path, t + s) for s in (-h, 0.0, h))
            np.testing.assert_allclose(here[2:], (after - before)[:4] / (2 * h), atol=1e-8)


def test_the_first_round_of_a_loop_begins_at_its_point() -> None:
    path = course("loop")
    np.testing.assert_array_equal(shown(path, 0.2), path.targets([0.2])[0])
    assert abs(shown(path, path.breaks()[-1].time + 0.2)[0] - 0.1) > 0.05


@pytest.mark.parametrize("hold", [0, 10])
def test_in_a_run_the_law_sees_the_fillet_and_the_log_has_the_corner(hold: int) -> None:
    grid = TimeGrid(0.05, 400, hold_every=hold)
    loop = replace(corrected(), controller=Witness(), path=course("continue"))
    run, sharp = (
        simulate(replace(loop, path=course("continue", fillet)), grid) for fillet in (3.0, 0.0)
    )
    times = run["time"]
    np.testing.assert_array_equal(run["x_d"], sharp["x_d"])
    np.testing.assert_allclose(run["z_e"], np.hypot(run["x_d"] - run["x"], run["y_d"] - run["y"]))
    asked = times - times % (0.05 * hold) if hold else times
    wanted = np.array([shown(loop.path, t) for t in np.round(asked, 9)])  # type: ignore[arg-type]
    for i, signal in enumerate(SEEN):
        np.testing.assert_allclose(run[signal.name], wanted[:, i], atol=1e-9)
    np.testing.assert_allclose(run["sampled"], wanted[:, 0], atol=1e-9)
    assert np.abs(run["north"] - run["x_d"]).max() > 0.1


@pytest.mark.slow
def test_runs_side_by_side_have_the_bits_that_they_have_alone() -> None:
    loops = [
        replace(corrected(), controller=Witness(), path=course("loop", fillet))
        for fillet in np.linspace(0.5, 3.0, 9)
    ]
    grid = TimeGrid(0.05, 700)
    one, other = (simulate_many(loops, grid, side_by_side=lanes) for lanes in (True, False))
    np.testing.assert_array_equal(one.state, other.state)


def test_a_fillet_is_refused_where_it_has_no_corner_or_no_room() -> None:
    with pytest.raises(ValidationError, match="a spline has no corners"):
        Waypoints(points=CORNERS, fillet=1.0)
    with pytest.raises(ValidationError, match=r"longer than leg 2 takes \(6\.32\d+ s\)"):
        course("continue", 6.4)
    with pytest.raises(ValidationError, match=r"longer than leg 1 takes \(2 s\)"):
        Waypoints(points=((0, 0), (1, 0), (1, 9), (9, 9)), legs="straight", fillet=3.0)
    points = ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 1.0))
    with pytest.raises(ValidationError, match="longer than leg 4"):  # it closes the loop
        Waypoints(points=points, legs="straight", after="loop", fillet=2.5)
    with pytest.raises(ValidationError, match="has none"):
        Waypoints(points=((0, 0), (9, 0)), legs="straight", fillet=2.0)
    assert Line().fillet_for_law() is None
    assert course("loop", 0.0).fillet_for_law() is None


def test_a_law_may_have_a_constant_of_the_name() -> None:
    class Named(Witness):
        kind: Literal["named"] = "named"  # type: ignore[assignment]
        fillet: float = 8.0

    loop, grid = replace(corrected(), path=course("loop")), TimeGrid(0.05, 400)
    one, other = (simulate(replace(loop, controller=law()), grid) for law in (Named, Witness))
    np.testing.assert_array_equal(one["north"], other["north"])


def test_steady_motion_is_looked_for_outside_the_fillets() -> None:
    path = course("continue", 6.0)
    corner = path.breaks()[-1].time
    near = course("continue", 0.0)
    assert abs(steady(near, 60.0, corner + 1.5).time - corner) == pytest.approx(1.5)
    with pytest.raises(NotConvergedError):
        steady(path, 60.0, corner + 3.5)


def test_the_acceleration_of_a_fillet_is_told_before_a_run() -> None:
    points = "points: [[0, 0], [9, 0], [9, 9]]"
    path = f"path={{kind: waypoints, legs: straight, {points}, fillet: 0.5}}"
    assert "jumps by up to 1.41 m/s2" in finding("path-bend", path).text
