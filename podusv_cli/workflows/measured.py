"""A log of a boat as an argument of `podusv compare`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from podusv_cli.comparison.measured import PLANE, Track
from podusv_cli.core.earth import Plane
from podusv_cli.core.errors import UsageError
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import STATE
from podusv_cli.scenario.identify import Identify
from podusv_cli.scenario.named_files import YAML

PSI = STATE[2]
SELDOM = 0.05  # of the positions, that may lack a heading
NO_COMMON_PLACE = (
    "the log and the runs have no common place: its x and y count from its first fix, those of the "
    "runs from where `start` is; write `origin: {lat: ..., lon: ...}` of x = y = 0 into the "
    "scenario, or move the log: `--align place` to where the first run is at the first common "
    "instant, `--align start` its clock as well"
)
NO_HEADING = (
    "no column is called psi: positions alone are compared, headings have no number, and no hull "
    "is drawn; if a column has the heading, name it under identify.columns, as `podusv identify "
    "--columns LOG` proposes"
)


def is_log(path: Path) -> bool:
    """Whether an argument is a log, and neither a scenario nor a folder."""
    if path.suffix in ("", *YAML) or path.is_dir():
        return False
    from podusv_cli.identify.logs.formats import READERS  # h5py is slow to import

    return path.suffix.lower() in READERS


def track(
    path: Path,
    identify: Sequence[Identify],
    top_speed: float = math.inf,
    *,
    plane: Plane | None = None,
    aligned: str = "",
) -> Track:
    """The measured track of a log; the first of the sections `identify` names its columns.

    `plane` is that of the runs beside it, in which latitudes and longitudes are placed. A row
    stands where a position is new; all else is straight between its own values, and NaN before the
    first and after the last of them. `top_speed` [m/s] is that of the fastest boat beside it;
    `aligned` as in `Track`. Raises UsageError where the log has no positions, or has mistakes that
    its motion shows.
    """
    from podusv_cli.identify.logs.checks import check_log
    from podusv_cli.identify.logs.reading import NamedQuantities, delivered_each, table

    given = identify[0] if identify else Identify()
    named = NamedQuantities(given.columns, given.frame, plane)
    log = table(path, STATE, named)
    if lacking := [name for name in PLANE if name not in log.columns]:
        raise UsageError(
            f"{path}: the log has no column for {', '.join(lacking)}; call its columns time, x, y "
            "(or lat, lon), psi, with other units than s, m, rad in brackets; "
            f"`podusv identify --columns {path}` proposes lines for identify.columns of a scenario"
        )
    new = delivered_each(log.columns)
    # A logger repeats a position until the next fix; only fixes count.
    rows = new["x"] & new["y"]
    if np.count_nonzero(rows) < 2:
        raise UsageError(f"{path}: has fewer than two positions, which is no track")
    lines = [*log.warnings, *check_log(log, top_speed=top_speed)]
    if log.from_fix and not aligned:
        lines.append(NO_COMMON_PLACE)
    signals = {
        signal.name: _at(log.times[rows], log.times, log.columns[signal.name], turns=signal == PSI)
        for signal in STATE
        if np.isfinite(log.columns.get(signal.name, np.nan)).any()
    }
    lines += _without_heading(log.times[rows], signals.get(PSI.name))
    own = Track(path, log.times[rows], signals, aligned=aligned)
    prefix = f"{log.name}: "
    return replace(own, remarks=tuple(own.remark(line.removeprefix(prefix)) for line in lines))


def _at(at: Vector, times: Vector, values: Vector, *, turns: bool) -> Vector:
    """A quantity at the times `at` (n,) [s]; NaN before its first value and after its last one.

    Its `values` (m,) are of `times` (m,) [s]; an angle (`turns`) goes the shorter way round.
    """
    known = np.isfinite(values)
    whole = np.unwrap(values[known]) if turns else values[known]
    return np.interp(at, times[known], whole, left=np.nan, right=np.nan)


def _without_heading(times: Vector, psi: Vector | None) -> Iterator[str]:
    """A sentence on a log whose heading `psi` (n,) is missing or covers few of its positions."""
    if psi is None:
        yield NO_HEADING
        return
    known = np.isfinite(psi)
    if np.mean(~known) > SELDOM:
        where = "at no position"
        if known.any():
            where = f"from {times[known][0]:.10g} to {times[known][-1]:.10g} s alone"
        yield (
            f"psi has values {where}, while its positions go from {times[0]:.10g} to "
            f"{times[-1]:.10g} s; headings are compared where psi has values"
        )
