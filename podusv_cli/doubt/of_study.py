"""The choices of a study: what it does not draw, and the values that each may have.

Numbers are tried at the ends of a range that `doubt.vary` gives, words in all their forms, and the
seed of the draws and the radius of success at two values each.
"""

from __future__ import annotations

import ast
import copy
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from podusv_cli.doubt.alone import ends
from podusv_cli.doubt.choices import Choice, Singles, choices, hulls, public
from podusv_cli.scenario.doubt import Doubt
from podusv_cli.scenario.model import Scenario

SEED, SUCCESS = "sweep.seed", "sweep.success"
RADIUS = (0.5, 2.0)  # times a length in what counts as a success
LENGTH = "m"


def study_choices(scenario: Scenario) -> list[Choice]:
    """The choices of a study: what it does not draw, and its source does not print."""
    assert scenario.sweep
    doubt, singles = scenario.doubt or Doubt(), _laws(scenario)
    taken = {key for name, drawn in scenario.sweep.vary.items() for key in drawn.targets(name)}
    taken |= set(scenario.sweep.grid)
    given = set(doubt.vary)
    undrawn = [
        # Each value costs a study, so of a range only the ends are tried.
        replace(choice, range=None, values=tuple(ends(choice)) if choice.range else choice.values)
        for choice in choices(singles, doubt)
        if (choice.values or choice.name in given) and not _is_taken(choice, taken)
    ]
    return [*_own(scenario, singles), *hulls(singles, doubt), *undrawn]


def _laws(scenario: Scenario) -> Singles:
    """The scenario of each law that the study has, by label: all, or those of `sweep.laws`."""
    assert scenario.sweep
    wanted = scenario.sweep.laws
    return {
        law: single for law, single in scenario.singles().items() if not wanted or law in wanted
    }


def _is_taken(choice: Choice, taken: set[str]) -> bool:
    """Whether the study draws a choice, or has cells of it or of a section that it is in.

    `taken` are the keys that the study draws or has cells of.
    """
    keys = {public(place) for place in choice.places}
    return any(
        key == drawn or key.startswith((f"{drawn}.", f"{drawn}["))
        for key in keys
        for drawn in taken
    )


def _own(scenario: Scenario, singles: Singles) -> Iterator[Choice]:
    """Choices of the study itself: the seed of its draws, and the lengths in its success."""
    assert scenario.sweep
    everywhere = tuple((label, ("sweep",)) for label in singles)
    seed = scenario.sweep.seed
    yield Choice(SEED, everywhere, seed, values=(seed + 1, seed + 2))
    others = tuple(_with_lengths(scenario, factor) for factor in RADIUS)
    # Without a length in it the condition comes back as it is
    if scenario.sweep.success not in others:
        yield Choice(SUCCESS, everywhere, scenario.sweep.success, values=others)


def _with_lengths(scenario: Scenario, factor: float) -> str:
    """The condition of success with all its lengths [m] times a factor; itself if it has none."""
    assert scenario.sweep
    known, tree = scenario.known_metrics(), ast.parse(scenario.sweep.success, mode="eval")
    changed = copy.deepcopy(tree)
    for node in (node for node in ast.walk(changed) if isinstance(node, ast.Compare)):
        sides = (node.left, *node.comparators)
        lengths = [s for s in sides if isinstance(s, ast.Name) and s.id in known]
        for side in sides:
            # A number that is compared with a metric in metres is a length.
            if isinstance(side, ast.Constant) and lengths and known[lengths[0].id].unit == LENGTH:
                side.value = ast.literal_eval(side) * factor
    same = ast.unparse(changed) == ast.unparse(tree)
    return scenario.sweep.success if same else ast.unparse(changed)


def overrides(choice: Choice, value: Any, scenario: Scenario) -> list[str]:
    """What `--set` takes to give a choice another value: KEY=VALUE for each of its places.

    `scenario` is that of the study.
    """
    if choice.name in (SEED, SUCCESS, "vessel.preset"):
        return [f"{choice.name}={json.dumps(value)}"]
    keys = dict.fromkeys(public(place) for place in choice.places)
    # A scenario with a single law has it under `controller`.
    if not scenario.controllers:
        keys = dict.fromkeys(
            f"controller.{key.split('.', 2)[2]}" if key.startswith("controllers.") else key
            for key in keys
        )
    return [f"{key}={json.dumps(value)}" for key in keys]
