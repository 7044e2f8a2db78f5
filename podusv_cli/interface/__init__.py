"""The Python interface: scenarios in, runs and tables out."""

from podusv_cli.interface.functions import compare, open_run, run, simulate, simulate_many, verify
from podusv_cli.interface.results import Comparison, Run
from podusv_cli.interface.scenarios import Scenario, load

__all__ = [
    "Comparison", "Run", "Scenario", "compare", "load", "open_run", "run", "simulate",
    "simulate_many", "verify",
]  # fmt: skip
