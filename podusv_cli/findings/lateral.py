"""Findings about laws that steer the velocity: sway answers yaw too much, or not as assumed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.velocity_steering import VelocitySteering
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.core.finding import Sentences, warn_before_run
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.reference import STANDING, sway_share
from podusv_cli.theory.lateral import (
    growth,
    momentum_vector_gains,
    momentum_vector_polynomial,
    sway_answer,
    velocity_vector_loop,
)

Growth = Callable[[Any, Case, float, float], float]


def _inverting(law: Any, case: Case, V: float, v: float) -> float:
    """Growth [1/s] of a law that inverts the answer, at speed V and sway v [m/s]; < 0 is stable."""
    loop = velocity_vector_loop(law, case.scenario.vessel, V, v, sway_share(case.scenario))
    return float(np.linalg.eigvals(loop).real.max())


def _weighing(law: Any, case: Case, V: float, v: float) -> float:
    """Growth [1/s] of a law that weighs the answer, at speed V and sway v [m/s]; < 0 is stable."""
    at = momentum_vector_gains(law, case.scenario.vessel, V, v)
    return growth(momentum_vector_polynomial(*at))


LOOPS: dict[type[Any], tuple[Growth, str]] = {
    VelocityVector: (_inverting, "take momentum_vector, which pays for it under loads"),
    MomentumVector: (_weighing, "take a larger trust, or smaller Q0 and k_b0"),
}


@warn_before_run(
    "sway-answers-yaw",
    about="controller",
    meaning="sway answers yaw more than the law bears",
    condition="on a straight line at the target's speed, told exactly, the law's linear loop has a "
    "root in the right half plane",
    remedy="take momentum_vector, there a larger trust, or more speed",
    law=VelocitySteering,
)
def sway_answers_yaw(case: Case) -> Sentences:
    """The linear loop of docs/theory.md grows at the run's typical speed and sway."""
    scenario, (u, v, _) = case.scenario, case.reference.working.tolist()
    V = math.hypot(u, v)
    if V <= STANDING:
        return
    law = scenario.controller
    loop, remedy = LOOPS[type(law)]
    grows = loop(law, case, V, v)
    if grows > 0.0:
        p_eff = sway_answer(scenario.vessel, V, v).p
        yield (
            f"sway answers yaw with p_eff = (m11 V - Y_r)/(m22 V) = {p_eff:.3g} at V = {V:.3g} m/s:"
            f" on a straight line the law, told exactly, grows at {grows:.2g} 1/s and swings for "
            f"ever; {remedy}, or more speed"
        )
