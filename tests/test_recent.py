"""What methods gave last is used again for the very same objects only."""

from __future__ import annotations

from podusv_cli.components.paths.line import Line
from podusv_cli.components.paths.sinusoid import Sinusoid
from podusv_cli.engine.loop.recent import Recent


def test_the_very_same_object_is_not_asked_again() -> None:
    """One that is equal is, since zeros of both signs are equal."""
    recall, line = Recent(), Line(course=0.5)
    first = recall(line.constants)
    assert recall(line.constants) is first
    assert recall(Line(course=0.5).constants) is not first
    assert recall(Line(course=0.25).constants)["course"] == 0.25


def test_other_arguments_and_other_kinds_are_apart() -> None:
    """Kinds do not drive each other out."""
    recall, line, sine = Recent(), Line(course=0.5), Sinusoid(course=0.75)
    first = recall(line.constants)
    assert recall(sine.constants)["course"] == 0.75
    assert recall(line.constants) is first
    early, late = recall(line.targets, (0.0,)), recall(line.targets, (8.0,))
    assert early[0, 0] != late[0, 0]
