"""A study's folder: the same bytes however the runs were made, and nothing that is made is lost."""

import errno
import json
import os
import shutil
from datetime import UTC, datetime

import numpy as np
import pytest
from small_study import TEXT, made, small, written

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.engine.running import lanes
from podusv_cli.engine.running.simulate import simulate
from podusv_cli.studies.counting import runs_file
from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making import dispatch as marching
from podusv_cli.studies.making import runs_writer
from podusv_cli.studies.making import unit as units
from podusv_cli.studies.making.draws import draw_scenario, draws
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.sessions import SessionLog, sessions
from podusv_cli.studies.making.store import RUNS, UNITS, Store
from podusv_cli.studies.telling.results import judge_study
from podusv_cli.workflows import studies, sweep


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made(tmp_path_factory.mktemp("study") / "whole")


def content(store):
    return (store.folder / RUNS).read_bytes()


def test_a_run_of_the_table_is_the_run_that_simulate_makes(whole):
    runs, plan = whole.runs(), small()
    for law, number in (("pid", 0), ("li", 39)):
        (draw,) = draws(plan.sweep, number, 1)
        single = draw_scenario(plan.single(law, 0), plan.sweep.vary, draw)
        probe = single.probe()
        log = simulate(single.closed_loop(), single.time_grid(), probe=probe)
        alone = probe.summary(log.seen)
        for name in runs.metrics:
            assert np.array_equal(runs.metric(law, name)[0, number], alone[name], equal_nan=True)
    for name, values in runs.drawn_quantities.items():
        assert values[39] == draw[name]


def test_workers_change_no_byte(whole, tmp_path):
    assert content(made(tmp_path / "two", workers=2)) == content(whole)


@pytest.mark.slow
def test_raising_the_draws_keeps_what_is_there(whole, tmp_path):
    few = made(tmp_path / "grown", draws=13)
    before = few.runs().metric("li", "iae")
    grown = made(tmp_path / "grown")
    assert np.array_equal(grown.runs().metric("li", "iae")[:, :13], before)
    assert content(grown) == content(whole)
    with pytest.raises(UsageError, match="has 40 draws; ask for as many or more"):
        made(tmp_path / "grown", draws=39)


@pytest.mark.slow
def test_shards_and_lost_units_come_to_the_same(whole, tmp_path):
    for number in (2, 3, 1):
        store = made(tmp_path / "shards", part=(number, 3))
    lost, damaged, *_ = sorted((store.folder / UNITS).iterdir())
    lost.unlink()
    damaged.write_bytes(damaged.read_bytes()[:-9])
    assert content(made(tmp_path / "shards")) == content(whole)


def damaged(whole, folder):
    """A copy of the study in which the end of runs.h5 is lost."""
    shutil.copytree(whole.folder, folder)
    (folder / RUNS).write_bytes(content(whole)[:-2000])
    (folder / "scenario.yaml").write_text(TEXT)
    return folder


def test_a_damaged_table_is_refused_and_never_overwritten(whole, tmp_path):
    folder = damaged(whole, tmp_path / "study")
    before = (folder / RUNS).read_bytes()
    request = sweep.Request(figures=False)
    for command in (
        lambda: sweep.run(folder, request, lambda tally: None),
        lambda: sweep.report(folder, request),
        lambda: studies.status(folder),
        lambda: studies.export(folder, "csv", None),
    ):
        with pytest.raises(StorageError, match=r"runs.h5: damaged, .*; restore the file, or move"):
            command()
    assert (folder / RUNS).read_bytes() == before
    (folder / RUNS).unlink()
    assert content(made(folder)) == content(whole)


def test_export_notices_an_altered_number(whole, tmp_path):
    folder = damaged(whole, tmp_path / "study")
    altered = bytearray(content(whole))
    altered[altered.index(np.float64(whole.runs().metric("li", "iae")[0, 3]).tobytes())] ^= 1
    (folder / RUNS).write_bytes(altered)
    with pytest.raises(StorageError, match="altered"):
        studies.export(folder, "csv", None)
    (folder / RUNS).unlink()
    with pytest.raises(UsageError, match=r"has no runs.h5 yet: podusv sweep report"):
        studies.export(folder, "csv", None)


def test_a_table_of_another_study_is_not_overwritten(whole, tmp_path):
    folder = damaged(whole, tmp_path / "study")
    other = content(made(tmp_path / "other", seed=8, draws=1))
    (folder / RUNS).write_bytes(other)
    with pytest.raises(StorageError, match="its runs are of another study; restore the file"):
        made(folder)
    assert (folder / RUNS).read_bytes() == other


def finishing(monkeypatch, act):
    """Have `act` happen right after runs.h5 is written, as by another podusv."""
    real = runs_writer.write
    monkeypatch.setattr(runs_writer, "write", lambda *given: (real(*given), act())[0])


@pytest.mark.long
def test_a_unit_that_comes_while_the_table_is_written_is_kept(whole, tmp_path, monkeypatch):
    store = made(tmp_path / "study", part=(1, 2))
    late = Unit("pid", 0, 20, 4)
    finishing(monkeypatch, lambda: store.write(units.make(small(), late)))
    store.write_runs()
    assert store.covered_draws()["pid", 0].sum() == 24
    monkeypatch.undo()
    assert content(made(store.folder)) == content(whole)
    assert not list((store.folder / UNITS).iterdir())


def replace_folder(store, folder):
    return Store(folder, store.about)


def test_another_study_is_refused_with_what_is_different(whole):
    other = Store(whole.folder, about(small(seed=8)))
    with pytest.raises(UsageError, match=r"another study: sweep.seed: 7, not 8; name another"):
        other.open("now")


def test_words_and_claims_do_not_make_another_study(whole):
    same = small(level=0.9, success="finished and iae <= 3")
    assert same.identity == small().identity
    assert small(seed=8).identity != small().identity


@pytest.mark.slow
def test_a_run_that_kills_its_process_is_found(tmp_path, monkeypatch):
    real = units.drawing

    def deadly(scenario, vary):
        alive = real(scenario, vary)

        def drawn(draw):
            if abs(draw["start.psi"] - draws_of(5)) < 1e-15 and "pid" in scenario.controller.kind:
                os._exit(3)
            return alive(draw)

        return drawn

    def draws_of(number):
        return next(draws(small().sweep, number, 1))["start.psi"]

    monkeypatch.setattr(units, "drawing", deadly)
    runs = made(tmp_path / "deadly", draws=16).runs()
    words = np.array(units.STATUSES)[runs.status("pid")[0]]
    assert [i for i, word in enumerate(words) if word != "finished"] == [5]
    assert words[5] == "crashed"
    assert runs.causes[0, 0, 5] == marching.ENDED
    assert runs.finished("li").all()


def test_time_over_keeps_what_is_made(tmp_path, monkeypatch):
    store = Store(tmp_path / "late", about(small()))
    store.open("now")
    clock = iter(range(10**6))
    monkeypatch.setattr(marching.time, "monotonic", lambda: float(next(clock)))
    executor = marching.Processes(1)
    tally, whole = marching.dispatch(store, small(), lambda tally: None, executor, seconds=2.0)
    assert not whole
    assert 0 < tally.made < tally.wanted
    assert sum(int(mask.sum()) for mask in store.covered_draws().values()) == tally.made


@pytest.mark.long
def test_a_full_disk_while_the_table_is_filled_keeps_the_units(whole, tmp_path, monkeypatch):
    store, real, wrote = made(tmp_path / "study", part=(1, 9)), runs_writer.write_at, []
    units_there = sorted((store.folder / UNITS).iterdir())
    assert units_there

    def limited(out, place, content):
        wrote.append(place)
        if len(wrote) == 30:
            raise OSError(errno.ENOSPC, "full")
        real(out, place, content)

    monkeypatch.setattr(runs_writer, "write_at", limited)
    with pytest.raises(StorageError, match=r"cannot write .*runs.h5: the disk is full"):
        store.write_runs()
    assert sorted((store.folder / UNITS).iterdir()) == units_there
    assert not list(store.folder.glob("*runs.h5*"))
    monkeypatch.undo()
    assert content(made(store.folder)) == content(whole)


@pytest.mark.slow
def test_times_of_all_sittings_are_added_up(tmp_path):
    config = written(tmp_path / "small.yaml")
    for wanted in (8, 24):
        request = sweep.Request(
            (f"sweep.draws={wanted}",), tmp_path / "s", workers=1, figures=False
        )
        sweep.run(config, request, lambda tally: None)
    told = json.loads((tmp_path / "s/timing.json").read_text())
    assert [sitting["runs"] for sitting in told["sittings"]] == [16, 32]
    for law in ("pid", "li"):
        found = told["laws"][law]
        assert found["runs"] == 24
        assert found["ms_a_run"] == pytest.approx(1e3 * found["processor_s"] / 24)
        assert found["processor_s"] > 0.0


def test_a_sitting_keeps_those_that_others_noted_meanwhile(tmp_path):
    now = datetime.now(UTC)
    driver = SessionLog(tmp_path, ["run"], now, ())
    for _ in range(3):
        SessionLog(tmp_path, ["report"], now, ()).end(0)
    driver.end(7)
    assert [session["runs"] for session in sessions(tmp_path)] == [7, 0, 0, 0]


def test_draws_beyond_those_asked_for_are_refused(whole, tmp_path):
    shutil.copytree(whole.folder, tmp_path / "study")
    fewer = Store(tmp_path / "study", about(small(draws=8)))
    with pytest.raises(StorageError, match="there are runs of 40 draws"):
        fewer.write_runs()
    assert (fewer.folder / RUNS).read_bytes() == (whole.folder / RUNS).read_bytes()


def test_success_is_evaluated_once_for_each_law(whole, monkeypatch):
    runs, real, times = whole.runs(), runs_file.judge_success, []
    monkeypatch.setattr(
        runs_file, "judge_success", lambda *given: (times.append(1), real(*given))[1]
    )
    judge_study(whole.about, runs)
    assert len(times) == 2


def test_a_study_whose_runs_march_one_by_one_says_why(tmp_path, monkeypatch):
    config, told = written(tmp_path / "small.yaml", ("draws: 40", "draws: 2")), []
    monkeypatch.setattr(lanes, "WORTH", 0)
    monkeypatch.setattr(lanes, "marcher", refuse)
    request = sweep.Request(out=tmp_path / "study", figures=False, warn=told.append)
    assert sweep.run(config, request, lambda tally: None).results
    assert [text for text in told if "one by one" in text] == [
        "pid: runs march one by one: no such pass",
        "li: runs march one by one: no such pass",
    ]


def refuse(*given):
    raise TypeError("no such pass")
