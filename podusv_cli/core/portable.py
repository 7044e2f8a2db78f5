"""Functions and sums of arrays, with the same bits on every machine.

Only plain arithmetic and square roots: functions of libraries differ in the last bit between
processors, and so do sums, in whose order a library has a free choice. So drawn numbers, and what
is computed after a march, depend on no machine.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from functools import reduce

import numpy as np

from podusv_cli.core.elementary import (
    LARGEST_ANGLE,
    LN2,
    LOG2_E,
    QUARTER,
    QUARTER_PI,
    ROUND,
    STEEPEST,
    A,
    E,
)
from podusv_cli.core.kernel import Vector

# Wichura (1988), algorithm AS 241, PPND16: numerator and denominator of each of its three parts.
# fmt: off
CENTRAL, TAIL, FAR_TAIL = (
    ((
        2509.0809287301227, 33430.57558358813, 67265.7709270087, 45921.95393154987,
        13731.69376550946, 1971.5909503065513, 133.14166789178438, 3.3871328727963665,
    ), (
        5226.495278852854, 28729.085735721943, 39307.89580009271, 21213.794301586597,
        5394.196021424751, 687.1870074920579, 42.31333070160091, 1.0,
    )),
    ((
        0.0007745450142783414, 0.022723844989269184, 0.2417807251774506, 1.2704582524523684,
        3.6478483247632045, 5.769497221460691, 4.630337846156546, 1.4234371107496835,
    ), (
        1.0507500716444169e-09, 0.0005475938084995345, 0.015198666563616457,
        0.14810397642748008, 0.6897673349851, 1.6763848301838038, 2.053191626637759, 1.0,
    )),
    ((
        2.0103343992922881e-07, 2.7115555687434876e-05, 0.0012426609473880784,
        0.026532189526576124, 0.29656057182850487, 1.7848265399172913, 5.463784911164114,
        6.657904643501103,
    ), (
        2.0442631033899397e-15, 1.421511758316446e-07, 1.8463183175100548e-05,
        0.0007868691311456133, 0.014875361290850615, 0.1369298809227358, 0.599832206555888,
        1.0,
    )),
)
# fmt: on


WITHIN = (-746.0, 710.0)  # beyond, e^x is 0 or infinite


def add_up(numbers: Iterable[float]) -> float:
    """Their sum, rounded after each; from Python 3.12 on `sum` rounds floats otherwise."""
    return reduce(operator.add, numbers, 0.0)


def _polynomial(x: Vector, coefficients: tuple[float, ...]) -> Vector:
    """Horner's scheme at x (n,), the highest power first."""
    result = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        result = result * x + coefficient
    return result


def logarithm(x: Vector) -> Vector:
    """ln x of x (n,), to two units in the last place.

    x = m 2^e with m about 1; ln m is 2 artanh s as a series of s = (m - 1)/(m + 1).
    """
    mantissa, exponent = np.frexp(x)
    low = mantissa < math.sqrt(0.5)
    mantissa, exponent = np.where(low, 2.0 * mantissa, mantissa), exponent - low
    s = (mantissa - 1.0) / (mantissa + 1.0)
    series = 2.0 * s * _polynomial(s * s, tuple(1.0 / n for n in range(23, 0, -2)))
    return exponent * LN2[0] + (series + exponent * LN2[1])


def exponential(x: Vector) -> Vector:
    """e^x of x of any shape, to two units in the last place; 0 or infinity beyond its range.

    x = n ln 2 + r with a small r, for which the series serves; ln 2 in two parts loses no digits.
    """
    x = np.clip(x, *WITHIN)
    n = np.rint(x * LOG2_E)
    r = (x - n * LN2[0]) - n * LN2[1]
    return np.ldexp(_polynomial(r, E[::-1]), n.astype(np.int32))


def cosine_and_sine(angle: Vector) -> tuple[Vector, Vector]:
    """Cosine and sine of angles [rad] (n,), with the bits of `elementary.cos_sin`."""
    angle = np.where(np.abs(angle) <= LARGEST_ANGLE, angle, np.nan)
    z = angle * (2.0 / math.pi) + ROUND  # whose last bits are the number of quarter turns
    n = z - ROUND
    r = ((angle - n * QUARTER[0]) - n * QUARTER[1]) - n * QUARTER[2]
    q = -r * r
    q4 = (q * q) * (q * q)
    even = _cubic(q, E[2:9:2]) + q4 * _cubic(q, E[10:17:2])
    odd = _cubic(q, E[3:10:2]) + q4 * _cubic(q, E[11:18:2])
    cosine, sine = 1.0 + q * even, r + r * q * odd
    quarters = z.view(np.int64)  # its last two bits count quarter turns
    turned, over = (quarters & 1) > 0, np.where(quarters & 2, -1.0, 1.0)
    cosine, sine = np.where(turned, -sine, cosine), np.where(turned, cosine, sine)
    return over * cosine, over * sine


def arctangents(y: Vector, x: Vector) -> Vector:
    """Angles [rad] of vectors (x, y) from the x axis (n,), with the bits of `arctangent`.

    The angle from the nearer axis or diagonal, for which the series serves, then the way back.
    """
    across, along = np.abs(y), np.abs(x)
    steep = across > along
    short, long = np.minimum(across, along), np.maximum(across, along)
    beyond = short > STEEPEST * long
    above = np.where(beyond, short - long, short)
    below = np.where(beyond, short + long, long)
    z = above / np.where(below > 0.0, below, 1.0)
    w = z * z
    w4 = (w * w) * (w * w)
    series = _cubic(w, A[:4]) + w4 * (_cubic(w, A[4:8]) + w4 * _cubic(w, A[8:12]))
    angle = z + z * (w * series)
    angle = np.where(beyond, QUARTER_PI[0] + (QUARTER_PI[1] + angle), angle)
    angle = np.where(steep, 2.0 * QUARTER_PI[0] - (angle - 2.0 * QUARTER_PI[1]), angle)
    angle = np.where(x < 0.0, 4.0 * QUARTER_PI[0] - (angle - 4.0 * QUARTER_PI[1]), angle)
    return np.where(y < 0.0, -angle, angle)


def _cubic(x: Vector, c: tuple[float, ...]) -> Vector:
    """A polynomial of four coefficients at x (n,), in the order of `elementary`."""
    return (c[0] + x * c[1]) + (x * x) * (c[2] + x * c[3])


def total(terms: Vector) -> Vector:
    """The sum over the first axis of terms (n, ...), shape (...), by halves.

    The order of the additions is fixed; rounding errors grow with log n. For n = 1 it is a view of
    `terms`: copy it before you write into it.
    """
    terms = np.asarray(terms)
    while len(terms) > 1:
        half, odd = divmod(len(terms), 2)
        folded = terms[:half] + terms[half : 2 * half]
        if odd:
            folded[0] += terms[-1]
        terms = folded
    return terms[0] if len(terms) else np.zeros(terms.shape[1:])


def solve(matrix: Vector, right: Vector) -> Vector:
    """x of matrix x = right, for a symmetric positive definite matrix (n, n) and right (n,).

    By elimination without pivots, which such a matrix does not need.
    """
    rest, x = matrix.copy(), right.copy()
    for i in range(len(x) - 1):
        factors = rest[i + 1 :, i] / rest[i, i]
        rest[i + 1 :, i + 1 :] -= factors[:, None] * rest[i, i + 1 :]
        x[i + 1 :] -= factors * x[i]
    for i in reversed(range(len(x))):
        x[i] = (x[i] - total(rest[i, i + 1 :] * x[i + 1 :])) / rest[i, i]
    return x


def _ratio(x: Vector, part: tuple[tuple[float, ...], tuple[float, ...]]) -> Vector:
    """A rational function of x (n,): the coefficients of numerator and denominator."""
    return _polynomial(x, part[0]) / _polynomial(x, part[1])


def standard_normal(u: Vector) -> Vector:
    """The standard normal numbers (n,) that a share u (n,) in (0, 1) of all are below."""
    # Borders and shifts of the three parts are the published ones; r is that of the nearer tail
    q = u - 0.5
    z = q * _ratio(0.180625 - q * q, CENTRAL)
    out = np.abs(q) > 0.425
    r = np.sqrt(-logarithm(np.minimum(u[out], 1.0 - u[out])))
    tail = np.where(r <= 5.0, _ratio(r - 1.6, TAIL), _ratio(r - 5.0, FAR_TAIL))
    z[out] = np.copysign(tail, q[out])
    return z


def by_lines(at: Vector, x: Vector, y: Vector) -> Vector:
    """y at each of `at` (m,), between points (x, y) (n,) and beyond the ends, by straight lines.

    x rises; beyond the ends the first and the last line go on.
    """
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    return np.asarray(y[i] + (at - x[i]) / (x[i + 1] - x[i]) * (y[i + 1] - y[i]))
