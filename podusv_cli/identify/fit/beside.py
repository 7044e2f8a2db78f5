"""What the filter follows beside its nine numbers: positions that wander, loads of gusts.

Errors of positions, north and east apart, are first-order Gauss-Markov processes,

    g' = -g/T_g + w,   E g^2 = s_g^2,   z = (x, y) + g + white error,

and a load of gusts, north, east and about the vertical, swings about its mean B,

    b' = c,   c' = -2 z_b w_b c - w_b^2 (b - B) + w,
    E c^2 = w_b^2 E (b - B)^2 = q_b^2 w_b/(4 z_b).

Where the Wiener process of `components.estimators.ekf` has the power (q_b/w)^2 at w rad/s, this one
has (q_b/w_b)^2/((1 - w^2/w_b^2)^2 + (2 z_b w/w_b)^2), about even below w_b and hardly any above. A
filter that expects the first of gusts takes a part of what they do for the hull's damping.

With e = (g, c) and F and P of the filter's own nine numbers, the covariance C between these and e,
that of e, G, the diagonals D and W of what forgets and of what is new, and K of w_b^2,

    P' = F P + P F^T + J C^T + C J^T + Q,   C' = F C + J G - C D - P J K,
    G' = W - D G - G D - K J^T C - C^T J K,

where J is 1 from c to its b, and nothing but c moves b. A position's derivative is h for the nine
and 1 for its own g. Sources: A. Gelb (ed.), "Applied Optimal Estimation", MIT Press 1974, ch. 3
(Markov processes, state augmentation), table 6.1-1; the second-order process has the poles of the
linear wave model, T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion Control", 2011,
8.2.6, and no zero.
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
RATE, SWINGS = "w_b", "z_b"  # rad/s, 1
ASKED = ("wandering", "gusts")  # 1 where the filter follows g and where c, alike in all lanes


@kernel
def entry(a: int, b: int) -> int:
    """Where G has the covariance of two of e, the first before the second or the same."""
    return OWN + ALL * a - a * (a - 1) // 2 + b - a


@kernel
def forgetting(a: int, k: Any) -> float:
    """D of one of e [1/s]."""
    return float(1.0 / k.T_g if a < AXES else 2.0 * k.z_b * k.w_b)


@kernel
def renewal(a: int, k: Any) -> float:
    """W of one of e."""
    if a < AXES:
        return float(2.0 * (1.0 / k.T_g) * k.s_g * k.s_g)
    q = k.q_b_psi if a == ALL - 1 else k.q_b
    return float(q * q * k.w_b * k.w_b)


@kernel
def spread_beside(begin: int, end: int, f: Vector, state: Vector, k: Any, rate: Vector) -> None:
    """Rates of e, C and G, of those of e from `begin` to before `end`, as if nothing swung."""
    e, to = tail(state, PLAIN), tail(rate, PLAIN)
    for a in range(begin, end):
        fade = forgetting(a, k)
        to[a] = -fade * e[a]
        for i in range(N):
            total = -fade * e[CROSS + ALL * i + a]
            if i < MOVING:
                for c in range(2, N):
                    total += f[N * i + c] * e[CROSS + ALL * c + a]
            elif end == ALL:
                moved = AXES + i - MOVING
                total += e[entry(a, moved) if a < moved else entry(moved, a)]
            to[CROSS + ALL * i + a] = total
        for b in range(a, end):
            at = entry(a, b)
            to[at] = -(fade + forgetting(b, k)) * e[at]
        to[entry(a, a)] += renewal(a, k)


@kernel
def swing(begin: int, state: Vector, k: Any, rate: Vector) -> None:
    """What w_b^2 (b - B) adds to the rates of c, C and G."""
    full, e, to = scratch(81), tail(state, PLAIN), tail(rate, PLAIN)
    unpack_triangle(tail(state, N), full)
    stiff = k.w_b * k.w_b
    for c in range(ALL - AXES):
        a, load = AXES + c, MOVING + c
        mean = k.mean_x if c == 0 else (k.mean_y if c == 1 else k.mean_psi)
        to[a] -= stiff * (state[load] - mean)
        for i in range(N):
            to[CROSS + ALL * i + a] -= stiff * full[N * i + load]
        for b in range(begin, ALL):
            at = entry(b, a) if b < a else entry(a, b)
            to[at] -= stiff * e[CROSS + ALL * load + b] * (2.0 if a == b else 1.0)


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
    begin, end = 0 if k.wandering != 0.0 else AXES, ALL if k.gusts != 0.0 else AXES
    if begin < end:
        spread_beside(begin, end, f, state, k, rate)
    if end == ALL:
        swing(begin, state, k, rate)
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
