"""Margins of the compared runs' loops, where a claim names one."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from podusv_cli.comparison.claims import ParsedClaim
from podusv_cli.comparison.entries import Entry
from podusv_cli.core.errors import LawError, NotConvergedError
from podusv_cli.metrics.margins import OF_LOOP
from podusv_cli.process.extras import Extras, Failure
from podusv_cli.process.interrupts import interrupts_enabled
from podusv_cli.scenario.model import Scenario
from podusv_cli.theory.loop_margins import loop_margins


def with_margins(
    entries: Sequence[Entry], made: Mapping[str, Scenario], claims: Sequence[ParsedClaim],
    extras: Extras,
) -> list[Entry]:  # fmt: skip
    """The entries; those `made` now each with those margins of its loop that claims name.

    A finished run, and one whose loop has no margins, has none; `extras` says why.
    """
    named = {pair for claim in claims for pair in _named(claim)}
    wanted = {
        e.label: {n for label, n in named if label == e.label and n in OF_LOOP} for e in entries
    }
    for run in (entry.run for entry in entries if wanted[entry.label] and entry.label not in made):
        why = f"it is finished: podusv margins {run.folder}/resolved.yaml"
        extras.missing.append(Failure(f"margins of {run.folder.name}", why))
    return [
        _measured(e, made[e.label], wanted[e.label], extras)
        if wanted[e.label] and e.label in made
        else e
        for e in entries
    ]


def _named(claim: ParsedClaim) -> Iterator[tuple[str, str]]:
    """The runs and what of them stands in a claim's expressions."""
    for tree in filter(None, (claim.expect, claim.given)):
        for node in ast.walk(tree):
            match node:
                case ast.Attribute(value=ast.Name(id=label), attr=name):
                    yield label, name


def _measured(entry: Entry, scenario: Scenario, wanted: set[str], extras: Extras) -> Entry:
    what = f"margins of {entry.label}"
    if extras.interrupted:
        return entry
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
        return replace(entry, cost={**entry.cost, **{name: margins[name] for name in wanted}})
    return entry
