"""Places where nothing can be written: told in a line, before anything is computed."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from children import give_up_rights, in_a_child
from command_samples import LONG, TWO, Command, Said, one_line, write
from counts import each_with_some
from storage_samples import deadline

from podusv_cli.figures import drawing
from podusv_cli.workflows import compare, execute

MINUTES = LONG + TWO.splitlines()[-1] + "\n"
RUN = ("run", "long.yaml", "--no-figures", "--controller", "soft")  # which says nothing more
COMPARE = ("compare", "long.yaml", "--no-figures")
RERUNS = [("rerun", "x"), ("rerun", "both")]
PLACED = [("plot", "x"), ("verify", "long.yaml")]


def a_file(place: Path) -> None:
    place.touch()


def dangling(place: Path) -> None:
    place.symlink_to("nowhere")


def circular(place: Path) -> None:
    place.symlink_to(place.name)


def pipe(place: Path) -> None:
    os.mkfifo(place)


def closed(place: Path) -> None:
    place.mkdir(0)


def read_only(place: Path) -> None:
    place.mkdir(0o555)


ODD = [circular, a_file, dangling, pipe]
FORBIDDEN = [closed, read_only]
# Commands that write, with the odd place in the way of where to.
INSIDE = [(*words, "--out", "place/new") for words in (RUN, COMPARE, *RERUNS, *PLACED)]
ITSELF = [(*words, "--out", "place") for words in (RUN, COMPARE, *RERUNS, ("plot", "x"))]


@pytest.fixture
def podusv(beside_old_results, monkeypatch):
    write("long.yaml", MINUTES)
    Path().chmod(0o755)
    monkeypatch.setattr(execute, "run", begun)
    monkeypatch.setattr(compare, "run_all", begun)  # whose processes rerun uses, too
    monkeypatch.setattr(compare, "warm_up", begun)
    monkeypatch.setattr(drawing, "draw_in_parallel", begun)
    return beside_old_results


def begun(*given: object, **more: object) -> None:
    raise AssertionError("it began")


def tree() -> dict[str, int]:
    """Everything here, and what kind of thing it is."""
    return {str(path): os.lstat(path).st_mode for path in Path().rglob("*")}


def refused(podusv: Command, words: tuple[str, ...], before: Callable[[], None]) -> str:
    """The line in which a command is refused, by a process that does something first."""

    def attempt() -> Said:
        before()
        return podusv(*words)

    here = tree()
    with deadline():
        said = in_a_child(attempt)
    assert (said.code, said.out) == (5, "")
    assert tree() == here
    return one_line(said.err)


@pytest.mark.parametrize(("words", "make"), each_with_some([*INSIDE, *ITSELF], ODD))
def test_something_that_is_no_folder(podusv, words, make):
    make(Path("place"))
    assert "place" in refused(podusv, words, lambda: None)


@pytest.mark.parametrize(("words", "make"), each_with_some([RUN, COMPARE, ("plot", "x")], ODD))
def test_something_that_is_no_folder_where_results_go_by_default(podusv, words, make):
    place = Path("figures" if words[0] == "plot" else "results")
    for path in place.glob("*"):
        path.unlink()
    if place.exists():
        place.rmdir()
    make(place)
    assert place.name in refused(podusv, words, lambda: None)


@pytest.mark.parametrize(("words", "make"), each_with_some(INSIDE, FORBIDDEN))
def test_somewhere_where_one_may_not(podusv, words, make):
    make(Path("place"))
    line = refused(podusv, words, give_up_rights)
    assert "place" in line
    assert line.endswith(": not permitted")


@pytest.mark.parametrize("words", [RUN, COMPARE], ids=" ".join)
def test_results_go_by_default_where_one_may_not(podusv, words):
    closed(Path("results"))
    assert refused(podusv, words, give_up_rights).endswith(": not permitted")
