"""The law cascade: against its linear loop, another program of it, and the page of its paper."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from conftest import VESSELS
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are
from verdict_words import in_words

import podusv
from podusv_cli.components.controllers.cascade import Cascade
from podusv_cli.components.controllers.constant_bearing import Moving, turn_rate
from podusv_cli.components.paths.sinusoid import Sinusoid
from podusv_cli.components.vessels.plant import plant as plant_rates
from podusv_cli.core.kernel import bundle, call

ROOT = Path(__file__).parents[3]
CONFIGS = ROOT / "configs" / "lefeber_2003"
RESULTS = ROOT / "results"
PAGE = (RESULTS / "lefeber_2003.md").read_text()
M11, M22, M33, D11, D22, D33 = 19.0, 35.2, 4.2, 4.0, 10.0, 1.0
GAINS = np.array([10.28, -9.2, 4.44, -2.74])  # of u, v, z1, z2
TURN = 0.05  # rad/s


def plant(r: float, d22: float = D22) -> tuple[Any, Any]:
    """Surge, sway and position in a steady turn, as deviations (u, v, z1, z2), and the force."""
    A = [
        [-D11 / M11, M22 * r / M11, 0, 0],
        [-M11 * r / M22, -d22 / M22, 0, 0],
        [1, 0, 0, r],
        [0, 1, -r, 0],
    ]
    return np.array(A), np.array([[1 / M11], [0], [0], [0]])


def slowest(r: float, gains: Any = GAINS, d22: float = D22) -> float:
    """Real part of the slowest pole of the loop in a turn of r [rad/s]."""
    A, B = plant(r, d22)
    return float(np.linalg.eigvals(A - B * gains).real.max())


def test_the_gains_are_optimal_for_a_turn_to_starboard_on_the_hull_with_10_and_1() -> None:
    A, B = plant(TURN)
    X = solve_continuous_are(A, B, np.diag([9.8, 90.9, 17.9, 9.3]), np.eye(1))
    np.testing.assert_allclose((B.T @ X)[0], GAINS, atol=0.01)


def test_poles_of_the_turn_the_line_the_other_side_and_the_other_damping() -> None:
    assert slowest(TURN) == pytest.approx(-0.03559, abs=1e-5)
    assert slowest(0.0) == pytest.approx(0.0, abs=1e-12)
    assert slowest(-TURN) == pytest.approx(0.0264, abs=1e-4)
    assert slowest(-TURN, GAINS * [1, -1, 1, -1]) == pytest.approx(slowest(TURN))
    assert slowest(TURN, d22=1.0) == pytest.approx(0.0009, abs=5e-5)


def by_hand(run: Any, turn: float, limit: float) -> Any:
    """Ship and virtual ship with u_r, r_r constant, integrated by another program."""
    v_r = float(run["v_ref"][0])
    u_r = math.sqrt(0.05**2 - v_r**2)

    def body(x: float, y: float, psi: float) -> Any:
        return np.array([x * np.cos(psi) + y * np.sin(psi), y * np.cos(psi) - x * np.sin(psi)])

    def rates(t: float, s: Any) -> Any:
        x, y, psi, u, v, r, x_r, y_r, psi_r = s
        z = body(x, y, psi) - body(x_r, y_r, psi_r)
        surge = -M22 * v_r * turn + D11 * u_r - GAINS @ [u - u_r, v - v_r, *z]
        yaw = -(M11 - M22) * u_r * v_r + D33 * turn - 9.02 * (r - turn) - 6.74 * (psi - psi_r)
        surge, yaw = np.clip([surge, yaw], -limit, limit)
        return [
            u * np.cos(psi) - v * np.sin(psi),
            u * np.sin(psi) + v * np.cos(psi),
            r,
            (M22 * v * r - D11 * u + surge) / M11,
            (-M11 * u * r - D22 * v) / M22,
            ((M11 - M22) * u * v - D33 * r + yaw) / M33,
            u_r * np.cos(psi_r) - v_r * np.sin(psi_r),
            u_r * np.sin(psi_r) + v_r * np.cos(psi_r),
            turn,
        ]

    first = [run[name][0] for name in ("x", "y", "psi", "u", "v", "r", "x_d", "y_d", "psi_ref")]
    times = run["time"]
    return solve_ivp(
        rates, (0, times[-1]), first, t_eval=times, rtol=1e-9, atol=1e-11, max_step=0.1
    ).y


@pytest.mark.parametrize("limit", [0.9, 100.0])
def test_the_run_is_that_of_a_virtual_ship_with_its_own_equations(limit: float) -> None:
    actuator = {"actuator.surge_limit": limit, "actuator.yaw_limit": limit}
    run = podusv.simulate(
        CONFIGS / "base.yaml", {"controller.kind": "cascade", "simulation.duration": 60} | actuator
    )
    other = by_hand(run, TURN, limit)
    np.testing.assert_allclose([run["x"], run["y"], run["psi"]], other[:3], atol=2e-4)
    np.testing.assert_allclose([run["x_d"], run["y_d"]], other[6:8], atol=1e-8)
    assert run["z_e"].max() > 0.25


def test_about_the_target_the_run_does_not_depend_on_where_the_coordinates_begin() -> None:
    def ended(origin: str, shift: float) -> Any:
        moved = {"path.x": 4.0 + shift, "start.x": 4.75 + shift, "simulation.duration": 30}
        moved |= {"actuator": {"kind": "ideal"}}
        law = {"controller.kind": "cascade", "controller.origin": origin}
        return podusv.simulate(CONFIGS / "base.yaml", law | moved)["z_e"]

    np.testing.assert_allclose(ended("target", 20.0), ended("target", 0.0), atol=1e-9)
    assert np.abs(ended("earth", 20.0) - ended("earth", 0.0)).max() > 0.1


def test_the_virtual_ship_starts_in_its_steady_turn_and_stays() -> None:
    run = podusv.simulate(
        CONFIGS / "base.yaml", {"controller.kind": "cascade", "simulation.duration": 20}
    )
    v_r = run["v_ref"]
    u_r = np.sqrt(0.05**2 - v_r**2)
    np.testing.assert_allclose(M11 * u_r * TURN, -D22 * v_r, rtol=1e-9)
    assert np.ptp(v_r) < 1e-12


def test_the_table_of_starts_is_that_of_the_study() -> None:
    numbers = pd.read_csv(RESULTS / "lefeber_2003" / "summary.csv").query(
        "metric == 'settling_time'"
    )
    numbers["law"] = numbers["law"].replace({"about_target": "cascade`, `origin: target"})
    rows = re.findall(r"^\| `(.+)` \| (\d+); (\d+) \| (\w+); (\w+) \|$", PAGE, re.M)
    assert {row[0] for row in rows} == set(numbers.law)
    for law, *told in rows:
        cells = numbers[numbers.law == law].sort_values("cell")
        settled = [f"{q:.0f}" if np.isfinite(q) else "fails" for q in cells.q50]
        assert told == [*(f"{500 * share:.0f}" for share in cells.failed), *settled]


def test_on_the_virtual_ship_the_demand_keeps_it_there_while_the_target_changes_its_speed() -> None:
    """u' of the plant is that of u_r = sqrt(V^2 - v_r^2), by differences along the law's memory."""
    law, path, hull = Cascade(), Sinusoid(amplitude=2.0, speed=0.3), VESSELS["cybership1"]
    k, h = bundle(law.constants_with(hull)), 1e-4

    def virtual(t: float, v_r: float) -> tuple[Any, Any]:
        target = path.targets([t])[0]
        x = np.array([*target[:2], 0.0, 0.0, v_r, turn_rate(Moving(*target[2:]), 1e-3)])
        x[3] = math.sqrt(target[2] ** 2 + target[3] ** 2 - v_r**2)
        x[2] = math.atan2(target[3], target[2]) - math.atan2(v_r, x[3])
        return x, target

    for t in (3.0, 8.0, 21.0):
        x, target = virtual(t, -0.02)
        tau, rate, out = np.zeros(2), np.zeros(1), np.zeros(6)
        call(
            law.law,
            x=x,
            memory=np.array([-0.02]),
            target=target,
            k=k,
            tau=tau,
            rate=rate,
            signals=np.zeros(4),
            work=np.zeros(4),
        )
        plant_rates(x, np.array([tau[0], 0.0, tau[1]]), np.zeros(3), k, out)
        near = [virtual(t + s, -0.02 + s * rate[0])[0][3] for s in (-h, h)]
        assert out[3] == pytest.approx((near[1] - near[0]) / (2 * h), rel=1e-4)
        assert abs(out[3]) > 1e-4


ROWS = re.findall(r"^\| (L\d+\w?) \| (.+?) \| (.+?) \| (.+?) \|$", PAGE, re.M)


@pytest.mark.papers
@pytest.mark.parametrize("name", ["circle", "line", "port", "load", "damping"])
def test_the_verdicts_on_the_page_are_those_of_the_comparison(name: str) -> None:
    found = podusv.compare(CONFIGS / f"{name}.yaml", figures=False).claims
    told = {claim: verdict for claim, _, verdict, _ in ROWS}
    assert len(found)
    for claim, row in found.iterrows():
        assert told[str(claim)] == in_words(row)


def whole_loop() -> Any:
    """The loop about a turn of 0.05 rad/s at 0.05 m/s, as deviations (u, v, r, psi, z1, z2).

    The source's public programs leave the moment (m11 - m22) u v to the yaw loop, so that yaw does
    see the position: through u and v.
    """
    v = -M11 * TURN / D22 * 0.05
    for _ in range(50):
        v = -M11 * TURN / D22 * math.sqrt(0.05**2 - v * v)
    u, k_u, k_v, k_1, k_2 = math.sqrt(0.05**2 - v * v), *np.abs(GAINS)
    return np.array(
        [
            [-(D11 + k_u) / M11, (M22 * TURN + k_v) / M11, M22 * v / M11, 0, -k_1 / M11, k_2 / M11],
            [-M11 * TURN / M22, -D22 / M22, -M11 * u / M22, 0, 0, 0],
            [(M11 - M22) * v / M33, (M11 - M22) * u / M33, -(D33 + 9.02) / M33, -6.74 / M33, 0, 0],
            [0, 0, 1, 0, 0, 0],
            [1, 0, 0, -v, 0, TURN],
            [0, 1, 0, u, -TURN, 0],
        ]
    )


@pytest.mark.papers
def test_the_rate_of_decay_is_that_of_the_loop_by_hand(tmp_path: Path) -> None:
    rate = -np.linalg.eigvals(whole_loop()).real.max()
    assert rate == pytest.approx(0.0357, abs=5e-5)
    done = podusv.compare(CONFIGS / "circle.yaml", out=tmp_path / "out", figures=False)
    assert done.table.loc["decay_rate", "about_target"] == pytest.approx(rate, rel=1e-5)
    at = done["cascade"].log["z_e"].sel(time=[100.0, 150.0])
    assert math.log(float(at[0] / at[1])) / 50.0 == pytest.approx(rate, rel=3e-3)
