"""A run is planned once: what follows from its loop is asked once, and handed down."""

from __future__ import annotations

from collections import Counter
from functools import wraps

import pytest

from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario
from podusv_cli.workflows.run import Request, run_loaded

ONCE = dict.fromkeys(
    ("plan", "closed_loop", "metrics_of", "about", "drive_with", "path", "measurement"), 1
)


@pytest.mark.parametrize(
    ("config", "controller", "of_law"),
    [
        ("podusv:fossen_2003/cybership2.yaml", "paper", 1),
        ("podusv:own_vessel.yaml", "", 3),  # two of them by the law itself, for its memory
        ("podusv:mu_2017/corrected.yaml", "", 3),  # which has the stability monitor
    ],
)
def test_a_run_plans_once(config, controller, of_law, tmp_path, monkeypatch):
    """From a scenario that is loaded to its folder: warnings, march, metrics, monitor, cost."""
    loaded, counts = load(config, ["simulation.duration=2"]), Counter()
    scenario = loaded.scenario.singles()[controller] if controller else loaded.scenario

    def count(owner, name, as_name):
        method = getattr(owner, name)

        @wraps(method)
        def counted(*given, **named):
            counts[as_name] += 1
            return method(*given, **named)

        monkeypatch.setattr(owner, name, counted)

    for owner, name in (
        (Scenario, "plan"), (Scenario, "closed_loop"), (Scenario, "metrics_of"),
        (ClosedLoop, "about"), (type(scenario.actuator), "drive_with"),
    ):  # fmt: skip
        count(owner, name, name)
    for part in ("path", "measurement"):
        count(type(getattr(scenario, part)), "constants_with", part)
    count(type(scenario.controller), "constants_with", "law")
    run_loaded(loaded, Request(out=tmp_path / "run", figures=False, controller=controller))
    assert counts == {**ONCE, "law": of_law}
