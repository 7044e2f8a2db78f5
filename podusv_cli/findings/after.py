"""What a finished run shows that a user should know, with times; from its logged rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from podusv_cli.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.controllers.tracking import TrackingController
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording, blocks
from podusv_cli.findings.finding import Finding, found
from podusv_cli.findings.law import FAR, nearest
from podusv_cli.scenario.model import Scenario

NEAR = 0.05  # hull lengths
CROSSWISE = 0.05  # |cos psi_e|; the virtual surge velocity is magnified twentyfold
LAST = 0.1  # of the run, over which a bound is watched
GROWN = 0.01  # by which it may grow there
LONG = 0.02  # of the run; a limit in force for less is not told

Mask = npt.NDArray[np.bool_]
Look = Callable[[Scenario, Recording], Iterator[Finding]]


def near_target(scenario: Scenario, log: Recording) -> Iterator[Finding]:
    """z_e comes near 0, where psi_d is not defined and w = psi_d' grows as 1/z_e."""
    law = scenario.controller
    if not isinstance(law, TrackingController):
        return
    near = NEAR * scenario.vessel.length
    close = _where(log, lambda part: part["z_e"] < near)
    if close.any() and law.hold_below < near:
        at = int(log["z_e"].argmin())
        kept = f"the standoff of {law.standoff:g} m did not keep it away; take hold_below"
        remedy = kept if law.standoff else "take a standoff, or hold_below"
        yield found(
            "near-target",
            f"z_e falls below {near:.2g} m {_when(log, close)}, to {log['z_e'][at]:.2g} m at "
            f"{log['time'][at]:.6g} s; the direction of the target is singular at 0, so "
            f"numbers from there on depend on the step; {remedy}",
        )


def crosswise(scenario: Scenario, log: Recording) -> Iterator[Finding]:
    """cos psi_e comes near 0, by which (21) divides."""
    law = scenario.controller
    if isinstance(law, TrackingController):
        across = _where(log, lambda part: np.abs(np.cos(part["psi_e"])) < CROSSWISE)
        if across.any():
            yield found(
                "crosswise",
                f"|cos psi_e| falls below {CROSSWISE:g} {_when(log, across)}; the virtual surge "
                "velocity (21) divides by it",
            )


def off_network(scenario: Scenario, log: Recording) -> Iterator[Finding]:
    """No node of the network within two widths of (u, v, r)."""
    if isinstance(law := scenario.controller, PolarBackstepping):
        off = _where(log, lambda part: nearest(law.network, _velocities(part)) > FAR)
        if off.any():
            yield found(
                "off-network",
                f"no node within {FAR:g} widths of (u, v, r) {_when(log, off)}; the network is "
                "blind there",
            )


def bound_growing(scenario: Scenario, log: Recording) -> Iterator[Finding]:
    """An estimated bound still grows at the end."""
    for name in ("b_hat_u", "b_hat_r"):
        if name not in log or log.status != "finished" or len(log["time"]) < 2:
            continue
        time, bound = log["time"], log[name]
        since = time[-1] - LAST * (time[-1] - time[0])
        before = bound[: np.searchsorted(time, since, side="right")].max()
        if bound[-1] > (1.0 + GROWN) * before and bound[-1] == bound.max():
            yield found(
                "bound-growing",
                f"{name} still grows at the end: {bound[-1]:.3g} against at most {before:.3g} "
                f"until {since:.6g} s; the run is not settled, "
                "or the leakage is too small",
            )


def saturated(scenario: Scenario, log: Recording) -> Iterator[Finding]:
    """The actuator limits the law for long."""
    if "saturated" not in log:
        return
    limited = _where(log, lambda part: part["saturated"] > 0.5)
    part = float(limited.mean())
    if part > LONG:
        learnt = (
            "anti_windup keeps it out of what the law learns"
            if scenario.controller.settles()
            else "what the law adapts and integrates meanwhile is not what it was designed for; "
            "see anti_windup"
        )
        yield found(
            "saturated",
            f"the actuator limits the law during {part:.1%} of the run, {_when(log, limited)}; "
            f"{learnt}",
        )


# One function a code, in the order in which findings are shown.
LOOKS: dict[str, Look] = {
    "near-target": near_target,
    "crosswise": crosswise,
    "off-network": off_network,
    "bound-growing": bound_growing,
    "saturated": saturated,
}


def aftermath(scenario: Scenario, log: Recording) -> list[Finding]:
    """What is worth knowing about a run of this scenario, silenced findings included."""
    if not len(log["time"]):
        return []
    with np.errstate(all="ignore"):
        return [finding for look in LOOKS.values() for finding in look(scenario, log)]


def _where(log: Recording, test: Callable[[Recording], Mask]) -> Mask:
    """In which rows a test comes true, asked of some of them at a time."""
    return np.concatenate([test(log.part(rows)) for rows in blocks(len(log["time"]))])


def _velocities(log: Recording) -> Vector:
    return np.column_stack([log["u"], log["v"], log["r"]])


def _when(log: Recording, mask: Mask) -> str:
    """`at 3.1 s`, `from 3.1 s to 4 s`, `3 times between 3.1 s and 80 s`."""
    changes = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    begins, ends = changes[::2], changes[1::2] - 1
    first, last = log["time"][begins[0]], log["time"][ends[-1]]
    if first == last:
        return f"at {first:.6g} s"
    if len(begins) == 1:
        return f"from {first:.6g} s to {last:.6g} s"
    return f"{len(begins)} times between {first:.6g} s and {last:.6g} s"
