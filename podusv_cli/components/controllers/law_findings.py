"""What can go wrong with the adaptive laws, and with all that steer by distance and direction.

The printed sign, and a network that lies elsewhere; then folding and singularities, relays, and a
learned law at another period.
"""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np

from podusv_cli.components.controllers.network import NODE_DISTANCE, nearest, node_distance
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.components.controllers.policy import Policy
from podusv_cli.components.controllers.tracking import TrackingController
from podusv_cli.core.finding import Sentences, rows_where, times_of, warn_after_run, warn_before_run
from podusv_cli.core.recording import Recording

KICK = 1.0  # rad/s; beyond what a hull turns at
NEAR = 0.05  # hull lengths
CROSSWISE = 0.05  # |cos psi_e|; the virtual surge velocity is magnified twentyfold
FAR = 2.0  # widths; a node further away answers with less than exp(-2)
RELAY = 0.5  # gain times delay, from which a loop of one lag swings
LAST = 0.1  # of the run, over which a bound is watched
GROWN = 0.01  # by which it may grow there


@warn_before_run(
    "coupling-saddle",
    about="controller.coupling",
    meaning="the printed sign makes a saddle",
    condition="k_ze k_ue < 1 or k_psie k_re < 1 with the printed sign",
    remedy="take coupling: corrected, or larger gains",
    law=PolarBackstepping,
)
def coupling_saddle(case: Any) -> Sentences:
    """Warn of a saddle: with the printed sign z_e' = -k_ze z_e - u_e, m11 u_e' = -k_ue u_e - z_e.

    Yaw is alike. The determinant (k_ze k_ue - 1)/m11 is negative where k_ze k_ue < 1: a saddle.
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


@warn_before_run(
    "network-range",
    about="controller.network",
    meaning="no node near the speeds needed",
    condition=f"a steady (u, v, r) along the path is more than {FAR:g} widths from every node",
    remedy="move low and high, or widen spread",
    law=PolarBackstepping,
)
def network_range(case: Any) -> Sentences:
    """Warn where no node is within two widths of the velocities that keep up with the target."""
    # (rows, 3): u, v, r along the path; where there is no such steady motion they are NaN
    nu = case.reference.nu[np.isfinite(case.reference.nu).all(axis=1)]
    if not len(nu):
        return
    network = case.scenario.controller.network
    distance = nearest(nu, network.center_array(), network.width_array())
    worst = int(distance.argmax())
    if distance[worst] > FAR:
        u, v, r = nu[worst]
        yield (
            f"keeping up means u = {u:.2g} m/s, v = {v:.2g} m/s, r = {r:.2g} rad/s, and the "
            f"nearest node is {distance[worst]:.2g} widths away: the network is blind there; "
            "move low and high, or widen spread"
        )


@warn_after_run(
    "off-network",
    about="controller.network",
    meaning="no node within two widths",
    condition=f"no node within {FAR:g} widths of (u, v, r)",
    remedy="move low and high, or widen spread",
    law=PolarBackstepping,
)
def off_network(scenario: Any, log: Recording) -> Sentences:
    """Warn of times at which no node of the network is within two widths of (u, v, r)."""
    name = NODE_DISTANCE.name
    # The stability monitor has logged it, where there is one
    distance = operator.itemgetter(name) if name in log else node_distance.compute
    off = rows_where(log, lambda part: distance(part) > FAR)
    if off.any():
        yield (
            f"no node within {FAR:g} widths of (u, v, r) {times_of(log, off)}; the network is "
            "blind there"
        )


@warn_after_run(
    "bound-growing",
    about="controller",
    meaning="an estimated bound still grew at the end",
    condition=f"growth above {GROWN:.0%} over the last {LAST:.0%} of the run, to a new maximum",
    remedy="simulate longer, or take more leakage",
    law=PolarBackstepping,
)
def bound_growing(scenario: Any, log: Recording) -> Sentences:
    """Warn where an estimated bound still grows at the end of a run: it has not settled."""
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


@warn_before_run(
    "start-astern",
    about="start",
    meaning="the start lies outside the folding range",
    condition="the target is more than a right angle off the bow, and fold is not joint",
    remedy="turn start.psi, or take fold: joint",
    law=TrackingController,
)
def start_astern(case: Any) -> Sentences:
    """Warn of a target abaft the beam at t = 0 where the law does not fold line of sight and error.

    `case.first_signals` has what the law logs at t = 0; without psi_d nothing is said.
    """
    law, start = case.scenario.controller, case.scenario.start
    if law.fold == "joint":
        return
    psi_e = math.remainder(case.first_signals.get("psi_d", math.nan) - start.psi, 2.0 * math.pi)
    if abs(psi_e) >= 0.5 * math.pi:
        yield (
            f"the target lies {math.degrees(psi_e):.0f} degrees off the bow at the start, beyond "
            f"the right angle within which fold: {law.fold} steers towards it; turn start.psi, or "
            "take fold: joint"
        )


@warn_before_run(
    "start-kick",
    about="controller.first_difference",
    meaning="the first difference is a kick",
    condition=f"|psi_d(0)|/difference_step above {KICK:g} rad/s",
    remedy="take first_difference: from_start",
    law=TrackingController,
)
def start_kick(case: Any) -> Sentences:
    """Warn of a kick: Remark 5's difference, started from 0, is psi_d(0)/Delta t for a sample."""
    law = case.scenario.controller
    if law.rate != "difference" or law.first_difference != "from_zero":
        return
    psi_d = case.first_signals.get("psi_d", math.nan)
    kick = math.remainder(psi_d, 2.0 * math.pi) / law.difference_step
    if abs(kick) > KICK:
        yield (
            f"the first difference of psi_d starts from zero and turns the virtual yaw rate by "
            f"{kick:.3g} rad/s for {law.difference_step:g} s; take first_difference: from_start"
        )


@warn_after_run(
    "near-target",
    about="controller.standoff",
    meaning="z_e came close to its singularity",
    condition=f"z_e below {NEAR:g} hull lengths, and hold_below is smaller than that",
    remedy="take a standoff, or hold_below",
    law=TrackingController,
    needs=("z_e",),
)
def near_target(scenario: Any, log: Recording) -> Sentences:
    """Warn where z_e comes near 0, where psi_d is not defined and w = psi_d' grows as 1/z_e.

    With standoff_reference: crab z_e is meant to vanish: the law points at a point beyond it.
    """
    law, near = scenario.controller, NEAR * scenario.vessel.length
    if law.standoff_reference == "crab":
        return
    close = rows_where(log, lambda part: part["z_e"] < near)
    if close.any() and law.hold_below < near:
        at = int(log["z_e"].argmin())
        kept = f"the standoff of {law.standoff:g} m did not keep it away; take hold_below"
        remedy = kept if law.standoff else "take a standoff, or hold_below"
        yield (
            f"z_e falls below {near:.2g} m {times_of(log, close)}, to {log['z_e'][at]:.2g} m at "
            f"{log['time'][at]:.6g} s; the direction of the target is singular at 0, so "
            f"numbers from there on depend on the step; {remedy}"
        )


@warn_after_run(
    "crosswise",
    about="controller",
    meaning="cos psi_e came close to zero",
    condition=f"|cos psi_e| below {CROSSWISE:g}",
    remedy="start with a heading nearer to the line of sight",
    law=TrackingController,
)
def crosswise(scenario: Any, log: Recording) -> Sentences:
    """Warn of times at which cos psi_e comes near 0, by which (21) divides."""
    if "psi_e" not in log:
        return
    across = rows_where(log, lambda part: np.abs(np.cos(part["psi_e"])) < CROSSWISE)
    if across.any():
        yield (
            f"|cos psi_e| falls below {CROSSWISE:g} {times_of(log, across)}; the virtual surge "
            "velocity (21) divides by it"
        )


@warn_before_run(
    "relay-gains",
    about="controller",
    meaning="PID's gains swing the actuator between its limits",
    condition=f"(K_P + K_D/T_d)/inertia times the loop's delay and its period exceeds {RELAY:g}",
    remedy="take smaller gains; PID's defaults are the paper's, for a model ship without delays",
    law=Pid,
)
def relay_gains(case: Any) -> Sentences:
    """Warn where PID's gains are too large for the loop's delay.

    Its defaults do not follow from hull and actuator, unlike those of later laws.
    """
    law, hull, facts = case.scenario.controller, case.scenario.nominal, case.facts
    axes = (
        ("surge", law.K_Pu, law.K_Du, hull.m11, facts.T_u),
        ("yaw", law.K_Pr, law.K_Dr, hull.m33, facts.T_r),
    )
    swinging = {}
    for axis, proportional, derivative, inertia, late in axes:
        gain = (proportional + derivative / law.T_d) / inertia  # 1/s, of a sudden error
        if gain * (late + facts.period) > RELAY:
            swinging[axis] = gain, late + facts.period
    if swinging:
        loops = " and ".join(f"{gain:.3g} 1/s in {axis}" for axis, (gain, _) in swinging.items())
        worst = max(gain * late for gain, late in swinging.values())
        late = max(late for _, late in swinging.values())
        yield (
            f"K_P and K_D/T_d over the inertia are {loops}, and the loop is late by {late:.2g} s: "
            f"the demand can swing from limit to limit; take about {RELAY / worst:.2g} times these "
            "gains, or a law whose defaults follow from hull and actuator, as velocity_vector's do"
        )


@warn_before_run(
    "policy-period",
    about="control.period",
    law=Policy,
    meaning="a policy runs at another period than in its training",
    condition="control.period is another one than the policy's file says of its training",
    remedy="set control.period to that of the training, or train anew with this one",
)
def policy_period(case: Any) -> Sentences:
    """Warn where a policy acts at another period than in its training, which it has learned too.

    Nothing is said where the file has no such remark.
    """
    period, trained = case.scenario.control.period, case.scenario.controller.network().period
    if trained is not None and period != trained:
        now = f"holds for {period:g} s" if period else "changes at every step"
        yield (
            f"in its training a demand held for {trained:g} s, and here it {now}; set "
            f"control.period={trained:g}, or train the policy anew"
        )
