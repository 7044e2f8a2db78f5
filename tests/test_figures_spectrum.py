"""The spectrum of the settled demand, and lines at peaks that claims name."""

import math
from pathlib import Path

import numpy as np
import pytest
from drawn_samples import drawn, recording, scenario, shown

from podusv_cli.comparison.claims import parse_claims, peaks
from podusv_cli.core.spectrum import periodogram
from podusv_cli.figures.drawing import FIGURES, dressed
from podusv_cli.figures.style import house_style
from podusv_cli.scenario.load import load

CONFIGS = Path(__file__).parents[1] / "configs"


def test_the_periodogram_has_the_power_of_the_signal():
    t = np.arange(0, 100, 0.01)
    y = 3.0 + 2.0 * np.sin(0.5 * t) + 0.1 * np.cos(40.0 * t)
    rates, power = periodogram(t, y)
    assert np.sum(power) == pytest.approx(2.0 + 0.005, rel=2e-3)
    assert math.sqrt(np.sum(power[rates > 2.0])) == pytest.approx(0.1 / math.sqrt(2.0), rel=1e-4)
    assert rates[np.argmax(power)] == pytest.approx(0.5, abs=rates[1])
    alternating = 100.0 * (-1.0) ** np.arange(1000)
    assert math.sqrt(np.sum(periodogram(t[:1000], alternating)[1])) == pytest.approx(
        100.0, rel=2e-3
    )
    assert [len(part) for part in periodogram(t[:3], y[:3])] == [0, 0]


def test_a_claim_that_names_a_peak_is_found_and_drawn_in_the_panel_of_the_demand():
    loaded = load(CONFIGS / "paper/figures_compare_standoff.yaml")
    found = peaks(parse_claims(loaded))
    assert found == {"tau_u_cmd": 300.0, "tau_r_cmd": 1000.0}
    runs = dressed([("a", recording(), scenario())], found)
    with house_style():
        axes = FIGURES["controls"].family(runs, 2).axes
    levels = {
        panel.get_ylabel(): sorted(
            line.get_ydata()[0] for line in panel.lines if "claim" in line.get_label()
        )
        for panel in axes[::3]
    }
    assert list(levels.values()) == [[], [-300.0, 300.0], [], [-1000.0, 1000.0]]


def test_the_spectrum_shows_a_cycle_of_the_settled_demand():
    cycling = recording(period=0.01, tau_u_cmd=lambda t: np.sin(0.5 * t) + 50.0 * np.sin(70.0 * t))
    surge, yaw = drawn(
        "spectrum", shown(("calm", recording(period=0.01)), ("cycling", cycling))
    ).axes
    peaks_at = {}
    for line in surge.lines:
        rates, rms = line.get_xdata(), line.get_ydata()
        peaks_at[line.get_label()] = rates[np.argmax(rms)], max(rms)
    assert peaks_at["cycling"] == pytest.approx((70.0, 50.0 / math.sqrt(2.0)), rel=0.3)
    assert peaks_at["calm"][0] < 1.0
    assert [line.get_label() for line in yaw.lines] == ["disturbance", "calm", "cycling"]
