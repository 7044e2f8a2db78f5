"""The page of `podusv live` in a real browser: what a person does with it, and what it shows."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from benchmarks.browser import BROWSER, Chromium, Page, chromium

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(BROWSER is None, reason="no browser is on the path"),
]
LEGS = "podusv:laws/legs.yaml"
QUIET = """window.seen?.frames > 0
    && /^(refused.*)?$/.test(document.getElementById("state").textContent)"""
OVERFLOWING = """[...document.querySelectorAll("body *")].filter((one) => {
    const { right, width } = one.getBoundingClientRect();
    return width && right > innerWidth + 1 && !one.closest(".wide, svg, .key");
}).map((one) => one.tagName + "#" + one.id)"""
CUT_TITLES = """[...document.querySelectorAll("#plot .title")].filter((one) =>
    one.getBoundingClientRect().right > one.closest("svg").getBoundingClientRect().right
).map((one) => one.textContent)"""
ROLES = {"slider", "spinbutton", "combobox", "textbox", "button", "checkbox"}


@contextmanager
def serve(folder: Path, *words: str) -> Iterator[str]:
    """The address of a page."""
    command = [sys.executable, "-m", "podusv_cli", "live", *words, "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=folder) as process:
        assert process.stdout
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found
        try:
            yield found[0]
            process.send_signal(signal.SIGINT)
            assert process.wait(30) == 130
        finally:
            process.kill()


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a page that is served without a scenario's name, which is the demo's."""
    with serve(tmp_path_factory.mktemp("served")) as address:
        yield address


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def page(browser: Chromium, address: str) -> Page:
    page = browser.open(address)
    page.wait(QUIET)
    return page


def text(page: Page, name: str) -> str:
    return str(page.run(f"document.getElementById('{name}').textContent"))


def choose(page: Page, name: str, value: Any, event: str = "change") -> None:
    """Give a menu or a slider a value, and wait until all is computed."""
    page.run(
        f"{{ const one = document.getElementById('{name}'); one.value = {value!r};"
        f" one.dispatchEvent(new Event('{event}')); }}"
    )
    page.run("new Promise((done) => setTimeout(done, 50))")
    page.wait(QUIET)


def enter(page: Page, key: str, number: float) -> None:
    """Type a number into the box beside a slider, and wait until all is computed."""
    page.run(
        f"{{ const box = document.getElementById('v-{key}').parentNode.querySelector("
        f"'input[type=number]'); box.value = {number}; box.dispatchEvent(new Event('change')); }}"
    )
    page.run("new Promise((done) => setTimeout(done, 50))")
    page.wait(QUIET)


def test_without_a_scenario_the_demo_is_there(page: Page) -> None:
    assert text(page, "command") == "podusv compare podusv:demo.yaml"
    assert page.run("document.title") == "podusv:demo.yaml"
    assert page.faults() == []


def test_an_arrow_key_on_a_slider_moves_curves_and_command(page: Page) -> None:
    curve = "document.querySelector('.curves g path').getAttribute('d')"
    before = page.run(curve)
    page.run("document.getElementById('v-controllers.pid_winds_up.K_Pu').focus()")
    for _ in range(9):
        page.press("ArrowRight", 39)
    page.wait("document.getElementById('command').textContent.includes('K_Pu=')")
    page.wait(QUIET)
    assert page.run(curve) != before
    said = page.run("document.activeElement.getAttribute('aria-valuetext')")
    number = text(page, "command").split("K_Pu=")[1]
    assert said == f"{number} kg/s"


def test_a_verdict_that_turns_says_at_which_value(page: Page) -> None:
    enter(page, "actuator.surge_limit", 6)
    assert text(page, "turned") == ""
    enter(page, "actuator.surge_limit", 4)
    assert text(page, "turned") == ("D1 turned: holds at 6, fails at actuator.surge_limit = 4")
    assert "fails D1" in text(page, "verdicts")
    assert "at the actuator's limits 67.2 % of the time" in text(page, "limits")


def test_margins_say_for_which_values_they_hold_and_why_there_are_none(page: Page) -> None:
    page.wait("document.getElementById('margins').textContent")
    assert "no margins, as the target moves steadily" in text(page, "margins")
    choose(page, "v-path.kind", "line")
    page.wait("!!document.querySelector('#margins table')")
    assert "at path.kind = line" in text(page, "margins")
    assert page.run("document.querySelectorAll('#margins tr').length") == 7


def test_a_refused_value_has_its_sentence_beside_it_and_the_curves_stay(page: Page) -> None:
    enter(page, "vessel.m", -5)
    said = page.run(
        "document.getElementById('v-vessel.m').parentNode.querySelector('.no').textContent"
    )
    assert "must be" in said
    assert text(page, "state").startswith("refused")
    enter(page, "vessel.m", 30)
    assert page.run("document.querySelector('.value .no')") is None


def test_what_is_kept_stays_as_pale_curves(page: Page) -> None:
    page.run("document.getElementById('keep').click()")
    enter(page, "actuator.surge_limit", 5)
    assert page.run("""document.querySelectorAll('.curves g path[opacity="0.35"]').length""") >= 10
    heads = page.run("[...document.querySelectorAll('#numbers th')].map((one) => one.textContent)")
    assert "pid, kept" in heads


def test_the_address_holds_what_is_shown(browser: Chromium, page: Page, address: str) -> None:
    enter(page, "actuator.surge_limit", 5)
    again = browser.open(page.run("location.href"))
    again.wait(QUIET)
    assert text(again, "command").endswith("--set actuator.surge_limit=5")


def test_a_law_is_added_from_the_menu_and_removed(page: Page) -> None:
    choose(page, "add", "pid")
    assert text(page, "command").endswith("--set controllers.pid_2.kind=pid")
    assert page.run("document.querySelectorAll('#plot .key li').length") == 4
    page.run("document.querySelector('#parts button').click()")
    page.run("new Promise((done) => setTimeout(done, 50))")
    page.wait(QUIET)
    assert text(page, "command") == "podusv compare podusv:demo.yaml"


def test_the_report_opens_from_the_page(browser: Chromium, page: Page) -> None:
    page.run("document.getElementById('report').click()")
    link = page.wait("document.querySelector('#saved a')?.href", 120)
    assert link.startswith("blob:http://127.0.0.1:")
    size = page.run("fetch(document.querySelector('#saved a').href).catch(() => 0)")
    assert size is not None
    assert "report.html" in text(page, "saved")


def test_everything_that_is_moved_has_a_name_for_a_screen_reader(page: Page) -> None:
    page.ask("Accessibility.enable")
    nodes = page.ask("Accessibility.getFullAXTree")["nodes"]
    moved = [node for node in nodes if node.get("role", {}).get("value") in ROLES]
    nameless = [node["role"] for node in moved if not node.get("name", {}).get("value")]
    assert len(moved) > 30
    assert nameless == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 800, 1280, 1920])
def test_nothing_is_wider_than_the_window(page: Page, width: int, scheme: str) -> None:
    page.darken(scheme)
    page.resize(width, 800)
    page.run("dispatchEvent(new Event('resize')); new Promise((done) => setTimeout(done, 100))")
    assert page.run("document.documentElement.scrollWidth") <= width
    assert page.run(OVERFLOWING) == []
    assert page.run(CUT_TITLES) == []
    colour = page.run("getComputedStyle(document.body).backgroundColor")
    assert (colour == "rgb(255, 255, 255)") == (scheme == "light")


def test_on_paper_there_is_what_is_shown_without_sliders(page: Page) -> None:
    page.ask("Emulation.setEmulatedMedia", media="print")
    visible = {
        name: page.run(f"document.getElementById('{name}').checkVisibility()")
        for name in ("parts", "bar", "command", "numbers", "verdicts", "plot", "stage")
    }
    page.ask("Emulation.setEmulatedMedia", media="")
    assert [name for name, seen in visible.items() if not seen] == ["parts", "bar"]


def test_many_frames_leave_no_nodes_behind(page: Page) -> None:
    page.ask("HeapProfiler.enable")

    def count_nodes() -> int:
        enter(page, "actuator.surge_limit", 8)
        page.ask("HeapProfiler.collectGarbage")
        return int(page.ask("Memory.getDOMCounters")["nodes"])

    before = count_nodes()
    page.run("""(async () => {
      const slider = document.getElementById("v-actuator.surge_limit"), at = +slider.value;
      for (let i = 0; i < 40; i++) {
        const frames = window.seen.frames;
        slider.value = at + 0.01 * (i % 10);
        slider.dispatchEvent(new Event("input"));
        while (window.seen.frames === frames) await new Promise((done) => setTimeout(done, 2));
      }
    })()""")
    assert count_nodes() <= before + 20
    assert page.faults() == []


def test_a_waypoint_is_dragged_on_the_map(browser: Chromium, tmp_path: Path) -> None:
    with serve(tmp_path, LEGS) as address:
        page = browser.open(address)
        page.wait(QUIET)
        grips = page.run("""[...document.querySelectorAll(".grip")].map((grip) => {
            const { x, y, width } = grip.getBoundingClientRect();
            return [x + width / 2, y + width / 2]; })""")
        points = [
            page.run(f"+document.getElementById('v-path.points[{i}][{axis}]').value")
            for i in (0, 1)
            for axis in (0, 1)
        ]
        metres = abs(complex(points[2] - points[0], points[3] - points[1]))
        pixels = abs(complex(grips[1][0] - grips[0][0], grips[1][1] - grips[0][1]))
        x, y = grips[1]
        mouse = {"button": "left", "buttons": 1, "clickCount": 1}
        page.ask("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, **mouse)
        for far in range(1, 25):
            page.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x + far, y=y, **mouse)
        page.ask("Input.dispatchMouseEvent", type="mouseReleased", x=x + 24, y=y, **mouse)
        page.run("new Promise((done) => setTimeout(done, 50))")
        page.wait(QUIET)
        command = text(page, "command")
        found = re.search(r"points\[1\]\[0\]=([-.\d]+).*points\[1\]\[1\]=([-.\d]+)", command)
        assert found
        assert float(found[1]) == pytest.approx(points[2], abs=2 * metres / pixels)
        assert float(found[2]) == pytest.approx(
            points[3] + 24 * metres / pixels, rel=0.02, abs=0.05
        )
        assert page.faults() == []
