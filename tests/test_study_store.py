"""A study's folder: the same bytes however the runs were made, and nothing that is made is lost."""

import os
import shutil

import numpy as np
import pytest
from small_study import made, small

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.engine.simulate import simulate
from podusv_cli.study import march as marching
from podusv_cli.study import unit as units
from podusv_cli.study.draws import drawn, draws
from podusv_cli.study.plan import watching
from podusv_cli.study.store import RUNS, UNITS, Store


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made(tmp_path_factory.mktemp("study") / "whole")


def content(store):
    return (store.folder / RUNS).read_bytes()


def test_a_run_of_the_table_is_the_run_that_simulate_makes(whole):
    runs, plan = whole.runs(), whole.plan
    for law, number in (("pid", 0), ("li", 39)):
        (draw,) = draws(plan.sweep, number, 1)
        one = drawn(plan.single(law, 0), plan.sweep.vary, draw)
        seeing = watching(one)
        log = simulate(one.closed_loop(), one.time_grid(), observer=seeing)
        alone = seeing.summary(log.seen)
        for name in runs.metrics:
            assert np.array_equal(runs.metric(law, name)[0, number], alone[name], equal_nan=True)
    for name, values in runs.drawn.items():
        assert values[39] == draw[name]


def test_workers_change_no_byte(whole, tmp_path):
    assert content(made(tmp_path / "two", workers=2)) == content(whole)


def test_raising_the_draws_keeps_what_is_there(whole, tmp_path):
    few = made(tmp_path / "grown", draws=13)
    before = few.runs().metric("li", "iae")
    grown = made(tmp_path / "grown")
    assert np.array_equal(grown.runs().metric("li", "iae")[:, :13], before)
    assert content(grown) == content(whole)
    with pytest.raises(UsageError, match="has 40 draws; ask for as many or more"):
        made(tmp_path / "grown", draws=39)


def test_shards_and_lost_units_come_to_the_same(whole, tmp_path):
    for number in (2, 3, 1):
        store = made(tmp_path / "shards", part=(number, 3))
    lost, damaged, *_ = sorted((store.folder / UNITS).iterdir())
    lost.unlink()
    damaged.write_bytes(damaged.read_bytes()[:-9])
    assert content(made(tmp_path / "shards")) == content(whole)


def test_a_flipped_bit_is_noticed_everywhere(whole, tmp_path):
    store = made(tmp_path / "units", part=(1, 9))
    path = next((store.folder / UNITS).iterdir())
    good = path.read_bytes()
    assert len(list(store.results())) > 0
    for place in range(len(good) - 1, len(good) - 2000, -97):
        path.write_bytes(good[:place] + bytes([good[place] ^ 4]) + good[place + 1 :])
        for result in store.results():
            assert result.unit.law in ("pid", "li")  # another file, or one that means the same
    shutil.copytree(whole.folder, tmp_path / "copy")
    runs = tmp_path / "copy" / RUNS
    altered = bytearray(runs.read_bytes())
    altered[altered.index(np.float64(whole.runs().metric("li", "iae")[0, 3]).tobytes())] ^= 1
    runs.write_bytes(altered)
    with pytest.raises(StorageError, match="its numbers were altered"):
        replace_folder(whole, tmp_path / "copy").runs().check()


def replace_folder(store, folder):
    return Store(folder, store.plan)


def test_another_study_is_refused_with_what_is_different(whole):
    other = Store(whole.folder, small(seed=8))
    with pytest.raises(UsageError, match=r"another study: sweep.seed: 7, not 8; name another"):
        other.open("now")


def test_words_and_claims_do_not_make_another_study(whole):
    same = small(level=0.9, success="finished and iae <= 3")
    assert same.identity == whole.plan.identity
    assert small(seed=8).identity != whole.plan.identity


def test_a_run_that_kills_its_process_is_found(tmp_path, monkeypatch):
    real = units.drawn

    def deadly(scenario, vary, draw):
        if abs(draw["start.psi"] - draws_of(5)) < 1e-15 and "pid" in scenario.controller.kind:
            os._exit(3)
        return real(scenario, vary, draw)

    def draws_of(number):
        return next(draws(small().sweep, number, 1))["start.psi"]

    monkeypatch.setattr(units, "drawn", deadly)
    runs = made(tmp_path / "deadly", draws=16).runs()
    words = np.array(units.STATUSES)[runs.status("pid")[0]]
    assert [i for i, word in enumerate(words) if word != "finished"] == [5]
    assert words[5] == "crashed"
    assert "exit code 3" in runs.causes[0, 0, 5]
    assert runs.finished("li").all()


def test_time_over_keeps_what_is_made(tmp_path, monkeypatch):
    store = Store(tmp_path / "late", small())
    store.open("now")
    clock = iter(range(10**6))
    monkeypatch.setattr(marching.time, "monotonic", lambda: float(next(clock)))
    engine = marching.Processes(store.plan, 1)
    tally, whole = marching.march(store, lambda tally: None, engine, seconds=2.0)
    assert not whole
    assert 0 < tally.made < tally.wanted
    assert sum(int(mask.sum()) for mask in store.covered().values()) == tally.made
