"""Findings about gains of another hull, and about values in another unit."""

import numpy as np
import pytest
from conftest import PACKAGE, VESSELS
from rotation import one_in
from test_sized_defaults import CATAMARAN, loaded

from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.recording import Recording
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.findings.finding import postflight, preflight
from podusv_cli.findings.sizing import gains_for_another_hull
from podusv_cli.findings.units import other_unit
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.load import load, load_text
from podusv_cli.scenario.model import Scenario
from podusv_cli.studies.making.plan import plan

SHIPPED = [
    path
    for path in sorted((PACKAGE.parent / "configs").rglob("*.yaml"))
    if not {"vessels", "conditions", "tasks"} & set(path.parts)
]
SEEING = ("measurement={kind: sensors}", "estimator={kind: ekf}")


def boat(*overrides: str) -> Scenario:
    return loaded(*overrides).scenario


def run(scenario: Scenario) -> Recording:
    return simulate(scenario.closed_loop(), scenario.time_grid())


def told(code: str, scenario: Scenario) -> list[str]:
    """Findings of that code before the run."""
    return [f"{one.where}: {one.text}" for one in preflight(scenario) if one.code == code]


# --- gains


def test_a_moment_of_the_model_ship_is_told_before_and_after_the_run():
    weak, own = boat("controller.N_m=2.5"), boat()
    (text,) = told("gains-for-another-hull", weak)
    assert text.startswith("controller.N_m: 2.5 N m, while hull and actuator make it 373 N m")
    assert not told("gains-for-another-hull", own)
    out = run(weak)
    assert out["leg"][-1] < 3 == run(own)["leg"][-1]
    (after,) = [one.text for one in postflight(weak, out) if one.code == "never-arrives"]
    assert "N_m = 2.5 where hull and actuator make it 373" in after
    assert "simulate longer" not in after


def test_a_run_that_is_only_short_is_not_told_of_moment_and_speed():
    short = boat("simulation.duration=40")
    (after,) = [one.text for one in postflight(short, run(short)) if one.code == "never-arrives"]
    assert after.endswith("simulate longer, or ask for more speed")


def test_a_path_faster_than_the_hull_is_named_where_legs_are_left():
    fast = boat("path.speed=1.9", "simulation.duration=60")
    (after,) = [one.text for one in postflight(fast, run(fast)) if one.code == "never-arrives"]
    assert "the hull goes 1.33 m/s at full thrust (400 N)" in after


@pytest.mark.parametrize(
    ("far", "near"),
    [
        ("U=0.5", "U=0.9"),
        ("U=3.5", "U=3.0"),
        ("N_m=100", "N_m=120"),
        ("N_m=1200", "N_m=1100"),
        ("k_psi=0.16", "k_psi=0.18"),
        ("k_psi=1.8", "k_psi=1.7"),
    ],
)
def test_a_number_far_from_the_rule_s_is_told_and_a_near_one_is_not(far, near):
    """U 1.66 m/s, N_m 373 N m, k_psi 0.857 1/s, at most 2 c/T_r = 1.71 1/s."""
    (text,) = told("gains-for-another-hull", boat(f"controller.{far}"))
    assert text.startswith(f"controller.{far.partition('=')[0]}: ")
    assert not told("gains-for-another-hull", boat(f"controller.{near}"))


def test_a_small_U_is_told_only_where_the_path_asks_for_more():
    """Of 1.66 m/s that hull and actuator make, 0.5 m/s are enough for a path of 0.3 m/s."""
    slow = "path.speed=0.3"
    assert not told("gains-for-another-hull", boat("controller.U=0.5", slow))
    assert told("gains-for-another-hull", boat("controller.U=0.4", slow))
    assert told("gains-for-another-hull", boat("controller.U=3.5", slow))
    reached = [run(boat(*own, slow))["leg"][-1] for own in ((), ("controller.U=0.5",))]
    assert reached[0] == reached[1] > 0


def test_a_hull_that_outruns_its_steering_cuts_its_corners():
    slow, fast = "path.speed=0.3", "path.speed=1.2"
    lazy = "controller.k_psi=0.18"
    (text,) = told("slow-steering", boat(lazy, fast))
    assert text.startswith("controller.k_psi: the law turns the hull at 0.18 1/s")
    assert not told("slow-steering", boat(lazy, slow))
    assert not told("slow-steering", boat(fast))
    late = [np.abs(run(boat(*given))["e_ct"][8000:]).max() for given in ((lazy, fast), (fast,))]
    assert late[0] > 1.05 * late[1]


def test_gains_of_pid_that_act_as_a_relay_are_told():
    """On the model ship at 10 Hz; with a tenth of the gains the actuator is hardly ever limited."""
    ship = ("vessel={preset: paper_nonlinear}", "actuator={kind: saturated}", "path={kind: line}")
    stiff, soft = (
        boat(
            *ship,
            f"controller={{kind: pid{more}}}",
            "start={x: -5, y: 0, u: 0.5}",
            "simulation.duration=60",
        )
        for more in ("", ", K_Pu: 50, K_Iu: 0.5, K_Du: 0, K_Pr: 5, K_Ir: 0.05, K_Dr: 0")
    )
    (text,) = told("relay-gains", stiff)
    assert "77.5 1/s in surge and 65.2 1/s in yaw, and the loop is late by 0.15 s" in text
    assert not told("relay-gains", soft)
    limited = [run(one)["saturated"][1000:].mean() for one in (stiff, soft)]
    assert limited[0] > 0.5 > 0.05 > limited[1]


def test_a_filter_has_one_warning_a_sensor_and_none_by_default():
    assert not told("estimator-noise", boat(*SEEING, "measurement.velocity.noise=0.3"))
    sigmas = "{kind: ekf, sigma_p: 1.0, sigma_psi: 1.0, sigma_u: 1.0, sigma_v: 1.0, sigma_r: 1.0}"
    keys = [
        one.partition(":")[0]
        for one in told("estimator-noise", boat(SEEING[0], f"estimator={sigmas}"))
    ]
    assert keys == [f"estimator.sigma_{of}" for of in ("p", "psi", "u", "r")]


def test_sigmas_are_those_of_the_sensors():
    noise = "measurement={kind: sensors, position: {noise: 0.3, bias: 0.4}, yaw_rate: null}"
    found = boat(noise, "estimator={kind: ekf, sigma_psi: 0.04}").estimator
    assert (found.sigma_p, found.sigma_psi, found.sigma_u) == (0.5, 0.04, 0.02)
    given = boat("measurement={kind: sensors, heading: {noise: 0.0123456}}", "estimator.kind=ekf")
    assert given.estimator.sigma_psi == 0.0123456, "a sensor's own number is not rounded"


# --- units

NONSENSE = [  # overrides, the key that is named, and what is proposed
    (["vessel.m=0.18"], "vessel.m", "given in t? then write 180"),
    (["vessel.m=180000"], "vessel.m", "given in g? then write 180"),
    (["nominal.m=0.18"], "nominal.m", "given in t? then write 180"),
    (["vessel.length=4000"], "vessel.length", "given in mm? then write 4"),
    (["vessel.length=4900", "vessel.beam=2440"], "vessel.length", "length and beam in mm?"),
    (["vessel.I_z=25000"], "vessel.I_z", "a radius of gyration of 11.8 m on a hull of 4.9 m"),
    ([SEEING[0], "measurement.heading.noise=2.0"], "measurement.heading.noise", "write 0.0349"),
    ([SEEING[0], "measurement.yaw_rate.noise=0.5"], "measurement.yaw_rate.noise", "in deg/s?"),
    ([SEEING[0], "measurement.position.noise=60"], "measurement.position.noise", "write 0.06"),
    (
        ["path.points=[[63.43, 10.39], [63.431, 10.391], [63.432, 10.39]]"],
        "path.points",
        "latitude and longitude in degrees? 0.002 deg of latitude are 222 m",
    ),
    (["path.points=[[0, 0], [0.6, 0], [0.6, 0.6]]"], "path.points", "in degrees?"),
    (
        ["path.points=[[7033500, 569000], [7033600, 569050]]"],
        "path.points",
        "the nearest waypoint is 7056 km from the start; are the points coordinates of a grid, as",
    ),
    (
        ["path={kind: waypoints, points: [[569000, 7033500], [569050, 7033600]], speed: 1}"],
        "path.points",
        "the first waypoint is 7056 km from the start; are the points coordinates of a grid, as",
    ),
    (["start.x=-6000"], "start.x", "given in mm? then write -6"),
    (["start.y=7000", "path={kind: circle}"], "start.y", "given in mm? then write 7"),
]


@pytest.mark.parametrize(("overrides", "key", "says"), NONSENSE)
def test_a_value_in_another_unit_is_told_with_the_unit(overrides, key, says):
    (text,) = told("other-unit", boat(*overrides))
    assert text.startswith(f"{key}: ")
    assert says in text


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["vessel.m=60"],
        ["vessel.m=1500"],
        ["vessel.I_z=100"],
        ["vessel.beam=0.5"],
        [SEEING[0], "measurement.heading.noise=0.1"],
        [SEEING[0], "measurement.position.noise=5"],
        ["path.points=[[6000, 10], [6000.5, 10], [6001, 10.1], [6003, 10]]", "start={x: 6000}"],
        ["start.x=-600"],
        ["path.points=[[7033500, 569000], [7033600, 569050]]", "start={x: 7033490, y: 569000}"],
    ],
)
def test_an_unusual_value_is_not(overrides):
    assert not told("other-unit", boat(*overrides))


@pytest.mark.parametrize("name", VESSELS)
def test_no_vessel_that_podusv_brings_along_is_in_another_unit(name):
    assert not list(other_unit.search(Case.of(boat(f"vessel={{preset: {name}}}"))))


@pytest.mark.parametrize(
    "path", one_in(3, SHIPPED, 1), ids=lambda path: f"{path.parent.name}/{path.stem}"
)
def test_no_scenario_that_podusv_brings_along_is_of_another_hull_or_unit(path):
    try:
        scenario = load(path).scenario
    except ScenarioError:  # a layer for others to extend
        return
    calm = {"disturbance": Calm()}  # neither looks at loads, which are slow to make of a sea
    cases = [Case.of(one.model_copy(update=calm)) for one in scenario.singles().values()]
    assert not [
        text
        for one in cases
        for kind in (other_unit, gains_for_another_hull)
        for text in kind.search(one)
    ]


@pytest.mark.parametrize(
    "path",
    one_in(
        3, [one for one in SHIPPED if one.parent.name in ("mu_2017", "fossen_2003", "lefeber_2003")]
    ),
    ids=lambda path: f"{path.parent.name}/{path.stem}",
)
def test_scenarios_of_papers_have_the_numbers_with_which_their_results_were_made(path):
    """Those of the model ship, or numbers of their own, in every cell of their studies."""
    try:
        whole = load(path)
    except ScenarioError:  # a layer for others to extend
        return
    grid = plan(whole).cells if whole.scenario.sweep else ()
    for one in (whole.scenario, *(cell.scenario for cell in grid)):
        for part in (*one.laws().values(), one.path, one.estimator):
            usual = {name: type(part).model_fields[name].default for name in part.by_rule}
            assert {name: getattr(part, name) for name in usual} == usual


def test_the_boat_that_these_tests_start_from_has_no_finding():
    assert preflight(load_text(CATAMARAN, "boat.yaml").scenario) == []
