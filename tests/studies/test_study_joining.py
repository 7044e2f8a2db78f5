"""Folders of one study joined: the bytes of one run, and a sentence for all that does not fit."""

import json
import platform
import shutil
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from small_study import TEXT, made, small

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.storage import provenance
from podusv_cli.studies.making import store as stores
from podusv_cli.studies.making.joining import _machine, gaps, join
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import RUNS, SCENARIO, Store
from podusv_cli.workflows import sweep as workflow
from podusv_cli.workflows.merge import merge

SHARDS = 8  # of five draws each


@pytest.fixture(scope="module")
def shards(tmp_path_factory):
    """Folders, each with its part of the study."""
    folder = tmp_path_factory.mktemp("shards")
    stores = [made(folder / str(n), part=(n, SHARDS)) for n in range(1, SHARDS + 1)]
    for store in stores:
        (store.folder / SCENARIO).write_text(TEXT)
    return [store.folder for store in stores]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return (made(tmp_path_factory.mktemp("whole") / "study").folder / RUNS).read_bytes()


def merged(folders, out):
    return merge(folders, out, workflow.Request(figures=False))


def test_shards_are_one_run_byte_for_byte(shards, whole, tmp_path):
    done = merged([*shards[3:], *shards[:3]], tmp_path / "all")
    assert done.results is not None
    assert (tmp_path / "all" / RUNS).read_bytes() == whole


@pytest.mark.slow
def test_runs_that_two_folders_have_alike_are_no_clash(shards, whole, tmp_path):
    merged(shards[:5], tmp_path / "first")
    merged([*shards[4:], tmp_path / "first"], tmp_path / "all")
    assert (tmp_path / "all" / RUNS).read_bytes() == whole
    merged([shards[3], tmp_path / "all"], tmp_path / "all again")
    assert (tmp_path / "all again" / RUNS).read_bytes() == whole


def altered(folder, to, metric="iae", machine="another processor"):
    """A copy of a shard in which the last run of a law has another number, and its machine."""
    shutil.copytree(folder, to)
    store = Store(to, about(small()))
    result = next(r for r in store.results() if r.unit.law == "li")
    numbers = result.metrics[metric].copy()
    numbers[-1] += 1e-9
    result.metrics[metric] = numbers
    store.write(result)
    told = {
        "platform": {"processor": machine, "libc": "glibc 2.0"},
        "python": "3.11",
        "podusv": "0.1",
        "packages": {"numpy": "2.0", "numba": "0.61"},
        "runs": 2,
        "started": "2026-03-01",
        "finished": None,
        "duration_s": None,
    }
    (to / "provenance.json").write_text(json.dumps({"sittings": [told, told]}))
    return to


def test_other_numbers_are_refused_with_the_machines_and_nothing_is_written(shards, tmp_path):
    other = altered(shards[1], tmp_path / "other")
    with pytest.raises(StorageError) as error:
        merged([*shards, other], tmp_path / "all")
    told = str(error.value)
    assert told.startswith(f"{other}: draw 9 of li with other numbers than in {shards[1]} ")
    assert "(iae of draw 9)" in told
    assert (
        "was made on another processor (glibc 2.0, podusv 0.1, Python 3.11, numpy 2.0, numba 0.61),"
        in told
    )
    assert f"{shards[1]} on a machine that its provenance.json does not tell" in told
    assert not list((tmp_path / "all").glob("units/*"))
    with pytest.raises(StorageError, match="with other numbers than in"):
        merged([other, shards[1]], tmp_path / "the other way round")


@pytest.mark.parametrize(
    ("name", "other"),
    [("status", {"status": [3, *[0] * 4]}), ("cause", {"causes": ("x", *[""] * 4)})],
)
def test_another_status_or_cause_is_another_run(shards, tmp_path, name, other):
    shutil.copytree(shards[0], tmp_path / "other")
    store = Store(tmp_path / "other", about(small()))
    store.write(replace(next(store.results()), **other))
    with pytest.raises(StorageError, match=rf"\({name} of draw 0\)"):
        merged([shards[0], store.folder], tmp_path / "all")


def test_a_missing_shard_is_told(shards, tmp_path):
    done = merged([shards[0], *shards[2:6], shards[7]], tmp_path / "most")
    assert done.results is None
    assert done.missing_runs == ("missing: draws 5 to 9, 30 to 34 of every law and cell",)
    store = Store(tmp_path / "most", about(small()))
    next(store.folder.glob("units/li-*")).unlink()
    assert [line.split(" of ")[1] for line in gaps(store)] == ["pid", "li"]


def test_what_cannot_be_the_outcome_is_refused(shards, tmp_path):
    with pytest.raises(UsageError, match="is one of the studies"):
        merged(shards[:3], shards[1])
    (tmp_path / "link").symlink_to(shards[0])
    with pytest.raises(UsageError, match="is one of the studies"):
        merged(shards[:3], tmp_path / "link")
    other = made(tmp_path / "other", seed=8, draws=1)
    (other.folder / SCENARIO).write_text(TEXT.replace("seed: 7", "seed: 8"))
    with pytest.raises(UsageError, match=r"sweep.seed: 8, not 7"):
        merged([shards[0], other.folder], tmp_path / "all")
    assert not (tmp_path / "all").exists()


def test_each_file_is_read_a_fixed_number_of_times(shards, tmp_path, monkeypatch):
    reads = []
    real = stores.read
    monkeypatch.setattr(
        stores, "read", lambda path, seal: (reads.append(path), real(path, seal))[1]
    )
    into, others = (
        Store(tmp_path / "all", about(small())),
        [Store(f, about(small())) for f in shards],
    )
    into.open("now")
    join(into, others)
    assert len(reads) == 2 * 2 * SHARDS  # compared, then written: two laws in each shard
    assert np.all([mask.all() for mask in into.covered_draws().values()])


def test_a_machine_is_told_from_a_sitting_of_this_machine():
    now = datetime.now(UTC)
    assert f"Python {platform.python_version()}, numpy {np.__version__}" in _machine(
        provenance.collect([], now, now)
    )
