"""Exponential, hyperbolic tangent, cosine, sine and direction in plain arithmetic.

The library's functions are calls, one number at a time. These are merged into the loops that use
them, which then work on several numbers at once, and they give the same bits on every machine and
in plain Python.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from podusv_cli.core.kernel import kernel

ROUND = 1.5 * 2.0**52  # added and taken away again it leaves the nearest whole number
SMALLEST = -708.0  # below, e^x is no normal number any more
LARGEST_ANGLE = 1e15  # rad, turns; beyond, neighbouring numbers are too far apart to be directions
LOG2_E = 1.0 / math.log(2.0)  # e^x = 2^(x LOG2_E)
# Long constants in parts, all but the last so short that a whole number times it is exact.
LN2 = (float.fromhex("0x1.62e42feep-1"), float.fromhex("0x1.a39ef35793c76p-33"))
QUARTER = (
    float.fromhex("0x1.921fb544p+0"),
    float.fromhex("0x1.0b4611a6p-34"),
    float.fromhex("0x1.3198a2e037073p-69"),
)
# Polynomials in f^2 through Chebyshev points, |f| <= 1/2: sin(pi f)/f and cos(pi f).
HALF_SINE = (
    3.1415926535362906,
    -5.167712764624565,
    2.5501633189477797,
    -0.5992521978306921,
    0.08205040183478672,
    -0.00702838644352765,
)
HALF_COSINE = (
    0.9999999997799046,
    -4.934802137078845,
    4.0587091595567815,
    -1.3352120030552643,
    0.23493731383698158,
    -0.024396324381933496,
)
QUARTER_PI = (0.25 * math.pi, 0.25 * float.fromhex("0x1.1a62633145c07p-53"))  # and what it lacks
STEEPEST = math.sqrt(2.0) - 1.0  # tangent of an eighth of half a turn
# atan(z) = z + z w (A[0] + A[1] w + ...) for w = z^2: interpolated at Chebyshev's points of
# 0 <= w <= STEEPEST^2, to 1e-18 of z.
A = (
    float.fromhex("-0x1.5555555555555p-2"),
    float.fromhex("0x1.9999999999953p-3"),
    float.fromhex("-0x1.249249248d7eep-3"),
    float.fromhex("0x1.c71c71c304b68p-4"),
    float.fromhex("-0x1.745d165df3f95p-4"),
    float.fromhex("0x1.3b1392d9e785cp-4"),
    float.fromhex("-0x1.110e880a7a521p-4"),
    float.fromhex("0x1.e19a13b9fc6dfp-5"),
    float.fromhex("-0x1.ac7a938b69c94p-5"),
    float.fromhex("0x1.74ddd408bb4c2p-5"),
    float.fromhex("-0x1.1b33b923aa956p-5"),
    float.fromhex("0x1.0ad36a455caffp-6"),
)
E = tuple(1.0 / math.factorial(n) for n in range(18))  # coefficients of all three series
O = tuple(1.0 / (2.0 * n + 1.0) for n in range(12))  # and of artanh  # noqa: E741
SQRT_2 = math.sqrt(2.0)
FRACTION, ONE = (1 << 52) - 1, 1023 << 52  # bits: of the fraction; of the exponent of 1


@kernel
def bits(number: float) -> Any:
    """The 64 bits of a number, as a whole number."""
    return np.float64(number).view(np.int64)


@kernel
def of_bits(whole: Any) -> float:
    """The number with these bits."""
    return np.int64(whole).view(np.float64)


@kernel
def _cubic(x: float, x2: float, a: float, b: float, c: float, d: float) -> float:
    return (a + x * b) + x2 * (c + x * d)


@kernel
def exponential(x: float) -> float:
    """e^x for x <= 0, to one unit in the last place; 0 where that is no normal number."""
    bound = SMALLEST if x < SMALLEST else x
    z = bound * LOG2_E + ROUND
    n = z - ROUND
    r = (bound - n * LN2[0]) - n * LN2[1]
    r2 = r * r
    r4 = r2 * r2
    low = _cubic(r, r2, E[2], E[3], E[4], E[5])
    middle = _cubic(r, r2, E[6], E[7], E[8], E[9])
    high = _cubic(r, r2, E[10], E[11], E[12], E[13])
    series = 1.0 + (r + r2 * (low + r4 * (middle + r4 * high)))
    # The last bits of z are n; in the place of the exponent they make 2^n.
    power = of_bits((bits(z) + 1023) << 52)
    return 0.0 if x < SMALLEST else series * power


@kernel
def logarithm(x: float) -> float:
    """ln x for a normal number x > 0, to three units in the last place of the larger of it and 1.

    x = 2^n m with m from sqrt(1/2) to sqrt(2); ln m = 2 artanh((m - 1)/(m + 1)) as a series.
    """
    n = float((bits(x) >> 52) - 1023)
    m = of_bits((bits(x) & FRACTION) | ONE)
    if m > SQRT_2:
        m = 0.5 * m
        n = n + 1.0
    s = (m - 1.0) / (m + 1.0)
    s2 = s * s
    s4 = s2 * s2
    low = _cubic(s2, s4, O[0], O[1], O[2], O[3])
    middle = _cubic(s2, s4, O[4], O[5], O[6], O[7])
    high = _cubic(s2, s4, O[8], O[9], O[10], O[11])
    series = low + s4 * s4 * (middle + s4 * s4 * high)
    return n * LN2[0] + (2.0 * s * series + n * LN2[1])


@kernel
def power(x: float, exponent: float) -> float:
    """x^exponent for a normal number x > 0, to 1e-15 times 1 + |exponent ln x|."""
    y = exponent * logarithm(x)
    size = exponential(-abs(y))
    return size if y <= 0.0 else 1.0 / size


@kernel
def hyperbolic_tangent(x: float) -> float:
    """tanh x, to two units in the last place of 1."""
    e = exponential(-2.0 * abs(x))
    size = (1.0 - e) / (1.0 + e)
    return -size if x < 0.0 else size


@kernel
def cos_sin(angle: float) -> tuple[float, float]:
    """Cosine and sine of `angle` [rad], to one unit in the last place.

    Beyond 1e6 rad the angle itself is off by up to its last place; beyond 1e15 rad there are none.
    """
    angle = angle if abs(angle) <= LARGEST_ANGLE else math.nan
    z = angle * (2.0 / math.pi) + ROUND
    n = z - ROUND
    r = ((angle - n * QUARTER[0]) - n * QUARTER[1]) - n * QUARTER[2]
    q = -r * r
    q2 = q * q
    q4 = q2 * q2
    even = _cubic(q, q2, E[2], E[4], E[6], E[8]) + q4 * _cubic(q, q2, E[10], E[12], E[14], E[16])
    odd = _cubic(q, q2, E[3], E[5], E[7], E[9]) + q4 * _cubic(q, q2, E[11], E[13], E[15], E[17])
    cosine, sine = 1.0 + q * even, r + r * q * odd
    quarters = bits(z)  # its last two bits count quarter turns
    if quarters & 1:
        cosine, sine = -sine, cosine
    return (-cosine, -sine) if quarters & 2 else (cosine, sine)


@kernel
def cos_sin_of_turns(turns: float) -> tuple[float, float]:
    """Cosine and sine of an angle in whole turns, to 5e-10: enough for one wave of many.

    It takes two thirds of the time of `cos_sin`: an angle in turns is reduced without rounding, and
    both series of the half angle are short. Beyond 1e15 turns there are none.
    """
    turns = turns if abs(turns) <= LARGEST_ANGLE else math.nan
    f = turns - ((turns + ROUND) - ROUND)
    q = f * f
    q2 = q * q
    q4 = q2 * q2
    sine = f * (
        _cubic(q, q2, HALF_SINE[0], HALF_SINE[1], HALF_SINE[2], HALF_SINE[3])
        + q4 * (HALF_SINE[4] + q * HALF_SINE[5])
    )
    cosine = _cubic(q, q2, HALF_COSINE[0], HALF_COSINE[1], HALF_COSINE[2], HALF_COSINE[3]) + q4 * (
        HALF_COSINE[4] + q * HALF_COSINE[5]
    )
    twice = sine + sine
    return 1.0 - twice * sine, twice * cosine


@kernel
def arctangent(y: float, x: float) -> float:
    """Angle [rad] of the vector (x, y) from the x axis, to three units in the last place.

    In [-pi, pi]; 0 where both are 0. It has the sign of y, and the library's `atan2` has it too.
    """
    across, along = abs(y), abs(x)
    steep = across > along
    short, long = (along, across) if steep else (across, along)
    # Beyond an eighth of half a turn the angle is measured from a quarter of it.
    beyond = short > STEEPEST * long
    above, below = (short - long, short + long) if beyond else (short, long)
    z = above / (below if below > 0.0 else 1.0)
    w = z * z
    w2 = w * w
    w4 = w2 * w2
    low, middle = _cubic(w, w2, A[0], A[1], A[2], A[3]), _cubic(w, w2, A[4], A[5], A[6], A[7])
    series = low + w4 * (middle + w4 * _cubic(w, w2, A[8], A[9], A[10], A[11]))
    angle = z + z * (w * series)
    angle = QUARTER_PI[0] + (QUARTER_PI[1] + angle) if beyond else angle
    angle = 2.0 * QUARTER_PI[0] - (angle - 2.0 * QUARTER_PI[1]) if steep else angle
    angle = 4.0 * QUARTER_PI[0] - (angle - 4.0 * QUARTER_PI[1]) if x < 0.0 else angle
    return -angle if y < 0.0 else angle
