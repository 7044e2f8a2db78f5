"""results/sea.md tells what the committed studies and comparisons found."""

import math
import re
from pathlib import Path

import pandas as pd
import pytest
from test_reproduction import rerun, untimed

from podusv_cli.scenario.load import load
from podusv_cli.workflows import compare, run

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "results" / "sea.md").read_text()
PERIODS = ("0.1", "0.5", "2.0")
LAWS = (
    "velocity_vector",
    "adaptive_neural",
    "dsc",
    "full_backstepping",
    "adaptive_neural_anti_windup",
    "pid",
)


def study(state):
    """Summary of a sea state's study, by period of GNSS, law and metric."""
    table = pd.read_csv(ROOT / "results" / "studies" / f"sea_state_{state}" / "summary.csv")
    table["period"] = table.cell.str.split().str[-1]
    return table.set_index(["period", "law", "metric"])


STUDIES = {state: study(state) for state in (2, 4, 6)}


def row(law, place):
    """The cells of a law's row in the table at this place."""
    found = re.findall(rf"^\| `{law}` \| (.*) \|$", PAGE, re.M)
    return found[place].split(" | ")


def told(state, period, law):
    found = STUDIES[state].loc[(period, law, "error_after_max")]
    off = round(found.n * found.failed)
    if found.q95 == float("inf"):
        return f"{off} off"
    ends = f"{1000 * found.q50:.0f}, {1000 * found.q95:.0f}"
    return f"{ends}, {off} off" if off else ends


@pytest.mark.parametrize("law", LAWS)
def test_the_distances_are_those_of_the_studies(law):
    assert row(law, 0) == [told(state, period, law) for state in STUDIES for period in PERIODS]


@pytest.mark.parametrize("law", LAWS[:4])
def test_what_noise_costs_is_as_in_the_studies(law):
    expected = []
    for state, period in ((2, "0.1"), (2, "2.0"), (6, "0.1"), (6, "2.0")):
        share, demand = (
            STUDIES[state].loc[(period, law, metric)].q50
            for metric in ("saturated_fraction", "tv_tau_u")
        )
        cell = f"{100 * share:.0f} %, {demand:.0f} N"
        expected.append(cell if math.isfinite(demand) else "more than half failed")
    assert row(law, 1) == expected


def failed(state, period, law):
    """How many of 20 draws failed."""
    return round(20 * STUDIES[state].loc[(period, law, "iae")].failed)


def test_how_often_a_law_that_is_told_of_the_loads_fails():
    assert {failed(n, p, "adaptive_neural_anti_windup") for n in STUDIES for p in PERIODS[:2]} == {
        20
    }
    rare = [failed(n, "2.0", "adaptive_neural_anti_windup") for n in STUDIES]
    assert "all draws at 10 and 2 Hz, and in {}, {} and {} of 20 at 0.5 Hz".format(*rare) in WORDS


def largest(state, period, law, share="q50"):
    return 1000 * STUDIES[state].loc[(period, law, "error_after_max")][share]


def test_what_is_said_in_short_is_as_in_the_studies():
    often = [(state, period) for state in STUDIES for period in PERIODS[:2]]
    worst = max(largest(*at, law, "q95") for at in often for law in LAWS[1:4])
    ours = max(largest(*at, LAWS[0], "q95") for at in often)
    assert f"stay within {worst / 1000:.2f} m of the target" in WORDS
    assert f"`velocity_vector` within {ours / 1000:.2f} m." in WORDS
    lost = [failed(6, "2.0", law) for law in LAWS[1:4]]
    assert f"in {min(lost)} to {max(lost)} of 20 draws" in WORDS
    assert failed(6, "2.0", LAWS[0]) == 1


def test_what_fewer_positions_cost_is_as_in_the_studies():
    def cost(state, law):
        return f"{largest(state, '2.0', law) - largest(state, '0.1', law):.0f}"

    theirs, ours = ([cost(n, law) for n in STUDIES] for law in ("adaptive_neural", LAWS[0]))
    assert "cost `adaptive_neural` {} and {} mm in states 2 and 4".format(*theirs) in WORDS
    assert "`velocity_vector` {}, {} and {} mm in states 2, 4 and 6".format(*ours) in WORDS


def single(name):
    """The committed comparison of single runs."""
    return pd.read_csv(ROOT / "results/sea" / name / "comparison.csv", index_col=0)


NAMES = re.search(r"^SEAS := (.*)$", (ROOT / "Makefile").read_text(), re.M).group(1).split()
SINGLE = {name: single(name) for name in NAMES}
WORDS = " ".join(PAGE.split())


def number(name, law, metric):
    return float(SINGLE[name].loc[metric, law])


@pytest.mark.parametrize(
    "law", ["adaptive_neural", "dsc", "full_backstepping", "pid", "velocity_vector"]
)
def test_what_sensors_cost_is_as_in_the_comparisons(law):
    true, *seen = (number(n, law, "tv_tau_u") for n in ("exact", "sensors", "sensors_alone"))
    place = 2 if law in LAWS[:4] else 1
    told = [f"{true:.2f}", *(f"{n:_.0f}".replace("_", " ") for n in seen)]
    assert [re.sub(r"^(\d) (\d{3})$", r"\1\2", cell) for cell in row(law, place)] == told


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


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("names", "said"),
    [(("state_3", "state_5"), "States 3 and 5"), (("rare", "rare_told"), "`rare_told.yaml`):")],
)
def test_pairs_of_single_runs_are_told_as_committed(names, said, law):
    one, other = (1000 * number(name, law, "error_after_max") for name in names)
    assert f"`{law}` {one:.0f} and {other:.0f}" in WORDS.partition(said)[2][:500]


def test_the_loads_are_those_of_the_logs():
    loads = pd.read_csv(ROOT / "results/sea/loads.csv", index_col="run")
    u, v, r, psi, yaw_rate = loads.T.values
    for sentence, at in (
        ("Its rms loads after 100 s are {:.2f} N, {:.2f} N and {:.2f} N m in surge", 0),
        ("sea state 6 they are {:.2f} N, {:.2f} N and {:.2f} N m;", 1),
        ("the current alone makes {:.2f} N, {:.2f} N and {:.2f} N m of that", 2),
    ):
        assert sentence.format(u[at], v[at], r[at]) in WORDS
    shaken = f"compass by {1000 * psi[1]:.0f} mrad and the gyro by {1000 * yaw_rate[1]:.0f} mrad/s"
    assert shaken in WORDS
    assert list(loads.index) == ["exact", "state_6", "current"]


def test_what_is_said_of_remark_8_is_as_in_the_tables():
    demand = {
        (name, law): number(name, law, "tv_tau_u")
        for name in ("sensors", "sensors_alone")
        for law in ("adaptive_neural", "dsc", "full_backstepping")
    }
    filtered = 1.0 - demand["sensors", "adaptive_neural"] / demand["sensors", "full_backstepping"]
    alone = (
        demand["sensors_alone", "adaptive_neural"] / demand["sensors_alone", "full_backstepping"]
        - 1.0
    )
    medians = [
        1.0 - STUDIES[2].loc[(p, "adaptive_neural", "tv_tau_u")].q50 / li.q50
        for p in PERIODS
        for li in [STUDIES[2].loc[(p, "full_backstepping", "tv_tau_u")]]
    ]
    low, high = (100 * f(medians) for f in (min, max))
    assert f"the variation is {100 * filtered:.0f} % smaller where the measurements" in WORDS
    assert f"the medians of sea state 2 it is {low:.0f} to {high:.0f} % smaller" in WORDS
    assert f"no difference is seen ({100 * alone:.0f} % larger, one run)" in WORDS
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


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_committed_comparison_is_what_comes_out(name, tmp_path, monkeypatch):
    monkeypatch.setattr(compare, "law_costs", untimed)
    request = run.Request(out=tmp_path / name, figures=False)
    compare.compare([ROOT / f"configs/sea/{name}.yaml"], request)
    found = pd.read_csv(tmp_path / name / "comparison.csv", index_col=0)
    pd.testing.assert_frame_equal(found, SINGLE[name], rtol=1e-6)


def test_one_committed_run_is_what_comes_out():
    """The one that a rounding error does not drive apart: no noise, no limit in the loop."""
    law = load(ROOT / "configs/sea/delay.yaml").scenario.singles()["velocity_vector"]
    found = rerun(law).run.metrics
    committed = SINGLE["delay"].velocity_vector.astype(float)
    common = [name for name in committed.index if name in found]
    assert {"iae", "tv_tau_u", "saturated_fraction"} <= set(common)
    for name in common:
        assert found[name] == pytest.approx(committed[name], rel=1e-6, nan_ok=True), name
