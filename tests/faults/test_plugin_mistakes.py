"""A mistake in a plug-in's law is refused before the run with file and line, never as a bug."""

from pathlib import Path

import pytest
from plugin_samples import LAW, put

# What is written in place of what, and what is said.
MISTAKES = {
    "undeclared": ("(E_CT,)", '("e_ct",)', "declares 'e_ct', which is no Signal"),
    "two kinds": ('["cross_track"] =', '["other"] =', "its kind is no fixed word; write kind: "),
    "other arguments": ("law(t, x, ", "law(t, ", "10 were given"),
    "numpy": ("push(k)", "np.dot(x, x)", "cannot become machine code"),
    "no constant": (
        "return PUSH * k.gain",
        "return PUSH * k.gian",
        "no attribute 'gian' (my_law.py, line 22); it has those of the nominal vessel, and kind, "
        "gain",
    ),
    "no rate": ("        rate[0] = signals[0]\n", "", "it leaves the rate of drift unwritten"),
    "wrong shape": ("np.zeros(1)", "np.zeros(2)", "a memory of shape (2,), its slots are (1,)"),
    "too many": ("rate[0] =", "rate[1] =", "IndexError: index 1 is out of bounds"),
    "no kernel": ("@kernel\ndef push", "def push", "cannot become machine code"),
    "slots raise": ("return ((DRIFT, 1),)", "return self.nothing", "AttributeError"),
    "no slots": ("return ((DRIFT, 1),)", "return 5", "TypeError"),
    "start raises": ("return np.zeros(1)", "return 1 / 0", "ZeroDivisionError"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_it_is_refused_before_the_run(podusv, name):
    right, wrong, words = MISTAKES[name]
    assert right in LAW
    for command in ("run", "compare"):
        said = podusv(command, put(law=LAW.replace(right, wrong)), "--out", "r", "--no-figures")
        told = " ".join(said.err.split())
        assert said.code == 2, said.err
        assert words in told
        assert "my_law.py, line " in told
        assert "bug" not in told
        assert not Path("r").exists()
