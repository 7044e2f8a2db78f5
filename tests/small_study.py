"""A small study for tests: two laws, a second of simulation, some quantities drawn."""

from pathlib import Path

from podusv_cli.scenario.load import load_text
from podusv_cli.studies.making.dispatch import Processes, dispatch
from podusv_cli.studies.making.plan import plan
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import SCENARIO, Store

TEXT = """
name: small
vessel: {preset: paper_nonlinear}
path: {kind: line}
disturbance: {kind: harmonic}
actuator: {kind: saturated}
controllers:
  pid: {kind: pid}
  li: {kind: full_backstepping}
simulation: {duration: 1.0, step: 0.02}
sweep:
  seed: 7
  draws: 40
  vary:
    vessel.m: {times: {uniform: [0.7, 1.3]}}
    start.psi: {angle: all}
    disturbance.b_u.sin_phase: {angle: all}
  claims:
    S1: {says: Li tracks better., source: ours, expect: share(li.iae < pid.iae) >= 0.5}
"""


def small(**changes):
    """The plan of the study, with changes such as draws=20 below `sweep`."""
    sets = [f"sweep.{name}={value}" for name, value in changes.items()]
    return plan(load_text(TEXT, "small.yaml", sets))


def made(folder: Path, workers=1, part=(1, 1), **changes):
    """The store of the study, simulated into a folder; runs.h5 where it is whole."""
    planned = small(**changes)
    store = Store(folder, about(planned))
    store.open("now")
    _, whole = dispatch(store, planned, lambda tally: None, Processes(workers), part=part)
    if whole and part == (1, 1):
        store.write_runs()
    return store


def folder_with_scenario(folder: Path) -> Path:
    """The folder of a whole study of four draws, with its scenario."""
    study = made(folder, draws=4).folder
    (study / SCENARIO).write_text(TEXT.replace("draws: 40", "draws: 4"))
    return study


def written(path: Path, *changes):
    """The study as a scenario's file, with the text (old, new) of each change replaced."""
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path
