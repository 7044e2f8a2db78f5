"""Table, differences, entries and verdicts as texts, from numbers planted by hand."""

import math

import pytest
from comparison_samples import FRAME, Folder, scenario, verdicts
from matplotlib.mathtext import MathTextParser

from podusv_cli.comparison import claims, table
from podusv_cli.comparison.differences import as_text, differences
from podusv_cli.comparison.entries import CHECKS, Absent, Entry
from podusv_cli.metrics.table import METRICS

# A key of every section that a run has besides its law, and another value.
OTHERWISE = {
    "vessel.m": "24.5", "nominal.m": "24.5", "start.x": "1.5", "path.speed": "0.25",
    "disturbance.b_u.mean": "0.75", "actuator.surge_limit": "4.0", "simulation.step": "0.02",
    "simulation.duration": "5.0", "control.period": "0.1", "log.every": "2",
    "metrics.settling_radius": "3.0",
}  # fmt: skip


# --- table


def test_cells_have_number_mark_and_ratio():
    assert table.cells(FRAME) == [
        ["iae", "m s", "4", "2* (0.5)", "8 (2)", "-"],
        ["energy", "J", "0*", "3", "1", "-"],
        ["law_ns", "ns", "10", "-", "5 (0.5)", "-"],
    ]


def test_a_run_that_does_not_end_at_its_target_is_never_the_best():
    unsettled = [str(FRAME.columns[1])]
    assert table.cells(FRAME, unsettled=unsettled)[0] == [
        "iae",
        "m s",
        "4*",
        "2 (0.5)",
        "8 (2)",
        "-",
    ]
    assert unsettled[0] not in table.leaders(FRAME, unsettled=unsettled)
    assert "4*" in table.as_markdown(FRAME, {}, unsettled=unsettled)
    assert r"\textbf{4}" in table.as_latex(FRAME, unsettled=unsettled)


def test_numbers_that_read_the_same_are_marked_the_same():
    frame = table.table({"a": {"iae": 0.500653}, "b": {"iae": 0.500649}, "c": {"iae": 0.50066}})
    assert table.cells(frame) == [["iae", "m s", "0.50065*", "0.50065* (1)", "0.50066 (1)"]]


def test_a_measured_time_is_never_marked_as_the_best():
    frame = table.table({"a": {"law_ns": 90.0}, "b": {"law_ns": 80.0}})
    assert table.cells(frame) == [["law_ns", "ns", "90", "80 (0.889)"]]


def test_where_a_law_keeps_a_standoff_to_be_nearer_is_not_better():
    frame = table.table({"a": {"iae": 9.0, "iae_e": 5.0}, "b": {"iae": 8.0, "iae_e": 6.0}})
    assert table.leaders(frame) == {"a": ["iae_e"], "b": []}


def test_csv_has_units_first_and_ratios_last():
    full = table.with_ratios(FRAME)
    assert list(full) == ["unit", "a", "b", "c", "lost", "b/a", "c/a", "lost/a"]
    assert full.loc["iae", ["b/a", "c/a"]].tolist() == [0.5, 2.0]
    assert full.loc["energy", ["b/a", "lost/a"]].isna().all()
    assert table.as_csv(FRAME).splitlines()[1] == "iae,m s,4.0,2.0,8.0,,0.5,2.0,"


def test_markdown_tells_how_runs_ended():
    text = table.as_markdown(FRAME, {"a": "", "lost": "killed"})
    lines = text.splitlines()
    assert lines[0] == "| metric | unit | a | b | c | lost |"
    assert lines[1] == "| --- | --- | ---: | ---: | ---: | ---: |"
    assert lines[2] == "| iae | m s | 4 | 2* (0.5) | 8 (2) | - |"
    assert lines[-2:] == ["", "- lost: killed"]
    assert table.as_markdown(FRAME, {"a": ""}).endswith(table.NOTE + "\n")


def test_latex_escapes_and_marks():
    frame = table.table({"a_b&~^\\{}": {"iae": 1.0}, "#$%": {"iae": 2.0}})
    lines = table.as_latex(frame).splitlines()
    head = r"a\_b\&\textasciitilde{}\textasciicircum{}\textbackslash{}\{\} & \#\$\% \\"
    assert lines[2].endswith(head)
    assert lines[4] == r"$\int z_e\,\mathrm{d}t$ & m s & \textbf{1} & 2 (2) \\"


def test_latex_has_symbols_units_and_powers_of_ten_as_formulas():
    numbers = {"effort_r": 1.5e7, "ise": 2e-9, "saturated_fraction": 0.5}
    frame = table.table({"a": numbers, "b": {"effort_r": 3e12, "ise": 4e-2}})
    rows = [line.removesuffix(r" \\").split(" & ") for line in table.as_latex(frame).splitlines()]
    found = {row[0]: row[1:] for row in rows[4:-2]}
    assert found == {
        r"$\int z_e^2\,\mathrm{d}t$": [
            "m$^2$ s", r"\textbf{\boldmath 2$\times10^{-9}$}", r"0.04 (2$\times10^{7}$)",
        ],
        r"$\int\tau_r^2\,\mathrm{d}t$": [
            "N$^2$ m$^2$ s", r"\textbf{\boldmath 1.5$\times10^{7}$}",
            r"3$\times10^{12}$ (2$\times10^{5}$)",
        ],
        r"saturated\_fraction": ["1", r"\textbf{0.5}", "-"],
    }  # fmt: skip


def test_every_symbol_of_a_metric_can_be_set():
    symbols = [metric.symbol for metric in METRICS.values() if metric.symbol]
    assert len(symbols) >= 10
    for symbol in symbols:
        MathTextParser("path").parse(f"${symbol}$")


# --- differences


@pytest.mark.parametrize("key", OTHERWISE)
def test_a_difference_in_any_section_is_found(key):
    other = scenario(f"{key}={OTHERWISE[key]}")
    found = differences({"a": scenario().model_dump(), "b": other.model_dump()})
    also = {"vessel.m": ["nominal.m"]}.get(key, [])  # the law is told about the vessel as it is
    assert list(found) == [key, *also]
    assert found[key]["b"] == float(OTHERWISE[key]) != found[key]["a"]


def test_every_section_of_a_scenario_is_looked_at():
    sections = {key.partition(".")[0] for key in OTHERWISE}
    rest = {
        "name", "description", "controller", "controllers", "claims", "silence", "plugins", "sweep",
        "tune", "measurement", "estimator",
    }  # fmt: skip
    assert sections | rest == set(type(scenario()).model_fields)


def test_sensors_and_an_estimator_are_a_difference():
    seeing = scenario("measurement={kind: sensors}", "estimator={kind: ekf}")
    found = differences({"a": scenario().model_dump(), "b": seeing.model_dump()})
    assert found["measurement.kind"] == {"a": "exact", "b": "sensors"}
    assert found["estimator.kind"] == {"a": "none", "b": "ekf"}


@pytest.mark.parametrize("key", ["name=b", "description=b", "controller.K_Pu=3"])
def test_names_and_laws_are_no_difference(key):
    assert not differences({"a": scenario().model_dump(), "b": scenario(key).model_dump()})


def test_a_key_that_a_run_lacks_is_a_difference():
    other = scenario("disturbance.kind=none").model_dump()
    found = differences({"a": scenario().model_dump(), "b": other})
    assert found["disturbance.kind"] == {"a": "harmonic", "b": "none"}
    assert found["disturbance.b_u.mean"]["b"] is None


def test_where_kinds_differ_only_the_kind_and_what_both_have_is_shown():
    calm, rough = scenario("disturbance.kind=none"), scenario("disturbance.scale=2")
    trees = {"a": scenario().model_dump(), "b": calm.model_dump()}
    assert as_text(differences(trees)) == {"disturbance.kind": {"a": "harmonic", "b": "none"}}
    third = as_text(differences({**trees, "c": rough.model_dump()}))
    assert list(third) == ["disturbance.kind", "disturbance.scale"]
    assert third["disturbance.scale"] == {"a": "1", "b": "-", "c": "2"}


# --- entries


def test_an_entry_answers_for_its_run():
    entry = Entry("a", Folder({"iae": 3.0, "rmse": None, "law_ns": 7.0}), scenario(), {"law_ns": 9})
    assert (entry.metric("iae"), entry.metric("law_ns")) == (3.0, 9.0)
    assert math.isnan(entry.metric("rmse"))
    assert math.isnan(entry.metric("ise"))
    assert entry.signal("x_e").tolist() == [0, 1, 2, 3]
    assert len(entry.signal("y_e")) == len(entry.signal("W_norm_u")) == len(entry.signal("v")) == 0
    assert (entry.until, entry.ending) == (4.0, "")
    assert entry.check("finished") is True


def test_an_entry_is_off_its_target_beyond_the_settling_radius_but_in_a_trial():
    near, far = (Folder({"e_steady": error}) for error in (0.9, 1.1))
    assert [Entry("a", run, scenario()).off_target for run in (near, far)] == [False, True]
    assert not Entry("a", far, scenario("metrics.settling_radius=2")).off_target
    assert not Entry("a", far, scenario("controller={kind: zigzag}")).off_target
    assert not Entry("a", Folder({"e_steady": 1.1}, "diverged"), scenario()).off_target


def test_an_entry_that_diverged_has_no_metrics_and_ends_early():
    run = Folder({"iae": 3.0}, "diverged", "diverged at t = 3.5 s: u is not finite; last ...")
    entry = Entry("a", run, scenario(), {"law_ns": 9.0})
    assert math.isnan(entry.metric("iae"))
    assert math.isnan(entry.metric("law_ns"))
    assert (entry.until, entry.ending) == (3.0, "diverged at t = 3.5 s")
    assert entry.check("finished") is False
    assert entry.check("underactuated") is True


def test_an_absent_run_has_nothing_but_its_scenario():
    absent = Absent(scenario(), "Traceback\n  File\nZeroDivisionError: oops\n")
    assert absent.ending == "has no log: ZeroDivisionError: oops"
    assert math.isnan(absent.metric("iae"))
    assert (len(absent.signal("x")), absent.until) == (0, 0.0)
    assert absent.check("finished") is None
    assert absent.check("underactuated") is True


def test_whether_an_interrupted_run_would_have_finished_cannot_be_told():
    assert CHECKS["finished"](scenario(), "interrupted") is None


# --- verdicts


def test_verdicts_have_numbers_reasons_and_the_labels_of_the_comparison():
    found = {verdict.name: verdict.as_json() for verdict in verdicts()}
    assert [v["verdict"] for v in found.values()] == [
        "reproduced", "not reproduced", "cannot tell", "not reproduced",
    ]  # fmt: skip
    assert found["C1"]["expect"] == "a.iae == 3"
    assert found["C1"]["numbers"] == {"a.iae": 3.0}
    assert found["C1"]["reason"] == ""
    assert found["C3"]["numbers"] == {"lost.iae": None, "a.iae": 3.0}
    assert found["C3"]["reason"] == "lost.iae: lost has no log: killed"
    assert verdicts()[2].evidence() == "a.iae = 3; lost.iae: lost has no log: killed"


def test_claims_in_markdown_stay_in_their_cells():
    lines = claims.as_markdown(verdicts()).splitlines()
    assert lines[2] == (
        r"| C1 | a \| \<b\> (here) | **reproduced** | `a.iae == 3`, tolerance 0.05 | a.iae = 3 |"
    )
    assert lines[-1] == r"- C4: Not \<stated\>."
