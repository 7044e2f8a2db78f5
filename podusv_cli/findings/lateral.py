"""Finding about a law that inverts how sway answers yaw, for a hull with which it cannot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.core.finding import Sentences, before
from podusv_cli.findings.finding import Case
from podusv_cli.findings.reference import STANDING, sway_share
from podusv_cli.theory.lateral import sway_answer, velocity_vector_loop


@before(
    "sway-answers-yaw", about="controller", meaning="sway answers yaw more than the law can invert",
    condition="on a straight line at the target's speed, told exactly, the law's polynomial has "
    "a root in the right half plane",
    remedy="take momentum_vector, or more speed", law=VelocityVector,
)  # fmt: skip
def sway_answers_yaw(case: Case) -> Sentences:
    """The linear loop of docs/theory.md grows at the run's typical speed and sway."""
    scenario, (u, v, _) = case.scenario, case.reference.working.tolist()
    law: Any = scenario.controller
    V = math.hypot(u, v)
    if V <= STANDING:
        return
    loop = velocity_vector_loop(law, scenario.vessel, V, v, sway_share(scenario))
    growth = float(np.linalg.eigvals(loop).real.max())
    if growth > 0.0:
        p_eff = sway_answer(scenario.vessel, V, v).p
        yield (
            f"sway answers yaw with p_eff = (m11 V - Y_r)/(m22 V) = {p_eff:.3g} at V = {V:.3g} m/s:"
            f" on a straight line the law, told exactly, grows at {growth:.2g} 1/s and swings for "
            "ever; take momentum_vector, or more speed"
        )
