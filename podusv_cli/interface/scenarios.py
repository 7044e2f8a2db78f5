"""Scenarios from files, from dictionaries, and from other scenarios."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from podusv_cli.core.component import Component
from podusv_cli.core.errors import UsageError
from podusv_cli.findings.finding import unknown_codes
from podusv_cli.interface.border import user_level
from podusv_cli.scenario import model, plugins
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import Check, Loaded, Plugged, load_text
from podusv_cli.scenario.load import load as load_file
from podusv_cli.scenario.resolved import yaml_text

Changes = Mapping[str, Any]
Source = str | os.PathLike[str] | Mapping[str, Any] | model.Scenario
IN_PYTHON = "scenario"  # what messages call a dictionary, and the name of its results


def Scenario(sections: Mapping[str, Any] | None = None, /, **more: Any) -> model.Scenario:
    """A scenario from its sections: vessel, path, disturbance, actuator, controller, ...

    Takes them as a dictionary or by keyword: as short as in YAML, with presets, `extends` and
    defaults. `podusv explain` on the command line tells every key, unit, range and default. The
    scenario is a value that does not change; `load(scenario, {...})` makes another one. Raises
    ScenarioError with every fault.

    >>> import podusv
    >>> scenario = podusv.Scenario(
    ...     vessel={"preset": "paper_nonlinear", "m": 25.0},
    ...     path={"kind": "line", "speed": 0.5},
    ...     disturbance={"kind": "none"},
    ...     actuator={"kind": "ideal"},
    ...     controller={"kind": "pid", "K_Pu": 40.0},
    ...     simulation={"duration": 20.0},
    ... )
    >>> scenario.vessel.m, scenario.vessel.length, scenario.controller.kind
    (25.0, 1.255, 'pid')
    >>> podusv.Scenario({"extends": "podusv:mu_2017/corrected.yaml", "vessel": {"lenght": 2}})
    Traceback (most recent call last):
    podusv_cli.core.errors.ScenarioError: scenario: vessel.lenght: unknown key; did you mean ...
    """
    return load_scenario({**(sections or {}), **more}).scenario


def load(source: Source, changes: Changes | None = None, *, trust: bool = False) -> model.Scenario:
    """The scenario of a file, a dictionary or another scenario, with some values changed.

    `source` may name a scenario of podusv (`podusv:mu_2017/corrected.yaml`). `changes` are what
    `--set` is on the command line: dotted keys and values. A vessel that is changed without
    `nominal` is also the one that the controller is told about, unless `source` is a scenario: that
    has a `nominal` of its own. `trust` executes plug-in files that a file names in the folder of a
    run, study or search, which anybody may have made. Raises ScenarioError with every fault.

    >>> import podusv
    >>> scenario = podusv.load("podusv:mu_2017/corrected.yaml", {"controller.k_ze": 0.2})
    >>> scenario.controller.k_ze, scenario.actuator.surge_limit
    (0.2, 8.0)
    >>> podusv.load(scenario, {"path": {"kind": "circle", "radius": 20.0}}).path.radius
    20.0
    """
    return load_scenario(source, changes, trust=trust).scenario


# Runs are read back here, and Python has no option that insists on larger ones.
CHECKS = (unknown_codes, limits(read_back=True, insist=""))


def load_scenario(
    source: Source,
    changes: Changes | None = None,
    checks: Sequence[Check] = CHECKS,
    *,
    silent: bool = False,
    trust: bool = False,
) -> Loaded:
    """A scenario with its text and the origin of each value, see `load`; `checks` are made of it.

    Unless it is `silent`, a UserWarning names values that a section loses with its kind. Raises
    ScenarioError.
    """
    result = _load_source(source, assignments(changes), checks, plugins.of_files(trust))
    if silent:
        return result
    return result.warn_of_remarks(
        lambda lost: warnings.warn(lost.removeprefix("warning: "), stacklevel=user_level())
    )


def assignments(changes: Changes | None) -> list[str]:
    """Changes as `--set` takes them. Raises UsageError for what is no mapping."""
    if not isinstance(changes, (Mapping, type(None))):
        raise UsageError(
            f"changes: found {changes!r}; give a dictionary of dotted keys and values, as in "
            '{"vessel.m": 24.0}'
        )
    return [f"{key}={_json(value)}" for key, value in (changes or {}).items()]


@singledispatch
def _load_source(
    source: Any, overrides: list[str], checks: Sequence[Check], plugged: Plugged
) -> Loaded:
    """Load a scenario's source: here a file; the functions below take other types."""
    return load_file(source, overrides, checks, plugged=plugged)


@_load_source.register
def _(
    source: model.Scenario, overrides: list[str], checks: Sequence[Check], plugged: Plugged
) -> Loaded:
    """Load a scenario in memory anew, from what it was given, with overrides and its plug-ins."""
    # `plugins` and an open choice's `controller` follow from the rest.
    derived = {plugins.KEY, *(["controller"] if source.open_choice else [])}
    sections = {key: part for key, part in source.as_given().items() if key not in derived}
    files = [plugin for plugin in source.plugged if plugin.text]  # as they were when it was loaded
    text = yaml_text(sections)
    return load_text(text, source.name, overrides, checks, files, plugged, placed=False)


@_load_source.register
def _(
    source: Mapping,  # type: ignore[type-arg]
    overrides: list[str],
    checks: Sequence[Check],
    plugged: Plugged,
) -> Loaded:
    """Load a mapping of sections as the same text in YAML, for the same checks and messages."""
    text = yaml_text(_plain(source))
    return load_text(text, IN_PYTHON, overrides, checks, plugged=plugged, placed=False)


def _json(value: Any) -> str:
    """A value as `--set` takes it; text in quotes, so that it stays text."""
    return json.dumps(_plain(value), ensure_ascii=False)


@singledispatch
def _plain(value: Any) -> Any:
    """A value as it stands in YAML. Raises UsageError for one that cannot."""
    raise UsageError(
        f"{IN_PYTHON}: a {type(value).__name__} cannot stand in a scenario; give numbers, texts, "
        "lists and dictionaries"
    )


@_plain.register(type(None))
@_plain.register(bool)
@_plain.register(int)
@_plain.register(float)
@_plain.register(str)
def _(value: Any) -> Any:
    return value


@_plain.register
def _(value: Path) -> str:
    return str(value)


@_plain.register(np.ndarray)
@_plain.register(np.generic)
def _(value: Any) -> Any:
    return _plain(value.tolist())


@_plain.register
def _(value: Component) -> Any:
    return _plain(value.model_dump())


@_plain.register(list)
@_plain.register(tuple)
def _(value: Any) -> Any:
    return tuple(_plain(item) for item in value)


@_plain.register
def _(value: Mapping) -> Any:  # type: ignore[type-arg]
    return {str(key): _plain(item) for key, item in value.items()}
