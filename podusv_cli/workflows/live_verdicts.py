"""What the page of `podusv live` says of its runs in words: claims, margins, limits."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from typing import Any

from podusv_cli.comparison.claims import ParsedClaim, judge
from podusv_cli.comparison.known_metrics import metrics_of
from podusv_cli.core.errors import LawError, NotConvergedError
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.recording import Recording
from podusv_cli.metrics.effort import saturated_fraction
from podusv_cli.metrics.margins import OF_LOOP
from podusv_cli.metrics.operations import law_operations, operations
from podusv_cli.process.extras import Extras
from podusv_cli.scenario.case import Case
from podusv_cli.theory.loop_margins import loop_margins
from podusv_cli.workflows.claimed_margins import with_margins

SHOWN_MARGINS = (
    "phase_margin_u",
    "phase_margin_v",
    "phase_margin_r",
    "gain_margin_u",
    "gain_margin_v",
    "gain_margin_r",
    "delay_margin",
    "decay_rate",
)


def claims_about(parsed: Sequence[ParsedClaim], labels: Sequence[str]) -> list[ParsedClaim]:
    """The claims that name no other runs than `labels`.

    These may be only some runs of the scenario.
    """
    return [
        claim
        for claim in parsed
        if {name for tree in (claim.expect, claim.given) for name in _names_in(tree)} <= {*labels}
    ]


def _names_in(tree: ast.expr | None) -> set[str]:
    """The runs that an expression names, as `run.metric` or `check(run)`."""
    nodes = list(ast.walk(tree)) if tree else []
    called = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    return {node.id for node in nodes if isinstance(node, ast.Name) and id(node) not in called}


def past_run_of(
    label: str,
    case: Case,
    recording: Recording,
    numbers: Mapping[str, float],
    parsed: Sequence[ParsedClaim],
) -> PastRun:
    """A run that was only simulated, as claims ask it; `numbers` are its metrics by name."""
    known = {**numbers}
    # Counting operations takes long, so only where a claim asks for them.
    if len(recording["time"]) and any(law_operations.name in c.claim.expect for c in parsed):
        known |= operations(case.plan, recording)
    return PastRun(label, case.about, recording, known, plugins=case.scenario.plugged)


def verdicts_on(
    parsed: Sequence[ParsedClaim],
    runs: Sequence[PastRun],
    cases: Mapping[str, Case],
    *,
    at_rest: bool,
) -> list[dict[str, Any]]:
    """The verdict on each claim, for the page; `cases` are by label.

    While values move (not `at_rest`), margins and the monitor's signals are missing: then only
    claims that can be told without them are among the verdicts.
    """
    if at_rest:
        scenarios = {label: case.scenario for label, case in cases.items()}
        runs = with_margins(runs, scenarios, parsed, Extras())
    verdicts = judge(parsed, {run.label: run for run in runs}, metrics_of(runs))
    return [
        {
            "name": v.name,
            "says": v.claim.says,
            "expect": v.claim.expect,
            "answer": v.answer,
            "words": v.in_words,
            "evidence": v.evidence(),
        }
        for v in verdicts
        if at_rest or v.answer is not None
    ]


def margins_of(case: Case) -> dict[str, Any]:
    """A law's margins as rows of name, meaning, unit and number, or why it has none."""
    scenario = case.scenario
    try:
        found = loop_margins(
            scenario.closed_loop(), scenario.time_grid(), compiled=scenario.simulation.compiled
        )
    except (LawError, NotConvergedError) as error:
        return {"why": str(error), "rows": []}
    if not found.stable:
        return {"why": "its loop is unstable about the steady motion", "rows": []}
    numbers = found.numbers()
    rows = [(OF_LOOP[name].about, numbers[name]) for name in SHOWN_MARGINS if name in numbers]
    return {
        "why": "",
        "left_out": list(found.left_out),
        "rows": [
            [about.name, about.meaning, "" if about.unit == "1" else about.unit, _as_shown(number)]
            for about, number in rows
        ],
    }


def _as_shown(number: float) -> float | str:
    """A margin; in words where it has no limit or the loop none."""
    if math.isfinite(number):
        return number
    return "none" if math.isnan(number) else "any"


def limits_in_words(numbers: Mapping[str, float]) -> str:
    """How much of the run the actuator limits the law; empty where it never does."""
    part = numbers.get(saturated_fraction.name, math.nan)
    return f"at the actuator's limits {100.0 * part:.3g} % of the time" if part > 0.0 else ""
