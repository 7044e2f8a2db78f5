"""docs/sea.md tells what the committed studies and comparisons found."""

import math
import re
from pathlib import Path

import pandas as pd
import pytest
from paper_samples import rerun, untimed

from podusv_cli.scenario.load import load
from podusv_cli.workflows import compare, run

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "sea.md").read_text().partition("## What six laws")[2]
WORDS = " ".join(PAGE.split())
PERIODS = ("0.1", "0.5", "2.0")
LAWS = (
    "velocity_vector",
    "adaptive_neural",
    "dsc",
    "full_backstepping",
    "adaptive_neural_anti_windup",
    "pid",
)
NAMED = ("sea_state_4", "sea_state_6", "sea_untold")
PLACES = [(study, period) for study in NAMED for period in PERIODS]


def study(name, file="summary"):
    """A table of a sea's study, by period of GNSS."""
    table = pd.read_csv(ROOT / "results" / "studies" / name / f"{file}.csv")
    table["period"] = table.cell.str.split().str[-1]
    return table


STUDIES = {name: study(name).set_index(["period", "law", "metric"]) for name in NAMED}


def row(law, place):
    """The cells of a law's row in the table at this place."""
    found = re.findall(rf"^\| `{law}` \| (.*) \|$", PAGE, re.M)
    return found[place].split(" | ")


def number_of(at, law, metric, name="q50"):
    return STUDIES[at[0]].loc[(at[1], law, metric)][name]


def off(at, law):
    """How many of the 100 draws failed."""
    assert number_of(at, law, "e_after_max", "n") == 100
    return round(100 * number_of(at, law, "e_after_max", "failed"))


def told(at, law):
    median, most = (1000 * number_of(at, law, "e_after_max", name) for name in ("q50", "q95"))
    return f"{median:.0f}, {most:.0f}" if math.isfinite(most) else f"{off(at, law)} off"


@pytest.mark.parametrize("law", LAWS)
def test_the_distances_are_those_of_the_studies(law):
    assert row(law, 0) == [told(at, law) for at in PLACES]


def test_the_consistency_of_the_filter_is_that_of_the_studies():
    nees = [number_of(at, "adaptive_neural", "nees") for at in PLACES]
    ends = [min(nees[:6]), max(nees[:6])], [min(nees[6:]), max(nees[6:])]
    said = "NEES, which should be 6, is {:.1f} to {:.1f} with and {:.0f} to {:.0f} without."
    assert said.format(*ends[0], *ends[1]) in WORDS


def test_what_is_to_be_kept_is_as_in_the_studies():
    sound = [at for at in PLACES if at[0] != "sea_untold"]
    assert {off(at, law) for at in sound for law in LAWS[:4]} == {0}
    lost = [off(PLACES[-1], law) for law in LAWS[:4]]
    assert f"in {min(lost)} to {max(lost)} of 100 draws of state 6 at 0.5 Hz" in WORDS
    assert f"{lost[0]} with `velocity_vector`, {lost[1]} with `adaptive_neural`" in WORDS
    theirs, ours = (1000 * number_of(PLACES[3], law, "e_after_max") for law in LAWS[1::-1])
    assert f"({theirs:.0f} against {ours:.0f} mm in state 6 at 10 Hz)" in WORDS
    turned = [number_of(PLACES[3], law, "tv_tau_u") for law in LAWS[1::-1]]
    assert round(turned[0] / turned[1], -1) == 160
    assert "turns its demand 160 times as much" in WORDS


def single(name):
    """The committed comparison of single runs."""
    return pd.read_csv(ROOT / "results/sea" / name / "comparison.csv", index_col=0)


NAMES = re.search(r"^SEAS := (.*)$", (ROOT / "Makefile").read_text(), re.M).group(1).split()
SINGLE = {name: single(name) for name in NAMES}


def number(name, law, metric):
    return float(SINGLE[name].loc[metric, law])


@pytest.mark.parametrize(
    "law", ["adaptive_neural", "dsc", "full_backstepping", "pid", "velocity_vector"]
)
def test_what_sensors_cost_is_as_in_the_comparisons(law):
    true, *seen = (number(n, law, "tv_tau_u") for n in ("exact", "sensors", "sensors_alone"))
    told = [f"{true:.2f}", *(f"{n:_.0f}".replace("_", " ") for n in seen)]
    assert [re.sub(r"^(\d) (\d{3})$", r"\1\2", cell) for cell in row(law, 1)] == told


@pytest.mark.parametrize(
    "law", ["adaptive_neural", "dsc", "full_backstepping", "pid", "velocity_vector"]
)
def test_what_actuators_cost_is_as_in_the_comparisons(law):
    names = ("pods", "delay", "thruster_failure", "dead_zone")
    told = [
        f"{1000 * number(name, law, 'error_after_rms'):.0f} mm, "
        f"{100 * number(name, law, 'saturated_fraction'):.0f} %"
        if law in SINGLE[name]
        else "-"
        for name in names
    ]
    assert row(law, -1) == told


SEA = ROOT / "configs/sea"


def test_the_sea_with_pods_has_the_pods_and_laws_of_one_scenario_and_the_sea_of_another():
    pods, kept, sea = (
        load(SEA / name).scenario.singles()
        for name in ("pods.yaml", "../pod/kept.yaml", "state_4.yaml")
    )
    assert set(pods) == {*kept, "velocity_vector"}
    for law, scenario in pods.items():
        assert scenario.actuator == kept["pid"].actuator
        given, other = scenario.as_given(), sea[law].as_given()
        laws = kept | {"velocity_vector": sea["velocity_vector"]}
        assert given["controller"] == laws[law].as_given()["controller"]
        for part in ("vessel", "path", "disturbance", "measurement", "estimator"):
            assert given[part] == other[part], part


def test_what_is_said_of_pods_is_as_in_the_tables():
    lost = [number("pods", law, "e_after_max") for law in LAWS[1:4]]
    assert 2.2 <= round(min(lost), 1) <= round(max(lost), 1) <= 2.6
    share = 100 * number("pods", "velocity_vector", "at_angle_limit")
    assert f"at their angle limit for {share:.0f} % of the time" in WORDS


def test_the_loads_are_those_of_the_logs():
    loads = pd.read_csv(ROOT / "results/sea/loads.csv", index_col="run")
    u, v, r, *_ = loads.T.values
    for sentence, at in (
        ("in surge, sway and yaw are {:.2f} N, {:.2f} N and {:.2f} N m in one run of sea", 1),
        ("{:.2f} N, {:.2f} N and {:.2f} N m of the paper's disturbance", 0),
    ):
        assert sentence.format(u[at], v[at], r[at]) in WORDS
    assert list(loads.index) == ["exact", "state_6", "current"]


def test_what_is_said_of_remark_8_is_as_in_the_tables():
    demand = {
        (name, law): number(name, law, "tv_tau_u")
        for name in ("sensors", "sensors_alone")
        for law in ("adaptive_neural", "dsc")
    }
    medians = [
        1.0 - number_of(at, "adaptive_neural", "tv_tau_u") / number_of(at, LAWS[3], "tv_tau_u")
        for at in PLACES[:3]
    ]
    low, high = (100 * f(medians) for f in (min, max))
    assert f"the medians of state 4 the variation is {low:.0f} to {high:.0f} % smaller" in WORDS
    ratios = [
        demand[name, "dsc"] / demand[name, "adaptive_neural"]
        for name in ("sensors", "sensors_alone")
    ]
    assert max(abs(ratio - 1.0) for ratio in ratios) < 0.02


def test_a_dead_zone_costs_what_is_told():
    ideal, dead = (number(name, "adaptive_neural", "tv_tau_u") for name in ("exact", "dead_zone"))
    assert f"the demand's variation grows from {ideal:.0f} to {dead:.0f} N" in WORDS
    off = [number(name, "adaptive_neural", "error_after_rms") for name in ("exact", "dead_zone")]
    assert off[1] == pytest.approx(off[0], rel=1e-3)


@pytest.mark.papers
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_committed_comparison_is_what_comes_out(name, tmp_path, monkeypatch):
    monkeypatch.setattr(compare, "law_costs", untimed)
    request = run.Request(out=tmp_path / name, figures=False)
    compare.compare([ROOT / f"configs/sea/{name}.yaml"], request)
    found = pd.read_csv(tmp_path / name / "comparison.csv", index_col=0)
    pd.testing.assert_frame_equal(found, SINGLE[name], rtol=1e-6)


@pytest.mark.papers
def test_one_committed_run_is_what_comes_out():
    """The one that a rounding error does not drive apart: no noise, no limit in the loop."""
    law = load(ROOT / "configs/sea/delay.yaml").scenario.singles()["velocity_vector"]
    found = rerun(law).metrics
    committed = SINGLE["delay"].velocity_vector.astype(float)
    common = [name for name in committed.index if name in found]
    assert {"iae", "tv_tau_u", "saturated_fraction"} <= set(common)
    for name in common:
        assert found[name] == pytest.approx(committed[name], rel=1e-6, nan_ok=True), name
