"""Files of laws and other components that podusv does not bring along."""

from pathlib import Path

LAW = '''"""A law of somebody's own."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.component import value
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal

E_CT = Signal("e_ct", "m", "cross-track error")
DRIFT = Signal("drift", "m s", "integral of the cross-track error")
PUSH = 1.0


@kernel
def push(k: Any) -> float:
    """The force in surge."""
    return PUSH * k.gain


class CrossTrack(Controller):
    """Holds the target's course."""

    kind: Literal["cross_track"] = "cross_track"
    gain: float = value(1.0, "N/m", "gain of the cross-track error", gt=0)
    signals: ClassVar[tuple[Signal, ...]] = (E_CT,)

    def slots(self):
        return ((DRIFT, 1),)

    def start(self, x, target, nominal):
        return np.zeros(1)

    @staticmethod
    @kernel
    def law(t, x, memory, target, k, table, tau, rate, signals, work):
        signals[0] = target[1] - x[1]
        tau[0], tau[1] = push(k), 0.1 * k.gain * signals[0]
        rate[0] = signals[0]
'''
SCENARIO = """
plugins: [laws/my_law.py]
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: saturated}
start: {x: -5.0, y: -2.0, u: 0.3}
simulation: {duration: 1.0}
controller: {kind: cross_track, gain: 0.5}
"""
TWO = SCENARIO + "controllers: {soft: {gain: 0.25}, stiff: {gain: 0.5}, pid: {kind: pid}}\n"


def put(scenario: str = SCENARIO, law: str = LAW) -> str:
    """A scenario and the file with its law, in the current folder; the scenario's name."""
    Path("laws").mkdir(exist_ok=True)
    Path("laws/my_law.py").write_text(law)
    Path("a.yaml").write_text(scenario)
    return "a.yaml"
