"""Logs of boats by plain numpy: motion, thrusters, sea and sensors that share no code with podusv.

A hull in three degrees of freedom (T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion
Control", 2011, ch. 6 and 7) with propellers that lag what is asked for, in a current and under a
load that is fixed to the earth, by classical RK4. What `podusv identify` makes of such a log says
how good it is; a simulator that shares its equations would hide what both have wrong.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP = 0.01  # s, of the integration
CEP = math.sqrt(2.0 * math.log(2.0))  # radius that holds half of all positions, over their sd


@dataclass(frozen=True)
class Propeller:
    """A propeller: where it is [m], thrust over squared speed [N s2] ahead and astern.

    `top` is its largest speed ahead [1/s]; its speed follows what is asked for with the time
    constant `lag` [s], at most at `rate` [1/s2]. It turns with its axis where `angle_lag` [s] is
    not 0, at most at `angle_rate` [rad/s]; or a rudder does in its stream, whose normal force is
    `lift` n^2 times its angle, up to the angle `stall` [rad]. With a dead band, a part of `top`,
    or another exponent than 2 its thrust at `top` is the same.
    """

    x: float
    y: float
    ahead: float
    astern: float
    top: float
    lag: float = 0.1
    rate: float = math.inf
    angle_lag: float = 0.0
    angle_rate: float = math.inf
    lift: float = 0.0
    stall: float = 0.0
    dead_band: float = 0.0
    exponent: float = 2.0

    def thrust(self, n: float) -> float:
        """Thrust [N] at a speed [1/s]."""
        gain = self.ahead if n >= 0.0 else self.astern
        if self.dead_band == 0.0 and self.exponent == 2.0:
            return gain * abs(n) * n
        part = max(abs(n) / self.top - self.dead_band, 0.0) / (1.0 - self.dead_band)
        return math.copysign(gain * self.top**2 * part**self.exponent, n)

    def push(self, n: float, angle: float) -> tuple[float, float, float]:
        """Surge force, sway force and yaw moment at a speed [1/s] and an angle [rad]."""
        T = self.thrust(n)
        along, across = T * math.cos(angle), T * math.sin(angle)
        if self.lift:
            normal = self.lift * max(n, 0.0) ** 2 * min(max(angle, -self.stall), self.stall)
            along, across = T - normal * math.sin(angle), normal * math.cos(angle)
        return along, across, self.x * across - self.y * along

    def rates(self, n: float, angle: float, asked: Sequence[float]) -> tuple[float, float]:
        """How fast speed and angle change."""
        faster = min(max((asked[0] - n) / self.lag, -self.rate), self.rate)
        if not self.angle_lag:
            return faster, 0.0
        turn = (asked[1] - angle) / self.angle_lag
        return faster, min(max(turn, -self.angle_rate), self.angle_rate)


@dataclass(frozen=True)
class PlainBoat:
    """A hull by the numbers of its mass matrix and its damping, as `Y_rv` (of |r| v), and so on.

    Damping that is not named is 0.
    """

    numbers: Mapping[str, float]
    propellers: Sequence[Propeller]

    def number(self, name: str) -> float:
        """A number of the hull."""
        return self.numbers.get(name, 0.0)

    @cached_property
    def damping(self) -> Callable[[float, float, float], tuple[float, float, float]]:
        """Forces and moment of the water on a hull that moves so (u, v, r) [N, N, N m]."""
        X_u, X_uu, X_uuu = map(self.number, ("X_u", "X_uu", "X_uuu"))
        Y, N = ([self.number(f"{a}_{n}") for n in ("v", "vv", "rv", "r", "vr", "rr")] for a in "YN")

        def turned(k: Sequence[float], v: float, r: float) -> float:
            V, R = abs(v), abs(r)
            return (k[0] + k[1] * V + k[2] * R) * v + (k[3] + k[4] * V + k[5] * R) * r

        def forces(u: float, v: float, r: float) -> tuple[float, float, float]:
            return (X_u + X_uu * abs(u) + X_uuu * u * u) * u, turned(Y, v, r), turned(N, v, r)

        return forces

    @cached_property
    def acceleration(self) -> Callable[..., tuple[float, float, float]]:
        """From M nu' = load + damping - C(nu) nu: of (u, v, r) through the water and three loads.

        Kirchhoff's equations: what momentum and angular momentum lose as the hull turns.
        """
        m11, m22, m23, m33 = map(self.number, ("m11", "m22", "m23", "m33"))
        determinant, damping = m22 * m33 - m23 * m23, self.damping

        def rates(
            u: float, v: float, r: float, a: float, b: float, c: float
        ) -> tuple[float, float, float]:
            ahead, aside = m11 * u, m22 * v + m23 * r
            X, Y, N = damping(u, v, r)
            X += a + aside * r
            Y += b - ahead * r
            N += c + ahead * v - aside * u
            return X / m11, (m33 * Y - m23 * N) / determinant, (m22 * N - m23 * Y) / determinant

        return rates


@dataclass(frozen=True)
class Sea:
    """How the water flows [m/s north, east], and a load at a time, earth-fixed [N, N, N m]."""

    current: tuple[float, float] = (0.0, 0.0)
    load: Callable[[float], Sequence[float]] = field(default=lambda t: (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Motion:
    """States over ground (x, y, psi, u, v, r) at times STEP apart.

    `thrusters` and `asked` have speeds [1/s] of all propellers, then their angles [rad]; `loads`
    are their surge force, sway force and yaw moment together.
    """

    times: Array
    states: Array
    thrusters: Array
    asked: Array
    loads: Array


def sail(
    boat: PlainBoat, asked: Callable[[float], Sequence[float]], duration: float, sea: Sea
) -> Motion:
    """The motion from rest in the water; of each propeller a speed, then an angle is asked for.

    Speeds alone [1/s] ask for angles of 0.
    """
    wx, wy = sea.current
    count, size = round(duration / STEP), len(boat.propellers)
    propellers = list(enumerate(boat.propellers))

    def push(s: Sequence[float]) -> list[float]:
        each = [p.push(s[6 + i], s[6 + size + i]) for i, p in propellers]
        return [sum(axis) for axis in zip(*each, strict=True)]

    def wanted_at(t: float) -> list[float]:
        wanted = [float(w) for w in asked(t)]
        return wanted + [0.0] * (2 * size - len(wanted))

    def rate(t: float, s: Sequence[float], wanted: Sequence[float]) -> list[float]:
        psi, u, v, r = s[2:6]
        c, n = math.cos(psi), math.sin(psi)
        bx, by, turn = sea.load(t)
        X, Y, N = push(s)
        lags = [p.rates(s[6 + i], s[6 + size + i], wanted[i::size]) for i, p in propellers]
        speeds, angles = zip(*lags, strict=True)
        nu = boat.acceleration(u, v, r, X + c * bx + n * by, Y + c * by - n * bx, N + turn)
        return [c * u - n * v + wx, n * u + c * v + wy, r, *nu, *speeds, *angles]

    def shifted(s: Sequence[float], h: float, by: Sequence[float]) -> list[float]:
        return [x + h * d for x, d in zip(s, by, strict=True)]

    s = [0.0] * (6 + 2 * size)
    rows, wants, h = [s], [wanted_at(0.0)], STEP
    for k in range(count):
        t, wanted = k * h, wants[-1]
        a = rate(t, s, wanted)
        b = rate(t + 0.5 * h, shifted(s, 0.5 * h, a), wanted)
        d = rate(t + 0.5 * h, shifted(s, 0.5 * h, b), wanted)
        e = rate(t + h, shifted(s, h, d), wanted)
        s = [
            x + h / 6.0 * (p + 2.0 * (q + r) + o)
            for x, p, q, r, o in zip(s, a, b, d, e, strict=True)
        ]
        rows.append(s)
        wants.append(wanted_at((k + 1) * h))
    states: Array = np.array(rows, dtype=np.float64)
    c, n = np.cos(states[:, 2]), np.sin(states[:, 2])
    states[:, 3] += c * wx + n * wy
    states[:, 4] += c * wy - n * wx
    times: Array = h * np.arange(count + 1, dtype=np.float64)
    loads = np.array([push(row) for row in rows])
    return Motion(times, states[:, :6], states[:, 6:], np.array(wants), loads)


def steps_of(
    rng: np.random.Generator, low: Sequence[float], high: Sequence[float], shortest: float
) -> Callable[[float], Sequence[float]]:
    """Numbers between two ends that stay for `shortest` to three times that [s]."""
    ends = np.cumsum(rng.uniform(shortest, 3.0 * shortest, 2000)).tolist()
    values = rng.uniform(low, high, (len(ends), len(low))).tolist()
    return lambda t: values[bisect_right(ends, t)]


def wander(rng: np.random.Generator, count: int, h: float, sd: float, lasting: float) -> Array:
    """A first-order Gauss-Markov process at `count` times h apart [s]; it forgets in `lasting`."""
    kept = math.exp(-h / lasting)
    values = np.empty(count)
    values[0] = sd * rng.standard_normal()
    for i, e in enumerate(rng.standard_normal(count - 1), 1):
        values[i] = kept * values[i - 1] + sd * math.sqrt(1.0 - kept**2) * e
    return values


def wandering_load(
    rng: np.random.Generator, duration: float, sd: Sequence[float], lasting: float
) -> Callable[[float], Sequence[float]]:
    """A load that wanders about 0, in straight lines between values 0.1 s apart."""
    count = math.ceil(duration / 0.1) + 2
    each = [wander(rng, count, 0.1, s, lasting) if s else np.zeros(count) for s in sd]
    values = np.array(each).T.tolist()

    def load(t: float) -> list[float]:
        i = int(10.0 * t)
        part = 10.0 * t - i
        return [a + part * (b - a) for a, b in zip(values[i], values[i + 1], strict=True)]

    return load


@dataclass(frozen=True)
class Sensors:
    """Periods [s] and errors of GNSS [m], compass [rad] and gyro [rad/s].

    A GNSS has a white error and one that wanders, with its deviation and the time in which it
    forgets; a compass may be off by a constant.
    """

    gnss: float = 0.02
    gnss_wander: float = 0.0
    gnss_lasting: float = 30.0
    gnss_period: float = 0.2
    compass: float = math.radians(0.5)
    compass_off: float = 0.0
    gyro: float = 0.002
    row: float = 0.1


def log_columns(motion: Motion, sensors: Sensors, rng: np.random.Generator) -> dict[str, Array]:
    """What a logger writes, a row every `sensors.row`; NaN where a sensor delivers nothing."""
    every = round(sensors.row / STEP)
    at = np.arange(0, len(motion.times), every)
    count, states = len(at), motion.states[at]
    columns = {"time": motion.times[at]}
    some = round(sensors.gnss_period / sensors.row)
    for i, name in enumerate(("x", "y")):
        off = sensors.gnss * rng.standard_normal(count)
        if sensors.gnss_wander:
            off += wander(rng, count, sensors.row, sensors.gnss_wander, sensors.gnss_lasting)
        column = states[:, i] + off
        column[np.arange(count) % some > 0] = np.nan
        columns[name] = column
    heading = states[:, 2] + sensors.compass_off + sensors.compass * rng.standard_normal(count)
    columns["psi"] = np.mod(heading + math.pi, 2.0 * math.pi) - math.pi
    columns["r"] = states[:, 5] + sensors.gyro * rng.standard_normal(count)
    for end, values in (("", motion.thrusters), ("_cmd", motion.asked)):
        both = np.split(values[at].T, 2)
        for name, each in zip(("n", "delta"), both, strict=True):
            columns |= {f"{name}{end}_{i}": v for i, v in enumerate(each, 1)}
    names = ("tau_u", "tau_v", "tau_r")
    return columns | dict(zip(names, motion.loads[at].T, strict=True))


def columns_of(columns: Mapping[str, Array], logged: str) -> dict[str, Array]:
    """The log of somebody who has commands, shaft speeds or forces: `logged`."""
    begins = {
        "commands": ("n_cmd", "delta_cmd"),
        "shaft speeds": ("n_", "delta_"),
        "forces": ("tau",),
    }
    asked = logged == "commands"
    acted = {
        n: c for n, c in columns.items() if n.startswith(begins[logged]) and ("cmd" in n) == asked
    }
    return {n: columns[n] for n in ("time", "x", "y", "psi", "r")} | acted


# An Otter's propellers; the hull of somebody's boat of 2 m, and the one that its owner guesses.
TWO = tuple(Propeller(0.0, y, 0.437421, 0.254438, 16.54) for y in (-0.395, 0.395))
GUESSED = {
    **{"m11": 60.2815, "m22": 137.5, "m23": 11.0, "m33": 39.325, "X_u": -40.0, "X_uu": -25.0},
    **{"Y_v": -137.5, "Y_vv": -100.403, "Y_rv": -74.677},
    **{"N_r": -39.325, "N_vr": -63.571, "N_rr": -416.691},
}
FACTORS = {
    **{"m11": 0.8, "m22": 1.2, "m33": 0.75, "X_u": 0.6, "X_uu": 0.75},
    **{"Y_v": 0.7, "Y_vv": 1.3, "N_r": 0.6, "N_rr": 0.5},
}
OWN_BOAT = PlainBoat({n: g * FACTORS.get(n, 1.0) for n, g in GUESSED.items()}, TWO)


def owners_log(
    seed: int, *, duration: float = 600.0, boat: PlainBoat = OWN_BOAT
) -> dict[str, Array]:
    """Ten minutes of a boat's owner: a consumer's GNSS, 2.5 m CEP that forgets in 30 s, and a
    compass that is 5 deg off, in a current, with throttles that change every 6 to 18 s.
    """
    rng = np.random.default_rng(seed)
    throttles = steps_of(rng, (-0.1, -0.1), (0.9, 0.9), 6.0)
    sea = Sea((0.15, 0.13), wandering_load(rng, duration, (2.0, 2.0, 0.8), 10.0))
    motion = sail(boat, lambda t: [TWO[0].top * each for each in throttles(t)], duration, sea)
    sensors = Sensors(
        gnss=0.1,
        gnss_wander=2.5 / CEP,
        compass=math.radians(1.0),
        compass_off=math.radians(5.0),
        gyro=0.005,
    )
    return log_columns(motion, sensors, rng)
