"""Allocation for several pods: least squares over sectors of force, solved exactly.

Pod i makes the force R_i g_i, where g_i lies in a circular sector (the angles it can take, thrust
up to its limit) or, for thrust astern, in the opposite one; a fixed propeller's is a segment, as is
that of a propeller astern with a rudder behind it. With a side chosen for each pod the problem

    minimise 1/2 |y|^2 + eps/2 sum |g_i|^2,  y = sum C_i g_i - tau,  g_i in its sector

is convex with one solution, and so is found by Newton's method on its dual, which has as many
unknowns as tau has entries: g_i is the point of the sector nearest to -C_i' y/eps (Bertsekas,
Nonlinear Programming, on duality of separable problems). Over all choices of sides the best is
taken, so the solution is that of the problem with both senses of thrust.
"""

from __future__ import annotations

import math

from podusv_cli.core.kernel import Vector, kernel, scratch, tail

MOST_PODS = 4  # all 2^4 choices of ahead and astern are tried
AXES = 3  # surge, sway, yaw
# A pod's row in `sectors`: directions of the two edges, most along them and astern; 1 for a segment
# both ways; 1 for a rudder, whose force astern is straight.
LOW_COS, LOW_SIN, HIGH_COS, HIGH_SIN, MOST_ASTERN, MOST_AHEAD, FIXED, STRAIGHT, SECTOR = range(9)
# Room for all pods: sectors, columns C_i, and the forces g_i with three numbers more.
SECTORS, COLUMNS, FORCES = SECTOR * MOST_PODS, 2 * AXES * MOST_PODS, 2 * MOST_PODS + 3
# Where a thrust is at its limit the part of a step that is level can be 1e-7 of it. A search that
# ends before it has found that part goes too far, and three such steps can come back to the first.
ITERATIONS, TRIALS = 60, 100
SETTLED, LEVEL = 1e-9, 0.1


# The point (p_x, p_y) is in parts of the largest thrust; side 1 is ahead, -1 astern. Writes out
# (5): the nearest point (2) and its derivative (3). In turn: a rudder astern, whose force is
# straight; a point between the edges, cut at the arc; else the nearer of the two edges.
@kernel
def nearest(p_x: float, p_y: float, sector: Vector, side: float, out: Vector) -> None:
    """The nearest point of the sector, then the derivative of that point (xx, xy, yy)."""
    most = sector[MOST_AHEAD] if side > 0.0 else sector[MOST_ASTERN]
    least = 0.0
    p_x, p_y = side * p_x, side * p_y
    if side < 0.0 and sector[STRAIGHT] > 0.0:
        out[0], out[1] = -min(max(p_x, 0.0), most), 0.0
        out[2], out[3], out[4] = 1.0 if 0.0 < p_x < most else 0.0, 0.0, 0.0
        return
    if sector[FIXED] > 0.0:
        least = -sector[MOST_ASTERN] if side > 0.0 else -sector[MOST_AHEAD]
    elif (
        sector[LOW_COS] * p_y - sector[LOW_SIN] * p_x >= 0.0
        and sector[HIGH_SIN] * p_x - sector[HIGH_COS] * p_y >= 0.0
    ):
        r = math.sqrt(p_x * p_x + p_y * p_y)
        scale = most / r if r > most else 1.0
        out[0], out[1] = side * scale * p_x, side * scale * p_y
        fall = scale / (r * r) if r > most else 0.0
        out[2], out[3] = scale - fall * p_x * p_x, -fall * p_x * p_y
        out[4] = scale - fall * p_y * p_y
        return
    low = sector[LOW_COS] * p_x + sector[LOW_SIN] * p_y
    high = sector[HIGH_COS] * p_x + sector[HIGH_SIN] * p_y
    on_low, on_high = min(max(low, least), most), min(max(high, least), most)
    nearer_low = on_low * (on_low - 2.0 * low) <= on_high * (on_high - 2.0 * high)
    cos, sin = sector[HIGH_COS], sector[HIGH_SIN]
    along, on = high, on_high
    if nearer_low:
        cos, sin, along, on = sector[LOW_COS], sector[LOW_SIN], low, on_low
    free = 1.0 if along == on else 0.0
    out[0], out[1] = side * on * cos, side * on * sin
    out[2], out[3], out[4] = free * cos * cos, free * cos * sin, free * sin * sin


# C (count, 3, 2) gives the axes' forces for those of the pods, tau (3) are the forces wanted, sides
# (count) are 1 or -1, sectors (count, SECTOR) as `allocation.shape` writes them; `eps` weighs the
# thrust. p is where the pod's force would be without a sector; the nearest point of the sector is
# g.
@kernel
def pull(
    count: int,
    C: Vector,
    tau: Vector,
    sides: Vector,
    sectors: Vector,
    eps: float,
    y: Vector,
    g: Vector,
    slope: Vector,
    curve: Vector,
) -> None:
    """The dual's gradient at y into `slope`, minus its Hessian into `curve`.

    `g` takes two numbers a pod, then three more of scratch; `curve` the lower triangle.
    """
    for a in range(AXES):
        slope[a] = -tau[a] - y[a]
    for a in range(6):
        curve[a] = 0.0
    curve[0] = curve[2] = curve[5] = 1.0
    for i in range(count):
        c = tail(C, 2 * AXES * i)
        p_x = -(c[0] * y[0] + c[2] * y[1] + c[4] * y[2]) / eps
        p_y = -(c[1] * y[0] + c[3] * y[1] + c[5] * y[2]) / eps
        at = tail(g, 2 * i)
        nearest(p_x, p_y, tail(sectors, SECTOR * i), sides[i], at)
        xx, xy, yy = at[2] / eps, at[3] / eps, at[4] / eps
        for a in range(AXES):
            slope[a] += c[2 * a] * at[0] + c[2 * a + 1] * at[1]
            for b in range(a + 1):
                curve[a * (a + 1) // 2 + b] += c[2 * a] * (xx * c[2 * b] + xy * c[2 * b + 1]) + c[
                    2 * a + 1
                ] * (xy * c[2 * b] + yy * c[2 * b + 1])


# Reads curve (6) and slope (3) as `pull` writes them; writes out (3). l00 to l22 are the factor's
# entries.
@kernel
def ascent(curve: Vector, slope: Vector, out: Vector) -> None:
    """Newton's direction curve^-1 slope by Cholesky; curve is at least the unit matrix."""
    l00 = math.sqrt(curve[0])
    l10, l20 = curve[1] / l00, curve[3] / l00
    l11 = math.sqrt(max(1.0, curve[2] - l10 * l10))
    l21 = (curve[4] - l20 * l10) / l11
    l22 = math.sqrt(max(1.0, curve[5] - l20 * l20 - l21 * l21))
    a = slope[0] / l00
    b = (slope[1] - l10 * a) / l11
    c = (slope[2] - l20 * a - l21 * b) / l22
    out[2] = c / l22
    out[1] = (b - l21 * out[2]) / l11
    out[0] = (a - l10 * out[1] - l20 * out[2]) / l00


# Arguments as those of `pull`. Changes y (3) until the slope is less than `settled`; g and slope
# belong to that y.
@kernel
def climb(
    count: int,
    C: Vector,
    tau: Vector,
    sides: Vector,
    sectors: Vector,
    eps: float,
    settled: float,
    y: Vector,
    g: Vector,
    slope: Vector,
) -> None:
    """Newton's method on the dual from y, each step as long as the dual rises along it."""
    way, curve = scratch(3), scratch(6)
    pull(count, C, tau, sides, sectors, eps, y, g, slope, curve)
    for _ in range(ITERATIONS):
        if not abs(slope[0]) + abs(slope[1]) + abs(slope[2]) > settled:  # or it is no number
            break
        ascent(curve, slope, way)
        along(count, C, tau, sides, sectors, eps, way, y, g, slope, curve)


# Arguments as those of `pull`; `way` (3) is Newton's direction. Changes y (3), g, slope and curve.
# The rise along the way falls from `first` (the dual is concave); the zero is sought by halving
# and, every other time, by the secant, which a kink can hold up.
@kernel
def along(
    count: int,
    C: Vector,
    tau: Vector,
    sides: Vector,
    sectors: Vector,
    eps: float,
    way: Vector,
    y: Vector,
    g: Vector,
    slope: Vector,
    curve: Vector,
) -> None:
    """One step from y: the whole way where the dual rises all along, else to where it is level."""
    start = scratch(3)
    for a in range(AXES):
        start[a] = y[a]
    first = slope[0] * way[0] + slope[1] * way[1] + slope[2] * way[2]
    low, high, rise_low, rise_high = 0.0, 1.0, first, 0.0
    part = 1.0
    for trial in range(TRIALS):
        for a in range(AXES):
            y[a] = start[a] + part * way[a]
        pull(count, C, tau, sides, sectors, eps, y, g, slope, curve)
        rise = slope[0] * way[0] + slope[1] * way[1] + slope[2] * way[2]
        if abs(rise) <= LEVEL * first or (rise > 0.0 and part == 1.0):
            break
        if rise > 0.0:
            low, rise_low = part, rise
        else:
            high, rise_high = part, rise
        part = 0.5 * (low + high)
        if trial % 2 == 0 and rise_high < 0.0:
            part = low + (high - low) * rise_low / (rise_low - rise_high)


# Arguments as those of `pull`; y starts at 0. Settled is relative to the size of what is wanted.
# The cost is what is short of `tau`, squared, and `eps` times the forces squared.
@kernel
def on_these_sides(
    count: int, C: Vector, tau: Vector, sides: Vector, sectors: Vector, eps: float, g: Vector
) -> float:
    """Solve with these sides: forces into `g` (see `pull`), gives the cost."""
    y, slope = scratch(3), scratch(3)
    for a in range(AXES):
        y[a] = 0.0
    size = 1.0 + abs(tau[0]) + abs(tau[1]) + abs(tau[2])
    climb(count, C, tau, sides, sectors, eps, SETTLED * size, y, g, slope)
    # Whatever the last step left, g is in its sectors; its cost is what counts.
    cost = 0.0
    for a in range(AXES):
        short = slope[a] + y[a]
        cost += 0.5 * short * short
    for i in range(2 * count):
        cost += 0.5 * eps * g[i] * g[i]
    return cost


# C, tau and sectors as in `pull`. All 2^count choices of ahead or astern are tried: on given sides
# the problem is convex, and pods are few. A fixed propeller's segment reaches both ways, so a
# choice that has it astern is left out. Writes best (2 count).
@kernel
def several_pods(
    count: int, C: Vector, tau: Vector, sectors: Vector, eps: float, best: Vector
) -> float:
    """The best forces g over all sides into `best`, two numbers a pod; gives their cost.

    No numbers, at an infinite cost, where `C` or `tau` leave all numbers.
    """
    g, sides = scratch(FORCES), scratch(MOST_PODS)
    least = math.inf
    for i in range(2 * count):
        best[i] = math.nan
    for choice in range(1 << count):
        wanted = True
        for i in range(count):
            sides[i] = -1.0 if (choice >> i) & 1 else 1.0
            if sides[i] < 0.0 and sectors[SECTOR * i + FIXED] > 0.0:
                wanted = False  # a segment reaches both ways
        if wanted:
            cost = on_these_sides(count, C, tau, sides, sectors, eps, g)
            if cost < least:
                least = cost
                for i in range(2 * count):
                    best[i] = g[i]
    return least
