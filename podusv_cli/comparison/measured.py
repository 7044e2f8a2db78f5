"""A measured track beside the runs of a comparison: as one of them, and how far they are off."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from podusv_cli.core.about import RunAbout
from podusv_cli.core.finding import Finding
from podusv_cli.core.kernel import Vector
from podusv_cli.core.past_run import PastRun
from podusv_cli.core.recording import Recording
from podusv_cli.core.signal import LOOP, STATE
from podusv_cli.metrics.measured import (
    log_distance_max,
    log_distance_rms,
    log_heading_rms,
    log_instants,
)

POSE = tuple(signal.name for signal in STATE[:3])
PLANE = POSE[:2]
START, PLACE = "start", "place"  # ways to lay a log on a run: clock and place, or its place alone
TARGET = ("x_d", "y_d")
NO_LAW = "measured"
ABOUT_LOG = "measured-log"  # code of what is doubtful about it
FEWEST = 10  # common instants, below which a distance says nothing
APART, LEAST_APART = 10.0, 200.0  # extents, and m, beyond which a log is of another place
SCALED = 20.0  # times the mean speed of a run, that only another unit explains
Marks = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Track:
    """What a log measured: times [s], and x, y at each; psi, u, v, r where it has them.

    Times are those of the runs. `remarks` say what is doubtful about it. `aligned`: how it is to be
    laid on the first run, `START` or `PLACE`, "" for as it is; `shifted` is by how much its clock
    was moved for that [s].
    """

    file: Path
    times: Vector
    signals: Mapping[str, Vector]
    remarks: tuple[Finding, ...] = ()
    aligned: str = ""
    shifted: float = 0.0

    def common(self, begin: float, end: float) -> Marks:
        """Which of its times lie in a span [s]."""
        return (self.times >= begin) & (self.times <= end)

    def start_clock_at(self, begin: float) -> Track:
        """The track, its clock moved so that it begins at `begin` [s].

        A track that is not aligned by START stays as it is.
        """
        if self.aligned != START:
            return self
        shifted = begin - float(self.times[0])
        return replace(self, times=self.times - self.times[0] + begin, shifted=shifted)

    def place_beside(self, label: str, run: Recording) -> Track:
        """The track, moved so that its first common position is the run's at that time, if aligned.

        A remark says what was moved, and by how much. `label` names the run.
        """
        rows = np.flatnonzero(self.common(run["time"][0], run["time"][-1]))
        if not self.aligned or not len(rows):
            return self
        at = self.times[rows[0]]
        north, east = (
            float(np.interp(at, run["time"], run[name]) - self.signals[name][rows[0]])
            for name in PLANE
        )
        moved = {
            name: self.signals[name] + by for name, by in zip(PLANE, (north, east), strict=True)
        }
        clock = f"its clock by {self.shifted:+.14g} s, and " if self.aligned == START else ""
        text = (
            f"--align {self.aligned} moves {clock}x by {north:+.4g} m, y by {east:+.4g} m: its "
            f"position at {at:.4g} s of the runs is that of {label} then"
        )
        signals = {**self.signals, **moved}
        return replace(self, signals=signals, remarks=(*self.remarks, self.remark(text)))

    def about(self, run: RunAbout, counts_to: float = math.inf) -> RunAbout:
        """What the track says about itself beside a run.

        It has the run's task, its own duration, and no law. `counts_to` [s] is when the last of the
        runs beside it has done its path.
        """
        said = {**run.said, "controller": NO_LAW}
        return run.model_copy(
            update={
                "duration": float(self.times[-1]),
                "settings": (),
                "law": (),
                "said": said,
                "values": {**run.values, "controller": {"kind": NO_LAW}},
                "polar": False,
                "optimum_of": "",
                "path_steady": {},
                "path_end": {"time": counts_to} if math.isfinite(counts_to) else {},
            }
        )

    def beside(self, run: Recording, label: str, about: RunAbout) -> PastRun:
        """The track as a run, with the target of `run` at the track's own times.

        `about` is what the track says about itself.
        """
        signals = {"time": self.times, **self.signals}
        for name in TARGET:
            signals[name] = np.interp(self.times, run["time"], run[name])
        if "z_e" in run:
            signals["z_e"] = np.hypot(signals["x_d"] - signals["x"], signals["y_d"] - signals["y"])
        known = {signal.name: signal for signal in LOOP if signal.name in signals}
        log = Recording("finished", NO_LAW, signals, about=known)
        return PastRun(label, about, log, folder=self.file)

    def departures(self, run: Recording) -> dict[str, float]:
        """How far a run is from the track where times agree, by metric.

        Metrics need FEWEST such instants at least. Headings count where the track has one; they are
        NaN where it has fewer than FEWEST.
        """
        times = run["time"]
        rows = self.common(times[0], times[-1]) if len(times) else np.zeros(len(self.times), bool)
        count = int(np.count_nonzero(rows))
        if count < FEWEST:
            return {log_instants.name: float(count)}
        nothing = np.full(len(self.times), np.nan)
        x, y, psi = (
            np.interp(self.times[rows], times, run[name]) - self.signals.get(name, nothing)[rows]
            for name in POSE
        )
        # The heading error is taken to -pi to pi.
        distances, turned = np.hypot(x, y), np.remainder(psi + math.pi, 2.0 * math.pi) - math.pi
        turned = turned[np.isfinite(turned)]
        enough = len(turned) >= FEWEST
        return {
            log_distance_rms.name: math.sqrt(np.mean(distances**2)),
            log_distance_max.name: float(distances.max()),
            log_heading_rms.name: math.sqrt(np.mean(turned**2)) if enough else math.nan,
            log_instants.name: float(count),
        }

    def beside_run(self, label: str, run: Recording) -> list[Finding]:
        """Remarks where it is much faster or slower than a run, or far away from it."""
        return [*self._beside_speeds(label, run), *self._beside_place(label, run)]

    def _beside_place(self, label: str, run: Recording) -> list[Finding]:
        """A remark where the distance between both is large beside what either extends over."""
        # An aligned track was moved on purpose.
        if self.aligned or not len(run["time"]):
            return []
        own, other = (
            np.column_stack([signals[name] for name in PLANE])
            for signals in (self.signals, run.signals)
        )
        own = own[np.isfinite(own).all(axis=1)]
        apart = float(np.hypot(*(np.median(own, axis=0) - np.median(other, axis=0))))
        extent = max(float(np.ptp(points, axis=0).max()) for points in (own, other))
        if apart < max(APART * extent, LEAST_APART):
            return []
        text = (
            f"it lies {apart / 1000.0:.3g} km from {label}, and neither extends over more than "
            f"{extent:.3g} m; check `origin` of the scenario, or whether the log is of that place"
        )
        return [self.remark(text)]

    def _beside_speeds(self, label: str, run: Recording) -> list[Finding]:
        """A remark where the track is SCALED times faster or slower than a run.

        Then it may have other units. Empty otherwise.
        """
        own, other = _path(self.times, self.signals), _path(run["time"], run.signals)
        if not own or not other or 1.0 / SCALED < own / other < SCALED:
            return []
        text = (
            f"the track makes {own:.2g} m/s on average and {label} {other:.2g}; look at the units "
            "of time, x and y, which stand in brackets behind the names of columns"
        )
        return [self.remark(text)]

    def remark(self, text: str) -> Finding:
        """A sentence about it."""
        return Finding(ABOUT_LOG, str(self.file), text)


def _path(times: Vector, signals: Mapping[str, Vector]) -> float:
    """The length of a track over its duration [m/s]; 0 where it has none."""
    span = float(np.ptp(times)) if len(times) > 1 else 0.0
    steps = np.hypot(np.diff(signals["x"]), np.diff(signals["y"]))
    return float(steps.sum()) / span if span else 0.0
