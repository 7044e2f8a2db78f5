"""Findings about path, hull and actuator: told where they hold, borne out by simulation."""

import math
from pathlib import Path

import numpy as np
import pytest
from conftest import VESSELS
from findings_samples import codes, finding, late, log, scene

from podusv_cli.components.vessels.plant import plant
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.findings.proof import conditions
from podusv_cli.findings.task import sliding_distance
from podusv_cli.findings.values import damping_sign
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load
from podusv_cli.scenario.reference import drift, reference

LONG = "simulation.duration=300"
SWITCH = 15.0
ON_TARGET = "start={x: -0.8, y: 0.0, u: 0.5}"


def turning(reading: str, amplitude: float = 0.5) -> str:
    return (
        f"path={{kind: line_circle, reading: {reading}, switch: {SWITCH}, amplitude: {amplitude}}}"
    )


def jump(signal: str, *overrides: str) -> float:
    """By how much a signal changes over the two steps around the path's switch."""
    out = log(*overrides)
    at = int(np.searchsorted(out["time"], SWITCH - 1e-9))
    return float(np.abs(np.diff(out[signal][at - 1 : at + 2])).max())


def test_a_jump_of_the_path_is_told_and_the_distance_jumps():
    there, not_there = turning("literal"), turning("velocity")
    assert "path-jump" in codes(there, ON_TARGET)
    assert "0.5 m at 15 s" in finding("path-jump", there).text
    assert jump("z_e", there, ON_TARGET) > 0.2
    assert "path-jump" not in codes(not_there, ON_TARGET)
    assert jump("z_e", not_there, ON_TARGET) < 0.01


def test_a_corner_of_the_path_is_told_and_the_virtual_speed_jumps():
    there, not_there = turning("velocity", 0.4), turning("velocity")
    assert codes(there) & {"path-jump", "path-corner", "path-bend"} == {"path-corner"}
    assert "0.1 m/s at 15 s" in finding("path-corner", there).text
    assert jump("alpha_u", there, ON_TARGET) == pytest.approx(0.1, abs=0.01)
    assert "path-corner" not in codes(not_there)
    assert jump("alpha_u", not_there, ON_TARGET) < 0.01


def test_a_corner_that_the_law_sees_rounded_is_not_told():
    course = "path={kind: waypoints, legs: straight, points: [[0, 0], [9, 0], [9, 9]], fillet: %s}"
    assert "path-corner" in codes(course % 0.0)
    assert "path-corner" not in codes(course % 2.0)


def test_a_bend_of_the_path_is_told_and_only_a_law_with_accelerations_steps():
    path, law = turning("velocity"), "controller={kind: full_backstepping}"
    assert codes(path) & {"path-jump", "path-corner", "path-bend"} == {"path-bend"}
    assert "0.015 m/s2 at 15 s" in finding("path-bend", path).text
    out = log(path, law, ON_TARGET)
    z_e = float(np.interp(SWITCH, out["time"], out["z_e"]))
    assert jump("tau_r_cmd", path, law, ON_TARGET) == pytest.approx(2.76 * 0.015 / z_e, rel=0.2)
    assert jump("tau_r_cmd", path, ON_TARGET) < 0.1 * 2.76 * 0.015 / z_e
    assert jump("tau_r_cmd", "path={kind: line}", law, ON_TARGET) < 0.1 * 2.76 * 0.015 / z_e


def test_a_target_that_goes_on_after_its_last_point_is_told():
    points = "points: [[0, 0], [3, 1], [6, 0]], speed: 0.5"
    on, stop = (
        f"path={{kind: waypoints, {points}}}",
        f"path={{kind: waypoints, {points}, after: stop}}",
    )
    assert (
        "last point at 12.65 s and goes straight on until 20 s" in finding("path-runs-on", on).text
    )
    assert log(on)["x_d"][-1] > 8.0
    for there in (stop, stop.replace("stop", "loop")):
        assert "path-runs-on" not in codes(there)
        assert log(there)["x_d"].max() < 6.5
    assert "path-runs-on" not in codes(on, "simulation.duration=12")


def test_a_start_opposite_to_the_path_is_told_and_the_last_digit_turns_it():
    line = "path={kind: line, course: 0.4, speed: 0.5}"
    ahead = 0.4 - math.pi
    at = f"start={{x: 0.0, y: 0.0, psi: {ahead!r}}}"
    assert "opposite-start" in codes(line, at)
    assert "-2.74259" in finding("opposite-start", line, at).text
    sides = [
        np.sign(
            log(line, "controller={kind: los_pid}", f"start={{x: 0.0, y: 0.0, psi: {psi!r}}}")["r"][
                -1
            ]
        )
        for psi in (ahead - 1e-9, ahead + 1e-9)
    ]
    assert sides[0] == -sides[1] != 0.0
    assert "opposite-start" not in codes(line, f"start={{x: 0.0, y: 0.0, psi: {ahead + 1e-3!r}}}")
    assert "opposite-start" not in codes(line, at, "start.r=0.1")


def test_what_comes_after_the_run_is_not_told():
    assert "path-jump" not in codes(turning("literal"), "simulation.duration=10")


DRIFTS = ("vessel={preset: paper}", "controller.k_ze=0.03", LONG)


def test_a_load_that_drifts_the_hull_faster_than_the_target_is_told_and_nothing_holds():
    assert "sway-drift" in codes(*DRIFTS)
    assert "0.57 m/s" in finding("sway-drift", *DRIFTS).text
    assert late("z_e", *DRIFTS).min() > 2.0
    half = (*DRIFTS, "disturbance.scale=0.5")
    assert "sway-drift" not in codes(*half)
    assert np.abs(late("z_e", *half) - 0.5).max() < 0.1


def test_the_steady_hull_of_the_reference_is_at_rest_in_the_plant():
    """The plant's rates vanish at the balance that the findings rest on, for every vessel."""
    for name, hull in VESSELS.items():
        calm = scene(f"vessel={{preset: {name}}}", "disturbance.scale=0.4", "path={kind: circle}")
        seen = reference(calm)
        mean = seen.load[:, 1].mean()
        for i in (0, 30):
            x, rate = np.concatenate([np.zeros(3), seen.nu[i]]), np.zeros(6)
            tau = np.array([seen.demand[i, 0], 0.0, seen.demand[i, 1]])
            b = np.array([seen.load[i, 0], mean, seen.load[i, 2]])
            plant(x, tau, b, bundle(hull.constants()), rate)
            assert np.abs(rate[3:]).max() < 1e-6, name
            assert math.hypot(*seen.nu[i, :2]) == pytest.approx(0.5)


def test_the_drift_is_where_damping_holds_the_load():
    assert drift(scene("vessel={preset: paper}"), 0.5) == pytest.approx(0.5 / 0.8896)
    v = drift(scene(), 0.5)
    assert 0.8896 * v + 36.47287 * v * v == pytest.approx(0.5)


SLIDES = ("vessel={preset: paper}", "disturbance.scale=0.05", LONG)


def test_a_hull_too_slippery_to_point_at_the_target_is_told_and_slides_away():
    assert "sway-unstable" in codes(*SLIDES)
    assert late("z_e", *SLIDES).min() > 2.0
    assert np.abs(late("v", *SLIDES)).max() > 2.0
    gentle = (*SLIDES, "controller.k_ze=0.03")  # below d22/m11 = 0.0345
    assert "sway-unstable" not in codes(*gentle)
    assert np.abs(late("z_e", *gentle) - 0.5).max() < 0.1


CALM = ("vessel={preset: paper}", "disturbance={kind: none}", LONG)


def astern(distance: float) -> str:
    """A start so far behind the target, which lies 45 degrees off the bow."""
    return f"start={{x: {-distance / math.sqrt(2.0)}, y: {-distance / math.sqrt(2.0)}}}"


@pytest.mark.parametrize("k_ze", [0.06, 0.1, 0.2])
def test_a_hull_slides_from_beyond_the_distance_that_is_told_and_not_from_within(k_ze):
    law = (*CALM, f"controller.k_ze={k_ze}")
    case = Case.of(scene(*law))
    distance = sliding_distance(case, case.scenario.controller.approach(), 0.8896)
    assert distance == pytest.approx(
        (0.5 * 8.0 + 25.8 * k_ze * 0.5) / (25.8 * k_ze - 0.8896)  # m22 - m11 = 8 kg
    )
    assert f"further than {distance:.2g} m" in finding("sway-unstable", *law).text
    within, beyond = (*law, astern(0.9 * distance)), (*law, astern(1.5 * distance))
    assert np.abs(late("z_e", *within) - 0.5).max() < 0.02
    assert late("z_e", *beyond).min() > 1.0
    assert np.abs(late("v", *beyond)).min() > 1.0


@pytest.mark.parametrize("standoff", [0.0, 0.5, 2.0])
def test_the_distance_is_where_the_plants_sway_starts_to_grow(standoff):
    """Eigenvalues of the hull that points at the target, by differences of the plant's kernel."""
    case = Case.of(scene(*CALM, f"controller.standoff={standoff}"))
    k, U, h = bundle(VESSELS["paper"].constants()), 0.5, 1e-6

    def rates(theta: float, v: float, D: float) -> Vector:
        u = 0.1 * (D - standoff) + U * math.cos(theta)
        r = (U * math.sin(theta) - v) / D
        rate = np.zeros(6)
        plant(np.array([0.0, 0.0, 0.0, u, v, r]), np.zeros(3), np.zeros(3), k, rate)
        return np.array([-r, rate[4]])

    def growth(D: float) -> float:
        columns = [(rates(*d, D) - rates(*-d, D)) / (2.0 * h) for d in h * np.eye(2)]
        return float(np.linalg.eigvals(np.column_stack(columns)).real.max())

    distance = sliding_distance(case, case.scenario.controller.approach(), 0.8896)
    assert growth(0.99 * distance) < 0.0 < growth(1.01 * distance)


def with_damping(ratio: float) -> str:
    """The paper's hull, whose growing sway nonlinear damping stops at so many target speeds."""
    return f"vessel={{preset: paper, Y_vv: {-(2.58 - 0.8896) / (0.5 * ratio)}}}"


@pytest.mark.parametrize("distance", [10.0, 14.0, 28.0])
@pytest.mark.parametrize("scale", [0.0, 0.3])
def test_sway_that_stops_short_of_the_targets_speed_is_not_told_and_the_hull_holds(distance, scale):
    slow = (with_damping(0.9), f"disturbance.scale={scale}", astern(distance), LONG)
    assert "sway-unstable" not in codes(*slow)
    assert np.abs(late("z_e", *slow) - 0.5).max() < 0.05


@pytest.mark.parametrize("ratio", [1.75, 2.5])
def test_sway_that_outgrows_the_targets_speed_is_told_and_the_hull_circles_the_target(ratio):
    fast = (with_damping(ratio), "disturbance={kind: none}", astern(7.0 * math.sqrt(2.0)), LONG)
    assert "sway-unstable" in codes(*fast)
    assert late("z_e", *fast).min() > 0.8
    assert np.abs(late("v", *fast)).min() > 1.0  # twice the target's speed


@pytest.mark.parametrize("k_ze", [0.1, 0.5])
def test_sway_that_nonlinear_damping_stops_is_no_finding_and_does_no_harm(k_ze):
    calm = (f"controller.k_ze={k_ze}", "disturbance={kind: none}", LONG)
    assert 25.8 * k_ze > 0.8896
    assert "sway-unstable" not in codes(*calm)
    assert np.abs(late("z_e", *calm) - 0.5).max() < 0.01


def limits(surge: float, yaw: float) -> str:
    return f"actuator={{kind: saturated, surge_limit: {surge}, yaw_limit: {yaw}}}"


@pytest.mark.parametrize(
    ("short", "enough"), [((0.5, 2.5), (4.0, 2.5)), ((8.0, 0.1), (8.0, 2.5))], ids=["surge", "yaw"]
)
def test_an_actuator_too_weak_is_told_and_falls_behind(short, enough):
    assert "thrust-short" in codes(limits(*short), ON_TARGET, LONG)
    assert late("z_e", limits(*short), ON_TARGET, LONG).max() > 3.0
    assert "thrust-short" not in codes(limits(*enough), ON_TARGET, LONG)
    assert np.abs(late("z_e", limits(*enough), ON_TARGET, LONG) - 0.5).max() < 0.1


def test_the_thrust_needed_is_what_the_law_ends_up_asking_for():
    needed = Case.of(scene(LONG)).reference.demand[:, 0]
    asked = late("tau_u_cmd", LONG)
    assert needed.max() == pytest.approx(asked.max(), rel=0.1)
    assert needed.min() == pytest.approx(asked.min(), abs=0.15)


def test_an_actuator_without_states_delivers_what_it_is_asked_for_within_limits():
    actuator = scene(limits(3.0, 1.0)).actuator
    assert actuator.settled(np.zeros(6), np.array([9.0, -0.5])).tolist() == [3.0, 0.0, -0.5]


def test_a_quick_pod_is_not_taken_for_a_weak_one():
    """What a pod delivers in the end does not hang on its lags."""
    quick = [f"actuator.pods.{i}={{n_lag: 0.004, angle_lag: 0.004}}" for i in (0, 1)]
    pair = "actuator={kind: pod, preset: cybership2_pod}"
    assert "thrust-short" not in codes(pair, *quick, LONG)
    weak = [f"actuator.pods.{i}.n_max=8" for i in (0, 1)]
    assert "thrust-short" in codes(pair, *weak, LONG)


def test_a_lag_too_short_for_the_step_is_told_and_does_not_settle():
    """RK4 decays up to step = 2.785 lags: 0.01 s for 3.6 ms."""
    pair, calm = "actuator={kind: pod, preset: cybership2_pod}", "disturbance={kind: none}"
    for lag, stiff in ((0.0034, True), (0.0038, False)):
        sets = [pair, calm, "controller.anti_windup=auxiliary", "simulation.duration=40"]
        sets += [f"actuator.pods.{i}={{n_lag: {lag}, angle_lag: {lag}}}" for i in (0, 1)]
        assert ("stiff-actuator" in codes(*sets)) == stiff
        apart = np.abs(late("n", *sets) - late("n_cmd", *sets))
        assert (np.median(apart) > 0.1) == stiff, np.median(apart)


def test_a_pod_that_turns_too_little_drives_the_hull_ahead_and_that_is_told():
    place = "x: -0.499, T_nn: 7.3e-3, T_nn_astern: 1e-2, n_max: 33, n_max_astern: 33"
    slow = "n_rate: 200, n_lag: 0.1, angle_rate: 1.75, angle_lag: 0.1"

    def sets(limit: float) -> tuple[str, ...]:
        one = f"actuator={{kind: pod, pods: [{{{place}, {slow}, angle_limit: {limit}}}]}}"
        return one, "controller.anti_windup=auxiliary", ON_TARGET, LONG

    assert "thrust-short" in codes(*sets(0.15))
    assert "thrust-short" not in codes(*sets(1.2))
    assert late("z_e", *sets(0.15)).min() < 0.3  # of the standoff of 0.5 m
    assert np.abs(late("z_e", *sets(1.2)) - 0.5).max() < 0.1


# --- gain conditions in words

CONFIGS = Path(__file__).parents[2] / "configs/mu_2017"


def said(name: str, *sets: str) -> list[str]:
    return list(conditions(load(CONFIGS / f"{name}.yaml", sets).scenario))


@pytest.mark.parametrize(("k_psie", "holds"), [(0.051, True), (0.049, False)])
def test_the_corrected_limit_of_k_psie_is_a_quarter_of_one_over_A(k_psie, holds):
    (line,) = said("corrected", f"controller.k_psie={k_psie}", "controller.A_r=5")
    assert ("all hold; lambda" in line) == holds
    assert (f"k_psie = {k_psie} fails: it must exceed 0.05" in line) != holds


def test_the_printed_sign_asks_for_more_than_the_printed_gains():
    (line,) = said("printed")
    assert "k_ze = 0.1 fails: it must exceed 0.336" in line  # 1/(4 A_u) + 1/(k_ue - 1/2)
    assert "as printed: all hold" in line


def test_every_law_with_a_lyapunov_function_has_its_line():
    assert [line.partition(",")[0] for line in said("corrected_compare")] == [
        "adaptive_neural",
        "dsc",
        "full_backstepping",
    ]


# --- findings about signs and units

STILL = ("disturbance={kind: none}", "simulation.duration=60")


@pytest.mark.parametrize("name", ["X_uu", "X_uuu", "Y_vv", "N_rr"])
def test_damping_that_drives_is_told_at_its_key_once(name):
    case = Case.of(scene(f"vessel.{name}=1.32"))
    (told,) = damping_sign.findings(case.scenario.controller, case)
    assert (told.code, told.where) == ("damping-sign", f"vessel.{name}")
    assert "-1.32?" in told.text


def test_a_hull_with_damping_of_the_wrong_sign_has_to_be_held_back():
    wrong, right = (*STILL, "vessel.X_uu=8.0"), (*STILL, "vessel.X_uu=-8.0")
    assert "damping-sign" in codes(*wrong)
    assert late("tau_u", *wrong).max() < -0.5
    assert "damping-sign" not in codes(*right)
    assert late("tau_u", *right).min() > 0.5


def test_added_mass_of_the_wrong_sign_makes_the_hull_lighter():
    """From rest, under a constant thrust: less mass, more acceleration."""
    thrust = (*STILL, "controller={kind: turning_circle, thrust: 2.0}")
    wrong, right = (*thrust, "vessel.X_udot=12.0"), (*thrust, "vessel.X_udot=-12.0")
    told = finding("added-mass-sign", *wrong)
    assert told.where == "vessel.X_udot"
    assert "m11 = 11.8 kg" in told.text  # 23.8 - 12
    assert "-12?" in told.text
    assert "added-mass-sign" not in codes(*right)
    speeds = [log(*one)["u"][10] for one in (wrong, right)]
    assert speeds[0] / speeds[1] == pytest.approx(35.8 / 11.8, rel=0.01)


def test_what_the_law_is_told_is_looked_at_too():
    assert finding("damping-sign", "nominal.Y_vv=36.0").where == "nominal.Y_vv"


def test_no_vessel_that_podusv_brings_along_drives_itself():
    for name in VESSELS:
        assert not {"damping-sign", "added-mass-sign"} & codes(f"vessel={{preset: {name}}}")


@pytest.mark.parametrize("key", ["start.psi", "path.course"])
def test_degrees_are_told_and_radians_are_not(key):
    told = finding("large-angle", f"{key}=-90")
    assert told.where == key
    assert "-90 deg is -1.571" in told.text
    assert "large-angle" not in codes(f"{key}={-math.pi / 2}")
    assert "large-angle" not in codes(f"{key}={2 * math.pi}")


@pytest.mark.parametrize(
    ("law", "says", "gained"),
    [("los_pid", "never catches up", -0.1), ("velocity_vector", "nears it by 0.05 m/s", 0.05)],
)
def test_a_law_that_asks_for_less_speed_than_its_target_has_is_told(law, says, gained):
    behind = ("disturbance={kind: none}", "path={kind: line, speed: 0.5}", "start={x: -9, y: 0}")
    slow, fast = (f"controller={{kind: {law}, U: {U}}}" for U in (0.4, 0.7))
    assert says in finding("slow-law", *behind, slow).text
    assert "slow-law" not in codes(*behind, fast)
    nearing = [
        -np.diff(late("z_e", *behind, one)[[0, -1]])[0] / (20.0 / 3.0) for one in (slow, fast)
    ]
    assert nearing[0] == pytest.approx(gained, abs=0.01)
    assert nearing[1] > gained + 0.05


def test_a_law_that_counts_on_more_moment_than_there_is_is_told():
    weak, across = "actuator={kind: saturated, yaw_limit: 0.5}", "start={x: 0, y: 5, psi: 1.5}"
    short, told = (f"controller={{kind: velocity_vector, N_m: {N}}}" for N in (2.5, 0.5))
    assert "the actuator gives 0.5 N m" in finding("moment-short", weak, across, short).text
    assert "moment-short" not in codes(weak, across, told)
    assert "moment-short" not in codes(across, short)
    pushes = [np.abs(log(weak, across, law)["tau_u_cmd"][:500]).max() for law in (short, told)]
    assert pushes[0] > 1.2 * pushes[1]
