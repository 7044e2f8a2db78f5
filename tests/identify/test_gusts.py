"""Loads of gusts: their process against algebra, when they are taken, and what that is good for."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identify_samples import commands_of, motion, problem, table_of
from scipy.linalg import solve_continuous_lyapunov

from benchmarks import coverage
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.estimators.ekf import MOVING, N
from podusv_cli.core.kernel import bundle
from podusv_cli.identify import judge
from podusv_cli.identify.fit import gusts
from podusv_cli.identify.fit.beside import AXES, CROSS, PLAIN, SIZE, entry, follow
from podusv_cli.identify.fit.estimate import HullEstimate, HullSearch, estimate_hull
from podusv_cli.identify.fit.gusts import SeaSearch, estimate_in_sea
from podusv_cli.identify.fit.march import GUSTS, NAMES
from podusv_cli.identify.fit.problem import FIRST_LOADS, MEAN_LOADS
from podusv_cli.identify.fit.records import log_of
from podusv_cli.identify.phrases import summary
from podusv_cli.workflows.identify import answer_logs

MEANS = dict(zip(MEAN_LOADS, (0.7, -1.1, 0.4), strict=True))


@pytest.fixture(scope="module")
def log():
    """A minute of the model ship, 5 times a second."""
    times = np.arange(0.0, 60.0, 0.2)
    commands = commands_of(times)
    states = motion(commands, times, np.array([0.0, 0.0, 0.3, 0.4, 0.0, 0.0]))
    return log_of(table_of(times, states, commands), Ideal(), 0.1)


def point_of(given, log, **numbers):
    """A point of these numbers, from numbers in their own units."""
    y = np.zeros(len(given.numbers))
    for i, number in enumerate(given.numbers):
        value = numbers.get(number.name.removesuffix(f", {log.name}"), number.prior)
        ratio = math.log(value / number.prior) if number.ratio else value - number.prior
        y[i] = ratio / number.sd
    return y


def test_a_log_begins_with_the_gusts_that_go_on(log):
    """Variances of Lyapunov's equation; the filter has no rate of them."""
    given = replace(problem([log]), gusts=True)
    own = {"q_b": 0.3, "q_b_psi": 0.2, "w_b": 1.7, "z_b": 0.35}
    values = given.at(point_of(given, log, **own, **MEANS))
    sea = given.sea_at(log, values)
    assert sea == pytest.approx([0.0, 0.0, *MEANS.values()])
    state = given.start(log, sea, values)
    assert state[MOVING:N] == pytest.approx([*MEANS.values()])
    A = np.array([[0.0, 1.0], [-(1.7**2), -2.0 * 0.35 * 1.7]])
    for axis, q in enumerate((0.3, 0.3, 0.2)):
        P = solve_continuous_lyapunov(A, -np.diag([0.0, (q * 1.7) ** 2]))
        load = N - 3 + axis
        row = N + load * N - load * (load - 1) // 2  # of the packed triangle, its diagonal
        assert state[row] == pytest.approx(P[0, 0])
        assert state[PLAIN + entry(AXES + axis, AXES + axis)] == pytest.approx(P[1, 1])
    rate = np.zeros(SIZE)
    k = bundle(dict(zip(NAMES, given.constants(values, sea), strict=True)))
    follow(np.zeros(3), state, k, rate)
    assert rate[MOVING:N] == pytest.approx(0.0, abs=1e-12)
    for a in range(AXES, AXES + 3):
        assert rate[PLAIN + a] == pytest.approx(0.0, abs=1e-12)
        load = MOVING + a - AXES
        row = N + load * N - load * (load - 1) // 2
        assert rate[row] == pytest.approx(0.0, abs=1e-12)
        assert rate[PLAIN + CROSS + 5 * load + a] == pytest.approx(0.0, abs=1e-12)
        assert rate[PLAIN + entry(a, a)] == pytest.approx(0.0, abs=1e-12)


def test_which_sea_is_kept(log, monkeypatch):
    """Gusts alone that gain enough, at first and beside loads that wander with their own hull."""
    given = problem([log], free=("m33",))
    size = len(given.numbers)
    made: dict[bool, list[HullEstimate]] = {}

    def estimate(search, tell, *, starts=5, begun=()):
        """The next one of this sea."""
        return made[search.size > size].pop(0)

    def of(value, *, gusts=False, settled=False):
        return HullEstimate(np.zeros(size + 2 * gusts), value, np.eye(2), 3, settled)

    monkeypatch.setattr(gusts, "estimate_hull", estimate)

    def kept(*wandering, trials, swinging=()):
        made[False], made[True] = [*wandering], [of(v, gusts=True) for v in swinging]
        left = [*trials]
        monkeypatch.setattr(SeaSearch, "fit_gusts", lambda *_: of(left.pop(0), gusts=True))
        sought, found = estimate_in_sea(given, lambda *_: None)
        assert [left, made[False], made[True]] == [[], [], []]  # as many searches as are meant
        assert not found.interrupted
        return sought.gusts, found.value

    for trial in (100.0, 90.5, math.inf):  # too little, and loads that wander settle
        assert kept(of(100.0), of(99.8, settled=True), trials=[trial]) == (False, 99.8)
    gusts_win = {"trials": [89.0], "swinging": [50.0]}
    assert kept(of(100.0), of(70.0), **gusts_win) == (True, 50.0)
    assert kept(of(100.0), of(59.0), of(58.0), **gusts_win) == (False, 58.0)
    # Loads that wander do not settle, and gusts are tried all the same.
    unsettled = {"trials": [math.inf, 85.0], "swinging": [79.0]}
    assert kept(of(100.0), of(90.0), of(95.0), **unsettled) == (True, 79.0)
    assert kept(of(100.0), of(90.0), of(70.0), of(69.5), **unsettled) == (False, 69.5)
    # The first search was stuck where gusts gain nothing.
    stuck = of(100.0), of(60.0, settled=True)
    assert kept(*stuck, trials=[math.inf, 55.0]) == (False, 60.0)
    assert kept(*stuck, of(58.0), trials=[99.0, 45.0], swinging=[40.0]) == (True, 40.0)


@pytest.mark.parametrize("asked", [True, False])
def test_a_sea_that_is_asked_for_is_not_looked_for(log, monkeypatch, asked):
    sought = []

    def estimate(search, tell):
        sought.append(search.size)
        return HullEstimate(np.zeros(search.size), 1.0, np.eye(search.size), 3, settled=True)

    monkeypatch.setattr(gusts, "estimate_hull", estimate)
    given, found = estimate_in_sea(problem([log], free=("m33",), gusts=asked), lambda *_: None)
    assert given.gusts is asked
    assert sought == [len(given.numbers)] == [len(found.y)]
    assert ({*GUSTS} <= {number.name for number in given.numbers}) is asked


def test_searches_that_were_made_before_count_with_those_to_come(log):
    """Two that have come to the same are enough, and no other begins."""
    given = problem([log], free=("m33",))
    once = estimate_hull(given.search, starts=1)
    whole = estimate_hull(given.search)
    again = estimate_hull(given.search, begun=(once,))
    assert (again.value, again.settled) == (whole.value, whole.settled)
    assert again.y == pytest.approx(whole.y, abs=0.0)
    far = replace(once, value=once.value + 100.0)
    assert estimate_hull(given.search, begun=(once, far), starts=2).settled is False
    calls = []
    assert estimate_hull(given.search, lambda *_: calls.append(1), begun=(once, once)).settled
    assert not calls


def test_the_prior_of_loads_says_for_no_sea(log):
    """Only what loads do to the logs and to all other numbers counts."""
    given = problem([log], free=("m33",))
    sought = SeaSearch(given, lambda *_: None)
    y, z = np.full(len(given.numbers), 2.0), np.full(len(sought.gusty.numbers), 1.0)
    wanders, swings = (HullEstimate(e, float(e @ e), np.eye(2), 3) for e in (y, z))
    # q_b and q_b_psi beside 4 x (n - 2) of all others; with w_b and z_b beside (n - 2) of them.
    assert sought.gain(swings, wanders) == pytest.approx(3.0 * (len(y) - 2))


def test_an_interrupt_leaves_the_best_so_far(log, monkeypatch):
    """While gusts are tried, looked for, and held against loads that wander."""
    given = problem([log], free=("m33",))

    def of(value, *, gusts=False, interrupted=False):
        y = np.zeros(len(given.numbers) + 2 * gusts)
        return HullEstimate(y, value, np.eye(2), 3, interrupted=interrupted)

    def kept(trial, *searches):
        left = [*searches]

        def estimate(*_, **wanted):
            found = left.pop(0)
            if found is None:
                raise KeyboardInterrupt
            return found

        monkeypatch.setattr(gusts, "estimate_hull", estimate)
        monkeypatch.setattr(SeaSearch, "fit_gusts", trial)
        sought, found = estimate_in_sea(given, lambda *_: None)
        assert not left
        assert found.interrupted
        return sought.gusts, found.value

    def interrupted(*_):
        raise KeyboardInterrupt

    def gains(*_):
        return of(80.0, gusts=True)

    assert kept(interrupted, of(100.0)) == (False, 100.0)
    for value, sea in ((95.0, (False, 100.0)), (85.0, (True, 85.0))):
        swings = of(value, gusts=True, interrupted=True)
        assert kept(gains, of(100.0), swings) == sea
        assert kept(gains, of(100.0), replace(swings, interrupted=False), None) == sea
    halfway = of(90.0, interrupted=True)
    assert kept(gains, of(100.0), of(85.0, gusts=True), halfway) == (False, 90.0)


def test_a_sea_in_which_the_filter_breaks_down_is_left_out(log, monkeypatch):
    """Whichever of both; the other's hull stays."""
    given = problem([log], free=("m33",))
    sought = SeaSearch(given, lambda *_: None)
    found = estimate_hull(given.search, starts=1)

    def broken(points):
        return np.full((9, len(points)), np.nan), np.ones((9, len(points)))

    sought.__dict__["gusty"] = SimpleNamespace(
        numbers=sought.gusty.numbers, search=HullSearch(broken, found.y.size + 2, np.zeros(9))
    )
    assert sought._choose(found, None, 2) == (given, found)


def test_gusts_begin_with_the_numbers_of_loads_that_wander(log):
    """A mean load with the one that the log began with; what is new at its prior; and back."""
    sought = SeaSearch(problem([log], free=("m33",)), lambda *_: None)
    y = np.arange(1.0, 1.0 + len(sought.problem.numbers))
    there = sought.to_gusts(y)
    start = dict(zip((n.name for n in sought.gusty.numbers), there.tolist(), strict=True))
    known = dict(zip((n.name for n in sought.problem.numbers), y.tolist(), strict=True))
    for mean, first in zip(MEAN_LOADS, FIRST_LOADS, strict=True):
        assert start.pop(f"{mean}, a.csv") == known.pop(f"{first}, a.csv")
    assert [start.pop(name) for name in GUSTS] == [0.0, 0.0]
    assert start == known
    assert sought.from_gusts(there) == pytest.approx(y, abs=0.0)


def test_a_judged_log_s_own_mean_load_goes_on_in_its_free_runs():
    """In gusts the current and the mean load are those of the log, which was not fitted."""
    times, load = np.arange(0.0, 90.0, 0.2), (0.6, -0.9, 0.05)
    commands, start = commands_of(times), np.array([0.0, 0.0, 0.3, 0.4, 0.0, 0.0])
    states = motion(commands, times, start, current=(0.02, 0.01), load=load)
    log = log_of(table_of(times, states, commands), Ideal(), 0.1)
    given = replace(problem([log]), gusts=True)
    y = point_of(given, log, q_b=0.05, q_b_psi=0.01)
    sea = judge._estimate_sea(given, log, y)
    assert sea[2:] == pytest.approx(load, abs=0.1)
    first = np.searchsorted(log.times, 20.0)
    (own, _), _, (still, _) = judge._free_run(given, log, y, int(first)).errors(30.0)
    assert own < 0.5
    assert still > 3.0


@pytest.mark.long
def test_in_gusts_of_another_program_the_hull_comes_out(tmp_path):
    """Errors in standard deviations of the answer, which says that there are gusts."""
    cell = coverage.CoverageSet(5001, 10, "shaft speeds", 0.02, "gusts", "cybership2")
    before = coverage.known_before(cell)
    boat = coverage.true_boat(before, cell, np.random.default_rng([cell.number, 99]))
    given = [(log, "fit") for log in coverage.read_logs(tmp_path, boat, cell, before)]
    answer = answer_logs(before, coverage.WANTED, given, None)
    assert answer.problem.gusts
    off = {line["name"]: line["off"] for line in coverage.numbers_beside_truth(answer, boat)}
    assert max(abs(off[name]) for name in ("m11", "m22", "m33")) < 3.0
    assert any("Loads of gusts explain the logs better" in line for line in summary(answer))
