"""podusv: experiments with controllers for pod-propelled surface vessels.

`podusv docs python` has examples. The names in `__all__` come from `podusv_cli.interface`, which is
imported when the first of them is used.
"""

import sys

from podusv_cli import WITHOUT_DOCSTRINGS
from podusv_cli import __version__ as __version__

if sys.flags.optimize > 1:
    raise ImportError(WITHOUT_DOCSTRINGS)

__all__ = [
    "Bench",
    "Comparison",
    "IdentifiedHull",
    "PodusvError",
    "Run",
    "Scenario",
    "Study",
    "Tuning",
    "bench",
    "compare",
    "doubt",
    "identify",
    "load",
    "open_run",
    "open_session",
    "open_study",
    "optimum",
    "run",
    "simulate",
    "simulate_many",
    "sweep",
    "tune",
    "verify",
]


def __getattr__(name: str) -> object:
    """A public name, on first use; `__init__.pyi` tells type checkers what it is."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module  # so that the package imports nothing before

    return getattr(import_module("podusv_cli.interface"), name)


def __dir__() -> list[str]:
    """What an interpreter completes."""
    return sorted([*globals(), *__all__])
