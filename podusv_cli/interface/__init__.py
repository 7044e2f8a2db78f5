"""The Python interface: scenarios in, runs and tables out."""

from podusv_cli.core.errors import PodusvError
from podusv_cli.interface import functions, scenarios, session, studies
from podusv_cli.interface.border import explained
from podusv_cli.interface.results import Comparison, Run
from podusv_cli.interface.studies import Bench, Study, Tuning

Scenario, load = explained(scenarios.Scenario), explained(scenarios.load)
simulate, run = explained(functions.simulate), explained(functions.run)
open_run, compare = explained(functions.open_run), explained(functions.compare)
simulate_many, verify = explained(functions.simulate_many), explained(functions.verify)
optimum, open_session = explained(functions.optimum), explained(session.open_session)
sweep, open_study = explained(studies.sweep), explained(studies.open_study)
tune, bench = explained(studies.tune), explained(studies.bench)
doubt = explained(functions.doubt)

__all__ = [
    "Bench", "Comparison", "PodusvError", "Run", "Scenario", "Study", "Tuning", "bench", "compare",
    "doubt", "load", "open_run", "open_session", "open_study", "optimum", "run", "simulate",
    "simulate_many", "sweep", "tune", "verify",
]  # fmt: skip
