"""Runs held against an optimum of the same task in a comparison; the rows that an optimum keeps."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_samples import BASE

from podusv_cli.optimum.feedback import MOST_ROWS, _chosen
from podusv_cli.storage.run_folder import open_run

BEST = BASE.replace(
    "controller: {kind: pid, K_Pu: 100.0}",
    'controller: {kind: schedule, rows: "0, 8, 0.5\\n1, 8, 0.5", minimises: iae}',
)


def made(podusv, name, text, *words):
    """A finished run in a folder of this name."""
    Path(f"{name}.yaml").write_text(text)
    assert podusv("run", f"{name}.yaml", "--no-figures", "--out", name, "-q", *words).code == 0
    return open_run(Path(name)).metrics


def compared(podusv, *items):
    """Exit code, ratios by run, and what is missing."""
    said = podusv("compare", *items, "--no-figures", "--json", "--out", "c", "--force")
    told = json.loads(said.out)
    return said.code, told["comparison"].get("iae_of_optimum"), told["missing"]


def test_every_run_of_the_task_has_its_ratio_to_the_optimum(podusv):
    best, law = made(podusv, "best", BEST), made(podusv, "law", BASE)
    code, ratios, missing = compared(podusv, "law", "best")
    assert (code, missing) == (0, [])
    assert ratios == {"law": pytest.approx(law["iae"] / best["iae"], rel=1e-12), "best": 1.0}
    assert ratios["law"] > 1.0
    assert "iae_of_optimum" in Path("c/comparison.md").read_text()


def test_without_an_optimum_there_is_no_such_row(podusv):
    made(podusv, "law", BASE)
    assert compared(podusv, "law")[1:] == (None, [])


def test_of_two_optima_the_lower_counts(podusv):
    made(podusv, "worse", BEST.replace("0, 8, 0.5", "0, 1, 0"))
    made(podusv, "best", BEST)
    ratios = compared(podusv, "worse", "best")[1]
    assert ratios["best"] == 1.0 < ratios["worse"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "what"),
    [
        ("start.x=-4", "start"), ("actuator.surge_limit=9", "actuator"),
        ("vessel.X_u=-1", "vessel"), ("path.speed=0.4", "path"),
        ("disturbance.kind=harmonic", "disturbance"),
        ("simulation.duration=0.9", "simulation.duration"),
    ],
)  # fmt: skip
def test_a_run_of_another_task_is_not_related_and_a_sentence_says_why(podusv, change, what):
    made(podusv, "best", BEST)
    made(podusv, "other", BASE, "--set", change)
    code, ratios, missing = compared(podusv, "best", "other")
    assert code == 0
    assert ratios == {"best": 1.0, "other": None}
    assert missing == [
        f"iae_of_optimum of other could not be made: the optimum best has another {what}"
    ]


def test_what_only_a_law_is_told_makes_no_other_task(podusv):
    made(podusv, "best", BEST)
    made(podusv, "wrong", BASE, "--set", "nominal.X_u=-1", "--set", "control.period=0.1")
    assert compared(podusv, "best", "wrong")[2] == []


def test_a_long_motion_keeps_the_rows_where_its_demand_bends():
    assert _chosen(np.zeros((100, 2))) == list(range(100))
    demands = np.zeros((3 * MOST_ROWS, 2))
    demands[5001:] = 8.0, 0.0
    kept = _chosen(demands)
    assert {0, 5000, 5001, len(demands) - 1} <= set(kept)
    assert len(kept) <= MOST_ROWS + 1
    assert np.diff(kept).max() <= 6
