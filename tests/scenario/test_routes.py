"""Routes of other programs, as points of a path."""

import json
import random
import warnings

import numpy as np
import pytest

from podusv_cli.core.errors import ScenarioError
from podusv_cli.scenario.load import load, load_stored
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.routes import RouteFault, route_of

BOAT = """\
vessel: {preset: otter}
actuator: {kind: ideal}
disturbance: {kind: none}
controller: {kind: los_pid}
"""
# Three places, and metres by a degree's length of 111 202 m and 74 481 m at 48.1 deg (WGS 84).
PLACES = [(48.1, -3.01), (48.0995, -3.0096), (48.0996, -3.0092)]
METRES = [(0.0, 0.0), (-55.6, 29.8), (-44.5, 59.6)]
GPX = '<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1">{}</gpx>'
KML = '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{}</Document></kml>'


def items(*commands):
    """Items of a .plan; a place where nothing else is given."""
    return [
        {"type": "SimpleItem", "frame": 3, "command": command, "params": [0, 0, 0, None, *place, 0]}
        for command, place in commands
    ]


def plan(*commands):
    return json.dumps({"fileType": "Plan", "mission": {"items": items(*commands)}})


def geojson(*geometries):
    return json.dumps(
        {"type": "FeatureCollection", "features": [{"geometry": g} for g in geometries]}
    )


AT = [(16, place) for place in PLACES]
LINE = {"type": "LineString", "coordinates": [[lon, lat] for lat, lon in PLACES]}
WPL = "QGC WPL 110\n" + "".join(
    f"{i}\t0\t3\t16\t0\t0\t0\t0\t{lat}\t{lon}\t0\t1\n" for i, (lat, lon) in enumerate(PLACES)
)
POINTS = "".join('<{0} lat="%s" lon="%s"/>' % place for place in PLACES)  # noqa: UP031 - {0} stays
FILES = {
    "plan": plan(*AT),
    "plan with a speed and a jump": plan(AT[0], (178, (0, 0)), AT[1], (177, (0, 0)), AT[2]),
    "plan of a survey": json.dumps(
        {"mission": {"items": [{"TransectStyleComplexItem": {"Items": items(*AT)}}]}}
    ),
    "waypoints": WPL,
    "waypoints of Windows": WPL.replace("\n", "\r\n"),
    "GPX route": GPX.format(f"<rte>{POINTS.format('rtept')}</rte>"),
    "GPX track": GPX.format(f"<trk><trkseg>{POINTS.format('trkpt')}</trkseg></trk>"),
    "GPX waypoints": GPX.format(POINTS.format("wpt")),
    "KML line": KML.format(
        "<Placemark><LineString><coordinates>\n"
        + "\n".join(f" {lon},{lat},0" for lat, lon in PLACES)
        + "</coordinates></LineString></Placemark>"
    ),
    "KML points": KML.format(
        "".join(
            f"<Placemark><Point><coordinates>{lon},{lat}</coordinates></Point></Placemark>"
            for lat, lon in PLACES
        )
    ),
    "KML track of Google Earth": KML.format(
        '<Placemark><gx:Track xmlns:gx="http://www.google.com/kml/ext/2.2"><when>2026</when>'
        + "".join(f"<gx:coord>{lon} {lat} 12.5</gx:coord>" for lat, lon in PLACES)
        + "</gx:Track></Placemark>"
    ),
    "GeoJSON": geojson(LINE),
    "GeoJSON points": geojson(*({"type": "Point", "coordinates": p[::-1]} for p in PLACES)),
    "CSV": "lat,lon\n" + "".join(f"{lat},{lon}\n" for lat, lon in PLACES),
    "CSV of more": "name,Longitude,Latitude\n" + "".join(f"a,{b},{a}\n" for a, b in PLACES),
    "with a byte order mark": "\ufeff" + plan(*AT),
}


def loaded(tmp_path, route, more="", path="path: {kind: legs, file: route.dat}\n"):
    (tmp_path / "route.dat").write_text(route, encoding="utf-8")
    (tmp_path / "a.yaml").write_text(BOAT + path + more)
    return load(tmp_path / "a.yaml")


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("kind", ["legs", "waypoints"])
def test_places_become_metres_north_and_east_of_the_first(tmp_path, name, kind):
    scenario = loaded(
        tmp_path, FILES[name], path=f"path: {{kind: {kind}, file: route.dat}}\n"
    ).scenario
    assert np.abs(np.subtract(scenario.path.points, METRES)).max() < 0.1
    assert (scenario.origin.lat, scenario.origin.lon) == PLACES[0]


def test_an_origin_places_them_and_stays(tmp_path):
    scenario = loaded(tmp_path, FILES["plan"], "origin: {lat: 48.0995, lon: -3.0096}\n").scenario
    second = np.subtract(scenario.path.points[1], 0.0)
    assert np.abs(second).max() < 1e-3
    assert scenario.path.points[0] == pytest.approx((55.6, -29.8), abs=0.1)
    assert scenario.origin.lat == 48.0995


def test_what_is_left_out_and_taken_for_granted_is_said(tmp_path):
    remarks = loaded(tmp_path, FILES["plan with a speed and a jump"]).remarks
    assert "left out of the route: change of speed (178): 1, jump (177): 1" in remarks[0]
    assert "origin: {lat: 48.1, lon: -3.01}" in remarks[1]
    two = geojson(LINE, LINE, {"type": "Polygon", "coordinates": []})
    assert "lines after the first: 1, Polygon: 1" in loaded(tmp_path, two).remarks[0]
    assert not loaded(tmp_path, "0,0\n10,0\n").remarks


def test_the_resolved_scenario_needs_neither_file_nor_remark(tmp_path):
    first = loaded(tmp_path, FILES["KML line"])
    again = load_stored(resolved_yaml(first.scenario), str(tmp_path / "resolved.yaml"))
    assert again.scenario == first.scenario
    assert again.remarks == ()


def test_the_way_over_the_date_line_is_short(tmp_path):
    fiji = plan((16, (-17.0, 179.9999)), (16, (-17.0, -179.9999)))
    points = loaded(tmp_path, fiji).scenario.path.points
    assert points[1] == pytest.approx((0.0, 2e-4 * 106_450.0), abs=0.01)


def test_moos_points_have_x_to_the_east(tmp_path):
    for points in ("pts={60,-40 : 60,-160 : 150,-160}", "60,-40:60,-160:150,-160:label,survey"):
        text = f"Behavior = BHV_Waypoint\n{{\n  name = go\n  points = {points} // m\n}}\n"
        scenario = loaded(tmp_path, text).scenario
        assert scenario.path.points == ((-40.0, 60.0), (-160.0, 60.0), (-160.0, 150.0))
        assert scenario.origin is None


def test_a_polygon_by_its_form_is_passed_over_for_points(tmp_path):
    text = "polygon = format=radial, x=75, y=-75, radius=30, pts=8\npoints = 0,-20 : 30,-20\n"
    found = loaded(tmp_path, text)
    assert found.scenario.path.points == ((-20.0, 0.0), (-20.0, 30.0))
    assert "polygons by their form (write their points): 1" in found.remarks[0]


def test_local_frames_of_a_mission_are_metres(tmp_path):
    text = "QGC WPL 110\n0 1 1 16 0 0 0 0 5.0 -3.0 0 1\n1 0 1 16 0 0 0 0 25.0 7.0 0 1\n"
    scenario = loaded(tmp_path, text).scenario
    assert scenario.path.points == ((5.0, -3.0), (25.0, 7.0))
    assert scenario.origin is None


def test_rows_without_names_are_places_where_they_lie_about_the_origin(tmp_path):
    rows = "".join(f"{lat},{lon}\n" for lat, lon in PLACES)
    found = loaded(tmp_path, rows, "origin: {lat: 48.1, lon: -3.01}\n")
    assert np.abs(np.subtract(found.scenario.path.points, METRES)).max() < 0.1
    assert "taken for latitude, longitude" in found.remarks[0]
    assert loaded(tmp_path, rows).scenario.path.points == tuple(PLACES)
    metres = loaded(tmp_path, "0,0\n60,0\n", "origin: {lat: 48.1, lon: -3.01}\n")
    assert metres.scenario.path.points == ((0.0, 0.0), (60.0, 0.0))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (plan((16, (4806.0, -300.6)), (16, (4805.97, -300.58))), "degrees and minutes, ddmm.mmmm?"),
        (plan((178, (0, 0))), "has no waypoints; left out: change of speed (178): 1"),
        (
            '{"mission": {"items": [{"complexItemType": "StructureScan", "Layers": 2}]}}',
            "has no waypoints; left out: StructureScan: 1",
        ),
        (
            "polygon = format=radial, x=75, y=-75, radius=30, pts=8",
            "has no waypoints; left out: polygons by their form (write their points): 1",
        ),
        ('{"mission": {"items": [3]}}', "a mission item that is no mapping"),
        ("QGC WPL 110\n0 1 0 16 0\n", "line 2 is no item of QGC WPL 110, which has 12 numbers"),
        ('{"type": "Plan", ', "is no JSON"),
        (GPX.format('<rte><rtept lat="a" lon="3"/></rte>'), "latitude or longitude is no number"),
        ("<gpx><rte>", "is no XML"),
        ("<svg/>", "neither GPX nor KML"),
        ('<!DOCTYPE gpx [<!ENTITY a "b">]><gpx/>', "document type or entities"),
        ("lat,lon\n48.1,\n48.2,-3\n", "no latitude and longitude in line 2"),
        ("lat,lon\n48,1,-3,01\n48,2,-3,02\n", "no latitude and longitude in line 2"),
        ("lat [rad],lon [rad]\n0.84,-0.05\n0.85,-0.05\n", "in another unit than deg"),
        ("lat,lon\n", "has no waypoints"),
        (geojson({"type": "Point", "coordinates": [1]}), "latitude or longitude is no number"),
    ],
)
def test_a_damaged_route_is_one_sentence(tmp_path, text, says):
    with pytest.raises(ScenarioError, match=r"route\.dat") as caught:
        loaded(tmp_path, text)
    assert says in str(caught.value).splitlines()[0]


def test_an_item_that_is_no_waypoint_may_have_no_place(tmp_path):
    camera = {"command": 530, "frame": 2, "params": [0, 2, None, None, None, None, None]}
    text = json.dumps({"mission": {"items": [camera, *items(*AT)]}})
    found = loaded(tmp_path, text)
    assert len(found.scenario.path.points) == 3
    assert "command (530): 1" in found.remarks[0]


def test_an_empty_file_beside_an_origin_is_told(tmp_path):
    for text in ("", "# nothing\n"):
        with pytest.raises(ScenarioError, match="at least two points"):
            loaded(tmp_path, text, "origin: {lat: 48.1, lon: -3.01}\n")


def test_home_is_said_and_points_that_are_none_are_counted(tmp_path):
    home = WPL.replace("0\t0\t3\t16", "0\t0\t0\t16", 1)
    assert "the home of ArduPilot" in loaded(tmp_path, home).remarks[0]
    odd = loaded(tmp_path, "points = 1,2 : 3,x4 : 5,6 : label,go\n")
    assert odd.remarks == (
        f"{tmp_path}/route.dat: left out of the route: points that are no two numbers: 1",
    )


def test_a_waypoint_that_repeats_the_one_before_is_left_out(tmp_path):
    found = loaded(tmp_path, plan(AT[0], AT[0], AT[1]))
    assert len(found.scenario.path.points) == 2
    assert "waypoints where the one before is: 1" in found.remarks[0]


def test_a_route_far_from_its_origin_says_how_wrong_the_plane_is(tmp_path):
    found = loaded(tmp_path, FILES["GPX route"], "origin: {lat: 47.1, lon: -3.01}\n")
    assert "111.2 km from the origin" in found.remarks[0]
    assert "off by about 5.6 m" in found.remarks[0]


def test_damaged_files_end_in_a_sentence_and_nothing_else():
    """A thousand files with letters cut out, exchanged or doubled."""
    rng = random.Random(62)
    texts = [*FILES.values(), "points = 1,2:3,4\n"]
    read = 0
    for _ in range(1000):
        text = rng.choice(texts)
        for _ in range(rng.randint(1, 2)):
            a, b = sorted(rng.randrange(len(text)) for _ in range(2))
            b = min(b, a + 8)
            text = (
                text[:a] + rng.choice(["", text[a:b] * 2, "-", "{", "nan", "<", "1e400"]) + text[b:]
            )
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                route = route_of(text)
            except RouteFault:
                continue
        read += route is not None
    assert 50 < read < 950
