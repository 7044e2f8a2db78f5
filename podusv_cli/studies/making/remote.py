"""What a worker of a cluster does: it reports what it computes with, then makes units.

Everything that is sent to a worker is text and numbers. The worker makes the plan of a study once.
"""

from __future__ import annotations

import platform
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import podusv_cli
from podusv_cli.process.interrupts import Interrupts
from podusv_cli.process.workers import Outcome, outcome_of
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.plugins import of_files
from podusv_cli.storage.provenance import processor
from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making.dispatch import time_unit
from podusv_cli.studies.making.plan import StudyPlan, Variant, digest, plan

PLANS = 2  # plans that a worker keeps
# Those whose version the bits of a run may depend on.
PACKAGES = ("numpy", "numba", "llvmlite")
Report = dict[str, str]
Plugins = tuple[tuple[str, str], ...]  # name and text of each file


@dataclass(frozen=True)
class StudyText:
    """A study as text, and its plug-in files by name."""

    text: str
    plugins: Plugins = ()


@lru_cache(PLANS)
def _place_plan(recipe: StudyText) -> tuple[StudyPlan, TemporaryDirectory[str]]:
    """The plan, and the folder that its plug-ins were read from; gone when it is forgotten."""
    folder = TemporaryDirectory(prefix="podusv-")
    for name, text in recipe.plugins:
        place = Path(folder.name, name)
        place.parent.mkdir(exist_ok=True)
        # Plug-ins are files to the scenario, so they are written as files here as well.
        place.write_text(text, encoding="utf-8")
    source = str(Path(folder.name, "scenario.yaml"))
    return plan(load_text(recipe.text, source, plugged=of_files(trusted=True))), folder


def _plan(recipe: StudyText) -> StudyPlan:
    return _place_plan(recipe)[0]


@lru_cache(PLANS)
def _variant(recipe: StudyText, variant: tuple[Any, ...]) -> StudyPlan:
    """The plan of a variant of a study, made once in this worker."""
    return _plan(recipe).with_variant(Variant(*variant))


@lru_cache(PLANS)
def _report(recipe: StudyText) -> Report:
    """All that this worker computes with: versions, and digests of kernels and of the study."""
    made = _plan(recipe)
    facts = {"podusv": podusv_cli.__version__, "Python": platform.python_version()}
    facts |= {name: version(name) for name in PACKAGES}
    for law in made.laws:
        sources = [made.identity[f"{law}[{cell.index}] kernels"] for cell in made.cells]
        facts[f"the kernels of {law}"] = digest(dict.fromkeys(sources))
    facts["the study"] = digest(made.identity)
    return facts


def report(text: str, plugins: Plugins) -> Report:
    """Versions, and digests of all kernels and of the study."""
    return dict(_report(StudyText(text, plugins)))


def differing(ours: Report, theirs: Report) -> str:
    """What differs in a worker's report (`theirs`) from ours, with a remedy, or ""."""
    differences = [
        f"{name} is {theirs.get(name, 'not there')}, not {word}"
        for name, word in ours.items()
        if theirs.get(name) != word
    ]
    remedy = "install there what is installed here, or leave the worker out"
    return f"{'; '.join(differences)}; {remedy}" if differences else ""


@dataclass(frozen=True)
class Reply:
    """What a worker sends back: who it is, its report, and the outcome of a unit.

    There is no outcome where the report is not the expected one.
    """

    worker: str
    machine: str
    report: Report
    outcome: Outcome | None


def make_unit(
    text: str,
    plugins: Plugins,
    unit: tuple[str, int, int, int],
    expected: str,
    variant: tuple[Any, ...] | None = None,
) -> Reply:
    """Make one unit (law, cell, first draw, number of draws) on a worker of the cluster.

    `text` and `plugins` are the study, `variant` the fields of a `Variant`, if any: plain data
    alone, since objects of another podusv could not be read. No unit is made where the digest of
    the worker's report is not `expected`.
    """
    from distributed import get_worker

    facts, outcome, recipe = report(text, plugins), None, StudyText(text, plugins)
    if digest(facts) == expected:
        plan = _variant(recipe, variant) if variant else _plan(recipe)
        job = partial(time_unit, plan, Unit(*unit))
        outcome = outcome_of(job, lambda fraction: None, Interrupts())
    machine = f"{processor()} ({' '.join(platform.libc_ver())})"
    return Reply(get_worker().address, machine, facts, outcome)
