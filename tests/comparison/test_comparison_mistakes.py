"""What a claim cannot say, and the sentence that tells it."""

import pytest
from known_signals import ABOUT
from test_comparison_words import RUNS

from podusv_cli.comparison.expressions import parse
from podusv_cli.core.signal import Signal
from podusv_cli.expressions.reading import ExpressionError


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a.iae", "not a condition"),
        ("a.z_e < 3", "a signal over time; reduce it to a number with one of"),
        ("a.ia < 3", "unknown signal or metric 'ia'; did you mean 'iae'?"),
        ("d.iae < 3", "unknown run 'd' (allowed: a, b, c, coarse, cut, even, lost, thin)"),
        ("maximum(a.z_e) < 3", "unknown function 'maximum'"),
        ("median(a.iae / b.iae) < 1", "'median'; it belongs to sweep.claims (allowed here: abs"),
        ("a.iae / 0.0 < 3", "'a.iae / 0.0': divides by zero"),
        ("a.iae < 1_0", "'1_0' is no number; write it in decimal"),
        ("a.iae < 1e1_0", "'1e1_0' is no number; write it in decimal"),
        ("a.iae < 0x10", "'0x10' is no number"),
        ("a.iae < 1j", "not a plain number"),
        ("max(a.iae) < 3", "a number where a signal is needed"),
        ("max(a.z_e, 5) < 3", "takes a signal, or a signal and two times"),
        ("max(a.z_e, 5, 2) < 3", "the first time must lie before the second"),
        ("max(a.z_e, a.iae, 9) < 3", "must be plain numbers"),
        ("a.iae < b.iae or finished(a)", "join conditions with `and` only"),
        ("a.iae ** 2 < 3", "calculate with + - * / only"),
        ("a.iae != 3", "compare with <, <=, >, >=, =="),
        ("ended(a)", "unknown check 'ended'"),
        ("finished(a.iae)", "takes the name of one run"),
        ("__import__('os').system('true') < 1", "called by name"),
        ("a.__class__ < 1", "unknown signal or metric '__class__'"),
        ("[x for x in a] < 1", "no meaning here"),
        ("'text' < 1", "not a plain number"),
        ("a.iae <", "cannot read"),
        ("", "cannot read"),
        ("(" * 300 + ")" * 300, "is longer than 500 characters"),
        ("-" * 100 + "1 < a.iae", "is nested more than 60 deep"),
        ("1e400 < a.iae", "a number is too large"),
        ("9" * 400 + " < a.iae", "a number is too large"),
        ("max(a.W_hat_u) < 1", "'W_hat_u' has a value for every node; take W_norm_u"),
        ("max(a.rbf_center) < 1", "'rbf_center' does not run over time"),
        ("max(a.z_e, 50, 60) < max(a.nothing) ", "unknown signal or metric 'nothing'"),
        ("finished(a) and max(abs(a.z_e), 5, 9) < 1 and lost.ia < 1", "'ia'; did you mean"),
    ],
)
def test_what_means_nothing_gets_a_sentence(text, says):
    with pytest.raises(ExpressionError) as error:
        parse(text, RUNS, ABOUT)
    assert says in str(error.value)


def test_a_signal_with_several_values_at_a_time_is_refused():
    several = Signal("modes", "m", "amplitudes", axes=("mode",))
    with pytest.raises(ExpressionError, match="'modes' has a value for every mode"):
        parse("mean(a.modes) < 1", RUNS, {"modes": several})
