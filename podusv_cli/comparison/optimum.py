"""Runs held against an optimum of the same task, where one of the compared runs is one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from podusv_cli.core.about import PROSE
from podusv_cli.core.past_run import PastRun
from podusv_cli.metrics.distance import OF_OPTIMUM
from podusv_cli.pages.page import flat
from podusv_cli.process.extras import Extras, Failure

# What an optimum depends on: law, sensors and sampling have no part in it.
TASK = ("vessel", "start", "path", "disturbance", "actuator")


def with_optimum_ratios(runs: Sequence[PastRun], extras: Extras) -> list[PastRun]:
    """The runs, each with its ratio to the best optimum among them that has the same task.

    A run of another task has no ratio; `extras` notes what differs.
    """
    related_runs = list(runs)
    for metric, ratio in OF_OPTIMUM.items():
        optima = [e for e in runs if e.about.optimum_of == metric]
        for i, run in enumerate(related_runs):
            same = [other for other in optima if not any(_other(run, other))]
            if same:
                # Each optimum is a local one, so the best of them counts.
                least = min(other.metric(metric) for other in same)
                cost = {**run.cost, ratio.name: run.metric(metric) / least}
                related_runs[i] = replace(run, cost=cost)
            elif optima:
                what = ", ".join(_other(run, optima[0]))
                why = f"the optimum {optima[0].label} has another {what}"
                extras.missing.append(Failure(f"{ratio.name} of {run.label}", why))
    return related_runs


def _other(run: PastRun, other: PastRun) -> Iterator[str]:
    """The keys of the task in which the two differ."""
    one, two = run.about, other.about
    yield from (key for key in TASK if _alike(one.values.get(key)) != _alike(two.values.get(key)))
    if one.duration != two.duration:
        yield "simulation.duration"


def _alike(section: Any) -> Any:
    """What has to be equal in a section: of a vessel its numbers, wherever they are from."""
    if not isinstance(section, Mapping):
        return section
    words = (*PROSE, ".preset")
    return {key: value for key, value in flat(section) if not f".{key}".endswith(words)}
