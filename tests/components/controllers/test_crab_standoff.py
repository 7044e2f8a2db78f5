"""The standoff along the heading that holds the path: its derivation, and what it gives."""

from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import NONLINEAR, ask, corrected, run, situations
from law_samples import STEADY, WRONG, rms, task
from pydantic import ValidationError

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.crab import SWAY, observe_sway, on_path, take_aim
from podusv_cli.components.controllers.dsc import DynamicSurface
from podusv_cli.components.controllers.full_backstepping import FullBackstepping
from podusv_cli.components.controllers.pid import Pid
from podusv_cli.components.paths.circle import Circle
from podusv_cli.components.paths.line import Line
from podusv_cli.components.vessels.plant import plant, sway_force
from podusv_cli.core.kernel import bundle

KINDS = (AdaptiveNeural, DynamicSurface, FullBackstepping, Pid)


def crab(kind: Any, **fields: Any) -> Any:
    return kind(standoff_reference="crab", **fields)


def constants(law: Any, nominal: Any = NONLINEAR) -> Any:
    return bundle(law.constants_with(nominal))


# --- where the law points


def test_the_sway_on_the_path_is_the_plant_s_ahead_and_backing_up():
    """A vessel with its origin on the target: the whole plant's sway rate, by its own equation."""
    t, V = sp.Symbol("t"), sp.Function("V")(sp.Symbol("t"))
    chi, beta = sp.Function("chi")(t), sp.Function("beta")(t)
    m11, m22, rest = sp.symbols("m11 m22 rest")  # rest: damping and load
    for side in (1, -1):
        psi = chi - beta if side > 0 else chi - sp.pi + beta
        north, east = V * sp.cos(chi), V * sp.sin(chi)
        u = sp.simplify(north * sp.cos(psi) + east * sp.sin(psi))
        v = sp.simplify(east * sp.cos(psi) - north * sp.sin(psi))
        assert sp.simplify(u - side * V * sp.cos(beta)) == 0
        assert sp.simplify(v - V * sp.sin(beta)) == 0
        residual = m22 * v.diff(t) + m11 * u * psi.diff(t) - rest
        force = -m11 * u * chi.diff(t) + rest  # as on_path has it, with turn = chi'
        claimed = (m22 - m11) * v.diff(t) - (force - m11 * V.diff(t) * sp.sin(beta))
        assert sp.simplify(residual - claimed) == 0


@pytest.mark.parametrize("heading", [0.0, np.pi])
def test_the_rate_of_the_aim_is_its_derivative(heading):
    """Over a short time in which target and v_s move as they are told to."""
    law = crab(Pid)
    k, h = constants(law), 1e-5
    memory = np.zeros(sum(size for _, size in law.slots()))
    at = int(k.crab_at)
    memory[at : at + 3] = 0.1, 0.4, 0.12

    def aim(moved: float) -> Any:
        angle, speed = 0.3 + 0.05 * moved, 0.5 + 0.02 * moved
        cos, sin, rate = np.cos(angle), np.sin(angle), 0.05
        velocity = np.array([speed * cos, speed * sin])
        acceleration = np.array([0.02 * cos - speed * rate * sin, 0.02 * sin + speed * rate * cos])
        target = np.concatenate([np.zeros(2), velocity, acceleration])
        x, now, found = np.array([0, 0, angle + heading, 0, 0, 0.0]), memory.copy(), np.zeros(6)
        now[at + 2] += moved * on_path(x, memory, target, k).sway_rate
        take_aim(x, now, target, k, found)
        return found[:2], found[2:4] - velocity

    (before, _), (_, rate), (after, _) = aim(-h), aim(0.0), aim(h)
    np.testing.assert_allclose(rate, (after - before) / (2 * h), rtol=1e-5)
    assert np.hypot(*aim(0.0)[0]) == pytest.approx(law.standoff)


def test_without_the_option_the_law_points_at_the_target():
    law, aim = Pid(), np.zeros(6)
    for x, memory, target in situations(law, 20):
        assert take_aim(x, memory, target, constants(law), aim) is target
    assert not set(SWAY) & {signal for signal, _ in law.slots()}


def test_a_target_at_rest_is_aimed_at_itself():
    law, aim = crab(Pid), np.zeros(6)
    memory = np.full(sum(size for _, size in law.slots()), 0.1)
    take_aim(np.zeros(6), memory, np.array([3.0, 4, 0, 0, 0, 0]), constants(law), aim)
    np.testing.assert_allclose(aim[:2], [3.0, 4.0])


@pytest.mark.parametrize("kind", KINDS)
def test_the_sway_load_is_observed_with_a_double_pole(kind):
    law = crab(kind, anti_windup="auxiliary")
    k, at = constants(law), int(constants(law).crab_at)
    assert [s for s, _ in law.slots()][-3 if kind is Pid else -5 :][:3] == list(SWAY)
    for x, memory, target in situations(law, 20):
        rate, true = np.zeros(len(memory)), np.zeros(6)
        observe_sway(x, memory, target, k, rate)
        plant(x, np.zeros(3), np.array([0, memory[at + 1], 0]), bundle(NONLINEAR.constants()), true)
        off = x[4] - memory[at]
        assert rate[at] == pytest.approx(true[4] + 2 * law.omega_v * off)
        assert rate[at + 1] == pytest.approx(NONLINEAR.m22 * law.omega_v**2 * off)
        found = ask(law, x, memory, target, NONLINEAR)
        np.testing.assert_array_equal(found.rate[at : at + 3], rate[at : at + 3])


def test_it_needs_a_standoff_and_has_neither_proof_nor_kept_distance():
    with pytest.raises(ValidationError, match="crab needs a standoff above 0"):
        crab(Pid, standoff=0.0)
    law = crab(AdaptiveNeural)
    assert law.lyapunov() is None
    assert law.approach().standoff == 0.0
    assert AdaptiveNeural().approach().standoff == 0.5


# --- what it gives


@pytest.mark.parametrize("path", [Line(speed=0.5, course=0.3), Circle(radius=16.67, speed=0.5)])
@pytest.mark.parametrize("nominal", [NONLINEAR, WRONG], ids=["told", "told wrong"])
def test_with_an_integral_constant_loads_leave_no_offset(path, nominal):
    law = crab(Pid, anti_windup="auxiliary", k_ze=0.2, k_psie=0.5, K_Iu=110.0, K_Ir=8.0)
    loop = corrected(
        controller=law, actuator=Saturated(), disturbance=STEADY, path=path, nominal=nominal
    )
    assert run(loop, 250.0)["z_e"][-1] < 1e-6


def test_at_the_target_on_its_heading_the_law_is_in_balance():
    law = crab(Pid)
    memory = np.zeros(sum(size for _, size in law.slots()))
    at, k = int(constants(law).crab_at), constants(law)
    v = 0.1
    memory[at : at + 3] = v, -sway_force(np.sqrt(0.25 - v * v), v, 0.0, k), v
    x = np.array([3.0, 1.0, -np.arcsin(v / 0.5), np.sqrt(0.25 - v * v), v, 0.0])
    found = ask(law, x, memory, np.array([3.0, 1.0, 0.5, 0, 0, 0]), NONLINEAR)
    assert found.signals["psi_e"] == pytest.approx(0.0, abs=1e-12)
    assert found.signals["alpha_u"] == pytest.approx(x[3])
    assert found.signals["alpha_r"] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(found.rate, 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS[:3])
def test_the_paper_s_laws_come_to_the_target_they_used_to_stay_behind(kind):
    as_published, told = task(kind()), task(crab(kind))
    for window in ((60, 100), (150, 310)):
        assert rms(as_published, *window) > 0.5
        assert rms(told, *window) < 0.04
    assert np.trapezoid(told["z_e"], told["time"]) < 255


def test_it_follows_backing_up_as_well():
    law = crab(AdaptiveNeural, k_ze=0.2, k_psie=0.5)
    start = (-3.0, 0.0, np.pi, 0.0, 0.0, 0.0)
    loop = corrected(controller=law, actuator=Saturated(), path=Line(), start=start)
    out = run(loop, 150.0)
    assert np.cos(out["psi"][-1]) < -0.9
    assert rms(out, 100, 150) < 0.03


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_the_same_in_machine_code_and_in_python(kind):
    law = crab(kind, rate="difference", hold_below=0.1)
    fast, slow = (run(corrected(controller=law), 0.5, compiled=c) for c in (True, False))
    for name in fast.signals:
        np.testing.assert_array_equal(fast[name], slow[name], name)
