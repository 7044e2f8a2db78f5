"""What the logs say of a hull: numbers with intervals, forces, what they leave open."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydantic import ValidationError

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.estimators.ekf import MOVING
from podusv_cli.components.vessels.envelope import Envelope
from podusv_cli.components.vessels.plant import surge_force, sway_force, yaw_moment
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.core.signal import STATE
from podusv_cli.identify.fit.estimate import Directions, HullEstimate
from podusv_cli.identify.fit.march import CURVE, THRUST
from podusv_cli.identify.fit.problem import FitProblem, channels
from podusv_cli.identify.fit.records import FilterLog
from podusv_cli.identify.judge import FreeRun, Score, decisive, scores_worse_than_prior

SIDE = 1.959964  # standard deviations to either end of an interval that holds 95 %
SLOWEST = 0.05  # of the largest speed along the logs: slower is no motion to speak of
COVERED = (0.1, 0.5, 0.9)  # quantiles of a speed along the logs
OUTERMOST = 0.995  # quantile of the motion that becomes the envelope
BEYOND, POINTS = 1.3, 40  # of a curve: how far beyond the fastest that is covered
TRIES = 100  # hulls that are drawn for one that is possible
WARM = 5.0  # s, in which innovations are those of the start


@dataclass(frozen=True)
class Parameter:
    """A number before and after the logs: the ends are those of an interval that holds 95 %."""

    name: str
    prior: float
    prior_low: float
    prior_high: float
    value: float
    low: float
    high: float
    width: float  # posterior over prior standard deviation, of the logarithm


@dataclass(frozen=True)
class Force:
    """A damping force of the hull at one velocity, with intervals that hold 95 % of the hulls."""

    force: str
    at: float
    value: float
    low: float
    high: float
    prior_low: float
    prior_high: float

    @property
    def width(self) -> float:
        """Of the interval, over that of the prior, each relative to what it is about.

        1 where nothing of it was looked for.
        """
        before = (self.prior_high - self.prior_low) / abs(self.prior_high + self.prior_low)
        return 0.5 * (self.high - self.low) / abs(self.value) / before if before else 1.0


@dataclass(frozen=True)
class DampingAxis:
    """A damping force of the hull over its own velocity, the other two being 0."""

    name: str
    unit: str
    speed: str
    speed_unit: str
    force: Callable[..., float]


AXES = (
    DampingAxis("X(u)", "N", "u", "m/s", surge_force),
    DampingAxis("Y(v)", "N", "v", "m/s", sway_force),
    DampingAxis("N(r)", "N m", "r", "rad/s", yaw_moment),
)


@dataclass(frozen=True)
class ForceCurve:
    """A force over speed; `after` and `before` are the two ends of 95 % of the hulls."""

    axis: DampingAxis
    speeds: Vector
    value: Vector
    after: Vector
    before: Vector
    covered: Vector


@dataclass(frozen=True)
class Whiteness:
    """Innovations of a sensor along a log: mean square over variance, and how like the one before.

    Both say where the model is wrong: the first is 1 and the second 0 where it is right.
    """

    log: str
    measured: str
    count: int
    nis: float
    correlation: float


@dataclass(frozen=True)
class Identification:
    """A hull from logs, and all that is known of its errors."""

    problem: FitProblem
    estimate: HullEstimate
    directions: Directions
    judged: Sequence[tuple[FilterLog, str, Sequence[FreeRun]]]
    scores: Sequence[Score]

    @property
    def determined_count(self) -> int:
        """How many directions the logs determine; none where the search did not settle."""
        return self.directions.determined_count if self.estimate.settled else 0

    @cached_property
    def refused_by(self) -> list[tuple[Score, Score]]:
        """Where the prior predicts better, so that the hull is none to use: own score, prior's."""
        both_axes = math.sqrt(2.0) * self.problem.position_noise(self.estimate.y)
        return scores_worse_than_prior(decisive(self.scores), both_axes)

    @cached_property
    def vessel(self) -> Vessel:
        """The hull, with the motion that the logs cover as its envelope."""
        hull = self.problem.vessel(self.estimate.y)
        names = ", ".join(log.name for log in self.problem.logs)
        return hull.changed(
            {
                "preset": "",
                "envelope": self.envelope,
                "source": f"podusv identify, from {names}",
                "validity": "the motion of the logs (envelope); posterior.csv has the joint errors",
            }
        )

    @cached_property
    def actuator(self) -> Actuator | None:
        """The actuator with the thrust that was found; None if none was looked for or none can be.

        A kind without propellers has no place for it, nor has a rudder for a bent curve.
        """
        sought = {number.name for number in self.problem.hull} & {THRUST, *CURVE}
        return self.problem.actuator(self.estimate.y) if sought else None

    @cached_property
    def motion(self) -> Vector:
        """u, v, r of the filter at all rows of all logs, without its first seconds."""
        tracks = []
        for log in self.problem.logs:
            track = self.problem.follow(log, [self.estimate.y]).track[:, 3:MOVING, 0]
            tracks.append(track[log.times >= log.times[0] + min(WARM, 0.5 * log.duration)])
        return np.concatenate(tracks)

    @cached_property
    def envelope(self) -> Envelope:
        """The motion that the logs cover."""
        u, v, r = self.motion.T
        speed = np.quantile(np.hypot(u, v), OUTERMOST)
        drift = np.where(np.hypot(u, v) > 0.1 * speed, np.arctan2(np.abs(v), np.abs(u)), 0.0)
        return Envelope(
            source="the logs",
            speed=float(max(speed, 1e-6)),
            drift=float(max(np.quantile(drift, OUTERMOST), 1e-3)),
            yaw_rate=float(max(np.quantile(np.abs(r), OUTERMOST), 1e-6)),
        )

    @cached_property
    def parameters(self) -> list[Parameter]:
        """The numbers that were looked for, the hull's first."""
        sd = np.sqrt(np.diag(self.estimate.covariance))
        at, y, width = self.problem.at, self.estimate.y, np.full(len(sd), SIDE)
        before = np.sort([at(-width), at(width)], axis=0)
        after = np.sort([at(y - SIDE * sd), at(y + SIDE * sd)], axis=0)
        columns = np.array([*before, at(y), *after, sd]).T.tolist()
        return [
            Parameter(number.name, number.prior, *ends)
            for number, ends in zip(self.problem.numbers, columns, strict=True)
        ]

    @cached_property
    def draws(self) -> list[Vessel]:
        """Hulls that the logs leave possible, drawn jointly."""
        return [self.problem.vessel(y) for y in self._draws]

    @cached_property
    def onward(self) -> list[Vessel]:
        """Hulls that move under one thrust, that of the estimate, as the draws do under theirs."""
        thrust = self.problem.thrust(self.estimate.y)
        return [self.problem.scale_by_thrust(y, thrust) for y in self._draws]

    @cached_property
    def _draws(self) -> list[Vector]:
        """Of hulls that the logs leave possible.

        In directions that are open the numbers' logarithms are normal, as they were before. Then
        the directions that are determined are put where they belong, in straight lines: forces are
        sums of the numbers themselves, however a draw divides them.
        """
        ways, sd = self.directions, self.problem.sd
        centre = self.estimate.y[: len(sd)]
        determined, open_ways = np.split(ways.basis, [ways.determined_count], axis=1)

        def point(normal: Vector) -> Vector:
            """The point of a draw; not finite where a number would change its sign."""
            near, far = np.split(ways.widths * normal, [ways.determined_count])
            off = np.expm1(sd * (open_ways @ far)) / sd
            off += determined @ (near - determined.T @ off)
            with np.errstate(invalid="ignore", divide="ignore"):  # a number that would change sign
                return np.asarray(centre + np.log1p(sd * off) / sd)

        return self._possible(point)

    @cached_property
    def before(self) -> list[Vessel]:
        """Hulls that were possible before the logs were read."""
        return [self.problem.vessel(y) for y in self._possible(lambda normal: normal)]

    def _possible(self, point: Callable[[Vector], Vector]) -> list[Vector]:
        """A point of each draw of normal numbers, but for draws of which no hull can be made.

        Raises UsageError where hardly any can.
        """
        rng = np.random.Generator(np.random.PCG64(self.problem.wanted.seed))
        points: list[Vector] = []
        for _ in range(TRIES * self.problem.wanted.draws):
            y = point(rng.standard_normal(len(self.problem.hull)))
            if np.all(np.isfinite(y)):
                with suppress(ValidationError):
                    self.problem.vessel(y)
                    points.append(y)
            if len(points) == self.problem.wanted.draws:
                return points
        raise UsageError(
            "hardly any hull that is drawn is possible (numbers keep their sign, the mass matrix "
            "must be positive definite); give narrower priors, identify.prior or identify.priors"
        )

    @cached_property
    def forces(self) -> list[Force]:
        """Damping forces at speeds of the logs, but those that are 0."""
        found = []
        for place, axis in enumerate(AXES):
            moving = np.abs(self.motion[:, place])
            moving = moving[moving >= SLOWEST * moving.max()]
            speeds = np.quantile(moving, COVERED)
            own, after, before = self._damping(place, speeds)
            found += [
                Force(axis.name, *map(float, numbers))
                for numbers in zip(speeds, own, *after, *before, strict=True)
                if numbers[1]  # of none there is no interval
            ]
        return found

    @cached_property
    def curves(self) -> list[ForceCurve]:
        """Damping forces from rest to beyond the speeds of the logs."""
        found = []
        for place, axis in enumerate(AXES):
            covered = np.quantile(np.abs(self.motion[:, place]), (COVERED[0], COVERED[-1]))
            speeds = np.linspace(0.0, BEYOND * covered[1], POINTS)
            found.append(ForceCurve(axis, speeds, *self._damping(place, speeds), covered))
        return found

    def _damping(self, place: int, speeds: Vector) -> tuple[Vector, Vector, Vector]:
        """Force at speeds, of the hull; with the ends of 95 % of the hulls after and before."""

        def along(hull: Vessel) -> list[float]:
            k, nu = bundle(hull.constants()), np.zeros((len(speeds), 3))
            nu[:, place] = speeds
            return [AXES[place].force(*row, k) for row in nu.tolist()]

        after, before = (
            np.quantile([along(hull) for hull in hulls], (0.025, 0.975), axis=0, method="weibull")
            for hulls in (self.draws, self.before)
        )
        return np.array(along(self.vessel)), after, before

    @cached_property
    def whiteness(self) -> list[Whiteness]:
        """Of every sensor along every log."""
        return [w for log in self.problem.logs for w in self._whiteness(log)]

    def _whiteness(self, log: FilterLog) -> Iterator[Whiteness]:
        """Of the sensors along a log that deliver enough values to tell."""
        followed = self.problem.follow(log, [self.estimate.y])
        normal = followed.innovations[:, 0] / np.sqrt(followed.variances[:, 0])
        of = channels(log)
        for i, signal in enumerate(STATE):
            own = normal[of == i][5:]
            if len(own) > 10:
                alike = float(np.mean(own[1:] * own[:-1]) / np.mean(own**2))
                yield Whiteness(log.name, signal.name, len(own), float(np.mean(own**2)), alike)
