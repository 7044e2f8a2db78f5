"""Findings about velocity loops that are too fast for the step or for the control period."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from podusv_cli.components.actuators.base import SATURATION
from podusv_cli.components.controllers.velocity_loop import Cause, Loop
from podusv_cli.core.errors import LawError, NotConvergedError
from podusv_cli.core.finding import FindingKind, Sentences, warn_before_run
from podusv_cli.findings.stability import (
    bursts,
    delay_margin,
    delayed_growth,
    fast_gain,
    loops,
    rk4_growth,
    sampled_growth,
)
from podusv_cli.scenario.case import Case
from podusv_cli.theory.loop_margins import loop_margins

UNSTABLE = 1.0 + 1e-6  # growth a step; a loop without damping has 1 but for rounding
# by the cause that a law gives: what is too fast, which loop that is, and what should be smaller
LOOPS: dict[Cause, tuple[str, str, str]] = {
    "adaptation": ("adaptation", "the linearised loop of error and adaptation", "adaptation gains"),
    "derivative": ("PID's loop", "the loop of error, integral and lag", "gains"),
    "loop": ("a velocity loop", "a velocity loop of the law", "gains"),
}


def _too_fast(case: Case, cause: Cause) -> Sentences:
    """A sentence for each axis on which RK4 is unstable because of a loop with this cause.

    Looked at are the velocity at the start and the usual one.
    """
    grid = case.plan.grid
    reported: set[str] = set()
    # Of a sampled law, RK4 sees a constant demand; `_sampled_too_fast` looks at it.
    for nu in () if grid.hold_every else (case.first_velocity, case.reference.working):
        for loop in loops(case.scenario, nu, cause):
            if loop.axis not in reported and rk4_growth(loop, grid.step) > UNSTABLE:
                reported.add(loop.axis)
                yield (
                    f"the {loop.axis} {loop.name} turns at {loop.fastest:.3g} 1/s, too fast for "
                    f"RK4 with {grid.step:g} s; take a step below {_largest_step(loop):.2g} s, "
                    f"or a smaller {fast_gain(case.scenario, nu, loop)}"
                )


def _largest_step(loop: Loop) -> float:
    """The largest step [s] up to which RK4 is stable, by bisection."""
    # RK4 is stable up to 2.8 over the fastest rate, so 4 is beyond.
    low, high = 0.0, 4.0 / loop.fastest
    # 40 halvings leave a part in 1e12.
    for _ in range(40):
        middle = 0.5 * (low + high)
        stable = rk4_growth(loop, middle) <= UNSTABLE
        low, high = (middle, high) if stable else (low, middle)
    return low


def _sampled_too_fast(case: Case, cause: Cause) -> Sentences:
    """A velocity loop with this cause is unstable when the law is evaluated once per period."""
    grid, period = case.plan.grid, case.scenario.control.period
    if not grid.hold_every:
        return
    nu = case.reference.working
    for loop in loops(case.scenario, nu, cause):
        growth = sampled_growth(loop, grid.step, grid.hold_every, update_first=grid.update_first)
        if growth > UNSTABLE:
            yield (
                f"the {loop.axis} {loop.name}, held for {period:g} s, grows {growth:.3g} times a "
                f"period; take a shorter period, or a smaller {fast_gain(case.scenario, nu, loop)}"
            )


def _stiff(cause: Cause) -> FindingKind:
    """The finding on loops that RK4's step makes grow, for one cause."""
    what, loop, gains = LOOPS[cause]
    return warn_before_run(
        f"stiff-{cause}",
        about="simulation.step",
        meaning=f"{what} too fast for RK4's step",
        condition=f"RK4 makes {loop} grow",
        remedy=f"take a shorter step, or smaller {gains}",
    )(partial(_too_fast, cause=cause))


def _sampling_finding(cause: Cause) -> FindingKind:
    """The finding on loops that the sampling period makes grow, for one cause."""
    what, loop, gains = LOOPS[cause]
    return warn_before_run(
        f"sampled-{cause}",
        about="control.period",
        meaning=f"{what} too fast for the period",
        condition=f"{loop} grows over one period",
        remedy=f"take a shorter period, or smaller {gains}",
    )(partial(_sampled_too_fast, cause=cause))


stiff_adaptation, stiff_derivative, stiff_loop = map(_stiff, LOOPS)
sampled_adaptation, sampled_derivative, sampled_loop = map(_sampling_finding, LOOPS)


def _margin(case: Case) -> float:
    """The delay margin of all demands [s].

    NaN where there is no steady motion, or it is unstable.
    """
    try:
        compiled = case.scenario.simulation.compiled
        margins = loop_margins(case.plan.loop, case.plan.grid, compiled=compiled)
    except (LawError, NotConvergedError):
        return math.nan
    return margins.delay_margin


@warn_before_run(
    "delayed-loop",
    about="actuator.command",
    meaning="a velocity loop too fast for the delay",
    condition="the delay exceeds the delay margin of all demands (podusv margins); without a "
    "steady motion, a velocity loop that is stable without the delay grows with it",
    remedy="take a shorter delay, or smaller gains",
)
def delayed_loop(case: Case) -> Sentences:
    """The delay of the actuator's command makes the law's loop unstable.

    Where the path has no steady motion, the velocity loops alone are looked at.
    """
    delay = case.scenario.actuator.delay()
    # NaN where there is no steady motion: then no comparison with it is true.
    whole = _margin(case) if delay else math.nan
    if delay > whole:
        yield (
            f"on the steady part of the path the loop grows with a delay of {delay:g} s; take a "
            f"delay below {whole:.3g} s, or smaller gains"
        )
    reported: set[str] = set()
    for nu in (case.first_velocity, case.reference.working) if delay and math.isnan(whole) else ():
        for loop in loops(case.scenario, nu):
            stable = np.isfinite(loop.matrix).all() and loop.growth < 0.0
            if stable and loop.axis not in reported and delayed_growth(loop, delay) > 0.0:
                reported.add(loop.axis)
                yield (
                    f"the {loop.axis} {loop.name} grows with a delay of {delay:g} s; take a delay "
                    f"below {delay_margin(loop, delay):.2g} s, or a smaller "
                    f"{fast_gain(case.scenario, nu, loop)}"
                )


@warn_before_run(
    "stiff-start",
    about="simulation.step",
    meaning="start error makes the bound too stiff",
    condition="RK4 makes the error, marched from t = 0 with its bound, grow",
    remedy="take a shorter step, a smaller bound gain, or a start nearer to the target's velocity",
)
def stiff_start(case: Case) -> Sentences:
    """The start error drives the estimated bound so high that RK4 becomes unstable.

    Without leakage b_hat rises to sqrt(gamma m) |e(0)| while e decays, and then
    e' = -e b_hat/(4 partial m). A saturating actuator opens that loop, so there is no finding.
    """
    scenario, step = case.scenario, case.scenario.simulation.step
    if SATURATION in scenario.actuator.signals or scenario.control.period:
        return
    for loop in loops(scenario, case.first_velocity):
        # Only loops whose bound adapts have such an error.
        error = case.first_signals[loop.bound.error] if loop.bound else math.nan
        stiff_anyway = rk4_growth(loop, step) > UNSTABLE  # a finding of its own
        if not loop.bound or not math.isfinite(error) or stiff_anyway:
            continue
        if bursts(loop, loop.bound, error, step):
            yield (
                f"{loop.bound.error} = {error:.3g} at the start drives the estimated bound so high "
                f"that the {loop.axis} loop outruns RK4 with {step:g} s and the error grows "
                f"instead; take a shorter step, a smaller {loop.bound.key}, or a start nearer to "
                "what the law wants"
            )
