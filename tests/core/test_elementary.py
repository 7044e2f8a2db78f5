"""Elementary functions: against the library's, and the same bits compiled or not."""

import math
from typing import Any

import numpy as np
import pytest
from conftest import adrift, run
from hypothesis import example, given
from hypothesis import strategies as st
from numba import njit

from podusv_cli.components.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.core.elementary import (
    arctangent,
    cos_sin,
    cos_sin_of_turns,
    exponential,
    logarithm,
    power,
)
from podusv_cli.core.kernel import Vector
from podusv_cli.core.kinematics import direction
from podusv_cli.engine.machine import compile_numba

EPSILON = np.finfo(float).eps


def compiled(function: Any, numbers: Vector) -> Vector:
    inner = compile_numba.inline_kernel(function)
    code = njit(lambda x: inner(x))
    return np.array([code(x) for x in numbers])


@given(x=st.floats(-708, 0))
@example(x=-0.5 * math.log(2))  # where the nearest power of two changes
@example(x=0.0)
@example(x=-708.0)
def test_the_exponential_is_right_to_the_last_place(x):
    assert exponential(x) == pytest.approx(math.exp(x), rel=EPSILON, abs=0)


def test_the_exponential_ends_in_zero_and_passes_on_what_is_no_number():
    assert exponential(0.0) == 1.0
    assert exponential(-709.0) == exponential(-math.inf) == 0.0
    assert math.isnan(exponential(math.nan))


@given(x=st.floats(1e-300, 1e300))
@example(x=1.0)
@example(x=math.sqrt(2.0))  # where the power of two changes
@example(x=math.nextafter(1.0, 0.0))
@example(x=math.nextafter(1.0, 2.0))
def test_the_logarithm_is_right_to_three_units(x):
    assert logarithm(x) == pytest.approx(math.log(x), rel=3 * EPSILON, abs=1e-300)


@given(x=st.floats(1e-6, 1e3), exponent=st.floats(-3.0, 3.0))
def test_a_power_is_that_of_the_library(x, exponent):
    assert power(x, exponent) == pytest.approx(x**exponent, rel=1e-14)


@given(angle=st.floats(-1e6, 1e6))
@example(angle=math.pi / 4)  # where the nearest quarter turn changes
@example(angle=-3 * math.pi / 4)
@example(angle=0.5 * math.pi)
@example(angle=1e6)
def test_cosine_and_sine_are_right_to_the_last_place(angle):
    assert cos_sin(angle) == pytest.approx((math.cos(angle), math.sin(angle)), abs=EPSILON)


@given(angle=st.floats(-1e15, 1e15))
def test_far_out_they_are_those_of_a_neighbouring_angle(angle):
    near = 4 * math.ulp(angle) + EPSILON
    assert cos_sin(angle) == pytest.approx((math.cos(angle), math.sin(angle)), abs=near)


@given(angle=st.floats(allow_nan=False))
@example(angle=1e15)
@example(angle=1e16)
@example(angle=-1e17)
@example(angle=1e308)
def test_what_they_give_is_a_rotation_or_no_number(angle):
    cosine, sine = cos_sin(angle)
    if abs(angle) <= 1e15:
        assert cosine * cosine + sine * sine == pytest.approx(1.0, abs=4 * EPSILON)
    else:
        assert math.isnan(cosine)
        assert math.isnan(sine)


def test_a_disturbance_of_which_no_phase_is_known_ends_the_run():
    sea = HarmonicDisturbance(b_u=Harmonic(sin=1.0, sin_rate=1e19))
    out = run(adrift(disturbance=sea), 1.0)
    assert (out.status, len(out["time"])) == ("diverged", 1)


@given(turns=st.floats(-1e5, 1e5))
@example(turns=0.5)
@example(turns=-0.25)
@example(turns=12345.5)
def test_a_wave_is_right_to_nine_places(turns):
    angle = 2.0 * math.pi * math.remainder(turns, 1.0)
    assert cos_sin_of_turns(turns) == pytest.approx((math.cos(angle), math.sin(angle)), abs=5e-10)


@pytest.mark.parametrize("turns", [1e16, -1e20, 1e308, math.inf, math.nan])
def test_a_wave_of_which_no_phase_is_known_is_no_number(turns):
    assert all(math.isnan(number) for number in cos_sin_of_turns(turns))


@pytest.mark.parametrize("function", [exponential, logarithm, cos_sin, cos_sin_of_turns])
def test_machine_code_gives_the_same_bits(function):
    numbers = -np.random.default_rng(3).exponential(20.0, 2000)
    numbers = np.append(numbers, [-1e15, -1e17, -1e308])
    plain = np.array([function(float(x)) for x in numbers])
    np.testing.assert_array_equal(compiled(function, numbers), plain)


@given(x=st.floats(-1e150, 1e150), y=st.floats(-1e150, 1e150))
def test_directions_are_right_to_three_units_in_the_last_place(x, y):
    wanted = math.atan2(y + 0.0, x + 0.0)
    if abs(wanted) < 1e-300:  # no normal number
        assert abs(direction(x, y) - wanted) < 1e-300
    else:
        assert abs(direction(x, y) - wanted) <= 3.0 * math.ulp(wanted)


def test_directions_on_the_axes_are_exact():
    ends = (-1.0, -0.0, 0.0, 1.0)
    for x in ends:
        for y in ends:
            assert direction(x, y) == math.atan2(y + 0.0, x + 0.0)
    assert math.isnan(arctangent(math.nan, 1.0))
