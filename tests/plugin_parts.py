"""A plug-in with a metric, a figure, a derived signal and a finding."""

from __future__ import annotations

MORE = """
from podusv_cli.core.derived import difference
from podusv_cli.core.finding import warn_after_run
from podusv_cli.figures.panels import signals_over_time
from podusv_cli.figures.sheet import figure
from podusv_cli.metrics.metric import Accumulator, Metric, gathered


@kernel
def watch(t, weight, s, row, k, seen):
    seen[0] = max(seen[0], abs(s[1]))


largest_east = Metric(
    "largest_east", "m", "largest |y|", Accumulator(watch, lambda _: 1, lambda _: {}), gathered(0)
)
GAP = Signal("gap", "m", "cross-track error less the distance to the target")
gap = difference(GAP, "e_ct", "z_e")
gaps = figure("gaps", caption="The gap over time", signals=("gap",))(signals_over_time("gap"))


@warn_after_run("wide-gap", about="controller", meaning="the gap is wide")
def wide_gap(scenario, log):
    yield "the gap is wide"
"""
