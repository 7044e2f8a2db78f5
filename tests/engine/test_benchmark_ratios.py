"""The compiled closed loop agrees with hand-written C, and is as fast (run by `make bench`)."""

import shutil
from typing import Any

import numpy as np
import pytest

from benchmarks.alternatives import python_alternatives
from benchmarks.batch import batch_costs, side_by_side_laws
from benchmarks.c_program import TOLERANCE, agreement, build
from benchmarks.cases import CASES, Case, rivals
from benchmarks.engine import beside_c, growth
from benchmarks.side_by_side import side_by_side_costs
from podusv_cli.components.controllers.base import Controller
from podusv_cli.core.registry import kinds

benchmark = pytest.mark.benchmark
COMPILERS = ("cc", "gcc", "clang")  # as `c_program` takes them
needs_cc = pytest.mark.skipif(not any(map(shutil.which, COMPILERS)), reason="needs a C compiler")
ROUNDS = 9
every_case = pytest.mark.parametrize("case", CASES, ids=[case.label for case in CASES])


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    return build(tmp_path_factory.mktemp("c"))


@pytest.fixture(scope="module")
def level(programs):
    def measured(case: Case) -> dict[str, float]:
        ratios: dict[str, Any] = beside_c(programs, case, ROUNDS)["ratios"]
        return {name: middle for name, (_, middle, _) in ratios.items()}

    return measured


@needs_cc
@pytest.mark.long
@every_case
def test_podusv_and_c_agree(programs, case):
    assert max(agreement(programs, case).values()) <= TOLERANCE


@benchmark
@every_case
def test_a_run_takes_less_time_than_in_plain_c(level, case):
    ratios = level(case)
    assert ratios["podusv / C -O3"] < 1.0
    assert ratios["podusv with metrics / C -O3"] < 1.0


@benchmark
@pytest.mark.parametrize("law", ["adaptive_neural", "dsc", "full_backstepping", "pid"])
def test_a_run_of_the_usual_size(level, law):
    ratios = level(Case(law, "" if law == "pid" else "27 grid"))
    assert ratios["podusv / C -O3"] <= 0.8
    # Level with C that may reorder sums and vectorise its exponentials, to within the scatter.
    assert ratios["podusv / C -Ofast"] <= 1.1


@benchmark
def test_the_cost_of_a_step_does_not_depend_on_how_many_there_are():
    seconds = {int(n): low for n, (low, _, _) in growth()["steps"].items()}
    assert seconds[100_000] <= 1.1 * seconds[10_000]
    # Less would mean that the clock does not count the thread in which the march computes.
    assert seconds[100_000] >= 0.5 * seconds[10_000]


@benchmark
def test_many_runs_cost_what_their_steps_cost():
    whole = batch_costs()["31000"]
    assert whole["processor cost"][1] <= 1.05
    # Other programs take cores away; they do not give any.
    assert whole["cost"][0] <= 1.05


@benchmark
def test_a_run_side_by_side_takes_less_than_a_third_of_the_usual_time():
    found = side_by_side_laws(3)
    whole = [law["ratio"][1] for label, law in found.items() if label.endswith("; 31000")]
    usual, many_nodes = whole[:4], whole[4:]
    assert max(usual) <= 0.33
    assert max(many_nodes) <= 0.5


@benchmark
def test_runs_side_by_side_beside_plain_c_that_marches_so():
    relative = side_by_side_costs(3)["ratios"]  # raises where results differ
    assert max(median for _, median, _ in relative.values()) <= 2.0


@benchmark
def test_python_alternatives_are_slower_at_the_same_accuracy():
    times = python_alternatives()["per_simulated_s"]
    middle = {name: quartiles[1] for name, quartiles in times.items()}
    assert np.isfinite(list(middle.values())).all()
    assert middle["solve_ivp"] >= 5 * middle["podusv"]
    assert middle["numpy"] >= 20 * middle["podusv"]


def test_every_law_is_timed_or_known_not_to_be():
    """Manoeuvres of trials and a schedule need few operations; the others have tasks of their own,
    read a file, or are made of laws that are timed.
    """
    trials = {"schedule", "stopping", "turning_circle", "zigzag", "maneuvering"}
    poses = {"pose_backstepping", "pose_pid", "pose_sliding_mode"}
    others = {"ardupilot", "cascade", "los_backstepping", "mss", "policy", "px4"}
    known = {*kinds("podusv_cli.components.controllers", Controller)}
    timed = {loop.controller.kind for loop in rivals().values()}
    assert known - timed == trials | poses | others
