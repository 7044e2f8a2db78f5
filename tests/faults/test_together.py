"""Several commands at once in one place: each result whole, or a clear refusal."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, tzinfo
from functools import partial
from pathlib import Path

import pytest
from children import FORK, begun
from command_samples import Command, Said, one_line
from counts import count
from old_results import bring_back, left_over
from storage_samples import files

from podusv_cli.storage import manifest, run_folder

RUN = ("run", "a.yaml", "--no-figures")
COMPARE = ("compare", "two.yaml", "--no-figures")
TIMES = range(count(1, 40))


@pytest.fixture
def podusv(beside_old_results):
    return beside_old_results


def at_once(podusv: Command, *commands: Sequence[str]) -> list[Said]:
    """What commands say that begin at the same moment, each in a process of its own."""
    start = FORK.Barrier(len(commands))

    def work(words: Sequence[str]) -> Said:
        start.wait(30)
        return podusv(*words)

    children = [begun(partial(work, words)) for words in commands]
    return [child.result() for child in children]


def is_whole(run: Path) -> bool:
    """StorageError where a file is not as it was written."""
    return not manifest.foreign(run, manifest.check(run))


@pytest.mark.slow
@pytest.mark.parametrize("words", [COMPARE, (*RUN, "--force")], ids=" ".join)
def test_without_a_name_each_gets_a_folder_of_its_own(podusv, monkeypatch, words):
    """Also in the same second."""
    monkeypatch.setattr(run_folder, "datetime", Clock)
    said = at_once(podusv, *[(*words, "-q")] * 3)
    assert [each.code for each in said] == [0] * 3
    assert {Path(each.out.strip()) for each in said} == set(Path("results").glob("*/*"))
    assert len({each.out for each in said}) == 3
    assert all(is_whole(Path(each.out.strip())) for each in said)
    assert not left_over()


class Clock(datetime):
    """Time stands still."""

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Clock:
        return cls(2026, 1, 1, 12, tzinfo=tz)


@pytest.mark.slow
@pytest.mark.parametrize("words", [RUN, ("rerun", "both")], ids=" ".join)
def test_of_those_that_want_one_name_one_gets_it(podusv, words):
    said = at_once(podusv, *[(*words, "--out", "new")] * 3)
    assert sorted(str(each.code) for each in said) == ["0", "5", "5"]
    refused = [one_line(each.err) for each in said if each.code == 5]
    elsewhere = {line.rpartition(" is in ")[2].split()[0] for line in refused if " is in " in line}
    assert elsewhere == {path.name for path in Path().glob("new-*")}
    assert all("new exists already" in line or "new is there already" in line for line in refused)
    assert all(is_whole(run) for run in Path().glob("new*"))
    assert not left_over()


@pytest.mark.slow
@pytest.mark.parametrize("place", ["x", "new"])
def test_of_those_that_replace_the_last_one_stays(podusv, place):
    gains = ("30.0", "40.0", "50.0")
    commands = [
        (*RUN, "--out", place, "--force", "--set", f"controller.K_Pu={gain}") for gain in gains
    ]
    for _ in TIMES:
        assert [each.code for each in at_once(podusv, *commands)] == [0] * 3
        assert is_whole(Path(place))
        found = Path(place, "resolved.yaml").read_text()
        assert sum(f"K_Pu: {gain}" in found for gain in gains) == 1
        assert not left_over()


@pytest.mark.long
def test_figures_that_are_drawn_at_once_are_whole(podusv, before):
    said = podusv("plot", "x", "--out", "figures")
    new = files(Path())
    for _ in TIMES:
        bring_back(before)
        done = at_once(podusv, *[("plot", "x", "--out", "figures")] * 3)
        assert [each.code for each in done] == [0] * 3
        assert {each.out for each in done} == {said.out}
        assert files(Path()) == new
        assert not left_over()


@pytest.mark.long
def test_a_run_that_is_replaced_while_it_is_drawn_is_drawn_or_refused(podusv):
    """What is read across the change is seen to be damaged.

    That it is there at every moment is in tests/storage/test_storage_staging.py, step by step.
    """
    for _ in TIMES:
        drawn, made, compared = at_once(
            podusv,
            ("plot", "x", "--out", "figures"),
            (*RUN, "--out", "x", "--force"),
            ("compare", "x", "both", "--out", "new", "--force", "--no-figures"),
        )
        assert made.code == 0
        for each in (drawn, compared):
            assert each.code == 0 or (
                each.code == 5 and one_line(each.err).startswith(("x", "cannot"))
            )
        assert not left_over()
