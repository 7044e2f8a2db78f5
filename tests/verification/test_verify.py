"""Convergence: Richardson on known sequences, real runs, DOP853, rankings, the command."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import corrected, run
from continuous import continuous
from dop853 import integrate
from findings_samples import CONFIGS, scene
from pose_samples import BOAT, HELD, POSES

from podusv_cli.cli.verify import _in_order
from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.scenario.load import load, load_text
from podusv_cli.scenario.model import Scenario
from podusv_cli.verification.ranking import ranking
from podusv_cli.verification.richardson import estimate, estimate_position
from podusv_cli.verification.step_halving import refine_grid, run_level
from podusv_cli.verification.verify import POSITION, check, floor_of, verify
from podusv_cli.workflows import verify as verifying

# Behind the target, facing it and moving; a step at which the adaptation is well resolved.
SMOOTH = (
    "start={x: -8, y: -4, psi: 0.1, u: 0.4, v: 0.05, r: 0.02}",
    "simulation={step: 0.0025, duration: 10}",
)
DIFFERENCE = ("controller.rate=difference", "controller.first_difference=from_start")


# --- Richardson


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
def test_a_power_of_the_step_gives_its_order_and_its_error(order):
    got = estimate([3.0 + 0.5 * 0.1**order * 2.0 ** (-order * n) for n in range(3)])
    assert got.order == pytest.approx(order, abs=1e-6)
    assert got.error == pytest.approx(0.5 * 0.1**order, rel=1e-6)


def test_the_step_that_would_do_follows_from_the_order():
    """An error of 0.04 of 1 at order 2 is 0.01 at half the step."""
    got = estimate([1.0 - 0.04 * (4.0**-n - 1.0) for n in range(3)])
    assert got.sufficient(0.01) == pytest.approx(0.5)
    assert got.sufficient(0.1) == 1.0
    assert math.isnan(estimate([1.0, 1.01, 0.995]).sufficient(0.001))


def test_differences_that_do_not_shrink_have_no_order_and_are_all_error():
    got = estimate([1.0, 1.01, 0.995])
    assert math.isnan(got.order)
    assert got.error == pytest.approx(4 * 0.015)
    assert not got.converged(0.05)


def test_a_peak_that_hits_an_instant_has_no_order_beyond_the_integrators():
    got = estimate([1.0, 1.01, 1.01 + 1e-9])
    assert math.isnan(got.order)
    assert got.error == pytest.approx(0.01, rel=1e-3)


def test_numbers_that_do_not_change_or_exist_nowhere_are_converged():
    assert estimate([0.0, 0.0, 0.0]).converged(0.0)
    assert estimate([2.0, 2.0 + 4e-16, 2.0]).converged(1e-12)
    never = estimate([math.nan] * 3)
    assert never.undefined
    assert never.converged(0.0)
    assert not estimate([math.nan, 1.0, 1.0]).converged(1.0)
    assert not estimate([0.0, 0.1, 0.1]).converged(1.0)


def test_a_position_is_judged_by_the_hulls_length():
    ends = [np.array([100.0 + 0.08 * 4.0**-n, 50.0 - 0.06 * 4.0**-n]) for n in range(3)]
    got = estimate_position(ends, 2.0)
    assert got.order == pytest.approx(2.0)
    assert got.error == pytest.approx(0.1)
    assert got.relative == pytest.approx(0.05)


# --- grids


def test_times_in_seconds_stay_when_the_step_is_halved():
    scenario = scene("control.period=0.04", "log.every=3", "simulation.duration=1.2")
    grid = refine_grid(scenario, 2)
    assert (grid.step, grid.steps, grid.hold_every) == (0.0025, 480, 16)
    assert grid.rows == 2
    sampled = scene(*DIFFERENCE)
    assert sampled.plan(refine_grid(sampled, 2)).layout.sample_every == 4


def test_the_first_level_is_the_run_itself():
    scenario = scene("simulation.duration=5", "log.every=7")
    level, out = run_level(scenario, 0), run(scenario.closed_loop(), 5.0)
    np.testing.assert_array_equal(level.position, [out["x"][-1], out["y"][-1]])
    assert level.metrics["peak_tau_u"] == np.abs(out["tau_u_cmd"]).max()


# --- real runs


@pytest.fixture(scope="module")
def smooth():
    return check(scene(*SMOOTH))


@pytest.mark.slow
def test_a_smooth_scenario_is_of_fourth_order_and_converged(smooth):
    assert smooth.estimates[POSITION].order == pytest.approx(4.0, abs=0.4)
    assert smooth.unconverged_numbers(0.01) == []


def test_the_error_that_is_estimated_is_the_error_that_there_is(smooth):
    """Against DOP853, which knows nothing of the three runs."""
    other = integrate(scene(*SMOOTH))
    true = math.dist(smooth.levels[0].position, other.position)
    assert smooth.estimates[POSITION].error == pytest.approx(true, rel=0.2)
    assert true > 1e-9  # or there would be nothing to estimate
    assert smooth.levels[0].metrics["iae"] == pytest.approx(other.iae, rel=1e-6)


@pytest.mark.slow
def test_dop853_starts_anew_where_the_path_jumps():
    jumping, smooth = (
        scene(
            f"path={{kind: line_circle, reading: literal, switch: {switch}}}",
            "start={x: -4, y: 0, u: 0.5}",
            "simulation={step: 0.005, duration: 6}",
        )
        for switch in (3.005, 50)
    )
    other = integrate(jumping)
    # The engine's step across the jump has its first stage before it: order one, and no more.
    gaps = [math.dist(run_level(jumping, n).position, other.position) for n in (1, 3)]
    assert gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.1)
    assert gaps[1] < 1e-4
    assert math.dist(integrate(smooth).position, other.position) > 0.05


def test_the_continuous_loop_is_the_engines():
    loop = corrected()
    fast, start = continuous(loop, 1.0)
    slow, same = continuous(loop, 1.0, compiled=False)
    np.testing.assert_array_equal(start, same)
    np.testing.assert_allclose(fast(1.5, start), slow(1.5, start), rtol=1e-12)
    step = run(loop, 1e-6, 1e-6)
    rate = fast(0.0, start)
    np.testing.assert_allclose(step["u"][1] - step["u"][0], rate[3] * 1e-6, rtol=0.02)
    with pytest.raises(ValueError, match="takes samples"):
        continuous(corrected(controller=AdaptiveNeural(rate="difference")), 1.0)
    with pytest.raises(ArithmeticError, match="not finite"):
        fast(math.inf, start)


def test_a_held_difference_leaves_chattering_unconverged():
    """What results/README.md warns of: finer steps see more of the sawtooth."""
    printed = load(CONFIGS / "printed.yaml", ["simulation={step: 0.0025, duration: 40}"]).scenario
    names = check(printed.alone()).unconverged_numbers(0.01)
    assert "tv_tau_r" in names
    assert "iae" not in names


def test_a_step_that_is_too_coarse_is_found_out():
    coarse = scene("simulation={step: 0.04, duration: 20}")
    assert "status" in check(coarse).unconverged_numbers(0.01)
    hardly = scene("simulation={step: 0.02, duration: 20}", "start={u: 0.5, psi: 0.5}")
    assert "peak_tau_u" in check(hardly).unconverged_numbers(0.01)


# --- rankings


def test_a_ranking_that_holds_changes_or_is_too_close():
    a, b = estimate([1.0, 1.001, 1.0012]), estimate([2.0, 2.01, 2.012])
    held = ranking({"b": b, "a": a})
    assert held is not None
    assert held.orders[0] == ("a", "b")
    assert held.converged
    near = estimate([1.0005, 1.0015, 1.0017])
    close = ranking({"a": a, "near": near})
    assert close is not None
    assert close.same
    assert close.close == (("a", "near"),)
    turning = ranking({"a": a, "turning": estimate([0.9, 1.0, 1.1])})
    assert turning is not None
    assert not turning.same
    assert not turning.converged


def test_equal_numbers_are_a_tie_and_missing_ones_are_left_out():
    zero, never = estimate([0.0] * 3), estimate([math.nan] * 3)
    tie = ranking({"a": zero, "b": zero, "c": never})
    assert tie is not None
    assert tie.converged
    assert tie.equal == (("a", "b"),)
    assert not tie.close
    assert ranking({"a": zero, "c": never}) is None
    gone = ranking({"a": zero, "b": estimate([0.0, math.nan, 0.0])})
    assert gone is not None
    assert not gone.converged


def test_a_tie_is_called_equal_and_no_ranking():
    zero, one = estimate([0.0] * 3), estimate([1.0, 1.001, 1.0012])
    all_tie, two_tie = ranking({"a": zero, "b": zero}), ranking({"c": one, "a": zero, "b": zero})
    apart = ranking({"a": zero, "c": one})
    assert all_tie
    assert two_tie
    assert apart
    assert _in_order(all_tie) == "a = b; equal at all steps, no ranking"
    assert _in_order(two_tie) == "a = b, c; the same at all steps, beyond the errors"
    assert _in_order(apart) == "a, c; the same at all steps, beyond the errors"


# --- `podusv verify`

TWO = f"""
extends: {CONFIGS / "corrected.yaml"}
path: {{kind: line}}
actuator: {{kind: ideal}}
start: {{x: -8, y: -4, psi: 0.1, u: 0.4, v: 0.05, r: 0.02}}
simulation: {{step: 0.0025, duration: 2}}
controllers: {{quick: {{k_ze: 0.15}}, slow: {{k_ze: 0.05}}}}
"""


def two() -> Scenario:
    Path("two.yaml").write_text(TWO)
    return load("two.yaml").scenario


@pytest.mark.slow
def test_the_command_shows_tables_and_rankings_and_leaves_nothing(podusv):
    two()
    before = sorted(Path().iterdir())
    said = podusv("verify", "two.yaml")
    assert said.code == 0, said.out
    assert said.err == ""
    lines = said.out.splitlines()
    assert lines[0] == "quick:"
    assert lines[1].split() == [
        *("number", "unit", "0.0025", "s", "0.00125", "s", "0.000625", "s"),
        *("order", "rel.", "error", "verdict"),
    ]
    assert "slow:" in lines
    assert "quick, slow; the same at all steps" in said.out
    assert lines[-1] == "converged within 0.01 relative"
    assert sorted(Path().iterdir()) == before


@pytest.mark.slow
def test_only_an_earlier_verification_is_replaced_without_force(podusv, monkeypatch):
    scenario = Path("two.yaml")
    two()
    before = scenario.read_text()
    for place, content in (("two.yaml", before), ("v.json", '{"format": 1}'), ("v.json", "[]")):
        Path(place).write_text(content)
        with monkeypatch.context() as patch:
            patch.setattr(verifying, "verification", None)  # nothing is computed
            said = podusv("verify", "two.yaml", "-q", "--out", place)
        assert (said.code, said.out) == (5, "")
        assert said.err == (
            f"{place} exists and is not a result of podusv verify; --force replaces it, or name "
            "another file\n"
        )
        assert Path(place).read_text() == content
    said = podusv("verify", "two.yaml", "--json", "--out", "v.json", "--force")
    got = json.loads(said.out)
    assert (said.code, json.loads(Path("v.json").read_text())) == (0, got)
    assert (got["converged"], got["steps"]) == (True, [0.0025, 0.00125, 0.000625])
    assert got["rankings"]["iae"]["orders"] == [["quick", "slow"]] * 3
    assert got["runs"]["slow"]["numbers"]["iae"]["converged"] is True
    Path("v.json").write_text(Path("v.json").read_text().replace("0.01", "0.5"))
    for start in ('"tolerance": 0.5', ""):
        assert start in Path("v.json").read_text()
        assert podusv("verify", "two.yaml", "-q", "--out", "v.json").code == 0
        assert json.loads(Path("v.json").read_text())["tolerance"] == 0.01
        Path("v.json").write_text("")


def test_a_file_that_comes_while_it_computes_is_spared_and_the_numbers_are_printed(
    podusv, monkeypatch
):
    def meanwhile(*given: Any) -> Any:
        Path("v.json").write_text("mine")
        return verify(*given)

    two()
    monkeypatch.setattr(verifying.verification, "verify", meanwhile)
    said = podusv("verify", "two.yaml", "--out", "v.json")
    assert said.code == 5
    assert said.out.endswith("converged within 0.01 relative\n")
    assert Path("v.json").read_text() == "mine"


@pytest.mark.slow
def test_what_is_not_converged_ends_with_3_and_is_named(podusv):
    two()
    coarse = podusv("verify", "two.yaml", "--set", "simulation={step: 0.1, duration: 4}")
    assert coarse.code == 3
    assert "diverged at t = " in coarse.out
    end = coarse.out[coarse.out.index("\nnot converged within 0.01 relative\n") :]
    assert "\nquick: status\n" in end
    strict = podusv("verify", "two.yaml", "--tolerance", "1e-9")
    assert strict.code == 3
    assert verify(two(), 1e-9).unconverged_by_run.keys() == {"quick", "slow"}


@pytest.mark.parametrize("size", [1e-20, 1e-15, 1e-13])
def test_what_is_within_a_picometre_of_nothing_has_converged(size):
    """Rounding errors of 0 differ by all of themselves."""
    found = estimate([size, -0.5 * size, 0.9 * size])
    assert found.converged(0.01)
    assert found.sufficient(0.01) == 1.0
    assert not estimate([1e10 * size, -0.5e10 * size, 0.9e10 * size]).converged(0.01)


def test_a_law_that_is_exact_on_its_path_has_converged():
    """Its distances of 1e-12 m are the integrator's own errors, all of them of fourth order."""
    text = BOAT + POSES + HELD
    found = verify(load_text(text, "s.yaml").scenario, 0.01)
    (run,) = found.runs.values()
    errors = run.estimates["iae"]
    assert errors.order == pytest.approx(4.0, abs=0.2)
    assert 1e-12 < errors.error < floor_of("m s", 1.255, 12.0)
    assert not found.unconverged_by_run


def test_a_distance_is_none_of_a_billionth_of_the_hull_and_a_force_of_a_piconewton():
    assert floor_of("m", 10.0, 100.0) == pytest.approx(1e-8)
    assert floor_of("m s", 10.0, 100.0) == pytest.approx(1e-6)
    assert floor_of("rad", 10.0, 100.0) == pytest.approx(1e-9)
    assert floor_of("m2 s", 1.0, 100.0) == floor_of("N", 10.0, 100.0) == 1e-12
