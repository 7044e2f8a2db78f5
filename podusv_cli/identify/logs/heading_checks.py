"""Mistakes in the heading of a log that its motion shows: its unit, its sign, its axes.

A heading is held against the course of the track, a yaw rate against both. A boat may drift, so
only what no leeway and no current explains is an error.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.motion import DEGREES, RADIANS, BinnedMotion
from podusv_cli.identify.logs.reading import UNITS

HEADING_IN_DEGREES = (
    'if so, write psi: "COLUMN [deg]" under identify.columns, or "psi [deg]" as the name of the '
    "column"
)
FEWEST_BINS = 10  # with numbers, below which nothing is said
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
FASTER = 1.3  # times the speed of the track, that a boat makes through the water at most
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
    over = _left(motion, FASTER * motion.fastest)
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
    """How alike two courses of a quantity are, both (bins,), NaN where one is not known."""
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


OF_HEADINGS = (_compass, _courses, _yaw_rate, _speeds)
