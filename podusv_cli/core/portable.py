"""Exponential, logarithm and normal quantiles of arrays, with the same bits on every machine.

Only plain arithmetic and square roots; logarithms and exponentials of libraries differ in the last
bit between processors. So drawn numbers depend on no machine.
"""

from __future__ import annotations

import math

import numpy as np

from podusv_cli.core.elementary import LN2, LOG2_E, E
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


def _polynomial(x: Vector, coefficients: tuple[float, ...]) -> Vector:
    """Horner's scheme at x (n,), the highest power first."""
    result = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        result = result * x + coefficient
    return result


def logarithm(x: Vector) -> Vector:
    """ln x of x (n,), to two units in the last place."""
    mantissa, exponent = np.frexp(x)
    low = mantissa < math.sqrt(0.5)
    mantissa, exponent = np.where(low, 2.0 * mantissa, mantissa), exponent - low
    s = (mantissa - 1.0) / (mantissa + 1.0)
    series = 2.0 * s * _polynomial(s * s, tuple(1.0 / n for n in range(23, 0, -2)))
    return exponent * LN2[0] + (series + exponent * LN2[1])


def exponential(x: Vector) -> Vector:
    """e^x of x (n,), to two units in the last place."""
    n = np.rint(x * LOG2_E)
    r = (x - n * LN2[0]) - n * LN2[1]
    return np.ldexp(_polynomial(r, E[::-1]), n.astype(np.int32))


def _ratio(x: Vector, part: tuple[tuple[float, ...], tuple[float, ...]]) -> Vector:
    """A rational function of x (n,): the coefficients of numerator and denominator."""
    return _polynomial(x, part[0]) / _polynomial(x, part[1])


def standard_normal(u: Vector) -> Vector:
    """The standard normal numbers (n,) that a share u (n,) of all are below."""
    q = u - 0.5
    z = q * _ratio(0.180625 - q * q, CENTRAL)
    out = np.abs(q) > 0.425
    r = np.sqrt(-logarithm(np.minimum(u[out], 1.0 - u[out])))
    tail = np.where(r <= 5.0, _ratio(r - 1.6, TAIL), _ratio(r - 5.0, FAR_TAIL))
    z[out] = np.copysign(tail, q[out])
    return z


def by_lines(at: Vector, x: Vector, y: Vector) -> Vector:
    """y at each of `at`, between the points (x, y) and beyond the first and last two by lines."""
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    return np.asarray(y[i] + (at - x[i]) / (x[i + 1] - x[i]) * (y[i + 1] - y[i]))
