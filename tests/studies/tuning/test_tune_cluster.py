"""`podusv tune --scheduler`: the bytes of a search whose units were made by a cluster's workers."""

from __future__ import annotations

import json
import sys
from queue import SimpleQueue
from types import SimpleNamespace

import pytest
from stub_cluster import KilledWorker, StubClient
from tune_samples import contents, toy, tuned

from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making import cluster as clusters
from podusv_cli.studies.making import remote
from podusv_cli.workflows import tune as workflow

SMALL = ("tune.budget=40", "tune.train=2", "tune.validate=8")


def is_plain(sent):
    if isinstance(sent, tuple):
        return all(map(is_plain, sent))
    return sent is None or type(sent) in (str, int, float, bool)


class Near(StubClient):
    """A cluster without network: its workers make units in this process, from text and numbers."""

    deadly_gain = float("inf")  # from which on a trial ends its worker

    def __enter__(self):
        return self

    def __exit__(self, *error):
        return None

    def submit(self, function, *args, **options):
        if function is remote.report:
            (worker,) = options["workers"]
            self.reports[worker] = remote.report(*args)
        return super().submit(function, *args, **options)

    def finish(self):
        self.most = max(self.most, len(self.waiting))
        future, callback = self.waiting.pop(0)
        assert is_plain(future.args), "nothing but text and numbers is sent"
        if self._gain(future.args[-1]) >= self.deadly_gain:
            future.status, future.value = "error", KilledWorker("died")
        else:
            self.made.append(Unit(*future.args[2]))
            future.status = "finished"
            future.value = remote.make_unit(*future.args)
        callback(future)

    def _gain(self, variant):
        return max(dict(new).get("gain", 0.0) for _, _, new in variant[2])


@pytest.fixture
def near(monkeypatch):
    """A cluster of two workers whose address is `near`."""
    pytest.importorskip("optuna", reason="the search needs Optuna: podusv[tune]")
    client = Near((), {"a": {}, "b": {}})

    class Impatient(SimpleQueue):
        """A queue that lets a worker work where one would wait."""

        def get(self, timeout):
            if client.waiting:
                client.finish()
            return super().get(timeout=timeout)

    worker = SimpleNamespace(address="a")
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(get_worker=lambda: worker))
    monkeypatch.setattr(clusters, "SimpleQueue", Impatient)
    monkeypatch.setattr(clusters, "_client", lambda address: client)
    monkeypatch.setattr(clusters, "LOOK", 0.0)
    return client


def on_cluster(folder, address, *changes):
    request = workflow.Request(changes, folder / "out", figures=False, scheduler=address)
    return workflow.tune(toy(folder), request, lambda tally, text: None)


@pytest.mark.slow
def test_a_cluster_gives_the_bytes_of_this_machine(near, tmp_path):
    far = on_cluster(tmp_path / "far", "near", *SMALL)
    here = tuned(tmp_path / "here", *SMALL)
    assert contents(far.folder) == contents(here.folder)
    fresh = 8 * 4  # draws of toy, found gains, the other repeat's, and bare
    assert sum(unit.count for unit in near.made) == 2 * 40 + fresh
    assert 1 < near.most <= 4
    (told,) = json.loads((far.folder / "provenance.json").read_text())["sittings"]
    assert [worker["runs"] for worker in told["workers"]] == [2 * 40 + fresh]


@pytest.mark.long
def test_a_trial_that_ends_its_worker_fails_and_no_other(near, tmp_path):
    near.deadly_gain = 5.0
    found = on_cluster(tmp_path, "near", *SMALL).results.trials["toy"]
    trials = [trial for repeat in found for trial in repeat]
    assert {trial.failures for trial in trials if trial.gains["gain"] >= 5.0} == {1.0}
    assert {trial.failures for trial in trials if trial.gains["gain"] < 5.0} == {0.0}


@pytest.mark.slow
def test_a_real_cluster_gives_them_too(tmp_path):
    pytest.importorskip("optuna", reason="the search needs Optuna: podusv[tune]")
    distributed = pytest.importorskip("distributed", reason="needs Dask: podusv[cluster]")
    with distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as local:
        far = on_cluster(tmp_path / "far", local.scheduler_address, *SMALL)
    here = tuned(tmp_path / "here", *SMALL)
    assert contents(far.folder) == contents(here.folder)
