"""What a study is to simulate: laws, cells, draws, and the identity of the result."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.about import BESIDE_RUNS, Keep
from podusv_cli.core.errors import UsageError
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.machine.object_cache import ingredients
from podusv_cli.engine.step import rk4 as closed_loop
from podusv_cli.scenario.load import Loaded, values
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.sweep import Sweep
from podusv_cli.studies.making.cells import Cell, cells
from podusv_cli.studies.making.check import sweep_faults
from podusv_cli.studies.making.draws import SWEEP

# Sections of a scenario that change no number of a study.
COSMETIC = (
    "name",
    "description",
    "origin",
    "log",
    "silence",
    "claims",
    "controllers",
    *BESIDE_RUNS,
)
MOST_NAMED = 4  # keys that a message about another study names
LawInCell = tuple[str, int]  # a law, and the number of a cell
KERNELS = " kernels"  # ends the key of the digest of a law's compiled source


@dataclass(frozen=True)
class Variant:
    """Laws of a study with other numbers, on draws of another stream; text and numbers alone.

    `laws` holds for each its name, the name of the study's law, and its numbers that are others.
    """

    stream: str
    draws: int
    laws: tuple[tuple[str, str, tuple[tuple[str, Any], ...]], ...]


@dataclass(frozen=True)
class StudyPlan:
    """A scenario with its key `sweep`, in cells."""

    scenario: Scenario
    cells: tuple[Cell, ...]
    variant: Variant | None = None  # which one of the study it is, if any

    def __reduce__(self) -> tuple[type[StudyPlan], tuple[Any, ...]]:
        """These values alone: what is made of them has kernels that other processes cannot name."""
        return StudyPlan, (self.scenario, self.cells, self.variant)

    @property
    def sweep(self) -> Sweep:
        """The study's settings. Raises UsageError where the scenario has none."""
        if self.scenario.sweep is None:
            raise UsageError(f"{self.scenario.name} has no key `sweep`; see podusv docs studies")
        return self.scenario.sweep

    @property
    def stream(self) -> str:
        """The stream of its draws."""
        return self.variant.stream if self.variant else SWEEP

    @property
    def laws(self) -> tuple[str, ...]:
        """The names of the laws that meet the draws."""
        return tuple(self.sweep.laws) or self.scenario.labels()

    @cached_property
    def metrics(self) -> tuple[str, ...]:
        """The names of the metrics that a law of the study has during a run, in their order."""
        probes = [self.run_plan(law, cell.index).probe for law in self.laws for cell in self.cells]
        # A summary of NaN has the names that a law's probe gives, without any run.
        blank = [probe.summary(np.full(probe.size, np.nan)) for probe in probes]
        names = {name for numbers in blank for name in numbers}
        return tuple(name for name in self.scenario.known_metrics() if name in names)

    def single(self, law: str, cell: int) -> Scenario:
        """The scenario of one law in one cell."""
        return self.cells[cell].scenario.singles()[law]

    def run_plan(self, law: str, cell: int) -> Plan:
        """The loop of a law in a cell before any draw, on its grid; put together once."""
        if (law, cell) not in self._run_plans:
            self._run_plans[law, cell] = self.single(law, cell).plan()
        return self._run_plans[law, cell]

    @cached_property
    def _run_plans(self) -> dict[LawInCell, Plan]:
        return {}

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that the numbers depend on, by dotted keys; two studies that agree can be joined.

        Each law in each cell has its settings and a digest of its kernels. How many draws there are
        is left out: a study may grow.
        """
        sweep = self.sweep
        facts: dict[str, Any] = {"sweep.seed": sweep.seed, "sweep.design": sweep.design}
        if self.stream != SWEEP:
            facts["stream"] = self.stream
        for name, quantity in sweep.vary.items():
            facts[f"sweep.vary.{name}"] = quantity.model_dump(exclude_defaults=True)
        for cell in self.cells:
            for law in self.laws:
                single = self.single(law, cell.index)
                kept = {
                    key: value
                    for key, value in values(single).items()
                    if key.partition(".")[0] not in COSMETIC
                }
                facts |= {f"{law}[{cell.index}].{key}": value for key, value in kept.items()}
                facts[f"{law}[{cell.index}]{KERNELS}"] = kernels(self.run_plan(law, cell.index))
        return facts

    def with_variant(self, variant: Variant) -> StudyPlan:
        """The study with the laws of `variant`, on its draws; this one must have no grid.

        Raises ValidationError where a law refuses its numbers.
        """
        own = self.scenario.singles()
        laws = {name: change_law(own[law].controller, dict(new)) for name, law, new in variant.laws}
        plain = {"laws": (), "draws": variant.draws, "claims": {}, "keep": Keep()}
        # `controller` is a placeholder that the scenario needs; `controllers` has the laws.
        scenario = self.scenario.model_copy(
            update={
                "controllers": laws,
                "controller": next(iter(laws.values())),
                "claims": {},
                "tune": None,
                "sweep": self.sweep.model_copy(update=plain),
            }
        )
        return StudyPlan(scenario, (Cell(0, (), scenario),), variant)


def change_law(law: Controller, new: Mapping[str, Any]) -> Controller:
    """The law with other numbers. Raises ValidationError where it refuses them."""
    return law.changed(new)


def plan(loaded: Loaded) -> StudyPlan:
    """The plan of a scenario with a key `sweep`. Raises ScenarioError with all that is wrong."""
    return StudyPlan(loaded.scenario, cells(loaded, sweep_faults))


def kernels(planned: Plan) -> str:
    """A digest (16 hexadecimal digits) of the source of all kernels of a law's loop.

    It is one of source, not of machine code: so it is the same on every processor.
    """
    parts = [kernel for _, kernel, _ in planned.functions]
    sha = hashlib.sha256()
    for kernel in (closed_loop.advance, *parts):
        for text in ingredients(kernel, {}):
            sha.update(text.encode() + b"\0")
    return sha.hexdigest()[:16]


def digest(identity: Mapping[str, Any]) -> str:
    """A digest (16 hexadecimal digits) of an identity; the order of its keys does not matter."""
    text = json.dumps(identity, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """The keys that two identities have different values for."""
    return [key for key in dict.fromkeys([*one, *other]) if one.get(key) != other.get(key)]


def disagreements(
    one: Mapping[str, Any], other: Mapping[str, Any], keys: Sequence[str] | None = None
) -> str:
    """What two identities differ in, as text with both values, MOST_NAMED keys at most.

    `keys` restricts it to these keys; "" where nothing differs.
    """
    keys = differing(one, other) if keys is None else keys
    texts = [
        f"{key}: {one.get(key, 'not there')}, not {other.get(key, 'not there')}"
        for key in keys[:MOST_NAMED]
    ]
    return "; ".join(texts) + (" and more" if len(keys) > MOST_NAMED else "")
