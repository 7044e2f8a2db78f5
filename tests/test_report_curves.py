"""The report's curves: what they are given, and in a browser, what they show."""

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from drawn_samples import recording, shown
from html_tree import tree
from test_comparison_page import page
from test_report_chase import browsed, needs_browser

from podusv_cli.comparison import traces

ODD = "</script><script>alert(1)</script><!--"


def decoded(curve):
    """Numbers and places of an encoded curve."""
    return (
        np.frombuffer(base64.b64decode(curve["numbers"]), dtype="<f4"),
        np.frombuffer(base64.b64decode(curve["places"]), dtype="u1"),
    )


def test_a_spike_survives_and_stands_at_its_time():
    numbers = np.sin(np.linspace(0.0, 6.0, 31_001))
    numbers[20_000] = 7.5
    numbers[100:300] = np.nan
    kept, places = traces.thinned(numbers)
    assert len(kept) == len(places) == 2 * traces.PIECES
    assert (np.nanmax(kept), np.nanmin(kept)) == (7.5, numbers[np.isfinite(numbers)].min())
    at = int(np.nanargmax(kept))
    time = (at // 2 + places[at] / 256) / traces.PIECES
    assert time == pytest.approx(20_000 / 31_001, abs=2 / 256 / traces.PIECES)
    assert np.isnan(kept).any(), "a gap longer than a piece stays one"


@pytest.mark.skipif(shutil.which("node") is None, reason="runs the page's script with Node.js")
def test_the_page_puts_a_spike_at_its_time():
    """By the script's own function, not by a second one in Python."""
    numbers = np.zeros(31_001)
    numbers[20_001] = 7.5
    curve = traces.encoded(*traces.thinned(numbers))
    template = Path(traces.__file__).parent / "templates" / "curves.js"
    (function,) = re.findall(r"^  const decoded = .*?^  };$", template.read_text(), re.M | re.S)
    script = f"""const chosen = {{ selectedIndex: 0 }};
      {function}
      const run = {{ start: 100.0, end: 410.0, curves: [{json.dumps(curve)}] }};
      console.log(curve(run).find((point) => point.y === 7.5).t);"""
    found = subprocess.run(["node", "-e", script], capture_output=True, text=True, check=True)
    piece = 310.0 / traces.PIECES
    assert float(found.stdout) == pytest.approx(
        100.0 + 310.0 * 20_001 / 31_001, abs=2 / 256 * piece
    )


def test_a_short_signal_is_whole_and_evenly_spaced():
    numbers = np.linspace(0.0, 1.0, 2 * traces.PIECES)
    kept, places = traces.thinned(numbers)
    assert kept is numbers
    assert len(places) == 0


def test_what_comes_out_of_base_64_is_what_went_in_and_beyond_numbers_there_is_none():
    numbers, places = np.array([1.5, -2e300, np.inf, np.nan]), np.array([0, 255, 3, 4])
    back, where = decoded(traces.encoded(numbers, places))
    assert back[0] == 1.5
    assert np.isnan(back[1:]).all()
    assert where.tolist() == [0, 255, 3, 4]


def test_only_what_all_runs_have_is_shown_in_words_and_nothing_but_scalars():
    both = traces.traces(shown(("a", recording()), ("b", recording(without=("alpha_u",)))))
    names = [signal["name"] for signal in both["signals"]]
    assert names[0] == "z_e"
    assert "tau_u" in names
    assert "alpha_u" not in names
    assert "time" not in names
    assert not [s["meaning"] for s in both["signals"] if re.search(r"\(\d+\)", s["meaning"])]
    assert {len(run["curves"]) for run in both["runs"]} == {len(names)}
    numbers, _ = decoded(both["runs"][0]["curves"][names.index("tau_u")])
    assert numbers.max() == pytest.approx(recording()["tau_u"].max(), rel=1e-6)


def test_no_text_of_a_user_reaches_the_script():
    told = tree(page(traces=traces.traces(shown((ODD, recording())))))
    assert len(told.all("script")) == 3
    data = told.all("script")[1]
    assert json.loads(data.raw)["runs"][0]["label"] == ODD
    assert ODD in told.all("section", id="curves")[0].all("ul", kind="key")[0].text


PROBE = """
<script>
addEventListener("load", () => {
  const said = {};
  for (const frame of document.querySelectorAll("iframe")) {
    const page = frame.contentDocument, one = (s) => page.querySelector(s);
    const plot = one(".curves"), box = plot.getBoundingClientRect();
    const at = (name, x) => plot.dispatchEvent(new frame.contentWindow.PointerEvent(
      name, { clientX: box.left + x, clientY: box.top + 50, pointerId: 1 }));
    const texts = () => [...plot.querySelectorAll("text")].map((e) => e.textContent);
    const ends = () => texts().filter((text) => text.endsWith(" s"));
    plot.setPointerCapture = () => {};
    const told = { whole: ends(), paths: plot.querySelectorAll("g path:not(.cursor)").length };
    at("pointermove", box.width / 2);
    told.time = one("#plot output").textContent;
    told.values = [...page.querySelectorAll("#plot .key small")].map((e) => e.textContent);
    at("pointerdown", 100); at("pointermove", 160); at("pointerup", 160);
    told.zoomed = ends();
    page.querySelectorAll("#plot input")[0].click();
    told.off = plot.querySelectorAll("g path:not(.cursor)").length;
    const choice = one("#plot select");
    choice.selectedIndex = 1;
    choice.dispatchEvent(new frame.contentWindow.Event("change"));
    one("#plot button").click();
    told.back = ends();
    told.bad = /NaN|undefined|Infinity/.test(plot.outerHTML);
    told.wide = page.documentElement.scrollWidth - frame.clientWidth;
    said[frame.id] = told;
  }
  const end = document.createElement("output");
  end.id = "said";
  end.textContent = JSON.stringify(said);
  document.body.append(end);
});
</script>
"""


@needs_browser
@pytest.mark.browser
def test_curves_zoom_tell_values_and_can_be_taken_out(tmp_path):
    gap = recording(z_e=lambda t: np.where(t < 30.0, np.nan, 1.0))
    both = shown(("whole", recording()), ("gap", gap))
    html = page(traces=traces.traces(both))
    said, console = browsed(tmp_path, html, probe=PROBE)
    assert not console
    for width, told in said.items():
        assert told["paths"] == len(both), width
        assert told["off"] == len(both) - 1
        time = float(re.fullmatch(r"t = ([\d.]+) s", told["time"])[1])
        shown_value = float(told["values"][0].removesuffix(" m"))
        assert shown_value == pytest.approx(1.5 + 0.5 * np.cos(time), abs=0.1)
        assert told["zoomed"] != told["whole"] == told["back"]
        assert not told["bad"]
        assert told["wide"] <= 0
