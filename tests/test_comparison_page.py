"""The HTML report, from numbers planted by hand."""

from comparison_samples import FRAME, Folder, scenario, verdicts
from html_tree import tree

from podusv_cli.comparison import outputs, report
from podusv_cli.comparison.entries import Entry
from podusv_cli.core.finding import Finding


def page(**parts):
    story = {
        "title": "planted", "scenario": scenario(),
        "controllers": {"a": scenario().controller}, "endings": {"a": "", "lost": "killed <9>"},
        "differences": {"start.x": {"a": 1.0, "lost": [1.0, 2.5]}}, "table": FRAME,
        "noticed": [Finding("crosswise", "controller", "|x| < 1", ("<a>",))],
        "verdicts": verdicts(), "theories": {}, "figures": [("errors", "x_e & y_e", b"<svg/>")],
        "provenance": {"git": {"commit": "abc"}},
    }  # fmt: skip
    return report.page(report.Story(**story | parts))


def theory(bound, holds):
    """A run's theory.json, as far as the report reads it."""
    forms = {name: {"lambda": 0.05, "bound": bound} for name in ("corrected", "printed")}
    return {
        "conditions": [{"name": "k_ze", "value": 0.1, "limit": 0.05, "holds": holds}],
        "assumptions": [{"assumption": "gives what is asked", "holds": holds, "found": 3.0}],
        "windows": {"settled": {**forms, "largest_V": 0.25}},
    }


def test_the_report_has_the_bounds_of_every_run_with_a_theory():
    rows = tree(page(theories={"a": theory(2.5, True), "<b>": theory(None, False)})).rows()
    assert ["a", "settled", "0.05", "2.5", "2.5", "0.25", "none"] in rows
    missing = "k_ze = 0.1 must exceed 0.05; not true: gives what is asked (3)"
    assert ["<b>", "settled", "0.05", "none", "none", "0.25", missing] in rows
    assert "Stability" not in page(theories={})


def test_the_report_tells_how_runs_ended_and_differ():
    told = tree(page())
    assert "lost: killed <9>" in [item.text for item in told.all("li")]
    assert ["key", "a", "lost"] in told.rows()
    assert ["start.x", "1", "1 2.5"] in told.rows()
    assert "Not all runs finished" not in page(endings={"a": ""})
    assert "differ in more" not in page(differences={})


def test_the_report_has_the_table_with_numbers_to_the_right():
    told = tree(page())
    row = next(row for row in told.all("tr") if row.text.startswith("iae"))
    assert told.rows()[told.all("tr").index(row)] == ["iae", "m s", "4", "2 (0.5)", "8 (2)", "-"]
    assert [cell.text for cell in row.all(kind="number")] == ["4", "2 (0.5)", "8 (2)", "-"]
    assert [best.text for best in row.all("b")] == ["2 (0.5)"]


def test_the_report_has_every_verdict_escaped():
    told = tree(page())
    for kind, answer in {
        "reproduced": "reproduced",
        "not": "not reproduced",
        "cannot": "cannot tell",
    }.items():
        assert answer in [mark.text for mark in told.all("b", kind=kind)]
    for text in (
        "a | <b>", "(here)", "Not <stated>.", "lost.iae < a.iae", "tolerance 0.05",
        "lost.iae: lost has no log: killed",
    ):  # fmt: skip
        assert text in told.text
    assert not [e for e in told.inside() if e.tag == "stated"]
    assert "Claims" not in page(verdicts=[])


def test_the_report_has_what_was_noticed_escaped():
    assert ["crosswise", "<a>: controller", "|x| < 1"] in tree(page()).rows()
    alone = page(noticed=[Finding("crosswise", "controller", "|x| < 1")])
    assert ["crosswise", "controller", "|x| < 1"] in tree(alone).rows()
    assert "Noticed" not in page(noticed=[])


def test_the_report_of_a_comparison_has_its_warnings():
    saturated = Finding("saturated", "actuator", "long <b>")
    entries = [Entry(label, Folder({}), scenario()) for label in ("a", "b")]
    told = {"a": [saturated], "b": []}
    result = outputs.Result(
        {"a": scenario(), "b": scenario()}, entries, {}, {}, FRAME, [], {}, told
    )
    text = outputs.as_report(result, "title", {}, {})
    assert ["saturated", "a: actuator", "long <b>"] in tree(text).rows()


def test_the_report_has_scenario_figures_and_provenance():
    told = tree(page())
    assert "What the <test> is for." in [part.text for part in told.all("p")]
    assert "errors: x_e & y_e" in [part.text for part in told.all("figcaption")]
    assert ["git.commit", "abc"] in told.rows()
    assert "controller a" in [part.text for part in told.all("b")]
    assert "surge_limit 8" in told.text
    assert "Figures" not in page(figures=[])
