"""Thrust by the table of a bollard test, its inverse, and pulses that command it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

import podusv
from podusv_cli.components.actuators.one_pod import Pod
from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.actuators.propeller import speed_for, thrust
from podusv_cli.components.actuators.thrust_table import PwmCommand, of_file
from podusv_cli.core.errors import ScenarioError
from podusv_cli.core.kernel import bundle, call
from podusv_cli.scenario.load import load_text

# Dead band to 0.1, half the thrust at 0.5, full from 0.8.
TEST = (
    (-1, -9),
    (-0.5, -3.1),
    (-0.1, 0),
    (0, 0),
    (0.1, 0),
    (0.2, 1),
    (0.4, 7),
    (0.6, 14),
    (0.8, 20),
    (1, 20),
)
ROWS = tuple((float(n), float(T)) for n, T in TEST)
OTHER = {"x": -0.5, "n_rate": 10.0, "n_lag": 0.1, "angle_limit": 0.0}


def pods(**keys):
    """Two thrusters side by side, and kernels' arguments for one of them."""
    whole = Pods(counts="parts", pods=(Pod(y=-0.3, **OTHER, **keys), Pod(y=0.3, **OTHER, **keys)))
    return whole, bundle(whole.constants()), whole.table()


@pytest.mark.parametrize("n", [-1.0, -0.73, -0.5, -0.1, -0.04, 0.0, 0.1, 0.5, 0.61, 0.9, 1.0])
def test_thrust_lies_on_straight_lines_between_rows(n):
    whole, k, table = pods(table=ROWS)
    second = table[len(whole.pods[0].numbers()) :]
    for pod in (table, second):
        assert thrust(n, 0.3, pod, k) == pytest.approx(np.interp(n, *np.array(ROWS).T), abs=1e-12)


@pytest.mark.parametrize(
    ("T", "n"),
    [
        (10.5, 0.5),
        (7.0, 0.4),
        (1e-9, 0.1),
        (0.0, 0.0),
        (-1e-9, -0.1),
        (-3.1, -0.5),
        (-9.0, -1.0),
        (20.0, 0.8),
    ],
)
def test_the_command_for_a_thrust_is_the_least_one(T, n):
    """The edge of the dead band for next to nothing, where full thrust begins for all."""
    _, k, table = pods(table=ROWS)
    with np.errstate(divide="raise", invalid="raise"):  # rows of the same thrust
        assert speed_for(T, 0.0, table, k) == pytest.approx(n, abs=1e-8)


@given(
    steps=st.lists(
        st.tuples(st.floats(0.05, 1.0), st.one_of(st.just(0.0), st.floats(0.1, 9.0))),
        min_size=2,
        max_size=7,
    ),
    ahead=st.integers(1, 6),
    wanted=st.floats(-1.0, 1.0),
    flow=st.floats(-2.0, 1.0),
)
def test_in_any_table_and_flow_the_inverse_is_the_first_command_that_does_it(
    steps, ahead, wanted, flow
):
    """Against a search over all commands."""
    n, T = np.cumsum(np.array(steps), axis=0).T
    rest = min(ahead, len(n) - 1) - 1
    rows = np.column_stack([n - n[rest], T - T[rest]])
    if rows[-1, 1] <= 0.0:
        return
    whole = Pods(
        pods=tuple(
            Pod(y=y, **OTHER, table=tuple(map(tuple, rows.tolist())), T_nV=0.4) for y in (-0.3, 0.3)
        )
    )
    k, table = bundle(whole.constants()), whole.table()
    reach = np.linspace(0.0, max(whole.pods[0].most_n[0 if wanted >= 0.0 else 1], 1e-9), 20001)
    sense = 1.0 if wanted >= 0.0 else -1.0
    all_thrusts = sense * np.array([thrust(sense * m, flow, table, k) for m in reach[::50]])
    T = abs(wanted) * max(all_thrusts.max(), 0.0)
    found = sense * speed_for(sense * T, flow, table, k)
    if T == 0.0:
        assert found == 0.0
        return
    assert sense * thrust(sense * found, flow, table, k) == pytest.approx(T, abs=1e-9)
    least = reach[::50][np.argmax(all_thrusts >= T)]
    assert found <= least + 1e-9


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        (((-1, -9), (0, 0), (0.5, 7), (0.6, 6.5), (1, 20)), "falls from 7 to 6.5 N in row 4"),
        (((0, 0), (0.5, 7), (0.5, 8), (1, 20)), "row 3 has the command 0.5 after 0.5"),
        (((0.2, 1), (1, 20)), "must begin at rest"),
        (((-1, -9), (1, 20)), "a thrust of 5.5 N at rest"),
        (((0, 0), (1, 0)), "without thrust ahead"),
        (((0, 0),), "table of 1 rows"),
        ((), "table of 0 rows"),
        (((-1, 9), (0, 0), (1, 20)), "is below 0 astern"),
    ],
)
def test_what_no_propeller_does_is_refused(rows, says):
    with pytest.raises(ValidationError, match=says):
        pods(table=tuple((float(n), float(T)) for n, T in rows))


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"table": ROWS, "T_nn": 3.0}, "has a table and T_nn;"),
        ({"T_nn": 3.0, "n_max": 1.0}, "has no T_nn_astern, n_max_astern"),
        ({"table": ROWS, "table_in": "us"}, "table in us and no pwm"),
        ({"table": ROWS, "pwm": {"dead_band": (1475.0, 1525.0)}}, "table and pwm.dead_band"),
        ({"table": ((-100.0, -9.0), (0.0, 0.0), (100.0, 20.0))}, "reach 100 parts"),
        ({"table": ROWS, "pwm": {"span": 0.0}}, "span of 0 us"),
        ({"table": ROWS, "pwm": {"dead_band": (1510.0, 1525.0)}}, "must lie about rest"),
    ],
)
def test_two_laws_of_thrust_or_none_are_refused(keys, says):
    with pytest.raises(ValidationError, match=says):
        pods(**keys)


def test_a_rudder_needs_the_square():
    turning = OTHER | {"angle_limit": 0.5, "angle_rate": 1.0, "angle_lag": 0.1}
    with pytest.raises(ValidationError, match="whose force goes with n\\^2"):
        Pod(**turning, table=ROWS, rudder={"lift": 0.1})


@pytest.mark.parametrize(
    ("header", "unit_n", "unit_T"),
    [
        ("throttle,force_N", 1.0, 1.0),
        ("throttle [%],thrust [kgf]", 0.01, 9.80665),
        ('" Throttle (%)"," Force (Kg f)"', 0.01, 9.80665),
        ("command [rpm],thrust (lbf)", 1.0 / 60.0, 4.4482216152605),
        ("n [1/s],thrust [gf]", 1.0, 9.80665e-3),
    ],
)
def test_a_file_names_its_units(header, unit_n, unit_T):
    values, _ = of_file(f"{header}\n-2,-3\n0,0\n3,5\n", ())
    assert np.array(values["table"]) == pytest.approx(
        np.array([[-2.0, -3.0], [0.0, 0.0], [3.0, 5.0]]) * [unit_n, unit_T]
    )


def test_pulses_of_a_makers_table_with_more_columns_and_noise():
    """Seven columns, from full ahead to full astern, and a load cell that falls by 0.5 %."""
    rows = [
        *("1900,3300,17,12,200,3.69", "1896,3290,17,12,200,3.71", "1700,2000,4,12,60,1.0"),
        *("1525,0,0,12,0,0", "1500,0,0,12,0,0", "1475,0,0,12,0,0"),
        *("1300,1900,4,12,50,-0.8", "1100,3200,16,12,190,-2.9"),
    ]
    text = "\n".join([" PWM (µs), RPM, Current (A), Voltage (V), Power (W), Force (Kg f)", *rows])
    values, remarks = of_file(text, ())
    assert values["table_in"] == "us"
    assert values["pwm"] == {"rest": 1500.0, "span": 400.0}
    pod = Pod(y=0.3, **OTHER, **values)
    assert pod.rows[[0, 2, -1]] == pytest.approx(
        np.array([[-1.0, -2.9 * 9.80665], [-0.0625, 0.0], [1.0, 3.71 * 9.80665]])
    )
    assert "falls by up to 0.2 N (0.5% of full thrust) in 1 rows" in remarks[0]
    assert remarks[1] == "pwm follows from it: rest 1500 us, span 400 us"
    assert "pwm" not in of_file(text, ("pwm",))[0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("throttle,thrust [kg]\n0,0\n1,5\n", "write kgf"),
        ("throttle [V],thrust [N]\n0,0\n1,5\n", "commands in 'V'"),
        ("a,b,c\n0,0,0\n1,5,5\n", "no columns of a command by name"),
        ("0,0\n1,5\n", "names the columns"),
        ("throttle,thrust\n0,0\n1,x\n", "line 3, column 2 of the table is no number"),
        ("pwm,thrust\n1500,1\n1900,5\n", "no row without thrust"),
    ],
)
def test_a_file_that_is_no_table_is_told(text, says):
    with pytest.raises(ValueError, match=says):
        of_file(text, ())


@pytest.mark.parametrize(("span", "ahead"), [(400.0, 1700.0), (-400.0, 1300.0)])
def test_a_dead_band_takes_its_part_of_n_and_the_rest_goes_to_full_thrust(span, ahead):
    """By hand: past 25 us of 400 the propeller turns with (200 - 25)/(400 - 25) of full speed."""
    pwm = {"span": span, "dead_band": (1475.0, 1525.0)}
    _, k, table = pods(T_nn=40.0, T_nn_astern=30.0, n_max=1.0, n_max_astern=1.0, pwm=pwm)
    n = (ahead - 1500.0) / span
    assert thrust(n, 0.0, table, k) == pytest.approx(40.0 * (175.0 / 375.0) ** 2)
    assert thrust(-n, 0.0, table, k) == pytest.approx(-30.0 * (175.0 / 375.0) ** 2)
    assert thrust(0.0624, 0.0, table, k) == thrust(-0.0624, 0.0, table, k) == 0.0
    assert (thrust(1.0, 0.0, table, k), thrust(-1.0, 0.0, table, k)) == pytest.approx((40.0, -30.0))
    for T in (-30.0, -1e-9, 0.0, 1e-9, 7.0, 40.0):
        assert thrust(speed_for(T, 0.0, table, k), 0.0, table, k) == pytest.approx(T, abs=1e-12)
    assert speed_for(1e-12, 0.0, table, k) > 0.0625 > speed_for(0.0, 0.0, table, k) == 0.0
    assert PwmCommand(span=span, dead_band=(1480.0, 1530.0)).dead_ends() == pytest.approx(
        (0.075, 0.05) if span > 0.0 else (0.05, 0.075)
    )


def test_no_number_is_lost_in_a_table_or_a_dead_band():
    by_table, by_square = (
        pods(table=ROWS),
        pods(T_nn=4.0, T_nn_astern=3.0, n_max=1.0, n_max_astern=1.0),
    )
    for _, k, table in (by_table, by_square):
        assert np.isnan(thrust(np.nan, 0.0, table, k))
        assert np.isnan(speed_for(np.nan, 0.0, table, k))


SCENARIO = """
name: table
vessel: {preset: otter}
actuator:
  kind: pod
  counts: parts
  pods:
    - {x: -0.8, y: -0.4, table: bollard.csv, n_rate: 4, n_lag: 0.1, angle_limit: 0}
    - {x: -0.8, y: 0.4, table: bollard.csv, n_rate: 4, n_lag: 0.1, angle_limit: 0}
path: {kind: line, speed: 0.4}
disturbance: {kind: none}
controller: {kind: pid}
simulation: {step: 0.02, duration: 30.0}
"""


@pytest.fixture
def boat(tmp_path):
    """A scenario beside the table of a bollard test."""
    lines = ["throttle,thrust [N]", *(f"{n},{T}" for n, T in ROWS)]
    (tmp_path / "bollard.csv").write_text("\n".join(lines))
    (tmp_path / "boat.yaml").write_text(SCENARIO)
    return tmp_path / "boat.yaml"


def test_a_constant_command_settles_where_drag_is_the_tables_thrust(boat):
    """By algebra: 2 T(0.5) = -X_u u, 21 N over 77.554 N s/m."""
    (boat.parent / "c.csv").write_text("t,n_part_1,n_part_2\n0,0.5,0.5\n100,0.5,0.5\n")
    run = podusv.simulate(
        boat, {"controller": {"kind": "schedule", "file": str(boat.parent / "c.csv")}}
    )
    assert run["u"][-1] == pytest.approx(21.0 / 77.554, rel=1e-6)
    assert run["thrust"][-1] == pytest.approx([10.5, 10.5])


@pytest.mark.long
def test_a_run_has_the_thrust_of_its_commands_compiled_or_not(boat):
    run = podusv.simulate(boat)
    n, T = run["n_part"], run["thrust"]
    assert np.allclose(T, np.interp(n, *np.array(ROWS).T), rtol=0.0, atol=1e-12)
    plain = podusv.simulate(boat, {"simulation.compiled": False})
    assert np.array_equal(run["x"], plain["x"])
    assert np.array_equal(n, plain["n_part"])


def test_the_allocation_asks_for_what_the_table_makes(boat):
    """Settled loads are the demand, within the reach of the table."""
    actuator = load_text(boat.read_text(), str(boat)).scenario.actuator
    for demand in ([12.0, 1.0], [0.3, 0.02], [-7.0, 2.0]):
        made = actuator.settled(np.zeros(6), np.array(demand))
        assert made[[0, 2]] == pytest.approx(demand, rel=2e-3)
    assert actuator.input_matrix()[[0, 2], [0, 1]] == pytest.approx([1.0, 1.0], abs=1e-4)


def test_a_factor_scales_the_table_and_can_be_drawn(boat):
    scaled = podusv.load(boat, {"actuator.pods[0].table_factor": 1.5})
    assert scaled.actuator.pods[0].most_thrust == pytest.approx((30.0, 13.5))


def test_a_damaged_table_is_named_with_its_file(boat):
    (boat.parent / "bollard.csv").write_text("throttle,thrust [N]\n0,0\n0.5,9\n1,3\n")
    with pytest.raises(ScenarioError, match=r"falls from 9 to 3 N in row 3"):
        podusv.load(boat)
    (boat.parent / "bollard.csv").write_text("throttle,thrust [kg]\n0,0\n1,3\n")
    with pytest.raises(ScenarioError, match=r"bollard.csv.*pods\[0\].table: the file has thrusts"):
        podusv.load(boat)


def test_a_rudder_behind_a_dead_band_stands_in_its_own_stream():
    """No stream within the dead band, so no force across; at full n all of it."""
    turning = OTHER | {"angle_limit": 0.5, "angle_rate": 1.0, "angle_lag": 0.1}
    square = {"T_nn": 40.0, "T_nn_astern": 30.0, "n_max": 1.0, "n_max_astern": 1.0}
    pod = turning | square | {"pwm": {"dead_band": (1475.0, 1525.0)}, "rudder": {"lift": 60.0}}
    own, tau = Pods(counts="parts", pods=(pod,)), np.zeros(3)
    for n, part in ((0.06, 0.0), (0.5, (175.0 / 375.0) ** 2), (1.0, 1.0)):
        given = {"x": np.zeros(6), "k": bundle(own.constants()), "table": own.table()}
        call(own.replay, demand=np.array([n, 0.2]), tau=tau, **given)
        assert tau[1] == pytest.approx(part * 60.0 * 0.2 * np.cos(0.2), abs=1e-12)
