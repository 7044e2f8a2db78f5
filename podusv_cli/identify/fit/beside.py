"""What the filter follows beside its nine numbers: positions that wander, loads that are smooth.

Errors of positions, north and east apart, are first-order Gauss-Markov processes,

    g' = -g/T_g + w,   E g^2 = s_g^2,   z = (x, y) + g + white error,

and a load, north, east and about the vertical, that is smooth has a rate c of that kind,

    b' = c,   c' = -c/T_b + w,   E c^2 = q_b^2/(2 T_b).

Slower than T_b such a load is the Wiener process of `components.estimators.ekf`; faster, where that
one has the power (q_b/w)^2 at a rate w [rad/s], it has (q_b/w)^2/(1 + (w T_b)^2). A filter that
expects the first of a load without fast parts takes what the load does for the hull's damping.

With e = (g, c) and F and P of the filter's own nine numbers, the covariance C between these and e,
that of e, G, and the diagonals D and W of what forgets and of what is new,

    P' = F P + P F^T + E C^T + C E^T + Q,   C' = F C + E G - C D,   G' = W - D G - G D,

where E is 1 from c to its b, and nothing but c moves b. A position's derivative is h for the nine
and 1 for its own g. Source: A. Gelb (ed.), "Applied Optimal Estimation", MIT Press 1974, ch. 3
(Markov processes, state augmentation), table 6.1-1.
"""

from __future__ import annotations

from typing import Any

from podusv_cli.components.estimators.ekf import MOVING, PACKED, N, predict, unpack_triangle
from podusv_cli.core.kernel import Vector, kernel, scratch, tail

PLAIN = N + PACKED + 2 * MOVING  # numbers of the filter's state without e
AXES, ALL = 2, 5  # of e: g north and east, then c north, east and about the vertical
CROSS, OWN = ALL, ALL + ALL * N  # behind these: C by rows, then G's upper triangle by rows
SIZE = PLAIN + OWN + ALL * (ALL + 1) // 2
DEVIATION, LASTING = "s_g", "T_g"  # m, s
SMOOTH = "T_b"  # s
ASKED = ("wandering", "smooth")  # 1 where the filter follows g and where c, alike in all lanes


@kernel
def entry(a: int, b: int) -> int:
    """Where G has the covariance of two of e, the first before the second or the same."""
    return OWN + ALL * a - a * (a - 1) // 2 + b - a


@kernel
def forgetting(a: int, k: Any) -> float:
    """D of one of e [1/s]."""
    return float(1.0 / k.T_g if a < AXES else 1.0 / k.T_b)


@kernel
def renewal(a: int, k: Any) -> float:
    """W of one of e."""
    if a < AXES:
        return float(2.0 * (1.0 / k.T_g) * k.s_g * k.s_g)
    q = k.q_b_psi if a == ALL - 1 else k.q_b
    return float(q * q / (k.T_b * k.T_b))


@kernel
def spread_beside(begin: int, end: int, f: Vector, e: Vector, k: Any, rate: Vector) -> None:
    """Rates of e, C and G, of those of e from `begin` to before `end`."""
    for a in range(begin, end):
        fade = forgetting(a, k)
        rate[a] = -fade * e[a]
        for i in range(N):
            total = -fade * e[CROSS + ALL * i + a]
            if i < MOVING:
                for c in range(2, N):
                    total += f[N * i + c] * e[CROSS + ALL * c + a]
            elif end == ALL:
                moved = AXES + i - MOVING
                total += e[entry(a, moved) if a < moved else entry(moved, a)]
            rate[CROSS + ALL * i + a] = total
        for b in range(a, end):
            at = entry(a, b)
            rate[at] = -(fade + forgetting(b, k)) * e[at]
        rate[entry(a, a)] += renewal(a, k)


@kernel
def move_loads(e: Vector, rate: Vector) -> None:
    """b' = c, and what that adds to P'; loads have nothing new of their own."""
    at = N
    for i in range(MOVING):
        at += MOVING - i
        for j in range(MOVING, N):
            rate[at] += e[CROSS + ALL * i + AXES + j - MOVING]
            at += 1
    for i in range(MOVING, N):
        rate[i] = e[AXES + i - MOVING]
        for j in range(i, N):
            rate[at] = e[CROSS + ALL * i + AXES + j - MOVING]
            rate[at] += e[CROSS + ALL * j + AXES + i - MOVING]
            at += 1


@kernel
def follow(tau: Vector, state: Vector, k: Any, rate: Vector) -> None:
    """The filter between deliveries, and what is asked for beside it."""
    f = scratch(54)
    predict(tau, state, k, f, rate)
    begin, end = 0 if k.wandering != 0.0 else AXES, ALL if k.smooth != 0.0 else AXES
    if begin < end:
        spread_beside(begin, end, f, tail(state, PLAIN), k, tail(rate, PLAIN))
    if end == ALL:
        move_loads(tail(state, PLAIN), rate)


@kernel
def covariances(
    begin: int, end: int, i: int, h: Vector, state: Vector, ph: Vector, pe: Vector
) -> float:
    """Those of the measured value i with the filter's nine numbers and with e; its own variance."""
    full, e = scratch(81), tail(state, PLAIN)
    unpack_triangle(tail(state, N), full)
    seen = i < AXES and begin == 0
    for a in range(begin, end):
        pe[a] = e[entry(i, a) if a > i else entry(a, i)] if seen else 0.0
        for c in range(MOVING):
            pe[a] += e[CROSS + ALL * c + a] * h[c]
    for j in range(N):
        ph[j] = e[CROSS + ALL * j + i] if seen else 0.0
        for c in range(MOVING):
            ph[j] += full[N * j + c] * h[c]
    own = pe[i] if seen else 0.0
    for j in range(MOVING):
        own += h[j] * ph[j]
    return own


@kernel
def take_in_beside(
    begin: int, end: int, i: int, h: Vector, innovation: float, sigma: float, state: Vector
) -> float:
    """As `ekf.take_in`, with e: correct all that is followed, return the innovation's variance."""
    ph, pe, packed, e = scratch(9), scratch(ALL), tail(state, N), tail(state, PLAIN)
    variance = sigma * sigma + covariances(begin, end, i, h, state, ph, pe)
    gain = 1.0 / variance
    at = 0
    for j in range(N):
        state[j] += ph[j] * gain * innovation
        for c in range(j, N):
            packed[at] -= ph[j] * gain * ph[c]
            at += 1
        for a in range(begin, end):
            e[CROSS + ALL * j + a] -= ph[j] * gain * pe[a]
    for a in range(begin, end):
        e[a] += pe[a] * gain * innovation
        for b in range(a, end):
            e[entry(a, b)] -= pe[a] * gain * pe[b]
    packed[at + i] += innovation * gain * innovation
    packed[at + MOVING + i] += 1.0
    return variance
