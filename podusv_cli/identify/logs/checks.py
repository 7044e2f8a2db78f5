"""Mistakes in a log that its motion shows before any hull is looked for.

Kinematics alone tell: a boat moves about where it points, its heading turns as its yaw rate says,
and its positions move on as its speeds say. What no motion could explain is an error that says what
to write; what is only unlikely is a warning.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple
from warnings import catch_warnings, simplefilter

import numpy as np

from podusv_cli.components.actuators.base import Actuator
from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.motion import DEGREES, FAST, RADIANS, BinnedMotion
from podusv_cli.identify.logs.ranges import IN_MINUTES
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
HEADING_IN_DEGREES = (
    'if so, write psi: "COLUMN [deg]" under identify.columns, or "psi [deg]" as the name of the '
    "column"
)
LOOK_AT_UNITS = (
    "look at the units of time, x and y, and name them in brackets, as in "
    'time: "COLUMN [ms]" under identify.columns'
)
SPIKE = 10.0  # times the largest of the usual steps: a jump
FEWEST_BINS = 10
ALIKE = 0.9  # correlation or agreement, from which on two quantities are the same one
SURE = 25.0  # courses times a squared agreement: e to the minus this is its chance without cause
UNLIKE = 0.005  # of 1, that an agreement lacks in a log with turns
BETTER = 0.3  # of what it lacks, that another reading of the heading may lack at most
ABEAM = 0.2  # of an agreement, within which a mean angle means something
NEAR = math.log(1.1)  # of a ratio, that counts as the ratio of two units
ODD = math.log(1.4)  # of a ratio, that no unit explains and no sensor has
ASIDE = 60.0  # deg, a mean angle between course and heading
CENTI = 100.0  # a degree, where headings are integers
HALF = 0.5  # of a motion, less than which a heading explains where it is wrong
LOUD = 4.0  # times the noise of velocities, from which on what is left is motion
TURN_AND_MORE = 7.0  # rad, with which no heading in radians begins
TINY = 1e-30  # beside a sum of squares
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


def _compass(motion: BinnedMotion) -> Iterator[str]:
    """A heading that stands while the boat turns."""
    known = motion.table.columns["psi"][np.isfinite(motion.table.columns["psi"])]
    straight = abs(np.nanmean(np.exp(1j * np.angle(motion.velocity)))) >= ALIKE
    if np.ptp(known) == 0.0 and not straight:
        raise LogFault(
            f"psi is {known[0]:g} throughout while the track turns; its sensor stood still, or "
            "identify.columns names another column"
        )
    yield from ()


def _constant(motion: BinnedMotion) -> Iterator[str]:
    """Columns that never change, and are not 0."""
    for name, values in motion.table.columns.items():
        known = values[np.isfinite(values)]
        if len(known) and np.ptp(known) == 0.0 and known[0] != 0.0:
            yield f"{name} is {known[0]:g} throughout"


# Full turns in the log's own numbers: what to write of psi, and which mistake that is.
TURNS = {
    RADIANS: ("COLUMN", ""),
    DEGREES: ("COLUMN [deg]", "psi is in degrees"),
    CENTI * DEGREES: ("COLUMN [1e-2 deg]", "psi is in hundredths of a degree"),
    math.radians(RADIANS): ("COLUMN [rad]", "psi is in radians and not in degrees"),
    math.radians(CENTI * DEGREES): (
        "COLUMN [1e-2 deg]",
        "psi is in hundredths of a degree and not in degrees",
    ),
}


@dataclass(frozen=True)
class Reading:
    """A way to read headings: how much a full turn is, and whether it is counted to port.

    `mean` is the mean of exp(i (course - heading)): of size 1 where both turn together.
    """

    turn: float
    sign: float
    mean: complex

    @property
    def words(self) -> str:
        """As a condition."""
        _, unit = TURNS[self.turn]
        counted = "psi or the position is counted the other way round" if self.sign < 0.0 else ""
        return " and ".join(filter(None, (unit, counted)))

    @property
    def remedy(self) -> str:
        """What to write."""
        column, _ = TURNS[self.turn]
        if self.sign > 0.0:
            return f'write psi: "{column}" under identify.columns'
        if abs(cmath.phase(self.mean)) < math.pi / 4.0:
            return f'psi is counted to port: write psi: "-{column}" under identify.columns'
        return (
            "x is east and y north, or psi is counted from the east: exchange x and y under "
            "identify.columns if psi is a compass's, or write identify.frame: enu if all is east, "
            f'north, up; psi: "{column}"'
        )


def _degrees(motion: BinnedMotion, own: Reading, degrees: Reading) -> Iterator[str]:
    """Headings in degrees of a boat that hardly turns: they are beyond a turn, or go through many.

    Raises LogFault where they begin beyond a turn, which headings in radians do not.
    """
    aside, nearer = (abs(cmath.phase(reading.mean)) for reading in (own, degrees))
    lack, less = (1.0 - abs(reading.mean) for reading in (own, degrees))
    if abs(degrees.mean) < ALIKE or not (nearer < 0.5 * aside or less < BETTER * lack):
        return
    psi = motion.table.columns["psi"]
    span = float(np.nanmax(psi) - np.nanmin(psi))
    what = (
        f"psi begins at {motion.first_heading:.4g} and goes through {span:.3g} rad; in degrees it "
        f"agrees with the course of the track; {HEADING_IN_DEGREES}"
    )
    if abs(motion.first_heading) > TURN_AND_MORE:
        raise LogFault(what)
    if abs(own.mean) < ALIKE:
        yield what


def _courses(motion: BinnedMotion) -> Iterator[str]:
    """Heading in degrees, counted to port, or axes exchanged: by the course of the track."""
    moving = motion.moving
    if np.sum(moving) < FEWEST_BINS:
        if abs(motion.first_heading) > TURN_AND_MORE:
            yield f"psi begins at {motion.first_heading:.4g} rad; in degrees? {HEADING_IN_DEGREES}"
        return
    course = np.angle(motion.velocity[moving])

    def read(turn: float, sign: float) -> Reading:
        apart = course - sign * motion.heading(turn)[moving]
        return Reading(turn, sign, complex(np.nanmean(np.exp(1j * apart))))

    own, *others = [read(turn, sign) for turn in TURNS for sign in (1.0, -1.0)]
    best, lack = max(others, key=lambda reading: abs(reading.mean)), 1.0 - abs(own.mean)
    # A reading that takes all headings for the same one agrees as well as the courses alike are.
    least = min(lack, 1.0 - abs(complex(np.nanmean(np.exp(1j * course)))))

    def sure_of(reading: Reading) -> bool:
        return bool(np.sum(moving) * abs(reading.mean) ** 2 > SURE and least > UNLIKE)

    if sure_of(best) and 1.0 - abs(best.mean) < BETTER * least:
        raise LogFault(
            f"the track's course and psi agree to {abs(own.mean):.2f} of 1 as "
            f"given, but to {abs(best.mean):.2f} if {best.words}; {best.remedy}"
        )
    yield from _degrees(motion, own, others[1])
    half = read(0.5 * RADIANS, 1.0)
    if sure_of(half) and 1.0 - abs(half.mean) < BETTER * least and _is_half(motion):
        yield (
            f"the track's course turns twice as far as psi: they agree to {abs(own.mean):.2f} of 1 "
            f"as given, but to {abs(half.mean):.2f} if psi is half the heading; double its column"
        )
        return
    aside = math.degrees(cmath.phase(own.mean))
    if lack < ABEAM and abs(aside) > ASIDE:
        yield (
            f"the boat moves {aside:.0f} deg off its heading on average; check that x is "
            "north, y east, and psi counted from north towards east"
        )
    straight = abs(complex(np.nanmean(np.exp(1j * course)))) >= ALIKE
    if not straight and lack > 1.0 - ALIKE and _is_unexplained(motion):
        yield (
            f"course and heading agree to {abs(own.mean):.2f} of 1; look at the unit and the "
            "column of psi, unless the boat moves in all directions without turning"
        )


class Left(NamedTuple):
    """What a heading leaves open of how a boat moves: mean squares [m2/s2].

    `moved` is what there is to explain, `left` what is left of it, `noise` that of positions.
    """

    moved: float
    left: float
    noise: float

    @property
    def is_motion(self) -> bool:
        """Whether more is left than positions are noisy."""
        return self.left > LOUD * self.noise


def _is_half(motion: BinnedMotion) -> bool:
    """Whether twice the heading explains motion that the heading does not, in any current.

    In a current of half its speed a sound log's course turns twice as far as its heading, too.
    """
    own, doubled = _left(motion), _left(motion, turn=0.5 * RADIANS)
    return own.is_motion and doubled.left < BETTER * own.left


def _is_unexplained(motion: BinnedMotion) -> bool:
    """Whether headings leave most of how a boat moves open, at any leeway and in any current."""
    over = _left(motion, BEYOND * motion.fastest)
    return over.is_motion and over.left > HALF * over.moved


def _left(motion: BinnedMotion, fastest: float = math.inf, turn: float = RADIANS) -> Left:
    """What is left of the motion with a speed through the water of at most so much [m/s].

    So many of the log's own numbers are a full turn of the heading.

    By least squares velocities are those of a steady speed through the water at a steady angle to
    the heading, or of the log's own u and v, and a current. The noise of positions is no motion.
    """
    velocity, heading = motion.velocity, np.exp(1j * motion.heading(turn))
    if {"u", "v"} <= motion.table.columns.keys():
        heading = heading * (motion.mean("u") + 1j * motion.mean("v"))
    rows = motion.moving & np.isfinite(heading)
    if np.sum(rows) < FEWEST_BINS:
        return Left(0.0, 0.0, 0.0)
    moved, ahead = (values[rows] - np.mean(values[rows]) for values in (velocity, heading))
    speed = complex(np.vdot(ahead, moved) / max(float(np.vdot(ahead, ahead).real), TINY))
    speed *= min(1.0, fastest / abs(speed)) if speed else 1.0
    bends = np.abs(velocity[4:] - 2.0 * velocity[2:-2] + velocity[:-4]) ** 2
    noise = float(np.nanmedian(bends)) / (6.0 * math.log(2.0))  # a rate spans two bins
    open_, whole = (float(np.mean(np.abs(part) ** 2)) for part in (moved - speed * ahead, moved))
    return Left(whole, open_, noise)


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


def _yaw_rate(motion: BinnedMotion) -> Iterator[str]:
    """Yaw rate in deg/s or of the other sign, or heading in degrees: by how both turn."""
    if "r" not in motion.table.columns:
        return
    given = motion.rate(motion.turned_angles())  # as smooth as the rate of the heading
    own, degrees = (_match(motion.rate(motion.heading(turn)), given) for turn in (RADIANS, DEGREES))
    if degrees.same and not own.same:
        raise LogFault(
            f"psi turns as r says if it is in degrees (correlation {degrees.alike:.2f}; as given "
            f'{own.alike:.2f}); write psi: "COLUMN [deg]" under identify.columns'
        )
    for line in _compare_quantity("r", own, UNITS["rad/s"]):
        yield f"{line} as fast as psi turns"


def _speeds(motion: BinnedMotion) -> Iterator[str]:
    """Speeds in knots or of the other sign: by how positions move."""
    body = motion.velocity * np.exp(-1j * motion.heading())
    for name, moved in (("u", body.real), ("v", body.imag)):
        if name in motion.table.columns:
            for line in _compare_quantity(name, _match(moved, motion.mean(name)), UNITS["m/s"]):
                yield f"{line} as fast as positions move"


class Match(NamedTuple):
    """What positions and headings say of a quantity beside what a log says of it.

    `alike` is their correlation about 0, 0 where there is too little of both; `ratio` that of
    their sizes, the first over the second.
    """

    alike: float
    ratio: float

    @property
    def same(self) -> bool:
        """Whether both are the same quantity in the same unit."""
        return self.alike > ALIKE and abs(math.log(self.ratio)) < NEAR


def _match(seen: Vector, given: Vector) -> Match:
    both = np.isfinite(seen) & np.isfinite(given)
    a, b = seen[both], given[both]
    if len(a) >= FEWEST_BINS:
        middle = np.abs(a - np.median(a)) <= 4.0 * np.std(a)  # an edge of a gap is no motion
        a, b = a[middle], b[middle]
    if len(a) < FEWEST_BINS or not (a.any() and b.any()):
        return Match(0.0, 1.0)
    return Match(float(a @ b / math.sqrt((a @ a) * (b @ b))), math.sqrt((a @ a) / (b @ b)))


def _compare_quantity(name: str, match: Match, units: dict[str, float]) -> Iterator[str]:
    """A quantity beside what positions and headings say of it. Raises LogFault."""
    alike, ratio = match
    if abs(alike) < ALIKE:
        return
    unit = next((u for u, f in units.items() if f != 1.0 and abs(math.log(ratio / f)) < NEAR), "")
    if unit or alike < 0.0:
        sign, brackets = "-" if alike < 0.0 else "", f" [{unit}]" if unit else ""
        raise LogFault(
            f"{name} is {'-' if alike < 0.0 else ''}{1.0 / ratio:.3g} times what positions and "
            f'headings say (correlation {alike:.2f}); write {name}: "{sign}COLUMN{brackets}" under '
            f"identify.columns, with the log's name of {name}"
        )
    if abs(math.log(ratio)) > ODD:
        yield f"{name} is {1.0 / ratio:.2g} times"


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
# Of every log, of those with headings, and of those that a hull is to be found from.
OF_ALL: tuple[Check, ...] = (
    _jumps,
    _clock,
    _places,
    _degrees_and_minutes,
    _speeds_apart,
    _speed_made_good,
    _empty,
)
OF_HEADINGS: tuple[Check, ...] = (_compass, _courses, _yaw_rate, _speeds)
OF_FITS: tuple[Check, ...] = (_slow_rows, _out_of_reach, _constant, _idle, _manoeuvres)
