"""Numbers that change no run are no gains of a search."""

from __future__ import annotations

import os

import pytest
from small_study import TEXT
from tune_samples import planned

from podusv_cli.core.errors import PodusvError
from podusv_cli.scenario.load import load_text
from podusv_cli.studies.tuning import idle as module
from podusv_cli.studies.tuning.check import tune_faults
from podusv_cli.studies.tuning.idle import find_idle
from podusv_cli.studies.tuning.plan import TunePlan

TUNED = TEXT + "tune: {budget: 200, train: 4, validate: 10, space: {around: 10.0}}\n"


def idle(*changes):
    """The idle gains of the law pid."""
    changes = ["sweep.laws=[pid]", *changes]
    return find_idle(TunePlan(load_text(TUNED, "a.yaml", changes, [tune_faults]).scenario), 1)[
        "pid"
    ]


def test_a_number_that_no_kernel_reads_is_idle_and_the_others_are_gains(tmp_path):
    plan = planned(tmp_path)
    assert [gain.key for gain in plan.gains["toy"]] == ["gain", "other", "unread"]
    assert find_idle(plan, 1) == {"toy": ("unread",)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ((), ("omega_v",)),
        (("controllers.pid.standoff_reference=crab",), ()),
        (("tune.space.standoff_reference={choice: [line_of_sight, crab]}",), ()),
        (("tune.space.omega_v.keep=true",), ()),
    ],
)
def test_a_number_that_an_option_leaves_unread_is_idle(changes, found):
    assert idle(*changes) == found


def test_a_law_that_ends_its_process_has_no_idle_gains(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "make", lambda plan, unit: os._exit(1))
    assert find_idle(planned(tmp_path), 1) == {"toy": ()}


def test_an_error_of_a_run_is_not_taken_for_gains_that_all_matter(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "make", lambda plan, unit: 1 / 0)
    with pytest.raises(PodusvError, match="ZeroDivisionError"):
        find_idle(planned(tmp_path), 1)


def test_the_points_are_in_the_space_and_begin_with_the_scenario(tmp_path):
    plan = planned(tmp_path, "tune.space={gain: {log: [0.1, 10]}, other: {choice: [1.0, 2.0]}}")
    first, *others = module._points(plan, "toy")
    assert first == {"gain": 1.0, "other": 1.0}
    assert all(0.1 <= point["gain"] <= 10.0 for point in others)
    assert {point["other"] for point in others} == {1.0, 2.0}
    assert min(point["gain"] for point in others) < 1.0 < max(point["gain"] for point in others)
