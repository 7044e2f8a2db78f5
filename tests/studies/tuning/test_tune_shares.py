"""Units that wait at once share a process and a march, with the bits and faults of each alone."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from podusv_cli.scenario.load import load
from podusv_cli.studies.counting.runs import Unit, UnitResult
from podusv_cli.studies.making import dispatch
from podusv_cli.studies.making.unit import alike, make, make_together
from podusv_cli.studies.tuning.check import tune_faults
from podusv_cli.studies.tuning.plan import TunePlan

SMALL = Path(__file__).parents[3] / "configs/studies/tune_small.yaml"


def searched(gains, count):
    """So many draws of full backstepping with these gains."""
    changes = ["simulation.duration=3.07", "sweep.laws=[full_backstepping]"]
    plan = TunePlan(load(SMALL, changes, [tune_faults]).scenario)
    return plan.variant({"law": ("full_backstepping", gains)}, "train", count), Unit(
        "law", 0, 0, count
    )


def test_units_of_other_gains_have_together_the_bits_that_each_has_alone():
    """A standoff of its own, gains that diverge, counts that fill no eight."""
    parts = [
        searched({"standoff": 0.31}, 2),
        searched({"k_ue": 1e308, "k_re": 1e308}, 3),
        searched({"standoff": 1.7, "k_ze": 0.013}, 6),
    ]
    assert len({alike(part) for part in parts}) == 1
    together = make_together(parts)
    for part, result in zip(parts, together, strict=True):
        alone = make(*part)
        assert result.unit == part[1]
        assert (result.causes, result.status.tolist()) == (alone.causes, alone.status.tolist())
        for name, values in alone.metrics.items():
            np.testing.assert_array_equal(result.metrics[name], values, name)
        np.testing.assert_array_equal(result.until, alone.until)
    errors = [result.metrics["e_steady"] for result in together]
    assert [np.isnan(of_unit).any() for of_unit in errors] == [False, True, False]
    assert len(np.unique(np.concatenate([errors[0], errors[2]]))) == 8


def test_gains_that_are_words_part_units():
    """A law with another word may have another structure."""
    with_word = [(searched({"anti_windup": word}, 2)) for word in ("none", "auxiliary")]
    assert len({alike(part) for part in with_word}) == 2


def test_a_number_that_changes_the_structure_makes_no_run_invalid():
    """Without `hold_below` full backstepping takes no samples."""
    parts = [searched({"hold_below": distance}, 2) for distance in (0.0, 0.2)]
    assert len({alike(part) for part in parts}) == 1
    for part, result in zip(parts, make_together(parts), strict=True):
        alone = make(*part)
        assert (result.causes, result.status.tolist()) == (alone.causes, alone.status.tolist())
        assert result.metrics["e_steady"].tolist() == alone.metrics["e_steady"].tolist()


class Waiting:
    """So many units of two runs, all of which wait."""

    def __init__(self, count):
        self.left = list(range(count))

    def __iter__(self):
        return self

    def __next__(self):
        if not self.left:
            raise StopIteration
        number = self.left.pop(0)
        return number, None, Unit("law", 0, number, 2)

    def __length_hint__(self):
        return len(self.left)


def faked(monkeypatch, bad=()):
    """What is made together, by process; a process that makes a bad unit is killed."""

    def make_together(parts):
        if any(unit.first in bad for _, unit in parts):
            os.kill(os.getpid(), signal.SIGKILL)
        each = np.full(2, float(os.getpid()))
        return [UnitResult(unit, {"process": each}, each, each, ("", "")) for _, unit in parts]

    monkeypatch.setattr(dispatch, "alike", lambda part: "")
    monkeypatch.setattr(dispatch, "make_together", make_together)


def test_units_that_wait_are_shared_out_among_the_processes(monkeypatch):
    faked(monkeypatch)
    made = {}
    assert dispatch.Processes(3)(Waiting(7), made.__setitem__)
    by = [made[number].result[0].metrics["process"][0] for number in range(7)]
    assert len(set(by)) >= 3  # of 7 that wait a process of three takes at most 3
    assert max(by.count(process) for process in set(by)) == 3


@pytest.mark.long
def test_a_unit_that_kills_its_process_takes_no_other_with_it(monkeypatch):
    faked(monkeypatch, bad={4})
    made = {}
    assert dispatch.Processes(2)(Waiting(9), made.__setitem__)
    assert sorted(made) == list(range(9))
    assert [number for number, outcome in made.items() if outcome.killed] == [4]
    assert all(made[number].result[0].unit.first == number for number in range(9) if number != 4)
