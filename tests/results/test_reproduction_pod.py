"""The committed results of the pods, made anew: the tables, and what docs/pod.md says."""

import re
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from paper_samples import rerun, untimed

from podusv_cli.scenario.load import load
from podusv_cli.workflows import compare, run

ROOT = Path(__file__).parents[2]
NAMES = ("ideal", "kept", "dropped", "single", "no_anti_windup")
SOON = (
    "single",
)  # the others take half a minute, and what `make test-papers` sees of them is in the lines
LAWS = ["adaptive_neural", "dsc", "full_backstepping", "pid"]
FOUND = (ROOT / "docs/pod.md").read_text()


LINES = re.findall(r"^\| `(\w+)` \| (`.*`) \| (\d+) \| (\d+) \|$", FOUND, re.MULTILINE)


def committed(name: str, folder: Path = ROOT / "results/pod") -> Any:
    """A comparison's table."""
    return pd.read_csv(folder / name / "comparison.csv", index_col=0)


@pytest.mark.papers
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n not in SOON)) for n in NAMES]
)
def test_the_committed_table_is_what_comes_out(name, tmp_path, monkeypatch):
    monkeypatch.setattr(compare, "law_costs", untimed)
    request = run.Request(out=tmp_path / name, figures=False)
    compare.compare([ROOT / f"configs/pod/{name}.yaml"], request)
    pd.testing.assert_frame_equal(committed(name, tmp_path), committed(name), rtol=1e-6)


def test_the_table_in_words_is_the_committed_one():
    rows = re.findall(r"^\| [^|]*\(`(\w+)`\) \|(.*)\|$", FOUND, re.MULTILINE)
    assert [name for name, _ in rows] == list(NAMES)
    for name, cells in rows:
        table = committed(name)
        for law, cell in zip(LAWS, cells.split("|"), strict=True):
            iae, z_e = cell.strip(" )").split(" (")
            assert float(iae) == round(float(table.loc["iae", law]))
            digits = len(z_e.partition(".")[2])
            assert float(z_e) == round(float(table.loc["z_e_steady", law]), digits)


@pytest.mark.parametrize(
    ("name", "law", "metric", "unit", "told"),
    [
        ("dropped", "adaptive_neural", "energy_pod", 1, "({} against "),
        ("kept", "adaptive_neural", "energy_pod", 1, " against {} J)"),
        ("dropped", "adaptive_neural", "angle_travel", 1, "({} against "),
        ("kept", "adaptive_neural", "angle_travel", 1, " against {} rad)"),
        ("dropped", "adaptive_neural", "at_angle_limit", 100, "for {} % of the time"),
        ("kept", "adaptive_neural", "at_angle_limit", 100, "instead of {} %"),
        ("no_anti_windup", "pid", "energy_pod", 1, "({} against "),
        ("kept", "pid", "energy_pod", 1, " against {} J)"),
        ("no_anti_windup", "full_backstepping", "peak_tau_u", 1e-3, "(up to {} kN)"),
        ("single", "pid", "saturated_fraction", 100, "({} % of the time out of"),
    ],
)
def test_a_number_in_the_text_is_the_committed_one(name, law, metric, unit, told):
    number = float(committed(name).loc[metric, law]) * unit
    assert told.format(f"{number:.0f}") in " ".join(FOUND.split())


def test_which_law_arrives_first_is_as_committed():
    settling = committed("kept").loc["settling_time", LAWS].astype(float)
    assert settling.idxmin() == "pid"
    assert f"({settling['pid']:.1f} against {settling['adaptive_neural']:.1f} s)" in FOUND


@pytest.mark.papers
@pytest.mark.parametrize(
    ("name", "keys", "adaptive_neural", "pid"),
    [pytest.param(*line, marks=[pytest.mark.slow] * (i % 4 > 0)) for i, line in enumerate(LINES)],
)
def test_what_the_findings_hang_on_comes_out(name, keys, adaptive_neural, pid):
    singles = load(
        ROOT / f"configs/pod/{name}.yaml", re.findall("`(.*?)`", keys)
    ).scenario.singles()
    for law, told in (("adaptive_neural", adaptive_neural), ("pid", pid)):
        iae = rerun(singles[law]).metrics["iae"]
        assert iae == pytest.approx(int(told), abs=0.6, rel=1e-3)


def test_the_lines_that_say_so_are_there():
    assert len(LINES) == 5


@pytest.mark.papers
@pytest.mark.parametrize(
    ("name", "keys", "told"),
    [("kept", tuple(f"actuator.pods.{i}.T_nV=0.075" for i in (0, 1)), "({} against 337 J)")],
)
def test_what_else_costs_at_the_propeller_comes_out(name, keys, told):
    law = load(ROOT / f"configs/pod/{name}.yaml", keys).scenario.singles()["adaptive_neural"]
    assert told.format(round(rerun(law).metrics["energy_pod"])) in " ".join(FOUND.split())
