"""What can go wrong with a law that steers by distance and direction: folding, singularities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from podusv_cli.controllers.tracking import TrackingController
from podusv_cli.core.finding import Sentences, after, before, rows_where, times_of
from podusv_cli.core.recording import Recording

KICK = 1.0  # rad/s; beyond what a hull turns at
NEAR = 0.05  # hull lengths
CROSSWISE = 0.05  # |cos psi_e|; the virtual surge velocity is magnified twentyfold


@before(
    "start-astern",
    about="start",
    meaning="the start lies outside the folding range",
    condition="the target is more than a right angle off the bow, and fold is not joint",
    remedy="turn start.psi, or take fold: joint",
    law=TrackingController,
)
def start_astern(case: Any) -> Sentences:
    """The target lies abaft the beam at t = 0 and the law does not fold line of sight and error."""
    law, start = case.scenario.controller, case.scenario.start
    if law.fold == "joint":
        return
    psi_e = math.remainder(case.first_signals.get("psi_d", math.nan) - start.psi, 2.0 * math.pi)
    if abs(psi_e) >= 0.5 * math.pi:
        yield (
            f"the target lies {math.degrees(psi_e):.0f} degrees off the bow at the start, beyond "
            f"the right angle within which fold: {law.fold} steers towards it; turn start.psi, or "
            "take fold: joint"
        )


@before(
    "start-kick",
    about="controller.first_difference",
    meaning="the first difference is a kick",
    condition=f"|psi_d(0)|/difference_step above {KICK:g} rad/s",
    remedy="take first_difference: from_start",
    law=TrackingController,
)
def start_kick(case: Any) -> Sentences:
    """Remark 5's difference, started from psi_d = 0, is a kick of psi_d(0)/Delta t for a sample."""
    law = case.scenario.controller
    if law.rate != "difference" or law.first_difference != "from_zero":
        return
    psi_d = case.first_signals.get("psi_d", math.nan)
    kick = math.remainder(psi_d, 2.0 * math.pi) / law.difference_step
    if abs(kick) > KICK:
        yield (
            f"the first difference of psi_d starts from zero and turns the virtual yaw rate by "
            f"{kick:.3g} rad/s for {law.difference_step:g} s; take first_difference: from_start"
        )


@after(
    "near-target",
    about="controller.standoff",
    meaning="z_e came close to its singularity",
    condition=f"z_e below {NEAR:g} hull lengths, and hold_below is smaller than that",
    remedy="take a standoff, or hold_below",
    law=TrackingController,
)
def near_target(scenario: Any, log: Recording) -> Sentences:
    """z_e comes near 0, where psi_d is not defined and w = psi_d' grows as 1/z_e."""
    law, near = scenario.controller, NEAR * scenario.vessel.length
    close = rows_where(log, lambda part: part["z_e"] < near)
    if close.any() and law.hold_below < near:
        at = int(log["z_e"].argmin())
        kept = f"the standoff of {law.standoff:g} m did not keep it away; take hold_below"
        remedy = kept if law.standoff else "take a standoff, or hold_below"
        yield (
            f"z_e falls below {near:.2g} m {times_of(log, close)}, to {log['z_e'][at]:.2g} m at "
            f"{log['time'][at]:.6g} s; the direction of the target is singular at 0, so "
            f"numbers from there on depend on the step; {remedy}"
        )


@after(
    "crosswise",
    about="controller",
    meaning="cos psi_e came close to zero",
    condition=f"|cos psi_e| below {CROSSWISE:g}",
    remedy="start with a heading nearer to the line of sight",
    law=TrackingController,
)
def crosswise(scenario: Any, log: Recording) -> Sentences:
    """cos psi_e comes near 0, by which (21) divides."""
    if "psi_e" not in log:
        return
    across = rows_where(log, lambda part: np.abs(np.cos(part["psi_e"])) < CROSSWISE)
    if across.any():
        yield (
            f"|cos psi_e| falls below {CROSSWISE:g} {times_of(log, across)}; the virtual surge "
            "velocity (21) divides by it"
        )
