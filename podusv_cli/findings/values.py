"""Findings about values with a probably wrong sign or unit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import unit_of
from podusv_cli.core.finding import At, Sentences, warn_before_run
from podusv_cli.scenario.case import Case

DAMPING = ("X_uu", "X_uuu", "Y_vv", "N_rr")  # a positive linear one is refused by the model
ADDED_MASS = {"X_udot": "m11", "Y_vdot": "m22", "N_rdot": "m33"}  # and the inertia it belongs to
TURN = 2.0 * math.pi


@warn_before_run(
    "damping-sign",
    about="vessel",
    meaning="nonlinear damping drives the motion",
    condition="X_uu, X_uuu, Y_vv or N_rr is positive",
    remedy="make the coefficient negative, as damping is published",
)
def damping_sign(case: Case) -> Sentences:
    """A nonlinear damping coefficient is positive, so it accelerates the motion."""
    for where, _, _, number in _positive(case, DAMPING):
        yield At(
            where,
            f"{number} accelerates the motion that it should damp; damping coefficients are "
            f"negative: -{number.partition(' ')[0]}?",
        )


@warn_before_run(
    "added-mass-sign",
    about="vessel",
    meaning="added mass makes the hull lighter",
    condition="X_udot, Y_vdot or N_rdot is positive",
    remedy="make the coefficient negative; papers that print positive added masses add them",
)
def added_mass_sign(case: Case) -> Sentences:
    """An added mass is positive, so it is taken from the inertia (M = M_RB - diag(X_udot, ...))."""
    for where, vessel, name, number in _positive(case, ADDED_MASS):
        inertia = ADDED_MASS[name]
        unit = number.partition(" ")[2]
        yield At(
            where,
            f"{number} makes the hull lighter than it is: {inertia} = "
            f"{getattr(vessel, inertia):.4g} {unit}, as {inertia} is the rigid body's less {name}; "
            f"added masses are negative numbers here: -{number.partition(' ')[0]}?",
        )


def _positive(case: Case, names: Iterable[str]) -> Iterator[tuple[str, Vessel, str, str]]:
    """Key, vessel, name and value with unit of each positive coefficient among `names`.

    Once if `vessel` and `nominal` have the same.
    """
    vessels = {"vessel": case.scenario.vessel, "nominal": case.scenario.nominal}
    reported = set[tuple[str, float]]()
    for section, vessel in vessels.items():
        for name in names:
            number = getattr(vessel, name)
            if number > 0.0 and (name, number) not in reported:
                reported.add((name, number))
                text = f"{number:g} {unit_of(Vessel.model_fields[name])}"
                yield f"{section}.{name}", vessel, name, text


@warn_before_run(
    "large-angle",
    about="start.psi",
    meaning="an angle is beyond a whole turn",
    condition="an angle of start, path or disturbance beyond 2 pi",
    remedy="give the angle in radians",
)
def large_angle(case: Case) -> Sentences:
    """An angle of the start, the path or a disturbance exceeds a whole turn."""
    parts = {"start": case.scenario.start, "path": case.scenario.path}
    for section, part in {**parts, **case.scenario.disturbances()}.items():
        for name, field in type(part).model_fields.items():
            if unit_of(field) == "rad" and abs(getattr(part, name)) > TURN:
                angle = getattr(part, name)
                yield At(
                    f"{section}.{name}",
                    f"{angle:g} rad is more than a whole turn; angles are in radians, and "
                    f"{angle:g} deg is {math.radians(angle):.4g}",
                )
