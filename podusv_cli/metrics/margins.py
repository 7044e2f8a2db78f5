"""Margins of loops, which only comparisons with claims about them have.

`theory.loop_margins` computes them.
"""

from __future__ import annotations

from functools import partial

from podusv_cli.metrics.metric import Metric

_margin, _number = partial(Metric, place=9, margin=True), partial(Metric, place=9)
phase_margin_u = _margin(
    "phase_margin_u", "rad", "phase by which the surge loop may lag or lead, at the plant's input"
)
phase_margin_v = _margin(
    "phase_margin_v", "rad", "phase by which the sway loop may lag or lead, at the plant's input"
)
phase_margin_r = _margin(
    "phase_margin_r", "rad", "phase by which the yaw loop may lag or lead, at the plant's input"
)
gain_margin_u = _margin("gain_margin_u", "1", "factor by which the surge loop's gain may grow")
gain_margin_v = _margin("gain_margin_v", "1", "factor by which the sway loop's gain may grow")
gain_margin_r = _margin("gain_margin_r", "1", "factor by which the yaw loop's gain may grow")
gain_reduction_u = _number(
    "gain_reduction_u", "1", "factor to which the surge loop's gain may fall"
)
gain_reduction_v = _number("gain_reduction_v", "1", "factor to which the sway loop's gain may fall")
gain_reduction_r = _number("gain_reduction_r", "1", "factor to which the yaw loop's gain may fall")
delay_margin_u = _margin("delay_margin_u", "s", "delay that the surge force may have")
delay_margin_v = _margin("delay_margin_v", "s", "delay that the sway force may have")
delay_margin_r = _margin("delay_margin_r", "s", "delay that the yaw moment may have")
delay_margin = _margin("delay_margin", "s", "delay that all of the law's demands may have")
delay_margin_loads = _margin(
    "delay_margin_loads", "s", "delay that all loads on the hull may have together"
)
peak_S_u = _number("peak_S_u", "1", "largest sensitivity of the surge loop")
peak_S_v = _number("peak_S_v", "1", "largest sensitivity of the sway loop")
peak_S_r = _number("peak_S_r", "1", "largest sensitivity of the yaw loop")
peak_T_u = _number("peak_T_u", "1", "largest complementary sensitivity of the surge loop")
peak_T_v = _number("peak_T_v", "1", "largest complementary sensitivity of the sway loop")
peak_T_r = _number("peak_T_r", "1", "largest complementary sensitivity of the yaw loop")
decay_rate = _number(
    "decay_rate", "1/s", "rate at which the slowest motion about the steady one dies out"
)
OF_LOOP = {
    metric.name: metric
    for metric in (
        phase_margin_u,
        phase_margin_v,
        phase_margin_r,
        gain_margin_u,
        gain_margin_v,
        gain_margin_r,
        gain_reduction_u,
        gain_reduction_v,
        gain_reduction_r,
        delay_margin_u,
        delay_margin_v,
        delay_margin_r,
        delay_margin,
        delay_margin_loads,
        peak_S_u,
        peak_S_v,
        peak_S_r,
        peak_T_u,
        peak_T_v,
        peak_T_r,
        decay_rate,
    )
}
