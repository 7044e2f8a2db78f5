"""Numbers with units: the table, and every place where a scenario takes them."""

import math

import pytest

from podusv_cli.core import units


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
    "text", ["", "5", "fast", "21/s", "0x5 m", "017 deg", "nan deg", "5 m 3", "1e999 m", "deg 5"]
)
def test_text_that_is_no_number_in_metres(text):
    assert units.number(text, "m") is None


def test_whole_numbers_stay_whole():
    assert isinstance(units.number("10 steps", "steps"), int)


def test_every_unit_of_the_table_is_exact():
    """No two units of one kind are one, and each is its own spelling."""
    for own, others in units.UNITS.items():
        assert len({*others.values(), 1}) == len(others) + 1
        assert all(units.spelled(name) == name for name in (own, *others))


@pytest.mark.parametrize(
    ("text", "unit", "told"),
    [
        ("45 dge", "rad", "; dge does not fit; did you mean 'deg'? (units here: rad, deg)"),
        ("5 kg", "kg m2", "; kg does not fit (units here: kg m2)"),
        ("0.7 rad", "", "; it has no unit here: write 0.7"),
        ("1e999 m", "m", "; it is too large, numbers must be finite"),
        ("5 ft", "m", ""),
        ("fast", "m", ""),
    ],
)
def test_what_does_not_fit_is_said(text, unit, told):
    assert units.misfit(text, unit) == told
