"""Findings about laws that steer the velocity: sway answers yaw too much, or not as told."""

from __future__ import annotations

import math
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


def _inverting(law: Any, case: Case, V: float, v: float) -> float:
    """Growth [1/s] of a law that inverts the answer."""
    loop = velocity_vector_loop(law, case.scenario.vessel, V, v, sway_share(case.scenario))
    return float(np.linalg.eigvals(loop).real.max())


def _weighing(law: Any, case: Case, V: float, v: float) -> float:
    """Growth [1/s] of a law that weighs the answer."""
    at = momentum_vector_gains(law, case.scenario.vessel, V, v)
    return growth(momentum_vector_polynomial(*at))


LOOPS = {
    VelocityVector: (_inverting, "take momentum_vector, which pays for it under loads"),
    MomentumVector: (_weighing, "take gains: schedule, a larger trust, or smaller Q0 and k_b0"),
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
    loop, remedy = LOOPS[type(scenario.controller)]
    grows = loop(scenario.controller, case, V, v)
    if grows > 0.0:
        p_eff = sway_answer(scenario.vessel, V, v).p
        yield (
            f"sway answers yaw with p_eff = (m11 V - Y_r)/(m22 V) = {p_eff:.3g} at V = {V:.3g} m/s:"
            f" on a straight line the law, told exactly, grows at {grows:.2g} 1/s and swings for "
            f"ever; {remedy}, or more speed"
        )


@before(
    "optimal-elsewhere", about="controller.gains", meaning="gains optimal for another hull",
    condition="gains: lqr, and the simulated vessel differs from the nominal one",
    remedy="take gains: schedule, with trust: 1.8 for a hull that is known less well, or tell the "
    "law the vessel",
    law=MomentumVector,
)  # fmt: skip
def optimal_elsewhere(case: Case) -> Sentences:
    """Of drawn hulls +-30 % many are unstable with these gains (docs/theory.md)."""
    scenario = case.scenario
    law, true, told = scenario.controller, scenario.vessel, scenario.nominal
    optimal = isinstance(law, MomentumVector) and law.gains == "lqr"
    if not optimal or true.constants() == told.constants():
        return
    speed = math.hypot(*case.reference.working[:2].tolist())
    answers = ""
    if speed > STANDING:
        p, at = sway_answer(told, speed).p, sway_answer(true, speed).p
        answers = f" (sway answers yaw with p_eff = {at:.3g}, told {p:.3g}, at {speed:.3g} m/s)"
    yield (
        f"gains: lqr are optimal for the nominal vessel, and the simulated one differs{answers}; "
        "there they may grow; take gains: schedule, with trust: 1.8 for a hull that is known less "
        "well, or tell the law the vessel"
    )
