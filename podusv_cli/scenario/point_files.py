"""Points of a path from a file: rows of x,y [m] or of latitude, longitude, or a route."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from podusv_cli.core import units
from podusv_cli.core.earth import Plane, error_at
from podusv_cli.core.timed_rows import TextLine, columns, lines_of
from podusv_cli.scenario.routes import (
    Pair,
    RouteFault,
    RouteFile,
    beyond_earth,
    route_of,
    without_repeats,
)
from podusv_cli.scenario.yaml_text import MAX_NODES, resolve
from podusv_cli.scenario.yaml_tree import Fault, Mark, Node

MAX_POINTS = MAX_NODES // 4  # a point is three values, and the resolved scenario has to be readable
MOST_FAULTS = 10  # in one file of points
METRES = ("x [m]", "y [m]")
DEGREES = {  # what columns of places are called
    "lat": "lat",
    "latitude": "lat",
    "lon": "lon",
    "lng": "lon",
    "long": "lon",
    "longitude": "lon",
}
NEARBY = 0.5  # deg, within which of an origin rows without names are places
DIGITS = 3  # of metres, after the point
FAR = 50e3  # m from the origin, beyond which the plane is said to be off


class Placing:
    """The plane in which routes lie: the scenario's, or that of the first route's first place."""

    def __init__(self, root: Node, remarks: list[str]) -> None:
        """`remarks` takes sentences about what was left out, or taken for granted."""
        self._given = root.mapping.get("origin")
        self.remarks = remarks
        self._plane = _plane(self._given) if self._given else None
        # The origin that the first route gives, where the scenario has none.
        self._first: Node | None = None

    def with_origin(self, root: Node) -> Node:
        """The tree with the origin that a route gave, where the tree has none."""
        return root.with_entry("origin", self._first) if self._first else root

    def points(self, text: str, name: str, key: str, faults: list[Fault]) -> Node:
        """The points (n, 2) of a file's text, north and east [m], as a node.

        This is a `Form` of `named_files`. `name` is the file's, `key` the scenario's key that names
        it.
        """
        try:
            route = route_of(text) or self._rows_as_places(text)
        except RouteFault as fault:
            faults.append(Fault(Mark(name), key, f"the file {fault}"))
            return Node((), Mark(name))
        if route is None:
            return Node(tuple(_rows(text, name, faults)), Mark(name))
        if left_out := ", ".join(route.left_out):
            self.remarks.append(f"{name}: left out of the route: {left_out}")
        pairs = self._in_metres(route.pairs, name, key, faults) if route.on_earth else route.pairs
        if len(pairs) > MAX_POINTS:
            faults.append(Fault(Mark(name), "", f"more than {MAX_POINTS:,} points"))
            return Node((), Mark(name))
        return Node(tuple(_point(pair, name) for pair in pairs), Mark(name))

    def _rows_as_places(self, text: str) -> RouteFile | None:
        """Rows of latitude and longitude [deg] as a route; None where the rows are something else.

        `text` is the file's. The rows have the names `lat` and `lon`, or no names and lie near the
        scenario's origin. Raises RouteFault.
        """
        header, lines = lines_of(text)
        cells = header.cells if header else []
        names = [DEGREES.get(cell.partition("[")[0].strip().lower()) for cell in cells]
        if {"lat", "lon"} <= {*names}:
            _demand_degrees(cells)
            order = names.index("lat"), names.index("lon")
        elif not header and lines and self._plane and _about(self._plane, lines):
            order = (0, 1)
            self.remarks.append(
                "rows without names lie about the origin's own degrees, and are taken for "
                "latitude, longitude; name the columns in a first line, lat,lon or x,y"
            )
        else:
            return None
        pairs = []
        for line in lines:
            lat, lon = (_number(line.cells[i]) if i < len(line.cells) else math.nan for i in order)
            if math.isnan(lat + lon) or len(line.cells) > max(len(cells), 2):
                raise RouteFault(f"has no latitude and longitude in line {line.number}")
            pairs.append((lat, lon))
        return without_repeats(RouteFile(tuple(pairs)))

    def _in_metres(
        self, places: Sequence[Pair], name: str, key: str, faults: list[Fault]
    ) -> tuple[Pair, ...]:
        """Places [deg] as north and east of the origin [m]."""
        if beyond := beyond_earth(places):
            faults.append(Fault(Mark(name), key, f"the file has a place whose {beyond}"))
            return ()
        if self._given and not self._plane:
            return ()  # whoever checks the origin says what is wrong with it
        plane = self._plane or self._take_first(places[0], name)
        north, east = plane.north_east(*np.transpose(places))
        away = float(np.hypot(north, east).max())
        # Also where the distance is NaN.
        if not away < FAR:
            self.remarks.append(
                f"{name}: a waypoint is {away / 1000.0:.4g} km from the origin ({plane.lat:g}, "
                f"{plane.lon:g} deg), where the plane is off by about {error_at(away):.2g} m; is "
                "that origin right?"
            )
        return tuple(zip(north.tolist(), east.tolist(), strict=True))

    def _take_first(self, place: Pair, name: str) -> Plane:
        """The plane whose origin is the first waypoint of the first route [deg].

        It is noted for the other routes.
        """
        # A longitude of 0 to 360 deg becomes one of -180 to 180 deg.
        lat, lon = place[0], place[1] - 360.0 * round(place[1] / 360.0)
        mark = Mark(name)
        self._first = Node({"lat": Node(lat, mark), "lon": Node(lon, mark)}, mark)
        self._plane = Plane(lat, lon)
        self.remarks.append(
            f"{name}: x = y = 0 is its first waypoint; to lay logs beside the run write "
            f"origin: {{lat: {lat:.12g}, lon: {lon:.12g}}}"
        )
        return self._plane


def _demand_degrees(cells: Sequence[str]) -> None:
    """Raise RouteFault for a unit in brackets that is none of degrees."""
    for cell in cells:
        name, _, unit = cell.partition("[")
        if DEGREES.get(name.strip().lower()) and unit.strip(" ]") not in ("", "deg", "°"):
            raise RouteFault("has latitude and longitude in another unit than deg; convert them")


def _plane(origin: Node) -> Plane | None:
    """That of an origin as it stands in a scenario; None where its numbers are none."""
    lat, lon = (_degrees(origin.get(key)) for key in ("lat", "lon"))
    return None if math.isnan(lat + lon) else Plane(lat, lon)


def _degrees(content: object) -> float:
    """An angle [deg] as it stands in a scenario, NaN for what is none."""
    if isinstance(content, str):
        content = units.number(content, "deg")
    return float(content) if isinstance(content, (int, float)) else math.nan


def _about(plane: Plane, lines: Sequence[TextLine]) -> bool:
    """Whether all rows of two numbers are near the origin's own degrees."""
    rows = [[_number(cell) for cell in line.cells] for line in lines]
    return all(
        len(row) == 2 and abs(row[0] - plane.lat) < NEARBY and abs(row[1] - plane.lon) < NEARBY
        for row in rows
    )


def _number(cell: str) -> float:
    """The number in a cell, NaN where there is none."""
    number = resolve(cell)
    if isinstance(number, bool) or not isinstance(number, (int, float)):
        return math.nan
    return float(number)


def _point(pair: Pair, name: str) -> Node:
    # Adding 0.0 makes 0.0 of -0.0.
    numbers = [round(part, DIGITS) + 0.0 for part in pair]
    return Node(tuple(Node(number, Mark(name)) for number in numbers), Mark(name))


def _rows(text: str, name: str, faults: list[Fault]) -> Iterator[Node]:
    """A node for every line: x and y [m], in the order of the header where there is one.

    Reading stops after MOST_FAULTS further faults.
    """
    header, filled = lines_of(text)
    try:
        order = columns(header, METRES, "the file") if header else [0, 1]
    except ValueError as error:
        faults.append(Fault(Mark(name, header.number if header else 1, 1), "", str(error)))
        return
    if len(filled) > MAX_POINTS:
        faults.append(Fault(Mark(name), "", f"more than {MAX_POINTS:,} points"))
        return
    most = len(faults) + MOST_FAULTS
    for line in filled:
        row = _row(line, Mark(name, line.number, 1), faults)
        if len(faults) > most:
            return
        cells = row.content
        yield replace(row, content=tuple(cells[i] for i in order if i < len(cells)))


def _row(line: TextLine, mark: Mark, faults: list[Fault]) -> Node:
    """A line of a file of points as a node of two numbers [m]; faults for what is no such pair."""
    numbers = [resolve(cell) for cell in line.cells]
    wrong = [isinstance(n, (str, bool)) or n is None for n in numbers]
    # The line is not shown: the file may be one that the user may not read.
    if len(numbers) != 2:
        text = f"must be two numbers x,y [m], found {len(numbers)} between commas"
        faults.append(Fault(mark, "", text))
    elif any(wrong):
        place = ("first", "second")[wrong.index(True)]
        faults.append(Fault(mark, "", f"must be two numbers x,y [m]; the {place} is no number"))
    pairs = zip(numbers, line.cells, strict=True)
    return Node(tuple(Node(number, mark, text=cell) for number, cell in pairs), mark)
