"""Wind and current over time: between rows, round the compass, where from and to, refusals."""

import math

import numpy as np
import pytest
from conftest import VESSELS, Constant, adrift, run
from pydantic import ValidationError
from scenario_samples import SOUND, findings, write

from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.current_file import CurrentFile
from podusv_cli.components.disturbances.flow_rows import read_flow
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.disturbances.wind import Wind
from podusv_cli.components.disturbances.wind_file import WindFile
from podusv_cli.core.kernel import bundle, call
from podusv_cli.scenario.load import load

KINDS = {WindFile: 120.0, CurrentFile: 20.0}
OTTER = VESSELS["otter"]
# Rows at uneven times, the direction through north twice, and once round by small steps.
TIMES = np.array([1.3, 2.0, 7.1, 7.9, 20.0, 33.3])
SPEEDS = np.array([0.31, 0.2, 0.0, 0.75, -0.1, 0.4])
DEGREES = np.array([359.0, 1.0, 340.0, 20.0, 120.0, 250.0])
TURNED = np.array([359.0, 361.0, 340.0, 380.0, 480.0, 610.0])  # the same directions, continuous
ROWS = "t, speed, direction [deg]\n" + "\n".join(
    f"{t}, {speed}, {degrees}" for t, speed, degrees in zip(TIMES, SPEEDS, DEGREES, strict=True)
)
INSTANTS = (0.0, 1.3, 1.65, 3.7, 7.5, 7.9, 11.1, 32.0, 33.3, 400.0)
MOVING = np.array([0.0, 0.0, 0.7, 0.5, 0.1, 0.2])


def written(sea, t, x=MOVING):
    """Load and signals of a disturbance on an Otter at time t [s] and state x (6,)."""
    b = np.full(3 + len(sea.signals), np.nan)
    k, table = bundle(sea.constants_with(OTTER)), sea.table_for(OTTER, 400.0)
    call(sea.evaluate, t=t, x=x, k=k, table=table, b=b, again=0.0, stage=0.0)
    return b


@pytest.mark.parametrize("t", INSTANTS)
def test_a_flow_is_straight_between_its_rows_and_held_beyond_them(t):
    """numpy's interpolation of speeds and of directions that a hand made continuous."""
    speed = float(np.interp(t, TIMES, SPEEDS))
    direction = math.radians(np.interp(t, TIMES, TURNED))
    water = written(CurrentFile(rows=ROWS), t)
    np.testing.assert_allclose(water[3:], [speed, direction], atol=1e-14)
    same = Current(speed=abs(speed), direction=direction + math.pi * (speed < 0.0))
    np.testing.assert_allclose(water[:3], written(same, t)[:3], atol=1e-11)
    fast = ROWS.replace("t, speed,", "t, speed [kn],")
    air = written(WindFile(rows=fast, at=2.0), t)
    share = 1.0 + 2.5 * math.sqrt(0.0026) * math.log(0.2)
    np.testing.assert_allclose(air[3:], [share * speed * 1852 / 3600, direction], atol=1e-14)


@pytest.mark.parametrize("time", ["time", "time [s]", "t [s]"])
def test_times_have_the_name_that_logs_have(time):
    """Rows at 5 Hz, with columns in another order."""
    rows = [f"{i % 360},{0.2 * i:.1f},{1.0 + 0.01 * i:.2f}" for i in range(100)]
    sea = CurrentFile(rows="\n".join([f"direction [deg],{time},speed", *rows]))
    direction = math.radians(0.5 * (61.0 + 62.0))
    np.testing.assert_allclose(written(sea, 12.3)[3:], [1.615, direction], atol=1e-12)
    with pytest.raises(ValidationError, match="column 1 is none of these"):
        CurrentFile(rows="timestamp,speed,direction\n0,1,0\n1,1,0\n")


@pytest.mark.parametrize("kind", KINDS)
def test_from_359_to_1_degree_the_way_leads_through_north(kind):
    sea = kind(rows="t,speed,direction [deg]\n0, 0.2, 359\n10, 0.2, 1\n")
    found = [written(sea, t)[4] % (2.0 * math.pi) for t in (2.5, 5.0, 7.5)]
    np.testing.assert_allclose(np.degrees(np.unwrap(found)), [359.5, 360.0, 360.5], atol=1e-12)


@pytest.mark.parametrize(("psi", "axis"), [(0.0, 0), (math.pi / 2.0, 1)])
def test_wind_has_the_direction_that_it_comes_from(psi, axis):
    """From north: against a bow that points north, from port where it points east."""
    sea = WindFile(rows="0, 8, 0\n1, 8, 0\n")
    x = np.array([0.0, 0.0, psi, 0.0, 0.0, 0.0])
    pushed = sea.loads(OTTER, [0.5], [x])[0]
    south = np.array([math.cos(psi), -math.sin(psi)]) @ pushed[:2]
    assert south < -1.0
    assert abs(pushed[axis]) == pytest.approx(abs(south))
    same = Wind(speed=8.0).loads(OTTER, [0.5], [x])[0]
    np.testing.assert_allclose(pushed, same, atol=1e-12)


def test_a_current_has_the_direction_that_it_flows_to():
    """A hull without thrust ends up drifting north-east, with the water."""
    sea = CurrentFile(rows="0, 0.3, 0.8\n50, 0.3, 0.8\n")
    last = run(adrift(disturbance=sea), 800.0)
    c, s = math.cos(last["psi"][-1]), math.sin(last["psi"][-1])
    u, v = last["u"][-1], last["v"][-1]
    water = 0.3 * np.array([math.cos(0.8), math.sin(0.8)])
    np.testing.assert_allclose([c * u - s * v, s * u + c * v], water, atol=1e-9)


def test_rows_that_stay_are_the_kind_current_beside_other_loads():
    ends = []
    for own in (CurrentFile(rows="0, 0.3, 0.8\n7, 0.3, 0.8\n"), Current(speed=0.3, direction=0.8)):
        sea = Total(parts=(Wind(speed=4.0), own))
        loop = adrift(disturbance=sea, vessel=OTTER, controller=Constant(surge=40.0, yaw=9.0))
        log = run(loop, 20.0)
        ends.append(np.column_stack([log[name] for name in ("x", "y", "psi", "V_c", "beta_c")]))
    np.testing.assert_array_equal(*ends)


def test_the_header_has_order_and_units():
    head = "direction [deg], t [min], speed [cm/s]\n"
    rows = read_flow(f"{head}90, 0, 20\n180, 1, 9\n270, 1.5, 4\n45, 2, 0\n", 1.0)
    quarters = [[0, 0.2, 1.0], [60, 0.09, 2.0], [90, 0.04, 3.0], [120, 0, 4.5]]
    expected = np.array(quarters) * [1.0, 1.0, math.pi / 2.0]
    np.testing.assert_allclose(rows, expected, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("", "the record needs at least two lines, has 0"),
        ("0, 1, 0\n", "the record needs at least two lines, has 1"),
        ("0, 1, 0, 2\n1, 1, 0, 2\n", "every line must have 3 (t, speed, direction)"),
        ("0, 1, 0\n1, calm, 0\n", "line 2, column 2 of the record is no number"),
        ("1, 1, 0\n1, 2, 0\n", "line 2 of the record: its time is not after that of the line"),
        ("t, speed, dir\n0, 1, 0\n1, 1, 0\n", "column 3 is none of these"),
        ("0, 1, 10\n1, 1, 20\n", "a direction of 20 rad, more than once round; for degrees write"),
        ("0, 1, 0\n1, -999, 0\n", "a speed of 999 m/s, more than "),
        (
            "t, speed, direction [deg]\n0, 0.5, 10\n60, 0.4, 190\n",
            "turns by 180 deg from t = 0 s to 60 s, which may be either way round; put a row",
        ),
    ],
)
def test_a_wrong_flow_is_told_in_a_sentence(kind, rows, says):
    with pytest.raises(ValidationError) as told:
        kind(rows=rows)
    assert says in str(told.value)


@pytest.mark.parametrize(("kind", "most"), KINDS.items())
def test_the_largest_speed_is_that_of_wind_or_water(kind, most):
    kind(rows=f"0, 1, 0\n1, {most}, 0\n")
    with pytest.raises(ValidationError, match=f"more than {most:g} m/s"):
        kind(rows=f"0, 1, 0\n1, {most + 0.1}, 0\n")


def test_a_flow_is_read_from_a_file_beside_the_scenario(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("tide.csv", ROWS)
    for sea in ("{kind: current_file, file: tide.csv}", "[{kind: current_file, file: tide.csv}]"):
        write("a.yaml", SOUND.replace("{kind: none}", sea))
        assert CurrentFile(rows=ROWS) in load("a.yaml").scenario.disturbances().values()


def test_what_a_flow_from_a_file_cannot_do_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("wind.csv", ROWS)
    missing = "file is missing; name a CSV file with columns t, speed, direction"
    for sea, says in (
        ("{kind: wind_file}", missing),
        ("{kind: current_file}", missing),
        ("{kind: wind_file, file: wind.csv, at: 1e-9}", "at 1e-09 m the profile has no wind left"),
        ("{kind: wind, file: wind.csv, speed: 1}", "file belongs to kind current_file, file or wi"),
    ):
        write("a.yaml", SOUND.replace("{kind: none}", sea))
        (said,) = findings("a.yaml")
        assert says in said


def test_a_vessel_without_windage_is_in_no_wind():
    sea, bare = WindFile(rows=ROWS), OTTER.model_copy(update={"windage": None})
    with pytest.raises(ValueError, match="windage"):
        sea.constants_with(bare)
    ((key, says),) = sea.conflicts(bare, 0.01)
    assert key == "kind"
    assert "windage" in says
    assert not list(sea.conflicts(OTTER, 0.01))
