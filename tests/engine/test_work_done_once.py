"""What would give the same answer again is asked once: counts of what commands do."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from identify_samples import made_logs, problem

import podusv
from podusv_cli.identify.fit import problem as fitting
from podusv_cli.interface import scenarios
from podusv_cli.scenario import load as loading
from podusv_cli.scenario.model import Scenario

SCANS = """
import json, pkgutil, sys
from collections import Counter

scans, iter_modules = Counter(), pkgutil.iter_modules

def counting(path=None, prefix=""):
    scans[prefix] += 1
    return iter_modules(path, prefix)

pkgutil.iter_modules = counting
import podusv_cli.cli
sys.argv = ["podusv", "run", "podusv:mu_2017/corrected.yaml", "--no-figures", "--out", "out", "-q"]
try:
    podusv_cli.cli.main()
finally:
    print(json.dumps({k: n for k, n in scans.items() if k.startswith("podusv_cli.")}))
"""
STUDY = {
    "simulation.duration": 2.0,
    "sweep": {
        "draws": 16,
        "seed": 3,
        "vary": {
            "vessel.m": {"uniform": [50.0, 70.0]},
            "vessel.I_z": {"times": {"uniform": [0.9, 1.1]}},
            "start.x": {"plus": {"uniform": [-0.3, 0.3]}},
            "start.psi": {"angle": "all"},
        },
    },
}


@pytest.fixture
def calls(monkeypatch):
    """How often these were called, by name."""
    counts: Counter[str] = Counter()

    def count(owner, name):
        function = getattr(owner, name)

        def counted(*given, **named):
            counts[name] += 1
            return function(*given, **named)

        monkeypatch.setattr(owner, name, counted)

    count(Scenario, "closed_loop")
    count(loading, "load_text")  # of files
    count(scenarios, "load_text")  # of what is given in Python
    count(fitting, "values_at")
    return counts


@pytest.mark.long
def test_a_package_is_scanned_once_a_process(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", SCANS], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    scans = json.loads(done.stdout.splitlines()[-1])
    assert len(scans) > 5
    assert set(scans.values()) == {1}


def test_the_loops_of_a_study_do_not_grow_with_what_it_draws(calls, tmp_path):
    """The values of all quantities are tried together: six rounds a law, not three a quantity."""
    study = podusv.sweep("podusv:own_vessel.yaml", STUDY, out=tmp_path / "study", figures=False)
    assert len(study.table) == 16
    assert calls["closed_loop"] <= 9


def test_the_numbers_of_a_point_are_worked_out_once_for_all_logs(calls):
    given = problem(made_logs())
    points = [np.full(len(given.numbers), share) for share in (0.0, 0.1, 0.2)]
    calls.clear()
    given.innovations(points)
    assert calls["values_at"] == len(points)


def test_a_session_reads_a_scenario_as_text_when_it_opens_and_when_it_closes(calls, tmp_path):
    session = podusv.open_session(
        "podusv:own_vessel.yaml", {"simulation.duration": 2.0}, period=0.1
    )
    assert (calls["load_text"], calls["closed_loop"]) == (1, 2)
    while session.status == "running":
        session.step((1.0, 0.0))
    assert (calls["load_text"], calls["closed_loop"]) == (1, 2)
    session.close(tmp_path / "run", figures=False)
    assert (calls["load_text"], calls["closed_loop"]) == (2, 3)
