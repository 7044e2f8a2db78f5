"""A hull from logs: the filter along a log, what logs determine, and what is said of it."""

from __future__ import annotations

import json
import math
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from identify_samples import (
    HULL,
    LOGS,
    SCENARIO,
    commands_of,
    fitted,
    made_logs,
    motion,
    problem,
    slope,
    table_of,
)
from scipy.integrate import solve_ivp

from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.estimators.ekf import ExtendedKalmanFilter
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import LANES, bundle
from podusv_cli.identify import judge
from podusv_cli.identify.answer import Identification
from podusv_cli.identify.doubts import early_words, thrust_words, worse_words
from podusv_cli.identify.figures import free_run
from podusv_cli.identify.fit.beside import SIZE
from podusv_cli.identify.fit.estimate import OPEN, SILENT, HullEstimate, directions
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
from podusv_cli.identify.fit.problem import FitProblem, hull_numbers
from podusv_cli.identify.fit.records import log_of
from podusv_cli.identify.logs.reading import LogTable, mark_new_values
from podusv_cli.identify.outputs import rows_of_draws
from podusv_cli.identify.phrases import summary
from podusv_cli.scenario.identify import Identify, LogFile
from podusv_cli.scenario.load import load
from podusv_cli.workflows.identify import answer_logs


@pytest.fixture(scope="module")
def boat():
    """Three logs, which no test changes."""
    return made_logs()


def test_the_filter_along_a_log_is_that_of_plain_python():
    """Irregular times, late and missing values; the matrices by another program's integrator.

    No velocity passes through 0, where the slopes of |v| v jump and every integrator is rough.
    """
    rng = np.random.default_rng(3)
    rows = np.zeros((12, COMMANDS + 9))
    rows[:, HOLDS] = rng.uniform(0.05, 0.4, 12)
    rows[:, DELIVERED : DELIVERED + 6] = rng.integers(0, 2, (12, 6))
    rows[:, VALUES : VALUES + 6] = rng.normal(0.0, 0.3, (12, 6))
    filter_ = ExtendedKalmanFilter(sigma_p=0.03, sigma_u=0.05, sigma_v=0.06, q_u=0.1, q_b=0.2)
    current, delay = (0.2, -0.1), 0.07
    constants = {
        **HULL.constants(),
        **filter_.constants(),
        "thrust": 0.9,
        **{"dead_band": 0.0, "thrust_exponent": 2.0},  # of propellers, which are none here
        "delay": delay,
        **dict.fromkeys(("Y_rv", "Y_vr", "N_rv", "N_vr"), 0.0),  # whose slopes are means
        "current_x": current[0],
        "current_y": current[1],
        **{"s_g": 0.0, "T_g": 30.0, "wandering": 0.0, "compass": 0.0},
        **{"mean_x": 0.0, "mean_y": 0.0, "mean_psi": 0.0, "w_b": 1.0, "z_b": 1.0, "gusts": 0.0},
    }
    rows[:, COMMANDS:] = rng.normal(0.0, 1.0, (12, 9))
    size, moving = 9, np.array([0.9, 0.4, 0.5])
    x = rng.normal(0.0, 0.3, size)
    x[3:6] = moving
    rows[:, VALUES + 3 : VALUES + 6] = moving + rng.normal(0.0, 0.05, (12, 3))
    P = np.diag(rng.uniform(1e-4, 4e-4, size))
    start = np.concatenate([x, P[np.triu_indices(size)], np.zeros(SIZE - 54)])
    count = int(rows[:, DELIVERED : DELIVERED + 6].sum())
    fine = np.repeat(rows, 40, axis=0)  # so that RK4's own error is small
    fine[:, HOLDS] /= 40.0
    fine[np.arange(len(fine)) % 40 > 0, DELIVERED : DELIVERED + 6] = 0.0
    run = side_by_side(Ideal())(
        FilterRecord(fine, count), [np.array([constants[n] for n in NAMES])], [start], False
    )
    expected = filtered(rows, x, P, bundle(constants), filter_, current)
    assert np.column_stack([run.innovations, run.variances]) == pytest.approx(
        np.array(expected), rel=2e-6, abs=5e-7
    )


def filtered(rows, x, P, k, filter_, current):
    """An extended Kalman filter with slopes by differences, and its covariance by solve_ivp."""
    sigma = (
        filter_.sigma_p,
        filter_.sigma_p,
        filter_.sigma_psi,
        filter_.sigma_u,
        filter_.sigma_v,
        filter_.sigma_r,
    )
    walks = (filter_.q_u, filter_.q_v, filter_.q_r, filter_.q_b, filter_.q_b, filter_.q_b_psi)
    Q = np.diag([0.0, 0.0, 0.0, *np.square(walks)])
    found, since = [], 0.0

    def measured(s, i):
        c, n = math.cos(s[2]), math.sin(s[2])
        flow = {3: c * current[0] + n * current[1], 4: c * current[1] - n * current[0]}
        return s[i] + {0: since * current[0], 1: since * current[1]}.get(i, flow.get(i, 0.0))

    def slopes(function, s):
        return np.array(
            [(function(s + 1e-6 * e) - function(s - 1e-6 * e)) / 2e-6 for e in np.eye(len(s))]
        ).T

    for line in rows:
        for i in np.flatnonzero(line[DELIVERED : DELIVERED + 6]):
            h = slopes(lambda s: measured(s, i), x)  # noqa: B023
            nu = line[VALUES + i] - measured(x, i)
            S = h @ P @ h + sigma[i] ** 2
            found.append((nu, S))
            K = P @ h / S
            x, P = x + K * nu, P - np.outer(K, h @ P)
        earlier, now, later = line[COMMANDS:].reshape(3, 3).T
        part = k.delay / APART
        tau = 0.9 * (
            0.5 * part * (part - 1.0) * earlier
            + (1.0 - part**2) * now
            + 0.5 * part * (part + 1.0) * later
        )
        rate = slope(k, tau)

        def whole(t, s):
            F = slopes(lambda y: rate(t, y), s[:9])  # noqa: B023
            C = s[9:].reshape(9, 9)
            return np.concatenate([rate(t, s[:9]), (F @ C + C @ F.T + Q).ravel()])  # noqa: B023

        ended = solve_ivp(
            whole, (0.0, line[HOLDS]), np.concatenate([x, P.ravel()]), rtol=1e-8, atol=1e-10
        )
        x, P = ended.y[:9, -1], ended.y[9:, -1].reshape(9, 9)
        since += line[HOLDS]
    return found


def test_a_few_numbers_come_out_of_two_logs(boat):
    """From half to twice the truth; with the current of each log, and no delay."""
    off = {"X_udot": -15.0, "N_rdot": -3.0, "Y_vv": -20.0, "N_r": -3.0}
    given = problem(boat[:2], HULL.changed(off), free=("m11", "m33", "Y_vv", "N_r"), prior=1.0)
    found = fitted(given)
    ways = directions(found.covariance, len(given.hull))
    assert found.settled
    assert ways.determined_count == 4
    values, sd, truth = given.values(found.y), np.sqrt(np.diag(found.covariance)), HULL.constants()
    for i, number in enumerate(given.hull):
        width = number.sd * sd[i]
        assert width < 0.05
        assert abs(math.log(values[number.name] / truth[number.name])) < 3.5 * width
    assert given.sea_at(boat[0], given.at(found.y)) == pytest.approx([0.05, -0.03], abs=0.01)
    assert given.sea_at(boat[1], given.at(found.y)) == pytest.approx([0.0, 0.04], abs=0.01)
    assert values["delay"] == pytest.approx(0.0, abs=0.03)
    assert values["sigma_p"] == pytest.approx(0.01, rel=0.1)


def test_slopes_take_the_room_of_innovations_and_variances(boat):
    """Tracks of all runs, or slopes of all values at once, would each take more than this."""
    given = problem(boat)
    size, values = len(given.numbers), sum(log.record.delivered for log in boat)
    given.search.score(np.zeros(size))
    tracemalloc.start()
    given.search.score(np.zeros(size))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1.5 * 2 * 8 * values * (size + 1 + LANES)


@pytest.mark.slow
def test_a_hull_comes_out_of_its_logs_with_its_error(boat):
    """All numbers, from such as are 1.5 times the truth, and half of it."""
    off = {"X_uuu": 1.5, "Y_vv": 1.5, "N_r": 0.6, "N_vv": 1.4, "Y_r": 0.7}
    guess = HULL.changed(
        {n: getattr(HULL, n) * f for n, f in off.items()} | {"X_udot": -10.0, "N_rdot": -2.0}
    )
    given = problem(boat, guess)
    found = fitted(given)
    ways = directions(found.covariance, len(given.hull))
    assert found.settled
    values, sd = given.values(found.y), np.sqrt(np.diag(found.covariance))
    truth = HULL.constants()
    for i, number in enumerate(given.hull):
        if sd[i] <= 0.3:
            z = math.log(values[number.name] / truth[number.name]) / (number.sd * sd[i])
            assert abs(z) < 3.5, (number.name, z)
    assert values["m11"] == pytest.approx(HULL.m11, rel=0.02)
    assert values["m33"] == pytest.approx(HULL.m33, rel=0.04)
    assert given.vessel(found.y).m33 == pytest.approx(values["m33"])
    assert 6 <= ways.determined_count < len(given.hull)


STILL = np.zeros(400)
PUSHED = np.repeat([10.0, 30.0, 50.0, 20.0], 100)  # N


@pytest.mark.parametrize(
    ("push", "noise", "determined"),
    [
        pytest.param(PUSHED, (0.1, 0.02, 0.01), {"m11", "X_u"}, marks=pytest.mark.slow),
        pytest.param(  # as only simulators make it
            PUSHED, (0.0, 0.0, 0.0), {"m11", "X_u"}, marks=pytest.mark.long
        ),
        (STILL, (0.01, 0.005, 0.002), set()),  # moored
    ],
)
def test_a_straight_or_moored_boat_leaves_what_it_does_not_show_as_it_was(push, noise, determined):
    """The noiseless one leaves no error that a sensor of podusv's own could have."""
    times = np.arange(0.0, 80.0, 0.2)
    commands = np.zeros((len(times), 3))
    commands[:, 0] = push
    otter = load("podusv:trials/base.yaml", ["controller={kind: pid}", "name=boat"]).scenario.vessel
    start = np.array([0.0, 0.0, 0.5, 0.3 if determined else 0.0, 0.0, 0.0])
    log = log_of(
        table_of(times, motion(commands, times, start, otter), commands, noise=noise), Ideal(), 0.1
    )
    given = problem([log], otter.changed({"X_u": -50.0}), current=0.0)
    found = fitted(given)
    ways = directions(found.covariance, len(given.hull))
    assert ways.determined_count == len(determined)
    sd = np.sqrt(np.diag(found.covariance))
    for number, y, width in zip(given.hull, found.y, sd, strict=False):
        if number.name in determined:
            assert width < OPEN
        elif (
            number.name != "m22"
        ):  # noise that the filter follows is sway, of which inertia is a part
            assert abs(y) < 0.25
            assert width > SILENT
    if determined:
        assert given.values(found.y)["X_u"] == pytest.approx(otter.X_u, rel=0.03)


def test_a_free_run_of_the_true_hull_stays_with_the_boat(boat):
    """With the hull that made the log the error is that of the measurement; thrust lost shows."""
    given = problem(boat[2:], current=0.0)
    names = [n.name for n in given.numbers]
    calm = np.array([-3.0 if name.startswith("q_") else 0.0 for name in names])
    errors = judge.free_runs(given, boat[2], calm)[0].errors(30.0)
    assert errors[0][0] < 0.3
    weak = np.where(np.array(names) == "m11", 1.0, calm)
    assert judge.free_runs(given, boat[2], weak)[0].errors(30.0)[0][0] > 3.0 * errors[0][0]


def test_the_drawn_headings_of_a_free_run_begin_together():
    """However often the boat has turned before, by the filter's count."""
    times = np.arange(0.0, 30.0, 0.5)
    pose = np.column_stack([0.5 * times, 0.1 * times, 0.2 * times - 3.0])
    measured = pose.copy()
    measured[:, 2] = (measured[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    measured[:2, 2] = np.nan
    turned = [pose + np.array([0.0, 0.0, 2.0 * math.pi * turns]) for turns in (-1, 0, 3)]
    _, heading = free_run(judge.FreeRun(times, measured, tuple(turned))).axes[:2]
    seen, *drawn = (line.get_ydata() for line in heading.lines)
    for line in drawn:
        assert line[2] == pytest.approx(seen[0])
        assert line == pytest.approx(np.degrees(pose[:, 2]))


def test_on_a_straight_track_a_current_along_it_is_left_to_the_load(boat):
    times = np.arange(0.0, 40.0, 0.2)
    commands = np.tile([2.0, 0.0, 0.0], (len(times), 1))
    states = motion(commands, times, np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0]), current=(0.1, 0.0))
    log = log_of(table_of(times, states, commands), Ideal(), 0.1)
    given = problem([log])
    ahead, _ = judge._estimate_sea(given, log, np.zeros(len(given.numbers)))
    assert ahead == pytest.approx(0.0, abs=1e-9)
    turning = judge._estimate_sea(problem(boat[:1]), boat[0], np.zeros(len(given.numbers)))
    assert turning == pytest.approx([0.05, -0.03], abs=0.02)


def test_draws_keep_what_is_determined_and_spread_as_before_where_nothing_is():
    """Of two numbers only a weighted sum is known; a third is as open as its prior."""
    wanted = Identify(logs=LOGS, free=("X_u", "Y_v", "N_r"), draws=4000, prior=0.8)
    given = FitProblem(SCENARIO, wanted, [])
    sum_of = np.array([0.6, 0.8, 0.0])
    covariance = np.eye(3) - (1.0 - 1e-4) * np.outer(sum_of, sum_of)
    found = HullEstimate(np.zeros(3), 0.0, covariance, 1)
    hulls = Identification(given, found, directions(covariance, 3), (), ()).draws
    factors = np.array([[getattr(h, n) / getattr(HULL, n) for n in wanted.free] for h in hulls])
    sd = given.sd[0]
    assert np.std((factors - 1.0) / sd @ sum_of) == pytest.approx(0.01, rel=0.05)
    ends = np.quantile(factors[:, 2], (0.025, 0.5, 0.975))
    assert ends == pytest.approx(np.exp(sd * np.array([-1.96, 0.0, 1.96])), rel=0.08)


def test_a_hull_that_predicts_worse_than_the_prior_gets_a_warning():
    def scored(identified, prior):
        scores = [
            judge.Score("a.csv", "judge", 30.0, who, 1, error, 0.1)
            for who, error in zip(judge.WHO, (identified, prior, 9.0), strict=True)
        ]
        return SimpleNamespace(scores=scores)

    assert worse_words(scored(1.0, 1.0)) == []
    (line,) = worse_words(scored(2.0, 1.0))
    assert line.startswith("a.csv: the vessel as it was given predicts this log better")


def test_a_long_log_is_judged_from_few_instants_and_only_once_to_its_end(boat):
    given, long = problem(boat[2:], current=0.0), replace(boat[2], times=50.0 * boat[2].times)
    y = np.zeros(len(given.numbers))
    short, runs = judge.free_runs(given, boat[2], y), judge.free_runs(given, long, y)
    assert len(short) == 3
    assert 15 < len(runs) <= judge.MOST
    assert [run.times[-1] == long.times[-1] for run in runs[:-1]] == [True] + [False] * 18
    for run in short:  # what is cut is beyond what any score looks at
        late = run.times[-1] - run.times[0]
        assert late > 32.9 or run.times[-1] == boat[2].times[-1]


def untold(prior, **wanted):
    """An answer where no log says anything."""
    given = problem([], prior=prior, **wanted)
    size = len(given.hull)
    found = HullEstimate(np.zeros(size), 0.0, np.eye(size), 1, True)
    return Identification(given, found, directions(found.covariance, size), (), ())


def test_hulls_are_drawn_from_wide_priors_too():
    answer = untold(3.0, draws=10)
    assert len(answer.draws) == len(answer.before) == 10
    assert all(hull.N_r < 0.0 and hull.Y_v < 0.0 for hull in answer.draws)


def test_a_force_that_is_zero_has_no_interval_and_no_log_for_judging_is_said():
    answer = untold(0.5, draws=10)
    answer.__dict__.update(
        {"motion": np.zeros((4, 3)), "parameters": []}
    )  # of a boat that lay still
    assert answer.forces == []
    lines = " ".join(summary(answer))
    assert "X(u)" not in lines
    assert "No log was kept for judging" in lines
    kept = (*LOGS, LogFile(file="b.csv", role="judge"))
    judged = replace(answer, problem=replace(answer.problem, wanted=Identify(logs=kept)))
    judged.__dict__.update({"motion": np.zeros((4, 3)), "parameters": []})
    assert summary(judged)[0].startswith("No log for judging holds a free run of 30 s")


def test_thrust_that_is_found_is_said_since_the_hull_has_no_place_for_it(boat):
    for free, count in ((("N_r",), 0), (("N_r", "thrust"), 1)):
        given = problem(boat[2:], free=free, prior=0.5)
        size = len(given.numbers)
        y = np.array([math.log(0.8) / n.sd if n.name == "thrust" else 0.0 for n in given.numbers])
        found = HullEstimate(y, 0.0, np.eye(size), 1, True)
        lines = thrust_words(Identification(given, found, directions(np.eye(size), 2), (), ()))
        assert len(lines) == count
    assert lines[0].startswith("thrust over what the actuator's numbers give is 0.8 (")
    assert "its loads have to be changed likewise" in lines[0]  # an ideal actuator has no propeller


@pytest.mark.parametrize(("off", "count"), [(-1.5, 1), (-0.1, 0), (0.0, 0), (1.5, 0)])
def test_a_boat_that_moves_before_its_commands_is_doubted(boat, off, count):
    """A delay has a prior of one step of the filter, 0.05 s; here it is known to 0.1 of that."""
    given = problem(boat[2:], free=("N_r",), prior=0.5)
    size = len(given.numbers)
    y = np.array([off * (n.name == "delay") for n in given.numbers])
    found = HullEstimate(y, 0.0, 0.01 * np.eye(size), 1, True)
    lines = early_words(Identification(given, found, directions(np.eye(size), 2), (), ()))
    assert len(lines) == count
    assert all(line.startswith("delay is -0.075 s (-0.085 to -0.065)") for line in lines)


def test_a_hull_times_a_factor_under_thrust_times_it_moves_as_before():
    times = np.arange(0.0, 20.0, 0.2)
    commands, start = commands_of(times), np.array([0.0, 0.0, 0.0, 0.4, 0.1, 0.0])
    double = problem([], free=("N_r", "thrust"), prior=0.5).scale_by_thrust(np.zeros(2), 2.0)
    assert double.m == 2.0 * HULL.m
    assert double.m23 == pytest.approx(2.0 * HULL.m23)
    twice = motion(2.0 * commands, times, start, double)
    assert twice == pytest.approx(motion(commands, times, start), abs=1e-8)


def test_draws_move_as_the_logs_leave_possible_with_the_one_thrust_that_is_said():
    """The logs tell N_r over thrust; so N_r of the draws stays, and all else goes with thrust."""
    given = problem([], free=("N_r", "thrust"), prior=0.5, draws=1000)
    ratio = np.array([1.0, -1.0]) / math.sqrt(2.0)
    covariance = np.eye(2) - (1.0 - 1e-6) * np.outer(ratio, ratio)
    found = HullEstimate(np.zeros(2), 0.0, covariance, 1)
    rows = pd.DataFrame(
        rows_of_draws(Identification(given, found, directions(covariance, 2), (), ()))
    )
    assert (rows.N_r / HULL.N_r).to_numpy() == pytest.approx(np.ones(1000), abs=0.01)
    thrust = np.quantile(HULL.m / rows.m, (0.025, 0.5, 0.975))
    assert thrust == pytest.approx(
        np.exp(given.sd[0] / math.sqrt(2.0) * np.array([-1.96, 0.0, 1.96])), rel=0.08
    )
    assert (rows.Y_v / HULL.Y_v).to_numpy() == pytest.approx((rows.m / HULL.m).to_numpy())


def test_a_search_beside_which_the_filter_breaks_down_ends_with_a_sentence():
    with pytest.raises(UsageError, match=r"beside the best numbers .* check units and signs"):
        directions(np.full((2, 2), np.nan), 2)


def test_a_log_of_few_seconds_gives_a_hull_without_scores():
    times = np.arange(0.0, 60.0, 0.1)
    commands = commands_of(times)
    states = motion(commands[:41], times[:41], np.array([0.0, 0.0, 0.0, 0.4, 0.0, 0.0]))
    given = problem(
        [log_of(table_of(times[:41], states, commands[:41]), Ideal(), 0.05)], free=("N_r",), draws=5
    )
    answer = answer_logs(given.scenario, given.wanted, [(given.logs[0], "fit")], None)
    assert answer.scores == []
    assert 0.2 < answer.vessel.envelope.speed < 0.6
    assert len(answer.forces) == 9


def test_ctrl_c_while_logs_are_judged_keeps_the_hull(boat, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(judge, "estimate_hull", interrupted)
    given = problem(boat[2:], free=("N_r",))
    logs = [(boat[2], "fit")]
    answer = answer_logs(given.scenario, given.wanted, logs, None)
    assert answer.estimate.interrupted
    assert answer.estimate.settled
    assert answer.judged == [(boat[2], "fit", ())]


def test_who_keeps_the_velocities_of_an_instant_goes_round_a_circle():
    times = np.linspace(3.0, 11.0, 9)
    state = np.array([1.0, 2.0, 0.3, 0.9, 0.2, 0.25])
    turned = judge._turning(times, state)

    def rate(_, s):
        c, n = math.cos(s[2]), math.sin(s[2])
        return [c * 0.9 - n * 0.2, n * 0.9 + c * 0.2, 0.25]

    ended = solve_ivp(rate, (3.0, 11.0), state[:3], t_eval=times, rtol=1e-10, atol=1e-12)
    assert turned == pytest.approx(ended.y.T, abs=1e-8)


def test_values_that_a_logger_repeats_count_once():
    rng = np.random.default_rng(0)
    true = rng.normal(size=100)
    assert mark_new_values(true).all()
    held = np.repeat(true, 5)
    assert mark_new_values(held).sum() == 100
    assert mark_new_values(held)[::5].all()
    uneven = true[np.floor(np.arange(350) / 3.5).astype(int)]  # 3 and 4 rows in turn
    assert mark_new_values(uneven).sum() == 100
    coarse = np.round(np.cumsum(rng.normal(0.0, 0.6, 400)))  # a resolution, not a rate
    assert mark_new_values(coarse).all()
    gaps = true.copy()
    gaps[10:20] = np.nan
    assert mark_new_values(gaps).sum() == 90


def test_a_log_becomes_rows_of_which_none_is_lost():
    """A gyro at 20 Hz beside a pose at 4 Hz, and a gap of 10 s."""
    times = np.concatenate([np.arange(0.0, 20.0, 0.05), np.arange(30.0, 40.0, 0.05)]) + 1.7e9
    count = len(times)
    pose = np.where(np.arange(count) % 5 == 0, 1.0, np.nan)
    rng = np.random.default_rng(2)
    columns = {
        "x": pose * rng.normal(size=count),
        "y": pose * rng.normal(size=count),
        "psi": pose * 0.1 * rng.normal(size=count),
        "r": rng.normal(size=count),
        "tau_u": np.linspace(0.0, 1.0, count),
        "tau_r": np.zeros(count),
    }
    log = log_of(LogTable("a", times, columns), Ideal(), 0.1)
    assert log.counts.tolist() == [count // 5] * 3 + [0, 0, count]
    rows = log.record.rows
    assert rows[:, HOLDS].sum() == pytest.approx(times[-1] - times[0])
    assert np.all(rows[:, HOLDS] <= 0.1 + 1e-6)
    assert len(rows) == count + 100  # of the gap


@pytest.mark.parametrize(
    "free",
    ["  free: [inertia, damping.yaw]\n", pytest.param("", marks=pytest.mark.long)],
    ids=["some", "usual"],
)
def test_the_command_writes_a_hull_that_a_scenario_takes(tmp_path, boat, free):
    from podusv_cli.components.vessels.vessel import Vessel
    from podusv_cli.scenario.yaml_text import read
    from podusv_cli.scenario.yaml_tree import plain

    config = tmp_path / "boat.yaml"
    times = np.arange(0.0, 60.0, 0.2)
    for i in range(2):
        commands = commands_of(times, seed=i)
        states = motion(commands, times, np.array([0.0, 0.0, 0.0, 0.4, 0.0, 0.0]))
        table = table_of(times, states, commands, seed=i)
        names = ["t", *table.columns]
        cells = np.column_stack([times, *table.columns.values()])
        cells[:, 1 + list(table.columns).index("psi")] *= 180.0 / math.pi
        lines = [",".join(names), *(",".join(f"{c:.8g}" for c in row) for row in cells)]
        (tmp_path / f"{i}.csv").write_text("\n".join(lines))
    config.write_text(
        "extends: podusv:trials/base.yaml\nvessel: {preset: cybership2, N_r: -2.5}\n"
        "actuator: {kind: ideal}\ncontroller: {kind: pid}\n"
        "identify:\n  columns: {time: t, psi: 'psi [deg]'}\n  draws: 5\n"
        + free
        + "  logs: [{file: 0.csv}, {file: 1.csv, role: judge}]\n"
    )
    import podusv

    hull = podusv.identify(config, out=tmp_path / "hull", figures=False)
    assert set(hull.draws.columns) <= set(Vessel.model_fields)
    assert len(hull.draws) == 5
    node = read((tmp_path / "hull/identified.yaml").read_text(), "identified.yaml", [])
    vessel = Vessel(**plain(node))
    assert vessel.N_r == pytest.approx(hull.vessel["N_r"])
    assert vessel.envelope.speed < 1.5
    numbers = pd.read_csv(tmp_path / "hull/parameters.csv", index_col="name")
    assert numbers.unit.notna().all()
    assert numbers.unit[["m11", "m33", "N_r", "q_b", "delay"]].tolist() == [
        "kg",
        "kg m2",
        "kg m2/s",
        "N/sqrt(s)",
        "s",
    ]
    forces = pd.read_csv(tmp_path / "hull/forces.csv", index_col="force")
    assert {*forces.loc[["N(r)"], "unit of at"]} == {"rad/s"}
    files = pd.read_csv(tmp_path / "hull/judged.csv")
    assert files["heading [deg]"].to_numpy() == pytest.approx(np.degrees(hull.scores.heading))
    judged = hull.scores[(hull.scores.role == "judge") & (hull.scores.horizon == 30.0)]
    errors = judged.set_index("who").position
    assert errors["identified"] < 0.5 * errors["constant velocity"]
    assert json.loads((tmp_path / "hull/provenance.json").read_text())
    assert "What the logs leave open" in (tmp_path / "hull/report.html").read_text()


def test_the_mass_matrix_stays_symmetric_where_it_was(boat):
    skewed = HULL.changed({"Y_rdot": HULL.Y_rdot - 0.3})
    for hull, free, names in (
        (HULL, ("m23",), ["m23"]),
        (HULL, ("m32",), ["m23"]),
        (HULL, ("m32", "m23"), ["m23"]),
        (skewed, ("m32",), ["m32"]),
    ):
        given = problem(boat[2:], hull, free=free)
        assert [number.name for number in given.hull] == names
        up = given.vessel(np.ones(1))
        assert up.m32 == pytest.approx(math.exp(given.sd[0]) * hull.m32)
        assert up.m23 == pytest.approx(up.m32 if hull is HULL else hull.m23)
        values = given.at(np.ones(len(given.numbers)))
        constants = dict(zip(NAMES, given.constants(values, (0.0, 0.0)), strict=True))
        assert (constants["m23"], constants["m32"]) == pytest.approx((up.m23, up.m32))


@pytest.mark.parametrize(
    ("section", "sentence"),
    [
        ({"logs": [{"file": "a", "role": "judge"}]}, "all logs are for judging"),
        ({"logs": [{"file": "a", "span": (9.0, 3.0)}]}, "9 s is not before 3 s"),
        ({"logs": [{"file": "a"}, {"file": "./a", "role": "judge"}]}, "a and ./a have a part in"),
        (
            {"logs": [{"file": "a", "span": (0.0, 5.0)}, {"file": "a", "span": (4.0, 9.0)}]},
            "a from 0 to 5 s and a from 4 to 9 s have a part in common, which would count twice",
        ),
        (
            {"logs": [{"file": "a"}], "noise": {"sigma_gps": 0.1}},
            "sigma_gps is no sensor's deviation",
        ),
        ({"logs": [{"file": "a"}], "noise": {"sigma_p": 0.0}}, "sigma_p is 0; it has to be above"),
        ({"logs": [{"file": "a"}], "noise": {"wander": -1.0}}, "wander is -1; .* at least 0"),
    ],
)
def test_a_section_that_cannot_be_meant_gets_a_sentence(section, sentence):
    with pytest.raises(ValueError, match=sentence):
        Identify.model_validate(section)


@pytest.mark.parametrize(
    ("wanted", "sentence"),
    [
        ({"free": ("damping.roll",)}, "is no group .* did you mean .damping.surge."),
        ({"free": ("X_u",), "priors": {"Y_v": 0.1}}, "Y_v is not looked for"),
        ({"free": ("N_rv", "Y_vr")}, None),
        ({"free": ("inertia", "damping.surge", "damping.sway", "damping.yaw", "thrust")}, "ratios"),
        ({"free": ("m22", "m33", "thrust")}, None),
    ],
)
def test_names_of_what_is_looked_for(wanted, sentence):
    asked = Identify(logs=LOGS, **wanted)
    if sentence is None:
        assert [n.name for n in hull_numbers(HULL, asked)] == list(wanted["free"])
        return
    with pytest.raises(UsageError, match=sentence):
        hull_numbers(HULL, asked)
