"""The sea: (52) at instants worked out by hand, its scale, its bounds."""

import math

import numpy as np
import pytest
from conftest import NONLINEAR, example, kinds, load_at
from pydantic import ValidationError
from scenario_samples import SOUND, findings, write

from podusv_cli.components.disturbances.base import ARGUMENTS
from podusv_cli.components.disturbances.calm import Calm
from podusv_cli.components.disturbances.current import Current
from podusv_cli.components.disturbances.file import FromFile
from podusv_cli.components.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.components.disturbances.step import Step
from podusv_cli.components.disturbances.total import Total
from podusv_cli.components.disturbances.waves import Waves
from podusv_cli.components.disturbances.wind import Wind
from podusv_cli.core.kernel import bundle, taking
from podusv_cli.scenario.load import load

# sin and cos are 0 or +-1 at these times, except where the numbers are written out.
BY_HAND = [
    (0.0, (0.8, 0.6, 0.6)),
    (5 * math.pi, (0.5, 0.6, 0.5)),
    (10 * math.pi, (0.2, 0.6, 0.6)),
    (2.5 * math.pi, (0.6 - 0.3 * math.sqrt(0.5), 0.6, 0.5 + 0.1 * math.sqrt(0.5))),
]


@pytest.mark.parametrize(("t", "load"), BY_HAND)
def test_the_defaults_are_equation_52(t, load):
    np.testing.assert_allclose(load_at(HarmonicDisturbance(), t), load, atol=1e-14)


def test_every_axis_has_its_own_numbers():
    surge = Harmonic(mean=1.0, sin=2.0, sin_rate=0.3, cos=4.0, cos_rate=0.7)
    sway = Harmonic(mean=-1.0, sin=0.5, sin_rate=1.1, cos=0.25, cos_rate=1.3)
    sea = HarmonicDisturbance(b_u=surge, b_v=sway, b_r=Harmonic(mean=7.0))
    t = 2.7
    b_u = 1 + 2 * math.sin(0.3 * t) + 4 * math.cos(0.7 * t)
    b_v = -1 + 0.5 * math.sin(1.1 * t) + 0.25 * math.cos(1.3 * t)
    np.testing.assert_allclose(load_at(sea, t), [b_u, b_v, 7.0], rtol=1e-14)


def test_phases_are_angles_of_the_waves_at_the_start():
    axis = Harmonic(mean=1.0, sin=2.0, sin_rate=0.3, sin_phase=0.7, cos=-4.0, cos_phase=-2.9)
    sea = HarmonicDisturbance(b_u=axis, b_v=axis, b_r=Harmonic(cos=1.0, cos_phase=100.0))
    for t in (0.0, 2.7, 300.0):
        load = 1 + 2 * math.sin(0.3 * t + 0.7) - 4 * math.cos(0.2 * t - 2.9)
        expected = [load, load, math.cos(0.2 * t + 100.0)]
        np.testing.assert_allclose(load_at(sea, t), expected, rtol=1e-13, atol=1e-13)


def test_phases_of_zero_leave_every_bit_of_the_tables():
    """The kernel is as it was, and so the loads are, to the last bit."""
    u, v, r = (Harmonic(sin=-0.1 * i, cos=0.3 * i, sin_rate=i, cos_rate=9 - i) for i in (1, 2, 3))
    rates, cosines, sines = HarmonicDisturbance(b_u=u, b_v=v, b_r=r).table().reshape(3, -1)[:, :6]
    zero = [0.0] * 3
    for found, expected in (
        (rates, [1, 2, 3, 8, 7, 6]),
        (cosines, zero + [axis.cos for axis in (u, v, r)]),
        (sines, [axis.sin for axis in (u, v, r)] + zero),
    ):
        assert found.tobytes() == np.array(expected, float).tobytes()


def test_scale_multiplies_everything_and_zero_is_calm_water():
    for t in (0.0, 3.3, 200.0):
        once = load_at(HarmonicDisturbance(), t)
        np.testing.assert_allclose(load_at(HarmonicDisturbance(scale=2.5), t), 2.5 * once)
        np.testing.assert_array_equal(
            load_at(HarmonicDisturbance(scale=0.0), t), load_at(Calm(), t)
        )


def test_the_load_is_bounded_as_assumption_1_wants():
    loads = np.array([load_at(HarmonicDisturbance(), t) for t in np.linspace(0, 400, 4001)])
    assert np.all(np.abs(loads).max(axis=0) <= [0.9, 0.8, 0.7])
    # A nonzero mean, as the paper says: about 0.5 on every axis.
    np.testing.assert_allclose(loads.mean(axis=0), 0.5, atol=0.02)


@pytest.mark.parametrize(
    ("axis", "bound"),
    [
        (Harmonic(mean=-0.5, sin=0.1, sin_rate=0.2, cos=0.3, cos_rate=0.5), 0.9),
        (Harmonic(mean=0.5, sin=-0.1, sin_rate=0.2, cos=-0.3, cos_rate=0.5), 0.9),
        (Harmonic(mean=0.5, sin=3.0, cos=-4.0), 5.5),  # one rate, one wave
        (Harmonic(mean=-1.0, sin=3.0, sin_rate=0.0, cos=0.25, cos_rate=0.3), 1.25),
        (Harmonic(mean=-1.0, sin=0.5, sin_rate=0.3, cos=0.25, cos_rate=0.0), 1.25),
        (Harmonic(mean=-1.0, sin=0.5, sin_rate=0.0, cos=0.25, cos_rate=0.0), 0.75),
        (Harmonic(sin=3.0, sin_phase=0.4, sin_rate=0.3, cos=-4.0, cos_rate=0.283), 7.0),
        (Harmonic(mean=0.5, sin=3.0, sin_phase=math.pi / 2, cos=-4.0), 1.5),  # they cancel to 1
        (Harmonic(mean=-0.5, sin=3.0, cos=-4.0, cos_phase=math.pi / 2), 7.5),  # they add up
        (Harmonic(sin=2.0, sin_rate=0.0, sin_phase=math.pi / 6, cos=0.25, cos_rate=0.3), 1.25),
        (Harmonic(mean=1.0, cos=0.5, cos_rate=0.0, cos_phase=math.pi, sin_rate=0.0), 0.5),
    ],
)
def test_a_bound_is_never_exceeded_and_nearly_reached(axis, bound):
    sea = HarmonicDisturbance(b_u=axis, b_v=axis, b_r=axis, scale=2.0)
    assert sea.bounds() == pytest.approx((2.0 * bound,) * 3)
    loads = np.abs([load_at(sea, t)[0] for t in np.linspace(0.0, 1000.0, 2001)])
    assert 0.99 * 2.0 * bound < loads.max() <= 2.0 * bound * (1 + 1e-15)


@pytest.mark.parametrize("kind", [k for k in kinds("disturbances").values() if k.of_time])
def test_what_claims_to_depend_on_time_alone_does(kind):
    sea, random = example(kind), np.random.default_rng(1)
    for t in random.uniform(0, 300, 20):
        loads = [load_at(sea, t, random.normal(0, 5, 6)) for _ in range(3)]
        np.testing.assert_array_equal(loads, [loads[0]] * 3)


SLOW = (
    Wind(speed=8.0, gusts="norsok"),
    Waves(height=0.1, period=2.0, components=21),
    Waves(height=0.1, period=2.0, components=21, spreading=2),
)


@pytest.mark.parametrize("sea", [*SLOW, Total(parts=(Current(), *SLOW))])
def test_what_a_disturbance_leaves_out_changes_no_bit_of_its_load(sea):
    """In a stage its signals, and at a time that it was asked for what depends on time alone."""
    random = np.random.default_rng(2)
    kernel = taking(sea.kernel_with(NONLINEAR), ARGUMENTS)
    k, table = bundle(sea.constants_with(NONLINEAR)), sea.table_for(NONLINEAR, 60.0)
    for t in random.uniform(0.0, 60.0, 5):
        once, x, y = np.zeros(3 + len(sea.signals)), *random.normal(0.0, 1.0, (2, 6))
        kernel(t, y, k, table, once, 0.0, 0.0)
        for before, again in ((np.full(len(once), np.nan), 0.0), (once, 1.0)):
            whole, stage = before.copy(), before.copy()
            kernel(t, x, k, table, whole, again, 0.0)
            kernel(t, x, k, table, stage, again, 1.0)
            fresh = np.full(len(once), np.nan)
            kernel(t, x, k, table, fresh, 0.0, 0.0)
            np.testing.assert_array_equal(whole, fresh)
            np.testing.assert_array_equal(stage[:3], fresh[:3])


def test_a_step_sets_in_at_its_time_and_grows_along_its_ramp():
    at_once = Step(time=3.0, b_u=2.0, b_v=-1.0, b_r=0.5)
    for t, share in ((0.0, 0.0), (2.999, 0.0), (3.0, 1.0), (100.0, 1.0)):
        np.testing.assert_array_equal(load_at(at_once, t), np.array([2.0, -1.0, 0.5]) * share)
    ramped = Step(time=3.0, ramp=4.0, b_u=2.0)
    for t, share in ((3.0, 0.0), (4.0, 0.25), (6.0, 0.75), (7.0, 1.0), (50.0, 1.0)):
        assert load_at(ramped, t)[0] == 2.0 * share
    assert at_once.bounds() == (2.0, 1.0, 0.5)


RECORD = "t, b_u, b_v, b_r\n1, 2, 0, 0  # at first\n3, 4, -1, 0.5\n4, 0, 0, 0\n"


def test_a_record_is_straight_between_its_rows_and_held_beyond_them():
    sea = FromFile(rows=RECORD)
    for t, expected in (
        (0.0, [2, 0, 0]),
        (1.0, [2, 0, 0]),
        (2.0, [3, -0.5, 0.25]),
        (3.0, [4, -1, 0.5]),
        (3.5, [2, -0.5, 0.25]),
        (4.0, [0, 0, 0]),
        (99.0, [0, 0, 0]),
    ):
        np.testing.assert_allclose(load_at(sea, t), expected, atol=1e-15)
    assert sea.bounds() == (4.0, 1.0, 0.5)


def test_the_header_says_which_column_is_which():
    for head in ("b_u,b_v,b_r,t", '"b_u [N]", b_v [N] ,b_r [N m],t [s]', "# load\nb_u,b_v,b_r,t"):
        sea = FromFile(rows=f"{head}\n2,0,0,1\n4,-1,0.5,3\n")
        np.testing.assert_array_equal(load_at(sea, 3.0), [4, -1, 0.5])


def test_a_wrong_record_is_told_with_its_file_and_a_missing_one_by_its_key(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    write("sub/gust.csv", "t,b_u,b_v,b_r\n0,0,0,0\nO,0,5,0\n")
    for sea in ("{kind: file, file: gust.csv}", "[{kind: file, file: gust.csv}]"):
        write("sub/a.yaml", SOUND.replace("{kind: none}", sea))
        (said,) = findings("sub/a.yaml")
        assert said.startswith("sub/gust.csv: disturbance")
        assert said.endswith("rows: line 3, column 1 of the record is no number")
    write("a.yaml", SOUND.replace("{kind: none}", "{kind: file}"))
    (said,) = findings("a.yaml")
    assert "disturbance: file is missing; name a CSV file" in said
    write("sub/a.yaml", SOUND.replace("{kind: none}", "{kind: file, file: none.csv}"))
    (said,) = findings("sub/a.yaml")
    assert "disturbance.file: 'sub/none.csv'" in said
    assert said.endswith(str(tmp_path / "sub"))


def test_a_record_is_read_from_a_file_beside_the_scenario(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("gust.csv", RECORD)
    write("a.yaml", SOUND.replace("{kind: none}", "{kind: file, file: gust.csv}"))
    assert load("a.yaml").scenario.disturbance == FromFile(rows=RECORD)
    write("a.yaml", SOUND.replace("{kind: none}", "[{kind: none}, {kind: file, file: gust.csv}]"))
    assert load("a.yaml").scenario.disturbance[1] == FromFile(rows=RECORD)


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("", "the record needs at least two lines, has 0"),
        ("0,1,1\n1,2,3\n", "line 1 of the record has 3; every line must have 4 (t, b_u, b_v, b_r)"),
        (
            "0;1;1;0\n1;2;3;0\n",
            "line 1 of the record has 1 value; separate values by commas: "
            "every line must have 4 (t, b_u, b_v, b_r)",
        ),
        (
            "t,b_u,b_v,b_r\n0;1;1;0\n1;2;3;0\n",
            "line 2 of the record has 1 value; separate values by commas: every line must have 4",
        ),
        ("0,1,1,0\n\n1,s3cret,2,0\n", "line 3, column 2 of the record is no number"),
        ("0,s3cret,5,0\n1,1,2,0\n", "line 1, column 2 of the record is no number"),
        ("O,0,5,0\n1,1,2,0\n2,1,2,0\n", "line 1, column 1 of the record is no number"),
        ("0,1,1,0\n1,1_0,2,0\n", "line 2, column 2 of the record is no number"),
        ("0,1,1,0\n1,0x10,2,0\n", "line 2, column 2 of the record is no number"),
        ("0,1,1,0\n1,\uff11,2,0\n", "line 2, column 2 of the record is no number"),
        ("0,1,1,0\n1,1 0,2,0\n", "line 2, column 2 of the record is no number"),
        ("0,1,1,0\n1,Infinity,2,0\n", "line 2, column 2 of the record is not a finite number"),
        ("0,1,1,0\n1,-nan,2,0\n", "line 2, column 2 of the record is not a finite number"),
        ("0,1,1,0\n1,1e999,2,0\n", "line 2, column 2 of the record is not a finite number"),
        ("0,1,1,0\n1,1,,0\n", "line 2, column 3 of the record is no number"),
        ("0,1,1,0\n1,1,nan,0\n", "line 2, column 3 of the record is not a finite number"),
        (
            "0,1,1,0\n0,1,2,0\n",
            "line 2 of the record: its time is not after that of the line before",
        ),
        (
            "s3cret,b_u,b_v\n0,0,0,0\n1,1,1,1\n",
            "line 1 of the record names columns that are not t [s], b_u [N], b_v [N], b_r [N m] "
            "(in any order, units may be left out): column 1 is ",
        ),
        ("t,b_u,b_v,s3cret\n0,0,0,0\n1,1,1,1\n", "column 4 is none of these"),
        ("t,b_u [kg],b_v,b_r\n0,0,0,0\n1,1,1,1\n", "column 2 is none of these"),
        ("t,b_u,b_u,b_r\n0,0,0,0\n1,1,1,1\n", "one is missing or twice"),
        ("t,b_u,b_v\n0,0,0,0\n1,1,1,1\n", "one is missing or twice"),
    ],
)
def test_a_wrong_record_is_told_in_a_sentence_that_repeats_none_of_it(rows, says):
    with pytest.raises(ValidationError) as told:
        FromFile(rows=rows)
    assert says in str(told.value)
    assert "s3cret" not in told.value.errors()[0]["msg"]


@pytest.mark.parametrize("psi", [0.0, 0.7, -2.5])
def test_loads_fixed_to_the_earth_push_to_the_same_side_at_every_heading(psi):
    """R(psi) of the load is (b_u, b_v) of (52), whatever the heading; the moment is the same."""
    times, states = [3.0, 41.0], [np.array([0, 0, psi, 0, 0, 0.0])] * 2
    body, earth = (
        HarmonicDisturbance(frame=frame, scale=1.5).loads(NONLINEAR, times, states)
        for frame in ("body", "earth")
    )
    c, s = math.cos(psi), math.sin(psi)
    pushed = [c * earth[:, 0] - s * earth[:, 1], s * earth[:, 0] + c * earth[:, 1], earth[:, 2]]
    np.testing.assert_allclose(np.transpose(pushed), body, atol=1e-14)
    assert (np.abs(earth) <= HarmonicDisturbance(frame="earth", scale=1.5).bounds()).all()
