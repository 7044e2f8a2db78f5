"""The HTML report, from numbers planted by hand."""

from dataclasses import replace

import pytest
from comparison_samples import FRAME, about, scenario, verdicts
from drawn_samples import recording, shown
from html_tree import tree
from page_samples import ERRORS, page, theory

from podusv_cli.comparison import report, table
from podusv_cli.components.controllers.velocity_vector import VelocityVector
from podusv_cli.core.finding import Finding
from podusv_cli.figures import chase
from podusv_cli.metrics.table import METRICS
from podusv_cli.pages.page import Picture
from podusv_cli.scenario.about import about_of

MOVING = chase.chase(shown(("a", recording())))


def section(name, **parts):
    (found,) = tree(page(**parts)).all("section", id=name)
    return found


def test_the_report_has_the_bounds_of_every_run_with_a_theory():
    rows = tree(page(theories={"a": theory(2.5, True), "<b>": theory(None, False)})).rows()
    assert ["a", "settled", "0.05", "2.5", "2.5", "0.25", "none"] in rows
    missing = "k_ze = 0.1 must exceed 0.05; not true: gives what is asked (3)"
    assert ["<b>", "settled", "0.05", "none", "none", "0.25", missing] in rows
    assert "Stability" not in page(theories={})


def test_the_report_tells_how_runs_ended_and_differ():
    told = tree(page(endings={"a": "", "lost": "killed <9>", "b": "far; x 1\nlast"}))
    items = [item.text for item in told.all("li")]
    assert "lost: killed <9>" in items
    assert "b: far all that is known far; x 1 last" in items
    assert ["key", "a", "lost"] in told.rows()
    assert ["start.x", "1", "1 2.5"] in told.rows()
    assert "Not all runs finished" not in page(endings={"a": ""})
    assert "differ in more" not in page(differences={})


def test_the_report_has_the_table_with_numbers_to_the_right():
    told = tree(page())
    row = next(
        row for row in told.all("tr") if row.all("code") and row.all("code")[0].text == "iae"
    )
    assert row.all("abbr")[0].text == METRICS["iae"].row
    assert told.rows()[told.all("tr").index(row)][1:] == ["m s", "4", "2 (0.5)", "8 (2)", "-"]
    assert [cell.text for cell in row.all(kind="number")] == ["4", "2 (0.5)", "8 (2)", "-"]
    assert [best.text for best in row.all("b")] == ["2 (0.5)"]


def test_many_runs_stand_below_each_other_a_few_numbers_to_a_table():
    labels = [f"a_long_label_of_a_run_{i}" for i in range(report.MANY + 1)]
    names = [name for name in METRICS if name != "law_ns"]
    runs = {label: dict.fromkeys(names, 1.0) for label in labels}
    told = section("comparison", table=table.table(runs))
    tables = told.all("table")
    assert [row[0] for row in tables[0].rows()[1:]] == labels
    assert max(len(row) for one in tables for row in one.rows()) <= report.FEW + 1
    shown = [code.text for one in tables for code in one.all("code")]
    assert sorted(shown) == sorted(names)
    del runs[labels[-1]]
    few = section("comparison", table=table.table(runs))
    assert "Below each column's heading" in told.text
    assert "Below each row's name" in few.text
    assert few.all("table")[0].rows()[0][2:] == labels[: report.MANY]


def test_only_the_headline_numbers_are_unfolded():
    told = section("comparison")
    folded = [code.text for part in told.all("details", kind="others") for code in part.all("code")]
    assert folded == ["iae"]
    assert [code.text for code in told.all("table")[0].all("code")] == ["energy", "law_ns"]


def test_what_is_ours_holds_or_fails_and_only_what_was_published_is_reproduced():
    ours = [replace(v, claim=v.claim.model_copy(update={"source": "ours"})) for v in verdicts()]
    (counts,) = section("answer", verdicts=ours).all("div", kind="counts")
    assert counts.text == "1 holds 2 fail 1 cannot tell"
    (counts,) = section("answer", verdicts=[*verdicts(), *ours]).all("div", kind="counts")
    assert counts.text == "1 reproduced 2 not reproduced 1 holds 2 fail 2 cannot tell"
    assert [v.as_json()["verdict"] for v in ours] == [v.verdict for v in verdicts()]


def test_the_answer_counts_the_claims_and_lists_them_in_words():
    answer = section("answer")
    (counts,) = answer.all("div", kind="counts")
    assert counts.text == "1 reproduced 2 not reproduced 1 cannot tell"
    lists = {told.attributes["aria-label"]: told.text for told in answer.all("ul", kind="told")}
    assert lists["reproduced"] == "C1 a | <b>"
    assert lists["not reproduced"] == "C2 a | <b> C4 a | <b>"
    targets = [link.attributes["href"] for link in answer.all("a")]
    claims = section("claims").all("li")
    assert [f"#{claim.attributes['id']}" for claim in claims] == sorted(targets[:4])
    assert "claim" not in section("answer", verdicts=[]).text


def test_the_answer_says_who_is_best_in_what():
    answer = section("answer")
    assert [term.text for term in answer.all("dt")] == ["a", "b", "c"]
    first, second, third = answer.all("dd")
    effort = METRICS["energy"].row
    assert first.text == f"{effort.capitalize()}: 0 J. Best in {effort}."
    assert second.text == f"{effort.capitalize()}: 3 J. Best in 1 further number."
    assert third.text == f"{effort.capitalize()}: 1 J."
    assert first.all("abbr")[0].attributes["title"] == f"{METRICS['energy'].meaning} [J]"
    assert (
        "Nothing to rank"
        in section(
            "answer", table=table.table({label: FRAME.of(label) for label in ("a", "lost")})
        ).text
    )


def test_equal_numbers_and_measured_times_are_no_ranking():
    a, b = ({"iae": 1.0, "law_ns": 1.0}, {"iae": 1.0 + 1e-9, "law_ns": 2.0})
    assert table.leaders(table.table({"a": {**a, "ise": 2.0}, "b": b})) == {"a": [], "b": []}
    frame = table.table({"a": {**a, "rmse": 2.0}, "b": {**b, "rmse": 1.0}})
    assert table.leaders(frame) == {"a": [], "b": ["rmse"]}


def test_the_report_has_every_verdict_escaped():
    claims = section("claims").all("li")
    assert [mark.text for claim in claims for mark in claim.all("b", kind="mark")] == [
        "reproduced",
        "not reproduced",
        "cannot tell",
        "not reproduced",
    ]
    assert "C3 a | <b> (here)" in claims[2].text
    assert "Not <stated>." in claims[2].text
    (folded,) = claims[2].all("details")
    for text in ("lost.iae < a.iae", "tolerance 0.05", "lost.iae: lost has no log: killed"):
        assert text in folded.text
    assert "expect" not in claims[2].attributes
    assert "open" not in folded.attributes
    assert not [e for e in tree(page()).inside() if e.tag == "stated"]
    assert "Claims" not in page(verdicts=[])


def test_the_report_has_what_was_noticed_escaped():
    noticed = section("noticed").all("li")
    assert noticed[0].all("code")[0].text == "crosswise"
    assert noticed[1].text == "<a>: controller |x| < 1"
    alone = [Finding("crosswise", "controller", "|x| < 1")]
    assert section("noticed", noticed=alone).all("li")[1].text == "controller |x| < 1"
    answer = section("answer", noticed=[Finding("of one's own", "path", "text")])
    assert "of one's own all runs" in answer.text
    assert "Noticed" not in page(noticed=[])


def test_figures_are_numbered_and_captioned_in_words():
    others = [Picture(name, f"{name}, of course", b"<svg/>") for name in ("b", "c")]
    told = tree(page(figures=[ERRORS, *others]))
    assert [part.text for part in told.all("figcaption")] == [
        "Figure 1. x_e & y_e, over <time>. (the paper's figure 4)",
        "Figure 2. B, of course.",
        "Figure 3. C, of course.",
    ]
    (beside,) = told.all("div", kind="beside")
    assert len(beside.all("img")) == 2
    linked = [link.attributes["href"] for link in told.all("section", id="figures")[0].all("a")]
    assert linked == ["#figure-1", "#figure-2", "#figure-3"]
    assert 'id="figures"' not in page(figures=[])


def test_every_link_leads_somewhere():
    told = tree(page(theories={"a": theory(2.5, True)}, chase=MOVING))
    ids = [e.attributes["id"] for e in told.inside() if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    links = [link.attributes["href"] for link in told.all("a")]
    assert len(links) > 9
    assert {link.removeprefix("#") for link in links} <= set(ids)


def test_the_report_has_scenario_and_provenance():
    told = tree(page())
    assert "What the <test> is for." in [part.text for part in told.all("p")]
    assert ["git.commit", "abc"] in told.rows()
    rows = section("scenario").rows()
    assert ["simulation.duration", "4", "s", "310", "simulated time, a whole number of steps"] in (
        rows
    )
    assert "actuator.surge_limit" not in [row[0] for row in rows]
    assert "surge_limit 8" in section("scenario").all("details")[0].text


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("vessel.m=30", {("vessel.m", "30", "23.8")}),
        ("disturbance.b_u.mean=0.75", {("disturbance.b_u.mean", "0.75", "0.5")}),
        (
            "nominal.m=20",
            {("nominal.m", "20", "23.8"), ("nominal.preset", "paper_nonlinear", "paper_nonlinear")},
        ),
        ("controller.K_Pu=7", set()),
    ],
)
def test_what_a_scenario_sets_is_held_against_preset_and_default(override, told):
    plain, other = (
        {(one.key, one.value, one.default) for one in some.settings}
        for some in (about(), about(override))
    )
    assert other - plain == told
    assert not plain - other


def test_legs_are_held_against_the_acceptance_that_follows_from_the_hull():
    """Legs have no points by default, so there are none that could be checked."""
    legs = "path={kind: legs, points: [[0, 0], [9, 0]]}"
    plain, other = (
        {(one.key, one.value, one.default) for one in some.settings}
        for some in (about(legs), about(legs, "path.acceptance=3"))
    )
    assert other - plain == {("path.acceptance", "3", "2")}


def test_numbers_are_shown_where_none_follows_from_the_hull():
    """Nothing follows where the yaw moment is too small to turn the hull."""
    law = VelocityVector(**dict.fromkeys(VelocityVector.rules, 1.0))
    some = scenario("actuator.yaw_limit=5e-324").model_copy(update={"controller": law})
    rows = {key.key: row[0].value for key, row in report.laws([about_of(some).law])}
    assert rows["N_m"] == "1"


def test_a_law_is_held_against_its_defaults_and_the_other_laws():
    laws = [about("controller.K_Pu=7").law, about().law]
    rows = {key.key: [one.value for one in row] for key, row in report.laws(laws)}
    assert list(rows) == ["kind", "K_Pu"]
    assert rows["K_Pu"] == ["7", "1100"]
    pods = "actuator={kind: pod, preset: cybership2_pod}"
    kept = {one.key for one in about(pods).settings}
    assert {key for key in kept if key.startswith("actuator")} == {
        "actuator.kind",
        "actuator.preset",
    }
