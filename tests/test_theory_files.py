"""What the monitor leaves in a run folder, and the figures made of it."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from podusv_cli.components.controllers.network import Network
from podusv_cli.core.recording import Recording
from podusv_cli.figures.drawing import FIGURES, dressed
from podusv_cli.figures.stability import FAR, POINTS
from podusv_cli.scenario.load import load
from podusv_cli.storage.log_reader import read_log
from podusv_cli.theory.derived import DERIVED
from podusv_cli.theory.ideal_weights import exponents, node_distance
from podusv_cli.theory.lyapunov import TERMS
from podusv_cli.theory.monitor import ERRORS, NETWORKS, WINDOWS
from podusv_cli.workflows.run import Request, run

CONFIGS = Path(__file__).parents[1] / "configs"
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
    gentle = ("controller.Gamma_u=1.0", "controller.Gamma_r=1.0", "controller.gamma_u=10.0",
              "controller.gamma_r=10.0", "simulation.duration=2")  # fmt: skip
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
    shown = dressed([("one", log, scenario), ("other", log, scenario)])
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
    stack = FIGURES["stability"].family(dressed([("one", log, scenario)]), 2).axes[0]
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
    request = Request(("simulation.duration=1", "controller={kind: backstepping}"), tmp_path / "r",
                      figures=False)  # fmt: skip
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
