"""A plug-in law whose cost has a known optimum in its gains, and a search for it."""

from pathlib import Path

from podusv_cli.scenario.load import load, load_text
from podusv_cli.studies.making.dispatch import Processes
from podusv_cli.studies.making.unit import prepare
from podusv_cli.studies.tuning import trials
from podusv_cli.studies.tuning.check import tune_faults
from podusv_cli.studies.tuning.dispatch import dispatch
from podusv_cli.studies.tuning.plan import TunePlan
from podusv_cli.studies.tuning.search import GainSearch
from podusv_cli.workflows import tune as workflow

# They have times, and the report the last session.
MADE_ANEW = {"provenance.json", "manifest.json", "tune.json", "study.json", "report.html"}

LAW = '''"""A law whose tau_u varies by its distance from a known gain."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.component import value
from podusv_cli.core.kernel import kernel
from podusv_cli.core.signal import Signal

MISS = Signal("miss", "1", "distance of the gain from its optimum")
BEST = 3.0


class Toy(Controller):
    """The best gain is 3; a gain above 20 raises the cost without bounds."""

    kind: Literal["toy"] = "toy"
    gain: float = value(1.0, "1", "best at 3", gt=0)
    other: float = value(1.0, "1", "with a small influence", gt=0)
    unread: float = value(1.0, "1", "without influence", gt=0)
    signals: ClassVar[tuple[Signal, ...]] = (MISS,)

    def slots(self):
        return ((Signal("seen", "1", "nothing"), 1),)

    def start(self, x, target, nominal):
        return np.zeros(1)

    @staticmethod
    @kernel
    def law(t, x, memory, target, k, table, tau, rate, signals, work):
        signals[0] = k.gain - BEST
        tau[0], tau[1] = 0.5 * (k.gain - BEST) * (k.gain - BEST) + 1e-4 * k.other, 0.0
        rate[0] = 0.0


class Bare(Controller):
    """A law without any number of its own."""

    kind: Literal["bare"] = "bare"

    def slots(self):
        return ((Signal("nothing", "1", "nothing"), 1),)

    def start(self, x, target, nominal):
        return np.zeros(1)

    @staticmethod
    @kernel
    def law(t, x, memory, target, k, table, tau, rate, signals, work):
        tau[0], tau[1], rate[0] = 0.2, 0.0, 0.0
'''
TEXT = """
name: toy
plugins: [toy.py]
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: ideal}
controllers:
  toy: {kind: toy}
  bare: {kind: bare}
simulation: {duration: 0.4, step: 0.02}
sweep:
  seed: 3
  draws: 10
  vary:
    start.psi: {uniform: [-0.1, 0.1]}
    start.u: {uniform: [0.0, 0.1]}
tune:
  budget: 64
  train: 4
  validate: 12
  objective: median(effort_u)
  repeats: 2
"""


def toy(folder: Path) -> Path:
    """The scenario of the search in a folder, with its plug-in."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "toy.py").write_text(LAW)
    (folder / "toy.yaml").write_text(TEXT)
    return folder / "toy.yaml"


def planned(folder: Path, *changes: str) -> TunePlan:
    """The plan of the search."""
    return TunePlan(load(toy(folder), changes, [tune_faults]).scenario)


def faults(text: str, *changes: str) -> list[str]:
    """What is wrong with a scenario's key `tune`."""
    from podusv_cli.core.errors import ScenarioError

    try:
        load_text(text, "a.yaml", changes, [tune_faults])
    except ScenarioError as error:
        return [str(fault) for fault in error.faults]
    return []


def tuned(folder, *changes, tell=lambda tally, text: None, workers=1, figures=False):
    """A finished search in folder/out."""
    request = workflow.Request(changes, folder / "out", workers, figures=figures)
    return workflow.tune(toy(folder), request, tell)


def contents(folder):
    """The bytes of all files that do not tell of times."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in MADE_ANEW
    }


def searched(folder, *changes, engine=None):
    """The trials of the toy law's searches, by the driver alone."""
    plan = planned(folder, *changes)
    (folder / trials.FOLDER).mkdir(exist_ok=True)
    found = [GainSearch(plan, "toy", number, folder) for number in range(plan.tune.searches)]
    prepare(plan.base, "toy", 0)  # before the fork
    dispatch(found, engine or Processes(1), lambda tally, searches: None)
    return found
