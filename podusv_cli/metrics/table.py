"""Every metric: one table for computing, printing and documentation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Metric:
    """A number that sums up a run; smaller is better for all of them."""

    name: str
    unit: str
    meaning: str


_ROWS = (
    Metric("iae", "m s", "integral of z_e"),
    Metric("ise", "m2 s", "integral of z_e^2"),
    Metric("itae", "m s2", "integral of t z_e"),
    Metric("rmse", "m", "root of the mean of z_e^2"),
    Metric("z_e_steady", "m", "mean of z_e over the steady window"),
    Metric("settling_time", "s", "when z_e comes within the settling radius to stay"),
    Metric("peak_tau_u", "N", "largest |tau_u| that the law asked for"),
    Metric("peak_tau_r", "N m", "largest |tau_r| that the law asked for"),
    Metric("effort_u", "N2 s", "integral of tau_u^2 on the hull"),
    Metric("effort_r", "N2 m2 s", "integral of tau_r^2 on the hull"),
    Metric("energy", "J", "integral of |tau_u u| + |tau_r r|, tau on the hull"),
    Metric("tv_tau_u", "N", "total variation of the demanded tau_u in the steady window"),
    Metric("tv_tau_r", "N m", "total variation of the demanded tau_r in the steady window"),
    Metric("saturated_fraction", "1", "part of the time in which the actuator limits the law"),
    Metric("at_speed_limit", "1", "part of the time with a propeller asked for its most"),
    Metric("at_angle_limit", "1", "part of the time with a pod asked for its largest angle"),
    Metric("at_rate_limit", "1", "part of the time with a pod changing as fast as it can"),
    Metric("energy_pod", "J", "integral of the propellers' power, where that is known"),
    Metric("angle_travel", "rad", "way that all propulsion angles go, steering wear"),
    Metric(
        "law_ns", "ns", "median processor time of one evaluation of the law over its logged states"
    ),
    Metric("law_ns_low", "ns", "lower quartile of that time over the replays"),
    Metric("law_ns_high", "ns", "upper quartile of that time over the replays"),
)

METRICS: dict[str, Metric] = {row.name: row for row in _ROWS}
CLOCKED = ("law_ns", "law_ns_low", "law_ns_high")  # a clock's readings; they never repeat
