"""Do the intervals of `podusv identify` hold the truth? On logs that share no code with podusv.

    python -m benchmarks.coverage out.csv [--first 0] [--sets 120] [--workers N]

Set by set, a hull is drawn from the prior, and `plain_logs` makes four logs of 120 s of it. Rows,
what a log has of the actuator, GNSS, sea and hull come in turn, so that every value of each has the
same number of sets. out.csv has a line for every number and force of every set, also where the
search did not settle, podusv refused the hull or gave none at all;
`examples/reproduce/identify_coverage.py` makes a table of them. Sets that out.csv has already are
not made again, so a long run may be made in parts.
"""

from __future__ import annotations

import argparse
import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from pydantic import ValidationError

import podusv
from benchmarks import plain_logs
from podusv_cli.core.errors import UsageError
from podusv_cli.identify.answer import SIDE, Identification
from podusv_cli.identify.fit.estimate import OPEN
from podusv_cli.identify.fit.numbers import hull_numbers
from podusv_cli.identify.fit.records import FilterLog
from podusv_cli.identify.intake import logs_of
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.model import Scenario
from podusv_cli.workflows.identify import answer_logs

LOGS, DURATION = 4, 120.0
WANTED = Identify(logs=(LogFile(file="-"),))
# What a set may have, by factor.
FACTORS: dict[str, Sequence[Any]] = {
    "rows": (5, 10, 20, 50),  # 1/s
    "logged": ("commands", "shaft speeds", "forces"),
    "gnss": (0.02, 0.5, 1.0),  # m, white
    "sea": ("gusts", "wandering", "mean load", "none"),
    "hull": ("otter", "cybership2", "revolt", "cybership2 with rudders"),
}
ACTUATORS = {
    "otter": "otter",
    "cybership2": "cybership2_pod",
    "revolt": "revolt",
    "cybership2 with rudders": "cybership2_rudders",
}
LOAD, MEAN = 0.02, 0.08  # of full thrust: deviation of a load that wanders, and a mean load
TURN = 0.35  # rad, the largest angle that is asked for


@dataclass(frozen=True)
class CoverageSet:
    """A set of logs: its number, and its value of every factor."""

    number: int
    rows: int
    logged: str
    gnss: float
    sea: str
    hull: str


def coverage_set(number: int) -> CoverageSet:
    """The set with this number: of as many sets as a factor has values, each has another."""
    chosen = {}
    for place, (name, values) in enumerate(FACTORS.items()):
        turn, within = divmod(number, len(values))
        order = np.random.default_rng([place, turn]).permutation(len(values))
        chosen[name] = values[order[within]]
    return CoverageSet(number, **chosen)


def known_before(cell: CoverageSet) -> Scenario:
    """Hull and actuator as they are known before."""
    pods = {"kind": "pod", "preset": ACTUATORS[cell.hull]}
    return podusv.Scenario(
        name="coverage",
        vessel={"preset": cell.hull.split()[0]},
        actuator={"kind": "ideal"} if cell.logged == "forces" else pods,
        controller={"kind": "pid"},
        path={"kind": "line", "speed": 0.0},
        disturbance={"kind": "none"},
        identify=WANTED,
    )


def true_boat(
    before: Scenario, cell: CoverageSet, rng: np.random.Generator
) -> plain_logs.PlainBoat:
    """A boat whose hull is drawn from the prior, with the actuator's own numbers."""
    numbers = dict(before.vessel.constants())
    while True:
        factors = {
            n.name: math.exp(n.sd * rng.standard_normal())
            for n in hull_numbers(before.vessel, WANTED)
        }
        drawn = numbers | {n: numbers[n] * f for n, f in factors.items()}
        if drawn["m22"] * drawn["m33"] > 1.1 * drawn["m23"] ** 2:
            return plain_logs.PlainBoat(drawn, propellers(cell.hull))


def propellers(hull: str) -> list[plain_logs.Propeller]:
    """Those of the hull's actuator, by its numbers."""
    pods = podusv.Scenario(
        name="pods",
        vessel={"preset": hull.split()[0]},
        actuator={"kind": "pod", "preset": ACTUATORS[hull]},
        controller={"kind": "pid"},
        path={"kind": "line", "speed": 0.0},
        disturbance={"kind": "none"},
    ).actuator.pods
    found = []
    for pod in pods:
        turns = (
            {"angle_lag": pod.angle_lag, "angle_rate": pod.angle_rate} if pod.angle_limit else {}
        )
        rudder = {"lift": pod.rudder.lift, "stall": pod.rudder.stall} if pod.rudder else {}
        place = (pod.x, pod.y, pod.T_nn, pod.T_nn_astern, pod.n_max, pod.n_lag, pod.n_rate)
        found.append(plain_logs.Propeller(*place, **turns, **rudder))
    return found


def sea_of(cell: CoverageSet, most: float, arm: float, rng: np.random.Generator) -> plain_logs.Sea:
    """A current, and what else the set has; `most` is full thrust [N], `arm` half a length [m]."""
    way = rng.uniform(-math.pi, math.pi)
    flow = 0.08 * rng.uniform() * math.sqrt(arm)
    current = (flow * math.cos(way), flow * math.sin(way))
    sizes = np.array([most, most, most * arm])
    if cell.sea == "wandering":
        load = plain_logs.wandering_load(rng, DURATION, LOAD * sizes, 10.0)
        return plain_logs.Sea(current, load)
    if cell.sea == "mean load":
        to = rng.uniform(-math.pi, math.pi)
        shares = np.array([math.cos(to), math.sin(to), rng.uniform(-1.0, 1.0)])
        mean = (MEAN * sizes * shares).tolist()
        return plain_logs.Sea(current, lambda t: mean)
    if cell.sea == "gusts":  # nothing above 1.6 rad/s
        rates, phases = rng.uniform(0.05, 1.6, (8, 3)), rng.uniform(0.0, 2.0 * math.pi, (8, 3))
        part = LOAD * sizes / 2.0
        return plain_logs.Sea(
            current, lambda t: (part * np.sin(rates * t + phases).sum(axis=0)).tolist()
        )
    return plain_logs.Sea(current)


def write_logs(
    folder: Path, boat: plain_logs.PlainBoat, cell: CoverageSet, before: Scenario
) -> Iterator[Path]:
    """Four logs of a boat whose propellers and angles change every 4 to 12 s."""
    arm = 0.5 * before.vessel.length
    most = sum(p.ahead * p.top**2 for p in boat.propellers)
    period = 1.0 / cell.rows
    sensors = plain_logs.Sensors(gnss=cell.gnss, gnss_period=max(0.2, period), row=period)
    for i in range(LOGS):
        rng = np.random.default_rng([cell.number, i])
        asked = speeds_and_angles(boat, 0.3 + 0.2 * i, rng)
        motion = plain_logs.sail(boat, asked, DURATION, sea_of(cell, most, arm, rng))
        columns = plain_logs.columns_of(plain_logs.log_columns(motion, sensors, rng), cell.logged)
        if cell.hull == "revolt":  # whose speeds are parts of the full one
            columns = {re.sub("^n_", "n_part_", name): c for name, c in columns.items()}
        path = folder / f"{i}.csv"
        pd.DataFrame(columns).to_csv(path, index=False, float_format="%.9g")
        yield path


def read_logs(
    folder: Path, boat: plain_logs.PlainBoat, cell: CoverageSet, before: Scenario
) -> list[FilterLog]:
    """The logs of a boat, written into a folder, as the filter takes them."""
    return [
        log
        for path in write_logs(folder, boat, cell, before)
        for log in logs_of(path, LogFile(file=path.name, delay=0.0), before)
    ]


def speeds_and_angles(
    boat: plain_logs.PlainBoat, share: float, rng: np.random.Generator
) -> Callable[[float], Sequence[float]]:
    """Of all propellers speeds [1/s], then angles [rad], up to a share of full thrust.

    Propellers that turn or have rudders do as one.
    """
    top = np.array([p.top for p in boat.propellers]) * math.sqrt(share)
    if not boat.propellers[0].angle_lag:
        return plain_logs.steps_of(rng, -0.1 * top, top, 4.0)
    driven = plain_logs.steps_of(rng, (0.4, -TURN), (1.0, TURN), 4.0)

    def asked(t: float) -> list[float]:
        part, angle = driven(t)
        return [*(part * top), *(angle for _ in top)]

    return asked


def make_set(number: int) -> list[dict[str, Any]]:
    """A line for every number and force that comes out of a set, beside the truth."""
    cell, begun = coverage_set(number), time.process_time()
    before = known_before(cell)
    boat = true_boat(before, cell, np.random.default_rng([cell.number, 99]))
    try:
        with TemporaryDirectory() as folder:
            given = [(log, "fit") for log in read_logs(Path(folder), boat, cell, before)]
        answer = answer_logs(before, WANTED, given, None)
        lines = [*numbers_beside_truth(answer, boat), *forces_beside_truth(answer, boat)]
    except (UsageError, ValidationError, np.linalg.LinAlgError) as error:
        return [asdict(cell) | {"what": "none", "name": str(error)}]
    found, problem = answer.estimate, answer.problem
    of = {"settled": found.settled, "refused": bool(answer.refused_by), "rounds": found.rounds}
    of |= {"wander": problem.wander, "gusts": problem.gusts, "cpu": time.process_time() - begun}
    return [asdict(cell) | line | of for line in lines]


def numbers_beside_truth(
    answer: Identification, boat: plain_logs.PlainBoat
) -> Iterator[dict[str, Any]]:
    """Of every number of the hull: how far off in its own standard deviations."""
    for p in answer.parameters[: len(answer.problem.hull)]:
        truth = boat.number(p.name)
        sd = abs(math.log(p.high / p.low)) / (2.0 * SIDE)
        yield _line("number", p.name, truth, p, math.log(p.value / truth) / sd)


def forces_beside_truth(
    answer: Identification, boat: plain_logs.PlainBoat
) -> Iterator[dict[str, Any]]:
    """Of every damping force at speeds of the logs."""
    for f in answer.forces:
        place = ("X(u)", "Y(v)", "N(r)").index(f.force)
        nu = [0.0, 0.0, 0.0]
        nu[place] = f.at
        truth = boat.damping(*nu)[place]
        off = (f.value - truth) / ((f.high - f.low) / (2.0 * SIDE))
        yield _line("force", f.force, truth, f, off)


def _line(what: str, name: str, truth: float, found: Any, off: float) -> dict[str, Any]:
    low, high = sorted((found.low, found.high))
    ends = {"truth": truth, "value": found.value, "low": low, "high": high, "width": found.width}
    judged = {"off": off, "holds": low <= truth <= high, "determined": found.width <= OPEN}
    return {"what": what, "name": name, **ends, **judged}


def main() -> None:
    """Make the sets that are not there yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--sets", type=int, default=120)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    made = pd.read_csv(asked.out) if asked.out.exists() else pd.DataFrame()
    there = set(made.number) if len(made) else set()
    wanted = [n for n in range(asked.first, asked.first + asked.sets) if n not in there]
    with ProcessPoolExecutor(asked.workers) as pool:
        for lines in pool.map(make_set, wanted):
            made = pd.concat([made, pd.DataFrame(lines)], ignore_index=True)
            made.to_csv(asked.out, index=False, float_format="%.6g")


if __name__ == "__main__":
    main()
