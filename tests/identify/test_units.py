"""Numbers with units: the table, and every place where a scenario takes them."""

import math
import re

import jsonschema
import pytest
import yaml
from scenario_samples import SOUND, loaded, told, write

import podusv
from podusv_cli.core import units
from podusv_cli.scenario.load import load
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.schema import json_schema
from podusv_cli.studies.making.cells import cells

SENSORS = "measurement: {kind: sensors, heading: {noise: 0.5 deg, outages: [[1 min, 2 min]]}}\n"
ROUTE = SOUND.replace(
    "{kind: line}", "{kind: legs, points: [[0, 0], [0.1 km, -20 ft]], speed: 36 km/h}"
)
STUDY = """\
sweep:
  grid: {simulation.step: [10 ms, 20 ms], start.x: [1 ft]}
  vary:
    start.psi: {uniform: [-30 deg, 30 deg]}
    path.course: {plus: {normal: {mean: 0, sigma: 5 deg, within: [-10 deg, 10 deg]}}}
    mass: {keys: [vessel.m], triangular: [20000 g, 23, 25 kg]}
    vessel.I_z: {times: {uniform: [90 %, 110 %]}}
tune: {space: {omega_psi: {log: [1 deg/s, 1]}, pid.T_d: {uniform: [100 ms, 1 s]}}}
doubt: {vary: {start.u: {uniform: [0, 1 kn]}}}
identify: {noise: {sigma_psi: 1 deg}}
"""


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("180 deg", "rad", math.pi),
        ("45deg", "rad", math.pi / 4),
        ("-30°", "rad", -math.pi / 6),
        ("36 km/h", "m/s", 10.0),
        ("5 knots", "m/s", 5 * 1852 / 3600),
        ("57 cm", "m", 0.57),
        ("120 rpm", "1/s", 2.0),
        ("1.5 h", "s", 5400.0),
        ("3 kN m", "N m", 3000.0),
        ("3 N·m", "N m", 3.0),
        ("50 kg m^2/s", "kg m2/s", 50.0),
        ("95 %", "", 0.95),
        ("2 1/s", "1/s", 2.0),
        ("3 m", "m or m/s", 3.0),
        ("1e-999999999 km", "m", 0.0),
    ],
)
def test_number_with_a_unit(text, unit, number):
    assert units.number(text, unit) == number


@pytest.mark.parametrize(
    "text",
    [
        "",
        "5",
        "fast",
        "21/s",
        "0x5 m",
        "017 deg",
        "nan deg",
        "5 m 3",
        "1e999 m",
        "deg 5",
        "1e308 km",
        "-1e308 nmi",
    ],
)
def test_text_that_is_no_number_in_metres(text):
    assert units.number(text, "m") is None


def test_whole_numbers_stay_whole():
    assert isinstance(units.number("10 steps", "steps"), int)


def test_every_unit_of_the_table_is_exact():
    """No two units of one kind are one, and each is its own spelling."""
    for own, others in units.UNITS.items():
        assert len({*others.values(), 1}) == len(others) + 1
        assert all(units.spell_unit(name) == name for name in (own, *others))


# What one of each is in podusv's unit, from the definitions: the yard of 1959, the pound, the knot.
WORTH = {
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
    "mm": 1e-3,
    "cm": 1e-2,
    "km": 1e3,
    "ft": 0.3048,
    "nmi": 1852.0,
    "cm2": 1e-4,
    "ft2": 0.09290304,
    "deg": 0.017453292519943295,
    "cm/s": 1e-2,
    "mm/s": 1e-3,
    "ft/s": 0.3048,
    "km/h": 0.2777777777777778,
    "kn": 0.5144444444444445,
    "cm/s2": 1e-2,
    "deg/s": 0.017453292519943295,
    "g": 1e-3,
    "t": 1e3,
    "lb": 0.45359237,
    "g/cm3": 1e3,
    "kN": 1e3,
    "kgf": 9.80665,
    "kN m": 1e3,
    "rpm": 1.0 / 60.0,
    "rpm/s": 1.0 / 60.0,
    "mHz": 1e-3,
    "%": 1e-2,
    "mrad": 1e-3,
    "mph": 0.44704,
    "lbf": 4.4482216152605,
}


def test_every_unit_of_the_table_is_worth_what_its_definition_says():
    assert {name for others in units.UNITS.values() for name in others} == WORTH.keys()
    for own, others in units.UNITS.items():
        for name in others:
            assert units.number(f"3 {name}", own) == pytest.approx(3.0 * WORTH[name], rel=1e-15)


@pytest.mark.parametrize(
    ("text", "unit", "told"),
    [
        ("45 dge", "rad", "; dge does not fit; did you mean 'deg'? (units here: rad, deg, mrad)"),
        ("5 kg", "kg m2", "; kg does not fit (units here: kg m2)"),
        ("0.7 rad", "", "; it has no unit here: write 0.7"),
        ("1e999 m", "m", "; it is too large, numbers must be finite"),
        ("1e308 km", "m", "; it is too large, numbers must be finite"),
        ("5 ft", "m", ""),
        ("fast", "m", ""),
    ],
)
def test_what_does_not_fit_is_said(text, unit, told):
    assert units.misfit(text, unit) == told


# --- in scenarios


def test_sections_lists_and_settings_take_units():
    scenario = loaded(ROUTE + SENSORS, ["start.psi=45deg", "start={u: 5 kn, psi: 90 deg}"]).scenario
    assert scenario.path.points == ((0.0, 0.0), (100.0, -6.096))
    assert scenario.path.speed == 10.0
    assert scenario.measurement.heading.noise == math.radians(0.5)
    assert scenario.measurement.heading.outages == ((60.0, 120.0),)
    assert (scenario.start.u, scenario.start.psi) == (5 * 1852 / 3600, math.pi / 2)


def test_the_scenario_written_out_has_podusv_s_units_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written = resolved_yaml(loaded(ROUTE + SENSORS).scenario)
    assert not re.search(r"\d ?(deg|km|ft|min)", written)
    write("resolved.yaml", written)
    assert load("resolved.yaml").scenario == loaded(ROUTE + SENSORS).scenario


def test_ranges_have_the_unit_of_the_key_they_are_about():
    scenario = loaded(SOUND + STUDY).scenario
    vary = scenario.sweep.vary
    assert vary["start.psi"].uniform == (-math.pi / 6, math.pi / 6)
    assert vary["path.course"].plus.normal.sigma == math.radians(5)
    assert vary["path.course"].plus.normal.within == (-math.pi / 18, math.pi / 18)
    assert vary["mass"].triangular == (20.0, 23.0, 25.0)
    assert vary["vessel.I_z"].times.uniform == (0.9, 1.1)
    assert scenario.tune.space["omega_psi"].log == (math.radians(1), 1.0)
    assert scenario.tune.space["pid.T_d"].uniform == (0.1, 1.0)
    assert scenario.doubt.vary["start.u"].uniform == (0.0, 1852 / 3600)
    assert scenario.identify.noise == {"sigma_psi": math.radians(1)}


def test_no_unit_stands_for_several_keys_that_have_not_all_of_it():
    drawn = "sweep.vary.drawn={keys: [start.x, start.u], uniform: [0, 1 kn]}"
    assert "kn does not fit" in " ".join(told(SOUND, [drawn]))


def test_cells_of_a_grid_are_those_of_plain_numbers():
    plain = (SOUND + STUDY).replace("[10 ms, 20 ms]", "[0.01, 0.02]").replace("[1 ft]", "[0.3048]")
    assert cells(loaded(SOUND + STUDY)) == cells(loaded(plain))


def test_a_vessel_s_file_takes_units(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("boat.yaml", yaml.safe_dump(OWN | {"length": "600 cm", "m": "0.1 t"}))
    vessel = loaded(SOUND.replace("preset: paper", "preset: boat.yaml, beam: 1 ft")).scenario.vessel
    assert (vessel.length, vessel.beam, vessel.m) == (6.0, 0.3048, 100.0)


OWN = {"source": "a test", "validity": "a test", "I_z": 20.0, "X_u": -5.0, "Y_v": -5.0, "N_r": -5.0}


def test_text_stays_text():
    text = SOUND + "name: 5-m\ndescription: 45 deg\n"
    assert loaded(text).scenario.description == "45 deg"


@pytest.mark.parametrize(
    ("override", "says"),
    [
        (
            "start.u=5 kg",
            "a number [m/s], found '5 kg'; kg does not fit (units here: m/s, cm/s, "
            "mm/s, ft/s, km/h, kn, mph)",
        ),
        ("simulation.step=-5 ms", "a number above 0 [s], found -5 ms"),
        (
            "sweep.vary.start.psi.plus.uniform[1]=3 dge",
            "a number [rad], found '3 dge'; dge does "
            "not fit; did you mean 'deg'? (units here: rad, deg, mrad)",
        ),
        (
            "metrics.steady_fraction=0.5 m",
            "a number above 0 and not above 1, found '0.5 m'; it has no unit here: write 0.5",
        ),
        (
            "sweep.draws=5 runs",
            "a whole number not below 1 and not above 1e+09, found '5 runs'; it "
            "has no unit here: write 5",
        ),
    ],
)
def test_a_unit_that_does_not_fit_is_one_sentence(override, says):
    below = SOUND + "sweep: {vary: {start.psi: {plus: {uniform: [0, 1]}}}}"
    assert told(below, [override]) == [
        f"--set {override}: {override.partition('=')[0]}: must be {says}"
    ]


# --- elsewhere


def test_functions_of_python_take_units():
    source = podusv.load("podusv:own_vessel.yaml", {"simulation.duration": "0.1 min"})
    assert source.simulation.duration == 6.0
    assert (
        podusv.Scenario(
            vessel={"preset": "paper"},
            path={"kind": "line", "course": "90 deg"},
            disturbance={"kind": "none"},
            actuator={"kind": "ideal"},
            controller={"kind": "pid"},
        ).path.course
        == math.pi / 2
    )


def test_a_batch_takes_units_and_says_which_do_not_fit():
    source = podusv.load("podusv:own_vessel.yaml", {"simulation.duration": 1.0})
    runs = podusv.simulate_many(
        source, {"start.psi": ["90 deg", 0.0], "vessel.m": ["0.05 t", 60.0]}
    )
    same = podusv.simulate_many(source, {"start.psi": [math.pi / 2, 0.0], "vessel.m": [50.0, 60.0]})
    assert runs.equals(same)
    with pytest.raises(ValueError, match=r"row 0: start.psi = 5 kg; .*kg does not fit"):
        podusv.simulate_many(source, {"start.psi": ["5 kg"]})


def test_editors_take_what_podusv_takes():
    schema = jsonschema.Draft7Validator(json_schema(()))

    def wrong(text):
        return [error.json_path for error in schema.iter_errors(yaml.safe_load(text))]

    assert wrong(ROUTE + SENSORS + STUDY) == []
    assert wrong(SOUND + "start: {psi: 45 kg}") == ["$.start.psi"]
    assert wrong(SOUND + "start: {psi: 45°, u: 5 knots}") == []
    assert wrong(SOUND + "sweep: {draws: 5 runs}") == ["$.sweep"]


def test_other_spellings_are_read():
    for other, unit in units.SPELLINGS.items():
        (own, *_) = [own for own in (*units.UNITS,) if unit in units.units_allowed_for(own)]
        assert units.number(f"2 {other}", own) == units.number(f"2 {unit}", own), other
