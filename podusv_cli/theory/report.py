"""The contents of theory.json."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from podusv_cli.core.recording import largest
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.theory.bounds import Bound, GainCondition
from podusv_cli.theory.monitor import Monitored, Window


def as_json(loop: ClosedLoop, grid: TimeGrid, monitored: Monitored) -> dict[str, Any]:
    """What theory.json has: gain conditions, assumptions, visited set, and bounds by window.

    `monitored` is a run of the loop over the grid.
    """
    first = next(iter(monitored.windows.values()))
    return {
        "format": 1,
        "conditions": [_condition(condition) for condition in first.bound.conditions],
        "assumptions": list(_assumptions(loop, grid, monitored)),
        "visited": _visited_ranges(monitored),
        "windows": {name: _window(window) for name, window in monitored.windows.items()},
    }


def _condition(condition: GainCondition) -> dict[str, Any]:
    """A condition on a gain as theory.json has it."""
    forms = {"holds": condition.holds, "holds_printed": condition.holds_printed}
    return asdict(condition) | forms


def _assumptions(
    loop: ClosedLoop, grid: TimeGrid, monitored: Monitored
) -> Iterator[dict[str, Any]]:
    """Assumptions behind V' <= -2 lambda V + Delta: whether each held in the monitored run.

    Each as theory.json has it, with the number that decides it, if any.
    """
    law, log, turn = loop.lyapunov(), monitored.recording, monitored.traces["turn"]
    # Largest difference of load and demand; -1 and 1 of `turn` change where psi_e is folded
    withheld = max(_withheld(monitored, "u"), _withheld(monitored, "r"))
    turned = int(np.count_nonzero(turn[1:] != turn[:-1]))
    alone = law.fold == "printed" and bool(np.any(turn < 0.0))
    distance = float(np.min(log["z_e"]))
    yield _assumption(
        "coupling has the sign that cancels the cross terms", law.coupling == "corrected"
    )
    yield _assumption("control is continuous", grid.hold_every == 0)
    yield _assumption("rate of psi_d is exact, nothing jumps at samples", law.rate == "analytic")
    yield _assumption("psi_e is never folded or unfolded on the way", turned == 0, turned)
    yield _assumption("psi_e is not folded alone, which turns the sign of z_e'", not alone)
    yield _assumption("distance [m] stays above hold_below", distance > law.hold_below, distance)
    yield _assumption("weights and bounds learn from u_e and r_e", not law.wants_loads())
    yield _assumption("actuator gives what the law asks for [N, N m]", withheld == 0.0, withheld)


def _withheld(monitored: Monitored, axis: str) -> float:
    """Largest difference between load on the hull and demand, on the axis `u` [N] or `r` [N m]."""
    log = monitored.recording
    load, demand = log[f"tau_{axis}"], log[f"tau_{axis}_cmd"]
    return largest(len(load), lambda rows: load[rows] - demand[rows])


def _assumption(assumption: str, holds: bool, found: float | None = None) -> dict[str, Any]:
    """An assumption as theory.json has it; `found` is the number that decides it."""
    number = {} if found is None else {"found": found}
    return {"assumption": assumption, "holds": holds} | number


def _visited_ranges(monitored: Monitored) -> dict[str, list[float]]:
    """The set of states for which the observed values hold: their ranges over the run."""
    names = ("u", "v", "r", "z_e", "psi_e", "V")
    log = monitored.recording
    return {name: [float(np.min(log[name])), float(np.max(log[name]))] for name in names}


def _window(window: Window) -> dict[str, Any]:
    """A window of time as theory.json has it."""
    return {
        "since": window.since,
        "largest_V": window.largest_V,
        "V_dot_below_bound": window.kept,
        "corrected": _bound(window.bound.corrected),
        "printed": _bound(window.bound.printed),
        "observed": asdict(window.observed) if window.observed else None,
        "sway": asdict(window.sway) | {"largest_v": window.largest_v},
    }


def _bound(bound: Bound) -> dict[str, Any]:
    """A bound, with the candidates and terms that it is made of, as theory.json has it."""
    return {
        "lambda": bound.lambda_,
        "Delta": bound.Delta,
        "bound": bound.value,
        "lambda_candidates": bound.candidates,
        "Delta_terms": bound.terms,
    }
