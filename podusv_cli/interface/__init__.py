"""The Python interface: scenarios in, runs and tables out."""

from podusv_cli.core.errors import PodusvError
from podusv_cli.interface import functions, scenarios, session, studies
from podusv_cli.interface.border import explained
from podusv_cli.interface.hulls import IdentifiedHull
from podusv_cli.interface.results import Comparison, Run
from podusv_cli.interface.studies import Bench, Study, Tuning

Scenario, load = explained(scenarios.Scenario), explained(scenarios.load)
simulate, run = explained(functions.simulate), explained(functions.run)
open_run, compare = explained(functions.open_run), explained(functions.compare)
simulate_many, verify = explained(functions.simulate_many), explained(functions.verify)
optimum, open_session = explained(functions.optimum), explained(session.open_session)
sweep, open_study = explained(studies.sweep), explained(studies.open_study)
tune, bench = explained(studies.tune), explained(studies.bench)
doubt, identify = explained(functions.doubt), explained(functions.identify)

__all__ = [
    "Bench", "Comparison", "IdentifiedHull", "PodusvError", "Run", "Scenario", "Study", "Tuning",
    "bench", "compare", "doubt", "identify", "load", "open_run", "open_session", "open_study",
    "optimum", "run", "simulate", "simulate_many", "sweep", "tune", "verify",
]  # fmt: skip
