"""A measured track beside the runs of a comparison: as one of them, and how far they are off."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from podusv_cli.core.about import RunAbout
from podusv_cli.core.kernel import Vector
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import LOOP, STATE
from podusv_cli.metrics.measured import OF_LOG
from podusv_cli.storage.run_folder import FinishedRun, InMemory

POSE = tuple(signal.name for signal in STATE[:3])
TARGET = ("x_d", "y_d")
NO_LAW = "measured"


@dataclass(frozen=True)
class Track:
    """What a log measured: times [s], and x, y, psi at each; u, v, r where it has them.

    Times are those of the runs.
    """

    file: Path
    times: Vector
    signals: Mapping[str, Vector]

    def about(self, run: RunAbout) -> RunAbout:
        """What it says about itself beside a run: the same task, as long as it lasts, no law."""
        said = {**run.said, "controller": NO_LAW}
        return run.model_copy(
            update={
                "duration": float(self.times[-1]), "settings": (), "law": (), "said": said,
                "values": {**run.values, "controller": {"kind": NO_LAW}},
                "polar": False, "optimum_of": "",
            }
        )  # fmt: skip

    def beside(self, run: Recording) -> FinishedRun:
        """It as a run, with the target of another one."""
        signals = {"time": self.times, **self.signals}
        for name in TARGET:
            signals[name] = np.interp(self.times, run["time"], run[name])
        if "z_e" in run:
            signals["z_e"] = np.hypot(signals["x_d"] - signals["x"], signals["y_d"] - signals["y"])
        about = {signal.name: signal for signal in LOOP if signal.name in signals}
        log = Recording("finished", NO_LAW, signals, about=about)
        return InMemory(self.file, "finished", {}, {}, "", kept=log)

    def departures(self, run: Recording) -> dict[str, float]:
        """How far a run is from it where times agree, by metric; nothing where none do."""
        times = run["time"]
        rows = (self.times >= times[:1]) & (self.times <= times[-1:])
        if not rows.any():
            return {}
        x, y, psi = (
            np.interp(self.times[rows], times, run[name]) - self.signals[name][rows]
            for name in POSE
        )
        distances, turned = np.hypot(x, y), np.remainder(psi + math.pi, 2.0 * math.pi) - math.pi
        numbers = (np.sqrt(np.mean(distances**2)), distances.max(), np.sqrt(np.mean(turned**2)))
        return {metric.name: float(x) for metric, x in zip(OF_LOG, numbers, strict=True)}
