"""Numbers that are looked for: what is known of each before, and which of a hull's they are."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from podusv_cli.components.vessels.vessel import COEFFICIENTS, INERTIA, Vessel
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.identify.fit.march import CURVE, DEAD_BAND, EXPONENT, SQUARE, THRUST
from podusv_cli.scenario.identify import DAMPING, GROUPS, THRUST_CURVE, Identify

# Where an entry of the mass matrix is, and what of it stands beside the added mass.
ADDED = {"m11": "X_udot", "m22": "Y_vdot", "m23": "Y_rdot", "m32": "N_vdot", "m33": "N_rdot"}
# Numbers that a force is proportional to; those of the damping.
FORCES = ("m", "I_z", *(n for n in COEFFICIENTS if n[:2] in DAMPING.values()))
# Of a thrust curve, before the logs: standard deviations of the dead band, a part of full n, and of
# the exponent, relative. The dead band may end below 0 by its error: a search that is held at 0
# jumps to and fro there, and cannot say how well 0 is known.
DEAD, BENT = 0.1, 0.25
DAMPINGS = tuple(n for n in FORCES[2:] if n not in ADDED.values())


@dataclass(frozen=True)
class FreeNumber:
    """One number that is looked for: its logarithm is normal about that of `prior`, with `sd`.

    Without a `ratio` it is normal itself. It is never more than `least` standard deviations below.
    """

    name: str
    prior: float
    sd: float
    ratio: bool = True
    least: float = -math.inf


def values_at(numbers: Sequence[FreeNumber], y: Vector) -> Vector:
    """The values of numbers that are so many standard deviations, `y`, from their priors."""
    prior, sd, least = np.array([(n.prior, n.sd, n.least) for n in numbers]).reshape(-1, 3).T
    step = sd * np.maximum(y, least)
    values: Vector = np.where([n.ratio for n in numbers], prior * np.exp(step), prior + step)
    return values


def hull_numbers(vessel: Vessel, wanted: Identify) -> list[FreeNumber]:
    """The vessel's numbers that are looked for. A number that is 0 stays 0.

    Raises UsageError for names that it has not, and where logs can give ratios alone.
    """
    names: dict[str, None] = {}
    constants = vessel.constants()
    for name in wanted.free:
        names |= dict.fromkeys(_members(name, constants))
    every = {n for group in GROUPS for n in _members(group, constants)}
    if THRUST in names and every <= names.keys():
        raise UsageError(
            "identify.free: thrust, inertia and damping times one factor give the same motion, so "
            "that with all of them free logs tell ratios alone; leave thrust out, or hold what is "
            "known otherwise, as m11 of a boat that was weighed: "
            f"free: [m22, m33, {', '.join(GROUPS[1:])}, thrust]"
        )
    unknown = [name for name in wanted.priors if name not in names]
    if unknown:
        raise UsageError(
            f"identify.priors: {unknown[0]} is not looked for; looked for: {', '.join(names)}"
        )
    return [_free_number(n, constants, wanted) for n in names]


def _free_number(name: str, constants: Mapping[str, float], wanted: Identify) -> FreeNumber:
    """What is known of a number before the logs."""
    if name == DEAD_BAND:
        return FreeNumber(name, 0.0, wanted.priors.get(name, DEAD), ratio=False)
    if name == EXPONENT:
        return FreeNumber(name, SQUARE, _log_sd(wanted.priors.get(name, BENT)))
    sd = _log_sd(wanted.priors.get(name, wanted.prior))
    return FreeNumber(name, constants.get(name, 1.0), sd)


def _members(name: str, constants: Mapping[str, float]) -> list[str]:
    """The numbers of a group, or the number of this name."""
    group = {"inertia": ("m11", "m22", "m33")} | {
        f"damping.{axis}": tuple(n for n in DAMPINGS if n.startswith(first))
        for axis, first in DAMPING.items()
    }
    if name == THRUST_CURVE:
        return [*CURVE]
    if name in group:
        return [n for n in group[name] if constants[n] != 0.0]
    alone = {*INERTIA, THRUST, *CURVE, *(n for members in group.values() for n in members)}
    if name not in alone:
        near = difflib.get_close_matches(name, [*GROUPS, THRUST_CURVE, *alone], 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise UsageError(
            f"identify.free: {name!r} is no group ({', '.join((*GROUPS, THRUST_CURVE))}) and no "
            f"number of the vessel ({', '.join(sorted(alone))}){hint}"
        )
    if name == "m32" and symmetric(constants):
        return ["m23"]
    if constants.get(name, 1.0) == 0.0:
        raise UsageError(
            f"identify.free: {name} of the vessel is 0 in `vessel`, and its prior is relative to "
            "that value; give a first guess other than 0"
        )
    return [name]


def symmetric(constants: Mapping[str, float]) -> bool:
    """Whether the mass matrix is so, as that of a hull at rest in the water: m32 goes with m23."""
    return constants["m23"] == constants["m32"]


def _log_sd(relative: float) -> float:
    """The standard deviation of the logarithm, of a log-normal number with this relative one."""
    return math.sqrt(math.log1p(relative * relative))
