"""Metrics against their definitions, computed the long way from a full log."""

import math
from typing import Any

import numpy as np
import pytest
from command_samples import TWO, write
from conftest import NONLINEAR, POD, Constant, adrift, corrected, example, target_at
from loop_samples import gathered

from podusv_cli.comparison.parsing import parse_claims
from podusv_cli.components.actuators.pod import Pod, Pods
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.actuators.saturated_full import SaturatedFull
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.full_backstepping import FullBackstepping
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.controllers.stopping import Stopping
from podusv_cli.components.controllers.turning_circle import TurningCircle
from podusv_cli.components.controllers.zigzag import Zigzag
from podusv_cli.components.estimators.ekf import ExtendedKalmanFilter
from podusv_cli.components.estimators.none import NoEstimator
from podusv_cli.components.measurements.sensors import Sensor, Sensors
from podusv_cli.components.paths.legs import Legs
from podusv_cli.components.paths.line_circle import LineCircle
from podusv_cli.components.paths.poses import Poses
from podusv_cli.core.component import value
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.kernel import Vector, bundle, kernel
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics import consistency
from podusv_cli.metrics.cost import law_costs
from podusv_cli.metrics.distance import OF_OPTIMUM
from podusv_cli.metrics.margins import OF_LOOP
from podusv_cli.metrics.measured import OF_LOG
from podusv_cli.metrics.metric import close_integrals
from podusv_cli.metrics.operations import operations
from podusv_cli.metrics.spans import WITHIN
from podusv_cli.metrics.table import METRICS, metrics_probe, metrics_with
from podusv_cli.metrics.windows import CROSSED, NAMED, SETTLING, find, settle, settled_from
from podusv_cli.scenario.load import load, load_text
from podusv_cli.studies.counting.expressions import parse_success


@pytest.fixture(scope="module")
def limited():
    return gathered(corrected(actuator=Saturated()))


def beyond_the_standoff(log, steady):
    """The metrics of |z_e - standoff|, and of the position in the frame of the target's course."""
    standoff = AdaptiveNeural().standoff if log.controller == "adaptive_neural" else 0.0
    t, e = log["time"], np.abs(log["z_e"] - standoff)
    vx, vy = np.array([target_at(LineCircle(), now)[2:4] for now in t]).T
    course = np.arctan2(vy, vx)
    gap = (log["x"] - log["x_d"]) + 1j * (log["y"] - log["y_d"])
    along = (gap * np.exp(-1j * course))[steady]
    span = np.ptp(t[steady])
    return {
        "iae_e": np.trapezoid(e, t),
        "e_steady": np.trapezoid(e[steady], t[steady]) / span,
        "along_track_rms": np.sqrt(np.trapezoid(along.real**2, t[steady]) / span),
        "cross_track_rms": np.sqrt(np.trapezoid(along.imag**2, t[steady]) / span),
    }


def by_definition(log, steady):
    """The integrals, means and variations of a log; the settled part has these rows."""
    t, z_e = log["time"], log["z_e"]
    power = np.abs(log["tau_u"] * log["u"]) + np.abs(log["tau_r"] * log["r"])
    return {
        "iae": np.trapezoid(z_e, t),
        "ise": np.trapezoid(z_e**2, t),
        "itae": np.trapezoid(t * z_e, t),
        "rmse": np.sqrt(np.trapezoid(z_e**2, t) / t[-1]),
        "z_e_steady": np.trapezoid(z_e[steady], t[steady]) / np.ptp(t[steady]),
        **beyond_the_standoff(log, steady),
        "peak_tau_u": np.abs(log["tau_u_cmd"]).max(),
        "peak_tau_r": np.abs(log["tau_r_cmd"]).max(),
        "effort_u": np.trapezoid(log["tau_u"] ** 2, t),
        "effort_r": np.trapezoid(log["tau_r"] ** 2, t),
        "energy": np.trapezoid(power, t),
        "tv_tau_u": np.abs(np.diff(log["tau_u_cmd"][steady])).sum(),
        "tv_tau_r": np.abs(np.diff(log["tau_r_cmd"][steady])).sum(),
        "saturated_fraction": np.trapezoid(log["saturated"], t) / t[-1],
    }


def crossing(t, z_e, radius):
    """Where the last straight line from beyond the radius to within meets it."""
    i = np.flatnonzero(z_e > radius)[-1]
    return np.interp(-radius, -z_e[i : i + 2], t[i : i + 2])


def test_metrics_follow_their_definitions(limited):
    log, got = limited
    t = log["time"]
    expected = by_definition(log, t >= 0.75 * t[-1])
    expected["settling_time"] = crossing(t, log["z_e"], 2.0)
    assert {name: got[name] for name in expected} == pytest.approx(expected, rel=1e-12)
    assert 0 < got["saturated_fraction"] < 1


@pytest.mark.parametrize("compiled", [True, False])
def test_errors_of_the_estimate_follow_their_definitions(compiled):
    """Over each step the estimate is that of its begin, so both ends of every jump count."""
    loop = corrected(measurement=Sensors(), estimator=NoEstimator())
    log, got = gathered(loop, steps=300, compiled=compiled)
    t = log["time"]

    def squared(name):
        true, held = log[name], log[f"{name}_est"]
        before = np.append(true[0], held[:-1])
        return 0.5 * ((before - true) ** 2 + (held - true) ** 2)

    def rms(*names):
        square = sum(squared(name) for name in names)
        assert square.any()
        return pytest.approx(np.sqrt(np.trapezoid(square, t) / t[-1]), rel=1e-12)

    assert got["estimate_position_rms"] == rms("x", "y")
    assert got["estimate_heading_rms"] == rms("psi")
    assert got["estimate_velocity_rms"] == rms("u", "v")
    assert got["estimate_yaw_rate_rms"] == rms("r")


def test_a_position_that_is_held_is_off_by_a_sawtooth_whatever_the_step():
    """At 1 m/s the distance grows from 0 to P between two deliveries: rms P/sqrt(3).

    Of a parabola of n steps a trapezoidal sum has 1 + 1/(2 n^2) of the area.
    """
    undamped = dict.fromkeys(("X_u", "X_uu", "X_uuu"), 0.0)
    exact = dict.fromkeys(("position", "heading", "velocity", "yaw_rate"), Sensor(period=0.5))
    loop = adrift(
        vessel=NONLINEAR.model_copy(update=undamped),
        estimator=NoEstimator(),
        measurement=Sensors(**exact),
        start=(0.0, 0.0, 0.0, 1.0, 0.0, 0.0),
    )
    for n in (2, 5, 10):
        grid = TimeGrid(0.5 / n, 400 * n)
        probe = metrics_probe(Plan(loop, grid), steady_fraction=0.25, settling_radius=2.0)
        got = probe.summary(simulate(loop, grid, probe=probe).seen)["estimate_position_rms"]
        sawtooth = 0.5 * math.sqrt((1 + 1 / (2 * n**2)) / 3)
        assert got == pytest.approx(sawtooth, rel=1.0 / grid.steps)  # half a jump at the end


@pytest.mark.parametrize("turns", [-1, 0, 1, 2])
def test_a_heading_is_as_consistent_a_turn_further(turns):
    """The filter's heading and the hull's may differ by whole turns, from either side of south."""
    error, variance = np.array([0.1, -0.2, 0.03, 0.04, -0.05, 0.06]), np.linspace(0.5, 1.0, 6)
    state = np.array([1.0, 2.0, 3.1, 0.5, 0.1, 0.2])
    estimate = state + error + 2.0 * math.pi * turns * (np.arange(6) == 2)
    packed = np.diag(variance)[np.triu_indices(6)]
    s, seen = np.concatenate([state, estimate, packed, np.zeros(12)]), np.zeros(consistency.SIZE)
    k = bundle({"estimate": 6.0, "covariance": 6.0, "order": 6.0})
    consistency.watch(1.0, 1.0, WITHIN, s, k, seen)
    assert seen[consistency.SQUARE] == pytest.approx(np.sum(error**2 / variance), rel=1e-9)


@pytest.mark.parametrize("compiled", [True, False])
def test_consistency_of_a_filter_follows_its_definition(compiled):
    """e^T P^-1 e and innovations over the steady window, from the log by numpy."""
    loop = corrected(measurement=Sensors(), estimator=ExtendedKalmanFilter())
    log, got = gathered(loop, steps=200, compiled=compiled, steady_fraction=0.25)
    late = log["time"] >= 1.5 - 1e-9
    names = ("x", "y", "psi", "u", "v", "r")
    error = np.transpose([log[f"{name}_est"] - log[name] for name in names])
    P = np.zeros((len(late), 9, 9))
    above = np.triu_indices(9)
    P[:, above[0], above[1]] = P[:, above[1], above[0]] = log["P_est"]
    square = np.einsum(
        "ni,ni->n",
        error,
        np.linalg.solve(P[:, :6, :6] + 1e-30 * np.eye(6), error[..., None])[..., 0],
    )
    t = log["time"][late]
    weight = np.full(late.sum(), 0.01)
    weight[-1] = 0.005
    assert got["nees"] == pytest.approx((weight * square[late]).sum() / weight.sum(), rel=1e-6)
    taken, count = (np.ptp(log[name][late], axis=0).sum() for name in ("nis_sum", "nis_count"))
    assert got["nis"] == pytest.approx(taken / count, rel=1e-12)
    assert t[0] == pytest.approx(1.5)
    assert 0.1 < got["nis"] < 5.0


def test_a_run_without_sensors_has_no_errors_of_an_estimate(limited):
    _, got = limited
    assert not [name for name in got if name.startswith("estimate_")]


def cut():
    """A progress that interrupts a run after its second block, of at most 100 steps."""
    calls = []

    def progress(done):
        calls.append(done)
        if len(calls) == 2:
            raise KeyboardInterrupt

    return progress


class Ending(Constant):
    """A law that gives 1 N up to a time and no number from then on."""

    last: float = value(..., "s", "time of the last number")

    @staticmethod
    @kernel
    def law(
        t: float,
        x: Vector,
        memory: Vector,
        target: Vector,
        k: Any,
        table: Vector,
        tau: Vector,
        rate: Vector,
        signals: Vector,
        work: Vector,
    ) -> None:
        """The demand."""
        tau[0] = 1.0 if t <= k.last else math.nan
        tau[1] = 0.0


# A hull that its own damping drives leaves all numbers in finite time.
DRIVEN = NONLINEAR.model_copy(update={"X_uu": 300.0})
SHORT = {
    "interrupted": (corrected(actuator=Saturated()), True),
    "diverged": (corrected(vessel=DRIVEN, nominal=NONLINEAR, actuator=Saturated()), False),
}


@pytest.mark.parametrize("status", SHORT)
def test_the_last_instant_of_a_run_cut_short_counts_half_as_that_of_every_run(status):
    loop, interrupted = SHORT[status]
    cut_short = (
        {"progress": cut(), "compiled": False} if interrupted else {}
    )  # plain Python is slow
    log, got = gathered(loop, steady_fraction=1.0, **cut_short)
    assert log.status == status
    assert 1 < len(log["time"]) < 4001
    expected = by_definition(log, slice(None))
    assert {name: got[name] for name in expected} == pytest.approx(expected, rel=1e-12)


def test_what_pods_take_in_a_run_cut_short_is_that_of_its_log():
    pods = example(Pods, pods=tuple(Pod(**POD, y=y, power_nnn=0.01) for y in (-0.1, 0.1)))
    log, got = gathered(corrected(actuator=pods), steps=100_000, progress=cut())
    assert log.status == "interrupted"
    t = log["time"]
    assert got["energy_pod"] == pytest.approx(np.trapezoid(log["power"].sum(axis=1), t))
    for name in ("speed", "angle", "rate"):
        part = np.trapezoid(log[f"{name}_limited"], t) / t[-1]
        assert got[f"at_{name}_limit"] == pytest.approx(part, rel=1e-12)


def test_a_settled_part_that_a_run_did_not_reach_has_no_numbers():
    _, got = gathered(corrected(), steady_fraction=0.2, progress=cut(), compiled=False)
    for name in ("z_e_steady", "tv_tau_u", "tv_tau_r"):
        assert np.isnan(got[name])


@pytest.mark.parametrize(("until", "defined"), [(300, False), (301, True)])
def test_the_settled_part_has_numbers_from_its_second_instant_on(until, defined):
    """A law that returns no number from the next instant on ends the run there."""
    _, got = gathered(
        corrected(controller=Ending(last=until * 0.01)), steady_fraction=0.7, steps=1000
    )
    assert [not np.isnan(got[name]) for name in ("z_e_steady", "tv_tau_u")] == [defined] * 2


def test_a_run_without_any_instant_has_no_numbers():
    _, got = gathered(corrected(controller=Ending(last=-1.0)), steps=10)
    assert np.isnan(list(got.values())).all()


def test_the_integrals_of_a_single_instant_are_zero_and_its_means_undefined():
    log, got = gathered(corrected(controller=Ending(last=0.0)), steps=10)
    assert len(log["time"]) == 1
    assert got["iae"] == got["effort_u"] == got["energy"] == 0.0
    assert got["peak_tau_u"] == 1.0
    assert np.isnan([got[name] for name in ("rmse", "z_e_steady", "saturated_fraction")]).all()


@pytest.mark.parametrize("steps", [100, 1000, 31000, 100_000_000])
@pytest.mark.parametrize("percent", [1, 7, 20, 30, 43, 57, 70, 93, 99, 100])
def test_the_settled_part_begins_at_the_first_instant_that_belongs_to_it(steps, percent):
    grid = TimeGrid(0.01, steps)
    assert grid.last_part(percent / 100) == (100 - percent) * steps // 100 * 0.01


def test_a_thinned_log_leaves_metrics_as_they_are(limited):
    _, thin = gathered(corrected(actuator=Saturated()), log_every=50)
    assert thin == limited[1]


def test_settling_that_never_happens_is_no_number():
    _, got = gathered(corrected(), steps=200, radius=0.01)
    assert np.isnan(got["settling_time"])


def test_settled_from_the_start_is_zero():
    _, got = gathered(corrected(), steps=200, radius=100.0)
    assert got["settling_time"] == 0.0


def test_settling_is_read_between_the_instants():
    """z_e falls to 1 m in 5.4 s, jumps to 4 m, and falls for good, past 3 m at 20 s by 0.21 m/s."""
    for step in (0.3, 0.07):
        seen = np.zeros(SETTLING)
        for t in np.arange(0.0, 40.0, step):
            z_e = 3.0 - 0.37 * t if t < 5.4 else 3.0 - 0.21 * (t - 20.0) if t > 12.0 else 4.0
            settle(t, z_e, 2.0, 0, seen)
        assert settled_from(seen[CROSSED]) == pytest.approx(20.0 + 1.0 / 0.21, rel=1e-12)
    settle(40.0, 2.1, 2.0, 0, seen)
    assert math.isnan(settled_from(seen[CROSSED]))


def test_every_metric_is_computed_and_documented(limited):
    log, got = limited
    plan = Plan(corrected(), TimeGrid(0.01, 1))
    (cost,) = law_costs([(plan, log)])
    _, of_pods = gathered(corrected(actuator=example(Pods)), steps=10)
    trials = [corrected(controller=kind()) for kind in (TurningCircle, Zigzag, Stopping)]
    of_trials = {name for trial in trials for name in gathered(trial, steps=10)[1]}
    seeing = corrected(measurement=Sensors(), estimator=ExtendedKalmanFilter())
    of_estimates = set(gathered(seeing, steps=10)[1])
    of_path = set(gathered(corrected(path=example(Legs)), steps=10)[1])
    posed = corrected(actuator=SaturatedFull(), path=example(Poses))
    of_poses = set(gathered(posed, steps=10)[1])
    ferry = load("podusv:dp/ferry.yaml").scenario.actuator
    of_poses |= set(gathered(corrected(actuator=ferry, path=example(Poses)), steps=10)[1])
    always = {name for name in METRICS if NAMED not in name}
    compared = {metric.name for metric in (*OF_OPTIMUM.values(), *OF_LOG)} | set(OF_LOOP)
    simulated = (
        set(got | cost | operations(plan, log) | of_pods)
        | of_estimates
        | of_trials
        | of_path
        | of_poses
    )
    assert always == simulated | compared
    assert set(of_pods) > set(got)
    assert all(metric.unit and metric.meaning for metric in METRICS.values())


@pytest.mark.benchmark
def test_full_derivatives_cost_more_than_pid():
    """A replay that timed nothing would not tell the cheapest law from the dearest."""
    dear, cheap = corrected(controller=FullBackstepping()), corrected(controller=Pid())
    costs = law_costs(
        [(Plan(loop, TimeGrid(0.01, 1)), gathered(loop, steps=500)[0]) for loop in (dear, cheap)]
    )
    assert costs[0]["law_ns"] > 1.3 * costs[1]["law_ns"] > 0


def test_an_integral_that_left_the_finite_numbers_stays_infinite():
    seen = np.array([0.05, np.inf, 0.01, np.inf])
    assert close_integrals(seen, 2, 0.01).tolist() == pytest.approx([0.045, np.inf, 0.01, np.inf])


# --- metrics that a scenario names, against their definitions; in tables, claims and studies

WINDOWS = (("bend", (12.0, 31.0)), ("start", (0.0, 5.0)), ("rest", (35.004, 40.0)))
RADII = (("far", 9.0), ("near", 0.01))
SCENARIO = """
name: windows
vessel: {preset: paper_nonlinear}
path: {kind: line_circle}
disturbance: {kind: harmonic}
actuator: {kind: saturated}
controllers: {a: {kind: pid}, b: {kind: dsc}}
"""


def windowed(*, compiled=True, steps=4000, windows=WINDOWS, until=math.inf):
    """Log and metrics of a run of 40 s that is told of these windows."""
    loop, grid = corrected(actuator=Saturated()), TimeGrid(0.01, steps)
    known = metrics_with((), (windows, RADII))
    probe = metrics_probe(Plan(loop, grid), steady_fraction=0.2, settling_radius=1.0, known=known)

    def progress(done):
        if done >= until:
            raise KeyboardInterrupt

    run = simulate(loop, grid, probe=probe, compiled=compiled, progress=progress)
    return run, probe.summary(run.seen)


@pytest.fixture(scope="module")
def run():
    return windowed()


def test_an_error_over_a_window_follows_its_definition(run):
    log, got = run
    t, z_e = log["time"], log["z_e"]
    for name, (start, end) in WINDOWS:
        inside = (t >= start - 1e-9) & (t <= end + 1e-9)
        rms = np.sqrt(np.trapezoid(z_e[inside] ** 2, t[inside]) / np.ptp(t[inside]))
        assert got[f"error_{name}_rms"] == pytest.approx(rms, rel=1e-12)
        assert got[f"error_{name}_max"] == z_e[inside].max()
        assert got[f"e_{name}_max"] == abs(z_e[inside] - 0.5).max()


def test_a_further_radius_has_the_settling_time_of_that_radius(run):
    log, got = run
    t, z_e = log["time"], log["z_e"]
    assert got["settling_time_far"] == pytest.approx(crossing(t, z_e, 9.0), rel=1e-12)
    assert math.isnan(got["settling_time_near"])  # the standoff is larger


def test_a_window_ends_at_the_instant_that_rounds_beyond_it():
    """35 steps of 0.01 s are 0.35000000000000003 s; the last instant belongs to the window."""
    assert 35 * 0.01 > 0.35
    windows = (("short", (0.35, 0.57)), ("early", (0.07, 0.35)))
    log, got = windowed(steps=60, windows=windows)
    for name, first, last in (("short", 35, 57), ("early", 7, 35)):
        t, z_e = log["time"][first : last + 1], log["z_e"][first : last + 1]
        rms = np.sqrt(np.trapezoid(z_e**2, t) / np.ptp(t))
        assert got[f"error_{name}_rms"] == pytest.approx(rms, rel=1e-12)
        assert got[f"error_{name}_max"] == z_e.max()


def test_windows_are_the_same_in_machine_code_and_in_python():
    windows = (("early", (0.5, 1.5)),)
    (_, fast), (_, slow) = (windowed(compiled=c, steps=200, windows=windows) for c in (True, False))
    assert fast["error_early_rms"] > 0
    np.testing.assert_equal(fast, slow)


def test_a_run_that_ends_before_a_window_does_has_no_error_over_it():
    windows = (("over", (1.0, 2.0)), ("cut", (1.0, 2.004)), ("later", (50.0, 60.0)))
    _, got = windowed(steps=200, windows=windows)
    assert got["error_over_rms"] > 0
    for name in ("error_cut_rms", "error_later_rms", "error_cut_max", "error_later_max"):
        assert math.isnan(got[name])


def test_an_interrupted_run_has_the_windows_that_are_over():
    windows = (("over", (0.1, 0.5)), ("cut", (0.1, 35.0)))
    log, got = windowed(compiled=False, windows=windows, until=0.02)
    assert 0.5 < log["time"][-1] < 35
    assert got["error_over_max"] > 0
    assert math.isnan(got["error_cut_rms"])


def test_metrics_of_windows_stand_beside_the_other_errors_and_only_where_they_are_named():
    names = list(metrics_with((), (WINDOWS, RADII)))
    place = names.index("error_bend_rms")
    assert names.index("iae") < place < names.index("effort_u")
    assert not [name for name in METRICS if "bend" in name]
    plain = load_text(SCENARIO, "plain.yaml").scenario
    assert list(plain.known_metrics()) == [name for name in METRICS if NAMED not in name]
    got = plain.probe()
    assert not [n for n in got.summary(np.full(got.size, np.nan)) if n.startswith("error_")]


def named(windows, claim="a.error_line_rms < b.error_line_max"):
    text = f"metrics: {{windows: {windows}}}\nclaims:\n  C: {{says: x, source: y, expect: {claim}}}"
    return load_text(SCENARIO + text, "named.yaml")


def test_claims_and_studies_know_the_metrics_of_windows_and_no_others():
    loaded = named("{line: [60, 100]}")
    assert len(parse_claims(loaded)) == 1
    known = loaded.scenario.known_metrics()
    assert parse_success("error_line_rms < 1", known) is not None
    with pytest.raises(ScenarioError, match=r"error_line_rms"):
        parse_claims(named("{circle: [150, 310]}"))
    with pytest.raises(ScenarioError, match=r"error_NAME_rms"):
        parse_claims(named("{line: [60, 100]}", "a.error_NAME_rms < 1"))


@pytest.mark.parametrize(
    ("section", "told"),
    [
        ("{windows: {line: [5, 5]}}", "windows.line: must start at 0 s or later and end after"),
        ("{windows: {line: [-1, 5]}}", "windows.line: must start at 0 s or later and end after"),
        ("{windows: {line: [1]}}", "windows.line: must be a list of 2 numbers"),
        ("{windows: {Line: [1, 2]}}", "windows.Line: a name here is at most 30"),
        ("{radii: {near: 0}}", "radii.near: must be above 0 m, found 0"),
        ("{radii: {1st: 1}}", "radii.1st: a name here is at most 30"),
    ],
)
def test_a_window_that_cannot_be_is_told_with_its_place(section, told):
    with pytest.raises(ScenarioError, match=f"metrics.{told}"):
        load_text(SCENARIO + f"metrics: {section}", "wrong.yaml")


def test_the_name_of_a_metric_that_a_scenario_names_is_explained():
    metric = find("error_my_line_rms", METRICS)
    assert metric is not None
    assert metric.unit == "m"
    assert find("iae", METRICS) is METRICS["iae"]
    assert find("error__rms", METRICS) is None
    assert find("iae_line", METRICS) is None


def test_runs_with_windows_and_runs_without_share_a_table(podusv):
    write("two.yaml", TWO)
    short = ("--set", "simulation.duration=2", "--no-figures")
    lines = ("--set", "metrics.windows.line=[1,2]", *short)
    assert podusv("run", "two.yaml", "--controller", "soft", *short, "--out", "old").code == 0
    assert podusv("run", "two.yaml", "--controller", "soft", *lines, "--out", "new").code == 0
    told = podusv("compare", "old", "new", "--out", "both", "--no-figures")
    assert told.code == 0
    (row,) = [line.split() for line in told.out.splitlines() if line.endswith(" error_line_rms")]
    assert row[-3] == "-"
    assert float(row[-2].rstrip("*")) > 0
    assert podusv("plot", "old", "--out", "figures", "--only", "errors").code in (0, 2)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("e_ct_max", "anew at each change of legs, with up to `acceptance`"),
        ("at_rate_limit", "a pod turns as fast as its drive can"),
    ],
)
def test_what_a_metric_means_can_be_read_without_its_source(name, says, podusv):
    assert says in " ".join(podusv("explain", name).out.split())
