"""Figures of the sea and of what sensors and estimators make of the vessel's state."""

import numpy as np
import pytest
from drawn_samples import drawn, line, no_figures_but, panels, recording, scenario, shown
from scenario_samples import SOUND

from podusv_cli.components.measurements.sensors import Sensor, Sensors
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.workflows import run

SEA = {
    "zeta": lambda t: 0.1 * np.sin(np.pi / 2.0 * (t - 1.05)),  # waves of 4 s
    "V_w": lambda t: 8.0 + np.cos(t),
    "V_c": lambda t: 0.3 + 0.01 * t,
    "beta_c": lambda t: 0.8 + 0.0 * t,
}


def held(t, start=0.0):
    """A value that is delivered every 2 s, and not between 10 s and 20 s."""
    since = np.floor(t / 2.0 + 1e-9) * 2.0
    return start + np.where((since > 10.0) & (since < 20.0), 10.0, since)


ESTIMATED = {f"{name}_est": np.cos for name in ("x", "y", "psi", "u", "v", "r")} | {"x_m": held}


def measured(*outages):
    sensors = Sensors(position=Sensor(outages=outages))
    return scenario().model_copy(update={"measurement": sensors})


def test_the_sea_is_shown_as_far_as_it_is_logged():
    figure = drawn("sea", shown(("a", recording(**SEA))))
    assert [axes.get_ylabel() for axes in figure.axes] == [
        r"$\zeta$ [m]", r"$\zeta$ [m]", "$V_w$ [m/s]", "$V_c$ [m/s]",
        r"$\beta_c$ [rad]",
    ]  # fmt: skip
    log = recording(**SEA)
    for axes, name in zip(figure.axes[1:], SEA, strict=True):
        assert np.array_equal(line(axes, "a").get_ydata(), log[name])
    calm = drawn("sea", shown(("a", recording(V_w=SEA["V_w"]))))
    assert [axes.get_ylabel() for axes in calm.axes] == ["$V_w$ [m/s]"]
    assert not FIGURES["sea"].fits(shown(("a", recording())))


def test_the_last_waves_are_shown_one_by_one():
    axes = drawn("sea", shown(("a", recording(**SEA)))).axes[0]
    assert axes.get_xlim() == pytest.approx(
        (21.0, 100.0)
    )  # 20 of the upward crossings at 1.05 + 4 k
    (curve,) = axes.lines
    assert curve.get_xdata()[0] == pytest.approx(21.0)
    few = drawn("sea", shown(("a", recording(end=30.0, **SEA)))).axes[0]
    assert few.get_xlim() == pytest.approx((0.0, 30.0))


def test_wind_that_all_runs_share_is_drawn_once_and_waves_that_each_meets_for_each():
    other = recording(shift=0.5, **SEA | {"zeta": np.sin})
    found = drawn("sea", shown(("a", recording(**SEA)), ("b", other))).axes
    assert [curve.get_label() for curve in found[2].lines] == ["all runs"]
    assert [curve.get_label() for curve in found[1].lines] == ["a", "b"]


def test_estimates_stand_beside_truth_and_deliveries_and_their_errors():
    log = recording(**ESTIMATED)
    found = panels(drawn("estimates", shown(("a", log))))
    assert len(found) == 12
    value, error = found["$x$ [m]"], found["error of $x$ [m]"]
    assert np.array_equal(line(value, "_true").get_ydata(), log["x"])
    assert np.array_equal(line(value, "a").get_ydata(), log["x_est"])
    assert np.array_equal(line(error, "a").get_ydata(), log["x_est"] - log["x"])
    # What a sensor held without a delivery is not shown: none at 12 s, 14 s, 16 s and 18 s.
    dots = line(value, "_measured")
    due = [at for at in range(2, 101, 2) if not 10 < at < 20]
    assert dots.get_xdata() == pytest.approx(due)
    rows = np.searchsorted(log["time"], np.array(due) - 0.05)
    assert line(error, "_measured").get_ydata() == pytest.approx(due - log["x"][rows])


def test_outages_are_shaded_for_the_quantities_of_the_sensor():
    runs = shown(("a", recording(**ESTIMATED), measured((10.0, 20.0), (50.0, 60.0))))
    for label, axes in panels(drawn("estimates", runs)).items():
        spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches]
        hit = "$x$" in label or "$y$" in label
        assert spans == ([(10.0, 20.0), (50.0, 60.0)] if hit else []), label
    words = [text.get_text() for text in drawn("estimates", runs).legends[0].get_texts()]
    assert words == ["a", "outage of the sensor"]


@pytest.mark.parametrize("measurement", ["exact", "sensors"])
def test_a_run_draws_estimates_by_default_if_it_has_any(tmp_path, measurement):
    config = tmp_path / "a.yaml"
    brief = "simulation: {step: 0.01, duration: 0.1, compiled: false}\n"
    config.write_text(f"{SOUND}{brief}measurement: {{kind: {measurement}}}\n")
    with no_figures_but("estimates", "sea", "errors", "trajectory", "controls"):
        done = run.run(config, run.Request((), tmp_path / "run"))
    found = {path.stem for path in (done.folder / "figures").iterdir()}
    assert ("estimates" in found) == (measurement == "sensors")
    assert "sea" not in found
    assert found >= {"errors", "trajectory", "controls"}
    assert not done.missing
