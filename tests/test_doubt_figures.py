"""Figures of what verdicts hang on, from draws and turns that are planted."""

import math
from types import SimpleNamespace

import numpy as np

from podusv_cli.doubt import figures
from podusv_cli.doubt.alone import TriedChoice
from podusv_cli.doubt.answer import Tried
from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.compared import compared
from podusv_cli.doubt.judged import Judged
from podusv_cli.doubt.ranges import Range
from podusv_cli.doubt.together import Draws
from podusv_cli.scenario.distributions import Distribution
from podusv_cli.scenario.sweep import Quantity


def choice(name, own, unit):
    quantity = Quantity(times=Distribution(log_uniform=(1.0 / 3.0, 3.0)))
    return Choice(name, (), own, unit, Range(quantity, quantity, abs(own)))


def judged(answer, number):
    return Judged({"C": answer}, {"C": {"a.iae": number}})


def drawn(base, *worlds):
    """The curve's panel of a claim that is judged so in draws, by the labels in its legend."""
    gain = choice("controllers.a.k", 1.0, "")
    shares = np.linspace(0.1, 0.9, len(worlds))[:, None]
    worlds = [judged(*world) for world in worlds]
    tried = Tried(judged(base, 3.9), [], Draws([gain], shares, shares.tolist()), worlds)
    answer = SimpleNamespace(
        verdict=SimpleNamespace(name="C", answer=base), number=compared("a.iae < 4.9", 0.05)[0],
        numbers={"a.iae": 3.9}, explained=(),
    )  # fmt: skip
    alone = [TriedChoice(gain, ())]
    figure = figures.specification(SimpleNamespace(tried=tried), answer, alone)
    return {line.get_label(): line for line in figure.axes[0].lines}, figure


def test_draws_that_cannot_tell_are_neither_kept_nor_turned():
    found, figure = drawn(
        True, (True, 4.0), (None, 4.7), (False, 6.0), (True, 3.0), (None, 5.0), (None, math.nan)
    )
    heights = {name: found[name].get_ydata().tolist() for name in ("kept", "turned", "cannot tell")}
    assert heights == {"kept": [3.0, 4.0], "turned": [6.0], "cannot tell": [4.7, 5.0]}
    looks = {(found[name].get_marker(), found[name].get_color()) for name in heights}
    assert len(looks) == 3
    assert found["cannot tell"].get_marker() != found["kept"].get_marker()
    (key,) = figure.legends
    names = [text.get_text() for text in key.get_texts()]
    assert names == ["kept", "turned", "cannot tell", "the scenario's own", "limit"]
    below = [line.get_xdata().tolist() for line in figure.axes[1].lines]
    assert below == [[0, 1], [4], [2, 3]]


def test_of_a_verdict_that_cannot_tell_no_draw_is_kept():
    found, _ = drawn(None, (True, 3.0), (None, 4.7), (False, 6.0))
    assert {"can tell", "cannot tell"} < {*found}
    assert not {"kept", "turned"} & {*found}
    assert found["can tell"].get_ydata().tolist() == [3.0, 6.0]
