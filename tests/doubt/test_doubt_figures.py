"""Figures of what verdicts hang on, from draws and turns that are planted."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb

from podusv_cli.doubt import figures
from podusv_cli.doubt.alone import TriedChoice, TriedValue, Turn, ends
from podusv_cli.doubt.answer import Tried
from podusv_cli.doubt.choices import Choice
from podusv_cli.doubt.compared import compared_numbers
from podusv_cli.doubt.judged import Judged
from podusv_cli.doubt.ranges import DoubtRange
from podusv_cli.doubt.together import Draws
from podusv_cli.figures.sketch import ON_PHONE
from podusv_cli.figures.style import house_style
from podusv_cli.scenario.distributions import Distribution
from podusv_cli.scenario.sweep import Quantity


def choice(name, own, unit):
    quantity = Quantity(times=Distribution(log_uniform=(1.0 / 3.0, 3.0)))
    return Choice(name, (), own, unit, DoubtRange(quantity, quantity, abs(own)))


def judged(answer, number):
    return Judged({"C": answer}, {"C": {"a.iae": number}})


def drawn(base, *worlds):
    """The curve's panel of a claim that is judged so in draws, by the labels in its legend."""
    gain = choice("controllers.a.k", 1.0, "")
    shares = np.linspace(0.1, 0.9, len(worlds))[:, None]
    worlds = [judged(*world) for world in worlds]
    tried = Tried(judged(base, 3.9), [], Draws([gain], shares, shares.tolist()), worlds)
    answer = SimpleNamespace(
        verdict=SimpleNamespace(name="C", answer=base),
        number=compared_numbers("a.iae < 4.9", 0.05)[0],
        numbers={"a.iae": 3.9},
        explained=(),
    )
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


BASE = judged(True, 3.9)


def tried(of, answers):
    """A choice with the answer on the claim at each value."""
    return TriedChoice(of, tuple(TriedValue(v, judged(word, 3.9)) for v, word in answers.items()))


def test_a_window_is_orange_as_far_as_it_was_seen_to_reach():
    omega = choice("controllers.los_pid.omega_psi", 0.5, "rad/s")
    low, high = sorted(ends(omega))
    answers = {low: False, 0.4: None, 0.6: False, 0.62: False, 0.7: True, 1.0: False, high: True}
    row = tried(omega, answers)
    up = list(figures.turned_spans(row, high, "C", BASE))
    assert up == [pytest.approx((0.1, 0.12)), pytest.approx((0.5, 0.5))]
    assert list(figures.turned_spans(row, low, "C", BASE)) == [(-1.0, -1.0)]
    answer = SimpleNamespace(
        verdict=SimpleNamespace(name="C"), neighbours=(), turns=(Turn(omega, 1.0, 0.7, 0.5),)
    )
    report = SimpleNamespace(tried=SimpleNamespace(base=BASE))
    drawing = FigureCanvasAgg(figures.ranges(report, answer, [row]))
    drawing.draw()
    (axes,) = drawing.figure.axes
    x, y = axes.transData.transform((0.5, 0.0)).round().astype(int)
    pixel = np.asarray(drawing.buffer_rgba())[::-1][y, x, :3] / 255.0
    assert pixel == pytest.approx(to_rgb(figures.TURNED), abs=0.1)  # though it is one value alone


@pytest.mark.parametrize("width", [None, ON_PHONE])
def test_where_a_verdict_turns_can_be_read_at_any_width(width):
    """Inside the panel, and over no other text, bar or line."""
    omega = choice("controllers.los_pid.omega_psi", 0.5, "rad/s")
    inertia, psi = choice("vessel.N_rdot", -1234.0, "kg m2/rad"), choice("start.psi", 3.14, "rad")
    answer = SimpleNamespace(
        verdict=SimpleNamespace(name="C"),
        turns=(
            Turn(omega, 0.357, 0.36, 0.143),
            Turn(omega, 0.881, 0.88, 0.381),
            Turn(inertia, -1930.0, -1900.0, 696.0),
            Turn(inertia, -812.0, -815.0, 422.0),
        ),
        neighbours=(Turn(psi, 3.14 + 7e-6, 3.14, 7e-6),),
    )
    turned = [(t.choice, t.value) for t in (*answer.turns, *answer.neighbours)]
    rows = [
        tried(c, dict.fromkeys([*ends(c), *(v for of, v in turned if of is c)], False))
        for c in (omega, inertia, psi)
    ]
    with house_style():
        figure = figures.ranges(SimpleNamespace(tried=SimpleNamespace(base=BASE)), answer, rows)
        if width:
            assert figure.narrow(width)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        (axes,) = figure.axes
        boxes = [text.get_window_extent(canvas.get_renderer()) for text in axes.texts]
        lines = [bar.get_window_extent(canvas.get_renderer()) for bar in axes.lines]
    assert [text.get_text() for text in axes.texts] == [
        "down from 0.357",
        "from 0.881",
        "from -812",
        "down from -1.93e+03",
        "+7e-06",
    ]
    names = [label.get_text() for label in axes.get_yticklabels()]
    assert names[0] == "controllers.los_pid.omega_psi\n0.5 rad/s"
    for place, box in enumerate(boxes):
        assert axes.bbox.x0 <= box.x0 < box.x1 <= axes.bbox.x1
        assert axes.bbox.y0 <= box.y0 < box.y1 <= axes.bbox.y1
        assert not any(box.overlaps(other) for other in (*boxes[:place], *lines))
