"""Everything that the author of a component imports, in one place.

    from podusv_cli.plugin import Controller, Signal, Vector, kernel, value, wrap

Modules inside podusv may move; these names stay. What figures need is imported when it is asked
for, since matplotlib is slow to import.
"""

from __future__ import annotations

import warnings
from typing import Any

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.components.controllers.base import Approach, Controller, Most, Slots
from podusv_cli.components.controllers.velocity_loop import Axis, Loop
from podusv_cli.components.disturbances.base import Disturbance
from podusv_cli.components.estimators.base import Estimator
from podusv_cli.components.measurements.base import FRESH, VALUE, Measurement
from podusv_cli.components.measurements.sensors import MEASURED
from podusv_cli.components.paths.base import Path
from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.component import value
from podusv_cli.core.elementary import cos_sin
from podusv_cli.core.finding import warn_after_run, warn_before_run
from podusv_cli.core.kernel import Vector, kernel, tail
from podusv_cli.core.kinematics import direction, wrap
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import Signal
from podusv_cli.metrics.metric import Accumulator, Metric, add, gathered, ratio

FIGURES = {
    "figure": "sheet",
    "signals_over_time": "panels",
    "Shown": "shown",
    "axis_label": "shown",
    "legend": "style",
    "new_figure": "style",
}
RENAMED = {"before": "warn_before_run", "after": "warn_after_run"}

__all__ = [
    "FRESH",
    "MEASURED",
    "VALUE",
    "Accumulator",
    "Actuator",
    "Approach",
    "Axis",
    "Controller",
    "Disturbance",
    "Estimator",
    "Loop",
    "Measurement",
    "Metric",
    "Most",
    "Path",
    "Recording",
    "Signal",
    "Slots",
    "Vector",
    "Vessel",
    "add",
    "cos_sin",
    "direction",
    "gathered",
    "kernel",
    "ratio",
    "tail",
    "value",
    "warn_after_run",
    "warn_before_run",
    "wrap",
]


def __getattr__(name: str) -> Any:
    """What was renamed, with a warning, and what draws, imported late as matplotlib is slow."""
    from importlib import import_module

    if name in RENAMED:
        text = f"podusv_cli.plugin.{name} is called {RENAMED[name]} now"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return globals()[RENAMED[name]]
    if name not in FIGURES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"podusv_cli.figures.{FIGURES[name]}"), name)
