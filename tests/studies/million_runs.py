"""Writes a study of a million made-up runs, then runs.h5, then its report; prints memory and time.

Each part is a process of its own: `python million_runs.py FOLDER units|runs|report`.
"""

import resource
import sys
import time
from pathlib import Path

import numpy as np

from podusv_cli.scenario.load import load, tree_yaml
from podusv_cli.studies.counting.runs import Unit, UnitResult
from podusv_cli.studies.making.plan import plan
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import SCENARIO, Store
from podusv_cli.workflows import studies, sweep

CONFIG = Path(__file__).parents[2] / "configs/studies/hull_and_sea.yaml"
NO_LOGS = ["sweep.keep.failed=0", "sweep.keep.worst.iae=0", "sweep.keep.draws=[]"]
DRAWS, SIZE = 250_000, 4096  # of each of four laws; of a unit


def units(folder: Path) -> None:
    """One in a hundred runs diverges."""
    loaded = load(CONFIG, [f"sweep.draws={DRAWS}", *NO_LOGS])
    store, chance = Store(folder, about(plan(loaded))), np.random.default_rng(1)
    store.open("now")
    (folder / SCENARIO).write_text(tree_yaml(loaded))
    for law in store.about.laws:
        for first in range(0, DRAWS, SIZE):
            n = min(SIZE, DRAWS - first)
            metrics = {name: chance.lognormal(0.0, 0.3, n) for name in store.about.measured}
            status = (chance.random(n) < 0.01).astype(np.uint8)
            causes = tuple("the state is not finite" if code else "" for code in status)
            until = np.full(n, 310.0)
            store.write(UnitResult(Unit(law, 0, first, n), metrics, status, until, causes))


def runs(folder: Path) -> None:
    studies.open_store(folder).write_runs()


def report(folder: Path) -> None:
    sweep.report(folder, sweep.Request())


if __name__ == "__main__":
    began = time.process_time()
    globals()[sys.argv[2]](Path(sys.argv[1]))
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(megabytes, time.process_time() - began)
