"""Routes as ground stations, plotters, maps and autonomy programs write them.

What a file is shows in its first letters, not in its name. Places are latitude and longitude [deg];
MOOS-IvP has metres with x to the east. Sources: MAVLink's common message set (MAV_CMD, MAV_FRAME)
and its file formats of plans and waypoints; GPX 1.1; KML 2.2; RFC 7946; MOOS-IvP's documentation of
BHV_Waypoint.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple
from xml.etree import ElementTree

from podusv_cli.core.units import NUMBER

Pair = tuple[float, float]
MissionItem = tuple[int, int, float, float]  # frame, command, latitude and longitude, or x and y
GLOBAL, LOCAL = {0, 3, 5, 6, 10, 11}, {1}  # MAV_FRAME: latitude and longitude; north and east [m]
PLACES = {16, 17, 18, 19, 21, 31, 82}  # MAV_CMD whose place the vehicle goes to
COMMANDS = {  # what MAV_CMD of a mission are called that are no places
    20: "return to launch",
    22: "takeoff",
    80: "region of interest",
    93: "delay",
    112: "delay",
    115: "yaw",
    177: "jump",
    178: "change of speed",
    201: "region of interest",
    206: "camera trigger",
    2000: "picture",
}
USUAL = {"frame": 3, "command": 0}  # of a plan's item that does not say
# Frames and commands of MAVLink have 16 bits. int() would refuse infinity and NaN.
MOST_CODE = 1e5
LONGEST_NAME = 40  # letters of a word that a file gives
POINTS = re.compile(r"^\s*(?:points|polygon)\s*=\s*(.*)$", re.MULTILINE | re.IGNORECASE)
FORM = re.compile(r"\s*format\s*=", re.IGNORECASE)
LABEL = re.compile(r"\s*[a-z_]+\s*[,=]\s*[A-Za-z_][\w ]*\s*")
MOOS_PAIR = re.compile(r"\s*([^,:{}\s]+)\s*,\s*([^,:{}\s]+)(?:\s*,[^:]*)?\s*")


class RouteFile(NamedTuple):
    """The waypoints of a file, and what of it is left out, in words.

    `pairs` are latitude and longitude [deg] where they are `on_earth`, else north and east [m].
    """

    pairs: tuple[Pair, ...]
    on_earth: bool = True
    left_out: tuple[str, ...] = ()


class RouteFault(ValueError):
    """What is wrong with a route's file, in a sentence."""


def route_of(text: str) -> RouteFile | None:
    """The route that a text holds; None for rows of numbers, which are no route's own format.

    Raises RouteFault where it is damaged, or has no waypoints.
    """
    begin = text.removeprefix("\ufeff").lstrip()
    for begins, read in FORMATS.items():
        if begin.startswith(begins):
            try:
                return without_repeats(read(begin))
            except RecursionError as error:
                raise RouteFault("has brackets in brackets without end") from error
    # A behaviour of MOOS-IvP may begin with anything, so its points are searched for.
    return without_repeats(_moos(begin)) if POINTS.search(begin) else None


def without_repeats(route: RouteFile) -> RouteFile:
    """The route without waypoints that repeat the one before, which would be legs of no length.

    Raises RouteFault where nothing is left.
    """
    if not route.pairs:
        others = f"; left out: {', '.join(route.left_out)}" if route.left_out else ""
        raise RouteFault(f"has no waypoints{others}")
    pairs = route.pairs
    kept = [pair for i, pair in enumerate(pairs) if i == 0 or pair != pairs[i - 1]]
    again = len(pairs) - len(kept)
    words = (f"waypoints where the one before is: {again}",) if again else ()
    return route._replace(pairs=tuple(kept), left_out=(*route.left_out, *words))


def _waypoint_list(text: str) -> RouteFile:
    """The route of a `QGC WPL 110` text: a row an item; item 0 in frame 0 is ArduPilot's home."""
    items, home = list[MissionItem](), False
    for number, line in enumerate(text.splitlines()[1:], 2):
        if not line.strip() or line.startswith("#"):
            continue
        cells = line.split()
        if len(cells) < 12 or not all(map(NUMBER.fullmatch, cells[:12])):
            raise RouteFault(f"line {number} is no item of QGC WPL 110, which has 12 numbers")
        # Columns of the format: frame, command, latitude, longitude.
        frame, command, lat, lon = (float(cells[i]) for i in (2, 3, 8, 9))
        home = home or (not items and frame == 0.0)
        items.append((_whole(frame), _whole(command), lat, lon))
    route = _of_mission(items)
    said = ("nothing of item 0, the home of ArduPilot: it is the first waypoint",) if home else ()
    return route._replace(left_out=(*route.left_out, *said))


def _plan(text: str) -> RouteFile:
    """The route of a JSON text: QGroundControl's .plan, or GeoJSON. Raises RouteFault."""
    try:
        data = json.loads(text)
    except ValueError as error:
        raise RouteFault(f"is no JSON: {error}") from error
    mission = data.get("mission")
    if not isinstance(mission, Mapping):
        return _geojson(data)
    items, others = list[MissionItem](), Counter[str]()
    for item in _simple_items(mission.get("items")):
        if kind := item.get("complexItemType"):
            others[str(kind)[:LONGEST_NAME]] += 1
            continue
        frame, command = (_whole(_number(item.get(key, usual))) for key, usual in USUAL.items())
        where: Sequence[Any] = (0.0, 0.0)
        if command in PLACES:
            # Old plans have a coordinate, new ones seven params with the place at 4 and 5.
            where = _list(item.get("coordinate"))[:2] or _list(item.get("params"))[4:6]
        if len(where) < 2:
            raise RouteFault("has a waypoint without latitude and longitude")
        items.append((frame, command, _number(where[0]), _number(where[1])))
    route = _of_mission(items)
    return route._replace(left_out=(*route.left_out, *_counts(others)))


def _simple_items(items: Any) -> Iterator[Mapping[str, Any]]:
    """The items of a mission; a survey or a corridor is replaced by the items that it consists of.

    `items` is a list as the file has it, unchecked. Raises RouteFault for an item that is none.
    """
    for item in _list(items):
        if not isinstance(item, Mapping):
            raise RouteFault("has a mission item that is no mapping")
        inner = item.get("TransectStyleComplexItem")
        if isinstance(inner, Mapping):
            yield from _simple_items(inner.get("Items"))
        else:
            yield item


def _of_mission(items: Sequence[MissionItem]) -> RouteFile:
    """The waypoints among mission items: frame, command, latitude and longitude, or x and y."""
    places: list[Pair] = []
    frames: set[bool] = set()
    others: Counter[str] = Counter()
    for frame, command, lat, lon in items:
        if command not in PLACES:
            others[f"{COMMANDS.get(command, 'command')} ({command})"] += 1
        elif frame not in GLOBAL | LOCAL:
            others[f"waypoint in frame {frame}"] += 1
        elif frame in GLOBAL and lat == 0.0 and lon == 0.0:
            others["waypoint at 0, 0, which means: stay here"] += 1
        else:
            frames.add(frame in GLOBAL)
            places.append((lat, lon))
    if len(frames) > 1:
        raise RouteFault("has waypoints in degrees and in metres; write them in one frame")
    # Without any waypoint, the frame does not matter.
    return RouteFile(tuple(places), on_earth=frames != {False}, left_out=_counts(others))


def _counts(others: Mapping[str, int]) -> tuple[str, ...]:
    """What is left out, with how often."""
    return tuple(f"{what}: {count}" for what, count in others.items() if count)


def _geojson(data: Mapping[str, Any]) -> RouteFile:
    """The first line of GeoJSON, or its points in their order.

    `data` is the file's content. What else it has is counted in `left_out`.
    """
    lines, points, others = [], [], Counter[str]()
    for geometry in _geometries(data):
        kind, where = str(geometry.get("type")), geometry.get("coordinates")
        if kind == "LineString":
            lines.append(where)
        elif kind == "MultiLineString":
            lines += _list(where)
        elif kind == "Point":
            points.append(where)
        else:
            others[kind[:LONGEST_NAME]] += 1
    chosen, left_out = _line_or_points(lines, points)
    # GeoJSON has the longitude first.
    pairs = tuple((_number(_at(p, 1)), _number(_at(p, 0))) for p in _list(chosen))
    return RouteFile(pairs, left_out=(*left_out, *_counts(others)))


def _geometries(data: Any) -> Iterator[Mapping[str, Any]]:
    """The geometries of GeoJSON, at any depth of collections and features. Raises RouteFault."""
    if not isinstance(data, Mapping):
        raise RouteFault("has a part of GeoJSON that is no mapping")
    for inner in [*_list(data.get("features")), *_list(data.get("geometries"))]:
        yield from _geometries(inner)
    if isinstance(data.get("geometry"), Mapping):
        yield from _geometries(data["geometry"])
    elif "coordinates" in data:
        yield data


def _line_or_points(
    lines: Sequence[Any], points: Sequence[Any]
) -> tuple[Sequence[Any], tuple[str, ...]]:
    """The first line where there is one, else all points; and what is left out, in words.

    `lines` and `points` hold coordinates as the file has them.
    """
    if not lines:
        return points, ()
    others = {"lines after the first": len(lines) - 1, "single points": len(points)}
    return lines[0], _counts(others)


def _xml(text: str) -> RouteFile:
    """The route of an XML text: GPX or KML. Raises RouteFault."""
    # Entities may expand without end.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise RouteFault("has a document type or entities, which are not read")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise RouteFault(f"is no XML: {error}") from error
    kind = _tag(root)
    if kind not in ("gpx", "kml"):
        raise RouteFault("is XML, but neither GPX nor KML")
    return _gpx(root) if kind == "gpx" else _kml(root)


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).rpartition("}")[2].lower()


def _children(element: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    """The elements of this name right in an element."""
    return [inner for inner in element if _tag(inner) == name]


def _inside(element: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    """The elements of this name in an element, however deep."""
    return [inner for inner in element.iter() if _tag(inner) == name]


def _gpx(root: ElementTree.Element) -> RouteFile:
    """The first route; the first track where there is none; else the waypoints in their order."""
    ways = [_children(way, "rtept") for way in _children(root, "rte")]
    ways += [
        [point for part in _children(way, "trkseg") for point in _children(part, "trkpt")]
        for way in _children(root, "trk")
    ]
    chosen, left_out = _line_or_points([*filter(None, ways)], _children(root, "wpt"))
    return RouteFile(
        tuple((_number(p.get("lat")), _number(p.get("lon"))) for p in chosen), left_out=left_out
    )


def _kml(root: ElementTree.Element) -> RouteFile:
    """The first line, else the points in their order; longitude comes first."""
    lines = [_kml_places(line) for line in _inside(root, "linestring")]
    lines += [_track_places(track) for track in _inside(root, "track")]
    points = [place for point in _inside(root, "point") for place in _kml_places(point)]
    chosen, left_out = _line_or_points([*filter(None, lines)], points)
    others = _counts({"polygons": len(_inside(root, "polygon"))})
    return RouteFile(tuple(chosen), left_out=(*left_out, *others))


def _kml_places(geometry: ElementTree.Element) -> list[Pair]:
    texts = [inner.text or "" for inner in _children(geometry, "coordinates")]
    cells = [place.split(",") for text in texts for place in text.split()]
    return [(_number(_at(place, 1)), _number(_at(place, 0))) for place in cells]


def _track_places(track: ElementTree.Element) -> list[Pair]:
    """Those of Google Earth's gx:Track: longitude, latitude and height between blanks."""
    cells = [(inner.text or "").split() for inner in _children(track, "coord")]
    return [(_number(_at(place, 1)), _number(_at(place, 0))) for place in cells]


def _moos(text: str) -> RouteFile:
    """The first points of a MOOS-IvP behaviour, whose x is east and y north [m].

    A polygon by its form (`format=radial, x=75, ...`) has no points.
    """
    lists = [match[1].partition("//")[0] for match in POINTS.finditer(text)]
    written = [body for body in lists if not FORM.match(body)]
    forms = {"polygons by their form (write their points)": len(lists) - len(written)}
    if not written:
        return RouteFile((), on_earth=False, left_out=_counts(forms))
    first, *others = written
    body = first.partition("pts=")[2] or first
    body = body.partition("{")[2].partition("}")[0] if "{" in body else body
    pairs, odd = [], 0
    for part in filter(str.strip, body.split(":")):
        match = MOOS_PAIR.fullmatch(part)
        if not match or not all(map(NUMBER.fullmatch, match.groups())):
            odd += not LABEL.fullmatch(part)  # `label, survey`: a setting among the points
            continue
        # North first, as everywhere in podusv.
        pairs.append((float(match[2]), float(match[1])))
    counts = {"points that are no two numbers": odd, "lists of points after the first": len(others)}
    left_out = _counts(counts | forms)
    return RouteFile(tuple(pairs), on_earth=False, left_out=left_out)


def _list(part: Any) -> list[Any]:
    """It, where it is a list; else an empty one."""
    return part if isinstance(part, list) else []


def _whole(number: float) -> int:
    """A code of a mission item; 0, which stands for nothing, where it is none."""
    return int(number) if abs(number) < MOST_CODE else 0


def _at(place: Any, index: int) -> Any:
    return place[index] if isinstance(place, (list, tuple)) and len(place) > index else None


def _number(part: Any) -> float:
    """A latitude or longitude of a file as a number. Raises RouteFault."""
    text = str(part).strip()
    if not NUMBER.fullmatch(text) or not math.isfinite(float(text)):
        raise RouteFault("has a waypoint whose latitude or longitude is no number")
    return float(text)


FORMATS: Mapping[str, Callable[[str], RouteFile]] = {
    "QGC WPL": _waypoint_list,
    "{": _plan,
    "<": _xml,
}


def beyond_earth(pairs: Iterable[Pair]) -> str:
    """What is wrong with the first place (latitude, longitude) [deg] that is not on earth.

    "" if all places are.
    """
    for lat, lon in pairs:
        if abs(lat) > 90.0:
            # As NMEA writes places: two digits of degrees, then minutes below 60.
            minutes = abs(lat) <= 9000.0 and abs(lat) % 100.0 < 60.0
            hint = "degrees and minutes, ddmm.mmmm? write dd + mm.mmmm / 60" if minutes else ""
            return f"latitude {lat:.10g} is beyond 90 deg{'; ' + hint if hint else ''}"
        if abs(lon) > 360.0:
            return f"longitude {lon:.10g} is beyond 360 deg"
    return ""
