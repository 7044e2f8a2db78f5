"""Table, differences, entries and verdicts as texts, from numbers planted by hand."""

import math
import re
import shutil
import subprocess

import pytest
from command_samples import ROOT
from comparison_samples import FRAME, about, past_run, scenario, verdicts
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser

from podusv_cli.comparison import claims, table
from podusv_cli.comparison.differences import as_text, differences
from podusv_cli.core.about import BESIDE_RUNS
from podusv_cli.core.past_run import CHECKS, PastRun
from podusv_cli.figures.style import STYLES
from podusv_cli.metrics.table import METRICS
from podusv_cli.metrics.windows import NAMED, metrics_of_windows

# A key of every section that a run has besides its law, and another value.
OTHERWISE = {
    "vessel.m": "24.5",
    "nominal.m": "24.5",
    "start.x": "1.5",
    "path.speed": "0.25",
    "disturbance.b_u.mean": "0.75",
    "actuator.surge_limit": "4.0",
    "simulation.step": "0.02",
    "simulation.duration": "5.0",
    "control.period": "0.1",
    "log.every": "2",
    "metrics.settling_radius": "3.0",
}


# --- table


def test_cells_have_number_mark_and_ratio():
    assert table.cells(FRAME) == [
        ["effort: work on the hull", "J", "0*", "3", "1", "-", "energy"],
        ["time of one evaluation of the law", "ns", "10", "-", "5 (0.5)", "-", "law_ns"],
        ["distance to the target, integrated", "m s", "4", "2* (0.5)", "8 (2)", "-", "iae"],
    ]


def row(frame, name, **more):
    """The cells of a metric, without what it is and its name."""
    return next(cells[1:-1] for cells in table.cells(frame, **more) if cells[-1] == name)


def test_the_numbers_that_matter_most_come_first_and_nothing_is_lost():
    names = [name for name in METRICS if name != "law_ns"]
    frame = table.table({"a": dict.fromkeys(names, 1.0)})
    written = [cells[-1] for cells in table.cells(frame)]
    first = [name for name in names if METRICS[name].headline]
    assert written == [*first, *(name for name in names if not METRICS[name].headline)]
    assert {"iae_e", "settling_time", "e_steady", "energy", "saturated_fraction"} <= set(first)


def test_metrics_that_are_chosen_stand_in_their_order_in_every_form():
    chosen = ["iae", "path_done", "energy"]
    written = [cells[-1] for cells in table.cells(FRAME, chosen=chosen)]
    assert written == ["iae", "energy"]
    lines = table.as_markdown(FRAME, {}, chosen=chosen).splitlines()
    assert [line.split("`")[1] for line in lines[2:4]] == written
    rows = table.as_latex(FRAME, chosen=chosen).splitlines()[6:-2]
    assert [row.split(" & ")[0] for row in rows] == [f"${METRICS[n].symbol}$" for n in written]


def test_what_never_happened_in_a_run_that_finished_is_never_and_not_undefined():
    runs = {"a": {"iae": 1.0, "settling_time": math.nan}, "lost": {"settling_time": math.nan}}
    assert row(table.table(runs), "settling_time") == ["s", "never", "-"]
    assert row(table.table(runs), "iae") == ["m s", "1*", "-"]


def test_every_metric_says_what_it_is_in_words_and_no_two_say_the_same():
    of_windows = metrics_of_windows((("late", (5.0, 9.0)),), (("near", 0.5),))
    metrics = [m for m in (METRICS | of_windows).values() if NAMED not in m.name]
    words = [metric.row for metric in metrics]
    assert len(set(words)) == len(words)
    assert not [text for text in words if "_" in text or len(text) > 70]


def test_a_run_that_does_not_end_at_its_target_is_never_the_best():
    unsettled = [str(FRAME.columns[1])]
    assert row(FRAME, "iae", unsettled=unsettled) == ["m s", "4*", "2 (0.5)", "8 (2)", "-"]
    assert unsettled[0] not in table.leaders(FRAME, unsettled=unsettled)
    assert "4*" in table.as_markdown(FRAME, {}, unsettled=unsettled)
    assert r"\textbf{4}" in table.as_latex(FRAME, unsettled=unsettled)
    assert r"\textbf{2}" not in table.as_latex(FRAME, unsettled=unsettled)


def test_numbers_that_read_the_same_are_marked_the_same():
    frame = table.table({"a": {"iae": 0.500653}, "b": {"iae": 0.500649}, "c": {"iae": 0.50066}})
    assert row(frame, "iae") == ["m s", "0.50065*", "0.50065* (1)", "0.50066 (1)"]


def test_a_measured_time_is_never_marked_as_the_best():
    frame = table.table({"a": {"law_ns": 90.0}, "b": {"law_ns": 80.0}})
    assert row(frame, "law_ns") == ["ns", "90", "80 (0.889)"]


def test_a_run_by_itself_is_not_ranked():
    alone = table.table({"a": {"iae": 9.0, "energy": 0.0, "settling_time": 2.5}})
    assert row(alone, "iae") == ["m s", "9"]
    assert "*" not in "".join(text for line in table.rows(alone) for text in line.texts)
    assert r"\textbf" not in table.as_latex(alone)
    said = table.as_markdown(alone, {"a": ""})
    assert "smallest" not in said
    assert "not defined" in said
    assert "smallest" in table.as_markdown(FRAME, {"a": ""})


def test_where_a_law_keeps_a_standoff_to_be_nearer_is_not_better():
    frame = table.table({"a": {"iae": 9.0, "iae_e": 5.0}, "b": {"iae": 8.0, "iae_e": 6.0}})
    assert table.leaders(frame) == {"a": ["iae_e"], "b": []}
    assert r"\textbf" not in table.as_latex(frame, chosen=["iae"])
    # One that stays within half its standoff is farther from it than from the target.
    inside = table.table({"a": {"iae": 1.0, "iae_e": 3.0}, "b": {"iae": 2.0, "iae_e": 2.0}})
    assert table.leaders(inside) == {"a": [], "b": ["iae_e"]}
    without = table.table({"a": {"iae": 1.0, "iae_e": 1.0}, "b": {"iae": 2.0, "iae_e": 2.0}})
    assert table.leaders(without) == {"a": ["iae", "iae_e"], "b": []}
    unknown = table.table({"a": {"iae": 1.0, "iae_e": math.nan}, "b": {"iae": 2.0}})
    assert table.leaders(unknown) == {"a": ["iae"], "b": []}


def test_csv_has_units_first_and_ratios_last():
    head, *rows = (line.split(",") for line in table.as_csv(FRAME).splitlines())
    assert head == ["metric", "unit", "a", "b", "c", "lost", "b/a", "c/a", "lost/a"]
    iae, energy, _ = sorted(rows, key=lambda row: ["iae", "energy", "law_ns"].index(row[0]))
    assert energy == ["energy", "J", "0.0", "3.0", "1.0", "", "", "", ""]  # nothing over 0
    assert iae == ["iae", "m s", "4.0", "2.0", "8.0", "", "0.5", "2.0", ""]
    below = table.as_csv(table.table({"a": {"iae": -2.0}, "b": {"iae": math.inf}}))
    assert below.splitlines()[1] == "iae,m s,-2.0,inf,-inf"  # numbers, and no formulas


def test_a_comparison_is_a_frame_of_pandas_in_python():
    frame = FRAME.frame()
    assert (frame.index.name, list(frame.columns)) == ("metric", ["a", "b", "c", "lost"])
    assert frame.loc["iae", ["a", "b", "c"]].tolist() == [4.0, 2.0, 8.0]
    assert frame["lost"].isna().all()


def test_markdown_tells_how_runs_ended():
    text = table.as_markdown(FRAME, {"a": "", "lost": "killed"})
    lines = text.splitlines()
    assert lines[0] == "|  | unit | a | b | c | lost | name |"
    assert lines[1] == "| --- | --- | ---: | ---: | ---: | ---: | --- |"
    words = METRICS["iae"].row
    assert lines[4] == f"| {words} | m s | 4 | 2* (0.5) | 8 (2) | - | `iae` |"
    assert lines[-2:] == ["", "- lost: killed"]
    assert table.as_markdown(FRAME, {"a": ""}).endswith(table.note(FRAME) + "\n")


def test_latex_escapes_and_marks():
    frame = table.table({"a_b&~^\\{}": {"iae": 1.0}, "#$%": {"iae": 2.0}})
    lines = table.as_latex(frame).splitlines()
    first = r"a\_b\&\textasciitilde{}\textasciicircum{}\textbackslash{}\{\}"
    head = rf"\multicolumn{{2}}{{c}}{{{first}}} & \multicolumn{{2}}{{c}}{{\#\$\%}} \\"
    assert lines[4].endswith(head)
    assert lines[6] == r"$\int z_e\,\mathrm{d}t$ & m s & \textbf{1} & \textbf{.00} & 2 & .00 \\"


def test_latex_has_symbols_or_words_and_numbers_cut_at_their_point():
    numbers = {"effort_r": 1.3e7, "ise": 2e-9, "saturated_fraction": 0.5}
    lost = {"path_time": math.nan, "ise": 1.0}
    runs = {"a": numbers | {"path_time": 7.5}, "b": {"effort_r": 3.25e12, "ise": 4e-2}, "c": lost}
    text = table.as_latex(table.table(runs))
    rows = [line.removesuffix(r" \\").split(" & ") for line in text.splitlines()]
    by_row = {row[0]: row[1:] for row in rows[6:-2]}
    assert by_row[r"$\int z_e^2\,\mathrm{d}t$"] == [
        "m$^2$ s",
        r"\textbf{\boldmath 2}",
        r"\textbf{\boldmath .00$\times10^{-9}$}",
        "0",
        ".0400",
        "1",
        ".00",
    ]
    assert by_row[r"$\int\tau_r^2\,\mathrm{d}t$"][3:5] == ["3", r".25$\times10^{12}$"]
    words = METRICS["saturated_fraction"].row
    assert by_row[words] == ["1", r"\textbf{0}", r"\textbf{.500}", "-", "", "-", ""]
    assert by_row[METRICS["path_time"].row][-2:] == ["never", ""]
    columns = text.splitlines()[2].rpartition("Xl")[2].replace("@{}", "")
    assert {len(row) - 2 for row in rows[6:-2]} == {len(columns.removesuffix("}"))}
    assert "booktabs" in text.splitlines()[0]


def test_latex_has_a_power_of_ten_once_where_all_numbers_of_a_row_have_nearly_that():
    """A large and a small row, one with a zero; what differs by a thousand keeps its own powers."""
    numbers = {"energy": [30934.5, 1720.0], "saturated_fraction": [0.0355, 0.0144]}
    numbers |= {"iae": [1e-9, 1.0], "e_ct_max": [0.0, 2.5e3]}
    runs = {label: {name: row[i] for name, row in numbers.items()} for i, label in enumerate("ab")}
    lines = table.as_latex(table.table(runs)).splitlines()[6:-2]
    rows = {line.split(" & ")[0]: line.removesuffix(r" \\").split(" & ")[1:] for line in lines}
    small = r"\textbf{\boldmath .00$\times10^{-9}$}"
    assert rows[f"${METRICS['iae'].symbol}$"] == ["m s", r"\textbf{\boldmath 1}", small, "1", ".00"]
    share = ["$10^{-2}$", "3", ".55", r"\textbf{1}", r"\textbf{.44}"]
    assert rows[METRICS["saturated_fraction"].row] == share
    work = ["$10^{3}$ J", "30", ".9", r"\textbf{1}", r"\textbf{.72}"]
    assert rows[f"${METRICS['energy'].symbol}$"] == work
    assert rows[METRICS["e_ct_max"].row] == ["$10^{3}$ m", r"\textbf{0}", "", "2", ".50"]


def typeset(folder, lines):
    """What pdflatex says of a page; no line of it is too wide."""
    (folder / "page.tex").write_text("\n".join(lines))
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "page.tex"],
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
    return done.stdout


@pytest.mark.skipif(not shutil.which("pdflatex"), reason="needs pdflatex")
def test_latex_fills_a_column_of_a_journal_and_nothing_is_overfull(tmp_path):
    """Type of 8 points, as IEEE's tables have it, for four runs at nine tenths of that or more."""
    names = ("e_ct_integral", "e_ct_steady", "path_time", "energy", "saturated_fraction")
    numbers = dict(zip(names, (81.2, 0.0485, 101.8, 3.1e4, 0.0355), strict=True))
    labels = ["los_pid", "alos", "momentum_vector", "velocity_vector", *"abcde"]
    page = [
        r"\documentclass[10pt,twocolumn]{article}\usepackage{booktabs,graphicx,tabularx}",
        r"\usepackage[textwidth=7.16in,columnsep=0.16in]{geometry}\begin{document}\newsavebox{\all}",
    ]
    for count in (1, 2, 4, 9):
        text = table.as_latex(table.table(dict.fromkeys(labels[:count], numbers)))
        (tmp_path / f"{count}.tex").write_text(text)
        given = rf"\input{{{count}}}\unskip"
        page += [
            rf"{{\footnotesize\sbox{{\all}}{{\def\resizebox#1#2#3{{#3}}{given}}}%",
            rf"\typeout{{{count} runs: \the\wd\all\space of \the\linewidth}}}}",
            *(
                rf"\begin{{{n}}}{t}{given}\end{{{n}}}"
                for n in ("table", "table*")
                for t in ("", r"\footnotesize")
            ),
            r"\clearpage",
        ]
    said = typeset(tmp_path, [*page, r"\end{document}"])
    widths = re.findall(r"(\d) runs: ([\d.]+)pt of ([\d.]+)pt", said)
    part = {int(count): float(line) / float(width) for count, width, line in widths}
    assert part[1] == part[2] == pytest.approx(1.0, abs=1e-3)
    assert 0.9 < part[4] < 1.0
    assert part[9] < 0.6


@pytest.mark.skipif(not shutil.which("pdflatex"), reason="needs pdflatex")
@pytest.mark.parametrize(
    ("style", "text", "between"),
    [("ieee", "43pc", "1pc"), ("elsevier", "522pt", "18pt")],  # IEEEtran; elsarticle, 5p
)
def test_latex_lines_of_the_pages_fill_columns_of_these_classes(tmp_path, style, text, between):
    """The lines of docs/check_a_paper.md, and that of docs/figures.md in two columns."""
    page = (ROOT / "docs/check_a_paper.md").read_text()
    packages, *lines = re.findall(r"^    (\\.*)$", page, re.M)
    (wide,) = re.findall(r"`(\\includegraphics.*?)`", (ROOT / "docs/figures.md").read_text())
    numbers = {"a": {"iae": 8.0, "iae_settled": 1.0}, "b": {"iae": 3.125, "iae_settled": 2.0}}
    for place, columns in (("paper/errors", 1), ("errors", 2)):
        file = tmp_path / f"{place}.pdf"
        file.parent.mkdir(exist_ok=True)
        figure = Figure(figsize=(STYLES[style].widths[columns], 1.0))
        figure.savefig(file)
    (tmp_path / "line").mkdir()
    (tmp_path / "line/comparison.tex").write_text(table.as_latex(table.table(numbers)))
    typeset(
        tmp_path,
        [
            rf"\documentclass[10pt,twocolumn]{{article}}{packages}",
            rf"\usepackage[textwidth={text},columnsep={between}]{{geometry}}\begin{{document}}",
            "Words.",
            *lines,
            rf"\begin{{figure*}}{wide}\end{{figure*}}",
            r"\end{document}",
        ],
    )


def test_latex_has_ratios_to_the_first_run_where_they_are_asked_for():
    frame = table.table({"a": {"iae": 8.0}, "b": {"iae": 3.125}, "c": {"iae": 1e-9}})
    (row,) = table.as_latex(frame, ratios=True).splitlines()[6:-2]
    assert row.split(" & ")[2:] == [
        "8",
        ".00",
        "3",
        ".12~(0.391)",
        r"\textbf{\boldmath 1}",
        r"\textbf{\boldmath .00$\times10^{-9}$}~(1.25e-10) \\",
    ]
    assert "(" not in table.as_latex(frame).splitlines()[6].partition("m s")[2]


def test_every_symbol_of_a_metric_can_be_set():
    symbols = [metric.symbol for metric in METRICS.values() if metric.symbol]
    assert len(symbols) >= 10
    for symbol in symbols:
        MathTextParser("path").parse(f"${symbol}$")


# --- differences


@pytest.mark.parametrize("key", OTHERWISE)
def test_a_difference_in_any_section_is_found(key):
    other = scenario(f"{key}={OTHERWISE[key]}")
    differing = differences({"a": scenario().model_dump(), "b": other.model_dump()})
    also = {"vessel.m": ["nominal.m"]}.get(key, [])  # the law is told about the vessel as it is
    assert list(differing) == [key, *also]
    assert differing[key]["b"] == float(OTHERWISE[key]) != differing[key]["a"]


def test_every_section_of_a_scenario_is_looked_at():
    sections = {key.partition(".")[0] for key in OTHERWISE}
    rest = {
        "name",
        "description",
        "controller",
        "controllers",
        "claims",
        "silence",
        "plugins",
        *BESIDE_RUNS,
        "measurement",
        "estimator",
        "origin",
    }
    assert sections | rest == set(type(scenario()).model_fields)


def test_sensors_and_an_estimator_are_a_difference():
    seeing = scenario("measurement={kind: sensors}", "estimator={kind: ekf}")
    differing = differences({"a": scenario().model_dump(), "b": seeing.model_dump()})
    assert differing["measurement.kind"] == {"a": "exact", "b": "sensors"}
    assert differing["estimator.kind"] == {"a": "none", "b": "ekf"}


@pytest.mark.parametrize("key", ["name=b", "description=b", "controller.K_Pu=3"])
def test_names_and_laws_are_no_difference(key):
    assert not differences({"a": scenario().model_dump(), "b": scenario(key).model_dump()})


def test_a_key_that_a_run_lacks_is_a_difference():
    other = scenario("disturbance.kind=none").model_dump()
    differing = differences({"a": scenario().model_dump(), "b": other})
    assert differing["disturbance.kind"] == {"a": "harmonic", "b": "none"}
    assert differing["disturbance.b_u.mean"]["b"] is None


def test_where_kinds_differ_only_the_kind_and_what_both_have_is_shown():
    calm, rough = scenario("disturbance.kind=none"), scenario("disturbance.scale=2")
    trees = {"a": scenario().model_dump(), "b": calm.model_dump()}
    assert as_text(differences(trees)) == {"disturbance.kind": {"a": "harmonic", "b": "none"}}
    third = as_text(differences({**trees, "c": rough.model_dump()}))
    assert list(third) == ["disturbance.kind", "disturbance.scale"]
    assert third["disturbance.scale"] == {"a": "1", "b": "-", "c": "2"}


# --- runs


def test_a_run_answers_for_itself():
    run = past_run({"iae": 3.0, "rmse": math.nan, "law_ns": 7.0}, cost={"law_ns": 9.0})
    assert (run.metric("iae"), run.metric("law_ns")) == (3.0, 9.0)
    assert math.isnan(run.metric("rmse"))
    assert math.isnan(run.metric("ise"))
    assert list(run.compared_metrics()) == ["iae", "rmse", "law_ns"]
    assert run.signal("x_e").tolist() == [0, 1, 2, 3]
    assert [run.has(name) for name in ("x_e", "y_e", "W_norm_u", "v")] == [True, *[False] * 3]
    with pytest.raises(KeyError):
        run.signal("v")
    assert (run.until, run.ending) == (4.0, "")
    assert run.check("finished") is True


def test_a_run_is_off_its_target_beyond_the_settling_radius_but_in_a_trial():
    near, far = {"e_steady": 0.9}, {"e_steady": 1.1}
    assert [past_run(metrics).off_target for metrics in (near, far)] == [False, True]
    assert not past_run(far, told=about("metrics.settling_radius=2")).off_target
    assert not past_run(far, told=about("controller={kind: zigzag}")).off_target
    assert not past_run(far, "diverged").off_target


def test_a_run_that_diverged_has_no_metrics_and_ends_early():
    message = "diverged at t = 3.5 s: u is not finite; last ..."
    run = past_run({"iae": 3.0}, "diverged", message, cost={"law_ns": 9.0})
    assert math.isnan(run.metric("iae"))
    assert math.isnan(run.metric("law_ns"))
    assert (run.until, run.ending) == (3.0, "diverged at t = 3.5 s")
    assert run.check("finished") is False
    assert run.check("underactuated") is True


def test_a_lost_run_has_nothing_but_its_scenario():
    lost = PastRun.without_log("a", about(), "Traceback\n  File\nZeroDivisionError: oops\n")
    assert lost.ending == "has no log: ZeroDivisionError: oops"
    assert math.isnan(lost.metric("iae"))
    assert (lost.compared_metrics(), lost.has("x"), lost.until) == ({}, False, 0.0)
    assert not lost.off_target
    assert lost.check("finished") is None
    assert lost.check("underactuated") is True


def test_whether_an_interrupted_run_would_have_finished_cannot_be_told():
    assert CHECKS["finished"](about(), "interrupted") is None


# --- verdicts


def test_verdicts_have_numbers_reasons_and_the_labels_of_the_comparison():
    by_name = {verdict.name: verdict.as_json() for verdict in verdicts()}
    assert [v["verdict"] for v in by_name.values()] == [
        "reproduced",
        "not reproduced",
        "cannot tell",
        "not reproduced",
    ]
    assert by_name["C1"]["expect"] == "a.iae == 3"
    assert by_name["C1"]["numbers"] == {"a.iae": 3.0}
    assert by_name["C1"]["reason"] == ""
    assert by_name["C3"]["numbers"] == {"lost.iae": None, "a.iae": 3.0}
    assert by_name["C3"]["reason"] == "lost.iae: lost has no log: killed"
    assert verdicts()[2].evidence() == "a.iae = 3; lost.iae: lost has no log: killed"


def test_claims_in_markdown_stay_in_their_cells():
    lines = claims.as_markdown(verdicts()).splitlines()
    assert lines[2] == (
        r"| C1 | a \| \<b\> (here) | **reproduced** | `a.iae == 3`, tolerance 0.05 | a.iae = 3 |"
    )
    assert lines[-1] == r"- C4: Not \<stated\>."
