"""lambda, Delta and the conditions on the gains, against a search over what they promise."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import NONLINEAR, PAPER
from drawn_samples import looked_at
from matplotlib.axes import Axes

from podusv_cli.components.controllers.adaptive_neural import AdaptiveNeural
from podusv_cli.components.controllers.dsc import DynamicSurface
from podusv_cli.components.controllers.full_backstepping import FullBackstepping
from podusv_cli.components.controllers.network import Network
from podusv_cli.components.controllers.polar_backstepping import PolarBackstepping
from podusv_cli.core.derived_signals import derived_with
from podusv_cli.core.recording import Recording
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.figures.shown import dress_runs
from podusv_cli.figures.stability import FAR, POINTS
from podusv_cli.scenario.load import load
from podusv_cli.storage.log_reader import read_log
from podusv_cli.theory.bounds import Observed, Pair, UltimateBound, sway_bound, ultimate_bound
from podusv_cli.theory.ideal_weights import exponents, node_distance
from podusv_cli.theory.lyapunov import TERMS
from podusv_cli.theory.monitor import ERRORS, NETWORKS, WINDOWS
from podusv_cli.workflows.request import Request
from podusv_cli.workflows.run import run

SEEN = Observed(
    b=Pair(0.9, 0.7),
    W=Pair(0.7, 0.4),
    alpha_dot=Pair(0.2, 0.03),
    drift=Pair(0.3, 0.05),
    epsilon=Pair(0.1, 0.2),
    rest=Pair(2.6, 0.6),
)

DERIVED = derived_with(())


def bound(observed: Observed | None = SEEN, **gains: Any) -> UltimateBound:
    return ultimate_bound(AdaptiveNeural(**gains), NONLINEAR, observed)


def lowest_by_search(law: PolarBackstepping, seen: Observed, coupled: bool) -> float:
    """Delta / (2 lambda) over a grid of sigma_yu and sigma_yr, lambda from eigenvalues."""
    m11, m33 = NONLINEAR.m11, NONLINEAR.m33
    A_u, A_r = law.filter_decay(0.0, 0.0)
    best = math.inf
    half = 0.5 if coupled else 0.0
    others = [
        (law.k_ue - 0.5) / m11,
        (law.k_re - 0.5) / m33,
        law.Gamma_u * law.sigma_u / 2,
        law.Gamma_r * law.sigma_r / 2,
        law.gamma_u * law.sigma_bu / 2,
        law.gamma_r * law.sigma_br / 2,
    ]
    fixed = (
        law.sigma_u * seen.W.u**2 / 2
        + law.sigma_r * seen.W.r**2 / 2
        + law.sigma_bu * seen.b.u**2 / 2
        + law.sigma_br * seen.b.r**2 / 2
        + law.partial * (seen.b.u + seen.b.r)
        + seen.rest.u**2 / 2
        + seen.rest.r**2 / 2
    )
    for s_u in np.geomspace(1e-3, 2 * A_u, 150):
        slow_u = np.linalg.eigvalsh([[law.k_ze, half], [half, A_u - s_u / 2]])[0]
        for s_r in np.geomspace(1e-3, 2 * A_r, 150):
            slow_r = np.linalg.eigvalsh([[law.k_psie, half], [half, A_r - s_r / 2]])[0]
            rate = min(slow_u, slow_r, *others)
            if rate > 0:
                drift = seen.drift.u**2 / (2 * s_u) + seen.drift.r**2 / (2 * s_r)
                best = min(best, (fixed + drift) / (2 * rate))
    return best


@pytest.mark.parametrize("gains", [{}, {"k_ze": 2.0, "k_psie": 1.0}, {"A_u": 3.0, "k_ze": 0.12}])
def test_the_bound_is_the_lowest_that_the_free_constants_of_47_allow(gains):
    law = AdaptiveNeural(**gains)
    searched = lowest_by_search(law, SEEN, coupled=True)
    found = ultimate_bound(law, NONLINEAR, SEEN).corrected
    assert found.value == pytest.approx(searched, rel=0.01)
    assert found.Delta == pytest.approx(sum(found.terms.values()))
    assert found.value == found.Delta / (2.0 * found.lambda_)


@pytest.mark.parametrize("coupling", ["corrected", "printed"])
@pytest.mark.parametrize("k", [0.02, 0.049, 0.051, 0.1, 0.4, 2.0])
def test_lambda_is_what_the_worst_direction_leaves(coupling, k):
    law = AdaptiveNeural(k_ze=k, k_psie=5.0, coupling=coupling)
    found = ultimate_bound(law, PAPER).corrected.candidates["z_e, y_u"]
    doubled = 2.0 if coupling == "printed" else 0.0
    z, u, y = np.random.default_rng(0).normal(size=(3, 400_000)) * [[1.0], [0.3], [0.3]]
    form = k * z**2 + 3.5 * u**2 + 5.0 * y**2 - np.abs(z * y) - doubled * np.abs(z * u)
    least = np.min(form / (z**2 + PAPER.m11 * u**2 + y**2))
    assert least >= found - 1e-12
    assert least == pytest.approx(found, abs=0.02)


@pytest.mark.parametrize(
    ("law", "limit"),
    [
        (AdaptiveNeural(A_u=5.0), 0.05),
        (DynamicSurface(T_u=0.2), 0.05),
        (DynamicSurface(T_u=2.0), 0.5),
        (FullBackstepping(), 0.0),
        (AdaptiveNeural(coupling="printed"), 0.05 + 1.0 / 3.5),
    ],
)
def test_limit_of_k_ze_is_where_lambda_changes_sign(law, limit):
    condition = ultimate_bound(law, PAPER).conditions[0]
    assert condition.name == "k_ze"
    assert condition.limit == pytest.approx(limit)
    for k, sign in ((limit * 0.99, -1.0), (limit * 1.01 + 1e-6, 1.0)):
        there = ultimate_bound(law.model_copy(update={"k_ze": k}), PAPER)
        assert there.conditions[0].holds is (sign > 0)
        if k > 0.0:
            assert math.copysign(1.0, there.corrected.candidates["z_e, y_u"]) == sign


def test_gains_as_printed_fail_where_the_paper_sees_no_failure():
    printed = bound(k_psie=0.01)
    failing = [c.name for c in printed.conditions if not c.holds]
    assert failing == ["k_psie"]
    assert all(c.holds_printed for c in printed.conditions)
    assert printed.corrected.value == math.inf
    assert printed.printed.value < math.inf


@pytest.mark.parametrize("name", ["sigma_u", "gamma_r", "Gamma_u", "sigma_br"])
def test_without_leakage_there_is_no_bound(name):
    without = bound(**{name: 0.0})
    assert [c.name for c in without.conditions if not c.holds] == [name]
    assert without.corrected.value == math.inf
    assert without.printed.value == math.inf or "amma" in name  # gains that the paper dropped


def test_before_a_run_only_lambda_and_the_conditions_are_known():
    before = bound(None)
    assert all(condition.holds for condition in before.conditions)
    assert bound(None, gamma_u=3.0, sigma_bu=0.5).corrected.candidates["b_u"] == 0.75
    assert before.corrected.lambda_ > bound().corrected.lambda_
    assert math.isnan(before.corrected.value)


def test_the_printed_lambda_leaves_out_masses_and_gains():
    candidates = bound().printed.candidates
    assert candidates["u_e"] == 3.5
    assert candidates["W_u"] == 0.05
    assert min(candidates, key=lambda name: candidates[name]) == "b_u"


def test_bound_cannot_be_made_arbitrarily_small():
    # Gains a thousand times as large: what leakage and the lemma's constant leave stays.
    large = bound(k_ze=100.0, k_psie=100.0, k_ue=4e3, k_re=4e4, A_u=5e3, A_r=5e3)
    assert large.corrected.Delta > 0.9 * sum(
        large.corrected.terms[name] for name in ("W_u", "W_r", "b_u", "b_r", "lemma")
    )


def test_sway_bound_is_where_damping_meets_the_push():
    for vessel in (PAPER, NONLINEAR):
        v = sway_bound(vessel, 1.3, 1.3).value
        assert -(vessel.Y_v + vessel.Y_vv * v) * v == pytest.approx(1.3)
    assert sway_bound(NONLINEAR, 1.3, 1.3).printed == pytest.approx(1.3 / 0.88965, rel=1e-3)
    bare = PAPER.model_copy(update={"Y_v": 0.0})
    assert sway_bound(bare, 1.3, 1.3).value == math.inf


# --- what the monitor leaves in a run folder, and the figures made of it

CONFIGS = Path(__file__).parents[2] / "configs"
SHORT = ("simulation.duration=20",)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("theory") / "run"
    request = Request(SHORT, out, figures=False)
    return run(CONFIGS / "theory/monitor.yaml", request).folder


@pytest.fixture(scope="module")
def found(folder):
    return json.loads((folder / "theory.json").read_text())  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def log(folder):
    return read_log(folder / "log.h5")


def test_the_log_carries_V_its_terms_and_its_bounds(log):
    rows = log["time"].shape
    for name in ("V", "V_dot", *(term.name for term in TERMS)):
        assert log[name].shape == rows
    for name in ("window_start", "V_lambda", "V_Delta", "V_bound", "v_bound"):
        assert log[name].shape == (len(WINDOWS),)
    assert log["W_star_u"].shape == log["W_hat_u"][0].shape


def test_theory_json_says_the_same_as_the_log(log, found):
    for i, name in enumerate(WINDOWS):
        part = found["windows"][name]
        assert part["corrected"]["lambda"] == log["V_lambda"][i]
        assert part["corrected"]["bound"] == log["V_bound"][i]
        assert part["sway"]["value"] == log["v_bound"][i]
        since = log["time"] >= part["since"] - 1e-9
        assert part["largest_V"] == log["V"][since].max()
        assert part["V_dot_below_bound"] == 1.0


def test_everything_that_the_proof_assumes_holds_here(found):
    assert all(each["holds"] for each in found["assumptions"])
    assert all(each["holds"] for each in found["conditions"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("controller.coupling=printed", "coupling"),
        ("control.period=0.05", "continuous"),
        ("controller.rate=difference", "rate of psi_d"),
        ("controller.fold=printed", "folded alone"),
        ("actuator={kind: saturated, surge_limit: 8.0, yaw_limit: 2.5}", "actuator"),
        ("controller.hold_below=40.0", "hold_below"),
    ],
)
def test_an_assumption_that_fails_is_named(change, words, tmp_path):
    turned = ("start.psi=-2.0",) if words == "folded alone" else ()
    gentle = (
        "controller.Gamma_u=1.0",
        "controller.Gamma_r=1.0",
        "controller.gamma_u=10.0",
        "controller.gamma_r=10.0",
        "simulation.duration=2",
    )
    request = Request((*gentle, change, *turned), tmp_path / "run", figures=False)
    done = run(CONFIGS / "theory/base.yaml", request).folder
    assumptions = json.loads((done / "theory.json").read_text())["assumptions"]
    failing = [each["assumption"] for each in assumptions if not each["holds"]]
    assert any(words in text for text in failing), failing


@pytest.mark.parametrize("change", ["log.monitor=false", "controller={kind: pid}"])
def test_without_a_monitor_there_is_nothing_of_it(change, tmp_path):
    request = Request(("simulation.duration=2", change), tmp_path / "run", figures=False)
    done = run(CONFIGS / "theory/base.yaml", request).folder
    assert not (done / "theory.json").exists()
    logged = read_log(done / "log.h5").signals
    assert not [name for name in logged if name.startswith("V") or name in (*ERRORS, *NETWORKS)]


def test_thinned_logs_are_monitored_where_they_are_logged(tmp_path, log):
    request = Request((*SHORT, "log.every=7"), tmp_path / "run", figures=False)
    thin = read_log(run(CONFIGS / "theory/monitor.yaml", request).folder / "log.h5")
    assert len(thin["V"]) == len(thin["time"]) == len(log["time"][::7])
    # The errors are the same; the weights' fit sees other rows.
    np.testing.assert_array_equal(thin["V_z_e"], log["V_z_e"][::7])
    np.testing.assert_allclose(thin["V"], log["V"][::7], rtol=0.05)


def test_a_stack_shows_parts_that_make_up_all_of_V(log):
    scenario = load(CONFIGS / "theory/monitor.yaml", SHORT).scenario
    shown = dress_runs([looked_at(label, log, scenario) for label in ("one", "other")])
    value, _, *stacks = FIGURES["stability"].family(shown, 2).axes
    assert value.get_yscale() == "log"
    for stack in stacks:
        tops = tops_of(stack)
        assert len(tops) == len(TERMS)
        assert tops[-1] == pytest.approx(1.0)
        assert np.all(np.diff(tops) >= 0.0)


def tops_of(stack: Axes) -> list[float]:
    return [layer.get_paths()[0].vertices[:, 1].max() for layer in stack.collections]


def test_V_of_a_single_run_is_stacked_below_its_bound(log):
    scenario = load(CONFIGS / "theory/monitor.yaml", SHORT).scenario
    stack = FIGURES["stability"].family(dress_runs([looked_at("one", log, scenario)]), 2).axes[0]
    tops = tops_of(stack)
    assert len(tops) == len(TERMS)
    width = -(-len(log["V"]) // POINTS)
    assert tops[-1] == pytest.approx(log["V"][:width].mean())  # V is largest at the start
    drawn = [line.get_ydata()[0] for line in stack.lines if len(line.get_ydata()) == 2]
    near = [bound for bound in log["V_bound"] if bound <= FAR * log["V"].max()]
    assert near
    assert drawn == near
    assert stack.get_ylim()[1] > max(near)


def test_the_log_has_filter_errors_norms_and_nodes(log):
    for name in (signal.name for signal in (*ERRORS, *NETWORKS)):
        np.testing.assert_allclose(
            log.signals[name], DERIVED[name].compute(log), rtol=1e-12, atol=1e-15
        )


def test_nearest_node_of_a_list_of_centres_far_from_all_of_them():
    centers = ((0.0, 0.0, 0.0), (1.0, 0.5, -0.2))
    network = Network(centers=centers, widths=(0.5, 0.2, 0.1))
    nu = np.array([[0.9, 0.4, 0.0], [40.0, 0.0, 0.0]])
    log = Recording("finished", "", dict(zip("uvr", nu.T, strict=True)))
    scaled = (nu[:, None, :] - np.array(centers)) / [0.5, 0.2, 0.1]
    expected = np.sqrt((scaled**2).sum(axis=2)).min(axis=1)
    np.testing.assert_allclose(node_distance(network, exponents(network, log)), expected)


def test_law_without_a_filter_has_no_filter_error(tmp_path):
    short = ("simulation.duration=1", "controller={kind: full_backstepping}")
    request = Request(short, tmp_path / "r", figures=False)
    log = read_log(run(CONFIGS / "theory/base.yaml", request).folder / "log.h5")
    assert not any(part.name in log for part in ERRORS)
    assert all(part.name in log for part in NETWORKS)


def test_derived_signals_of_the_monitor(log):
    near, largest = (DERIVED[name].compute(log) for name in ("node_distance", "activation"))
    nu = np.column_stack([log["u"], log["v"], log["r"]])[::50]
    apart = (nu[:, None, :] - log["rbf_center"]) / log["rbf_width"]
    np.testing.assert_allclose(near[::50], np.sqrt((apart**2).sum(axis=2)).min(axis=1))
    np.testing.assert_allclose(largest, np.exp(-(near**2) / 2.0))
    limit = DERIVED["V_dot_bound"].compute(log)
    assert np.all(log["V_dot"] <= limit)
    first = -2.0 * log["V_lambda"][0] * log["V"][0] + log["V_Delta"][0]
    assert limit[0] == first
    last = -2.0 * log["V_lambda"][1] * log["V"][-1] + log["V_Delta"][1]
    assert limit[-1] == last
