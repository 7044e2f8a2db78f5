"""Positions whose error wanders and a compass that is off: seen, looked for, and what it takes."""

from __future__ import annotations

import math
from itertools import product
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from identify_samples import HULL, commands_of, fitted, motion, problem, table_of
from rotation import one_in

import podusv
from benchmarks import plain_logs
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.estimators.ekf import ExtendedKalmanFilter
from podusv_cli.identify.answer import Identification
from podusv_cli.identify.fit.beside import PLAIN, SIZE, entry
from podusv_cli.identify.fit.estimate import HullEstimate, directions
from podusv_cli.identify.fit.march import (
    APART,
    COMMANDS,
    DELIVERED,
    HOLDS,
    NAMES,
    VALUES,
    FilterRecord,
    side_by_side,
)
from podusv_cli.identify.fit.records import log_of
from podusv_cli.identify.fit.sensing import position_wandering
from podusv_cli.identify.phrases import summary

K = {
    **HULL.constants(),
    **ExtendedKalmanFilter(sigma_p=0.03, sigma_u=0.05, sigma_v=0.06, q_u=0.1, q_b=0.2).constants(),
    **{
        "dead_band": 0.0,
        "thrust_exponent": 2.0,
        "thrust": 0.9,
        "delay": 0.07,
        "current_x": 0.2,
        "current_y": -0.1,
    },
    **{"mean_x": 0.7, "mean_y": -0.4, "mean_psi": 0.2},
    **{"s_g": 0.4, "T_g": 3.7, "w_b": 1.9, "z_b": 0.3, "compass": 0.08},
}


def mean_sign(x, variance):
    """The sign of a number that is known so well."""
    return x / math.sqrt(x * x + 0.5 * math.pi * variance)


def rates_and_slopes(x, P, tau, k):
    """Right-hand sides of all numbers and their derivatives, by matrices.

    They are the nine of the filter, two errors of positions, three rates of loads.
    """
    _, _, psi, u, v, r = x[:6]
    c, s = math.cos(psi), math.sin(psi)
    M = np.array([[k["m11"], 0, 0], [0, k["m22"], k["m23"]], [0, k["m32"], k["m33"]]])
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    nu, V, W = np.array([u, v, r]), abs(v), abs(r)
    momentum = k["m22"] * v + k["m23"] * r
    coriolis = np.array([momentum * r, -k["m11"] * u * r, k["m11"] * u * v - momentum * u])
    D = np.array(
        [
            [k["X_u"] + k["X_uu"] * abs(u) + k["X_uuu"] * u * u, 0.0, 0.0],
            [
                0.0,
                k["Y_v"] + k["Y_vv"] * V + k["Y_rv"] * W,
                k["Y_r"] + k["Y_vr"] * V + k["Y_rr"] * W,
            ],
            [
                0.0,
                k["N_v"] + k["N_vv"] * V + k["N_rv"] * W,
                k["N_r"] + k["N_vr"] * V + k["N_rr"] * W,
            ],
        ]
    )
    f = np.zeros(14)
    f[:3] = R @ nu
    f[3:6] = np.linalg.solve(M, k["coriolis"] * coriolis + D @ nu + tau + R.T @ x[6:9])
    f[6:9] = k["gusts"] * x[11:]
    f[9:11] = -x[9:11] / k["T_g"]
    means = np.array([k["mean_x"], k["mean_y"], k["mean_psi"]])
    fades, stiff = 2.0 * k["z_b"] * k["w_b"], k["gusts"] * k["w_b"] ** 2
    f[11:] = -fades * x[11:] - stiff * (x[6:9] - means)
    sv, sr = mean_sign(v, P[4, 4]), mean_sign(r, P[5, 5])
    by_nu = D.copy()
    by_nu[0, 0] += k["X_uu"] * abs(u) + 2.0 * k["X_uuu"] * u * u
    for row, a in ((1, "Y"), (2, "N")):
        by_nu[row, 1] += k[a + "_vv"] * V + k[a + "_vr"] * sv * r
        by_nu[row, 2] += k[a + "_rr"] * W + k[a + "_rv"] * sr * v
    m11, m22, m23 = k["m11"], k["m22"], k["m23"]
    by_nu += k["coriolis"] * np.array(
        [
            [0.0, m22 * r, m22 * v + 2.0 * m23 * r],
            [-m11 * r, 0.0, -m11 * u],
            [(m11 - m22) * v - m23 * r, (m11 - m22) * u, -m23 * u],
        ]
    )
    F = np.zeros((14, 14))
    F[0:3, 3:6] = R
    F[0, 2], F[1, 2] = -s * u - c * v, c * u - s * v
    F[3:6, 3:6] = np.linalg.solve(M, by_nu)
    turned = np.array([[-s, c, 0], [-c, -s, 0], [0, 0, 0]])
    F[3:6, 2] = np.linalg.solve(M, turned @ x[6:9])
    F[3:6, 6:9] = np.linalg.solve(M, R.T)
    F[6:9, 11:], F[11:, 6:9] = k["gusts"] * np.eye(3), -stiff * np.eye(3)
    F[9:11, 9:11] = -np.eye(2) / k["T_g"]
    F[11:, 11:] = -fades * np.eye(3)
    return f, F


def marched(x, P, tau, h, k):
    """One step of classical RK4 of estimate and covariance."""
    moving, *loads = (
        np.square([k[q] for q in names])
        for names in (("q_u", "q_v", "q_r"), ("q_b", "q_b", "q_b_psi"))
    )
    loads = np.array(loads[0])
    walks, rates = loads * (1.0 - k["gusts"]), loads * k["gusts"] * k["w_b"] ** 2
    errors = [2.0 * k["wandering"] * k["s_g"] ** 2 / k["T_g"]] * 2
    Q = np.diag([0.0, 0.0, 0.0, *moving, *walks, *errors, *rates])

    def rate(x, P):
        f, F = rates_and_slopes(x, P, tau, k)
        return f, F @ P + P @ F.T + Q

    a = rate(x, P)
    b = rate(x + 0.5 * h * a[0], P + 0.5 * h * a[1])
    c = rate(x + 0.5 * h * b[0], P + 0.5 * h * b[1])
    d = rate(x + h * c[0], P + h * c[1])
    return tuple(
        old + h / 6.0 * (p + 2.0 * q + 2.0 * r + s)
        for old, p, q, r, s in zip((x, P), a, b, c, d, strict=True)
    )


def corrected(x, P, line, since, k):
    """What a row delivers taken in, one value after the other; innovations and variances."""
    found = []
    sigma = [k[f"sigma_{s}"] for s in ("p", "p", "psi", "u", "v", "r")]
    wx, wy = k["current_x"], k["current_y"]
    for i in np.flatnonzero(line[DELIVERED : DELIVERED + 6]):
        c, s = math.cos(x[2]), math.sin(x[2])
        h, expected = np.zeros(14), x[i]
        h[i] = 1.0
        if i < 2:
            h[9 + i] = k["wandering"]
            expected += x[9 + i] + since * (wx, wy)[i]
        elif i == 2:
            expected += k["compass"]
        elif i == 3:
            expected += c * wx + s * wy
            h[2] = c * wy - s * wx
        elif i == 4:
            expected += c * wy - s * wx
            h[2] = -(c * wx + s * wy)
        nu, S = line[VALUES + i] - expected, h @ P @ h + sigma[i] ** 2
        gain = P @ h / S
        x, P = x + gain * nu, P - np.outer(gain, h @ P)
        found.append((nu, S))
    return x, P, found


@pytest.mark.parametrize(("wandering", "gusts"), [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
def test_the_filter_with_more_than_its_own_numbers_is_that_of_plain_numpy(wandering, gusts):
    """All numbers in one matrix, by algebra of matrices: the likelihood to nine digits."""
    k = K | {"wandering": wandering, "gusts": gusts}
    rng = np.random.default_rng(4)
    rows = np.zeros((300, COMMANDS + 9))
    rows[:, HOLDS] = rng.uniform(0.03, 0.11, 300)
    rows[:, DELIVERED : DELIVERED + 6] = rng.integers(0, 2, (300, 6))
    rows[:, VALUES : VALUES + 6] = rng.normal(0.0, 0.3, (300, 6))
    rows[:, COMMANDS:] = rng.normal(0.0, 1.0, (300, 9))
    x = np.append(rng.normal(0.0, 0.3, 9), np.zeros(5))
    beside = [0.16 * wandering, 0.25 * wandering, *(gusts * np.array([0.3, 0.2, 0.1]))]
    P = np.diag([*rng.uniform(1e-3, 4e-2, 9), *beside])
    start = np.zeros(SIZE)
    start[:9], start[9:54] = x[:9], P[:9, :9][np.triu_indices(9)]
    start[[PLAIN + entry(a, a) for a in range(5)]] = beside
    count = int(rows[:, DELIVERED : DELIVERED + 6].sum())
    run = side_by_side(Ideal())(
        FilterRecord(rows, count), [np.array([k[n] for n in NAMES])], [start], True
    )
    expected, since = [], 0.0
    part = k["delay"] / APART
    for line in rows:
        seen = x[:2] + x[9:11]
        x, P, found = corrected(x, P, line, since, k)
        expected += found
        early, now, late = line[COMMANDS:].reshape(3, 3).T
        tau = now + 0.5 * part * (late - early) + 0.5 * part**2 * (late - 2.0 * now + early)
        x, P = marched(x, P, k["thrust"] * tau, line[HOLDS], k)
        since += line[HOLDS]
    nu, S = np.array(expected).T
    assert run.innovations[:, 0] == pytest.approx(nu, rel=1e-9, abs=1e-9)
    likelihood = np.sum(nu**2 / S + np.log(S))
    own = np.sum(run.innovations**2 / run.variances + np.log(run.variances))
    assert own == pytest.approx(likelihood, rel=1e-9)
    assert run.track[-1, :2, 0] == pytest.approx(seen, rel=1e-9)  # where a receiver sees the boat


def positions(times, x, y):
    """A log of positions alone, as `position_wandering` looks at it."""
    rows = np.zeros((len(times), COMMANDS))
    rows[:, DELIVERED : DELIVERED + 2] = 1.0
    rows[:, VALUES], rows[:, VALUES + 1] = x, y
    return SimpleNamespace(times=times, record=FilterRecord(rows, 2 * len(rows)))


def turns(times, radius, rate):
    return radius * np.cos(rate * times), radius * np.sin(rate * times)


@pytest.mark.parametrize(
    ("h", "duration"), one_in(3, [*product((0.1, 0.2, 0.5, 1.0), (120.0, 600.0))], 2)
)
def test_no_white_error_looks_as_if_it_wandered(h, duration):
    times = np.arange(0.0, duration, h)
    rng = np.random.default_rng(int(10 * h + duration))
    for _ in range(100):
        log = positions(times, *rng.standard_normal((2, len(times))))
        assert not position_wandering([log]).is_sure


@pytest.mark.parametrize("h", [0.1, 0.2, 1.0])
@pytest.mark.parametrize("white", [0.02, 0.5])
def test_no_motion_looks_as_if_positions_wandered(h, white):
    """A boat of 2 m goes round at 1.5 m/s, and an acceleration changes every 7 s."""
    times = np.arange(0.0, 300.0, h)
    rng = np.random.default_rng(7)
    pushes = 0.3 * (-1.0) ** (times // 7.0)
    sprints = np.cumsum(np.cumsum(pushes) * h) * h
    for x, y in (turns(times, 5.0, 0.3), turns(times, 2.5, 0.6), (sprints, 0.4 * sprints)):
        noise = white * rng.standard_normal((2, len(times)))
        found = position_wandering([positions(times, x + noise[0], y + noise[1])])
        assert not found.is_sure


@pytest.mark.parametrize(
    ("h", "sd", "lasting", "white"),
    [
        (0.1, 2.1, 30.0, 0.5),
        (0.2, 2.1, 30.0, 0.5),
        (0.2, 2.1, 30.0, 0.0),
        (0.2, 0.5, 20.0, 0.02),
        (0.7, 2.1, 30.0, 0.1),
        (1.0, 2.1, 30.0, 0.1),
    ],
)
def test_an_error_that_wanders_is_seen_with_its_rate(h, sd, lasting, white):
    """s^2/T of a known process, beside a motion and a white error."""
    times = np.arange(0.0, 600.0, h)
    rng = np.random.default_rng(2)
    x, y = turns(times, 8.0, 0.15)
    wanders = [plain_logs.wander(rng, len(times), h, sd, lasting) for _ in range(2)]
    noise = white * rng.standard_normal((2, len(times)))
    log = positions(times, x + wanders[0] + noise[0], y + wanders[1] + noise[1])
    found = position_wandering([log])
    assert found.is_sure
    assert found.rate == pytest.approx(sd**2 / lasting, rel=0.35)


def boat_log(noise, *, compass=0.0, wander=0.0, seed=3):
    """120 s of the model ship with RTK, or with positions that wander and a compass that is off."""
    times = np.arange(0.0, 120.0, 0.2)
    commands = commands_of(times, seed=seed)
    states = motion(commands, times, np.array([0.0, 0.0, 0.3, 0.4, 0.0, 0.0]))
    states[:, 2] += compass
    rng = np.random.default_rng(seed)
    for i in range(2):
        states[:, i] += plain_logs.wander(rng, len(times), 0.2, wander, 30.0) if wander else 0.0
    return log_of(table_of(times, states, commands, noise=noise, seed=seed), Ideal(), 0.1)


@pytest.mark.long
def test_which_numbers_are_looked_for():
    """By the logs, unless the deviation is given; 0 looks for none."""
    calm, wandering = boat_log((0.01, 0.005, 0.002)), boat_log((0.01, 0.005, 0.002), wander=1.0)

    def names(log, **noise):
        return [n.name for n in problem([log], noise=noise).numbers]

    assert not {"s_g", "T_g"} & {*names(calm)}
    noisy = [boat_log((0.1, 0.005, 0.002), seed=seed) for seed in range(6)]
    assert max(problem([log]).wandering.rate for log in noisy) > 0.0  # by chance
    assert not any("s_g" in names(log) for log in noisy)
    assert {"s_g", "T_g", "compass"} <= {*names(wandering)}
    assert not {"s_g", "T_g"} & {*names(wandering, wander=0.0)}
    assert {"T_g"} == {"s_g", "T_g"} & {*names(calm, wander=0.5)}
    assert "compass" not in names(calm, compass=0.0)
    given = problem([wandering])
    assert given.wander == pytest.approx(1.0, rel=0.5)
    assert given.position_noise(np.zeros(len(given.numbers))) > 0.5


@pytest.mark.long
def test_a_hull_comes_out_beside_positions_that_wander_and_a_compass_that_is_off():
    """Two numbers that begin 30 to 40 % off, from 240 s; the errors come out with them."""
    logs = [boat_log((0.01, 0.005, 0.002), compass=0.09, wander=0.8, seed=seed) for seed in (3, 4)]
    off = HULL.changed({"N_r": 1.4 * HULL.N_r, "X_udot": HULL.X_udot - 8.0})
    given = problem(logs, off, free=("m11", "N_r"), prior=0.5, current=0.0)
    found = fitted(given)
    sd = np.sqrt(np.diag(found.covariance))
    truth = {**HULL.constants(), "s_g": 0.8, "T_g": 30.0, "compass": 0.09}
    values = given.values(found.y)
    for number, width in zip(given.numbers, sd, strict=True):
        if number.name in truth and number.name[:5] != "sigma":
            exact, ratio = (
                truth[number.name],
                math.log(abs(values[number.name] / truth[number.name])),
            )
            miss = ratio if number.ratio else values[number.name] - exact
            assert abs(miss) < 3.0 * number.sd * width, number.name
    assert values["compass"] == pytest.approx(0.09, abs=0.03)
    assert values["N_r"] == pytest.approx(HULL.N_r, rel=0.06)
    answer = Identification(given, found, directions(found.covariance, 2), (), ())
    words = " ".join(summary(answer))
    assert f"looked for beside the hull: {values['s_g']:.2g} m (" in words
    assert f"The compass shows {math.degrees(values['compass']):.2g} deg (" in words


def test_what_was_not_looked_for_is_said():
    given = problem([boat_log((0.01, 0.005, 0.002))], free=("m11",), draws=5)
    size = len(given.numbers)
    found = HullEstimate(np.zeros(size), 0.0, np.eye(size), 1, True)
    words = " ".join(summary(Identification(given, found, directions(np.eye(size), 1), (), ())))
    assert "Third differences of the positions show no error that wanders" in words


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_an_owners_log_gives_a_hull_that_predicts_better(tmp_path, seed):
    """Ten minutes of a consumer's GNSS, by a simulator that shares no code with podusv's."""
    kept = plain_logs.columns_of(plain_logs.owners_log(seed), "commands")
    pd.DataFrame(kept).to_csv(tmp_path / "owner.csv", index=False, float_format="%.7g")
    (tmp_path / "owner.yaml").write_text(
        "vessel: {preset: otter, X_u: -40.0, X_uu: -25.0}\npath: {kind: line, speed: 0.0}\n"
        "disturbance: {kind: none}\ncontroller: {kind: pid}\nactuator: {kind: pod, preset: otter}\n"
        "identify:\n  logs:\n    - {file: owner.csv, span: [0, 420]}\n"
        "    - {file: owner.csv, span: [420, 601], role: judge}\n"
    )
    hull = podusv.identify(tmp_path / "owner.yaml", out=tmp_path / "hull", figures=False)
    judged = hull.scores[(hull.scores.role == "judge") & (hull.scores.horizon == 30.0)]
    errors = judged.set_index("who").position
    assert not hull.refusal
    assert errors["identified"] <= 0.7 * errors["prior"]
    damping = plain_logs.OWN_BOAT.damping
    for row in hull.forces[hull.forces.force != "Y(v)"].itertuples():
        motion_ = (row.at, 0.0, 0.0) if row.force == "X(u)" else (0.0, 0.0, row.at)
        assert row.low <= damping(*motion_)[0 if row.force == "X(u)" else 2] <= row.high
    numbers = hull.parameters.set_index("name")
    for name, exact in {"compass": math.radians(5.0), "s_g": 2.5 / plain_logs.CEP}.items():
        assert numbers.low[name] <= exact <= numbers.high[name]
