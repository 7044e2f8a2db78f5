"""The Python interface: scenarios in, runs and tables out."""

from podusv_cli.core.errors import PodusvError
from podusv_cli.interface import functions, scenarios, session, studies
from podusv_cli.interface.border import with_short_traceback
from podusv_cli.interface.hulls import IdentifiedHull
from podusv_cli.interface.results import Comparison, Run
from podusv_cli.interface.studies import Bench, Study, Tuning

Scenario, load = with_short_traceback(scenarios.Scenario), with_short_traceback(scenarios.load)
simulate, run = with_short_traceback(functions.simulate), with_short_traceback(functions.run)
open_run, compare = (
    with_short_traceback(functions.open_run),
    with_short_traceback(functions.compare),
)
simulate_many, verify = (
    with_short_traceback(functions.simulate_many),
    with_short_traceback(functions.verify),
)
optimum, open_session = (
    with_short_traceback(functions.optimum),
    with_short_traceback(session.open_session),
)
sweep, open_study = with_short_traceback(studies.sweep), with_short_traceback(studies.open_study)
tune, bench = with_short_traceback(studies.tune), with_short_traceback(studies.bench)
doubt, identify = with_short_traceback(functions.doubt), with_short_traceback(functions.identify)

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
