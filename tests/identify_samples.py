"""A boat whose logs are made by plain integration, and the problem of finding its hull."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import bundle
from podusv_cli.core.signal import STATE
from podusv_cli.identify.fit.estimate import estimate_hull, prior_kept
from podusv_cli.identify.fit.problem import FitProblem
from podusv_cli.identify.fit.records import log_of
from podusv_cli.identify.logs.reading import LogTable
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.load import load

LOGS = (LogFile(file="a.csv"),)
SCENARIO = load(
    "podusv:trials/base.yaml",
    [
        "vessel={preset: cybership2}",
        "actuator={kind: ideal}",
        "controller={kind: pid}",
        "name=boat",
    ],
).scenario
HULL = SCENARIO.vessel


def slope(k, tau, current=(0.0, 0.0)):
    """The hull's rate over ground, as plain Python: state, then load in the earth's frame."""

    def rate(_, s):
        c, n = math.cos(s[2]), math.sin(s[2])
        x = s[:6].copy()
        x[3] -= c * current[0] + n * current[1]
        x[4] -= c * current[1] - n * current[0]
        b = np.array([c * s[6] + n * s[7], c * s[7] - n * s[6], s[8]])
        out = np.zeros(6)
        plant(x, np.asarray(tau), b, k, out)
        out[0] = c * s[3] - n * s[4]
        out[1] = n * s[3] + c * s[4]
        # The water's velocity in the hull's frame turns with the hull.
        r = s[5]
        out[3] += r * (c * current[1] - n * current[0])
        out[4] -= r * (c * current[0] + n * current[1])
        return np.concatenate([out, np.zeros(3)])

    return rate


def motion(commands, times, start, hull=HULL, current=(0.0, 0.0), load=(0.0, 0.0, 0.0)):
    """States at times, with commands held from each to the next, by another integrator."""
    k, states = bundle(hull.constants()), [np.concatenate([start, load])]
    for i in range(len(times) - 1):
        span = times[i], times[i + 1]
        ended = solve_ivp(slope(k, commands[i], current), span, states[-1], rtol=1e-9, atol=1e-11)
        states.append(ended.y[:, -1])
    return np.array(states)[:, :6]


def commands_of(times, seed=0):
    """Force and moment that change every 4 s, with some that stay."""
    rng = np.random.default_rng(seed)
    count = int(times[-1] // 4.0) + 1
    u, r = rng.uniform(0.5, 4.0, count), rng.uniform(-0.6, 0.6, count)
    at = (times // 4.0).astype(int)
    return np.column_stack([u[at], np.zeros(len(times)), r[at]])


def table_of(times, states, commands, *, noise=(0.01, 0.005, 0.002), seed=1, name="a.csv"):
    """A log with pose and yaw rate measured."""
    rng = np.random.default_rng(seed)
    sigma = dict(zip(("x", "y", "psi", "r"), (noise[0], *noise), strict=True))
    names = [signal.name for signal in STATE]
    columns = {
        n: states[:, names.index(n)] + sigma[n] * rng.standard_normal(len(times)) for n in sigma
    }
    columns |= {"tau_u": commands[:, 0], "tau_r": commands[:, 2]}
    return LogTable(name, times, columns)


def made_logs():
    """Three logs at 5 Hz, of different commands, in a current that the first two have."""
    logs = []
    for i, current in enumerate([(0.05, -0.03), (0.0, 0.04), (0.0, 0.0)]):
        times = np.arange(0.0, 90.0, 0.2)
        commands = commands_of(times, seed=i)
        states = motion(commands, times, np.array([1.0, -2.0, 3.0, 0.4, 0, 0]), current=current)
        logs.append(log_of(table_of(times, states, commands, seed=i, name=f"{i}"), Ideal(), 0.1))
    return logs


def problem(logs, vessel=HULL, **wanted):
    """The problem of logs, by default with the wide prior of a hull that is guessed."""
    scenario = SCENARIO.model_copy(update={"vessel": vessel, "nominal": vessel})
    return FitProblem(scenario, Identify(logs=LOGS, **wanted), logs)


def fitted(given):
    return prior_kept(given.search, estimate_hull(given.search))
