"""podusv: experiments with controllers for pod-propelled surface vessels.

`import podusv` has the names in `__all__`. They come from `podusv_cli.interface`, which is imported
when the first of them is used.
"""

__version__ = "0.1.0"
__all__ = [
    "Comparison", "Run", "Scenario", "compare", "load", "open_run", "run", "simulate",
    "simulate_many", "verify",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """A public name, on first use; `__init__.pyi` tells type checkers what it is."""
    if name not in __all__:
        raise AttributeError(f"module 'podusv' has no attribute {name!r}")
    from importlib import import_module  # which most commands do not need

    return getattr(import_module(f"{__name__}.interface"), name)


def __dir__() -> list[str]:
    """What an interpreter completes."""
    return sorted([*globals(), *__all__])
