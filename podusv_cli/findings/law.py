"""Findings about the law: signs, folding, the network, and how fast its loops are."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from podusv_cli.controllers.network import Network
from podusv_cli.controllers.pid import Pid
from podusv_cli.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.controllers.tracking import TrackingController
from podusv_cli.core.kernel import Vector
from podusv_cli.findings.finding import Case, Finding, found
from podusv_cli.findings.stability import (
    Bound,
    Loop,
    bursts,
    loops,
    rk4_growth,
    sampled_growth,
)

FAR = 2.0  # widths; a node further away answers with less than exp(-2)
KICK = 1.0  # rad/s; beyond what a hull turns at
UNSTABLE = 1.0 + 1e-6


def coupling_saddle(case: Case) -> Iterator[Finding]:
    """With the printed sign, z_e' = -k_ze z_e - u_e and m11 u_e' = -k_ue u_e - z_e; yaw alike.

    The determinant (k_ze k_ue - 1)/m11 is negative where k_ze k_ue < 1: a saddle.
    """
    law, vessel = case.scenario.controller, case.scenario.vessel
    if not isinstance(law, PolarBackstepping) or law.coupling != "printed":
        return
    pairs = (
        ("k_ze", "k_ue", law.k_ze, law.k_ue, vessel.m11),
        ("k_psie", "k_re", law.k_psie, law.k_re, vessel.m33),
    )
    for outer, inner, k, k_e, inertia in pairs:
        if k * k_e < 1.0:
            matrix = np.array([[-k, -1.0], [-1.0 / inertia, -k_e / inertia]])
            growth = float(np.linalg.eigvals(matrix).real.max())
            yield found(
                "coupling-saddle",
                f"the printed sign with {outer} {inner} = {k * k_e:.2g} < 1 makes a saddle that "
                f"grows at {growth:.2g} 1/s unless the network's adaptation hides it; take "
                "coupling: corrected, or larger gains",
            )


def start_astern(case: Case) -> Iterator[Finding]:
    """The target lies abaft the beam at t = 0 and the law does not fold line of sight and error."""
    law, start = case.scenario.controller, case.scenario.start
    if not isinstance(law, TrackingController) or law.fold == "joint":
        return
    psi_e = math.remainder(case.first["psi_d"] - start.psi, 2.0 * math.pi)
    if abs(psi_e) >= 0.5 * math.pi:
        yield found(
            "start-astern",
            f"the target lies {math.degrees(psi_e):.0f} degrees off the bow at the start, beyond "
            f"the right angle within which fold: {law.fold} steers towards it; turn start.psi, or "
            "take fold: joint",
        )


def start_kick(case: Case) -> Iterator[Finding]:
    """Remark 5's difference, started from psi_d = 0, is a kick of psi_d(0)/Delta t for a sample."""
    law = case.scenario.controller
    if not isinstance(law, TrackingController) or law.rate != "difference":
        return
    kick = math.remainder(case.first["psi_d"], 2.0 * math.pi) / law.difference_step
    if law.first_difference == "from_zero" and abs(kick) > KICK:
        yield found(
            "start-kick",
            f"the first difference of psi_d starts from zero and turns the virtual yaw rate by "
            f"{kick:.3g} rad/s for {law.difference_step:g} s; take first_difference: from_start",
        )


def network_range(case: Case) -> Iterator[Finding]:
    """No node of the network within two widths of the velocities that keep up with the target."""
    law = case.scenario.controller
    if not isinstance(law, PolarBackstepping):
        return
    nu = case.reference.nu[np.isfinite(case.reference.nu).all(axis=1)]
    if not len(nu):
        return
    distance = nearest(law.network, nu)
    worst = int(distance.argmax())
    if distance[worst] > FAR:
        u, v, r = nu[worst]
        yield found(
            "network-range",
            f"keeping up means u = {u:.2g} m/s, v = {v:.2g} m/s, r = {r:.2g} rad/s, and the "
            f"nearest node is {distance[worst]:.2g} widths away: the network is blind there; "
            "move low and high, or widen spread",
        )


def nearest(network: Network, nu: Vector) -> Vector:
    """Distance from velocities (n, 3) to the nearest node, in widths."""
    widths = network.width_array()
    if network.centers:
        gaps = [((row - network.center_array()) / widths) ** 2 for row in nu]
        return np.sqrt([gap.sum(axis=1).min() for gap in gaps])
    axes = zip(nu.T, network.axes(), widths, strict=True)
    gaps = [(((v[:, None] - axis) / width) ** 2).min(axis=1) for v, axis, width in axes]
    return np.asarray(np.sqrt(np.sum(gaps, axis=0)))


def stiff_adaptation(case: Case) -> Iterator[Finding]:
    """The network's adaptation turns faster than RK4 follows at this step."""
    if isinstance(case.scenario.controller, PolarBackstepping):
        yield from _too_fast(case, "stiff-adaptation", "adaptation")


def stiff_derivative(case: Case) -> Iterator[Finding]:
    """PID's proportional and derivative action is faster than RK4 follows at this step."""
    if isinstance(case.scenario.controller, Pid):
        yield from _too_fast(case, "stiff-derivative", "PID loop")


def _too_fast(case: Case, code: str, what: str) -> Iterator[Finding]:
    grid, law = case.scenario.time_grid(), case.scenario.controller
    told: set[str] = set()
    for nu in () if grid.hold_every else (case.first_velocity, case.reference.working):
        for loop in loops(law, case.scenario, nu):
            if loop.axis not in told and rk4_growth(loop, grid.step) > UNSTABLE:
                told.add(loop.axis)
                yield found(
                    code,
                    f"the {loop.axis} {what} turns at {loop.fastest:.3g} 1/s, too fast for RK4 "
                    f"with {grid.step:g} s; take a step below {_largest(loop):.2g} s, or a smaller "
                    f"{loop.key}",
                )


def _largest(loop: Loop) -> float:
    """The largest step [s] up to which RK4 is stable, by bisection."""
    low, high = 0.0, 4.0 / loop.fastest
    for _ in range(40):
        middle = 0.5 * (low + high)
        stable = rk4_growth(loop, middle) <= UNSTABLE
        low, high = (middle, high) if stable else (low, middle)
    return low


def sampled_adaptation(case: Case) -> Iterator[Finding]:
    """The network's adaptation is unstable when the law acts once a period."""
    if isinstance(case.scenario.controller, PolarBackstepping):
        yield from _sampled_too_fast(case, "sampled-adaptation", "adaptation")


def sampled_derivative(case: Case) -> Iterator[Finding]:
    """PID is unstable when it acts once a period."""
    if isinstance(case.scenario.controller, Pid):
        yield from _sampled_too_fast(case, "sampled-derivative", "PID loop")


def _sampled_too_fast(case: Case, code: str, what: str) -> Iterator[Finding]:
    grid, law = case.scenario.time_grid(), case.scenario.controller
    if not grid.hold_every:
        return
    for loop in loops(law, case.scenario, case.reference.working):
        growth = sampled_growth(loop, grid.step, grid.hold_every)
        if growth > UNSTABLE:
            yield found(
                code,
                f"the {loop.axis} {what}, held for {case.scenario.control.period:g} s, grows "
                f"{growth:.3g} times a period; take a shorter period, or a smaller {loop.key}",
            )


def stiff_start(case: Case) -> Iterator[Finding]:
    """The velocity error at the start drives the bound so high that its loop outruns the step.

    Without leakage b_hat rises to sqrt(gamma m) |e(0)| while e decays, and then e' = -e b_hat/
    (4 partial m). Where an actuator cuts the demand off, that loop is open and nothing is said.
    """
    law, scenario = case.scenario.controller, case.scenario
    limited = "saturated" in scenario.actuator.signals
    if not isinstance(law, PolarBackstepping) or limited or scenario.control.period:
        return
    u, r, partial, step = "u_e", "r_e", law.partial, scenario.simulation.step
    m11, m33 = scenario.vessel.m11, scenario.vessel.m33
    bounds = {
        u: Bound("gamma_u", law.gamma_u, law.sigma_bu, law.b_hat_u0, partial, m11),
        r: Bound("gamma_r", law.gamma_r, law.sigma_br, law.b_hat_r0, partial, m33),
    }
    both = zip(bounds.items(), loops(law, scenario, case.first_velocity), strict=True)
    for (name, bound), loop in both:
        error = case.first[name]
        told_already = rk4_growth(loop, step) > UNSTABLE
        if math.isfinite(error) and not told_already and bursts(loop, bound, error, step):
            yield found(
                "stiff-start",
                f"{name} = {error:.3g} at the start drives the estimated bound so high that the "
                f"{loop.axis} loop outruns RK4 with {step:g} s and the error grows instead; take "
                f"a shorter step, a smaller {bound.key}, or a start nearer to what the law wants",
            )
