"""Metrics that a scenario names, against their definitions; in tables, claims and studies."""

import math

import numpy as np
import pytest
from command_samples import TWO, write
from conftest import corrected

from podusv_cli.comparison.claims import parse_claims
from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.core.errors import ScenarioError
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.engine.step.grid import TimeGrid
from podusv_cli.metrics.table import METRICS, metrics_with, observer
from podusv_cli.metrics.windows import NAMED, called
from podusv_cli.scenario.load import load_text
from podusv_cli.studies.study.expressions import parse_success

WINDOWS = (("bend", (12.0, 31.0)), ("start", (0.0, 5.0)), ("rest", (35.004, 40.0)))
RADII = (("far", 9.0), ("near", 0.01))
SCENARIO = """
name: windows
vessel: {preset: paper_nonlinear}
path: {kind: line_circle}
disturbance: {kind: harmonic}
actuator: {kind: saturated}
controllers: {a: {kind: pid}, b: {kind: dsc}}
"""


def gathered(*, compiled=True, steps=4000, windows=WINDOWS, until=math.inf):
    """Log and metrics of a run of 40 s that is told of these windows."""
    loop, grid = corrected(actuator=Saturated()), TimeGrid(0.01, steps)
    known = metrics_with((), (windows, RADII))
    seeing = observer(loop, grid, steady_fraction=0.2, settling_radius=1.0, known=known)

    def progress(done):
        if done >= until:
            raise KeyboardInterrupt

    run = simulate(loop, grid, observer=seeing, compiled=compiled, progress=progress)
    return run, seeing.summary(run.seen)


@pytest.fixture(scope="module")
def run():
    return gathered()


def test_an_error_over_a_window_follows_its_definition(run):
    log, got = run
    t, z_e = log["time"], log["z_e"]
    for name, (start, end) in WINDOWS:
        inside = (t >= start - 1e-9) & (t <= end + 1e-9)
        rms = np.sqrt(np.trapezoid(z_e[inside] ** 2, t[inside]) / np.ptp(t[inside]))
        assert got[f"error_{name}_rms"] == pytest.approx(rms, rel=1e-12)
        assert got[f"error_{name}_max"] == z_e[inside].max()


def test_a_further_radius_has_the_settling_time_of_that_radius(run):
    log, got = run
    t, z_e = log["time"], log["z_e"]
    assert got["settling_time_far"] == pytest.approx(t[z_e > 9.0][-1] + 0.01)
    assert math.isnan(got["settling_time_near"])  # the standoff is larger


def test_windows_are_the_same_in_machine_code_and_in_python():
    windows = (("early", (0.5, 1.5)),)
    (_, fast), (_, slow) = (gathered(compiled=c, steps=200, windows=windows) for c in (True, False))
    assert fast["error_early_rms"] > 0
    np.testing.assert_equal(fast, slow)


def test_a_run_that_ends_before_a_window_does_has_no_error_over_it():
    windows = (("over", (1.0, 2.0)), ("cut", (1.0, 2.004)), ("later", (50.0, 60.0)))
    _, got = gathered(steps=200, windows=windows)
    assert got["error_over_rms"] > 0
    for name in ("error_cut_rms", "error_later_rms", "error_cut_max", "error_later_max"):
        assert math.isnan(got[name])


def test_an_interrupted_run_has_the_windows_that_are_over():
    windows = (("over", (0.1, 0.5)), ("cut", (0.1, 35.0)))
    log, got = gathered(compiled=False, windows=windows, until=0.02)
    assert 0.5 < log["time"][-1] < 35
    assert got["error_over_max"] > 0
    assert math.isnan(got["error_cut_rms"])


def test_metrics_of_windows_stand_beside_the_other_errors_and_only_where_they_are_named():
    names = list(metrics_with((), (WINDOWS, RADII)))
    place = names.index("error_bend_rms")
    assert names.index("iae") < place < names.index("effort_u")
    assert not [name for name in METRICS if "bend" in name]
    plain = load_text(SCENARIO, "plain.yaml").scenario
    assert list(plain.known_metrics()) == [name for name in METRICS if NAMED not in name]
    got = plain.observer()
    assert not [n for n in got.summary(np.full(got.size, np.nan)) if n.startswith("error_")]


def named(windows, claim="a.error_line_rms < b.error_line_max"):
    text = f"metrics: {{windows: {windows}}}\nclaims:\n  C: {{says: x, source: y, expect: {claim}}}"
    return load_text(SCENARIO + text, "named.yaml")


def test_claims_and_studies_know_the_metrics_of_windows_and_no_others():
    loaded = named("{line: [60, 100]}")
    assert len(parse_claims(loaded)) == 1
    known = loaded.scenario.known_metrics()
    assert parse_success("error_line_rms < 1", known) is not None
    with pytest.raises(ScenarioError, match=r"error_line_rms"):
        parse_claims(named("{circle: [150, 310]}"))
    with pytest.raises(ScenarioError, match=r"error_NAME_rms"):
        parse_claims(named("{line: [60, 100]}", "a.error_NAME_rms < 1"))


@pytest.mark.parametrize(
    ("section", "told"),
    [
        ("{windows: {line: [5, 5]}}", "windows.line: must start at 0 s or later and end after"),
        ("{windows: {line: [-1, 5]}}", "windows.line: must start at 0 s or later and end after"),
        ("{windows: {line: [1]}}", "windows.line: must be a list of 2 numbers"),
        ("{windows: {Line: [1, 2]}}", "windows.Line: a name here is at most 30"),
        ("{radii: {near: 0}}", "radii.near: must be above 0 m, found 0"),
        ("{radii: {1st: 1}}", "radii.1st: a name here is at most 30"),
    ],
)
def test_a_window_that_cannot_be_is_told_with_its_place(section, told):
    with pytest.raises(ScenarioError, match=f"metrics.{told}"):
        load_text(SCENARIO + f"metrics: {section}", "wrong.yaml")


def test_the_name_of_a_metric_that_a_scenario_names_is_explained():
    metric = called("error_my_line_rms", METRICS)
    assert metric is not None
    assert metric.unit == "m"
    assert called("iae", METRICS) is METRICS["iae"]
    assert called("error__rms", METRICS) is None
    assert called("iae_line", METRICS) is None


def test_runs_with_windows_and_runs_without_share_a_table(podusv):
    write("two.yaml", TWO)
    short = ("--set", "simulation.duration=2", "--no-figures")
    lines = ("--set", "metrics.windows.line=[1,2]", *short)
    assert podusv("run", "two.yaml", "--controller", "soft", *short, "--out", "old").code == 0
    assert podusv("run", "two.yaml", "--controller", "soft", *lines, "--out", "new").code == 0
    told = podusv("compare", "old", "new", "--out", "both", "--no-figures")
    assert told.code == 0
    (row,) = [line.split() for line in told.out.splitlines() if line.startswith("error_line_rms")]
    assert row[:3] == ["error_line_rms", "m", "-"]
    assert float(row[3].rstrip("*")) > 0
    assert podusv("plot", "old", "--out", "figures", "--only", "errors").code in (0, 2)
