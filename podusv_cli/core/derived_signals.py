"""Access to logged and derived signals of a recording, by name."""

from __future__ import annotations

from functools import cache

from podusv_cli.core import registry
from podusv_cli.core.derived import Derived
from podusv_cli.core.kernel import Vector
from podusv_cli.core.plugins import Plugins
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal


@cache
def derived_with(plugins: Plugins) -> dict[str, Derived]:
    """All derived signals by name, with those of these plug-ins; laws and theory declare them."""
    return {
        name: derived
        for package in ("podusv_cli.components.controllers", "podusv_cli.theory")
        for name, derived in registry.find_by_name(package, Derived, plugins).items()
    }


def has(log: Recording, name: str, plugins: Plugins = ()) -> bool:
    """Whether the log has the signal, or those that it is computed from."""
    known = derived_with(plugins)
    return name in log or (name in known and all(part in log for part in known[name].needs))


def signal(log: Recording, name: str, plugins: Plugins = ()) -> Vector:
    """A signal as logged, else computed; KeyError where neither is possible."""
    return log[name] if name in log else derived_with(plugins)[name].compute(log)


def about(log: Recording, name: str, plugins: Plugins = ()) -> Signal:
    """Name, unit and meaning of a logged or derived signal."""
    return log.about[name] if name in log else derived_with(plugins)[name].signal
