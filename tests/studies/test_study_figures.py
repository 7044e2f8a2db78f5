"""Figures of a study show the numbers that they are given; failures stay visible."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pandas as pd
import pytest
from study_samples import pairs, sensitivity, study

from podusv_cli.figures.style import WIDTHS, house_style, image, new_figure
from podusv_cli.studies.telling import figures

inf, nan = math.inf, math.nan
A = np.r_[np.linspace(1.0, 2.0, 150), [inf] * 50]
B = np.r_[np.linspace(1.5, 3.0, 199), 1e6]


def curves(axes: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in axes.lines if not line.get_label().startswith("_")}


def test_failures_are_missing_mass_of_a_distribution_and_a_tail_does_not_set_the_axis() -> None:
    axes = figures.distributions({"a": A, "b": B}, "IAE [m s]", 0.95).axes[0]
    found = curves(axes)
    assert list(found) == ["a (50 of 200 failed)", "b"]
    x, y = found["a (50 of 200 failed)"].get_data()
    assert (x[0], x[-1]) == axes.get_xlim()
    assert (y[0], y[-1]) == (0.0, 75.0)
    assert axes.get_xlim()[1] < 4.0
    assert np.interp(1.5, x, y) == pytest.approx(37.5, abs=0.6)


def test_a_wide_range_of_values_has_a_logarithmic_axis() -> None:
    def scale(values: Any) -> str:
        return str(figures.distributions({"a": values}, "x", 0.95).axes[0].get_xscale())

    assert scale(np.geomspace(0.01, 10.0, 100)) == "log"
    assert scale(np.linspace(1.0, 3.0, 100)) == scale(np.linspace(-1.0, 50.0, 100)) == "linear"


def test_failure_rates_over_the_threshold_never_fall_below_the_failed_runs() -> None:
    axes = figures.failure_rates({"a": A, "b": B}, "z_e", 1.5, 0.95).axes[0]
    x, y = curves(axes)["a (50 of 200 failed)"].get_data()
    assert (np.diff(y) <= 0).all()
    assert (y[0], y[-1]) == (100.0, 25.0)
    assert y[np.searchsorted(x, 1.5)] == pytest.approx(100 * np.mean(A > 1.5), abs=1.0)
    assert axes.lines[-1].get_xdata()[0] == 1.5


def test_ratios_show_open_intervals_as_arrows_on_an_axis_symmetric_about_one() -> None:
    table = pairs(study(a=np.full(40, 1.0), b=np.linspace(1.1, 1.4, 40), c=np.full(40, inf)))
    few = pairs(study(a=np.ones(4), b=np.full(4, 2.0)))
    axes = figures.ratios(pd.concat([table, few])).axes[0]
    low, high = axes.get_xlim()
    assert low * high == pytest.approx(1.0)
    arrows = [line.get_marker() for line in axes.lines if line.get_marker() in "<>"]
    assert arrows == ["<", "<", "<", ">"]  # a failed law twice, and four draws
    labels = [text.get_text() for text in axes.get_yticklabels()]
    assert labels[0] == "a / b\nwins 100 % / 0 %"


def test_heatmaps_write_every_number_failures_and_gaps_too() -> None:
    panels = {"a": np.array([[1.0, 2.0], [inf, nan]]), "b": np.array([[0.5, 0.25], [3.0, 4.0]])}
    figure = figures.heatmaps(panels, "failed [%]", ("sea", ["1", "2"]), ("nodes", ["9", "27"]))
    written = [[text.get_text() for text in axes.texts] for axes in figure.axes[:2]]
    assert written == [["1", "2", "inf", "-"], ["0.5", "0.25", "3", "4"]]
    assert [axes.get_title() for axes in figure.axes[:2]] == ["a", "b"]


def test_correlations_order_quantities_by_what_matters_most_to_any_law() -> None:
    random = np.random.default_rng(1)
    draws = {f"q{i}": random.random(200) for i in range(15)}
    runs = study(
        a=draws["q3"] + 0.1 * random.random(200), b=-draws["q7"] - 0.5 * random.random(200)
    )
    axes = figures.correlations(sensitivity(runs, draws)).axes[0]
    names = [text.get_text() for text in axes.get_yticklabels()]
    assert (len(names), names[:2]) == (figures.MOST_BARS, ["q3", "q7"])
    bars = {bars.get_label(): [bar.get_width() for bar in bars] for bars in axes.containers}
    assert bars["a"][0] > 0.9
    assert bars["b"][1] < -0.8


def test_the_same_study_gives_the_same_picture_whatever_it_is_made_of() -> None:
    odd = {"$a_$": np.full(9, inf), "_b": np.array([1.0]), "c": np.array([nan, 2.0])}

    def picture() -> bytes:
        with house_style():
            return image(figures.distributions(odd, "x", 0.95), "svg")

    assert picture() == picture()


@pytest.mark.slow
def test_a_study_imports_neither_matplotlib_nor_pandas() -> None:
    code = (
        "import sys, podusv_cli.studies.counting.claims, podusv_cli.workflows.sweep; "
        "sys.exit(any(m in sys.modules for m in ('matplotlib', 'scipy.stats', 'pandas')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    ("shape", "labels", "columns"),
    [((1, 3), "xy", 1), ((3, 4), "x", 2), ((2, 2), "x", 2), ((4, 1), "y", 1), ((3, 5), "", None)],
)
def test_a_page_for_a_phone_has_at_most_two_columns(
    shape: tuple[int, int], labels: str, columns: int | None
) -> None:
    with house_style():
        page = new_figure(2, 2.0)
        panels = page.subplots(*shape, squeeze=False).ravel()
        panels[0].set_ylabel("first")
        panels[-1].set_visible(shape == (1, 3))
        for axes in panels:
            axes.set(**{f"{name}label": "m" for name in labels})
        fits = page.narrow(4.5)
        image(page, "png")
    seen = [axes for axes in panels if axes.get_visible()]
    if columns is None:
        assert not fits
        assert page.get_figwidth() == WIDTHS[2]
        return
    rows = -(-len(seen) // columns) if "x" in labels else shape[0]
    assert page.get_size_inches() == pytest.approx((4.5, 2.0 * rows / shape[0]))
    lefts = {round(axes.get_position().x0, 6) for axes in seen}
    assert len(lefts) == columns
    assert all(axes.get_ylabel() for axes in seen[::columns])
