"""What can go wrong with the adaptive backstepping laws: the printed sign, a network elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np

from podusv_cli.controllers.network import nearest
from podusv_cli.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.finding import Sentences, after, before, rows_where, times_of
from podusv_cli.core.recording import Recording

FAR = 2.0  # widths; a node further away answers with less than exp(-2)
LAST = 0.1  # of the run, over which a bound is watched
GROWN = 0.01  # by which it may grow there


@before(
    "coupling-saddle",
    about="controller.coupling",
    meaning="the printed sign makes a saddle",
    condition="k_ze k_ue < 1 or k_psie k_re < 1 with the printed sign",
    remedy="take coupling: corrected, or larger gains",
    law=PolarBackstepping,
)
def coupling_saddle(case: Any) -> Sentences:
    """With the printed sign, z_e' = -k_ze z_e - u_e and m11 u_e' = -k_ue u_e - z_e; yaw alike.

    The determinant (k_ze k_ue - 1)/m11 is negative where k_ze k_ue < 1: a saddle.
    """
    law, vessel = case.scenario.controller, case.scenario.vessel
    pairs = (
        ("k_ze", "k_ue", law.k_ze, law.k_ue, vessel.m11),
        ("k_psie", "k_re", law.k_psie, law.k_re, vessel.m33),
    )
    for outer, inner, k, k_e, inertia in pairs:
        if law.coupling == "printed" and k * k_e < 1.0:
            matrix = np.array([[-k, -1.0], [-1.0 / inertia, -k_e / inertia]])
            growth = float(np.linalg.eigvals(matrix).real.max())
            yield (
                f"the printed sign with {outer} {inner} = {k * k_e:.2g} < 1 makes a saddle that "
                f"grows at {growth:.2g} 1/s unless the network's adaptation hides it; take "
                "coupling: corrected, or larger gains"
            )


@before(
    "network-range",
    about="controller.network",
    meaning="no node near the speeds needed",
    condition=f"a steady (u, v, r) along the path is more than {FAR:g} widths from every node",
    remedy="move low and high, or widen spread",
    law=PolarBackstepping,
)
def network_range(case: Any) -> Sentences:
    """No node of the network within two widths of the velocities that keep up with the target."""
    nu = case.reference.nu[np.isfinite(case.reference.nu).all(axis=1)]
    if not len(nu):
        return
    distance = nearest(case.scenario.controller.network, nu)
    worst = int(distance.argmax())
    if distance[worst] > FAR:
        u, v, r = nu[worst]
        yield (
            f"keeping up means u = {u:.2g} m/s, v = {v:.2g} m/s, r = {r:.2g} rad/s, and the "
            f"nearest node is {distance[worst]:.2g} widths away: the network is blind there; "
            "move low and high, or widen spread"
        )


@after(
    "off-network",
    about="controller.network",
    meaning="no node within two widths",
    condition=f"no node within {FAR:g} widths of (u, v, r)",
    remedy="move low and high, or widen spread",
    law=PolarBackstepping,
)
def off_network(scenario: Any, log: Recording) -> Sentences:
    """No node of the network within two widths of (u, v, r)."""
    network = scenario.controller.network

    def far(part: Recording) -> Any:
        return nearest(network, np.column_stack([part["u"], part["v"], part["r"]])) > FAR

    off = rows_where(log, far)
    if off.any():
        yield (
            f"no node within {FAR:g} widths of (u, v, r) {times_of(log, off)}; the network is "
            "blind there"
        )


@after(
    "bound-growing",
    about="controller",
    meaning="an estimated bound still grew at the end",
    condition=f"growth above {GROWN:.0%} over the last {LAST:.0%} of the run, to a new maximum",
    remedy="simulate longer, or take more leakage",
    law=PolarBackstepping,
)
def bound_growing(scenario: Any, log: Recording) -> Sentences:
    """An estimated bound still grows at the end."""
    time = log["time"]
    if log.status != "finished" or len(time) < 2:
        return
    since = time[-1] - LAST * (time[-1] - time[0])
    for name in ("b_hat_u", "b_hat_r"):
        bound = log[name]
        before_then = bound[: np.searchsorted(time, since, side="right")].max()
        if bound[-1] > (1.0 + GROWN) * before_then and bound[-1] == bound.max():
            yield (
                f"{name} still grows at the end: {bound[-1]:.3g} against at most "
                f"{before_then:.3g} until {since:.6g} s; the run is not settled, "
                "or the leakage is too small"
            )
