"""Eigenvalues of the closed loop about steady motion on a line, for vessels no law was told."""

from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, VESSELS, ask, corrected, run
from counts import count

from podusv_cli.actuators.saturated import Saturated
from podusv_cli.controllers.adrc import Adrc
from podusv_cli.controllers.velocity_vector import VelocityVector
from podusv_cli.core.kernel import Vector, bundle
from podusv_cli.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.paths.line import Line
from podusv_cli.vessels.plant import plant, surge_force, sway_force, yaw_moment
from podusv_cli.vessels.vessel import Vessel

SPEED, LOAD = 0.5, np.array([0.5, 0.5, 0.5])  # m/s; N and N m
STEADY = HarmonicDisturbance(
    b_u=Harmonic(mean=0.5), b_v=Harmonic(mean=0.5), b_r=Harmonic(mean=0.5)
)  # fmt: skip
CAREFUL = VelocityVector(omega_v=0.2)
DAMPING = ("X_u", "X_uu", "X_uuu"), ("Y_v", "Y_vv"), ("N_r", "N_rr")


def drawn(random: Any, spread: float = 0.3) -> Vessel:
    """The vessel with every inertia and damping changed by up to this."""
    a, b, c, *scales = random.uniform(1 - spread, 1 + spread, 6)
    v = NONLINEAR
    changes = {
        "X_udot": v.m - a * v.m11, "Y_vdot": v.m - b * v.m22, "N_rdot": v.I_z - c * v.m33,
    }  # fmt: skip
    for names, scale in zip(DAMPING, scales, strict=True):
        changes |= {name: scale * getattr(v, name) for name in names}
    return v.model_copy(update=changes)


def steady_velocity(k: Any) -> tuple[float, float]:
    """(u, v) at which sway damping holds the load, at the target's speed; v by bisection."""
    low, high = 0.0, SPEED
    for _ in range(60):
        v = 0.5 * (low + high)
        u = np.sqrt(SPEED**2 - v * v)
        low, high = (v, high) if sway_force(u, v, 0.0, k) + LOAD[1] > 0 else (low, v)
    return float(np.sqrt(SPEED**2 - low * low)), low


def at_rest(law: Any, vessel: Vessel, told: Vessel) -> Vector:
    """(x, memory) on the target, which goes north: nothing changes but the position."""
    true, k = bundle(vessel.constants()), bundle(told.constants())
    u, v = steady_velocity(true)
    forces = surge_force, sway_force, yaw_moment
    tau = [-(f(u, v, 0.0, true) + b) for f, b in zip(forces, LOAD, strict=True)]
    tau[1] = 0.0
    observed = [-(f(u, v, 0.0, k) + t) for f, t in zip(forces, tau, strict=True)]
    x = np.array([0.0, 0.0, -np.arctan2(v, u), u, v, 0.0])
    memory = law.start(x, np.zeros(6), told)
    memory[3:6] = observed
    return np.concatenate([x, memory])


def rates(law: Any, s: Vector, vessel: Vessel, told: Vessel) -> Vector:
    """Of (x, memory), the position relative to the target."""
    x, memory, out = s[:6], s[6:], np.zeros(6)
    found = ask(law, x, memory, np.array([0.0, 0.0, SPEED, 0.0, 0.0, 0.0]), told)
    tau = np.array([found.tau[0], 0.0, found.tau[1]])
    plant(x, tau, LOAD, bundle(vessel.constants()), out)
    out[0] -= SPEED
    return np.concatenate([out, found.rate])


def growth(law: Any, vessel: Vessel, told: Vessel = NONLINEAR) -> float:
    """Largest real part of the eigenvalues [1/s]; checks that the state is one of rest."""
    s, small = at_rest(law, vessel, told), 1e-6
    assert abs(rates(law, s, vessel, told)).max() < 1e-9
    columns = [
        (rates(law, s + d, vessel, told) - rates(law, s - d, vessel, told)) / (2 * small)
        for d in small * np.eye(len(s))
    ]
    return float(np.linalg.eigvals(np.transpose(columns)).real.max())


def unstable(law: Any, count: int, heavier_sway: bool) -> tuple[int, int]:
    """How many drawn vessels are unstable, and how many of these have m11 < m22."""
    random, found = np.random.default_rng(5), []
    while len(found) < count:
        vessel = drawn(random)
        if vessel.m11 < vessel.m22 or not heavier_sway:
            found.append((growth(law, vessel) > 0.0, vessel.m11 < vessel.m22))
    bad = [heavier for grows, heavier in found if grows]
    return len(bad), sum(bad)


def test_velocity_vector_is_stable_on_every_drawn_vessel_whose_sway_is_heavier():
    assert unstable(VelocityVector(), count(60, 4500), heavier_sway=True) == (0, 0)


def test_with_lighter_sway_than_told_it_need_not_be_and_a_slower_observer_helps():
    vessels = count(100, 1500)
    bad, heavier = unstable(VelocityVector(), vessels, heavier_sway=False)
    assert 0.02 < bad / vessels < 0.1
    assert heavier == 0
    assert unstable(CAREFUL, vessels, heavier_sway=False) == (0, 0)


def test_told_its_own_hull_it_is_stable_whichever_inertia_is_the_larger():
    random = np.random.default_rng(6)
    vessels = [drawn(random) for _ in range(count(40, 1500))]
    assert any(vessel.m11 > vessel.m22 for vessel in vessels)
    assert all(growth(VelocityVector(), vessel, vessel) < 0.0 for vessel in vessels)


def test_adrc_is_not_stable_on_all_of_them():
    """The hand point is short for a hull that turns, and damps sway, less than it was told."""
    bad, _ = unstable(Adrc(), count(100, 1500), heavier_sway=True)
    assert 0.01 < bad / count(100, 1500) < 0.15


@pytest.mark.parametrize(("law", "growing"), [(VelocityVector(), True), (CAREFUL, False)])
def test_sway_that_answers_yaw_more_than_told_takes_a_slower_sway_observer(law, growing):
    assert (growth(law, VESSELS["cybership2"]) > 0.0) is growing
    assert growth(law, VESSELS["cybership2"], VESSELS["cybership2"]) < 0.0
    assert growth(law, NONLINEAR) < 0.0


@pytest.mark.parametrize(
    ("omega_v", "grows", "lowest", "highest"),
    [(2.0, True, 0.2, 0.4), (0.5, False, 0.1, 0.3), (0.2, False, 0.0, 1e-3)],
)
def test_such_a_hull_cycles_also_where_no_eigenvalue_grows(omega_v, grows, lowest, highest):
    """At 0.5 rad/s a limit cycle stands beside the stable state: eigenvalues do not tell."""
    law, vessel = VelocityVector(omega_v=omega_v), VESSELS["cybership2"]
    out = run(
        corrected(
            controller=law, vessel=vessel, nominal=NONLINEAR, actuator=Saturated(), path=Line(),
            disturbance=STEADY, start=(-2.0, 0.0, 0.0, 0.5, 0.0, 0.0),
        ),
        150.0, step=0.02,
    )  # fmt: skip
    assert (growth(law, vessel) > 0.0) is grows
    assert lowest <= out["z_e"][out["time"] > 100].max() <= highest


@pytest.mark.parametrize("law", [VelocityVector(), Adrc()])
def test_a_small_error_decays_at_the_rate_of_the_slowest_eigenvalue(law):
    """Measured on the envelope of a run that begins 1 mm off the state of rest."""
    rate = growth(law, NONLINEAR)
    s = at_rest(law, NONLINEAR, NONLINEAR)
    loop = corrected(
        controller=law, path=Line(), disturbance=STEADY, start=(0.0, 1e-3, *map(float, s[2:6]))
    )
    out = run(loop, 120.0)
    late = out["z_e"][(out["time"] > 60) & (out["time"] < 61)].max()
    later = out["z_e"][(out["time"] > 80) & (out["time"] < 81)].max()
    assert np.log(later / late) / 20.0 == pytest.approx(rate, rel=0.25)
