"""A position whose error wanders, and the two numbers by which the filter follows it.

    g' = -g/T_g + w,   E g^2 = s_g^2,   z = (x, y) + g + white error

north and east apart: a first-order Gauss-Markov process each. Nothing but a position sees g, and g
moves nothing, so of the covariance of all eleven numbers three blocks are left: P of the filter's
own nine, C between these and g, G of g. With F and P as in `components.estimators.ekf`

    C' = F C - C/T_g,   G' = -2 G/T_g + 2 s_g^2/T_g I,

and a position's derivative is h for the nine and 1 for its own g. Source: A. Gelb (ed.), "Applied
Optimal Estimation", MIT Press 1974, ch. 3 (Markov processes, state augmentation), table 6.1-1.
"""

from __future__ import annotations

from typing import Any

from podusv_cli.components.estimators.ekf import MOVING, PACKED, N, predict, unpack_triangle
from podusv_cli.core.kernel import Vector, kernel, scratch, tail

PLAIN = N + PACKED + 2 * MOVING  # numbers of the filter's state without g
AXES = 2  # north, east
CROSS, OWN = AXES, AXES + AXES * N  # behind these: C by rows, then G as (north, both, east)
SIZE = PLAIN + OWN + 3
DEVIATION, LASTING = "s_g", "T_g"  # m, s
ASKED = "wandering"  # 1 where the filter follows g, alike in all lanes


@kernel
def spread_errors(f: Vector, errors: Vector, k: Any, rate: Vector) -> None:
    """Rates of g, C and G."""
    fade = 1.0 / k.T_g
    for a in range(AXES):
        rate[a] = -fade * errors[a]
        for i in range(N):
            total = -fade * errors[CROSS + AXES * i + a]
            if i < MOVING:
                for c in range(2, N):
                    total += f[N * i + c] * errors[CROSS + AXES * c + a]
            rate[CROSS + AXES * i + a] = total
    for j in range(3):
        rate[OWN + j] = -2.0 * fade * errors[OWN + j]
    rate[OWN] += 2.0 * fade * k.s_g * k.s_g
    rate[OWN + 2] += 2.0 * fade * k.s_g * k.s_g


@kernel
def follow(tau: Vector, state: Vector, k: Any, rate: Vector) -> None:
    """The filter between deliveries, and the error of its positions where that is asked for."""
    f = scratch(54)
    predict(tau, state, k, f, rate)
    if k.wandering != 0.0:
        spread_errors(f, tail(state, PLAIN), k, tail(rate, PLAIN))


@kernel
def covariances(i: int, h: Vector, state: Vector, ph: Vector, pg: Vector) -> float:
    """Those of the measured value i with the filter's nine numbers and with g; its own variance."""
    full, errors = scratch(81), tail(state, PLAIN)
    unpack_triangle(tail(state, N), full)
    for a in range(AXES):
        pg[a] = errors[OWN + a + i] if i < AXES else 0.0
        for c in range(MOVING):
            pg[a] += errors[CROSS + AXES * c + a] * h[c]
    for j in range(N):
        ph[j] = errors[CROSS + AXES * j + i] if i < AXES else 0.0
        for c in range(MOVING):
            ph[j] += full[N * j + c] * h[c]
    own = pg[i] if i < AXES else 0.0
    for j in range(MOVING):
        own += h[j] * ph[j]
    return own


@kernel
def take_in_wandering(i: int, h: Vector, innovation: float, sigma: float, state: Vector) -> float:
    """As `ekf.take_in`, with g: correct all eleven numbers, return the innovation's variance."""
    ph, pg, packed, errors = scratch(9), scratch(2), tail(state, N), tail(state, PLAIN)
    variance = sigma * sigma + covariances(i, h, state, ph, pg)
    gain = 1.0 / variance
    at = 0
    for j in range(N):
        state[j] += ph[j] * gain * innovation
        for c in range(j, N):
            packed[at] -= ph[j] * gain * ph[c]
            at += 1
        for a in range(AXES):
            errors[CROSS + AXES * j + a] -= ph[j] * gain * pg[a]
    for a in range(AXES):
        errors[a] += pg[a] * gain * innovation
        for b in range(a, AXES):
            errors[OWN + a + b] -= pg[a] * gain * pg[b]
    packed[at + i] += innovation * gain * innovation
    packed[at + MOVING + i] += 1.0
    return variance
