"""results/paper.md: its numbers are those of the committed comparisons, its functions exist."""

from __future__ import annotations

import re
from functools import reduce
from importlib import import_module

import pandas as pd
import pytest
from command_samples import ROOT, Command

PAGE = (ROOT / "results/paper.md").read_text()
TABLES = {
    letter: pd.read_csv(ROOT / "results/mu_2017" / name / "comparison.csv", index_col=0)
    for letter, name in (
        ("P", "printed_compare"),
        ("F", "figures_compare"),
        ("S", "figures_compare_standoff"),
        ("C", "corrected_compare"),
    )
}
PROPOSED, LI, PID = "adaptive_neural", "full_backstepping", "pid"
FUNCTIONS = re.findall(r"^\| [^|]+ \| [^|]+ \| `([\w/]+)\.py` \| (`.*`) \|$", PAGE, re.M)
EQUATIONS = 53  # the last number that the paper has


def number(reading: str, metric: str, law: str) -> float:
    return float(TABLES[reading].loc[metric, law])


def section(heading: str) -> str:
    found = re.search(rf"^#* ?{re.escape(heading)}.*?(?=^## )", PAGE, re.M | re.S)
    assert found
    return found[0]


@pytest.mark.parametrize(("file", "names"), FUNCTIONS)
def test_every_function_of_the_table_exists(file: str, names: str) -> None:
    module = import_module(f"podusv_cli.{file.replace('/', '.')}")
    for name in re.findall(r"`([\w.]+)`", names):
        reduce(getattr, name.split("."), module)


def test_every_equation_of_the_paper_is_in_the_table() -> None:
    told: set[int] = set()
    for cell in re.findall(r"^\| (\(.*?) \|", PAGE, re.M):
        for first, last in re.findall(r"\((\d+)\)(?:-\((\d+)\))?", cell):
            told |= {*range(int(first), int(last or first) + 1)}
    assert {*range(1, EQUATIONS + 1)} - told == {16}  # the membrane, of which (17) is made


def test_the_peaks_of_figure_5_are_those_of_the_reading_that_has_them() -> None:
    force, moment = (number("F", f"peak_tau_{axis}", PROPOSED) for axis in "ur")
    assert f"{force:.1f} N and {moment:.0f} N m" in section("## Figure 5")
    assert f"up to {number('C', 'peak_tau_u', PROPOSED):.0f} N".replace("36460", "36 460") in PAGE
    for told in (f"Peak surge force: {force:.1f} N", f"Peak yaw moment: {moment:.0f} N m"):
        assert told in section("# The paper in figures")


def test_the_errors_of_figures_3_and_4_are_those_of_the_corrected_reading() -> None:
    ours, li, pid = (number("C", "iae_e", law) for law in (PROPOSED, LI, PID))
    assert f"{ours:.1f} and {li:.1f} m s, differ by {100 * (1 - li / ours):.1f} %" in PAGE
    assert f"integrated error, {pid:.1f} m s" in PAGE
    times = [number("C", "settling_time", law) for law in (PROPOSED, LI, PID)]
    assert "after {:.1f} s, the Li-type law after {:.1f} s, and PID first, after {:.1f} s".format(
        *times
    ) in section("## Figure 4")
    assert abs(times[1] / times[0] - 1) < 0.01
    assert number("C", "e_steady", PROPOSED) < 1e-3


@pytest.mark.parametrize(("figure", "law"), [(6, LI), (7, PID)])
def test_the_peaks_of_figures_6_and_7_are_those_of_the_reading_with_a_standoff(
    figure: int, law: str
) -> None:
    text = section(f"## Figure {figure}")
    force, moment = number("S", "peak_tau_u", law), number("S", "peak_tau_r", law)
    assert f"surge peak is {force:.0f} N" in text
    ours = number("S", "peak_tau_r", PROPOSED)
    assert f"yaw peak is {moment:.3g} N m against {ours:.0f} N m" in text
    ratio = force / number("S", "peak_tau_u", PROPOSED)
    assert {6: f"{ratio:.0f}" == "10", 7: f"{ratio:.1f} times" in text}[figure]


def test_what_is_said_of_settled_demands_energy_and_distance_is_so() -> None:
    for axis in "ur":
        li, ours = (number("S", f"tv_tau_{axis}", law) for law in (LI, PROPOSED))
        assert abs(li / ours - 1) < 0.01
    pid, ours = (number("S", "energy", law) for law in (PID, PROPOSED))
    assert f"PID uses {pid:.0f} J against {ours:.0f} J" in PAGE
    distances = [number("S", "z_e_steady", law) for law in (PROPOSED, PID)]
    assert f"stays {distances[0] - distances[1]:.2f} m further" in PAGE
    orbits = TABLES["P"].loc["z_e_steady", [PROPOSED, "dsc", LI, PID]].astype(float)
    assert f"at {orbits.min():.1f} to {orbits.max():.1f} m" in PAGE
    worst = TABLES["S"].loc["iae_e", [PROPOSED, "dsc", LI, PID]].astype(float)
    assert worst.idxmax() == PROPOSED


def test_laws_of_the_type_of_li_are_found_by_that_word(podusv: Command) -> None:
    said = podusv("docs", "Li-type")
    assert said.code == 0
    assert said.out.startswith("podusv docs results/paper")


def test_reproduce_ends_with_this_page() -> None:
    recipe = (ROOT / "Makefile").read_text().partition("\nreproduce:")[2].partition("\n\n")[0]
    assert recipe.splitlines()[-1].endswith('results/paper.md"')
