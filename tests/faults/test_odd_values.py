"""Odd values in place of every key: the scenario is sound, or each fault is told in a sentence."""

import copy
import random
import warnings
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from counts import count

from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.core.errors import PodusvError
from podusv_cli.engine.running.simulate import ready
from podusv_cli.findings.finding import preflight, unknown_codes
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import load_text
from podusv_cli.studies.making.check import sweep_faults
from podusv_cli.studies.making.plan import plan
from podusv_cli.studies.tuning.check import tune_faults

SEED = 20261123
TEXT = """
vessel: {preset: paper_nonlinear, m: 20.0}
path: {kind: waypoints, points: [[0, 0], [10, 5], [20, -5]], speed: 0.5}
disturbance:
- {kind: current, speed: 0.1, speed_std: 0.05}
- {kind: waves, height: 0.02, period: 1.0}
measurement: {kind: sensors, position: {period: 0.2, delay: 0.2, outages: [[0.2, 0.4]]}}
estimator: {kind: ekf}
actuator: {kind: saturated, surge_limit: 8.0, command: {delay: 0.1}}
controllers: {pid: {kind: pid, K_Pu: 10.0}, li: {kind: full_backstepping}}
start: {x: -1.0}
simulation: {duration: 1.0, step: 0.02}
metrics: {windows: {line: [0, 0.5]}, radii: {near: 1.0}}
claims: {C1: {says: a, source: b, expect: pid.iae < li.iae, given: finished(pid)}}
silence: [saturated]
sweep:
  draws: 40
  vary:
    vessel.m: {times: {uniform: [0.7, 1.3]}}
    moved: {keys: [start.x, start.y], normal: {sigma: 1, within: [-2, 2]}}
  success: finished
  keep: {failed: 1, worst: {iae: 1}, draws: [0]}
  claims: {S1: {says: a, source: b, expect: share(li.iae < pid.iae) >= 0.5}}
tune: {budget: 64, batch: 8, train: 4, objective: median(iae), space: {pid.K_Pu: {log: [1, 100]}}}
"""
ODD: list[Any] = [
    {},
    [],
    {"a": 1},
    {"kind": {"a": 1}},
    {"kind": []},
    [[]],
    [{}],
    None,
    "",
    " ",
    ".",
    "/",
    "nan",
    True,
    0,
    -1,
    -0.0,
    5e-324,
    1e160,
    1.7e308,
    -1e300,
    10**40,
    2**63,
    2**31,
    [1, "a"],
    [[0, 0], [1e200, 1e200]],
    [{"kind": "pid"}],
    {"x": {"y": []}},
    {"uniform": [0, 1e308]},
]
Place = tuple[Any, ...]


def places(data: Any, above: Place = ()) -> Iterator[Place]:
    """Every key and every place of a list."""
    inner = data.items() if isinstance(data, dict) else enumerate(data)
    for step, part in inner:
        yield (*above, step)
        if isinstance(part, (dict, list)):
            yield from places(part, (*above, step))


def altered(data: Any, place: Place, odd: Any) -> str:
    whole = copy.deepcopy(data)
    section = whole
    for step in place[:-1]:
        section = section[step]
    section[place[-1]] = odd
    return str(yaml.safe_dump(whole, sort_keys=False))


def verdict(text: str) -> str:
    """`ok`, or what is said of it; nothing is simulated or compiled."""
    try:
        checks = (unknown_codes, limits(), sweep_faults, tune_faults)
        loaded = load_text(text, "odd.yaml", (), checks)
        parse_claims(loaded)
        for single in loaded.scenario.singles().values():
            ready(single.plan(), compiled=False)
        preflight(loaded.scenario)
        if loaded.scenario.sweep:
            plan(loaded)
    except PodusvError as error:
        return str(error)
    return "ok"


@pytest.mark.slow
def test_an_odd_value_is_taken_or_told_in_a_sentence():
    base = yaml.safe_load(TEXT)
    assert verdict(TEXT) == "ok"
    every = [(place, odd) for place in places(base) for odd in range(len(ODD))]
    tries = random.Random(SEED).sample(every, min(len(every), count(60, 10_000)))
    said = []
    with warnings.catch_warnings(action="error"):
        for place, odd in tries:
            said.append(verdict(altered(base, place, ODD[odd])))
    assert len(tries) / 30 < said.count("ok") < len(tries) / 1.5
    assert all(line.isprintable() for text in said for line in text.splitlines())
