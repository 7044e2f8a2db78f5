"""A browser that shows reports at several widths."""

import json
import re
import shutil
import subprocess
from html import escape

import pytest
from html_tree import tree

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)


WIDTHS = (400, 800, 1400)


# Under virtual time hardly any frame is painted, so timers have to call for frames and say that the
# animation is in sight.
TICKING = """<script>
requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 16);
IntersectionObserver = class {
  constructor(tell) { this.tell = tell; }
  observe() { setTimeout(() => this.tell([{ isIntersecting: true }], this), 16); }
  disconnect() {}
};
</script>"""


QUIET = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-logging=stderr",
    "--window-size=1500,3000",
    "--virtual-time-budget=6000",
)


PROBE = """
<script>
const said = {};
const record = (name, what) => { said[name] = what; };
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const look = async (frame) => {
  const page = frame.contentDocument, one = (s) => page.querySelector(s), width = frame.clientWidth;
  const inside = (e) => e.closest(".wide, details:not([open]), svg");
  const wide = [...page.querySelectorAll("body *")].filter((e) => !inside(e.parentElement))
    .filter((e) => e.getBoundingClientRect().right > width + 0.5)
    .map((e) => e.outerHTML.slice(0, 80));
  const now = () => parseFloat(one("output").textContent.slice(4));
  const hull = () => one(".map polygon").getAttribute("points");
  const told = { wide, width, start: now(), hull: hull() };
  told.scroll = page.documentElement.scrollWidth;
  told.pictures = [...page.images].map((image) =>
    [image.naturalWidth, image.width, image.closest(".card").clientWidth]);
  told.images = [...page.images].map((image) => image.naturalWidth);
  await sleep(600);
  told.played = now();
  told.moved = hull();
  one(".play").click();
  told.paused = now();
  await sleep(300);
  told.rested = now();
  const slider = one("input[type=range]");
  slider.value = 50;
  slider.dispatchEvent(new frame.contentWindow.Event("input"));
  told.scrubbed = [now(), hull(), one(".map polygon.lost") !== null, one(".key").textContent];
  const { KeyboardEvent } = frame.contentWindow;
  const key = (name) => one("#stage").dispatchEvent(new KeyboardEvent("keydown", { key: name }));
  key("End"); told.end = now(); key("Home"); told.home = now();
  key("ArrowRight"); told.stepped = now();
  key(" "); await sleep(300); told.again = now(); told.button = one(".play").textContent;
  frame.contentWindow.location.hash = "#t=12.5"; await sleep(300); told.asked = now();
  told.traces = page.querySelectorAll(".trace polyline").length;
  told.bad = /NaN|undefined|Infinity/.test(one(".map").outerHTML + one(".trace").outerHTML);
  return told;
};
addEventListener("load", async () => {
  for (const frame of document.querySelectorAll("iframe"))
    record(frame.id, await look(frame).catch((error) => ({ error: `${error}` })));
  const end = document.createElement("output");
  end.id = "said";
  end.textContent = JSON.stringify(said);
  document.body.append(end);
});
</script>
"""


def browsed(tmp_path, html, *options, probe=PROBE):
    """What a probe finds at every width, and what the browser's console says."""
    html = html.replace("<head>", f"<head>{TICKING}")
    frames = "".join(
        f'<iframe id="w{width}" width="{width}" height="900" srcdoc="{escape(html)}"></iframe>'
        for width in WIDTHS
    )
    path = tmp_path / "frames.html"
    path.write_text(f"<!doctype html><body>{probe}{frames}</body>")
    own = (*options, f"--user-data-dir={tmp_path}/browser", "--dump-dom", path.as_uri())
    made = subprocess.run(
        [str(BROWSER), *QUIET, *own], capture_output=True, text=True, timeout=120, check=True
    )
    said = re.search(r'<output id="said">(.*?)</output>', made.stdout, re.DOTALL)
    assert said, made.stderr[-2000:]
    console = [line for line in made.stderr.splitlines() if "CONSOLE" in line]
    return json.loads(tree(said[0]).text), console


needs_browser = pytest.mark.skipif(
    BROWSER is None, reason=f"no browser: none of {', '.join(BROWSERS)} is on the path"
)
