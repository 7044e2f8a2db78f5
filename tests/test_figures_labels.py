"""Labels of runs in figures: folder names may hold anything, and are shown as they are."""

import pytest
from matplotlib.cbook import is_math_text
from rerun_samples import made
from scenario_samples import SOUND

from podusv_cli.core import escaping
from podusv_cli.figures.animation import stage
from podusv_cli.figures.drawing import FIGURES, dressed
from podusv_cli.figures.style import house_style, image, new_figure
from podusv_cli.workflows.members import from_folder

# An odd and an even number of $, what they would enclose, and what a legend would leave out.
ODD = ["_a$x^{2$b \\frac{ 3$", "$\\undefined$\udcff\x1b[31m\n"]
SCENARIO = SOUND.replace("kind: ideal", "kind: pod, preset: otter").replace("pid", "dsc").replace(
    "{kind: none}", "[{kind: wind, speed: 1.0}, {kind: current, speed: 0.1}]"
)  # fmt: skip
SCENARIO += "measurement: {kind: sensors}\n"
QUICK = ("errors", "trajectory", "pods")
BRIEF = "name: x\nsimulation: {step: 0.01, duration: 0.1, compiled: false}\n"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs of which every figure can be drawn, along paths of their own."""
    place = tmp_path_factory.mktemp("runs")
    folders = [made(place / x, f"path.x={x}", text=SCENARIO + BRIEF) for x in ("1", "2")]
    (one,), (other,) = map(from_folder, folders)
    parts = zip(ODD, (one, other), strict=True)
    return dressed([(label, part.run.recording, part.scenario) for label, part in parts])


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in FIGURES]
)
def test_every_figure_shows_labels_as_they_are(runs, name):
    assert FIGURES[name].fits(runs)
    with house_style():
        figure = FIGURES[name].family(runs, 2)
        assert b"<svg" in image(figure, "svg")
    (legend,) = figure.legends or [None]
    named = [text.get_text() for text in legend.get_texts()] if legend else []
    ours = [text for text in named if text in (run.name for run in runs)]
    assert ours == [run.name for run in runs] or not ours
    assert not any(map(is_math_text, ours))


def test_an_animation_shows_labels_as_they_are(runs):
    with house_style():
        figure = new_figure(1, 3.0)
        stage(figure.add_subplot(), runs)(0.05)
        figure.legend()
        assert image(figure, "png")


@pytest.mark.parametrize("text", [*ODD, "", "_", "$", "a\\$b", "50$ or 60$", "ψ _ x"], ids=ascii)
def test_the_text_of_a_figure_reads_as_it_was(text):
    found = escaping.figure(text)
    assert not is_math_text(found)
    assert not found.startswith("_")
    assert found.replace(r"\$", "$").removeprefix(" ") == escaping.visible(text)


def test_a_run_whose_name_looks_hidden_is_in_the_legend(runs):
    with house_style():
        figure = FIGURES["errors"].family(runs, 2)
    assert [text.get_text() for text in figure.legends[0].get_texts()][:2] == [
        f" {escaping.visible(ODD[0])}".replace("$", r"\$"),
        escaping.visible(ODD[1]).replace("$", r"\$"),
    ]
