"""A study's report, figures and words, from a small study and from numbers planted by hand."""

import math
import shutil
from dataclasses import replace
from math import inf

import numpy as np
import pytest
from browser_samples import WIDTHS, browsed, needs_browser
from html_tree import tree
from small_study import written
from study_samples import claim, judged, study

from podusv_cli.metrics.table import METRICS
from podusv_cli.pages.page import environment
from podusv_cli.process.extras import Extras
from podusv_cli.storage import files
from podusv_cli.studies.counting import runs_file
from podusv_cli.studies.telling import bars, figures, outputs, report
from podusv_cli.workflows import sweep

SUCCESS = "  success: finished and iae <= 0.215\n  claims:\n"
GRID = "  grid: {disturbance.scale: [0.5, 1], start.r: [0.0, 0.1]}\n"
CHANGES = ("says: Li tracks better.", "says: 'Li <b>tracks</b> better.'")


def made(folder, success, *, figures):
    config = written(folder / "small.yaml", ("  claims:\n", success), CHANGES)
    request = sweep.Request(("sweep.draws=7",), folder / "study", workers=1, figures=figures)
    return sweep.run(config, request, lambda tally: None)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study with a grid, without figures."""
    return made(tmp_path_factory.mktemp("report"), GRID + SUCCESS, figures=False)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A study without a grid, with figures and a kept log."""
    kept = f"  keep: {{failed: 1}}\n  laws: [pid, li]\n{SUCCESS}"
    return made(tmp_path_factory.mktemp("drawn"), kept, figures=True)


@pytest.fixture(scope="module")
def told(whole):
    return tree((whole.folder / "report.html").read_text())


def section(told, name):
    (found,) = told.all("section", id=name)
    return found


@pytest.mark.slow
def test_the_answer_comes_first(whole, told):
    assert [part.attributes["id"] for part in told.all("section")] == [
        "answer",
        "claims",
        "failures",
        "numbers",
        "varied",
        "provenance",
    ]
    answer = section(told, "answer")
    (verdict,) = whole.results.verdicts
    (counts,) = answer.all("div", kind="counts")
    assert f"1 {verdict.in_words}" in counts.text
    assert not verdict.published
    assert "S1 Li <b>tracks</b> better." in answer.text
    rows = answer.rows()
    words = [f"{METRICS[n].row} [{METRICS[n].unit}]" for n in ("iae", "z_e_steady")]
    assert rows[0] == ["law", "cell", "failed", "share", *words]
    assert len(rows) == 1 + 2 * 4
    for law, cell, failed, *_ in rows[1:]:
        runs = whole.results.runs
        count = int(np.sum(~runs.success(law)[runs.cells.index(cell)]))
        assert failed == f"{count} of 7"
    assert "Preliminary" not in answer.text


def test_the_worst_failures_of_every_law_are_listed_with_what_decided_and_how_to_get_one(
    whole, told
):
    part, runs = section(told, "failures"), whole.results.runs
    head, *rows = part.rows()
    assert head == ["law", "cell", "draw", "ending", "cause", "other laws fail", "drawn"]
    total = sum(int(np.sum(runs.failed(law))) for law in runs.laws)
    assert len(rows) == min(total, report.FIRST)
    assert total > report.FIRST
    assert f"{total - report.FIRST} more failed" in part.text
    for law, cell, draw, ending, cause, others, _ in rows:
        assert ending == "finished"
        place = int(cell.partition(":")[0]), int(draw)
        value = runs.metric(law, "iae")[place]
        assert value > 0.215
        assert cause == f"iae = {value:.5g}"
        (other,) = {*runs.laws} - {law}
        assert others == f"{int(runs.metric(other, 'iae')[place] > 0.215)} of 1"
    for law in runs.laws:
        listed = [float(row[4].removeprefix("iae = ")) for row in rows if row[0] == law]
        assert len(listed) == min(int(np.sum(runs.failed(law))), report.FIRST // 2)
        all_of_law = np.sort(runs.metric(law, "iae")[runs.failed(law)])[::-1]
        assert listed == pytest.approx(all_of_law[: len(listed)], rel=1e-4)
    law, cell, draw, *_ = rows[0]
    (command,) = part.all("pre")
    number = cell.partition(":")[0]
    assert command.text == (
        f"podusv sweep draw {whole.folder} --law {law} --draw {draw} --cell {number}"
    )


def test_runs_that_ended_first_come_first(whole, monkeypatch):
    runs, until = whole.results.runs, np.ones((4, 7))
    until[1, 4], until[0, 2] = 0.5, 0.2
    monkeypatch.setattr(runs, "until", lambda law: until)
    monkeypatch.setattr(runs, "finished", lambda law: until == 1.0)
    listed = report.runs_that(whole.results, lambda law: until < 2.0).first
    first = [row for row in listed if row.law == runs.laws[1]]
    assert [(row.cell, row.draw) for row in first[:2]] == [(0, 2), (1, 4)]
    assert len(listed) == report.FIRST
    assert len(first) == report.FIRST // 2


@pytest.mark.parametrize(
    ("success", "missed"),
    [
        ("finished and iae <= 0.215", lambda iae, z: iae - 0.215),
        ("finished and iae >= 0.24", lambda iae, z: 0.24 - iae),
        ("finished and not 0.215 < iae", lambda iae, z: iae - 0.215),
        ("z_e_steady >= 1e9 and finished", lambda iae, z: -z),
    ],
)
def test_the_run_that_missed_success_by_most_comes_first_of_its_law(whole, success, missed):
    runs = runs_file.RunsTable(whole.folder / "runs.h5", success, whole.results.known_metrics)
    listed = report.runs_that(replace(whole.results, runs=runs), runs.failed).first
    for law in runs.laws:
        by = np.where(
            runs.failed(law), missed(runs.metric(law, "iae"), runs.metric(law, "z_e_steady")), -inf
        )
        most = np.argsort(-by, axis=None)[: min(runs.failed(law).sum(), report.FIRST // 2)]
        assert len(most) > 2
        places = [row.cell * runs.wanted + row.draw for row in listed if row.law == law]
        assert places == most.tolist()


def test_a_comparison_that_a_run_keeps_does_not_rank_it(whole):
    """All keep the first, each by another margin; the second decides."""
    success = "finished and iae < 1e3 and z_e_steady <= 0"
    runs = runs_file.RunsTable(whole.folder / "runs.h5", success, whole.results.known_metrics)
    listed = report.runs_that(replace(whole.results, runs=runs), runs.failed).first
    for law in runs.laws:
        steady, of_law = runs.metric(law, "z_e_steady"), [row for row in listed if row.law == law]
        missed = [steady[row.cell, row.draw] for row in of_law]
        assert len(missed) > 2
        assert missed == sorted(missed, reverse=True)


@pytest.mark.parametrize("by_chance", [0.0, math.nan, 1.0])
def test_of_a_draw_the_values_are_listed_that_go_together_most_with_success(drawn, by_chance):
    rows = [row | {"by_chance": by_chance} for row in drawn.results.tables.sensitivity]
    tables = drawn.results.tables._replace(sensitivity=rows)
    results = replace(drawn.results, tables=tables)
    (row, *_) = report.runs_that(results, results.runs.failed).first
    sizes = {
        r["quantity"]: abs(r["correlation"])
        for r in rows
        if (r["law"], r["metric"]) == (row.law, "iae")
    }
    most = sorted(sizes, key=sizes.__getitem__, reverse=True)[: report.DECISIVE]
    told = [f"{name} {results.runs.drawn_quantities[name][row.draw]:.3g}" for name in most]
    assert told
    assert row.drawn == ("-" if by_chance == 1.0 else ", ".join(told))


def test_what_was_varied_is_told_in_words(told):
    rows = section(told, "varied").rows()
    assert [
        "vessel.m",
        "the scenario's own value times a factor: uniform from 0.7 to 1.3",
        "23.8",
    ] in rows
    assert ["disturbance.scale", "0.5, 1"] in rows


@pytest.mark.slow
def test_figures_are_files_and_pictures(drawn):
    names = {path.stem for path in (drawn.folder / "figures").iterdir()}
    assert names == {
        "distribution-iae",
        "distribution-z_e_steady",
        "failures-iae",
        "funnel",
        "ratios-iae",
        "ratios-z_e_steady",
        "sensitivity-iae",
        "sensitivity-z_e_steady",
    }
    told = tree((drawn.folder / "report.html").read_text())
    captions = [caption.text for caption in told.all("figcaption")]
    assert [c.partition(".")[0] for c in captions] == [f"Figure {i + 1}" for i in range(len(names))]
    folders = [row[0] for row in section(told, "kept").rows()[1:]]
    assert folders == ["logs/pid-0-0", "logs/li-0-0"]


def test_no_figures_are_drawn_where_none_are_wanted(drawn, tmp_path):
    folder = tmp_path / "plain"
    shutil.copytree(drawn.folder, folder)
    sweep.report(folder, sweep.Request(figures=False))
    assert not list((folder / "figures").iterdir())
    assert "<figcaption>" not in (folder / "report.html").read_text()


def test_a_table_of_cells_has_the_whole_page_and_its_keys_break_after_dots(whole):
    """Beside a figure it was cut behind its second number at 1920 pixels."""
    plain = whole.results.without_verdicts("")
    answer = section(tree(report.page(whole.folder, plain, [], [], [])), "answer")
    assert "failed" in answer.all("table")[0].text
    assert not answer.all("div", kind="answer")
    label = environment("podusv_cli.studies.telling").filters["label"]
    assert label("a_b<c.d_e = 0.1") == "a_<wbr>b&lt;c.<wbr>d_<wbr>e = 0.1"


def test_a_study_with_a_grid_has_figures_of_cells_and_of_the_grid(whole):
    names = [one.name for one in figures.sketches(whole.results, {})]
    assert {"distribution-iae-cell0", "failures-iae-cell3", "grid-failed", "grid-iae"} <= {*names}
    assert len({*names}) == len(names)


@pytest.mark.slow
def test_a_figure_that_fails_costs_nothing_else(drawn, monkeypatch, tmp_path):
    def broken(*args, **kwargs):
        raise ArithmeticError("no such curve")

    monkeypatch.setattr(figures, "distributions", broken)
    extras = Extras()
    outputs.write_tables(tmp_path, drawn.results)
    outputs.write_report(tmp_path, drawn.results, [], extras, figures=True)
    assert {part.what for part in extras.missing} >= {"figure distribution-iae"}
    told = tree((tmp_path / "report.html").read_text())
    assert "no such curve" in section(told, "answer").text
    assert (tmp_path / "figures" / "ratios-iae.png").exists()
    assert (tmp_path / "missing.json").exists()
    outputs.write_report(tmp_path, drawn.results, [], Extras(), figures=False)
    assert not (tmp_path / "missing.json").exists()


def test_an_interrupt_while_figures_are_drawn_costs_figures_alone(drawn, tmp_path, monkeypatch):
    def interrupted(listed, extras):
        extras.interrupted = True
        return {}, []

    folder = tmp_path / "stopped"
    shutil.copytree(drawn.folder, folder)
    (folder / "summary.csv").unlink()
    monkeypatch.setattr("podusv_cli.figures.sketch.render_sketches", interrupted)
    with pytest.raises(KeyboardInterrupt, match=f"podusv sweep report {folder}"):
        sweep.report(folder, sweep.Request())
    same = (drawn.folder / "summary.csv").read_bytes()
    assert (folder / "summary.csv").read_bytes() == same
    assert (folder / "report.html").exists()
    assert not (folder / "manifest.json").exists()


def test_the_heatmap_has_every_cell_in_its_place(whole):
    results = whole.results
    panel = figures._panel(results, "pid", "iae", 2)
    table = results.summary[(results.summary.law == "pid") & (results.summary.metric == "iae")]
    for label, median in zip(table.cell, table.q50, strict=True):
        values = dict(part.split(" = ") for part in label.split(", "))
        column = [0.5, 1.0].index(float(values["disturbance.scale"]))
        row = [0.0, 0.1].index(float(values["start.r"]))
        assert panel[row, column] == median


def test_a_study_with_runs_missing_is_preliminary(whole, tmp_path):
    config = written(tmp_path / "small.yaml")
    request = sweep.Request(("sweep.draws=6",), tmp_path / "s", workers=1, shard=(1, 2))
    sweep.run(config, request, lambda tally: None)
    done = sweep.report(tmp_path / "s", sweep.Request(figures=False))
    answer = section(tree((tmp_path / "s" / "report.html").read_text()), "answer")
    assert "Preliminary: 3 of 6 draws that all 2 laws have." in answer.text
    assert "6 of 12 runs are made" in answer.text
    assert done.results.made_runs == 6


def test_broken_runs_are_told_with_their_causes(whole, monkeypatch):
    runs = whole.results.runs
    broke = {law: np.arange(7) % 7 == 3 for law in runs.laws}
    monkeypatch.setattr(runs, "broken", lambda law: np.broadcast_to(broke[law], (4, 7)))
    monkeypatch.setattr(runs, "causes", {(0, 2, 3): "the law <raised>"})
    told = tree(report.page(whole.folder, whole.results, [], [], []))
    assert "8 runs crashed, hung or had an invalid draw" in section(told, "answer").text
    assert "the law <raised>" in section(told, "failures").text


# --- bars


def only_bar(expect, runs):
    (one,) = bars.bars(claim(expect, runs.laws), judged(runs, expect))
    return one


def test_a_bar_has_interval_estimate_and_bound_in_their_order():
    runs = study(a=np.arange(1.0, 101.0), b=np.r_[np.full(30, 0.5), np.full(70, 1e3)])
    bar = only_bar("share(a.iae < b.iae) >= 0.9", runs)
    assert 0.0 < bar.low < bar.estimate < bar.high < bar.bound < 100.0
    assert bar.asked == (bar.bound, 100.0)
    assert bar.words.startswith("share(a.iae < b.iae): 70 % [60, 78.8]; compared with: ")
    assert bar.words.endswith("compared with: at least 90 %")
    low, high = (float(end.removesuffix(" %")) for end in bar.ends)
    assert low + bar.estimate / 100.0 * (high - low) == pytest.approx(70.0, abs=0.1)


def test_a_bar_with_an_open_end_runs_to_the_edge():
    runs = study(a=np.r_[np.arange(1.0, 18.0), [math.inf] * 3])
    bar = only_bar("quantile(a.iae, 0.8) <= 10", runs)
    assert bar.high == 100.0
    assert "16 [12, failed]" in bar.words
    lost = only_bar("quantile(a.iae, 0.95) <= 10", runs)
    assert (lost.estimate, lost.words.split(": ")[1].split(",")[0]) == (None, "failed [17")


# --- the page


def test_a_funnel_shows_every_kept_run_once_in_the_legend():
    from podusv_cli.figures.style import house_style

    time = np.linspace(0.0, 10.0, 50)
    runs = {"a": [(time, np.exp(-time)), (time, np.full(50, 2.0))], "b": [(time, 1e9 + time)]}
    with house_style():
        axes = figures.funnel(runs).axes[0]
    assert len(axes.lines) == 3
    assert [line.get_label() for line in axes.lines if line.get_label()[0] != "_"] == ["a", "b"]
    assert axes.get_ylim()[1] == pytest.approx(3.0)


def test_a_report_needs_nothing_else(drawn):
    text = files.read_text(drawn.folder / "report.html")
    assert "<script" not in text
    assert "http" not in text.replace("http://www.w3.org", "")
    assert "logs/pid-0-0" in text


def test_the_table_on_the_terminal_has_failures_in_percent(whole):
    head, (row, *_) = whole.results.cells()
    words = [f"median of {METRICS[name].row}" for name in ("iae", "z_e_steady")]
    assert head == ["law", "cell", "failed", f"{words[0]} [m s]", f"{words[1]} [m]"]
    assert row[:3] == ["pid", "disturbance.scale = 0.5, start.r = 0.0", "85.7 % [42.1, 99.6]"]


# --- in a browser

PROBE = """
<script>
addEventListener("load", () => {
  const told = {};
  for (const frame of document.querySelectorAll("iframe")) {
    const page = frame.contentDocument, width = frame.clientWidth;
    const inside = (e) => e.closest(".wide, details:not([open]), svg");
    told[frame.id] = [...page.querySelectorAll("body *")].filter((e) => !inside(e.parentElement))
      .filter((e) => e.getBoundingClientRect().right > width + 0.5)
      .map((e) => e.outerHTML.slice(0, 80));
    told[frame.id].push(Math.max(0, page.documentElement.scrollWidth - width));
    told[frame.id].push([...page.images].filter((image) => !image.naturalWidth).length);
  }
  const end = document.createElement("output");
  end.id = "said";
  end.textContent = JSON.stringify(told);
  document.body.append(end);
});
</script>
"""


@needs_browser
@pytest.mark.browser
@pytest.mark.parametrize("kind", ["whole", "drawn"])
def test_nothing_is_wider_than_the_page(kind, request, tmp_path):
    page = (request.getfixturevalue(kind).folder / "report.html").read_text()
    said, _ = browsed(tmp_path, page, probe=PROBE)
    assert said == {f"w{width}": [0, 0] for width in WIDTHS}
