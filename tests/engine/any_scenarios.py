"""Scenarios at numbers that nobody chose, for pairs of ways that promise the same answer.

Steps, periods, delays and durations that do not divide each other, turned starts, other hulls. Few
kinds of parts, since machine code is made for each; all else is drawn.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import podusv
from podusv_cli.scenario.model import Scenario

SOURCE = "podusv:mu_2017/corrected.yaml"
STEPS = (0.01, 0.02, 0.007, 0.0125, 0.03, 1.0 / 60.0)  # s
LEGS = {"kind": "legs", "points": [[0, 0], [6, 1], [5, 7]], "acceptance": 1.5}
PODS = {
    "actuator": {"kind": "pod", "preset": "otter", "failure": {"time": 0.2, "pod": 1}},
    "vessel": {"preset": "otter"},
}
ROWS = [
    [-1, -30],
    [-0.5, -8.3],
    [-0.0625, 0],
    [0.0625, 0],
    [0.2, 3],
    [0.6, 31.7],
    [0.9, 52],
    [1, 52],
]
TABLES = [
    {"x": -0.8, "y": y, "table": ROWS, "n_rate": 4, "n_lag": 0.1, "angle_limit": 0}
    for y in (-0.4, 0.4)
]
POSES = [[0, 0, 0.2], [0.3, -0.2, 1.1], [0.1, 0.4, -0.6]]
COMMANDED = {"command": {"resolution_u": 0.1, "dead_zone_r": 0.02}}
SENSORS = {"measurement": {"kind": "sensors"}, "estimator": {"kind": "ekf"}}
# Parts that are put together in another way, with a metric that is gathered at every instant
KINDS: dict[str, dict[str, Any]] = {
    "a cut demand": {"controller": {"kind": "pid"}},
    "legs behind a command path": {
        "controller": {"kind": "los_pid"},
        "path": LEGS,
        "actuator": COMMANDED,
    },
    "pods of which one fails": {"controller": {"kind": "momentum_vector"}, **PODS},
    "thrusters by a table": {
        "controller": {"kind": "momentum_vector"},
        "vessel": {"preset": "otter"},
        "actuator": {"kind": "pod", "counts": "parts", "pods": TABLES},
    },
    "sensors in a sea": {
        "controller": {"kind": "adrc"},
        **SENSORS,
        "disturbance": [
            {"kind": "current", "speed": 0.2},
            {"kind": "wind", "speed": 5.0},
            {"kind": "waves", "height": 0.1, "period": 1.5, "components": 9},
        ],
    },
    "three loads for a pose": {
        "controller": {"kind": "pose_backstepping", "k_i": 0.05},
        "path": {"kind": "poses", "poses": POSES, "travel": 0.7, "dwell": 0.3},
        "actuator": {
            "kind": "saturated_full",
            "command": {"resolution_v": 0.1, "dead_zone_r": 0.02},
        },
        "vessel": {"preset": "cybership2"},
    },
    "pods for a pose": {
        "controller": {"kind": "pose_pid"},
        "path": {"kind": "poses", "poses": POSES, "travel": 0.7, "dwell": 0.3},
        "actuator": {"kind": "pod", "preset": "milliampere", "sway_weight": 1.0},
        "vessel": {"preset": "milliampere"},
    },
    "a path at the law's own time": {
        "controller": {"kind": "maneuvering", "speed": 0.2, "gamma": 0.3},
        "path": {"kind": "ellipse", "period": 40.0},
        "actuator": {"kind": "saturated_full"},
        "vessel": {"preset": "cybership2"},
    },
    "stations behind an observer": {
        "controller": {"kind": "pose_backstepping", "load": "estimated"},
        "path": {"kind": "stations", "poses": POSES, "keep": 0.1, "travel": 0.5, "radius": 2.0},
        "actuator": {"kind": "saturated_full"},
        "vessel": {"preset": "cybership2"},
        "measurement": {"kind": "sensors"},
        "estimator": {"kind": "passive_observer"},
    },
    "legs that end in a hold": {
        "controller": {"kind": "los_pid"},
        "path": {**LEGS, "kind": "legs_hold", "points": [[0, 0], [1, 0.3]], "radius": 0.4},
    },
    "a trial": {"controller": {"kind": "zigzag"}},
    "a difference of headings": {
        "controller": {"kind": "adaptive_neural", "rate": "difference", "hold_below": 0.1}
    },
}


class Drawn:
    """A drawn scenario. `random` goes on to draw what is done with it."""

    def __init__(self, seed: int) -> None:
        """The kinds take turns; the same seed gives the same scenario."""
        self.random = np.random.default_rng([2026, seed])
        self.kind = [*KINDS][seed % len(KINDS)]
        self.step = float(self.random.choice(STEPS))
        self.held = self.whole(0, 7)  # steps of a control period; 0: the law acts continuously
        self.steps = self.whole(30, 80)

    def whole(self, low: int, high: int) -> int:
        """A whole number, both ends included."""
        return int(self.random.integers(low, high, endpoint=True))

    def seconds(self, steps: int) -> float:
        """So many steps, as somebody writes them."""
        return float(f"{steps * self.step:.12g}")

    def between(self, low: float, high: float) -> float:
        """A number with all its digits."""
        return float(self.random.uniform(low, high))

    def scenario(self, **more: Any) -> Scenario:
        """The scenario, with what a test needs beside it."""
        changes = {
            "controllers": None,
            "claims": None,
            **KINDS[self.kind],
            **self._numbers(),
            **self._seen(),
            **self._of_law(),
        }
        return podusv.load(SOURCE, {**changes, **more})

    def _numbers(self) -> dict[str, Any]:
        """What every scenario has."""
        numbers = {
            "simulation.step": self.step,
            "simulation.duration": self.seconds(self.steps),
            "control.period": self.seconds(self.held),
            "control.update": str(self.random.choice(["after", "before"])),
            "log.every": min(self.whole(1, 9), self.steps) if self.whole(0, 9) else self.steps,
            "start.x": self.between(-3, 3),
            "start.y": self.between(-3, 3),
            "start.psi": self.between(-math.pi, math.pi),
            "start.u": self.between(-0.3, 1.0),
            "start.v": self.between(-0.1, 0.1),
            "start.r": self.between(-0.2, 0.2),
        }
        timed = ("poses", "ellipse", "stations")
        if KINDS[self.kind].get("path", LEGS)["kind"] not in timed:
            numbers["path.speed"] = self.between(0.2, 0.8)
        if "actuator" in KINDS[self.kind]:
            numbers["actuator.command.delay"] = self.seconds(self.whole(0, 9))
        return numbers

    def _seen(self) -> dict[str, Any]:
        """Sensors that look and deliver now and then."""
        if "measurement" not in KINDS[self.kind]:
            return {}
        times = {
            f"measurement.{name}.period": self.seconds(self.whole(1, 11))
            for name in ("position", "heading", "velocity", "yaw_rate")
        }
        late = {"measurement.position.delay": self.seconds(self.whole(0, 14))}
        return {**times, **late, "measurement.seed": self.whole(1, 1000)}

    def _of_law(self) -> dict[str, Any]:
        """When a trial begins, and when the law takes samples of its own."""
        begun, sampled = self.whole(0, self.steps // 2), max(self.held, 1) * self.whole(1, 3)
        times = {
            "zigzag": {"execute": begun, "check_every": sampled * self.whole(0, 1)},
            "adaptive_neural": {"difference_step": sampled},
        }
        own = times.get(KINDS[self.kind]["controller"]["kind"], {})
        return {f"controller.{key}": self.seconds(steps) for key, steps in own.items()}

    def vary(self) -> dict[str, Any]:
        """Quantities of a study of this scenario."""
        found: dict[str, Any] = {
            "vessel.m": {"times": {"uniform": [0.8, 1.2]}},
            "start.psi": {"angle": "all"},
            "start.x": {"plus": {"uniform": [-1.0, 1.0]}},
        }
        if "actuator" in KINDS[self.kind]:
            delays = [self.seconds(count) for count in (0, 1, 4)]
            found["actuator.command.delay"] = {"choice": delays}
        if "measurement" in KINDS[self.kind]:
            found["measurement.seed"] = {"seed": True}
            periods = [self.seconds(count) for count in (1, 3, 10)]
            found["measurement.heading.period"] = {"choice": periods}
        return found
