"""results/sea.md tells what the committed studies of sea states found."""

import re
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "results" / "sea.md").read_text()
PERIODS = ("0.1", "0.5", "2.0")
LAWS = ("velocity_vector", "proposed", "dsc", "li", "proposed_anti_windup", "pid")


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
        expected.append(f"{100 * share:.0f} %, {demand:.0f} N")
    assert row(law, 1) == expected


def test_a_law_told_of_the_loads_fails_more_often_with_more_positions():
    for table in STUDIES.values():
        failed = [table.loc[(p, "proposed_anti_windup", "iae")].failed for p in PERIODS]
        assert failed == sorted(failed, reverse=True)
        assert failed[0] > failed[-1]
