"""Mistakes in a log that its motion shows before any hull is looked for.

Kinematics alone tell: a boat moves about where it points, its heading turns as its yaw rate says
(`heading_checks`), and its positions move on as its speeds say. What no motion could explain is an
error that says what to write; what is only unlikely is a warning.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from warnings import catch_warnings, simplefilter

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.units import PURE
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.heading_checks import FEWEST_BINS, OF_HEADINGS
from podusv_cli.identify.logs.motion import FAST, BinnedMotion
from podusv_cli.identify.logs.ranges import IN_MINUTES, TO_PULSES, like_pulses
from podusv_cli.identify.logs.reading import SENSED, UNITS, LogTable, delivered_each

SLOWEST = 5.0  # s between rows, with which no turn of a boat can be followed
NEAREST = 2e-3  # s between positions, below which no receiver is
FINER = {unit: UNITS["s"][unit] for unit in ("ms", "us", "ns")}
COARSER = ("h", "min")
STILL = 5e-4  # m/s: a boat at 50 m/s moves so in degrees, and no receiver in metres is so quiet
FAR = 10.0  # standard deviations of a track, that degrees are away from (0, 0)
SCALED = 20.0  # times a speed, that no error of a hull's numbers explains
TWICE = 2.0  # times the speed at full thrust, above which a track is doubted
FASTEST = 60.0  # m/s, which no boat makes
BRISK = 10.0  # m/s, twice which few boats make
QUIET = 0.1  # m, rad, m/s or rad/s: smaller steps are no jumps
GAP = 2.5  # usual distances of values: a step over more says nothing
OTHER_UNIT = 300.0  # times a speed, that no current explains
DEGREE = 111e3  # m, of latitude
NARROW = 0.5  # deg, within which a log's track stays
THRICE = 3.0  # times a speed, that two measures of it are apart
CALL_THEM = (
    'write lat: "COLUMN", lon: "COLUMN" under identify.columns, or call the columns lat and lon'
)
LOOK_AT_UNITS = (
    "look at the units of time, x and y, and name them in brackets, as in "
    'time: "COLUMN [ms]" under identify.columns'
)
SPIKE = 10.0  # times the largest of the usual steps: a jump
STEADY = 0.05  # of a speed, and in rad of a heading: standard deviations without a manoeuvre
BEYOND = 1.3  # of what an actuator can do


def check_log(
    table: LogTable, actuator: Actuator | None = None, top_speed: float = math.inf
) -> list[str]:
    """What is doubtful about a log, a sentence each. Raises LogFault where a mistake is certain.

    `actuator` is that of a log from which a hull is to be found, `top_speed` [m/s] that of the
    boat.
    """
    motion, lines = BinnedMotion(table, actuator, top_speed), list[str]()
    try:
        with np.errstate(invalid="ignore", divide="ignore"), catch_warnings():
            simplefilter("ignore", RuntimeWarning)  # of means over nothing, which are NaN
            headed = OF_HEADINGS if "psi" in table.columns else ()
            for check in (*(OF_FITS if actuator else ()), *OF_ALL, *headed):
                lines += check(motion)
    except LogFault as error:
        raise LogFault("; also, ".join((f"{table.name}: {error}", *lines))) from error
    return [f"{table.name}: {line}." for line in lines]


def _out_of_reach(motion: BinnedMotion) -> Iterator[str]:
    """Commands in another unit: by what the actuator can do."""
    assert motion.actuator
    reaches = motion.actuator.reach
    for signal in motion.actuator.replayed:
        values, reach = motion.table.columns.get(signal.name, np.zeros(1)), reaches.get(signal.name)
        most = float(np.nanmax(np.abs(values), initial=0.0))
        if reach is None or most <= BEYOND * reach:
            continue
        what = f"{signal.name} reaches {most:.4g} {signal.unit}, and the actuator {reach:.4g}"
        if signal.unit == PURE and like_pulses(values):
            raise LogFault(
                f"{what}; pulses of PWM are written as [us]: give each pod {TO_PULSES}, and write "
                'the quantity as "COLUMN [us]" under identify.columns'
            )
        units = [u for u, f in UNITS[signal.unit].items() if f < 1.0 and most * f <= BEYOND * reach]
        if units:
            forms = " or ".join(f'{signal.name}: "COLUMN [{unit}]"' for unit in units)
            raise LogFault(f"{what}; write {forms} under identify.columns")
        yield what


def _clock(motion: BinnedMotion) -> Iterator[str]:
    """Times in minutes or longer units: rows that are too near for a sensor of positions."""
    times = motion.table.times[np.isfinite(motion.table.columns["x"])]
    span = float(np.ptp(times)) if len(times) else 0.0
    rows = span / max(len(times) - 1, 1)
    if rows >= NEAREST:
        return
    forms = " or ".join(f'time: "COLUMN [{unit}]"' for unit in COARSER)
    raise LogFault(
        f"its positions are {rows:.2g} s apart, and the whole log lasts {span:.3g} s; if its times "
        f"are in hours or minutes, write {forms} under identify.columns"
    )
    yield


def _slow_rows(motion: BinnedMotion) -> Iterator[str]:
    """Times in milliseconds or finer: rows that are too far apart."""
    step = float(np.median(np.diff(motion.table.times)))
    if step >= SLOWEST:
        unit = next((u for u, f in FINER.items() if step * f < SLOWEST), "ns")
        raise LogFault(
            f"its rows are {step:g} s apart, too far to follow a turn; if "
            f'these are {unit}, write time: "COLUMN [{unit}]" under identify.columns'
        )
    yield from ()


def _places(motion: BinnedMotion) -> Iterator[str]:
    """Positions in degrees that are called x and y: they hardly move, far from (0, 0)."""
    x, y = (motion.table.columns[name] for name in ("x", "y"))
    apart = np.hypot(np.nanstd(x), np.nanstd(y))
    if not 0.0 < motion.fastest < STILL or np.hypot(np.nanmean(x), np.nanmean(y)) < FAR * apart:
        return
    what = (
        f"x and y move at {motion.fastest:.2g} m/s at most; if they are latitude and longitude in "
        f"degrees, {CALL_THEM}"
    )
    if "psi" not in motion.table.columns or np.nanstd(motion.heading()) > STEADY:
        raise LogFault(what)
    yield what


def _speeds_apart(motion: BinnedMotion) -> Iterator[str]:
    """Tracks that are hundreds of times slower or faster than the log's own speed."""
    speed = motion.own_speed
    if not (speed and motion.fastest) or 1.0 / OTHER_UNIT < motion.fastest / speed < OTHER_UNIT:
        return
    x, y = (motion.table.columns[name] for name in ("x", "y"))
    wide = max(float(np.nanmax(values) - np.nanmin(values)) for values in (x, y))
    ratio = motion.fastest / speed
    times = (unit for unit, f in UNITS["s"].items() if abs(math.log(ratio / f)) < math.log(THRICE))
    unit = next(times, "")
    hint = f'if its times are in {unit}, write time: "COLUMN [{unit}]" under identify.columns'
    if wide < NARROW and abs(math.log(ratio * DEGREE)) < math.log(SCALED):
        hint = f"x and y in degrees? Then {CALL_THEM}"
    elif not unit:
        hint = LOOK_AT_UNITS
    raise LogFault(f"its track makes {motion.fastest:.2g} m/s, while u is {speed:.3g} m/s; {hint}")
    yield


def _degrees_and_minutes(motion: BinnedMotion) -> Iterator[str]:
    """Latitude and longitude as ddmm.mmmm near the equator: a track that is 60 times as fast.

    Raises LogFault where no boat is so fast, or the log's own speed is another.
    """
    fast, speed = motion.fastest, motion.own_speed
    is_fast = fast > TWICE * (speed or min(motion.top_speed, BRISK))
    if not (motion.table.maybe_minutes and is_fast):
        return
    beside = f", and u is {speed:.3g} m/s" if speed else ""
    what = f"its track makes {fast:.3g} m/s by latitude and longitude{beside}; {IN_MINUTES}"
    if fast > FASTEST or (speed and fast > SCALED * speed):
        raise LogFault(what)
    yield what


def _speed_made_good(motion: BinnedMotion) -> Iterator[str]:
    """Tracks that are faster than the boat can be."""
    fast, top = motion.fastest, motion.top_speed
    what = f"its track makes {fast:.3g} m/s"
    if fast > min(FASTEST, SCALED * top):
        beside = f", and the boat {top:.3g} at full thrust" if math.isfinite(top) else ""
        raise LogFault(f"{what}{beside}; {LOOK_AT_UNITS}")
    if fast > TWICE * top:
        yield f"{what}, and the boat {top:.3g} at full thrust; look at the units of time, x and y"


def _empty(motion: BinnedMotion) -> Iterator[str]:
    """Columns without numbers."""
    for name, values in motion.table.columns.items():
        if not np.isfinite(values).any():
            yield f"{name} has no number at all"


def _constant(motion: BinnedMotion) -> Iterator[str]:
    """Columns that never change, and are not 0."""
    for name, values in motion.table.columns.items():
        known = values[np.isfinite(values)]
        if len(known) and np.ptp(known) == 0.0 and known[0] != 0.0:
            yield f"{name} is {known[0]:g} throughout"


def _jumps(motion: BinnedMotion) -> Iterator[str]:
    """Values that jump: of a receiver that finds itself elsewhere, or in a damaged cell."""
    new = delivered_each(motion.table.columns)
    for name in [name for name in motion.table.columns if name in SENSED]:
        rows = np.flatnonzero(new[name])
        values, times = motion.table.columns[name][rows], motion.table.times[rows]
        if len(rows) < FEWEST_BINS:
            continue
        steps, spans = np.diff(values), np.diff(times)
        steps = np.abs(np.angle(np.exp(1j * steps)) if name == "psi" else steps)
        usual = float(np.quantile(steps, FAST))
        jumps = np.flatnonzero(
            (steps > max(SPIKE * usual, QUIET)) & (spans < GAP * np.median(spans))
        )
        if len(jumps):
            first, several = jumps[0], "" if len(jumps) == 1 else f" {len(jumps)} times, first"
            yield (
                f"{name} jumps{several} by {steps[first]:.4g} at {times[first + 1]:.10g} s, while "
                f"{100.0 * FAST:g} % of its steps are below {usual:.3g}; that is taken for motion, "
                "so leave such cells empty, or leave out what is around them, with spans"
            )


def _manoeuvres(motion: BinnedMotion) -> Iterator[str]:
    """Logs without excitation."""
    fast = np.abs(motion.velocity)[motion.moving]
    turned = np.nanstd(motion.heading())
    if turned < STEADY and len(fast) and np.nanstd(fast) < STEADY * np.nanmean(fast):
        yield (
            f"its heading stays within {math.degrees(2.0 * turned):.1f} deg and its speed within "
            f"{200.0 * np.nanstd(fast) / np.nanmean(fast):.0f} %, which determines the drag at one "
            "speed and little else; zig-zags, turning circles and stops determine more"
        )


def _idle(motion: BinnedMotion) -> Iterator[str]:
    """Logs in which nothing was commanded."""
    columns = motion.table.columns
    assert motion.actuator
    given = [columns[s.name] for s in motion.actuator.replayed if s.name in columns]
    if not any(np.any(np.abs(values) > 0.0) for values in given):
        yield (
            "its commands are 0 throughout, so the boat lay still or drifted, which says next to "
            "nothing of the hull; keep the log for judging, or leave it out"
        )


Check = Callable[[BinnedMotion], Iterator[str]]
# Of every log, and of those that a hull is to be found from.
OF_ALL: tuple[Check, ...] = (
    _jumps,
    _clock,
    _places,
    _degrees_and_minutes,
    _speeds_apart,
    _speed_made_good,
    _empty,
)
OF_FITS: tuple[Check, ...] = (_slow_rows, _out_of_reach, _constant, _idle, _manoeuvres)
