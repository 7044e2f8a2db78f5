"""Findings about laws that steer the velocity: sway answers yaw too much, or not as told."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from podusv_cli.components.controllers.momentum_vector import MomentumVector
from podusv_cli.components.controllers.velocity_steering import VelocitySteering
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.core.finding import Sentences, before
from podusv_cli.findings.finding import Case
from podusv_cli.findings.reference import STANDING, sway_share
from podusv_cli.theory.lateral import (
    growth,
    momentum_vector_gains,
    momentum_vector_polynomial,
    sway_answer,
    velocity_vector_loop,
)

Growth = Callable[[Any, Case, float, float], float]


def _inverting(law: Any, case: Case, V: float, v: float) -> float:
    """Growth [1/s] of a law that inverts the answer."""
    loop = velocity_vector_loop(law, case.scenario.vessel, V, v, sway_share(case.scenario))
    return float(np.linalg.eigvals(loop).real.max())


def _weighing(law: Any, case: Case, V: float, v: float) -> float:
    """Growth [1/s] of a law that weighs the answer."""
    at = momentum_vector_gains(law, case.scenario.vessel, V, v)
    return growth(momentum_vector_polynomial(*at))


ALIKE = 0.01  # of a number; optimal gains bear a smaller difference
REMEDIES = {
    "schedule": "take a larger trust, or smaller Q0 and k_b0",
    "lqr": "take gains: schedule, or smaller Q0 and k_b0",
}  # by the key `gains`
LOOPS: dict[type[Any], tuple[Growth, Callable[[Any], str]]] = {
    VelocityVector: (_inverting, lambda law: "take momentum_vector, which pays for it under loads"),
    MomentumVector: (_weighing, lambda law: REMEDIES[law.gains]),
}


@before(
    "sway-answers-yaw", about="controller", meaning="sway answers yaw more than the law bears",
    condition="on a straight line at the target's speed, told exactly, the law's linear loop has a "
    "root in the right half plane",
    remedy="take momentum_vector, there a larger trust, or more speed", law=VelocitySteering,
)  # fmt: skip
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
            f"ever; {remedy(law)}, or more speed"
        )


@before(
    "optimal-elsewhere", about="controller.gains", meaning="gains optimal for another hull",
    condition="gains: lqr, and the simulated vessel's p_eff, sway damping or yaw inertia differ "
    "from the nominal one's by more than 1 %",
    remedy="take gains: schedule, with trust: 1.8 for a hull that is known less well, or tell the "
    "law the vessel",
    law=MomentumVector,
)  # fmt: skip
def optimal_elsewhere(case: Case) -> Sentences:
    """Of drawn hulls +-30 % many are unstable with these gains (docs/theory.md)."""
    scenario = case.scenario
    law, true, told = scenario.controller, scenario.vessel, scenario.nominal
    if not (isinstance(law, MomentumVector) and law.gains == "lqr"):
        return
    u, v, _ = case.reference.working.tolist()
    speed = max(math.hypot(u, v), law.V_m)
    (p, d), (at, damping) = (sway_answer(hull, speed, v) for hull in (told, true))
    if not np.allclose([at, damping, true.m33], [p, d, told.m33], rtol=ALIKE):
        yield (
            "gains: lqr are optimal for the nominal vessel, and the simulated one has p_eff = "
            f"{at:.3g}, d = {damping:.3g} 1/s and m33 = {true.m33:.3g} kg m2 in place of {p:.3g}, "
            f"{d:.3g} 1/s and {told.m33:.3g} kg m2 at {speed:.3g} m/s; the loop may be unstable "
            "there; take gains: schedule, with trust: 1.8 for a hull that is known less well, or "
            "tell the law the vessel"
        )
