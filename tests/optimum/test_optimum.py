"""`podusv optimum`: a motion that Pontryagin's principle gives, the plant on symbols, refusals."""

import json
import math
import os
import signal
import sys
from fractions import Fraction
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from command_samples import BASE
from conftest import VESSELS
from scipy.integrate import quad

from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.component import Component
from podusv_cli.core.errors import NotConvergedError, UsageError
from podusv_cli.core.kernel import bundle, kernel, transplant
from podusv_cli.optimum import collocation, feedback
from podusv_cli.optimum.feedback import MOST_ROWS, _choose_rows
from podusv_cli.optimum.problem import Motion, problem
from podusv_cli.process.interrupts import interrupts_caught
from podusv_cli.scenario.load import load, load_text
from podusv_cli.storage.run_folder import open_run
from podusv_cli.workflows import optimum

REASON = "CasADi is not installed: podusv[optimum]"
# A target ahead that keeps its distance: between them only the thrust acts. Yawing would help, as
# turning abeam brakes without any force (the added mass is larger there), so the limit forbids it.
CHASE = """
vessel: {preset: paper, X_u: 0.0}
path: {kind: line, x: 2.0, speed: 0.5}
disturbance: {kind: none}
actuator: {kind: saturated, surge_limit: 8.0, yaw_limit: 1e-6}
start: {u: 0.5}
simulation: {duration: 5.0}
controller: {kind: pid, K_Pu: 100.0}
"""


def switching(distance: float, a: float, duration: float) -> tuple[float, float]:
    """When to reverse full thrust so that the integral of |e| is least, and the time of e = 0.

    With e'' = -a or a, e(0) = distance and e'(0) = 0. The costate of e' at t is the integral of
    (s - t) sign(e(s)) from t to the end. It is zero at the switch where
    (t_c - t)^2 = (T - t)^2/2, with e > 0 before t_c and e < 0 after it.
    """

    def caught(t: float) -> float:
        return 2.0 * t - math.sqrt(2.0 * t * t - 2.0 * distance / a)

    low, high = math.sqrt(distance / a) * (1 + 1e-12), math.sqrt(2.0 * distance / a)
    for _ in range(200):
        t = 0.5 * (low + high)
        late = (math.sqrt(2.0) - 1.0) * t - math.sqrt(2.0) * caught(t) + duration > 0.0
        low, high = (low, t) if late else (t, high)
    return t, caught(t)


@pytest.mark.slow
def test_full_thrust_is_reversed_when_pontryagin_says_so():
    pytest.importorskip("casadi", reason=REASON)
    chase = load_text(CHASE, "a.yaml").scenario
    a = 8.0 / chase.vessel.m11
    t_s, t_c = switching(2.0, a, 5.0)
    t = np.linspace(0.0, 5.0, 100_001)
    e = np.where(t < t_s, 2 - a * t**2 / 2, 2 + a * (t - 2 * t_s) ** 2 / 2 - a * t_s**2)
    assert 0.0 < t_s < t_c < 5.0
    assert (e[t < t_c - 1e-3] > 0).all()
    assert (e[t > t_c + 1e-3] < 0).all()  # what was assumed
    guess = Motion(np.array([0.0, 5.0]), np.zeros((2, 6)), np.zeros((2, 2)))
    stages, motion = collocation.search_optima(problem(chase, "iae"), {"rest": guess}, 0.05)
    known = np.trapezoid(abs(e), t)
    assert stages[-1].integral == pytest.approx(known, rel=1e-4)
    surge = motion.demands[:, 0]
    away = abs(motion.times - t_s) > 0.06  # the step in which it is reversed
    np.testing.assert_allclose(surge[away], np.where(motion.times < t_s, 8, -8)[away], atol=0.05)


def test_the_gaps_and_the_cost_of_a_segment_are_of_the_fifth_order_along_a_known_motion():
    """Surge u' = -d u + a t from u = 1: exponentials give u and x; the cost is of x^2."""
    pytest.importorskip("casadi", reason=REASON)
    chase = load_text(CHASE.replace("X_u: 0.0", "X_u: -20.0"), "a.yaml").scenario
    m, a = chase.vessel.m11, 1.5
    d = 20.0 / m

    def known(t: float) -> np.ndarray:
        fading, once = math.exp(-d * t), 1.0 + a / d**2
        x = once * (1.0 - fading) / d + a * t**2 / (2.0 * d) - a * t / d**2
        return np.array([x, 0, 0, once * fading + a * t / d - a / d**2, 0, 0, m * a * t, 0])

    def off(h: float) -> np.ndarray:
        """Gaps of x and u, and the error of the integral."""
        segment, nothing = collocation._segment(problem(chase, "ise"), h), np.zeros(3)
        still = [nothing] * 3 + [np.zeros(2)] * 3
        gaps, cost, _ = segment(known(0.0), known(h), *still, 0.0)
        return np.array(
            [*np.array(gaps)[[0, 3], 0], float(cost) - quad(lambda t: known(t)[0] ** 2, 0, h)[0]]
        )

    np.testing.assert_allclose(off(0.2) / off(0.1), 2.0**5, rtol=0.1)


def test_the_gains_are_those_of_the_linear_quadratic_regulator(monkeypatch):
    """At rest without damping surge and yaw are z'' = a; x^2 + u^2 + a^2/w^4 has these gains."""
    pytest.importorskip("casadi", reason=REASON)
    monkeypatch.setattr(feedback, "BANDWIDTH", w := 1.5)
    chase = load_text(CHASE.replace("X_u: 0.0", "X_u: 0.0, N_r: 0.0"), "a.yaml").scenario

    def first(h: float) -> np.ndarray:
        times = h * np.arange(round(8.0 / h) + 1)
        still = Motion(times, np.zeros((len(times), 6)), np.zeros((len(times), 2)))
        surge, yaw = feedback._gains(problem(chase, "iae"), still)[0]
        return np.stack([surge[[0, 3]] / chase.vessel.m11, yaw[[2, 5]] / chase.vessel.m33])

    found = 2.0 * first(0.005) - first(0.01)  # the trapezoidal rule's error is of the first order
    np.testing.assert_allclose(found, [[w**2, math.sqrt(2.0 * w**2 + w**4)]] * 2, rtol=3e-4)


def test_with_a_sway_force_the_regulator_has_the_same_gains_there():
    """The hull at rest without damping, whose sway and yaw go by themselves."""
    pytest.importorskip("casadi", reason=REASON)
    undamped = BESIDE.replace("  x_g: 0.0", "  x_g: 0.0\n  X_u: 0.0")
    beside = problem(load_text(undamped, "a.yaml").scenario, "iae")

    def first(h: float) -> np.ndarray:
        times = h * np.arange(round(14.0 / h) + 1)
        still = Motion(times, np.zeros((len(times), 6)), np.zeros((len(times), 3)))
        surge, yaw, sway = feedback._gains(beside, still)[0]
        hull = beside.loop.vessel
        own = (surge[[0, 3]] / hull.m11, yaw[[2, 5]] / hull.m33, sway[[1, 4]] / hull.m22)
        return np.stack(own)

    found = 2.0 * first(0.01) - first(0.02)
    np.testing.assert_allclose(found, [[1.0, math.sqrt(3.0)]] * 3, rtol=3e-4)


def test_the_plant_on_symbols_is_the_plant():
    pytest.importorskip("casadi", reason=REASON)
    random = np.random.default_rng(3)
    for vessel in VESSELS.values():
        rate = collocation.dynamics(bundle(vessel.constants()))
        for _ in range(20):
            x, tau, b = random.normal(0, 1, 6), random.normal(0, 5, 3), random.normal(0, 1, 3)
            tau[1] = 0.0
            expected = np.zeros(6)
            plant(x, tau, b, bundle(vessel.constants()), expected)
            np.testing.assert_allclose(
                np.array(rate(x, tau[[0, 2]], b)).ravel(), expected, rtol=1e-12, atol=1e-13
            )


@kernel
def third(x):
    return float(x) / 3.0


@kernel
def arithmetic(x):
    return third(x) + math.sqrt(x)


def test_a_kernel_is_transplanted_with_all_that_it_calls():
    class Roots:
        def sqrt(self, x):
            return x / 2

    found = transplant(arithmetic, {math: Roots(), float: Fraction})
    assert found(Fraction(1)) == Fraction(1) / 3.0 + Fraction(1, 2)
    other = transplant(arithmetic, {third: lambda x: -x, math: Roots()})
    assert other(4.0) == -2.0
    assert arithmetic(9.0) == 6.0  # as it was


SHORT = BASE.replace("duration: 1.0", "duration: 8.0").replace("none", "harmonic")


def test_the_command_writes_a_run_that_is_repeated_and_beats_the_law(podusv):
    pytest.importorskip("casadi", reason=REASON)
    Path("a.yaml").write_text(SHORT)
    words = ("optimum", "a.yaml", "--step", "0.2", "--no-figures", "--json")
    told = json.loads(podusv(*words, "--set", "control.period=0.1").out)
    assert told["run"] == str(Path("results/a/optimum"))
    assert told["metrics"]["iae"] == pytest.approx(told["grids"][-1]["integral"], rel=2e-3)
    assert [grid["step"] for grid in told["grids"]] == pytest.approx([0.8, 0.8, 0.4, 0.2])
    starts = [grid["start"] for grid in told["grids"]]
    assert starts[:2] == ["pid", "velocity_vector"]
    better = min(told["grids"][:2], key=lambda grid: grid["integral"])
    assert starts[2:] == [better["start"]] * 2
    assert told["departures"]["position"] < 0.01
    assert podusv("run", "a.yaml", "--no-figures", "--out", "law").code == 0
    assert told["metrics"]["iae"] < 0.96 * open_run(Path("law")).metrics["iae"]
    assert podusv("rerun", "results/a/optimum").code == 0
    repeated = load("results/a/optimum/resolved.yaml").scenario
    assert repeated.controller.minimises == "iae"
    assert repeated.control.period == 0.0  # it acts continuously, whatever the law does


def test_grids_and_departures_are_told_and_a_second_optimum_has_a_name_of_its_own(podusv):
    pytest.importorskip("casadi", reason=REASON)
    Path("a.yaml").write_text(SHORT)
    Path("results/a/optimum").mkdir(parents=True)
    words = ("--minimise", "ise", "--step", "1", "--no-figures", "--set", "simulation.duration=4")
    said = podusv("optimum", "a.yaml", *words)
    assert said.code == 0, said.err
    head, *grids = (line.split() for line in said.out.splitlines()[:5])
    assert head == ["from", "a", "run", "of", "step", "ise", "[m2", "s]", "iterations", "time"]
    assert [grid[1:3] for grid in grids] == [["4", "s"], ["4", "s"], ["2", "s"], ["1", "s"]]
    assert "a local optimum" in said.out
    assert "repeated by podusv: ise" in said.out
    assert said.out.splitlines()[-1] == f"finished: {Path('results/a/optimum-2')}"


@pytest.mark.slow
def test_the_square_has_an_optimum_of_its_own():
    pytest.importorskip("casadi", reason=REASON)
    scenario = load_text(SHORT, "a.yaml").scenario
    guess = Motion(np.array([0.0, 8.0]), np.zeros((2, 6)), np.zeros((2, 2)))
    found = {
        name: collocation.search_optima(problem(scenario, name), {"rest": guess}, 0.4)[1]
        for name in ("iae", "ise")
    }
    places = problem(scenario, "iae").places(found["iae"].times)
    away = {name: np.hypot(*(m.states[:, :2] - places).T) for name, m in found.items()}
    for power, best, other in ((1, "iae", "ise"), (2, "ise", "iae")):
        assert (away[best] ** power).sum() < (away[other] ** power).sum()


def test_without_casadi_a_sentence_says_what_to_install(podusv, monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    Path("a.yaml").write_text(SHORT)
    said = podusv("optimum", "a.yaml")
    assert (said.code, said.out) == (2, "")
    assert said.err == "podusv optimum needs CasADi: pip install 'podusv[optimum]'\n"
    assert not Path("results").exists()


class Leaning(Disturbance):
    """A load that depends on the state, or does not say that it does not."""

    kind: Literal["leaning"] = "leaning"


def replaced(**parts: Component):
    return load_text(SHORT, "a.yaml").scenario.model_copy(update=parts)


def test_what_the_solver_cannot_take_is_refused_in_a_sentence():
    pods = load_text(SHORT.replace("{kind: saturated}", "{kind: pod, preset: otter}"), "a.yaml")
    with pytest.raises(UsageError) as raised:
        problem(pods.scenario, "iae")
    assert str(raised.value) == (
        "a: actuator.kind: pod does not fit; podusv optimum knows actuators that deliver the "
        "demand up to constant limits: ideal, saturated, ideal_full, saturated_full"
    )
    with pytest.raises(UsageError, match=r"a: disturbance\.kind: leaning does not fit"):
        problem(replaced(disturbance=Leaning()), "iae")


def test_an_interrupt_ends_the_solver_at_its_next_iteration():
    pytest.importorskip("casadi", reason=REASON)
    wanted = problem(load_text(SHORT, "a.yaml").scenario, "iae")
    guess = Motion(np.array([0.0, 8.0]), np.zeros((2, 6)), np.zeros((2, 2)))
    told = []

    def interrupt(what: str, fraction: float) -> None:
        told.append(fraction)
        if len(told) == 3:
            os.kill(os.getpid(), signal.SIGINT)

    with interrupts_caught(), pytest.raises(KeyboardInterrupt):
        collocation.search_optima(wanted, {"rest": guess}, 0.4, interrupt)
    assert 3 <= len(told) <= 4


def test_a_solver_that_does_not_converge_is_told_and_nothing_is_written(podusv, monkeypatch):
    pytest.importorskip("casadi", reason=REASON)
    monkeypatch.setattr(collocation, "MOST_ITERATIONS", 1)
    Path("a.yaml").write_text(SHORT)
    said = podusv("optimum", "a.yaml", "--step", "0.5")
    assert said.code == NotConvergedError.exit_code == 3
    assert said.err.startswith("IPOPT found no optimum with a step of 2 s in ")
    assert not list(Path().glob("results/a/*"))


WILD = ("--set", "controller.K_Pu=1e9", "--set", "actuator.kind=ideal")


def test_a_law_that_diverges_is_no_beginning(podusv, monkeypatch):
    pytest.importorskip("casadi", reason=REASON)
    begun = []

    def stop(problem, guesses, *rest):
        begun.extend(guesses)
        raise NotConvergedError("enough")

    monkeypatch.setattr(collocation, "search_optima", stop)
    Path("a.yaml").write_text(SHORT)
    assert podusv("optimum", "a.yaml", *WILD).code == 3
    assert begun == ["velocity_vector"]
    monkeypatch.setattr(optimum, "BESIDE", Pid(K_Pu=1e9))
    said = podusv("optimum", "a.yaml", *WILD)
    assert said.code == 2
    assert "a: the search begins from runs of laws, and all of these diverge (pid: div" in said.err


def test_every_law_of_a_comparison_is_a_beginning_unless_one_is_chosen(podusv, monkeypatch):
    pytest.importorskip("casadi", reason=REASON)
    begun = []

    def stop(problem, guesses, *rest):
        begun.append([*guesses])
        raise NotConvergedError("enough")

    monkeypatch.setattr(collocation, "search_optima", stop)
    Path("a.yaml").write_text(SHORT + "controllers: {stiff: {K_Pu: 200.0}, soft: {K_Pu: 5.0}}\n")
    podusv("optimum", "a.yaml")
    podusv("optimum", "a.yaml", "--controller", "soft")
    assert begun[0] == ["stiff", "soft", "velocity_vector"]
    assert begun[1] == ["pid", "velocity_vector"]


def test_a_taken_place_is_told_before_anything_is_computed(podusv, monkeypatch):
    pytest.importorskip("casadi", reason=REASON)
    monkeypatch.setattr(collocation, "search_optima", None)
    Path("a.yaml").write_text(SHORT)
    Path("there").mkdir()
    Path("there/mine").write_text("")
    said = podusv("optimum", "a.yaml", "--out", "there")
    assert said.code == 5
    assert said.err.startswith("there exists")


# --- runs held against an optimum of the same task in a comparison; the rows that an optimum keeps

BEST = BASE.replace(
    "controller: {kind: pid, K_Pu: 100.0}",
    'controller: {kind: schedule, rows: "0, 8, 0.5\\n1, 8, 0.5", minimises: iae}',
)


def made(podusv, name, text, *words):
    """A finished run in a folder of this name."""
    Path(f"{name}.yaml").write_text(text)
    assert podusv("run", f"{name}.yaml", "--no-figures", "--out", name, "-q", *words).code == 0
    return open_run(Path(name)).metrics


def compared(podusv, *items):
    """Exit code, ratios by run, and what is missing."""
    said = podusv("compare", *items, "--no-figures", "--json", "--out", "c", "--force")
    told = json.loads(said.out)
    return said.code, told["comparison"].get("iae_of_optimum"), told["missing"]


def test_every_run_of_the_task_has_its_ratio_to_the_optimum(podusv):
    best, law = made(podusv, "best", BEST), made(podusv, "law", BASE)
    code, ratios, missing = compared(podusv, "law", "best")
    assert (code, missing) == (0, [])
    assert ratios == {"law": pytest.approx(law["iae"] / best["iae"], rel=1e-12), "best": 1.0}
    assert ratios["law"] > 1.0
    assert "iae_of_optimum" in Path("c/comparison.md").read_text()


def test_without_an_optimum_there_is_no_such_row(podusv):
    made(podusv, "law", BASE)
    assert compared(podusv, "law")[1:] == (None, [])


def test_of_two_optima_the_lower_counts(podusv):
    made(podusv, "worse", BEST.replace("0, 8, 0.5", "0, 1, 0"))
    made(podusv, "best", BEST)
    ratios = compared(podusv, "worse", "best")[1]
    assert ratios["best"] == 1.0 < ratios["worse"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "what"),
    [
        ("start.x=-4", "start"),
        ("actuator.surge_limit=9", "actuator"),
        ("vessel.X_u=-1", "vessel"),
        ("path.speed=0.4", "path"),
        ("disturbance.kind=harmonic", "disturbance"),
        ("simulation.duration=0.9", "simulation.duration"),
    ],
)
def test_a_run_of_another_task_is_not_related_and_a_sentence_says_why(podusv, change, what):
    made(podusv, "best", BEST)
    made(podusv, "other", BASE, "--set", change)
    code, ratios, missing = compared(podusv, "best", "other")
    assert code == 0
    assert ratios == {"best": 1.0, "other": None}
    assert missing == [
        f"iae_of_optimum of other could not be made: the optimum best has another {what}"
    ]


def test_what_only_a_law_is_told_makes_no_other_task(podusv):
    made(podusv, "best", BEST)
    made(podusv, "wrong", BASE, "--set", "nominal.X_u=-1", "--set", "control.period=0.1")
    assert compared(podusv, "best", "wrong")[2] == []


def test_a_long_motion_keeps_the_rows_where_its_demand_bends():
    assert _choose_rows(np.zeros((100, 2))) == list(range(100))
    demands = np.zeros((3 * MOST_ROWS, 2))
    demands[5001:] = 8.0, 0.0
    kept = _choose_rows(demands)
    assert {0, 5000, 5001, len(demands) - 1} <= set(kept)
    assert len(kept) <= MOST_ROWS + 1
    assert np.diff(kept).max() <= 6


# --- three demands

BESIDE = """
vessel:
  preset: cybership2_linear
  Y_v: 0.0
  Y_r: 0.0
  N_v: 0.0
  N_r: 0.0
  Y_rdot: 0.0
  N_vdot: 0.0
  x_g: 0.0
path: {kind: hold, y: 2.0}
disturbance: {kind: none}
actuator: {kind: saturated_full, surge_limit: 1e-6, sway_limit: 4.0, yaw_limit: 1e-6}
start: {u: 0.0}
simulation: {duration: 8.0}
controller: {kind: pose_pid}
"""


def test_full_sway_force_is_reversed_when_pontryagin_says_so():
    """The target lies abeam: the same switch as ahead, by the sway force alone."""
    pytest.importorskip("casadi", reason=REASON)
    chase = load_text(BESIDE, "a.yaml").scenario
    a = 4.0 / chase.vessel.m22
    t_s, t_c = switching(2.0, a, 8.0)
    t = np.linspace(0.0, 8.0, 100_001)
    e = np.where(t < t_s, 2 - a * t**2 / 2, 2 + a * (t - 2 * t_s) ** 2 / 2 - a * t_s**2)
    assert 0.0 < t_s < t_c < 8.0
    guess = Motion(np.array([0.0, 8.0]), np.zeros((2, 6)), np.zeros((2, 3)))
    stages, motion = collocation.search_optima(problem(chase, "iae"), {"rest": guess}, 0.1)
    assert stages[-1].integral == pytest.approx(np.trapezoid(abs(e), t), rel=3e-4)
    away = abs(motion.times - t_s) > 0.11
    known = np.where(motion.times < t_s, 4, -4)[away]
    np.testing.assert_allclose(motion.demands[:, 2][away], known, atol=0.05)


AWAY = """
vessel: {preset: cybership2}
path: {kind: poses, poses: [[0, 0, 0.3], [1.5, 1, 1.2]], travel: 8.0, dwell: 1.0}
disturbance: {kind: step, b_v: 0.3}
actuator: {kind: saturated_full}
start: {x: -1.0, y: 1.5, psi: 0.3}
simulation: {step: 0.02, duration: 20.0}
controller: {kind: pose_pid}
"""


@pytest.mark.long
def test_an_optimum_with_a_sway_force_is_repeated_and_beats_the_law(podusv):
    pytest.importorskip("casadi", reason=REASON)
    Path("a.yaml").write_text(AWAY)
    said = podusv("optimum", "a.yaml", "--no-figures", "--out", "o", "--step", "0.2", "--json")
    told = json.loads(said.out)
    found, law = (
        told["grids"][-1]["integral"],
        json.loads(podusv("run", "a.yaml", "--no-figures", "--out", "r", "--json").out),
    )
    assert told["metrics"]["iae"] == pytest.approx(found, rel=2e-3)
    assert told["departures"]["position"] < 5e-3
    assert found < 0.95 * law["metrics"]["iae"]
    run = open_run(Path("o")).recording
    assert np.abs(run["tau_v"]).max() == pytest.approx(2.0, abs=1e-6)
    assert told["departures"]["feedback_v"] < 0.2
