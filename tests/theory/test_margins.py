"""Margins: transfer functions, algebra, other linearisations, simulated delays, what is told."""

import json
import math
import re
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from command_samples import BASE
from conftest import VESSELS, corrected, run
from continuous import continuous
from findings_samples import scene
from law_samples import STEADY
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import podusv
from podusv_cli.comparison import table
from podusv_cli.components.actuators.command import Command
from podusv_cli.components.actuators.ideal import Ideal
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.adrc import Adrc
from podusv_cli.components.controllers.base import Controller, Slots, each
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.measurements.sensors import Sensors
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.line_circle import LineCircle
from podusv_cli.components.paths.sinusoid import Sinusoid
from podusv_cli.core.component import value
from podusv_cli.core.errors import LawError, NotConvergedError
from podusv_cli.core.kernel import Vector, kernel
from podusv_cli.core.signal import Signal
from podusv_cli.engine.loop.closed_loop import LOADS, ClosedLoop
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.findings import stability
from podusv_cli.metrics.margins import OF_LOOP
from podusv_cli.theory import steady
from podusv_cli.theory.course import course
from podusv_cli.theory.loop_margins import LoopMargins, loop_margins
from podusv_cli.theory.margins import Cut, _roots, delay_margin, margins, stable

GRID = TimeGrid(0.01, 3000)


def fed_back(gain: float, numerator: list[float], denominator: list[float]) -> Cut:
    """gain * numerator/denominator in controllable form, closed by unity feedback."""
    n = len(denominator) - 1
    A = np.eye(n, k=1)
    A[-1] = -np.array(denominator[:0:-1])
    B, C = np.zeros((n, 1)), np.zeros((1, n))
    B[-1] = 1.0
    C[0, : len(numerator)] = -gain * np.array(numerator[::-1])
    return Cut(A + B @ C, B, C)


# --- margins of transfer functions, by hand


def test_the_gain_of_a_triple_lag_may_grow_until_rouths_limit():
    measured = margins(fed_back(2.0, [1.0], [1.0, 3.0, 2.0, 0.0]))  # 2/(s (s + 1) (s + 2))
    assert measured.gain_margin == pytest.approx(6.0 / 2.0, rel=1e-9)
    assert measured.gain_reduction == 0.0
    (omega,) = measured.crossovers
    assert abs(2.0 / (1j * omega * (1j * omega + 1) * (1j * omega + 2))) == pytest.approx(1.0)
    phase = math.pi / 2 - math.atan(omega) - math.atan(omega / 2)
    assert measured.phase_margin == pytest.approx(phase, rel=1e-9)
    assert measured.delay_margin == pytest.approx(phase / omega, rel=1e-9)


def test_an_unstable_plant_needs_its_gain():
    measured = margins(fed_back(2.0, [1.0], [1.0, -1.0]))  # 2/(s - 1), stable for gains above 1
    assert measured.gain_reduction == pytest.approx(0.5, rel=1e-12)
    assert measured.gain_margin == math.inf
    assert measured.crossovers == pytest.approx([math.sqrt(3.0)])
    assert measured.phase_margin == pytest.approx(math.pi / 3.0)
    assert measured.delay_margin == pytest.approx(math.pi / 3.0 / math.sqrt(3.0))
    assert measured.peak_S == pytest.approx(1.0)
    assert measured.peak_T == pytest.approx(2.0, rel=1e-4)  # at 0


def test_of_several_gains_that_the_loop_needs_the_nearest_to_its_own_is_told():
    """4 (s + 1)^6/s^7 crosses the negative real axis twice beyond -1."""
    numerator, denominator = list(np.poly(-np.ones(6))), [1.0, *[0.0] * 7]

    def loop(gain: float) -> Cut:
        return fed_back(4.0 * gain, numerator, denominator)

    # arg L = 6 atan(w) - 7 pi/2 is -pi at tan(5 pi/12), and -3 pi at tan(pi/12).
    crossed = [math.tan(math.pi * n / 12.0) for n in (1.0, 5.0)]
    gains = [w**7 / (4.0 * (1.0 + w * w) ** 3) for w in crossed]
    assert gains[0] < gains[1] < 1.0
    assert margins(loop(1.0)).gain_reduction == pytest.approx(gains[1], rel=1e-9)
    assert [stable(loop(gains[1] * near).A) for near in (0.999, 1.001)] == [False, True]


def test_a_sharp_resonance_is_found_with_its_peak_and_all_crossovers():
    zeta = 1e-4  # L = 0.1/(s^2 + 2 zeta s + 1) is above 1 in a band around 1 rad/s
    measured = margins(fed_back(0.1, [1.0], [1.0, 2 * zeta, 1.0]))
    exact = [math.sqrt(1 - 0.1), math.sqrt(1 + 0.1)]
    assert measured.crossovers == pytest.approx(exact, rel=1e-6)
    assert measured.peak_S == pytest.approx(0.1 / (2 * zeta * math.sqrt(1.1)), rel=1e-3)


def test_a_lead_is_a_lag_of_a_turn_less():
    measured = margins(
        fed_back(-0.1, [1.0], [1.0, 2e-4, 1.0])
    )  # from -1 a lead, then nearly half a turn
    low, high = measured.crossovers
    lead, lag = math.atan(2e-4 * low / 0.1), math.pi + math.atan(2e-4 * high / 0.1)
    assert measured.phase_margin == pytest.approx(lead, rel=1e-3)
    assert measured.delay_margin == pytest.approx(
        min((2 * math.pi - lead) / low, lag / high), rel=1e-6
    )


def test_a_root_at_a_frequency_that_is_looked_at_counts_once():
    omega = np.array([0.5, 1.0, 2.0])
    assert _roots(lambda w: 1.0 - w, omega, 1.0 - omega) == pytest.approx([1.0])
    assert _roots(lambda w: w - 1.0, omega, omega - 1.0) == pytest.approx([1.0])


def test_an_undamped_plant_has_margins():
    loop = margins(fed_back(1.0, [1.0, 0.0], [1.0, 0.0, 1.0]))  # s/(s^2 + 1), infinite at 1 rad/s
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    assert loop.crossovers == pytest.approx([1.0 / golden, golden])
    assert loop.phase_margin == pytest.approx(math.pi / 2.0)


def test_a_loop_that_never_reaches_one_has_no_limit_and_an_unstable_one_no_margin():
    weak = margins(fed_back(0.5, [1.0], [1.0, 1.0]))
    assert (weak.phase_margin, weak.delay_margin, weak.gain_margin) == (math.inf,) * 3
    lost = margins(fed_back(7.0, [1.0], [1.0, 3.0, 2.0, 0.0]))
    assert math.isnan(lost.phase_margin)
    assert math.isnan(lost.gain_margin)


def test_loops_that_do_not_touch_have_the_shorter_delay_together():
    one, other = fed_back(2.0, [1.0], [1.0, 0.0]), fed_back(5.0, [1.0], [1.0, 0.0])
    zeros = np.zeros((1, 1))
    both = Cut(
        *(np.block([[getattr(one, k), zeros], [zeros, getattr(other, k)]]) for k in ("A", "B", "C"))
    )
    assert delay_margin(both) == pytest.approx(math.pi / 2 / 5.0)


# --- a simple law, by algebra


class Proportional(Controller):
    """Holds the target's speed and a heading of zero."""

    kind: Literal["proportional"] = "proportional"
    k: float = value(40.0, "kg/s", "gain", gt=0)

    @staticmethod
    @kernel
    def law(x: Vector, target: Vector, k: Any, tau: Vector) -> None:
        """Plain proportional control of speed and heading."""
        tau[0] = -k.k * (x[3] - target[2]) - k.X_u * target[2]
        tau[1] = -3.0 * x[2] - 6.0 * x[5]


def calm(law: Controller, **parts: Any) -> ClosedLoop:
    return corrected(controller=law, path=Line(speed=0.5), disturbance=Calm(), **parts)


def test_a_proportional_law_has_the_loop_of_its_formula():
    hull = VESSELS["paper"]
    loop = calm(Proportional(), vessel=hull, nominal=hull)
    measured = loop_margins(loop, TimeGrid(0.01, 500), compiled=False).loops["surge"]
    k, m, d = 40.0, hull.m11, -hull.X_u
    omega = math.sqrt(k * k - d * d) / m
    phase = math.pi - math.atan(m * omega / d)
    assert measured.crossovers == pytest.approx([omega], rel=1e-7)
    assert measured.phase_margin == pytest.approx(phase, rel=1e-7)
    assert measured.delay_margin == pytest.approx(phase / omega, rel=1e-7)
    s = 1j * measured.omega
    np.testing.assert_allclose(measured.S, abs((m * s + d) / (m * s + d + k)), rtol=1e-6)
    np.testing.assert_allclose(measured.T, abs(k / (m * s + d + k)), rtol=1e-6)


class Idle(Proportional):
    """The same, with a memory that changes by rounding alone."""

    kind: Literal["idle"] = "idle"  # type: ignore[assignment]

    def slots(self) -> Slots:
        """One number."""
        return each((Signal("idle_sum", "1", "sum of next to nothing"),))

    @staticmethod
    @kernel
    def law(x: Vector, target: Vector, k: Any, tau: Vector, rate: Vector) -> None:
        """Plain proportional control of speed and heading."""
        tau[0] = -k.k * (x[3] - target[2]) - k.X_u * target[2]
        tau[1] = -3.0 * x[2] - 6.0 * x[5]
        rate[0] = 1e-17 * x[3]


def test_a_memory_that_changes_by_rounding_does_not_move():
    hull = VESSELS["paper"]
    plain, idle = (
        loop_margins(calm(law, vessel=hull, nominal=hull), TimeGrid(0.01, 500), compiled=False)
        for law in (Proportional(), Idle())
    )
    assert idle.linear.states == plain.linear.states
    assert idle.numbers() == pytest.approx(plain.numbers())


# --- the laws of the paper and ours


@cache
def of(law: Controller, **parts: Any) -> LoopMargins:
    return loop_margins(calm(law, **parts), GRID)


@pytest.mark.parametrize("law", [AdaptiveNeural(), Pid()])
def test_the_fast_loops_have_the_delay_margin_of_their_own_linearisation(law):
    """Against `velocity_loops` by hand, whose delayed roots come from a collocation."""
    told = scene(f"controller={{kind: {law.label}}}", "disturbance={kind: none}")
    for loop in stability.loops(told, np.array([0.5, 0.0, 0.0])):
        axis = {"surge": "surge", "yaw": "yaw"}[loop.axis]
        alone = stability.delay_margin(loop, 1.0)
        assert of(law).loops[axis].delay_margin == pytest.approx(alone, rel=0.02)


def test_the_sensitivity_peaks_where_hull_and_adaptation_resonate():
    """At sqrt(Gamma m11 |Phi|^2), see results/claim.md."""
    (loop, _) = stability.loops(scene("disturbance={kind: none}"), np.array([0.5, 0.0, 0.0]))
    resonance = math.sqrt(-loop.feedback[1] * loop.memory[0, 0])
    surge = of(AdaptiveNeural()).loops["surge"]
    assert surge.omega[surge.S.argmax()] == pytest.approx(resonance, rel=0.02)
    assert surge.peak_S == pytest.approx(1.0 / (2.0 * math.sin(surge.phase_margin / 2.0)), rel=0.02)


def growth(law: Controller, delay: float, step: float, duration: float, signal: str) -> float:
    """Rate [1/s] at which an oscillation grows in a run with a delayed command."""
    loop = calm(
        law, actuator=Ideal(command=Command(delay=delay)), start=(-0.02, 0.01, 0.0, 0.5, 0.0, 0.0)
    )
    log = run(loop, duration, step)
    swing = np.gradient(log[signal], log["time"])
    late = [np.std(part) for part in np.array_split(swing, 4)[2:]]
    return math.log(late[1] / late[0]) / (0.25 * duration)


@pytest.mark.parametrize(
    ("law", "step", "duration", "signal"),
    [
        (VelocityVector(), 5e-3, 80.0, "v"),
        (Pid(standoff=0.5), 2.5e-4, 6.0, "tau_u_cmd"),
        (AdaptiveNeural(standoff=0.5, anti_windup="auxiliary"), 1e-3, 20.0, "tau_r_cmd"),
    ],
)
def test_a_simulated_command_may_be_late_by_the_delay_margin(law, step, duration, signal):
    margin = of(law).delay_margin
    shorter, longer = (step * round(part * margin / step) for part in (0.96, 1.04))
    rates = [growth(law, delay, step, duration, signal) for delay in (shorter, longer)]
    assert rates[0] < 0.0 < rates[1], (margin, rates)


class Untold(VelocityVector):
    """The same law that takes its demand for the load: any delay is behind what it is told."""

    def wants_loads(self) -> bool:
        """Not the loads that act."""
        return False


def test_both_loads_may_be_late_by_the_delay_margin_of_loads():
    behind = of(VelocityVector()).delay_margin_loads
    assert behind == pytest.approx(of(Untold()).delay_margin, rel=1e-6)
    assert behind < 0.8 * of(VelocityVector()).delay_margin
    rates = [growth(Untold(), round(part * behind, 2), 5e-3, 80.0, "v") for part in (0.96, 1.04)]
    assert rates[0] < 0.0 < rates[1], rates


def test_a_law_that_is_told_the_loads_bears_more_delay_before_the_actuator_than_behind_it():
    told, untold = (
        AdaptiveNeural(standoff=0.5, anti_windup="auxiliary"),
        AdaptiveNeural(standoff=0.5),
    )
    assert of(untold).delay_margin == pytest.approx(
        of(untold).loops["surge"].delay_margin, rel=1e-3
    )
    assert of(told).loops["surge"].delay_margin == pytest.approx(
        of(untold).loops["surge"].delay_margin, rel=1e-3
    )
    assert of(told).delay_margin > 10.0 * of(untold).delay_margin


# --- the steady motion


def test_on_a_circle_small_deviations_go_as_the_linearised_loop_says():
    """Against the loop's own equation with a target that moves, for a law with a heading in it."""
    loop = corrected(
        controller=Adrc(),
        path=Circle(radius=8.0),
        disturbance=STEADY,
        start=(8.0, 0.0, np.pi / 2, 0.5, 0.0, 0.0625),
    )
    linear = loop_margins(loop, TimeGrid(0.01, 10_000)).linear
    assert linear.course.turn == pytest.approx(0.5 / 8.0)
    slope, _ = continuous(loop, 200.0)
    s0 = last_of(loop, linear.course.time)
    deviation = 1e-5 * np.arange(1.0, 1.0 + len(s0))
    t0, t1 = linear.course.time, linear.course.time + 2.0
    ends = [
        solve_ivp(slope, (t0, t1), s, rtol=1e-10, atol=1e-12).y[:, -1] for s in (s0, s0 + deviation)
    ]
    seen = ends[1] - ends[0]
    back = linear.course.turn * (t0 - t1)
    turned = np.array([[math.cos(back), -math.sin(back)], [math.sin(back), math.cos(back)]])
    seen[:2] = turned @ seen[:2]
    np.testing.assert_allclose(seen, expm(2.0 * linear.A) @ deviation, atol=1e-8, rtol=2e-3)


def last_of(loop: ClosedLoop, time: float) -> Vector:
    """The state of a settled run."""
    log = run(loop, time, log_every=round(time / 0.01))
    names = ("x", "y", "psi", "u", "v", "r", *(part.name for part, _ in loop.controller.slots()))
    return np.array([log[name][-1] for name in names])


def test_a_delay_sensors_and_sampling_are_left_out_and_told():
    delayed = calm(
        Pid(standoff=0.5), actuator=Ideal(command=Command(delay=0.1)), measurement=Sensors()
    )
    measured = loop_margins(delayed, TimeGrid(0.01, 3000, hold_every=5))
    assert measured.left_out == (
        "measurement and estimator",
        "the sampling of the law every 0.05 s",
        "the command's delay of 0.1 s",
    )
    assert measured.numbers() == pytest.approx(of(Pid(standoff=0.5)).numbers(), rel=1e-6)


def test_the_last_straight_line_is_taken_before_any_circle():
    path = LineCircle()
    last = course(path, 310.0)
    assert last.turn == 0.0
    assert 98.0 < last.time < 100.0
    later = course(path, 310.0, 200.0)
    assert later.turn == pytest.approx(0.03)
    assert later.speed == pytest.approx(0.5)
    with pytest.raises(NotConvergedError, match=r"not at t = 100 s, .* --at SECONDS"):
        course(path, 310.0, 100.0)
    with pytest.raises(NotConvergedError, match="at no time of the run"):
        course(Sinusoid(), 310.0)


def test_a_law_that_does_not_settle_has_no_margins():
    weak = calm(VelocityVector(), actuator=Saturated(surge_limit=0.01, yaw_limit=2.5))
    with pytest.raises(
        NotConvergedError, match=r"no steady motion was found: .* m from the target"
    ):
        loop_margins(weak, TimeGrid(0.01, 1000))


@pytest.mark.long
def test_a_law_that_stays_near_and_never_rests_is_told_with_its_distance(monkeypatch):
    """The network never rests with the load held; a plain run says how far off it is meanwhile."""
    monkeypatch.setattr(steady, "MOST_EVALUATIONS", 3000)
    law = podusv.load("podusv:laws/learned.yaml").singles()["policy"]
    with pytest.raises(NotConvergedError) as told:
        loop_margins(law.closed_loop(), law.time_grid())
    form = r"is (\S+) m .* t = (\S+) s; .* held for (\S+) s it is between (\S+) m and (\S+) m"
    there, time, seconds, near, far = map(float, re.search(form, str(told.value)).groups())
    run = podusv.simulate(law, {"simulation.duration": time}).recording
    assert there == pytest.approx(run["z_e"][-1], rel=6e-3)  # three digits are told
    held = {
        "start": {name: float(run[name][-1]) for name in ("x", "y", "psi", "u", "v", "r")},
        "path": {"kind": "line", "x": float(run["x_d"][-1])},
        "disturbance": {"kind": "step", **{b: float(run[b][-1]) for b in LOADS[3:]}},
        "simulation.duration": math.ceil(seconds),
    }
    left = podusv.simulate(law, held).recording
    late = left["z_e"][(left["time"] >= seconds / 2) & (left["time"] <= seconds)]
    assert (near, far) == (pytest.approx(late.min(), rel=0.02), pytest.approx(late.max(), rel=0.02))
    assert far < 0.06


def test_a_corner_at_the_steady_motion_has_no_derivative():
    edge = Saturated(surge_limit=1e-9 - VESSELS["paper"].X_u * 0.5)
    hull = VESSELS["paper"]
    loop = calm(Proportional(), vessel=hull, nominal=hull, actuator=edge)
    with pytest.raises(NotConvergedError, match="no derivative by u at the steady motion: a limit"):
        loop_margins(loop, TimeGrid(0.01, 500), compiled=False)


def test_a_target_within_reach_of_the_hull_is_told_to_be_singular():
    near, far = of(AdaptiveNeural(standoff=0.0)).linear, of(AdaptiveNeural(standoff=0.5)).linear
    assert (near.singular, far.singular) == (True, False)
    assert near.distance < 0.01


def test_a_law_that_takes_samples_is_refused():
    with pytest.raises(LawError, match=r"it takes samples, .* set controller.rate=analytic"):
        loop_margins(calm(AdaptiveNeural(rate="difference")), GRID)


# --- the command, and claims

LINE = BASE.replace("duration: 1.0", "duration: 40.0").replace("K_Pu: 100.0", "standoff: 0.5")


def test_the_command_tells_writes_and_encodes_the_same(podusv):
    Path("a.yaml").write_text(LINE)
    said = podusv("margins", "a.yaml", "--json", "--out", "m", "--format", "pdf")
    told, kept = json.loads(said.out), json.loads(Path("m/margins.json").read_text())
    assert said.code == 0
    assert kept | {"folder": "m"} == told
    law = told["laws"]["pid"]
    assert law["stable"]
    assert law["margins"].keys() == {name for name in OF_LOOP if not name.endswith("_v")}
    assert Path("m/figures/sensitivities.pdf").read_bytes().startswith(b"%PDF")
    rows = [line.split(",") for line in Path("m/margins.csv").read_text().splitlines()[1:]]
    assert {name: float(number) for name, _, number in rows if number != "inf"} == pytest.approx(
        {name: number for name, number in law["margins"].items() if number is not None}
    )
    shown = podusv("margins", "a.yaml", "--at", "30").out
    assert "straight on at 0.5 m/s from t = 30 s on" in " ".join(shown.split())
    assert f"{law['margins']['delay_margin']:.4g}" in shown


def test_a_law_without_margins_is_told_beside_the_others(podusv):
    Path("a.yaml").write_text(LINE + "controllers: {one: {}, two: {rate: difference}}\n")
    said = podusv("margins", "a.yaml")
    assert said.code == 3
    assert said.err.startswith("two: law pid")
    assert podusv("margins", "a.yaml", "--controller", "two").code == 2
    assert podusv("margins", "a.yaml", "--set", "path.kind=sinusoid").code == 3
    Path("run").mkdir()
    Path("run/resolved.yaml").touch()
    assert podusv("margins", "run").err == "run is a run folder; give its resolved.yaml\n"
    late = podusv("margins", "a.yaml", "--at", "41")
    assert (late.code, late.err) == (2, "--at 41: the run ends at 40 s; give an earlier time\n")


def test_no_table_marks_the_smallest_margin():
    runs = {
        "a": {"iae_e": 1.0, "gain_margin_u": 2.0},
        "b": {"iae_e": 2.0, "gain_margin_u": math.inf},
    }
    cells = {row[-1]: row[2:-1] for row in table.cells(table.table(runs))}
    assert cells == {"iae_e": ["1*", "2 (2)"], "gain_margin_u": ["2", "no limit"]}


def test_claims_compare_margins(podusv):
    claims = {
        "yes": "one.phase_margin_u > 0.5",
        "no": "one.delay_margin < 0.001",
        "never": "one.gain_margin_u > 2",
        "unknown": "two.peak_S_r > 1",
    }
    text = LINE + "controllers: {one: {}, two: {rate: difference}}\nclaims:\n"
    for name, expect in claims.items():
        text += f"  {name}: {{says: a, source: b, expect: {expect}}}\n"
    Path("a.yaml").write_text(text)
    told = json.loads(podusv("compare", "a.yaml", "--no-figures", "--json", "--out", "c").out)
    verdicts = {claim["claim"]: claim["verdict"] for claim in told["claims"]}
    assert verdicts == {
        "yes": "reproduced",
        "no": "not reproduced",
        "never": "reproduced",
        "unknown": "cannot tell",
    }
    assert told["comparison"]["phase_margin_u"]["one"] > 0.5
    assert "peak_T_u" not in told["comparison"]
    (why,) = told["missing"]
    assert why.startswith("margins of two could not be made: law pid")
