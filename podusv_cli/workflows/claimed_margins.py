"""Margins of the compared runs' loops, where a claim names one."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.core.errors import LawError, NotConvergedError
from podusv_cli.core.past_run import PastRun
from podusv_cli.metrics.margins import OF_LOOP
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.scenario.model import Scenario
from podusv_cli.theory.loop_margins import loop_margins


def with_margins(
    runs: Sequence[PastRun],
    made: Mapping[str, Scenario],
    claims: Sequence[ParsedClaim],
    extras: Extras,
) -> list[PastRun]:
    """The runs, each with those margins of its loop that claims name.

    `made` has the scenarios of runs made now, by label. A finished run, and one whose loop has no
    margins, gets none; `extras` says why.
    """
    named = {pair for claim in claims for pair in _names_in_claim(claim)}
    wanted = {
        run.label: {n for label, n in named if label == run.label and n in OF_LOOP} for run in runs
    }
    for run in runs:
        if wanted[run.label] and run.label not in made and run.folder:
            why = f"it is finished: podusv margins {run.folder}/resolved.yaml"
            extras.missing.append(Failure(f"margins of {run.folder.name}", why))
    return [
        _with_margins(run, made[run.label], wanted[run.label], extras)
        if wanted[run.label] and run.label in made
        else run
        for run in runs
    ]


def _names_in_claim(claim: ParsedClaim) -> Iterator[tuple[str, str]]:
    """Label and name for each `run.name` in a claim's expressions."""
    for tree in filter(None, (claim.expect, claim.given)):
        for node in ast.walk(tree):
            match node:
                case ast.Attribute(value=ast.Name(id=label), attr=name):
                    yield label, name


def _with_margins(run: PastRun, scenario: Scenario, wanted: set[str], extras: Extras) -> PastRun:
    """The run with the margins `wanted` (by name) among its numbers, as far as there are any.

    What fails is noted in `extras`, and so is an interrupt.
    """
    what = f"margins of {run.label}"
    if extras.interrupted:
        return run
    try:
        with interrupts_enabled():
            margins = loop_margins(
                scenario.closed_loop(), scenario.time_grid(), compiled=scenario.simulation.compiled
            ).numbers()
    except KeyboardInterrupt:
        extras.interrupted = True
    except (LawError, NotConvergedError) as error:
        extras.missing.append(Failure(what, str(error)))
    else:
        if wanted - margins.keys():
            why = "its law asks for no sway force, so there is no sway loop"
            extras.missing.append(Failure(what, why))
        known = {name: margins[name] for name in wanted & margins.keys()}
        return replace(run, cost={**run.cost, **known})
    return run
