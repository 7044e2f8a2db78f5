"""Sensors with a rate, noise, bias, resolution, delay and outages."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from podusv_cli.components.measurements.base import FRESH, OWN, Measurement
from podusv_cli.core.component import OF_SECTION, Component, value
from podusv_cli.core.elementary import ROUND
from podusv_cli.core.kernel import Vector, kernel, shared, tail
from podusv_cli.core.random_words import gauss_markov, normals, uniforms
from podusv_cli.core.signal import STATE, Signal
from podusv_cli.core.steps import misfit

MEASURED = tuple(
    Signal(f"{state.name}_m", state.unit, f"measured {state.meaning}", rf"{state.symbol}_m")
    for state in STATE
)
# What the table has of each quantity, before all samples' errors: period and delay in steps (a
# period of 0: not measured), resolution, where its errors begin in the table; where samples wait in
# `seen` for their delivery, and how many can.
PERIOD, DELAY, RESOLUTION, ERRORS, WAITING, ROOM, HEAD = range(7)

ROUNDED = 1e-9  # of a sample
MOST_WAITING = 1_000_000  # samples that are under way at a time

Span = Annotated[tuple[float, float], Field(strict=False)]


class Sensor(Component):
    """One instrument. Its quantities are sampled together and have errors of their own."""

    period: float = value(0.1, "s", "time between two samples, a whole number of steps", gt=0)
    delay: float = value(0.0, "s", "from a sample to its delivery, a whole number of steps", ge=0)
    noise: float = value(0.0, OF_SECTION, "standard deviation of white noise", ge=0)
    bias: float = value(
        0.0,
        OF_SECTION,
        "standard deviation of a bias that wanders (first-order Gauss-Markov)",
        ge=0,
    )
    bias_time: float = value(100.0, "s", "time constant of the bias", gt=0)
    resolution: float = value(
        0.0, OF_SECTION, "samples are rounded to multiples; 0: not rounded", ge=0
    )
    lost: float = value(0.0, "", "share of the samples that are lost, at random", ge=0, lt=1)
    outages: tuple[Span, ...] = value(
        (), "s", "times [from, to] whose samples are lost", strict=False
    )

    def errors(self, stream: tuple[int | str, ...], quantities: int, count: int) -> Vector:
        """Errors of the first `count` samples, (quantities, count); NaN for a lost sample.

        `stream` names the random numbers. A sample is lost for all of an instrument's quantities.
        """
        each = [self._error((*stream, i), count) for i in range(quantities)]
        lost = uniforms((*stream, "lost"), 0, count) < self.lost
        sample = np.arange(count)
        for start, end in self.outages:  # in samples, since 3 * 0.1 is more than 0.3
            first, last = (
                math.floor(at / self.period + rest)
                for at, rest in ((start, -ROUNDED), (end, ROUNDED))
            )
            lost |= (sample > first) & (sample <= last)
        return np.where(lost, np.nan, each)

    def _error(self, stream: tuple[int | str, ...], count: int) -> Vector:
        """Noise and bias of `count` samples (count,), in the unit of the quantity."""
        error = self.noise * normals((*stream, "noise"), 0, count)
        if self.bias > 0.0:
            lag = self.period / self.bias_time  # a sample, in time constants of the bias
            error += self.bias * gauss_markov((*stream, "bias"), count, lag)
        return error

    def conflicts(self, step: float) -> Iterator[tuple[str, str]]:
        """Key and message for times that do not fit the step [s]."""
        for key, time in (("period", self.period), ("delay", self.delay)):
            if time and (fault := misfit(time, step)):
                yield key, fault
        if (waiting := self.delay / self.period) > MOST_WAITING:
            text = f"{self.delay:g} s are {waiting:.3g} periods; at most {MOST_WAITING:,} can wait"
            yield "delay", text
        for i, (start, end) in enumerate(self.outages):
            if not 0.0 <= start <= end:
                text = f"must be [from, to] with 0 <= from <= to, found [{start:g}, {end:g}]"
                yield f"outages[{i}]", text


class Sensors(Measurement):
    """GNSS, compass, speed log and gyro, each with a rate and errors of its own.

    Until the first delivery the law is given the state at the start. All contain the first-order
    motion of `disturbance.kind: waves`.
    """

    kind: Literal["sensors"] = "sensors"
    seed: int = value(1, "", "of all random errors", ge=0, lt=2**63)
    position: Sensor = value(Sensor(period=0.2, noise=0.02), "m", "x and y, as GNSS gives them")
    heading: Sensor = value(Sensor(period=0.1, noise=0.005), "rad", "psi, as a compass gives it")
    velocity: Sensor | None = value(
        Sensor(period=0.2, noise=0.02), "m/s", "u and v over ground; null: not measured"
    )
    yaw_rate: Sensor | None = value(
        Sensor(period=0.1, noise=0.002), "rad/s", "r, as a gyro gives it; null: not measured"
    )

    def instruments(self) -> dict[str, tuple[Sensor | None, int]]:
        """Each sensor by its key, and how many quantities it has, in the order of the state."""
        return {
            "position": (self.position, 2),
            "heading": (self.heading, 1),
            "velocity": (self.velocity, 2),
            "yaw_rate": (self.yaw_rate, 1),
        }

    def measured(self) -> tuple[bool, ...]:
        """Which of x, y, psi, u, v, r have a sensor."""
        return tuple(
            bool(sensor) for sensor, count in self.instruments().values() for _ in range(count)
        )

    def outages_of_each(self) -> tuple[tuple[Span, ...], ...]:
        """Times [from, to] [s] without samples, of each of x, y, psi, u, v, r."""
        sensors = self.instruments().values()
        return tuple(
            sensor.outages if sensor else () for sensor, count in sensors for _ in range(count)
        )

    def noise_of_each(self) -> tuple[float, ...]:
        """Standard deviation of white noise and bias together, of each quantity in its unit."""
        sensors = self.instruments().values()
        each = [
            (math.hypot(sensor.noise, sensor.bias) if sensor else 0.0, n) for sensor, n in sensors
        ]
        return tuple(noise for noise, count in each for _ in range(count))

    def delay_of_position(self) -> float:
        """Age of a position when it is delivered [s]."""
        return self.position.delay

    def age(self) -> float:
        """Mean age of the heading that the law sees [s]: delay and half a period."""
        return self.heading.delay + 0.5 * self.heading.period

    @property
    def signals(self) -> tuple[Signal, ...]:
        """The measured values that are logged, as they were delivered last."""
        return tuple(part for part, has in zip(MEASURED, self.measured(), strict=True) if has)

    def constants_with(self, step: float, motion: int) -> dict[str, float]:
        """Where the disturbance has the wave motion; all else is in the table."""
        return {"motion": float(motion)}

    def table_for(self, step: float, steps: int) -> Vector:
        """A head for each quantity, see `PERIOD`, then the errors of all samples; one vector.

        For a run of `steps` steps of `step` [s]. A quantity without a sensor has a head of zeros.
        """
        # Where the next errors begin in the table, and the next waiting samples in `seen`
        heads, errors, filled, waiting = [], [np.zeros(0)], HEAD * len(STATE), OWN
        for name, (sensor, count) in self.instruments().items():
            if not sensor:
                heads += [np.zeros(HEAD)] * count
                continue
            period, delay, room = _steps(sensor, step)
            rows = sensor.errors((self.seed, "measurement", name), count, steps // period + 1)
            for row in rows:
                heads.append(np.array([period, delay, sensor.resolution, filled, waiting, room]))
                filled, waiting = filled + len(row), waiting + room
                errors.append(row)
        return np.concatenate([*heads, *errors]).astype(float)

    def shared_places(self) -> list[int]:
        """Places in the table that runs side by side share: the heads but for the resolutions."""
        heads = range(HEAD * len(STATE))
        return [place for place in heads if place % HEAD != RESOLUTION]

    def first(self, start: Vector, step: float) -> Vector:
        """The start, and room for the samples that wait for their delivery."""
        rooms = [_steps(sensor, step)[2] * n for sensor, n in self.instruments().values() if sensor]
        return np.concatenate([super().first(start, step), np.zeros(sum(rooms))])

    def conflicts(self, step: float) -> Iterator[tuple[str, str]]:
        """Key and message of each sensor's conflicts with the step [s]."""
        for name, (sensor, _) in self.instruments().items():
            for key, text in sensor.conflicts(step) if sensor else ():
                yield f"{name}.{key}", text

    # `instant` counts steps, x (6) is the state, b has the waves' motion from k.motion on; table as
    # `table_for` has it. Writes seen: values, marks, and samples that wait for their delivery, in a
    # ring of its own for each quantity.
    @staticmethod
    @kernel
    def sense(instant: float, x: Vector, b: Vector, k: Any, table: Vector, seen: Vector) -> None:
        """Sample what is due, with its error; deliver what has waited long enough."""
        for i in range(6):
            head = tail(table, HEAD * i)
            period = shared(head[PERIOD])
            seen[FRESH + i] = 0.0
            if period > 0.0:
                # Periods since the start: quotients of whole numbers, which take less
                # time than remainders.
                sampled, delivered = instant / period, (instant - shared(head[DELAY])) / period
                waiting, room = tail(seen, int(shared(head[WAITING]))), int(shared(head[ROOM]))
                if sampled == int(sampled):
                    moved = b[int(k.motion) + i] if k.motion > 0.0 else 0.0
                    sample = x[i] + moved + table[int(shared(head[ERRORS])) + int(sampled)]
                    waiting[int(sampled) % room] = round_to(sample, head[RESOLUTION])
                if delivered >= 0.0 and delivered == int(delivered):
                    sample = waiting[int(delivered) % room]
                    if not math.isnan(sample):
                        seen[i] = sample
                        seen[FRESH + i] = 1.0


# Both in the unit of the quantity. Adding ROUND, a number without fraction digits, and taking it
# off rounds without a function call.
@kernel
def round_to(number: float, resolution: float) -> float:
    """The nearest multiple of the resolution; the number itself for a resolution of 0."""
    if resolution > 0.0:
        return float(((number / resolution + ROUND) - ROUND) * resolution)
    return number


def _steps(sensor: Sensor, step: float) -> tuple[int, int, int]:
    """Period and delay of a sensor in steps, and how many samples wait for delivery at most.

    One more than whole periods in the delay: the one that is due is still there.
    """
    period, delay = max(1, round(sensor.period / step)), round(sensor.delay / step)
    return period, delay, delay // period + 1
