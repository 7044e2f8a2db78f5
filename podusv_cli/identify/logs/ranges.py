"""What the values of a column can be: places on earth have a range, and sensors a word for none."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from podusv_cli.core.earth import LAT, LON, MOST
from podusv_cli.core.kernel import Vector
from podusv_cli.core.signal import Signal
from podusv_cli.identify.logs.contents import LogFault

Marks = npt.NDArray[np.bool_]
PLACES = {LAT.name: ("latitude", MOST[LAT.name]), LON.name: ("longitude", MOST[LON.name])}
SELDOM = 0.05  # of the values, that may be out of range
MINUTES = 100.0  # a degree, where degrees and minutes are written as one number
IN_MINUTES = (
    "is it in NMEA's degrees and minutes, ddmm.mmmm? Convert it to degrees: dd + mm.mmmm / 60"
)
FINE, COARSE = 1e-7, 1e-6  # deg, the units of positions that are integers
FEWEST = 1e3  # times the largest degrees, below which integers are in none of these
TURN = 360.0  # deg
PULSES = (800.0, 2200.0)  # us, of servos and speed controllers
TO_PULSES = "pwm: {rest: 1500, span: 400}"
NEARBY = 1.0  # deg, within which a log's track stays
APART = 0.2  # of the range of all other values, that one for "none" lies beyond them
# What sensors and buses write where they have no value: the largest numbers of 16 and 32 bits with
# usual scales, the heading 511 of AIS, and nines.
NONE = (
    *(65535.0 * scale for scale in (1.0, 0.1, 0.01, 1e-4)),
    *(32767.0 * scale for scale in (1.0, 0.1, 0.01, 1e-4)),
    *(-32768.0 * scale for scale in (1.0, 0.1, 0.01)),
    *(sign * (2.0**31 - 1.0) * scale for scale in (1.0, 1e-7) for sign in (1.0, -1.0)),
    4294967295.0,
    511.0,
    *(sign * nines for nines in (999.0, 9999.0, 99999.0) for sign in (1, -1)),
)


def without_none(values: Vector) -> tuple[Vector, str]:
    """The values, NaN for those that stand for none; and which these are, "" where there are none.

    Such a value is a number of `NONE` that is the largest or the least, clearly beyond all others.
    """
    words = []
    for most in (np.nanmax, np.nanmin):
        known = np.isfinite(values)
        value = float(most(values, initial=0.0, where=known))
        alike = values == value
        rest = values[known & ~alike]
        if not (np.isclose(value, NONE, rtol=1e-9, atol=0.0).any() and len(rest)):
            continue
        if abs(value - float(most(rest))) > APART * float(np.ptp(rest)):
            words.append(
                f"is {value:.10g} {_often(alike)}, which stands for no value and is left out"
            )
            values = np.where(alike, np.nan, values)
    return values, " and ".join(words)


def like_pulses(values: Vector) -> bool:
    """Whether there are values, and all but 0 are pulses [us], or hundredths of some."""
    known = values[np.isfinite(values) & (values != 0.0)]
    sized = [(known * scale > PULSES[0]) & (known * scale < PULSES[1]) for scale in (1.0, 100.0)]
    return bool(len(known)) and any(map(np.all, sized))


def pulses_alone(values: Vector, rest: float) -> tuple[Vector, str]:
    """Pulses [us], and which values are none: 0, which is taken for `rest`, and all out of range.

    `rest` is the pulse at which a thruster stands, as it does without any.
    """
    none = values == 0.0
    beyond = ((values < PULSES[0]) | (values > PULSES[1])) & ~none
    words = []
    if none.any():
        words.append(f"is 0 us {_often(none)}, which is no pulse and taken for rest")
    if beyond.any():
        first = float(values[beyond][0])
        words.append(f"is out of range {_often(beyond)}: {first:.10g} us, which is left out")
    return np.where(none, rest, np.where(beyond, np.nan, values)), " and ".join(words)


def _often(marks: Marks) -> str:
    return f"{marks.sum()} times" if marks.sum() > 1 else "once"


def on_earth(signal: Signal, values: Vector) -> tuple[Vector, str]:
    """Latitudes or longitudes [deg], and how many are left out since they are out of range.

    Raises LogFault, with a sentence that does not name the file, where it is no single damage.
    """
    word, most = PLACES[signal.name]
    if signal == LON:
        values = _west(values, most)
    beyond = np.abs(values) > most  # false for NaN
    if not beyond.any():
        return values, ""
    first = float(values[beyond][0])
    what = f"{word} {first:.10g} is beyond {most:g} deg"
    if beyond.sum() <= SELDOM * np.isfinite(values).sum():
        return np.where(
            beyond, np.nan, values
        ), f"is out of range {_often(beyond)}: {what}; it is left out"
    raise LogFault(f"{what}; {_reason(signal.name, values[np.isfinite(values)], most)}")


def _west(longitudes: Vector, most: float) -> Vector:
    """Longitudes less a turn where they are counted from 0 to 360 deg.

    A few beyond 180 deg are so where they are near the others, as on both sides of Greenwich.
    """
    west = (longitudes > most) & (longitudes <= TURN)
    others = longitudes[np.isfinite(longitudes) & ~west]
    if west.sum() <= SELDOM * np.isfinite(longitudes).sum() and len(others):
        west &= np.abs(longitudes - TURN - np.median(others)) < NEARBY
    return np.where(west, longitudes - TURN, longitudes)


def integers_of(lat: Vector, lon: Vector) -> bool:
    """Whether places are in 1e-7 deg for sure: integers that are beyond the earth in 1e-6 deg."""
    sizes = [np.abs(values[np.isfinite(values)]) for values in (lat, lon)]
    if not all(len(size) and np.all(size == np.round(size)) for size in sizes):
        return False
    limits = [most for _, most in PLACES.values()]
    largest = [float(size.max()) for size in sizes]
    return any(a > most / COARSE for a, most in zip(largest, limits, strict=True)) and all(
        a <= most / FINE for a, most in zip(largest, limits, strict=True)
    )


def may_be_minutes(degrees: Vector) -> bool:
    """Whether places may be NMEA's degrees and minutes as one number, ddmm.mmmm."""
    return bool(np.all(np.abs(degrees[np.isfinite(degrees)]) % MINUTES < 60.0))


def _reason(name: str, values: Vector, most: float) -> str:
    """What such numbers probably are, and what to write."""
    size = np.abs(values)
    if size.max() <= most * MINUTES + MINUTES and may_be_minutes(values):
        return IN_MINUTES
    if most * FEWEST < size.max() <= most / FINE and np.all(values == np.round(values)):
        unit, most_fine = "1e-7 deg", size.max() * FINE
        instead = f"; for {size.max() * COARSE:.6g} deg write 1e-6 deg instead"
        return (
            f'if it is in {unit} ({most_fine:.6g} deg), write {name}: "COLUMN [{unit}]" under '
            f'identify.columns, or "{name} [{unit}]" as the name of the column'
            f"{instead if size.max() <= most / COARSE else ''}"
        )
    return f"write degrees from {-most:g} to {most:g}"
