"""The HTML report, from numbers planted by hand."""

import re

from comparison_samples import FRAME, Folder, scenario, verdicts

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
    text = page(theories={"a": theory(2.5, True), "<b>": theory(None, False)})
    row = "<td>settled</td><td>0.05</td><td>{0}</td><td>{0}</td><td>0.25</td><td>{1}</td></tr>"
    assert "<tr><td>a</td>" + row.format("2.5", "nothing") in text
    missing = "k_ze = 0.1 has to exceed 0.05; gives what is asked (off by 3)"
    assert "<tr><td>&lt;b&gt;</td>" + row.format("none", missing) in text
    assert "Stability" not in page(theories={})


def test_the_report_tells_how_runs_ended_and_differ():
    text = page()
    assert "Not all runs finished:<ul><li><b>lost</b>: killed &lt;9&gt;</li></ul>" in text
    assert "<tr><th>key</th><th>a</th><th>lost</th></tr>" in text
    assert "<tr><td>start.x</td><td>1</td><td>1 2.5</td></tr>" in text
    assert "Not all runs finished" not in page(endings={"a": ""})
    assert "differ in more" not in page(differences={})


def test_the_report_has_the_table_with_numbers_to_the_right():
    number = "<td class=number>".replace('"', "")
    assert (
        f"<tr><td>iae</td><td>m s</td>{number}4</td>{number}<b>2 (0.5)</b></td>{number}8 (2)</td>"
        f"{number}-</td></tr>"
    ) in page()
    assert "<th>unit</th><th class=number>a</th>" in page()


def test_the_report_has_every_verdict_escaped():
    text = page()
    assert "<b class='reproduced'>reproduced</b>" in text
    assert "<b class='not'>not reproduced</b>" in text
    assert "<b class='cannot'>cannot tell</b>" in text
    assert "a | &lt;b&gt; <small>(here)</small><br><small>Not &lt;stated&gt;.</small>" in text
    assert "<code>lost.iae &lt; a.iae</code>, tolerance 0.05" in text
    assert "lost.iae: lost has no log: killed" in text
    assert "<b>" not in re.sub(r"</?b>", "", text)
    assert "Claims" not in page(verdicts=[])


def test_the_report_has_what_was_noticed_escaped():
    row = "<tr><td><code>crosswise</code></td><td>{}controller</td><td>|x| &lt; 1</td></tr>"
    assert row.format("&lt;a&gt;: ") in page()
    assert row.format("") in page(noticed=[Finding("crosswise", "controller", "|x| < 1")])
    assert "Noticed" not in page(noticed=[])


def test_the_report_of_a_comparison_has_its_warnings():
    saturated = Finding("saturated", "actuator", "long <b>")
    entries = [Entry(label, Folder({}), scenario()) for label in ("a", "b")]
    told = {"a": [saturated], "b": []}
    result = outputs.Result(
        {"a": scenario(), "b": scenario()}, entries, {}, {}, FRAME, [], {}, told
    )
    text = outputs.as_report(result, "title", {}, {})
    assert "<td>a: actuator</td><td>long &lt;b&gt;</td>" in text


def test_the_report_has_scenario_figures_and_provenance():
    text = page()
    assert "<p>What the &lt;test&gt; is for.</p>" in text
    assert "<figcaption>errors: x_e &amp; y_e</figcaption>" in text
    assert "<td>git.commit</td><td>abc</td>" in text
    assert "<b>controller a</b>" in text
    assert "surge_limit 8" in text
    assert "Figures" not in page(figures=[])
