"""How often laws fail with the model ship's numbers, and with those of their rules.

    .venv/bin/python -m benchmarks.default_gains [LAW]...

A table of docs/laws/gains.md: hulls that no rule was made on, at 10 Hz, on a line and on legs; and
of the legs, whose corners turn by 90 deg, how many runs fail at each speed.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
import yaml

from podusv_cli.components.vessels.vessel import COEFFICIENTS
from podusv_cli.core.component import Component
from podusv_cli.engine.running.batch import simulate_many
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.model import Scenario

LAWS: dict[str, dict[str, str]] = {
    name: {"kind": name}
    for name in (
        "velocity_vector",
        "momentum_vector",
        "los_pid",
        "alos",
        "adrc",
        "hand_position",
        "sliding_mode",
    )
} | {"ilos": {"kind": "alos", "learns": "integral"}}
# A preset, the full thrust of each of two fixed propellers [N] and their distance abeam [m].
BASES = (
    ("cybership1", 0.6, 0.1),
    ("otter", 120.0, 0.4),
    ("wamv", 200.0, 1.03),
    ("milliampere", 500.0, 1.0),
    ("paper_nonlinear", 4.0, 0.12),
    ("revolt", 25.0, 0.3),
)
SEED, DRAWS, SPREAD = 42, 2, (0.7, 1.3)
KEPT = ("beam", "x_g")  # numbers that are not drawn
SHARES = (0.3, 0.6, 0.9)  # of the speed at full thrust
LOADED = 0.6  # the largest share with a sway load
DRIFT = 0.1  # of the speed, to which the load brings the hull
LEG = 15.0  # lengths
STEP = 0.02  # s


class Hull(NamedTuple):
    """A vessel's numbers and its actuator."""

    name: str
    numbers: dict[str, float]
    actuator: dict[str, Any]


def hulls() -> Iterator[Hull]:
    """CyberShip I within its limits, then two draws of each base."""
    limits = {"kind": "saturated", "surge_limit": 0.9, "yaw_limit": 0.9}
    yield Hull("cybership1", _numbers("cybership1"), limits)
    rng = np.random.default_rng(SEED)
    for base, thrust, y in BASES:
        for place in range(DRAWS):
            usual = _numbers(base)
            drawn = {
                key: one if key in KEPT else one * rng.uniform(*SPREAD)
                for key, one in usual.items()
            }
            full, lag = thrust * rng.uniform(*SPREAD), rng.uniform(0.1, 0.5)
            pods = [_propeller(-0.4 * drawn["length"], side * y, full, lag) for side in (-1, 1)]
            yield Hull(f"{base} {place}", drawn, {"kind": "pod", "pods": pods})


def _numbers(name: str) -> dict[str, float]:
    text = (files("podusv_cli.components.vessels") / f"{name}.yaml").read_text("utf-8")
    return {k: float(v) for k, v in yaml.safe_load(text).items() if k in COEFFICIENTS}


def _propeller(x: float, y: float, thrust: float, lag: float) -> dict[str, float]:
    return {
        "x": x,
        "y": y,
        "T_nn": thrust,
        "T_nn_astern": 0.8 * thrust,
        "n_max": 1.0,
        "n_max_astern": 1.0,
        "n_rate": 10.0,
        "n_lag": lag,
        "angle_limit": 0.0,
        "angle_rate": 1.0,
        "angle_lag": 1.0,
    }


class Task(NamedTuple):
    """A run with the numbers of a law's rules, at a share of the speed at full thrust."""

    share: float
    scenario: Scenario


def tasks(hull: Hull, law: dict[str, str]) -> Iterator[Task]:
    """Every task of a law on a hull."""
    length, U = hull.numbers["length"], _scenario(hull, law, _line(1.0, 1.0, 1.0), 0.0).facts.U
    for share in SHARES:
        for loaded in (False, True) if share <= LOADED else (False,):
            speed, drift = share * U, DRIFT * share * U
            damping = -hull.numbers["Y_v"] - hull.numbers.get("Y_vv", 0.0) * drift
            load = damping * drift if loaded else 0.0
            yield Task(share, _scenario(hull, law, _line(speed, length, U), load))
            yield Task(share, _scenario(hull, law, _legs(speed, length), load))


def _scenario(hull: Hull, law: dict[str, str], task: dict[str, Any], load: float) -> Scenario:
    sea = {"kind": "step", "b_v": load} if load else {"kind": "none"}
    whole = {
        "name": "judged",
        "vessel": hull.numbers,
        "actuator": hull.actuator,
        "disturbance": sea,
        "controller": law,
        "control": {"period": 0.1},
        "metrics": {"steady_fraction": 0.2, "settling_radius": 0.5 * hull.numbers["length"]},
    }
    return load_text(json.dumps(whole | task), "judged.yaml").scenario


def _line(speed: float, length: float, U: float) -> dict[str, Any]:
    """From a length beside and behind, at half the speed."""
    return {
        "path": {"kind": "line", "speed": speed, "course": 0.7},
        "start": {"x": -length, "y": -length, "u": 0.5 * speed},
        "simulation": _during(min(max(150.0 * length / U, 60.0), 600.0)),
    }


def _legs(speed: float, length: float) -> dict[str, Any]:
    """Three legs, from a length beside the first, at rest."""
    side = LEG * length
    points = [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]]
    return {
        "path": {"kind": "legs", "speed": speed, "points": points},
        "start": {"y": length, "psi": 0.3},
        "simulation": _during(1.6 * 3.0 * side / speed + 20.0),
    }


def _during(time: float) -> dict[str, float]:
    return {"duration": round(time / 0.2) * 0.2, "step": STEP}


def of_the_model_ship(part: Component) -> Any:
    """The part with the model ship's numbers."""
    fields = type(part).model_fields
    return part.changed({name: fields[name].default for name in part.rules})


def outcome(scenario: Scenario) -> tuple[bool, float]:
    """Whether the run fails, and its error, rms over the length of the hull."""
    probe, length = scenario.probe(), scenario.vessel.length
    done = simulate_many([scenario.closed_loop()], scenario.time_grid(), probe=probe, workers=1)
    if done.status[0] != "finished":
        return True, float("inf")
    found = {name: float(numbers[0]) for name, numbers in probe.summaries(done.seen).items()}
    if scenario.path.follows:
        error = found["e_ct_rms"]
        return found["path_done"] < 1.0 or not error <= length, error / length
    return not found["e_steady"] <= 0.5 * length, found["z_e_steady"] / length


def judge(law: str) -> str:
    """A row of the table."""
    told: dict[str, list[tuple[bool, float]]] = {"model ship": [], "rule": []}
    corners: dict[float, list[bool]] = {share: [] for share in SHARES}
    for hull in hulls():
        for share, scenario in tasks(hull, LAWS[law]):
            usual = {
                name: of_the_model_ship(getattr(scenario, name)) for name in ("controller", "path")
            }
            told["model ship"].append(outcome(scenario.model_copy(update=usual)))
            told["rule"].append(outcome(scenario))
            if scenario.path.follows:
                corners[share].append(told["rule"][-1][0])
    failed = [np.mean([bad for bad, _ in runs]) for runs in told.values()]
    errors = [np.median([error for _, error in runs]) for runs in told.values()]
    return (
        f"| `{law}` | {failed[0]:.2f} -> {failed[1]:.2f} | {errors[0]:.2f} -> {errors[1]:.2f} | "
        f"{len(told['rule'])} runs | {' | '.join(map(_of_all, corners.values()))} |"
    )


def _of_all(failed: list[bool]) -> str:
    return f"{sum(failed)} of {len(failed)}"


if __name__ == "__main__":
    for name in sys.argv[1:] or LAWS:
        print(judge(name), flush=True)
