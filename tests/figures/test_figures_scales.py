"""Scales of figures: runs that diverge, peaks beside small values; controls, filters, loads."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_samples import changed, drawn, line, panels, recording, scenario, shown, title
from old_results import draw_quickly
from scenario_samples import SOUND

from podusv_cli.components.measurements.sensors import Sensor, Sensors
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.workflows import run


def inside(limits, values):
    return limits[0] <= np.min(values) and np.max(values) <= limits[1]


def blown_up(end=50.0, **given):
    """A run that leaves all bounds in its last 10 s."""
    growth = {"u": lambda t: np.exp(np.maximum(0.0, t - end + 10.0))}
    return recording(end=end, status="diverged", **growth | given)


@pytest.mark.parametrize("place", [0, 1])
def test_a_run_that_diverges_is_drawn_but_does_not_set_the_scale(place):
    pair = [("good", recording()), ("bad", blown_up())]
    runs = shown(*(pair if place else reversed(pair)))
    axes = panels(drawn("velocities", runs))["$u$ [m/s]"]
    good, bad = (line(axes, label).get_ydata() for label in ("good", "bad"))
    assert inside(axes.get_ylim(), good)
    assert axes.get_ylim()[1] < 2.0 * good.max()
    assert bad.max() == pytest.approx(np.exp(10.0))
    far = axes.get_ylim()[0] - 5.0
    shifted = [(name, changed(log, u=log["u"] - far)) for name, log in pair]
    assert panels(drawn("velocities", shown(*shifted)))["$u$ [m/s]"].get_ylim()[0] > 4.0
    assert axes.get_yscale() == "linear"


def test_an_axis_with_a_tall_peak_is_logarithmic_beyond_the_settled_values():
    peak = {"r": lambda t: np.where(t < 1.0, 60.0, 0.04)}
    axes = panels(drawn("velocities", shown(("a", recording(**peak)))))["$r$ [rad/s]"]
    assert axes.get_yscale() == "symlog"
    assert axes.yaxis.get_transform().linthresh == pytest.approx(0.1)
    assert inside(axes.get_ylim(), [0.04, 60.0])
    assert axes.get_ylim()[0] > -0.1


def test_no_tick_of_a_logarithmic_axis_lies_within_its_linear_part():
    peak = {"r": lambda t: np.where(t < 1.0, -3e4, np.where(t < 2.0, 3e4, 110.0 * np.sin(t)))}
    axes = panels(drawn("velocities", shown(("a", recording(**peak)))))["$r$ [rad/s]"]
    linear = axes.yaxis.get_transform().linthresh
    assert linear == pytest.approx(1e3)
    assert [*axes.get_yticks()] == pytest.approx([-1e4, -1e3, 0.0, 1e3, 1e4])


@pytest.mark.parametrize(("peak", "scale"), [(19.0, "linear"), (21.0, "symlog")])
def test_a_peak_is_tall_from_twenty_times_the_settled_values_on(peak, scale):
    given = {"r": lambda t: np.where(t < 1.0, -peak, 1.0)}
    axes = panels(drawn("velocities", shown(("a", recording(**given)))))["$r$ [rad/s]"]
    assert axes.get_yscale() == scale


IDEAL = scenario(actuator="{kind: ideal}")


def free(log):
    """The log of an actuator without limits: the hull gets what the law demands."""
    kept = {name: values for name, values in log.signals.items() if name != "saturated"}
    return replace(log, signals=kept | {f"tau_{i}_cmd": kept[f"tau_{i}"] for i in "ur"})


def controls(*runs, columns=2):
    axes = drawn("controls", shown(*runs), columns).axes
    return dict(zip(("early", "whole", "settled"), axes, strict=False)), axes


def test_controls_show_the_peak_the_whole_run_and_the_settled_part():
    log = recording(period=0.01)
    _, drawn_axes = controls(("a", log))
    names = ["tau_u", "tau_u_cmd", "tau_r", "tau_r_cmd"]
    limits = [(0.0, 0.5), (0.0, 100.0), (75.0, 100.0)] * 4
    for axes, span, name in zip(drawn_axes, limits, np.repeat(names, 3), strict=True):
        assert axes.get_xlim() == pytest.approx(span)
        curve = line(axes, "a")
        rows = np.searchsorted(log["time"], curve.get_xdata())
        assert np.array_equal(curve.get_ydata(), log[name][rows])
        assert curve.get_xdata()[[0, -1]] == pytest.approx(span)
    assert [axes.get_title() for axes in drawn_axes] == ["early", "whole run", "settled"] + [""] * 9
    assert [axes.get_ylabel() for axes in drawn_axes[::3]] == [
        r"$\tau_u$ [N]",
        r"$\tau_{u,\mathrm{cmd}}$ [N]",
        r"$\tau_r$ [N m]",
        r"$\tau_{r,\mathrm{cmd}}$ [N m]",
    ]
    assert [axes.get_xlabel() for axes in drawn_axes] == [""] * 9 + ["time [s]"] * 3


def test_controls_without_limits_are_logarithmic_where_the_peak_is():
    peak = {"tau_u": lambda t: np.where(t < 1.0, 500.0, 0.5 * np.sin(t))}
    by, _ = controls(("a", free(recording(**peak)), IDEAL))
    scales = {part: axes.get_yscale() for part, axes in by.items()}
    assert scales == {"early": "symlog", "whole": "symlog", "settled": "linear"}
    assert by["early"].yaxis.get_transform().linthresh == pytest.approx(1.0)
    assert inside(by["early"].get_ylim(), [500.0])
    assert by["whole"].get_ylim()[1] > 700.0  # a margin that can be seen on this axis


def saturated(**given):
    """A run at the limits of 8 N and 2.5 N m for 2 s, of whose law 4000 N are demanded."""
    early = {
        "tau_u": lambda t: np.where(t < 2.0, 8.0, 0.1),
        "tau_r": lambda t: np.where(t < 2.0, -2.5, 0.1),
        "tau_u_cmd": lambda t: np.where(t < 2.0, 4e3, 0.1),
    }
    return recording(**early | given)


def test_loads_within_limits_are_on_a_linear_axis_and_what_was_demanded_is_not():
    _, found = controls(("a", saturated()))
    force, demand = found[1], found[4]
    assert (force.get_yscale(), demand.get_yscale()) == ("linear", "symlog")
    assert inside(force.get_ylim(), [0.0, 8.0])
    assert force.get_ylim()[1] < 9.0
    assert inside(demand.get_ylim(), [4e3])
    assert inside(found[0].get_ylim(), [0.0, 8.0])  # constant there, but no panel of 7.6 to 8.4


def test_a_constant_demand_with_a_ripple_is_a_flat_line_beside_zero():
    def ripple(t):
        return 25.6 + 1e-9 * np.sin(9.0 * t)

    log = recording(tau_u=ripple, tau_u_cmd=ripple)
    for axes in controls(("a", log))[1][:6]:  # on the hull, and as the law demands it
        low, high = axes.get_ylim()
        assert low <= 0.0
        assert high > 25.0


def test_what_is_left_of_a_demand_that_dies_out_is_a_flat_line():
    def dying(t):
        return 5.0 * np.exp(-t) + 1e-9 * np.sin(9.0 * t)

    _, found = controls(("a", recording(tau_r=dying, tau_r_cmd=dying)))
    mean = 0.05  # of 5 exp(-t) over 100 s
    for axes in found[8], found[11]:  # settled
        assert np.ptp(axes.get_ylim()) > 0.9e-3 * mean
    whole = found[10]
    assert whole.get_yscale() == "symlog"
    assert whole.yaxis.get_transform().linthresh == pytest.approx(1e-2)  # a tenth of it, rounded up


def test_a_heading_that_hardly_moves_is_a_flat_line():
    log = recording(psi=lambda t: 1.5 + 1e-9 * np.sin(t))
    axes = panels(drawn("velocities", shown(("a", log))))[r"$\psi$ [rad]"]
    assert np.ptp(axes.get_ylim()) > 1e-3


@pytest.mark.parametrize(
    ("given", "force", "moment"), [("", 8.0, 2.5), (", surge_limit: 6.0", 6.0, 2.5)]
)
def test_the_actuator_s_limits_are_drawn_ahead_and_astern(given, force, moment):
    actuator = scenario(actuator=f"{{kind: saturated{given}}}")
    _, found = controls(("a", saturated(), actuator))
    for place, limit in ((1, force), (7, moment)):
        lines = [c for c in found[place].lines if c.get_label() == "limit of the actuator"]
        assert [list(curve.get_ydata()) for curve in lines] == [[limit] * 2, [-limit] * 2]
        assert all(tuple(curve.get_xdata()) == found[place].get_xlim() for curve in lines)
    assert all(len(axes.lines) == 1 for axes in (*found[3:6], *found[9:]))  # none at the demand
    assert found[2].get_ylim()[1] < 0.5 * force  # they do not set the scale


def test_what_a_diverging_run_asks_for_does_not_set_the_scale():
    wild = recording(end=60.0, status="diverged", tau_u_cmd=lambda t: np.where(t < 50.0, 0.0, 1e9))
    _, drawn_axes = controls(("good", recording()), ("bad", wild))
    assert drawn_axes[4].get_ylim()[1] < 1e3


def test_a_run_that_diverges_later_does_not_set_the_scale_of_the_beginning():
    def blowing_up(t):
        return np.where(t < 45.0, 5.0, 1e12)

    lost = blown_up(tau_u=blowing_up, tau_u_cmd=blowing_up)
    early = controls(("a", recording(tau_u=np.cos, tau_u_cmd=np.cos)), ("lost", lost))[1][0]
    assert 5.0 < early.get_ylim()[1] < 10.0


def test_filters_show_virtual_control_and_output_together_and_their_difference():
    log, plain = recording(), recording(shift=0.4, without=("beta_u", "beta_r"))
    figure = drawn("filters", shown(("filtered", log), ("plain", plain)))
    by_label = panels(figure)
    assert list(by_label) == [
        r"$\alpha_u, \beta_u$ [m/s]",
        r"$\alpha_r, \beta_r$ [rad/s]",
        "$y_u$ [m/s]",
        "$y_r$ [rad/s]",
    ]
    for axes, part in zip(figure.axes[:2], "ur", strict=True):
        assert np.array_equal(line(axes, "filtered").get_ydata(), log[f"beta_{part}"])
        assert np.array_equal(line(axes, "plain").get_ydata(), plain[f"alpha_{part}"])
        thin = line(axes, f"_filtered, alpha_{part}")
        assert np.array_equal(thin.get_ydata(), log[f"alpha_{part}"])
        assert thin.get_linewidth() < line(axes, "filtered").get_linewidth()
        assert len(axes.lines) == 3
    for axes, part in zip(figure.axes[2:], "ur", strict=True):
        (curve,) = axes.lines
        assert np.array_equal(curve.get_ydata(), log[f"beta_{part}"] - log[f"alpha_{part}"])
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["filtered", "plain", "virtual control before the filter"]


def test_a_disturbance_that_all_runs_share_is_drawn_once():
    figure = drawn("loads", shown(("a", recording(end=60.0)), ("b", recording(shift=0.0))))
    for axes, name in zip(figure.axes, ("b_u", "b_v", "b_r"), strict=False):
        (curve,) = axes.lines
        assert curve.get_label() == "all runs"
        assert np.array_equal(curve.get_ydata(), recording()[name])
    assert [a.get_ylabel() for a in figure.axes] == ["$b_u$ [N]", "$b_v$ [N]", "$b_r$ [N m]", ""]


def test_limits_are_marked_while_they_act_in_a_line_for_each_run():
    never = changed(recording(), saturated=np.zeros(1001))
    runs = shown(
        ("often", recording()), ("never", never), ("none", recording(without=("saturated",)))
    )
    axes = drawn("loads", runs).axes[-1]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["often", "never"]
    assert axes.get_title() == "limited by the actuator"
    often, never = axes.collections
    boxes = [path.get_extents() for path in often.get_paths()]
    assert [(box.x0, box.x1) for box in boxes] == [
        pytest.approx((2.0, 5.0)),
        pytest.approx((30.0, 30.5)),
    ]
    assert {(box.y0 + box.y1) / 2 for box in boxes} == {0.0}
    assert len(never.get_paths()) == 0
    assert axes.get_ylim()[0] > 1.3
    assert axes.get_ylim()[1] < -0.3


# --- figures of the sea and of what sensors and estimators make of the vessel's state

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
        r"$\zeta$ [m]",
        r"$\zeta$ [m]",
        "$V_w$ [m/s]",
        "$V_c$ [m/s]",
    ]
    level = SEA["beta_c"](np.zeros(1))[0]
    assert [text.get_text() for text in figure.texts] == [rf"constant: $\beta_c$ = {level:.4g} rad"]
    log = recording(**SEA)
    for axes, name in zip(figure.axes[1:], ("zeta", "V_w", "V_c"), strict=True):
        assert np.array_equal(line(axes, "a").get_ydata(), log[name])
    calm = drawn("sea", shown(("a", recording(V_w=SEA["V_w"]))))
    assert [axes.get_ylabel() for axes in calm.axes] == ["$V_w$ [m/s]"]
    assert not FIGURES["sea"].fits(shown(("a", recording())))


def test_the_direction_of_a_wind_has_a_panel_where_the_wind_turns():
    for directions, count in ((np.ones_like, 1), (np.sqrt, 2)):
        figure = drawn("sea", shown(("a", recording(V_w=SEA["V_w"], beta_w=directions))))
        assert len(figure.axes) == count


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
    by_label = panels(drawn("estimates", shown(("a", log))))
    assert len(by_label) == 12
    value, error = by_label["$x$ [m]"], by_label["error of $x$ [m]"]
    assert np.array_equal(line(value, "_true").get_ydata(), log["x"])
    assert np.array_equal(line(value, "a").get_ydata(), log["x_est"])
    assert np.array_equal(line(error, "a").get_ydata(), log["x_est"] - log["x"])
    # What a sensor held without a delivery is not shown: none at 12 s, 14 s, 16 s and 18 s.
    dots = line(value, "_measured")
    due = [at for at in range(2, 101, 2) if not 10 < at < 20]
    assert dots.get_xdata() == pytest.approx(due)
    rows = np.searchsorted(log["time"], np.array(due) - 0.05)
    assert line(error, "_measured").get_ydata() == pytest.approx(due - log["x"][rows])


@pytest.mark.parametrize(("columns", "blocks"), [(2, 1), (1, 2)])
def test_estimates_of_several_runs_have_a_column_each_on_common_axes(columns, blocks):
    logs = {label: recording(**ESTIMATED, shift=i) for i, label in enumerate("abc")}
    found = drawn("estimates", shown(*logs.items()), columns).axes
    assert len(found) == 18
    assert found[0].get_subplotspec().get_gridspec().nrows == 6 * blocks
    for (label, log), mine in zip(logs.items(), np.reshape(found, (3, 6)), strict=True):
        assert title(mine[0]).endswith(label)
        for axes, name in zip(mine, ("x", "y", "psi", "u", "v", "r"), strict=True):
            error = line(axes, label).get_ydata()
            assert np.array_equal(error, log[f"{name}_est"] - log[name])
            assert not {*logs} - {label} & {curve.get_label() for curve in axes.lines}
    for place in range(6):
        assert len({axes.get_ylim() for axes in found[place::6]}) == 1


def test_outages_are_shaded_for_the_quantities_of_the_sensor():
    runs = shown(("a", recording(**ESTIMATED), measured((10.0, 20.0), (50.0, 60.0))))
    for label, axes in panels(drawn("estimates", runs)).items():
        spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches]
        hit = "$x$" in label or "$y$" in label
        assert spans == ([(10.0, 20.0), (50.0, 60.0)] if hit else []), label
    words = [text.get_text() for text in drawn("estimates", runs).legends[0].get_texts()]
    assert words == ["a", "outage of the sensor"]


@pytest.mark.parametrize("measurement", ["exact", "sensors"])
def test_a_run_draws_trajectory_and_errors_unless_others_are_asked_for(
    tmp_path, measurement, monkeypatch
):
    draw_quickly(monkeypatch)
    config = tmp_path / "a.yaml"
    brief = "simulation: {step: 0.01, duration: 0.1, compiled: false}\n"
    config.write_text(f"{SOUND}{brief}measurement: {{kind: {measurement}}}\n")
    drawn = {}
    for asked in ((), ("all",), ("all", "errors"), ("velocities",)):
        request = run.Request(out=tmp_path / "run", force=True, names=asked)
        done = run.run(config, request)
        assert not done.missing
        drawn[asked] = {path.stem for path in (done.folder / "figures").iterdir()}
    assert drawn[()] == {"errors", "trajectory"}
    assert drawn["velocities",] == {"velocities"}
    assert drawn["all",] == drawn["all", "errors"]
    assert drawn["all",] >= {"errors", "trajectory", "controls", "velocities"}
    assert ("estimates" in drawn["all",]) == (measurement == "sensors")
    assert "sea" not in drawn["all",]


def test_signals_that_never_change_are_a_line_of_text_with_each_run_s_value():
    held = {"b_hat_r": lambda t: 0.25 + 0.0 * t}
    same = drawn("adaptation", shown(("a", recording(**held)), ("b", recording(**held))))
    assert r"$\hat b_r$ [N m]" not in panels(same)
    assert [text.get_text() for text in same.texts] == [r"constant: $\hat b_r$ = 0.25 N m"]
    other = recording(b_hat_r=lambda t: 0.5 + 0.0 * t)
    apart = drawn("adaptation", shown(("a", recording(**held)), ("b", other)))
    assert [text.get_text() for text in apart.texts] == [
        r"constant: $\hat b_r$ = 0.25 (a), 0.5 (b) N m"
    ]
    changing = drawn("adaptation", shown(("a", recording(**held)), ("b", recording())))
    assert r"$\hat b_r$ [N m]" in panels(changing)


def test_a_calm_curve_lies_above_a_restless_one_and_equal_ones_keep_their_order():
    restless = recording(u=lambda t: np.sin(40.0 * t))
    runs = shown(("calm", recording()), ("restless", restless), ("alike", recording()))
    calm, rough, alike = panels(drawn("velocities", runs))["$u$ [m/s]"].lines
    assert calm.get_zorder() == alike.get_zorder() > rough.get_zorder()
    assert rough.get_linewidth() < calm.get_linewidth()
