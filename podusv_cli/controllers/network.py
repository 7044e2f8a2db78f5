"""Gaussian radial basis network over (u, v, r), the paper's (13)-(15), and its adaptation."""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import model_validator

from podusv_cli.kernels import Vector, kernel, tail
from podusv_cli.registry import Component, value

MOST_NODES = 10_000
Triple = tuple[float, float, float]


class Network(Component):
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
    def _spanned(self) -> Self:
        if not self.centers and any(n < 1 for n in self.nodes):
            raise ValueError(f"every axis needs at least one node, got {list(self.nodes)}")
        if self.count > MOST_NODES:
            raise ValueError(f"has {self.count:,} nodes, at most {MOST_NODES:,} are possible")
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
        """The grid's coordinates along u, v, r."""
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
        """Gaussian widths along u, v, r."""
        if self.widths is not None:
            return np.asarray(self.widths, dtype=float)
        return np.array([self.spread * (axis[1] - axis[0]) for axis in self.axes()])

    def constants(self) -> dict[str, float]:
        """Node counts (grid counts are 0 for listed centres) and exponents 1/(2 width^2)."""
        n_u, n_v, n_r = (0, 0, 0) if self.centers else self.nodes
        e_u, e_v, e_r = 1.0 / (2.0 * self.width_array() ** 2)
        counts = {
            "count": float(self.count),
            "n_u": float(n_u),
            "n_v": float(n_v),
            "n_r": float(n_r),
        }
        exponents = {"e_u": float(e_u), "e_v": float(e_v), "e_r": float(e_r)}
        return counts | exponents | {"initial_weight": self.initial_weight}

    def table(self) -> Vector:
        """Coordinates of the grid's axes one after another, or the listed centres row by row."""
        if self.centers:
            return self.center_array().ravel()
        return np.concatenate(self.axes())


@kernel
def _bells(at: float, exponent: float, count: int, centers: Vector, out: Vector) -> None:
    for i in range(count):
        out[i] = math.exp(-exponent * (at - centers[i]) * (at - centers[i]))


@kernel
def _on_grid(
    u: float, v: float, r: float, k: Any, table: Vector, phi: Vector, work: Vector
) -> None:
    # The Gaussian of a grid node is the product of three one-dimensional ones: n_u + n_v + n_r
    # exponentials instead of their product.
    n_u, n_v, n_r = int(k.network_n_u), int(k.network_n_v), int(k.network_n_r)
    _bells(u, k.network_e_u, n_u, table, work)
    _bells(v, k.network_e_v, n_v, tail(table, n_u), tail(work, n_u))
    _bells(r, k.network_e_r, n_r, tail(table, n_u + n_v), tail(work, n_u + n_v))
    node = 0
    for i in range(n_u):
        for j in range(n_u, n_u + n_v):
            g = work[i] * work[j]
            for m in range(n_u + n_v, n_u + n_v + n_r):
                phi[node] = g * work[m]
                node += 1


@kernel
def _on_list(u: float, v: float, r: float, k: Any, table: Vector, phi: Vector) -> None:
    for i in range(int(k.network_count)):
        du, dv, dr = u - table[3 * i], v - table[3 * i + 1], r - table[3 * i + 2]
        phi[i] = math.exp(
            -k.network_e_u * du * du - k.network_e_v * dv * dv - k.network_e_r * dr * dr
        )


@kernel
def activate(x: Vector, k: Any, table: Vector, phi: Vector, work: Vector) -> None:
    """Node outputs (14) at Z = (u, v, r) into `phi`; `work` holds the axes' exponentials."""
    if k.network_n_u > 0.0:
        _on_grid(x[3], x[4], x[5], k, table, phi, work)
    else:
        _on_list(x[3], x[4], x[5], k, table, phi)


@kernel
def weigh(count: int, weights: Vector, phi: Vector) -> float:
    """Network output W . Phi (15)."""
    total = 0.0
    for i in range(count):
        total += weights[i] * phi[i]
    return total


@kernel
def adapt(
    count: int, weights: Vector, phi: Vector, drive: float, Gamma: float, sigma: float,
    initial: float, rate: Vector,
) -> None:  # fmt: skip
    """Weights' rate Gamma (drive Phi - sigma (W - W0)), drive u_e m11 or r_e m33; (27), (36)."""
    for i in range(count):
        rate[i] = Gamma * (drive * phi[i] - sigma * (weights[i] - initial))


def activation(network: Network, nu: npt.NDArray[np.float64]) -> Vector:
    """Node outputs (14) for velocities of shape (n, 3): shape (n, q), by the direct sum."""
    scaled = (nu[:, None, :] - network.center_array()) / network.width_array()
    return np.asarray(np.exp(-0.5 * np.sum(scaled**2, axis=2)))
