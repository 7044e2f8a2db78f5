"""What is wrong with a scenario's key `doubt`, found before anything is simulated."""

from __future__ import annotations

from collections.abc import Iterator

from podusv_cli.core.phrases import unknown_word
from podusv_cli.doubt.choices import by_key, with_loads
from podusv_cli.scenario.load import Loaded
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.yaml_tree import Route, bracketed_key

Faults = Iterator[tuple[Route, str]]
LISTED = "podusv explain"


def doubt_faults(loaded: Loaded) -> list[tuple[Route, str]]:
    """Steps of the key and message for everything that is wrong; nothing without the section."""
    scenario = loaded.scenario
    return [] if scenario.doubt is None else [*_faults_of_printed(scenario), *_vary(scenario)]


def _faults_of_printed(scenario: Scenario) -> Faults:
    """Keys in `doubt.printed` that the scenario has not."""
    assert scenario.doubt
    known = set(by_key(with_loads(scenario.singles())))
    # A section, or a list's entry, may be printed as a whole.
    sections = {key[:end] for key in known for end in range(len(key)) if key[end] in ".["}
    for place, key in enumerate(scenario.doubt.printed):
        if bracketed_key(key) not in known | sections:
            yield (
                ("doubt", "printed", place),
                unknown_word(f"key {key!r}", key, sorted(known), LISTED),
            )


def _vary(scenario: Scenario) -> Faults:
    """Keys in `doubt.vary` that cannot be moved.

    These are unknown keys, and rows where a study draws rows itself.
    """
    assert scenario.doubt
    known = by_key(with_loads(scenario.singles()))
    for name, quantity in scenario.doubt.vary.items():
        if quantity.rows and scenario.sweep and scenario.sweep.claims:
            text = (
                "a study draws rows itself: write this under sweep.vary, whose claims are judged "
                "here; single hulls to be tried belong under doubt.hulls"
            )
            yield ("doubt", "vary", name), text
            continue
        for key in quantity.targets(name):
            if bracketed_key(key) not in known:
                text = unknown_word(f"key {key!r}", key, sorted(known), LISTED)
                yield ("doubt", "vary", name), text
