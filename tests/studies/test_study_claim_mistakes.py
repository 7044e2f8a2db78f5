"""Mistakes in claims about studies: each is told with what to write."""

from __future__ import annotations

import pytest

from podusv_cli.comparison.curves import REDUCERS
from podusv_cli.comparison.expressions import OPERATIONS
from podusv_cli.expressions.reading import FUNCTIONS, ExpressionError
from podusv_cli.metrics.table import METRICS
from podusv_cli.studies.counting.claims import parse
from podusv_cli.studies.counting.expressions import parse_success
from podusv_cli.studies.counting.samples import STATISTICS

LAWS = ["proposed", "pid", "li"]
MISTAKES = {
    "share(propsed.iae < pid.iae) >= 0.9": "unknown law 'propsed'; did you mean 'proposed'?",
    "median(pid.z_e_stedy) >= 0.9": "unknown metric 'z_e_stedy'; did you mean 'z_e_steady'?",
    "shares(proposed.iae < pid.iae) >= 0.9": "unknown statistic 'shares'; did you mean 'share'?",
    "median(pid.iae / 0) < 3": "'pid.iae / 0': divides by zero",
    "mean(pid.z_e) < 3": "unknown statistic 'mean'; it belongs to claims (allowed here: failures",
    "max(abs(pid.tau_u)) == 300": "unknown statistic 'max'; it belongs to claims",
    "share(finish(pid)) >= 0.9": "unknown property 'finish'; did you mean 'finished'?",
    "failures(pdi) <= 0.1": "unknown law 'pdi'; did you mean 'pid'?",
    "failures(pid.iae) <= 0.1": "failures takes the name of one law",
    "failures(pid) <= 5": "is a share between 0 and 1, and cannot be compared with 5",
    "failures(pid) < median(li.iae)": "two shares with each other: failures(a) < failures(b)",
    "median(pid.iae) < median(li.iae)": "median(a.iae / b.iae)",
    "proposed.iae < pid.iae": "compare a statistic with a number",
    "proposed.iae < 3": "no statistic of all draws; write one of share",
    "failures(pid)": "not a condition; compare one of share",
    "failures(pid) == 0.1": "compare with <, <=, >, >=",
    "failures(pid) < 0.1 or failures(li) < 0.1": "join conditions with `and` only",
    "share(pid.iae == 3) < 0.1": "compare with <, <=, >, >=",
    "share(pid.iae) < 0.1": "not a condition; compare numbers, or write finished(law)",
    "share(1 < 2) < 0.1": "names no law",
    "share(median(pid.iae) < 3) < 0.1": "no function of numbers here",
    "share(iae < 3) < 0.1": "no meaning here; write law.metric",
    "share() < 0.1": "share takes one condition",
    "median(pid.iae ** 2) < 3": "calculate with + - * / only",
    "median(pid.iae, 3) < 3": "median takes one number of each draw",
    "quantile(pid.iae) < 3": "quantile takes a number of each draw and a share",
    "quantile(pid.iae, 95) < 3": "the share must lie between 0 and 1",
    "quantile(pid.iae, q=0.9) < 3": "functions are called by name, without keywords",
    "failures(pid) < 'a'": "not a plain number",
    "failures(pid) <": "cannot read",
    "__import__('os')": "not a condition",
    "": "cannot read",
    "not " * 70 + "failures(pid) < 0.1": "nested more than",
}


def test_the_functions_of_both_languages_are_known_to_their_messages() -> None:
    assert set(FUNCTIONS["claims"]) == {*REDUCERS, *OPERATIONS, "rate"}
    assert set(FUNCTIONS["sweep.claims"]) == set(STATISTICS)


@pytest.mark.parametrize("text", MISTAKES)
def test_every_mistake_is_told_with_what_to_write(text: str) -> None:
    with pytest.raises(ExpressionError) as error:
        parse(text, LAWS, METRICS)
    assert MISTAKES[text] in str(error.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("finished and z_e_stedy <= 1.5", "did you mean 'z_e_steady'?"),
        ("finishd", "did you mean 'finished'?"),
        ("pid.iae < 3", "write metrics by their names alone"),
        ("finished(pid)", "write finished alone"),
        ("finished or iae < 3", "join conditions with `and` only"),
    ],
)
def test_every_mistake_in_success_is_told(text: str, told: str) -> None:
    with pytest.raises(ExpressionError) as error:
        parse_success(text, METRICS)
    assert told in str(error.value)


def test_an_expression_that_python_finds_odd_gives_no_warning(
    recwarn: pytest.WarningsRecorder,
) -> None:
    parse("failures(pid) < 0.5and failures(li) < 0.5", LAWS, METRICS)
    assert not recwarn.list
