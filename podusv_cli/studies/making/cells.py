"""The cells of a study: every combination of the values under `sweep.grid`, as a scenario."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import product
from math import prod
from typing import Any

from podusv_cli.core.about import BESIDE_RUNS
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.phrases import as_yaml
from podusv_cli.scenario.load import CLASHES, Check, Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.yaml_tree import Fault, Node, find, merge, plain, route, tree_with

MOST = 1000  # cells
FIXED = ("extends", "plugins", *BESIDE_RUNS, "name", "claims")  # the same in all cells


@dataclass(frozen=True)
class Cell:
    """A combination of values, by key, and the scenario that has them."""

    index: int
    values: tuple[tuple[str, Any], ...]
    scenario: Scenario

    @property
    def label(self) -> str:
        """`disturbance.scale = 0.5, path.kind = line`; "" without a grid."""
        return _label(self.values)


def cells(loaded: Loaded, check: Check | None = None) -> tuple[Cell, ...]:
    """All cells, the last key of the grid changing fastest; one without a grid.

    A value counts as if it stood in the scenario's file: `vessel.m` changes `nominal` too, where
    that is not given. `check` is made of each. Raises ScenarioError with all that is wrong.
    """
    # Before any cell is made: a few lists can have more combinations than there is memory for.
    _check_grid(loaded)
    faults: dict[Hashable, None] = {}
    made = list(_make_cells(loaded, check, faults))
    if faults:
        raise ScenarioError(list(faults))
    return tuple(made)


def _make_cells(
    loaded: Loaded, check: Check | None, faults: dict[Hashable, None]
) -> Iterator[Cell]:
    """The cells of the grid in order, the last key changing fastest.

    `faults` collects what is wrong with cells that do not load, each once; a dict keeps the order.
    """
    grid = _grid(loaded)
    for index, nodes in enumerate(product(*grid.values())):
        each = [tree_with(key, node, loaded.root) for key, node in zip(grid, nodes, strict=True)]
        top = reduce(merge, each, Node({}, loaded.root.mark))
        values = tuple(zip(grid, map(plain, nodes), strict=True))
        checks = [_within(check, _label(values))] if check else []
        try:
            # A cell is the scenario's own tree with the grid's values laid over it.
            scenario = (
                loaded.merge_over(top, checks)
                if grid
                else loaded.pass_checks([], (CLASHES, *checks)).scenario
            )
            yield Cell(index, values, scenario)
        except ScenarioError as error:
            faults |= dict.fromkeys(error.faults)


def _label(values: tuple[tuple[str, Any], ...]) -> str:
    """A cell in words: its keys and values."""
    return ", ".join(f"{key} = {as_yaml(value)}" for key, value in values)


def _within(check: Check, label: str) -> Check:
    """The check, naming the cell in what it says."""
    if not label:
        return check
    return lambda loaded: [(key, f"{text} (in the cell {label})") for key, text in check(loaded)]


def _grid(loaded: Loaded) -> dict[str, tuple[Node, ...]]:
    """The nodes of each key's values under `sweep.grid`, in podusv's units, with their places."""
    grid = find(loaded.filled, ("sweep", "grid"))
    entries = grid.mapping.items() if grid else ()
    return {key: node.content for key, node in entries if node.content is not None}


def _check_grid(loaded: Loaded) -> None:
    """Raise ScenarioError for keys that cannot be in a grid, empty lists, and too many cells."""
    grid = _grid(loaded)
    faults = [
        _fault(loaded, key, text) for key, nodes in grid.items() for text in _wrong(key, nodes)
    ]
    count = prod(len(nodes) for nodes in grid.values())
    if count > MOST:
        faults.append(
            _fault(loaded, "", f"has {count:,} combinations, at most {MOST:,} are allowed")
        )
    if faults:
        raise ScenarioError(faults)


def _wrong(key: str, nodes: tuple[Node, ...]) -> Iterator[str]:
    """What is wrong with a key of the grid and its values."""
    steps = route(key)
    if not nodes:
        yield "is empty; write the values of the cells"
    if not steps or steps[0] in FIXED:
        yield f"cannot differ between cells (nor can {', '.join(FIXED)})"


def _fault(loaded: Loaded, key: str, text: str) -> Fault:
    """A fault at a key of the grid; at the grid itself for an empty `key`."""
    place = ("sweep", "grid", *([key] if key else []))
    node = find(loaded.root, place)
    mark = node.key_mark or node.mark if node else loaded.root.mark
    return Fault(mark, ".".join(place), text)
