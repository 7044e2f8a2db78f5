"""Tables behind results/claim.md: a law that is told a wrong vessel, sampled control, and f_hat.

    python examples/reproduce/claim.py unknown | discrete | limits | learnt | gains | networks

Each prints a CSV table. The scenarios are those of configs/mu_2017; every number comes from a run.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd

from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.network import activation
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.engine.running.replay import rates_replay
from podusv_cli.findings.stability import loops, sampled_growth
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario
from podusv_cli.theory.ideal_weights import unloaded_accelerations
from podusv_cli.theory.loop_margins import loop_margins
from podusv_cli.workflows.execute import Stopwatch, simulate_case

Item, Value = TypeVar("Item"), TypeVar("Value")
PAPER = Path(__file__).parents[2] / "configs/mu_2017"
READINGS = {
    "F": "figures_compare.yaml",
    "S": "figures_compare_standoff.yaml",
    "C": "corrected_compare.yaml",
}
# Laws beside the paper's four: the proposed one without its network and bounds.
OFF = "kind: adaptive_neural, Gamma_u: 0, Gamma_r: 0, gamma_u: 0, gamma_r: 0"
WITHOUT = {"no_adaptation": f"{{{OFF}}}", "equal_gain": f"{{{OFF}, k_ue: 13208, k_re: 191}}"}
SIDES = {"nominal": "told", "vessel": "true"}
# Keys of a vessel that are multiplied by the same factor.
SCALED = {
    "mass": ("m", "X_udot", "Y_vdot"),
    "inertia": ("I_z", "N_rdot"),
    "damping": (
        "X_u",
        "X_uu",
        "X_uuu",
        "Y_v",
        "Y_vv",
        "Y_rv",
        "Y_r",
        "Y_vr",
        "Y_rr",
        "N_v",
        "N_vv",
        "N_rv",
        "N_r",
        "N_vr",
        "N_rr",
    ),
}
SCALED["all of it"] = tuple(key for keys in SCALED.values() for key in keys)
FACTORS = (0.7, 0.85, 1.15, 1.3, 1.5)
STEP = 0.0005  # s, of the sampled runs
PERIODS = (2, 4, 10, 20, 40)  # steps: 0.001 to 0.02 s
DIFFERENCE = 0.01  # s
UPDATES = ("after", "before")  # the demand is formed; when the law's memory takes a sample
# kg/s in surge by kg m2/s in yaw; the last has those on which the network settles
GAINS = {100: 80, 200: 80, 400: 80, 800: 80, 1100: 80, 6660: 116, 13208: 191}
LEAKAGES = (0.03, 0.1, 0.3, 1.0, 3.0)  # sigma_u
FIXED = (500, 2000, 8000, 32000)  # kg/s
LONGEST = 400  # steps of STEP: 0.2 s
GROWS = 1 + 1e-9
SETTLED = 0.8  # of the run, from where it counts as settled


def laws(config: str, *overrides: str) -> dict[str, Scenario]:
    """The scenario's laws by label."""
    return load(PAPER / config, overrides).scenario.singles()


def made(scenario: Scenario) -> tuple[dict[str, float], Recording]:
    """Metrics and log of a run."""
    case = Case.of(scenario)
    recording = simulate_case(case, Stopwatch())
    seen = recording.seen
    assert seen is not None  # the probe saw it
    return case.plan.probe.summary(seen), recording


def errors(scenario: Scenario) -> dict[str, float]:
    """Errors beyond the standoff, over the run and settled; NaN where the run diverges."""
    metrics, recording = made(scenario)
    finished = recording.status == "finished"
    return {name: metrics[name] if finished else np.nan for name in ("iae_e", "e_steady")}


def parallel(work: Callable[[Item], Value], runs: Sequence[Item]) -> list[Value]:
    """What the work gives for each run, in as many processes as there are cores."""

    def job(item: Item, progress: object) -> Value:
        return work(item)

    outcomes = run_all([partial(job, run) for run in runs], lambda *_: None)
    if failures := [outcome.failure for outcome in outcomes if outcome.failure]:
        raise RuntimeError(failures[0])
    return [outcome.result for outcome in outcomes]


def mismatched(scenario: Scenario) -> Iterator[tuple[str, Scenario]]:
    """The scenario as it is, with its law told wrong numbers, and with another true vessel."""
    yield "as it is", scenario
    other = load(PAPER / READINGS["C"], ["vessel.preset=cybership2"]).scenario.vessel
    yield "told CyberShip II", scenario.model_copy(update={"nominal": other})
    yield "true CyberShip II", scenario.model_copy(update={"vessel": other})
    for side in ("nominal", "vessel"):  # what the law is told, and the hull that moves
        for what, keys in SCALED.items():
            for factor in FACTORS:
                numbers = {key: factor * getattr(scenario.vessel, key) for key in keys}
                other = getattr(scenario, side).model_copy(update=numbers)
                name = f"{SIDES[side]} {what} {100 * (factor - 1):+.0f} %"
                yield name, scenario.model_copy(update={side: other})


def unknown() -> pd.DataFrame:
    """Errors of every law in the corrected reading where it is told a wrong vessel."""
    keys = [f"controllers.{name}={law}" for name, law in WITHOUT.items()]
    keys += ["simulation.step=0.002", "log.every=5", "log.monitor=false"]
    runs = {
        (name, label): run
        for label, single in laws(READINGS["C"], *keys).items()
        for name, run in mismatched(single)
    }
    found = pd.DataFrame(parallel(errors, list(runs.values())))
    found.index = pd.MultiIndex.from_tuples(runs, names=["case", "law"])
    return found


def sampled(config: str, count: int, update: str) -> dict[str, Scenario]:
    """The laws sampled once in so many steps; 0 for continuous control.

    `update` is when the law's memory takes the sample: after or before the demand is formed.
    Remark 5's difference is formed over 0.01 s, rounded up to a whole number of samples.
    """
    period = count * STEP
    difference = math.ceil(DIFFERENCE / period - 1e-9) * period if count else DIFFERENCE
    return laws(
        config,
        f"simulation.step={STEP}",
        f"control.period={period:.9g}",
        f"controller.difference_step={difference:.9g}",
        f"control.update={update}",
        "log.every=10",
        "log.monitor=false",
    )


def cycle(scenario: Scenario) -> dict[str, float]:
    """Half the settled surge demand's range [N], energy [J] and IAE [m s]; NaN after divergence."""
    metrics, log = made(scenario)
    if log.status != "finished":
        return dict.fromkeys(("cycle_N", "energy_J", "iae_m_s"), np.nan)
    demand = log["tau_u_cmd"][int(SETTLED * len(log["time"])) :]
    return {"cycle_N": np.ptp(demand) / 2, "energy_J": metrics["energy"], "iae_m_s": metrics["iae"]}


def predicted(scenario: Scenario) -> float:
    """The longest period [s] at which the settled run's linearised velocity loops are stable."""
    _, log = made(scenario)
    late = slice(int(SETTLED * len(log["time"])), None)
    found = loops(scenario, np.array([np.mean(log[name][late]) for name in "uvr"]))
    counts = range(1, LONGEST + 1)
    first = scenario.time_grid().update_first
    unstable = (
        n
        for n in counts
        if any(sampled_growth(loop, STEP, n, update_first=first) > GROWS for loop in found)
    )
    return (next(unstable, LONGEST + 1) - 1) * STEP


def longest(config: str, label: str, update: str) -> float:
    """The longest stable period [s]: no settled cycle beyond twice that of continuous control."""
    allowed = 2 * cycle(sampled(config, 0, update)[label])["cycle_N"]
    low, high = 0, LONGEST
    while high - low > 1:
        middle = (low + high) // 2
        stable = cycle(sampled(config, middle, update)[label])["cycle_N"] <= allowed
        low, high = (middle, high) if stable else (low, middle)
    return low * STEP


def discrete() -> pd.DataFrame:
    """Settled cycle, energy and IAE of every law and reading over the control period."""
    cases = {
        (reading, label, update, count * STEP): single
        for reading, config in READINGS.items()
        for update in UPDATES
        for count in (0, *PERIODS)
        for label, single in sampled(config, count, update).items()
    }
    index = pd.MultiIndex.from_tuples(cases, names=["reading", "law", "update", "period_s"])
    return pd.DataFrame(parallel(cycle, list(cases.values())), index=index)


def limits() -> pd.DataFrame:
    """The longest stable period [s], found by bisection and predicted by the linearised loops."""
    cases = [
        (reading, label, update)
        for reading, config in READINGS.items()
        for label in laws(config)
        for update in UPDATES
    ]

    def both(case: tuple[str, str, str]) -> dict[str, float]:
        reading, label, update = case
        single = sampled(READINGS[reading], 0, update)[label]
        found = longest(READINGS[reading], label, update)
        return {"predicted_s": predicted(single), "found_s": found}

    index = pd.MultiIndex.from_tuples(cases, names=["reading", "law", "update"])
    return pd.DataFrame(parallel(both, cases), index=index)


def learnt() -> pd.DataFrame:
    """What the networks learn: the settled rms of f_hat less f, and less f + b/m."""
    rows = {}
    for reading, config in READINGS.items():
        single = laws(config)["adaptive_neural"]
        _, log = made(single)
        loop = single.closed_loop()
        unloaded = unloaded_accelerations(loop, rates_replay(single.plan())(log))
        for axis, f, m in zip("ur", unloaded, (loop.vessel.m11, loop.vessel.m33), strict=True):
            f_hat, lump = log[f"f_hat_{axis}"], f + log[f"b_{axis}"] / m
            found = {
                "f": f,
                "f + b/m": lump,
                "f_hat - f": f_hat - f,
                "f_hat - (f + b/m)": f_hat - lump,
            }
            rows[reading, axis] = {name: settled_rms(signal) for name, signal in found.items()}
    return pd.DataFrame(rows).T.rename_axis(["reading", "axis"])


def gains() -> pd.DataFrame:
    """Fixed velocity gains instead of the network: errors, and settled rms of u_e and r_e."""
    keys = {f"k_{k}": f"{{{OFF}, k_ue: {k}, k_re: {yaw}}}" for k, yaw in GAINS.items()}
    told = [f"controllers.{name}={law}" for name, law in keys.items()]
    told += ["simulation.step=0.002", "log.every=5", "log.monitor=false"]
    runs = {
        (reading, label): single
        for reading, config in READINGS.items()
        for label, single in laws(config, *told).items()
        if label in keys or label == "adaptive_neural"
    }
    index = pd.MultiIndex.from_tuples(runs, names=["reading", "law"])
    return pd.DataFrame(parallel(velocity_errors, list(runs.values())), index=index)


def networks() -> pd.DataFrame:
    """Networks of three sizes with five leakages, and fixed gains of the size that they act as.

    `gain` is k_ue + m11^2 |Phi|^2/sigma_u with the settled mean of |Phi|^2; `product` is gain times
    the settled rms of u_e, which does not change if the network acts as that gain.
    """
    told = {
        (
            nodes**3,
            sigma,
        ): f"{{kind: adaptive_neural, network: {{nodes: [{nodes}, {nodes}, {nodes}]}}, "
        f"sigma_u: {sigma}}}"
        for nodes in (2, 3, 5)
        for sigma in LEAKAGES
    }
    told |= {(0, gain): f"{{{OFF}, k_ue: {gain}, k_re: 191}}" for gain in FIXED}
    names = {key: f"case_{place}" for place, key in enumerate(told)}
    sets = [f"controllers.{names[key]}={law}" for key, law in told.items()]
    every = laws(READINGS["C"], *sets, "simulation.step=0.002", "log.every=5", "log.monitor=false")
    index = pd.MultiIndex.from_tuples(told, names=["nodes", "sigma_u_or_gain"])
    cases = [every[name] for name in names.values()]
    return pd.DataFrame(parallel(acting_as, cases), index=index)


def acting_as(scenario: Scenario) -> dict[str, float]:
    """The gain that a law's network acts as in surge, the settled rms of u_e, and their product.

    With the margins of the surge loop.
    """
    _, log = made(scenario)
    settled = slice(int(SETTLED * len(log["time"])), None)
    nu = np.stack([log[name][settled] for name in "uvr"], axis=1)
    law, hull = scenario.controller, scenario.closed_loop().nominal
    assert isinstance(law, AdaptiveNeural)
    phi2 = float(np.mean(np.sum(activation(law.network, nu) ** 2, axis=1)))
    gain = law.k_ue + (hull.m11**2 * phi2 / law.sigma_u if law.Gamma_u else 0.0)
    error = settled_rms(log["u_e"])
    numbers = {"phi2": phi2, "gain": gain, "rms_u_e": error, "product": gain * error}
    surge = loop_margins(scenario.closed_loop(), scenario.time_grid()).loops["surge"]
    return numbers | {
        "phase_margin_deg": math.degrees(surge.phase_margin),
        "delay_margin_ms": 1e3 * surge.delay_margin,
    }


def velocity_errors(scenario: Scenario) -> dict[str, float]:
    """Errors of a run, with those of the velocities."""
    metrics, log = made(scenario)
    if log.status != "finished":
        return dict.fromkeys(("iae_e", "e_steady", "rms_u_e", "rms_r_e"), np.nan)
    return {
        "iae_e": metrics["iae_e"],
        "e_steady": metrics["e_steady"],
        "rms_u_e": settled_rms(log["u_e"]),
        "rms_r_e": settled_rms(log["r_e"]),
    }


def settled_rms(signal: Vector) -> float:
    """Root mean square over the settled part."""
    return float(np.sqrt(np.mean(signal[int(SETTLED * len(signal)) :] ** 2)))


TABLES: Mapping[str, Callable[[], pd.DataFrame]] = {
    "unknown": unknown,
    "discrete": discrete,
    "limits": limits,
    "learnt": learnt,
    "gains": gains,
    "networks": networks,
}

if __name__ == "__main__":
    TABLES[sys.argv[1]]().to_csv(sys.stdout, float_format="%.6g", lineterminator="\n")
