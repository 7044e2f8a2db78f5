"""Access to logged and derived signals of a recording, by name."""

from __future__ import annotations

from podusv_cli.core import registry
from podusv_cli.core.derived import Derived
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal

DERIVED: dict[str, Derived] = {
    name: derived
    for package in ("podusv_cli.controllers", "podusv_cli.theory")
    for name, derived in registry.named(package, Derived).items()
}


def has(log: Recording, name: str) -> bool:
    """Whether the log has the signal, or those that it is computed from."""
    if name in log:
        return True
    return name in DERIVED and all(part in log for part in DERIVED[name].needs)


def signal(log: Recording, name: str) -> Vector:
    """A signal as logged, else computed; KeyError where neither is possible."""
    return log[name] if name in log else DERIVED[name].compute(log)


def about(log: Recording, name: str) -> Signal:
    """Name, unit and meaning of a logged or derived signal."""
    return log.about[name] if name in log else DERIVED[name].signal
