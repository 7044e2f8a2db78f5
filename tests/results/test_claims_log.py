"""results/claims_log.csv holds every text of every claim, and a reason for each change."""

import importlib.util
import sys
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import pytest
from rotation import one_in

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def history() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "claims_history", ROOT / "examples/reproduce/claims_history.py"
    )
    assert spec
    assert spec.loader
    script = importlib.util.module_from_spec(spec)
    sys.modules["claims_history"] = script
    spec.loader.exec_module(script)
    return script


def of_scenarios(history):
    files = sorted((ROOT / "configs").rglob("*.yaml"))
    texts = [history.stated(str(f.relative_to(ROOT / "configs")), f.read_text()) for f in files]
    return {text.key: text.decides for of_file in texts for text in of_file.values()}


def refusals(history, texts, stated):
    """What is wrong with a log beside the claims that scenarios state."""
    last = {text.key: text for text in texts}
    for key, text in last.items():
        if text.expect and key not in stated:
            yield f"{key}: the log does not say that it was taken out"
    for key, decides in stated.items():
        if key not in last or last[key].decides != decides:
            yield f"{key}: the log does not have this text, {decides}; run claims_history.py"
    for of_claim in history.of_several(texts):
        for _, after in pairwise(of_claim):
            if not after.reason:
                yield f"{after.key}: no reason for the text of {after.date}"


def test_a_claim_of_a_scenario_stands_in_the_log_and_every_change_has_its_reason(history):
    assert not list(refusals(history, history.written(), of_scenarios(history)))


@pytest.mark.parametrize(
    "change", one_in(3, [{"expect": "1 < 2"}, {"given": "1 < 2"}, {"tolerance": "0.5"}])
)
def test_a_changed_text_is_refused_until_the_log_has_it_with_a_reason(history, change):
    texts = history.written()
    stated = of_scenarios(history)
    changed = next(text for text in texts if text.claim == "F7")._replace(**change)
    stated[changed.key] = changed.decides
    assert [changed.claim in line for line in refusals(history, texts, stated)] == [True]
    unreasoned = (*texts, changed._replace(reason=""))
    assert [
        line.endswith(f"text of {changed.date}") for line in refusals(history, unreasoned, stated)
    ] == [True]
    assert not list(refusals(history, (*texts, changed._replace(reason="wider")), stated))


def test_the_page_is_of_the_log(history):
    assert (ROOT / "results/claims_log.md").read_text() == history.page(history.written())


def test_names_that_changed_change_no_claim_and_an_overridden_remark_is_none(history):
    old = "claims: [{id: C3, says: s, expect: proposed.iae <\n  li.iae}]"
    new = (
        "claims: {C3: {expect: adaptive_neural.iae < full_backstepping.iae}, C4: {remark: r}, C5: }"
    )
    was, now = history.stated("a.yaml", old), history.stated("a.yaml", new)
    assert set(now) == {"C3"}
    assert was["C3"].decides == now["C3"].decides


def test_claims_of_studies_count(history):
    text = "sweep: {claims: {S1: {expect: share(a.iae < b.iae) >= 0.5, tolerance: 0.01}}}"
    assert history.stated("s.yaml", text)["S1"].tolerance == "0.01"
