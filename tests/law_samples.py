"""What tests of laws share: constant loads, a hull that is told wrong, the paper's task."""

from functools import lru_cache
from typing import Any

import numpy as np
from conftest import NONLINEAR, corrected, run

from podusv_cli.components.actuators.saturated import Saturated
from podusv_cli.components.disturbances.harmonic import Harmonic, HarmonicDisturbance
from podusv_cli.core.recording import Recording

MEAN = Harmonic(mean=0.5)
STEADY = HarmonicDisturbance(b_u=MEAN, b_v=MEAN, b_r=MEAN)
WRONG = NONLINEAR.model_copy(update={"m": 20.0, "X_u": -1.5, "Y_vv": -20.0, "N_r": -1.0})


@lru_cache(maxsize=3)  # a recording takes up to 40 MB, which every process started after it copies
def task(law: Any, **options: Any) -> Recording:
    """The paper's task, corrected, within its limits."""
    return run(corrected(controller=law, actuator=Saturated()), 310.0, **options)


def rms(out: Recording, start: float, end: float = np.inf) -> float:
    """Of the distance to the target [m], between two times [s]."""
    return float(np.sqrt(np.mean(out["z_e"][(out["time"] >= start) & (out["time"] <= end)] ** 2)))
