"""Time as whole numbers of steps."""

from __future__ import annotations

import math


def whole_steps(duration: float, step: float) -> int | None:
    """How many steps make `duration` (both in s), or None where it is no whole number of them.

    Up to rounding: 1e-9 of the duration.
    """
    steps = duration / step
    if not math.isfinite(steps):
        return None
    count = round(steps)
    return count if abs(count * step - duration) <= 1e-9 * max(duration, step) else None


def misfit(time: float, step: float) -> str:
    """What is wrong with a time above 0 that is no whole number of steps; else empty."""
    if whole_steps(time, step):
        return ""
    return f"{time:g} s is no whole number of steps of {step:g} s{nearest_hint(time, step)}"


def nearest_hint(time: float, step: float) -> str:
    """A hint with the nearest time [s] that fits the step [s]; the smaller one of two as near."""
    count = time / step
    return f"; try {max(1, math.ceil(count - 0.5)) * step:.10g}" if count < 1e12 else ""
