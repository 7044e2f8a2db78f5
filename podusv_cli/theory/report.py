"""What the monitor found, as theory.json has it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from podusv_cli.core.recording import largest
from podusv_cli.engine.grid import TimeGrid
from podusv_cli.engine.simulate import ClosedLoop
from podusv_cli.theory.bounds import Bound, Condition
from podusv_cli.theory.monitor import Monitored, Window


def as_json(loop: ClosedLoop, grid: TimeGrid, found: Monitored) -> dict[str, Any]:
    """Gain conditions, what the proof assumes, the visited set, and the bounds by window."""
    first = next(iter(found.windows.values()))
    return {
        "format": 1,
        "conditions": [_condition(condition) for condition in first.bound.conditions],
        "assumptions": list(_assumptions(loop, grid, found)),
        "visited": _visited(found),
        "windows": {name: _window(window) for name, window in found.windows.items()},
    }


def _condition(condition: Condition) -> dict[str, Any]:
    forms = {"holds": condition.holds, "holds_printed": condition.holds_printed}
    return asdict(condition) | forms


def _assumptions(loop: ClosedLoop, grid: TimeGrid, found: Monitored) -> Iterator[dict[str, Any]]:
    """What V' <= -2 lambda V + Delta rests on, whether it was so, and the number that tells."""
    law, log, turn = loop.controller.lyapunov(), found.recording, found.traces["turn"]
    asked = max(_gap(found, "u"), _gap(found, "r"))
    turned = int(np.count_nonzero(turn[1:] != turn[:-1]))
    alone = law.fold == "printed" and bool(np.any(turn < 0.0))
    distance = float(np.min(log["z_e"]))
    yield _says("coupling has the sign that cancels the cross terms", law.coupling == "corrected")
    yield _says("control is continuous", grid.hold_every == 0)
    yield _says("rate of psi_d is exact, nothing jumps at samples", law.rate == "analytic")
    yield _says("psi_e is never folded or unfolded on the way", turned == 0, turned)
    yield _says("psi_e is not folded alone, which turns the sign of z_e'", not alone)
    yield _says("distance [m] stays above hold_below", distance > law.hold_below, distance)
    yield _says("weights and bounds learn from u_e and r_e", not law.wants_loads())
    yield _says("actuator gives what the law asks for [N, N m]", asked == 0.0, asked)


def _gap(found: Monitored, axis: str) -> float:
    log = found.recording
    acting, asked = log[f"tau_{axis}"], log[f"tau_{axis}_cmd"]
    return largest(len(acting), lambda rows: acting[rows] - asked[rows])


def _says(assumption: str, holds: bool, found: float | None = None) -> dict[str, Any]:
    told = {} if found is None else {"found": found}
    return {"assumption": assumption, "holds": holds} | told


def _visited(found: Monitored) -> dict[str, list[float]]:
    """The set that the observed constants speak for: least and largest values over the run."""
    names = ("u", "v", "r", "z_e", "psi_e", "V")
    log = found.recording
    return {name: [float(np.min(log[name])), float(np.max(log[name]))] for name in names}


def _window(window: Window) -> dict[str, Any]:
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
    return {
        "lambda": bound.lambda_,
        "Delta": bound.Delta,
        "bound": bound.value,
        "lambda_candidates": bound.candidates,
        "Delta_terms": bound.terms,
    }
