"""Scenario texts that the tests of configuration and commands start from."""

from collections.abc import Sequence
from pathlib import Path

from conftest import VESSELS

from podusv_cli.core.errors import ScenarioError
from podusv_cli.scenario.load import Loaded, load, load_text

VESSEL_NAMES = ", ".join([*VESSELS, "any FILE.yaml"])
SOUND = """\
vessel: {preset: paper}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: ideal}
controller: {kind: pid}
"""


def loaded(text: str = SOUND, overrides: Sequence[str] = ()) -> Loaded:
    """The text as the scenario `a.yaml`."""
    return load_text(text, "a.yaml", overrides)


def told(text: str = SOUND, overrides: Sequence[str] = ()) -> list[str]:
    """What is wrong with the text as the scenario `a.yaml`, a line each."""
    try:
        loaded(text, overrides)
    except ScenarioError as error:
        return str(error).splitlines()
    return []


def write(name: str, text: str) -> None:
    """A file with that text."""
    Path(name).write_text(text, encoding="utf-8")


def findings(name: str, *overrides: str) -> list[str]:
    """What is wrong with the scenario file, a line each."""
    try:
        load(name, overrides)
    except ScenarioError as error:
        return str(error).splitlines()
    return []
