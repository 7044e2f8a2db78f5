"""Findings about values that fit the others in another unit only."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.core.finding import At, Sentences, warn_before_run
from podusv_cli.scenario.case import Case

WATER = 1000.0  # kg/m3
SLENDER = (0.4, 30.0)  # length over beam
BULK = (5e-4, 1.0)  # mass over that of water of the volume length times beam squared
GYRATION = (0.05, 1.0)  # radius of gyration over length
TYPICAL = 0.25  # radius of gyration over length of most hulls
TURNED = 0.3  # rad and rad/s; a compass and a gyro with such noise show nothing
ASTRAY = 10.0  # lengths; a position with such noise shows nothing
CLOSE = 0.5  # lengths, over which a whole way extends
FAR = 300.0  # lengths between start and target
NORTH, EAST = 90.0, 180.0  # deg, the largest latitude and longitude
DEGREE = 111e3  # m, of latitude
GRID = 2e4  # m, from which on a way that far is one in coordinates of a map


class UnitGuess(NamedTuple):
    """A unit that was perhaps meant, and what one of it is in podusv's."""

    name: str
    factor: float


METRES = (UnitGuess("mm", 1e-3), UnitGuess("cm", 1e-2), UnitGuess("ft", 0.3048))
KILOGRAMS = (UnitGuess("t", 1e3), UnitGuess("g", 1e-3))
DEGREES = UnitGuess("deg", math.pi / 180.0)
RANGES = (
    f"length over beam outside {SLENDER[0]:g} to {SLENDER[1]:g}, m over 1000 kg/m3 length beam^2 "
    f"outside {BULK[0]:g} to {BULK[1]:g}, sqrt(I_z/m) over length outside {GYRATION[0]:g} to "
    f"{GYRATION[1]:g}; noise of heading or yaw rate above {TURNED:g}, of the position above "
    f"{ASTRAY:g} lengths; all points within {CLOSE:g} lengths; a start {FAR:g} lengths away"
)


@warn_before_run(
    "other-unit",
    about="vessel",
    meaning="a value fits the others in another unit only",
    condition=RANGES,
    remedy="give the value in podusv's unit",
)
def other_unit(case: Case) -> Sentences:
    """Ratios of values of hull, sensors, path and start that no boat has."""
    scenario = case.scenario
    vessels = {"vessel": scenario.vessel, "nominal": scenario.nominal}
    if scenario.nominal == scenario.vessel:
        del vessels["nominal"]
    hulls = [
        At(f"{section}.{key}", text)
        for section, vessel in vessels.items()
        for key, text in _hull(vessel)
    ]
    yield from hulls
    if hulls:  # the length may be wrong, which the others are compared with
        return
    yield from _noise(case)
    yield from _points(case)
    yield from _start(case)


def _within(number: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= number <= limits[1]


def _guess_unit(
    number: float, units: tuple[UnitGuess, ...], ratio: float, limits: tuple[float, float]
) -> str:
    """A question whether `number` was given in one of `units`, and what to write then; else "".

    It is the first unit in which the `ratio`, linear in the number, lies within the usual `limits`.
    """
    fits = [unit for unit in units if _within(ratio * unit.factor, limits)]
    return (
        f"; was it given in {fits[0].name}? then write {number * fits[0].factor:g}" if fits else ""
    )


def _hull(vessel: Vessel) -> Iterator[tuple[str, str]]:
    """Key and sentence for the first of the hull's ratios that no hull has.

    Only the first: a wrong length spoils the others.
    """
    L, B, m = vessel.length, vessel.beam, vessel.m
    slender, bulk = L / B, m / (WATER * L * B * B)
    radius = math.sqrt(vessel.I_z / m)
    if not _within(slender, SLENDER):
        meant = _guess_unit(L, METRES, slender, SLENDER)
        yield "length", f"{L:g} m over a beam of {B:g} m{meant or '; check both, in metres'}"
    elif not _within(bulk, BULK):
        # Length times beam squared goes with the unit's cube.
        both = [unit for unit in METRES if _within(bulk / unit.factor**3, BULK)]
        scaled = f"; are length and beam in {both[0].name}? write them in metres" if both else ""
        if meant := _guess_unit(m, KILOGRAMS, bulk, BULK):
            yield "m", f"{m:g} kg for a hull of {L:g} m by {B:g} m{meant} (kg)"
        else:
            yield "length", f"{L:g} m by {B:g} m for a hull of {m:g} kg{scaled or '; check all'}"
    elif not _within(radius / L, GYRATION):
        usual = m * (TYPICAL * L) ** 2
        yield (
            "I_z",
            f"{vessel.I_z:g} kg m2 is a radius of gyration of {radius:.3g} m on a hull of {L:g} m "
            f"and {m:g} kg; a quarter of the length is usual, which is {usual:.3g} kg m2",
        )


def _noise(case: Case) -> Sentences:
    """Findings on sensors whose noise hides all that they measure."""
    noise, length = case.scenario.measurement.noise_of_each(), case.scenario.vessel.length
    for key, place, unit in (("heading", 2, "rad"), ("yaw_rate", 5, "rad/s")):
        if noise[place] > TURNED:
            yield At(
                f"measurement.{key}.noise",
                f"{noise[place]:g} {unit} of noise, which shows nothing; was it given in "
                f"{unit.replace('rad', 'deg')}? then write {noise[place] * DEGREES.factor:.3g}",
            )
    if noise[0] > ASTRAY * length:
        yield At(
            "measurement.position.noise",
            f"{noise[0]:g} m of noise on a hull of {length:g} m; was it given in mm? then write "
            f"{noise[0] / 1000.0:g}",
        )


def _points(case: Case) -> Sentences:
    """A finding where all points of a way lie within the hull: they are degrees, mostly."""
    points = np.asarray(case.scenario.path.waypoints(), float).reshape(-1, 2)
    length = case.scenario.vessel.length
    if len(points) < 2:
        return
    extent, (north, east) = float(np.ptp(points, axis=0).max()), np.abs(points).max(axis=0)
    if not extent < CLOSE * length:
        return
    degrees = north <= NORTH and east <= EAST and extent * DEGREE > length
    meant = (
        f"are they latitude and longitude in degrees? {extent:.3g} deg of latitude are "
        f"{extent * DEGREE:.3g} m: write metres north and east of a point nearby, or a file whose "
        "first line is lat,lon (podusv docs origin)"
        if degrees
        else "are they in km? write metres"
    )
    yield At(
        "path.points", f"they all lie within {extent:.3g} m, on a hull of {length:g} m; {meant}"
    )


def _start(case: Case) -> Sentences:
    """A finding where the start is far from the target, or points are a map's coordinates."""
    start, path, length = case.scenario.start, case.scenario.path, case.scenario.vessel.length
    if not case.scenario.controller.aims():
        return
    # A path that is followed has no target at t = 0, so its nearest waypoint counts.
    places = path.waypoints() if path.follows else path.targets((0.0,))[:, :2].tolist()
    north, east = min(
        ((start.x - x, start.y - y) for x, y in places), key=lambda off: math.hypot(*off)
    )
    away = math.hypot(north, east)
    if away > FAR * length:
        axis = int(abs(east) > abs(north))
        number = (start.x, start.y)[axis]
        if path.waypoints() and away > GRID:
            which = "nearest" if path.follows else "first"
            yield At(
                "path.points",
                f"the {which} waypoint is {away / 1000.0:.4g} km from the start; are the points "
                "coordinates of a grid, as UTM's? write metres north and east of a place nearby, "
                "or a start beside them",
            )
            return
        near = number and away / 1000.0 < FAR * length
        meant = (
            f"was {number:g} given in mm? then write {number / 1000.0:g}" if near else "check it"
        )
        yield At(
            f"start.{'xy'[axis]}",
            f"{away:.3g} m from the target, {away / length:.3g} lengths; {meant}",
        )
