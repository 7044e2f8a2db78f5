"""Gaussian radial basis network over (u, v, r), the paper's (13)-(15), and its adaptation."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import model_validator

from podusv_cli.core.component import KernelPart, value
from podusv_cli.core.derived import Derived, norm
from podusv_cli.core.elementary import exponential
from podusv_cli.core.kernel import Vector, kernel, padded_rounds, tail, whole_lanes
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal

MOST_NODES = 10_000  # each has two weights, which are states of the loop
CENTER = Signal(
    "rbf_center",
    "1",
    "network centres in (u, v, r) [m/s, m/s, rad/s]",
    "c",
    axes=("node", "input"),
    fixed=True,
)
WIDTH = Signal(
    "rbf_width",
    "1",
    "Gaussian widths in (u, v, r) [m/s, m/s, rad/s]",
    r"\sigma",
    axes=("input",),
    fixed=True,
)
Triple = tuple[float, float, float]
W_NORM_U = Signal("W_norm_u", "m/s2", "norm of the surge network weights", r"|\hat W_u|")
W_NORM_R = Signal("W_norm_r", "rad/s2", "norm of the yaw network weights", r"|\hat W_r|")
NODE_DISTANCE = Signal(
    "node_distance", "1", "distance of (u, v, r) to the nearest network centre, in widths", "d"
)
ACTIVATION = Signal("activation", "1", "largest output of a network node (14)", r"\max\Phi")


class Network(KernelPart):
    """Nodes of both networks: a grid over (u, v, r), or a list of centres.

    Neither nodes nor widths are printed in the paper; the defaults are podusv's choice.
    """

    nodes: tuple[int, int, int] = value((3, 3, 3), "", "grid nodes along u, v, r", strict=False)
    low: Triple = value(
        (-1.0, -1.0, -1.0), "m/s, m/s, rad/s", "first grid node along u, v, r", strict=False
    )
    high: Triple = value(
        (2.5, 1.0, 1.0), "m/s, m/s, rad/s", "last grid node along u, v, r", strict=False
    )
    spread: float = value(
        0.7, "", "Gaussian width in units of the grid's spacing, axis by axis", gt=0
    )
    centers: tuple[Triple, ...] = value(
        (), "m/s, m/s, rad/s", "centres (u, v, r) that replace the grid", strict=False
    )
    widths: Triple | None = value(
        None, "m/s, m/s, rad/s", "Gaussian widths along u, v, r that replace `spread`", strict=False
    )
    initial_weight: float = value(
        0.0, "", "every weight at the start, and what leakage pulls it to"
    )

    @model_validator(mode="after")
    def _check_span(self) -> Self:
        """Raises ValueError for nodes, widths or ranges that make no network."""
        if not self.centers and any(n < 1 for n in self.nodes):
            raise ValueError(f"every axis needs at least one node, got {list(self.nodes)}")
        if self.count > MOST_NODES:
            raise ValueError(f"has {self.count:,} nodes, at most {MOST_NODES:,} are possible")
        # Neither has a spacing that `spread` could be times
        if self.widths is None and (self.centers or any(n < 2 for n in self.nodes)):
            raise ValueError(
                "widths must be given for listed centres and for an axis with one node"
            )
        if self.widths is not None and min(self.widths) <= 0:
            raise ValueError(f"widths must be positive, got {list(self.widths)}")
        if not self.centers and any(a >= b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError(
                f"low {list(self.low)} must lie below high {list(self.high)} on every axis"
            )
        return self

    @property
    def count(self) -> int:
        """Number of nodes q."""
        return len(self.centers) or math.prod(self.nodes)

    def axes(self) -> list[Vector]:
        """The grid's coordinates along u, v [m/s] and r [rad/s], each (nodes on it,)."""
        ranges = zip(self.low, self.high, self.nodes, strict=True)
        return [
            np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2])
            for low, high, count in ranges
        ]

    def center_array(self) -> Vector:
        """Centres, shape (q, 3), in the order of the weights."""
        if self.centers:
            return np.asarray(self.centers, dtype=float)
        return np.stack(np.meshgrid(*self.axes(), indexing="ij"), axis=-1).reshape(-1, 3)

    def width_array(self) -> Vector:
        """Gaussian widths along u, v, r: (3,) [m/s, m/s, rad/s]."""
        if self.widths is not None:
            return np.asarray(self.widths, dtype=float)
        return np.array([self.spread * (axis[1] - axis[0]) for axis in self.axes()])

    @property
    def factors(self) -> tuple[int, int]:
        """How many factors every node is a product of two of: along u, and in the plane (v, r).

        A list is a plane whose factors depend on u as well, and a single factor 1.
        """
        n_u, n_v, n_r = self.nodes
        return (1, len(self.centers)) if self.centers else (n_u, n_v * n_r)

    @property
    def bells(self) -> int:
        """How many Gaussians are evaluated: all factors, filled up to whole vector registers."""
        return whole_lanes(sum(self.factors))

    def constants(self) -> dict[str, float]:
        """Numbers of nodes, Gaussians and factors, and the initial weight, as kernels read them."""
        along, plane = self.factors
        counts = {"count": self.count, "bells": self.bells, "along": along, "plane": plane}
        return {name: float(n) for name, n in counts.items()} | {
            "initial_weight": self.initial_weight
        }

    def table(self) -> Vector:
        """Centre, then exponents 1/(2 width^2), along u, v, r of every Gaussian: six rows.

        Those in the plane come first. One that does not depend on a velocity has no exponent there.
        """
        return _table(self)


@lru_cache(maxsize=4)  # the runs of a batch mostly have one network, and a run asks three times
def _table(network: Network) -> Vector:
    """The table of `_evaluate`, flat: centres (3, bells), then exponents (3, bells).

    On a grid the first bells are the nodes of the plane (v, r), the others those along u. Read
    only: runs share it.
    """
    along, plane = network.factors
    centers, exponents = rows = np.zeros((2, 3, network.bells))
    centers[:, :plane] = network.center_array()[:plane].T
    exponents[:, :plane] = 1.0 / (2.0 * network.width_array()[:, None] ** 2)
    if not network.centers:
        # The exponent along u is read before it is taken out of the plane
        line = slice(plane, plane + along)
        centers[0, line], exponents[0, line] = network.axes()[0], exponents[0, 0]
        exponents[0, :plane] = 0.0
    rows.flags.writeable = False
    return rows.ravel()


# Gaussians of the factors at velocity (u, v, r) of x. table (6, count): centres, then exponents
# 1/(2 width^2), by axis; writes out (count). `needed` of them count, the rest fills registers.
@kernel
def _evaluate(x: Vector, count: int, needed: int, table: Vector, out: Vector) -> None:
    u, v, r = x[3], x[4], x[5]
    c_u, c_v, c_r = table, tail(table, count), tail(table, 2 * count)
    e_u, e_v, e_r = tail(table, 3 * count), tail(table, 4 * count), tail(table, 5 * count)
    for i in range(padded_rounds(count, needed)):
        du, dv, dr = u - c_u[i], v - c_v[i], r - c_r[i]
        out[i] = exponential(-e_u[i] * du * du - e_v[i] * dv * dv - e_r[i] * dr * dr)


# x (6) state; table as in `_evaluate`. Writes phi (nodes).
@kernel
def activate(x: Vector, k: Any, table: Vector, phi: Vector, work: Vector) -> None:
    """Node outputs (14) at Z = (u, v, r) into `phi`; `work` holds the factors.

    On a grid a node's Gaussian is the product of one of u and one of (v, r): so many exponentials
    less.
    """
    along, plane = int(k.network_along), int(k.network_plane)
    _evaluate(x, int(k.network_bells), along + plane, table, work)
    for i in range(along):
        for j in range(plane):
            phi[i * plane + j] = work[plane + i] * work[j]


# All arrays (count); returns f_u and f_r.
@kernel
def weigh(count: int, W_u: Vector, W_r: Vector, phi: Vector) -> tuple[float, float]:
    """Outputs W . Phi (15) of both networks."""
    f_u = f_r = 0.0
    for i in range(count):
        f_u += W_u[i] * phi[i]
        f_r += W_r[i] * phi[i]
    return f_u, f_r


# weights, phi and rate are (count); writes rate. `drive` [kg m/s or kg m2 rad/s] is what the node
# outputs are weighted with; leakage pulls the weights to `initial`.
@kernel
def adapt(
    count: int,
    weights: Vector,
    phi: Vector,
    drive: float,
    Gamma: float,
    sigma: float,
    initial: float,
    rate: Vector,
) -> None:
    """Weights' rate Gamma (drive Phi - sigma (W - W0)), drive u_e m11 or r_e m33; (27), (36)."""
    for i in range(count):
        rate[i] = Gamma * (drive * phi[i] - sigma * (weights[i] - initial))


def nearest(nu: Vector, centers: Vector, widths: Vector) -> Vector:
    """Distance (n,) from velocities (n, 3) to the nearest of the centres (q, 3), in widths (3,)."""
    squares = np.full(len(nu), np.inf)
    for center in centers:  # one by one: a long log times all nodes is too large
        squares = np.minimum(squares, np.sum(((nu - center) / widths) ** 2, axis=1))
    return np.asarray(np.sqrt(squares))


def activation(network: Network, nu: npt.NDArray[np.float64]) -> Vector:
    """Node outputs (14) for velocities of shape (n, 3): shape (n, q), by the direct sum."""
    scaled = (nu[:, None, :] - network.center_array()) / network.width_array()
    return np.asarray(np.exp(-0.5 * np.sum(scaled**2, axis=2)))


def _node_distance(log: Recording) -> Vector:
    """How far the velocity is from the nearest node, in widths, over the rows of a log (rows,)."""
    nu = np.stack([log[name] for name in "uvr"], axis=1)
    return nearest(nu, log["rbf_center"], log["rbf_width"])


def _activation(log: Recording) -> Vector:
    """The Gaussian of the distance to the nearest node, over the rows of a log (rows,)."""
    return np.asarray(np.exp(-0.5 * _node_distance(log) ** 2))


_NEEDED = ("rbf_center", "rbf_width", "u", "v", "r")
norm_u, norm_r = norm(W_NORM_U, "W_hat_u"), norm(W_NORM_R, "W_hat_r")
node_distance = Derived(NODE_DISTANCE, _NEEDED, _node_distance)
largest_activation = Derived(ACTIVATION, _NEEDED, _activation)
