"""The report's curves: what they are given, and in a browser, what they show."""

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser_samples import browsed, needs_browser
from drawn_samples import drawn, panels, recording, shown
from html_tree import tree
from known_signals import ABOUT
from page_samples import page

from podusv_cli import pages
from podusv_cli.core.derived_signals import derived_with
from podusv_cli.core.quantities import letters_of_symbol
from podusv_cli.figures import traces

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
    kept, places = traces.thin_trace(numbers)
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
    curve = traces.encode_trace(*traces.thin_trace(numbers))
    template = Path(pages.__file__).parent / "templates" / "curves.js"
    (function,) = re.findall(r"^  const decoded = .*?^  };$", template.read_text(), re.M | re.S)
    script = f"""{function}
      const run = {{ start: 100.0, end: 410.0, curves: [{json.dumps(curve)}] }};
      console.log(curve(run, 0).find((point) => point.y === 7.5).t);"""
    found = subprocess.run(["node", "-e", script], capture_output=True, text=True, check=True)
    piece = 310.0 / traces.PIECES
    assert float(found.stdout) == pytest.approx(
        100.0 + 310.0 * 20_001 / 31_001, abs=2 / 256 * piece
    )


def test_a_short_signal_is_whole_and_evenly_spaced():
    numbers = np.linspace(0.0, 1.0, 2 * traces.PIECES)
    kept, places = traces.thin_trace(numbers)
    assert kept is numbers
    assert len(places) == 0


def test_what_comes_out_of_base_64_is_what_went_in_and_beyond_numbers_there_is_none():
    numbers, places = np.array([1.5, -2e300, np.inf, np.nan]), np.array([0, 255, 3, 4])
    back, where = decoded(traces.encode_trace(numbers, places))
    assert back[0] == 1.5
    assert np.isnan(back[1:]).all()
    assert where.tolist() == [0, 255, 3, 4]


def test_all_scalars_are_shown_in_words_symbols_and_units_and_one_that_a_run_lacks_is_null():
    both = traces.traces(shown(("a", recording()), ("b", recording(without=("alpha_u",)))))
    names = [signal["name"] for signal in both["signals"]]
    assert names[: both["first"]] == ["z_e", "psi_e", "tau_u", "tau_r"]
    assert {"x_e", "y_e", "alpha_u", "u"} <= set(names)
    assert not {"time", "W_hat_u"} & set(names)
    assert not [s["meaning"] for s in both["signals"] if re.search(r"\(\d+\)", s["meaning"])]
    assert {len(run["curves"]) for run in both["runs"]} == {len(names)}
    lacking = [run["curves"][names.index("alpha_u")] is None for run in both["runs"]]
    assert lacking == [False, True]
    force = both["signals"][names.index("tau_u_cmd")]
    assert (force["symbol"], force["unit"]) == ([("τ", "u,cmd")], "N")
    numbers, _ = decoded(both["runs"][0]["curves"][names.index("tau_u")])
    assert numbers.max() == pytest.approx(recording()["tau_u"].max(), rel=1e-6)


def test_of_a_vessel_that_is_asked_for_a_sway_force_it_is_seen_first_too():
    asked = recording(tau_v_cmd=np.sin, tau_v=np.cos)
    both = traces.traces(shown(("a", recording()), ("b", asked)))
    names = [signal["name"] for signal in both["signals"]]
    assert names[: both["first"]] == ["z_e", "psi_e", "tau_u", "tau_r", "tau_v"]


def test_of_many_runs_there_are_fewer_signals():
    runs = shown(*[(f"run {i}", recording()) for i in range(30)])
    assert len(traces.traces(runs)["signals"]) == traces.MOST


PEAKS = {
    "u": lambda t: 0.3 * np.cos(t) - 900.0 * (t == 2.0),
    "v": lambda t: 1e-6 * np.cos(t) + 900.0 * (t == 2.0),
}


def test_an_axis_is_logarithmic_where_the_figure_s_is_and_from_the_same_size_on():
    runs = shown(("a", recording(**PEAKS, saturated=lambda t: t == 2.0)))
    about = {signal["name"]: signal for signal in traces.traces(runs)["signals"]}
    assert (about["u"]["linear"], about["u"]["floor"]) == (1.0, False)  # above 0.3
    panel = panels(drawn("velocities", runs))["$u$ [m/s]"]
    assert panel.get_yaxis().get_transform().linthresh == 1.0
    assert about["v"]["linear"] == 0.1, "four decades below the peak"
    assert about["tau_r"]["linear"] is None, "no peak"
    brief = recording(v=lambda t: 1e-6 * np.cos(t) + 900.0 * (t == 2.0), end=1000.0)
    long = {signal["name"]: signal for signal in traces.traces(shown(("a", brief)))["signals"]}
    assert long["v"]["linear"] == 0.1, "four decades below, where the mean is five"
    assert about["saturated"]["linear"] is None, "a state, no size"
    z_e = panels(drawn("errors", runs))["$z_e$ [m]"]
    assert about["z_e"]["floor"]
    assert about["z_e"]["linear"] <= z_e.get_ylim()[0]


@pytest.mark.skipif(shutil.which("node") is None, reason="runs the page's script with Node.js")
@pytest.mark.parametrize(
    ("floor", "numbers", "places"),
    [
        (False, [-1000.0, -0.1, -0.05, 0.0, 0.05, 10.0], [-5.0, -1.0, -0.5, 0.0, 0.5, 3.0]),
        (True, [-3.0, 0.0, 0.05, 0.1, 1.0], [2.477121255, 1.0, 1.0, 1.0, 2.0]),
    ],
)
def test_numbers_that_are_no_powers_have_a_place_on_a_logarithmic_axis(floor, numbers, places):
    template = Path(pages.__file__).parent / "templates" / "curves.js"
    (function,) = re.findall(r"^  const warped = .*?^  };$", template.read_text(), re.M | re.S)
    (inverse,) = re.findall(r"^  const number = .*$", template.read_text(), re.M)
    script = f"""{function}{inverse}
      const scale = {{ linear: 0.1, floor: {json.dumps(floor)} }};
      const places = {json.dumps(numbers)}.map((y) => warped(scale, y));
      console.log(JSON.stringify([places, places.map((w) => number(scale, w))]));"""
    found = subprocess.run(["node", "-e", script], capture_output=True, text=True, check=True)
    at, back = json.loads(found.stdout)
    assert at == pytest.approx(places)
    sizes = np.maximum(np.abs(numbers), 0.1) if floor else numbers
    assert back == pytest.approx(sizes)


@pytest.mark.parametrize(
    ("symbol", "pieces"),
    [
        ("x", [("x", "")]),
        (r"V_{\psi_e}", [("V", "ψe")]),
        (r"|\hat W_r|", [("|W\u0302", "r"), ("|", "")]),
        (r"\dot\psi_d^-", [("ψ\u0307", "d"), ("\u207b", "")]),
        (r"\max\Phi", [("maxΦ", "")]),
        (r"n_\mathrm{cmd}", [("n", "cmd")]),
    ],
)
def test_a_symbol_is_text_on_the_line_and_below(symbol, pieces):
    assert letters_of_symbol(symbol) == pieces


def test_every_symbol_of_podusv_becomes_text_without_latex():
    derived = {name: one.signal for name, one in derived_with(()).items()}
    for signal in {**ABOUT, **derived}.values():
        assert not re.search(r"[\\{}_^$]", "".join(map("".join, letters_of_symbol(signal.symbol))))


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
    const paths = () => plot.querySelectorAll("g path").length;
    const change = (box) => box.click();
    plot.setPointerCapture = () => {};
    const told = { whole: ends(), paths: paths(), bent: texts() };
    told.labels = [...plot.querySelectorAll(".label")].map((e) => e.textContent);
    change(one("#plot input.log"));
    told.straight = texts();
    change(one("#plot input.log"));
    at("pointermove", box.width / 2);
    told.time = one("#plot output").textContent;
    told.values = [...page.querySelectorAll("#plot .key small")].map((e) => e.textContent);
    at("pointerdown", 100); at("pointermove", 160); at("pointerup", 160);
    told.zoomed = ends();
    change(one("#plot .key input"));
    told.off = paths();
    for (const box of [...page.querySelectorAll("#plot .choice input")].slice(1, 4)) change(box);
    told.alone = paths();
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
    tall = recording(tau_u=lambda t: np.sin(t) + 1000.0 * (t == 1.0) - 50.0 * (t == 2.0))
    both = shown(("whole", tall), ("gap", gap))
    html = page(traces=traces.traces(both))
    said, console = browsed(tmp_path, html, probe=PROBE)
    assert not console
    for width, told in said.items():
        assert told["paths"] == 4 * len(both), width
        assert told["off"] == 4 * (len(both) - 1)
        assert told["alone"] == len(both) - 1
        labels = [text.replace("\u200b", "") for text in told["labels"]]
        assert labels == ["ze [m]", "ψe [rad]", "τu [N]", "τr [N m]"]
        assert {"1000", "-10", "0", "distance to the target"} <= set(told["bent"])
        assert "1000" in told["straight"]
        assert "-10" not in told["straight"]
        time = float(re.fullmatch(r"t = ([\d.]+) s", told["time"])[1])
        shown_value = float(re.match(r"z_e (\S+) m, psi_e ", told["values"][0])[1])
        assert shown_value == pytest.approx(1.5 + 0.5 * np.cos(time), abs=0.1)
        assert told["zoomed"] != told["whole"] == told["back"]
        assert not told["bad"]
        assert told["wide"] <= 0
