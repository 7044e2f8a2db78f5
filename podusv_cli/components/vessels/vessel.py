"""A vessel's inertia and damping in three degrees of freedom (surge, sway, yaw)."""

from __future__ import annotations

from typing import Any, Self

from pydantic import model_validator

from podusv_cli.components.vessels.envelope import Envelope
from podusv_cli.components.vessels.windage import Windage
from podusv_cli.core.component import Component, Presets, value

VESSELS = Presets("podusv_cli.components.vessels", "vessel", "vessel file")
INERTIA = ("m11", "m22", "m23", "m32", "m33")


def _damping(unit: str, meaning: str, **limits: Any) -> Any:
    """A field for a damping derivative of this unit, 0 where a vessel gives none."""
    return value(0.0, unit, f"damping derivative: {meaning} (negative when it brakes)", **limits)


class Vessel(Component):
    """Rigid body and hydrodynamics; derivatives as published, negative where they resist.

    Raises a validation error where the mass matrix is not positive definite or a linear
    damping on the diagonal would drive the motion.
    """

    presets = VESSELS
    preset: str = value(
        "",
        "",
        "the parameter file that the other values come from: the name of one of podusv's, or a "
        "YAML file beside the scenario, which is read in; none where empty",
    )
    source: str = value("", "", "where the numbers come from")
    validity: str = value("", "", "what the numbers hold for")
    length: float = value(..., "m", "length over all, for figures", gt=0)
    beam: float = value(..., "m", "beam, for figures", gt=0)
    m: float = value(..., "kg", "mass", gt=0)
    I_z: float = value(..., "kg m2", "moment of inertia about the body origin's vertical", gt=0)
    x_g: float = value(0.0, "m", "centre of gravity ahead of the body origin")
    X_udot: float = value(0.0, "kg", "added mass in surge (negative as published)")
    Y_vdot: float = value(0.0, "kg", "added mass in sway (negative as published)")
    Y_rdot: float = value(0.0, "kg m", "added mass, sway force from yaw acceleration")
    N_vdot: float = value(0.0, "kg m", "added mass, yaw moment from sway acceleration")
    N_rdot: float = value(0.0, "kg m2", "added moment of inertia in yaw (negative as published)")
    X_u: float = _damping("kg/s", "surge, linear", le=0)
    X_uu: float = _damping("kg/m", "surge, times |u|u")
    X_uuu: float = _damping("kg s/m2", "surge, times u^3")
    Y_v: float = _damping("kg/s", "sway, linear", le=0)
    Y_vv: float = _damping("kg/m", "sway, times |v|v")
    Y_rv: float = _damping("kg", "sway, times |r|v")
    Y_r: float = _damping("kg m/s", "sway from yaw, linear")
    Y_vr: float = _damping("kg", "sway from yaw, times |v|r")
    Y_rr: float = _damping("kg m", "sway from yaw, times |r|r")
    N_v: float = _damping("kg m/s", "yaw from sway, linear")
    N_vv: float = _damping("kg", "yaw from sway, times |v|v")
    N_rv: float = _damping("kg m", "yaw from sway, times |r|v")
    N_r: float = _damping("kg m2/s", "yaw, linear", le=0)
    N_vr: float = _damping("kg m", "yaw, times |v|r")
    N_rr: float = _damping("kg m2", "yaw, times |r|r")
    coriolis: float = value(
        1.0,
        "",
        "share of the Coriolis and centripetal terms in the motion, 0 for a model without "
        "any; laws count on all of them",
        ge=0,
        le=1,
    )
    windage: Windage | None = value(
        None, "", "what the wind acts on; without it the vessel is in no wind"
    )
    envelope: Envelope | None = value(
        None, "", "motion that the numbers hold for; a run that leaves it gets a finding"
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        """Raises ValueError for a mass matrix that is not positive definite."""
        # x^T M x depends on the symmetric part of M alone
        m11, m22, m33, symmetric = self.m11, self.m22, self.m33, (self.m23 + self.m32) / 2
        if m11 <= 0 or m22 <= 0 or m22 * m33 <= symmetric * symmetric:
            raise ValueError(
                "the mass matrix is not positive definite: "
                f"m11 = {m11:g} kg, m22 = {m22:g} kg, m33 = {m33:g} kg m2, "
                f"m23 = {self.m23:g}, m32 = {self.m32:g} kg m; added masses are negative numbers"
            )
        return self

    @property
    def m11(self) -> float:
        """Surge inertia m - X_udot [kg]."""
        return self.m - self.X_udot

    @property
    def m22(self) -> float:
        """Sway inertia m - Y_vdot [kg]."""
        return self.m - self.Y_vdot

    @property
    def m23(self) -> float:
        """Coupling m x_g - Y_rdot [kg m]."""
        return self.m * self.x_g - self.Y_rdot

    @property
    def m32(self) -> float:
        """Coupling m x_g - N_vdot [kg m]."""
        return self.m * self.x_g - self.N_vdot

    @property
    def m33(self) -> float:
        """Yaw inertia I_z - N_rdot [kg m2]."""
        return self.I_z - self.N_rdot

    def constants(self) -> dict[str, float]:
        """The fields' numbers and the entries of the mass matrix (5), without the windage.

        In the order of `COEFFICIENTS`, in SI units.
        """
        return {name: float(getattr(self, name)) for name in COEFFICIENTS}


# The names of a vessel's constants, the same for every vessel and in the same order.
COEFFICIENTS = (
    tuple(name for name, field in Vessel.model_fields.items() if field.annotation is float)
    + INERTIA
)
