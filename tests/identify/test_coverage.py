"""The sets of logs that measure coverage: what they have, and that podusv can say the truth."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest

from benchmarks import coverage
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import bundle, call
from podusv_cli.identify.fit.estimate import estimate_hull
from podusv_cli.identify.fit.problem import FitProblem

HULLS = coverage.FACTORS["hull"]


@pytest.fixture(params=HULLS)
def known(request):
    """A set of this hull with commands, what is known of it before, and its boat."""
    cell = coverage.CoverageSet(0, 10, "commands", 0.02, "mean load", request.param)
    before = coverage.known_before(cell)
    return cell, before, coverage.true_boat(before, cell, np.random.default_rng(5))


def test_every_value_of_a_factor_has_the_same_number_of_sets():
    sets = [coverage.coverage_set(i) for i in range(120)]
    for factor, values in coverage.FACTORS.items():
        count = Counter(getattr(each, factor) for each in sets)
        assert count == dict.fromkeys(values, 120 // len(values))
    met = {(each.rows, each.sea, each.gnss) for each in sets}
    every = product(*(coverage.FACTORS[f] for f in ("rows", "sea", "gnss")))
    assert len(met) > 0.75 * len([*every])  # no factor goes with another


def test_a_plain_boat_moves_as_podusv_says(known):
    """The fit's form of a hull is the truth's: what is off comes from logs and fit."""
    _, before, boat = known
    rng = np.random.default_rng(8)
    k = bundle(before.vessel.constants() | dict(boat.numbers))
    for _ in range(30):
        nu, tau, rate = rng.normal(size=3), 20.0 * rng.normal(size=3), np.zeros(6)
        call(plant, x=np.array([0.0, 0.0, 0.0, *nu]), tau=tau, b=np.zeros(3), k=k, rate=rate)
        assert boat.acceleration(*nu, *tau) == pytest.approx(rate[3:], rel=1e-12)


def test_plain_propellers_push_and_lag_as_podusv_says(known):
    _, before, boat = known
    actuator, rng, count = before.actuator, np.random.default_rng(9), len(boat.propellers)
    k, table = bundle(actuator.constants()), actuator.table()
    turning = np.array([0.6 if p.angle_lag else 0.0 for p in boat.propellers])
    top = np.array([p.top for p in boat.propellers])
    for _ in range(30):
        (n, asked), (angle, turn) = rng.uniform(-1, 1, (2, 2, count)) * [[top], [turning]]
        tau, rate = np.zeros(3), np.zeros(2 * count)
        x = np.concatenate([np.zeros(3), rng.normal(size=3)])
        call(actuator.replay, x=x, demand=np.append(n, angle), k=k, table=table, tau=tau)
        pushed = [p.push(*at) for p, *at in zip(boat.propellers, n, angle, strict=True)]
        assert np.sum(pushed, axis=0) == pytest.approx(tau, rel=1e-12, abs=1e-12)
        command = np.append(asked, turn)
        call(actuator.lag, state=np.append(n, angle), command=command, k=k, table=table, rate=rate)
        wanted = command.reshape(2, count).T
        own = [p.rates(*at) for p, *at in zip(boat.propellers, n, angle, wanted, strict=True)]
        assert np.ravel(own, "F") == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("logged", coverage.FACTORS["logged"])
def test_a_log_has_what_its_actuator_takes(known, logged, tmp_path, monkeypatch):
    monkeypatch.setattr(coverage, "DURATION", 2.0)
    monkeypatch.setattr(coverage, "LOGS", 1)
    cell = replace(known[0], logged=logged)
    before = coverage.known_before(cell)
    (path,) = coverage.write_logs(tmp_path, known[2], cell, before)
    actuator = before.actuator
    names = {s.name for s in (actuator.lagged if logged == "commands" else actuator.replayed)}
    assert {"time", "x", "y", "psi", "r"} | names == set(pd.read_csv(path).columns)


def test_a_mean_load_is_8_percent_of_full_thrust(known):
    cell = known[0]
    for seed in range(5):
        load = coverage.sea_of(cell, 50.0, 2.0, np.random.default_rng(seed)).load
        assert load(3.0) == load(70.0)
        assert np.hypot(*load(0.0)[:2]) == pytest.approx(4.0)
        assert abs(load(0.0)[2]) <= 8.0


def test_gusts_and_wandering_have_2_percent_of_full_thrust(known):
    for sea in ("gusts", "wandering"):
        cell, values = replace(known[0], sea=sea), []
        for seed in range(40):
            load = coverage.sea_of(cell, 50.0, 2.0, np.random.default_rng(seed)).load
            values.append([load(t) for t in np.arange(0.0, 120.0, 1.3)])
        rms = np.sqrt(np.mean(np.square(values), axis=(0, 1)))
        assert rms == pytest.approx([1.0, 1.0, 2.0], rel=0.1)


@pytest.mark.long
def test_a_search_does_not_end_in_steps_of_the_filter_where_sway_changes_its_sign(tmp_path):
    """With slopes over 1e-4 of the priors' deviations the search takes 60 rounds or more here."""
    cell = coverage.CoverageSet(5000, 10, "commands", 0.02, "wandering", "otter")
    before = coverage.known_before(cell)
    boat = coverage.true_boat(before, cell, np.random.default_rng([cell.number, 99]))
    given = coverage.read_logs(tmp_path, boat, cell, before)
    problem = FitProblem(before, coverage.WANTED, given)
    found = estimate_hull(problem.search, starts=1)
    assert found.rounds < 30
    assert problem.values(found.y)["m33"] == pytest.approx(boat.number("m33"), rel=0.1)
