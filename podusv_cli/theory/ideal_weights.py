"""Ideal weights of the two networks (13), (25), (34). They are unknown and fitted to a run.

The fit minimises the mean of (m epsilon)^2 over the visited states plus sigma |W - W(0)|^2. This is
the networks' mean contribution to Delta in (48), so there is no free parameter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from podusv_cli.components.controllers.network import Network
from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.kernel import Vector
from podusv_cli.core.portable import exponential, solve, total
from podusv_cli.core.recording import Recording
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.engine.running.replay import Replayed

MOST_ROWS = 2000  # of a run that the fit uses, evenly spread
MOST_NUMBERS = 2_000_000  # rows times nodes of the fit
SINGULAR = 1e-12  # relative; least regularisation, for weights that no visited state determines


@dataclass(frozen=True)
class IdealWeights:
    """Weights W*, shape (nodes,), surge [m/s2] and yaw [rad/s2]."""

    W_u: Vector
    W_r: Vector


def unloaded_accelerations(loop: ClosedLoop, now: Replayed) -> tuple[Vector, Vector]:
    """f_u [m/s2] and f_r [rad/s2] (rows,): accelerations less those of actuator and disturbance.

    `now` has rates and signals at the rows. For any vessel, with its full mass matrix, in which a
    sway force turns the hull as well.
    """
    m, s, d = loop.vessel, now.signals, now.rates
    sway, yaw = s["tau_v"] + s["b_v"], s["tau_r"] + s["b_r"]
    loaded = (m.m22 * yaw - m.m32 * sway) / (m.m22 * m.m33 - m.m23 * m.m32)
    return d["u"] - (s["tau_u"] + s["b_u"]) / m.m11, d["r"] - loaded


def node_outputs(network: Network, log: Recording) -> Vector:
    """Phi (14) at every logged row, shape (rows, nodes)."""
    return outputs(network, exponents(network, log))


def exponents(network: Network, log: Recording) -> Vector:
    """Exponents of the factors of Phi, shape (rows, factors): half squared distances in widths.

    At (u, v, r) of the rows of `log`; a factor depends on u, or on v and r, see `Network.factors`.
    """
    along, plane = network.factors
    centers, steep = network.table().reshape(2, 3, -1)[..., : along + plane]
    nu = np.column_stack([log["u"], log["v"], log["r"]])
    squares = np.zeros((len(nu), along + plane))
    for axis in range(3):
        squares += steep[axis] * (nu[:, axis, None] - centers[axis]) ** 2
    return np.nan_to_num(squares, nan=np.inf)  # velocities of a diverged run


def outputs(network: Network, factors: Vector) -> Vector:
    """Phi (14), shape (rows, nodes), from the `exponents`."""
    plane, bells = network.factors[1], exponential(-factors)
    return (bells[:, plane:, None] * bells[:, None, :plane]).reshape(len(bells), -1)


def node_distance(network: Network, factors: Vector) -> Vector:
    """Distance (rows,) of (u, v, r) to the nearest centre in widths, from the `exponents`."""
    plane = network.factors[1]
    nearest = factors[:, plane:].min(axis=1) + factors[:, :plane].min(axis=1)
    return np.asarray(np.sqrt(2.0 * nearest))


def network_output(phi: Vector, weights: Vector) -> Vector:
    """W . Phi (15) at every row of phi (rows, nodes), for weights (nodes,)."""
    return total((phi * weights).T)


def fit_weights(
    loop: ClosedLoop, law: PolarBackstepping, log: Recording, now: Replayed
) -> IdealWeights:
    """The fit described above; f_u and f_r are scaled by true over nominal inertia.

    `log` and `now` are the run's rows and the rates there. The law multiplies what its networks
    give by nominal inertia.
    """
    f_u, f_r = unloaded_accelerations(loop, now)
    usable = (np.abs(f_u) < 1e100) & (np.abs(f_r) < 1e100)  # not those of a diverging run
    phi = node_outputs(law.network, log)[usable]
    start, inverse, weights = law.network.initial_weight, _ridge_solver(phi), []
    for f, mass, nominal, sigma in (
        (f_u, loop.vessel.m11, loop.nominal.m11, law.sigma_u),
        (f_r, loop.vessel.m33, loop.nominal.m33, law.sigma_r),
    ):
        # W = start + dW: what is fitted is dW, and its size counts
        aim = f[usable] * (mass / nominal) - start * total(phi.T)
        damping = np.float64(sigma * len(phi)) / (
            nominal * nominal
        )  # a float would raise on overflow
        weights.append(start + inverse(aim, float(damping)))
    return IdealWeights(*weights)


def _ridge_solver(phi: Vector) -> Callable[[Vector, float], Vector]:
    """W(f, c) that minimises |f - Phi W|^2 + c |W|^2, by the smaller of Phi^T Phi and Phi Phi^T.

    `phi` is (rows, nodes). The matrix is made once, for surge and yaw. c is at least SINGULAR times
    the matrix's trace, without which it may be singular; a smaller c is replaced by that floor.
    """
    tall = phi.shape[0] >= phi.shape[1]
    short = phi if tall else phi.T
    square = _gram_matrix(short)
    # Where no node ever answers the matrix is 0, and any size will do
    least = SINGULAR * float(total(square.diagonal())) or 1.0

    def weights(f: Vector, c: float) -> Vector:
        """The weights (nodes,) that fit `f` (rows,); c, or the floor, weighs their own size."""
        right = network_output(phi.T, f) if tall else f
        solved = solve(square + max(c, least) * np.eye(len(square)), right)
        return np.asarray(solved if tall else network_output(phi.T, solved))

    return weights


def _gram_matrix(short: Vector) -> Vector:
    """A^T A of A (rows, n), row by row: the order of a library's sum depends on the processor."""
    square = np.zeros((short.shape[1], short.shape[1]))
    product = np.empty_like(square)
    for row in short:
        np.multiply(row[:, None], row, out=product)
        square += product
    return square


def rows_to_fit(rows: int, nodes: int) -> Vector:
    """Indices (n,) of the rows that the fit uses, evenly spread over so many `rows`."""
    most = max(1, min(MOST_ROWS, MOST_NUMBERS // nodes, rows))
    return np.linspace(0, rows - 1, most).astype(int)
