"""How often a command builds what only a simulation needs."""

from collections import Counter

import pytest

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.engine.loop.closed_loop import ClosedLoop
from podusv_cli.scenario.model import Scenario

COUNTED = ((ClosedLoop, "__init__"), (Vessel, "constants"), (Scenario, "in_numbers"))


def loop_counts(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Calls in this process from here on, by the class whose method it is."""
    calls = Counter[str]()

    def count(owner: type, name: str) -> None:
        real = getattr(owner, name)

        def counted(*given, **named):
            calls[owner.__name__] += 1
            return real(*given, **named)

        monkeypatch.setattr(owner, name, counted)

    for owner, name in COUNTED:
        count(owner, name)
    return calls
