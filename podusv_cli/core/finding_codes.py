"""Every finding that podusv can report about a scenario or a run: one table of codes.

`silence`, the findings themselves and docs/findings.md read it. `key` is the part of the scenario
that the finding is about.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Code:
    """A short, stable name for a kind of finding; `when` it can be told."""

    name: str
    key: str
    when: Literal["before", "after"]
    meaning: str


_ROWS = (
    Code("damping-sign", "vessel", "before", "nonlinear damping drives the motion"),
    Code("large-angle", "start.psi", "before", "an angle is beyond a whole turn"),
    Code("path-jump", "path", "before", "the target's position jumps"),
    Code("path-corner", "path", "before", "the target's velocity jumps"),
    Code("path-bend", "path", "before", "the target's acceleration jumps"),
    Code("sway-drift", "path", "before", "the sway load drifts the hull faster than the target"),
    Code("sway-unstable", "controller.k_ze", "before", "pointing at the target makes sway grow"),
    Code("thrust-short", "actuator", "before", "keeping up takes more than the actuator gives"),
    Code("coupling-saddle", "controller.coupling", "before", "the printed sign makes a saddle"),
    Code("start-astern", "start", "before", "the start lies outside the folding range"),
    Code("start-kick", "controller.first_difference", "before", "the first difference is a kick"),
    Code("network-range", "controller.network", "before", "no node near the speeds needed"),
    Code("stiff-adaptation", "simulation.step", "before", "adaptation too fast for RK4's step"),
    Code("stiff-start", "simulation.step", "before", "start error makes the bound too stiff"),
    Code("stiff-actuator", "simulation.step", "before", "a pod's lag too short for RK4's step"),
    Code("stiff-derivative", "simulation.step", "before", "PID's loop too fast for RK4's step"),
    Code("sampled-adaptation", "control.period", "before", "adaptation too fast for the period"),
    Code("sampled-derivative", "control.period", "before", "PID's loop too fast for the period"),
    Code("near-target", "controller.standoff", "after", "z_e came close to its singularity"),
    Code("crosswise", "controller", "after", "cos psi_e came close to zero"),
    Code("off-network", "controller.network", "after", "no node within two widths"),
    Code("bound-growing", "controller", "after", "an estimated bound still grew at the end"),
    Code("saturated", "actuator", "after", "the actuator limited the law for long"),
)

CODES: dict[str, Code] = {row.name: row for row in _ROWS}
