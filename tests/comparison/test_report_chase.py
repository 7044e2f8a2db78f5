"""The report's animation: what it is given, and in a browser, what it shows."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from browser_samples import PROBE, WIDTHS, browsed, needs_browser
from comparison_samples import FRAME, about
from drawn_samples import recording, shown
from html_tree import tree
from page_samples import ERRORS, page, theory
from PIL import Image

from podusv_cli.comparison import table
from podusv_cli.figures import chase
from podusv_cli.scenario.load import load_text

NO_STANDOFF = """
vessel: {preset: paper}
path: {kind: line}
disturbance: {kind: none}
actuator: {kind: ideal}
controller: {kind: pid, standoff: 0.0}
"""


def diverged(end=40.0):
    """A run whose last second takes it beyond all numbers."""
    run = recording(end=end, period=0.05, status="diverged")
    x = run["x"].copy()
    x[-20:] = np.geomspace(1e2, 1e300, 20)
    told = f"diverged at t = {end:g} s: x is not finite"
    return replace(run, signals={**run.signals, "x": x}, message=told)


def runs():
    """A whole run, one with another step that diverges, one of a law that logs little."""
    bare = recording(end=60.0, without=("z_e", "psi_e", "alpha_u"))
    return shown(
        ("whole <b>", recording()),
        ("lost", diverged()),
        ("bare", bare),
        ("apart", recording(shift=1.0), load_text(NO_STANDOFF, "a.yaml").scenario),
    )


def test_positions_are_thinned_and_rounded_to_millimetres():
    told = chase.chase(shown(("long", recording(end=400.0, period=0.05))))
    (run,) = told["runs"]
    assert len(run["time"]) == chase.FRAMES
    assert (run["time"][0], run["time"][-1], told["end"]) == (0.0, 400.0, 400.0)
    log = recording(end=400.0, period=0.05)
    rows = np.searchsorted(log["time"], np.array(run["time"]) - 1e-6)
    for name in ("x", "y", "x_d", "y_d"):
        np.testing.assert_allclose(run[name], log[name][rows], atol=5.1e-4, rtol=0)
        assert all(number == round(number, 3) for number in run[name])
    short = chase.chase(shown(("short", recording(end=10.0))))["runs"][0]
    assert len(short["time"]) == 101


def test_the_map_has_room_for_a_hull_at_the_end_of_its_track():
    (run,) = moving = shown(("a", recording(end=1.0)))
    west, south, east, north = chase.chase(moving)["box"]
    x, y = run.signal("x"), run.signal("y")
    assert x.max() + run.length / 2 <= north
    assert south <= x.min() - run.length / 2
    assert y.max() + run.length / 2 <= east
    assert west <= y.min() - run.length / 2


def test_the_ends_of_runs_are_told():
    whole, lost, bare, apart = chase.chase(runs())["runs"]
    assert [run["ending"] for run in (whole, lost, bare)] == ["", "diverged at t = 40 s", ""]
    assert max(lost["x"]) == chase.FAR
    assert bare["distance"] == []
    assert (whole["standoff"], apart["standoff"]) == (0.5, 0.0)
    cut = replace(recording(end=3.0), status="interrupted")
    assert chase.chase(shown(("a", cut)))["runs"][0]["ending"] == "interrupted at t = 3 s"


def test_what_is_no_number_is_none():
    gaps = recording(z_e=lambda t: np.where(t < 5, np.nan, np.where(t < 6, np.inf, 1.0)))
    distances = chase.chase(shown(("a", gaps)))["runs"][0]["distance"]
    assert (distances[0], distances[55], distances[-1]) == (None, chase.FAR, 1.0)
    assert "NaN" not in chase.as_json(chase.chase(shown(("a", gaps))))


def test_on_legs_the_distance_is_that_from_the_path():
    beside = recording(without=("z_e",), e_ct=lambda t: np.where(t < 5, -0.25, 0.5))
    (run,) = chase.chase(shown(("a", beside)))["runs"]
    assert (run["distance"][0], run["distance"][-1]) == (0.25, 0.5)
    assert "x_d" not in run


def test_runs_that_cannot_be_placed_have_no_animation():
    assert chase.chase([]) == {}
    assert chase.chase(shown(("a", recording(without=("psi",))))) == {}
    both = chase.chase(shown(("a", recording(without=("psi",))), ("b", recording())))
    assert [run["label"] for run in both["runs"]] == ["b"]
    assert "<script" not in page(chase={})


def test_no_text_ends_the_script_that_holds_it():
    odd = "</script><script>alert(1)</script><!--"
    told = tree(page(chase=chase.chase(shown((odd, recording())))))
    shared, data, _ = told.all("script")
    assert json.loads(data.raw)["runs"][0]["label"] == odd
    assert "use strict" in shared.raw
    assert odd in told.all("ul", kind="key")[0].text


# --- in a browser


def picture(width: int = 700) -> bytes:
    """A PNG, by default wider than a phone."""
    file = io.BytesIO()
    Image.new("P", (width, 300)).save(file, "PNG")
    return file.getvalue()


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    every = {label: FRAME.of(label) for label in FRAME.columns}
    wide = table.table(every | {f"a_long_label_of_a_run_{i}": FRAME.of("a") for i in range(8)})
    html = page(
        chase=chase.chase(runs()),
        theories={"a": theory(2.5, True)},
        table=wide,
        figures=[ERRORS._replace(file=picture(), phone=picture(300))] * 4,
        provenance={"argv": ["podusv", "x" * 300]},
        title="long" * 60,
        abouts={"a": about("description=" + "word/" * 90)},
    )
    return browsed(tmp_path_factory.mktemp("browser"), html)


@needs_browser
@pytest.mark.browser
def test_the_console_has_nothing_to_say(seen):
    assert seen[1] == []
    assert [said.get("error") for said in seen[0].values()] == [None] * len(WIDTHS)


@needs_browser
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_wider_than_the_window_and_every_image_is_there(seen, width):
    said = seen[0][f"w{width}"]
    assert said["width"] == width
    assert said["wide"] == []
    assert said["scroll"] <= width
    assert len(said["images"]) == 4
    assert min(said["images"]) > 0


@needs_browser
@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_the_animation_moves_pauses_and_scrubs(seen, width):
    said = seen[0][f"w{width}"]
    assert said["played"] > said["start"]
    assert said["moved"] != said["hull"]
    assert said["paused"] == said["rested"] >= said["played"]
    t, hull, lost, key = said["scrubbed"]
    assert t == 50
    assert hull not in (said["hull"], said["moved"])
    assert lost
    assert "diverged at t = 40 s" in key
    assert (said["end"], said["home"], said["stepped"]) == (100, 0, 0.5)
    assert said["again"] > said["stepped"]
    assert said["button"] == "Pause"
    assert said["asked"] == 12.5
    assert said["traces"] == 3
    assert not said["bad"]


SHAPE = PROBE.replace(
    "await look(frame)", "frame.contentDocument.querySelector('.map').getAttribute('viewBox')"
).replace(".catch((error) => ({ error: `${error}` }))", "")


@needs_browser
@pytest.mark.browser
@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 3.0])
def test_the_map_has_the_shape_of_the_course(tmp_path, ratio):
    told = chase.chase(runs()) | {"box": [0.0, 0.0, 10.0 * ratio, 10.0]}
    said, _ = browsed(tmp_path, page(chase=told), probe=SHAPE)
    for place, box in said.items():
        width, height = map(float, box.split()[2:])
        course = min(width / ratio, height) ** 2 * ratio
        assert course > 0.74 * width * height, (place, width, height)


@needs_browser
@pytest.mark.browser
def test_a_phone_has_figures_of_one_column_that_do_not_scroll(seen):
    for width, phone in zip(WIDTHS, (True, False, False), strict=True):
        for natural, drawn, room in seen[0][f"w{width}"]["pictures"]:
            assert natural == (300 if phone else 700)
            assert drawn <= room


@needs_browser
@pytest.mark.browser
def test_who_wants_less_motion_gets_a_paused_animation(tmp_path):
    said, console = browsed(
        tmp_path, page(chase=chase.chase(runs())), "--force-prefers-reduced-motion"
    )
    assert console == []
    assert said["w800"]["start"] == said["w800"]["played"] == 0
