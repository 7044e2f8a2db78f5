"""Do the intervals of `podusv identify` hold what they say? Hulls drawn from the prior, and logs.

    python examples/reproduce/identify_coverage.py results/identify/coverage.csv [--sets 100]

For each hull and each GNSS: so many true hulls, drawn as the prior has it; each does two zig-zags
and two turning circles in a current and under loads that the filter does not know, through
noisy sensors. The logs are CSV files and are read as anybody's, but for their clocks: that commands
are not late is given (`delay`), since to find it out takes 1 to 10 s a set. What comes out is
compared with the truth, where the logs determine it.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pydantic import ValidationError

import podusv
from podusv_cli.components.facts import Facts
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.core.recording import Recording
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.identify.answer import AXES, SIDE, Identification
from podusv_cli.identify.fit.estimate import OPEN, directions, estimate_hull, prior_kept
from podusv_cli.identify.fit.problem import FitProblem
from podusv_cli.identify.fit.records import FilterLog
from podusv_cli.identify.intake import logs_of
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.model import Scenario

HULLS = {
    "cybership2": {"kind": "saturated"},
    "otter": {"kind": "pod", "preset": "otter"},
    "revolt": {"kind": "pod", "preset": "revolt"},
}
GNSS = (0.01, 1.0)  # m, standard deviation of a position
# A law, its thrust over the hull's largest, and the angle of the thrust [rad].
MANOEUVRES = (
    ("zigzag", 0.15, 0.35),
    ("zigzag", 0.5, 0.35),
    ("turning_circle", 0.2, 0.6),
    ("turning_circle", 0.6, 0.35),
)
CURRENT = 0.05  # of the speed at full thrust
LOAD = 0.02  # of largest force and moment: deviation of a load that is fixed to the earth
LASTING = 10.0  # s on the model ship: how long a gust's load lasts
WANTED = Identify(logs=(LogFile(file="-"),))
HEAD = (
    "sea",
    "hull",
    "gnss",
    "set",
    "what",
    "name",
    "truth",
    "value",
    "low",
    "high",
    "width",
    "off",
    "holds",
    "determined",
    "settled",
)


class Cell(NamedTuple):
    """A set of logs."""

    sea: str
    hull: str
    gnss: float
    number: int


def known(hull: str) -> Scenario:
    """The hull as it is known before, with its actuator."""
    return podusv.Scenario(
        name=hull,
        vessel={"preset": hull},
        actuator=HULLS[hull],
        controller={"kind": "pid"},
        path={"kind": "line", "speed": 0.0},
        disturbance={"kind": "none"},
        identify=WANTED,
    )


def true_hull(problem: FitProblem, rng: np.random.Generator) -> Vessel:
    """A hull drawn from the prior; another where none can be like that."""
    while True:
        with suppress(ValidationError):
            return problem.vessel(rng.standard_normal(len(problem.hull)))


def logs(before: Scenario, true: Vessel, cell: Cell, i: int) -> list[FilterLog]:
    """What the sensors deliver in one manoeuvre; none where the run does not end."""
    kind, share, angle = MANOEUVRES[i]
    facts, seed = before.facts, 1 + cell.number
    step = 0.01 * math.sqrt(facts.lam)
    seeds = np.random.default_rng([seed, i])
    direction = seeds.uniform(-math.pi, math.pi)
    scenario = podusv.Scenario(
        name=before.name,
        vessel=true.model_dump(),
        nominal=before.vessel.model_dump(),
        start={"u": 0.3 * facts.s},
        path={"kind": "line", "speed": 0.0},
        disturbance=[
            {"kind": "current", "speed": CURRENT * facts.U, "direction": direction},
            *SEAS[cell.sea](facts, seeds),
        ],
        actuator=HULLS[before.name],
        measurement=sensors(cell.gnss, step, seed * 10 + i),
        estimator={"kind": "ekf"},
        control={"period": 10 * step},
        controller={
            "kind": kind,
            "thrust": share * facts.F,
            "angle": angle,
            "execute": 1000 * step,
        },
        simulation={"step": step, "duration": 12000 * step},
        log={"every": 2},
    )
    scenario.ready()
    run = simulate(scenario.closed_loop(), scenario.time_grid())
    if run.status != "finished":
        return []
    columns = {"time": run["time"]} | {q: run[f"{q}_m"] for q in ("x", "y", "psi", "r")}
    columns |= replayed(scenario, run)
    with TemporaryDirectory() as folder:
        path = Path(folder, f"{i}.csv")
        pd.DataFrame(columns).to_csv(path, index=False, float_format="%.9g")
        return logs_of(path, LogFile(file=path.name, delay=0.0), before)


def gusts(
    facts: Facts, seeds: np.random.Generator, *, sines: int = 8, highest: float = 0.48
) -> list[dict[str, Any]]:
    """A load north, east and about the vertical that wanders about a mean, and forgets.

    Sines whose rates are spread as the power of a Gauss-Markov process is, up to the part `highest`
    of pi: tan(pi highest) over the time that a load lasts.
    """

    def axis(largest: float) -> dict[str, float]:
        size = LOAD * largest / math.sqrt(sines)  # of 2 sines each, so that their sum has LOAD
        rates = np.tan(seeds.uniform(0.0, highest * math.pi, 2)) / (LASTING * math.sqrt(facts.lam))
        phases = seeds.uniform(0.0, 2.0 * math.pi, 2)
        return {
            "mean": size * seeds.standard_normal(),
            "sin": size,
            "sin_rate": rates[0],
            "sin_phase": phases[0],
            "cos": size,
            "cos_rate": rates[1],
            "cos_phase": phases[1],
        }

    return [_earth(facts, axis) for _ in range(sines)]


def swings(facts: Facts, seeds: np.random.Generator) -> list[dict[str, Any]]:
    """A load with two rates: it has one phase in all of a log, and so may go with the motion."""

    def axis(largest: float) -> dict[str, float]:
        rates = seeds.uniform(0.1, 0.5, 2) / math.sqrt(facts.lam)
        return {
            "mean": LOAD * largest * seeds.uniform(-1.0, 1.0),
            "sin": LOAD * largest,
            "sin_rate": rates[0],
            "sin_phase": seeds.uniform(0.0, 6.0),
            "cos": LOAD * largest,
            "cos_rate": rates[1],
            "cos_phase": seeds.uniform(0.0, 6.0),
        }

    return [_earth(facts, axis)]


def _earth(facts: Facts, axis: Callable[[float], dict[str, float]]) -> dict[str, Any]:
    loads = {"b_u": axis(facts.F), "b_v": axis(facts.F), "b_r": axis(facts.N)}
    return {"kind": "harmonic", "frame": "earth", **loads}


SEAS = {
    "wandering": partial(gusts, sines=64, highest=0.499),  # as the filter takes it
    "gusts": gusts,  # none of it faster than 1.6 rad/s on the model ship
    "swings": swings,
}


def sensors(gnss: float, step: float, seed: int) -> dict[str, Any]:
    """GNSS every 20 steps, compass and gyro every 10, without delay."""
    alone = {"delay": 0.0, "bias": 0.0}
    return {
        "kind": "sensors",
        "seed": seed,
        "velocity": None,
        "position": {"period": 20 * step, "noise": gnss, **alone},
        "heading": {"period": 10 * step, "noise": math.radians(0.5), **alone},
        "yaw_rate": {"period": 10 * step, "noise": 0.002, **alone},
    }


def replayed(scenario: Scenario, run: Recording) -> dict[str, Vector]:
    """What the log has of the actuator."""
    columns = {}
    for signal in scenario.actuator.replayed:
        name, _, place = signal.name.rpartition("_")
        whole = signal.name in run
        columns[signal.name] = run[signal.name] if whole else run[name][:, int(place) - 1]
    return columns


def rows(cell: Cell) -> list[tuple[Any, ...]]:
    """What comes out of one set of logs, beside the truth."""
    before = known(cell.hull)
    rng = np.random.default_rng([1 + cell.number, [*HULLS].index(cell.hull), GNSS.index(cell.gnss)])
    true = true_hull(FitProblem(before, WANTED, []), rng)
    try:
        given = [log for i in range(len(MANOEUVRES)) for log in logs(before, true, cell, i)]
        if not given:
            return []
        problem = FitProblem(before, WANTED, given)
        found = prior_kept(problem.search, estimate_hull(problem.search))
    except UsageError as error:
        print(f"{cell}: {error}", file=sys.stderr)
        return []
    ways = directions(found.covariance, len(problem.hull))
    answer = Identification(problem, found, ways, (), ())
    return [
        (*cell, *row, found.settled)
        for row in (*of_numbers(answer, true), *of_forces(answer, true))
    ]


def of_numbers(answer: Identification, true: Vessel) -> Iterator[tuple[Any, ...]]:
    """Of every number of the hull: how far off in its own standard deviations."""
    truth = true.constants()
    for p in answer.parameters[: len(answer.problem.hull)]:
        sd = (math.log(abs(p.high / p.low))) / (2.0 * SIDE)
        off = math.log(p.value / truth[p.name]) / abs(sd)
        low, high = sorted((p.low, p.high))
        holds = low <= truth[p.name] <= high
        yield (
            "number",
            p.name,
            truth[p.name],
            p.value,
            low,
            high,
            p.width,
            off,
            holds,
            p.width <= OPEN,
        )


def of_forces(answer: Identification, true: Vessel) -> Iterator[tuple[Any, ...]]:
    """Of every damping force at speeds of the logs."""
    k = bundle(true.constants())
    for f in answer.forces:
        place = next(i for i, axis in enumerate(AXES) if axis.name == f.force)
        nu = [0.0, 0.0, 0.0]
        nu[place] = f.at
        truth = AXES[place].force(*nu, k)
        off = (f.value - truth) / ((f.high - f.low) / (2.0 * SIDE))
        holds = f.low <= truth <= f.high
        yield "force", f.force, truth, f.value, f.low, f.high, f.width, off, holds, f.width <= OPEN


def summary(made: pd.DataFrame) -> pd.DataFrame:
    """Of each sea, hull and GNSS what the logs determine, and how it stands to the truth.

    Without searches that did not settle.
    """
    determined = made[made.determined & made.settled]
    by = determined.groupby(["sea", "hull", "gnss", "what"], sort=False)
    sets = made.groupby(["sea", "hull", "gnss", "what"], sort=False)
    return pd.DataFrame(
        {
            "sets": sets.set.nunique(),
            "settled": sets.apply(lambda cell: cell[cell.settled].set.nunique()),
            "determined": by.size(),
            "of": sets.settled.sum(),
            "held": by.holds.mean(),
            "off_rms": by.off.apply(lambda off: float(np.sqrt(np.mean(off**2)))),
            "off_median": by.off.apply(lambda off: float(np.median(np.abs(off)))),
        }
    ).reset_index()


def main() -> None:
    """Write what comes out of every cell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--sets", type=int, default=100)
    parser.add_argument("--seas", nargs="*", default=[*SEAS])
    parser.add_argument("--workers", type=int, default=0)
    asked = parser.parse_args()
    cells = [Cell(*cell, i) for i in range(asked.sets) for cell in product(asked.seas, HULLS, GNSS)]
    every: list[tuple[Any, ...]] = []
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(asked.workers or None) as pool:
        for made in pool.map(rows, cells):
            every += made
            table = summary(pd.DataFrame(every, columns=list(HEAD)))
            table.to_csv(asked.out, index=False, float_format="%.3g")


if __name__ == "__main__":
    main()
