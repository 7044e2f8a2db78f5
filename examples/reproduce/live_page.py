"""docs/images/live.gif: the page of `podusv live` while a slider moves, recorded in Chromium.

    PYTHONPATH=. python examples/reproduce/live_page.py

The delay of the command goes from 0 to 0.7 s and back, on the demo's scenario.
"""

from __future__ import annotations

import io
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image

from benchmarks.browser import Page, chromium

FILE = Path(__file__).parents[2] / "docs" / "images" / "live.gif"
SLIDER = "v-actuator.command.delay"
DELAYS = (*range(0, 71, 7), *range(56, -1, -14))  # steps of 0.01 s
WIDTH, HEIGHT = 1240, 760  # pixels
SHOWN, COLORS = 900, 64  # pixels of the recording's width, and its colours
FRAME, LAST = 160, 1500  # ms
QUIET = "window.seen?.frames > 0 && document.getElementById('state').textContent === ''"


@contextmanager
def serve_demo() -> Iterator[str]:
    """The address of a page of the demo's scenario."""
    command = [sys.executable, "-m", "podusv_cli", "live", "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found
        try:
            yield found[0]
        finally:
            process.send_signal(signal.SIGINT)


def move_slider(page: Page, steps: int) -> None:
    """Move the slider and wait until what it gives is drawn."""
    page.run(f"""(async () => {{
      const slider = document.getElementById("{SLIDER}"), frames = window.seen.frames;
      slider.focus();
      slider.value = {steps / 100};
      slider.dispatchEvent(new Event("input"));
      while (window.seen.frames === frames) await new Promise((done) => setTimeout(done, 5));
      await new Promise((done) => setTimeout(done, 50));
    }})()""")


def record(page: Page) -> list[Image.Image]:
    """A picture for each place of the slider."""
    pictures = []
    for steps in DELAYS:
        move_slider(page, steps)
        picture = Image.open(io.BytesIO(page.picture())).convert("RGB")
        pictures.append(picture.resize((SHOWN, HEIGHT * SHOWN // WIDTH), Image.Resampling.LANCZOS))
    return pictures


def write_gif(pictures: list[Image.Image], file: Path) -> None:
    """All pictures in the colours of the middle one, in which the curves are apart."""
    palette = pictures[len(pictures) // 2].quantize(COLORS, kmeans=3)
    drawn = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    drawn[0].save(
        file,
        save_all=True,
        append_images=drawn[1:],
        loop=0,
        optimize=True,
        duration=[*[FRAME] * (len(drawn) - 1), LAST],
    )


def main() -> None:
    """Record the page and write the GIF."""
    with serve_demo() as address, chromium() as browser:
        page = browser.open(address, WIDTH, HEIGHT)
        page.wait(QUIET)
        write_gif(record(page), FILE)
    print(f"{FILE}: {FILE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
