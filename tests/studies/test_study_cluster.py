"""Units made by a cluster's workers: who gets units, and what is kept when something goes wrong."""

import os
import signal
from concurrent.futures import CancelledError
from queue import SimpleQueue
from unittest.mock import Mock

import numpy as np
import pytest
from small_study import small
from stub_cluster import REPORT, StubClient

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.studies.counting.runs import STATUSES
from podusv_cli.studies.making import cluster as clusters
from podusv_cli.studies.making import dispatch as marching
from podusv_cli.studies.making.cluster import Cluster
from podusv_cli.studies.making.dispatch import dispatch
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.remote import StudyText
from podusv_cli.studies.making.store import Store

OTHER_NUMPY = REPORT | {"numpy": "1.9"}


@pytest.fixture(autouse=True)
def instant(monkeypatch):
    """Laws are not compiled, it is always time to look for workers, and nothing waits."""
    monkeypatch.setattr(marching, "prepare", lambda plan, law, cell: None)
    monkeypatch.setattr(clusters, "LOOK", 0.0)


class Impatient(SimpleQueue):
    """A queue that lets the stub work where one would wait."""

    client: StubClient

    def get(self, timeout):
        if self.client.waiting:
            self.client.finish()
        return super().get(timeout=timeout)


def cluster(client):
    made = Cluster(client, StudyText("text"), REPORT)
    made._finished = Impatient()
    made._finished.client = client
    return made


def stub(names="ab", **others):
    plan = small()
    return StubClient(plan.metrics, dict.fromkeys(names, REPORT), **others)


def marched(folder, client, tell=lambda tally: None, **changes):
    plan, executor = small(**changes), cluster(client)
    store = Store(folder, about(plan))
    store.open("now")
    return store, executor, dispatch(store, plan, tell, executor)


def statuses(store):
    store.write_runs()
    words = np.array(STATUSES)
    return {law: words[store.runs().status(law)[0]] for law in store.about.laws}


def test_every_run_is_made_once_and_every_result_released(tmp_path):
    client = stub()
    store, _, (tally, whole) = marched(tmp_path / "study", client)
    assert whole
    assert tally.made == 80
    assert client.submitted == client.released == len(client.made) == 10
    assert client.most == 4  # two for each thread
    assert all(np.all(words == "finished") for words in statuses(store).values())
    assert list(store.runs().metric("li", "iae")[0]) == list(range(40))


def test_a_foreign_worker_is_refused_by_name_before_the_march(tmp_path):
    client = stub()
    client.reports["tcp://b:1"] = OTHER_NUMPY
    with pytest.raises(UsageError) as error:
        cluster(client).check()
    assert str(error.value) == (
        "worker tcp://b:1 computes with something else: numpy is 1.9, not 2.0; install there what "
        "is installed here, or leave the worker out"
    )


@pytest.mark.parametrize("name", REPORT)
def test_whatever_is_another_or_not_told_is_refused(name):
    client = stub()
    client.reports["b"] = {key: word for key, word in REPORT.items() if key != name}
    with pytest.raises(UsageError, match=f"{name} is not there, not"):
        cluster(client).check()


def test_a_cluster_without_workers_is_refused():
    with pytest.raises(UsageError, match="no workers yet; start one with `dask worker"):
        cluster(stub("")).check()


def test_which_worker_made_which_draws_is_told(tmp_path):
    _, executor, (_, whole) = marched(tmp_path / "study", stub("ab"))
    assert whole
    told = {worker["worker"]: worker["units"] for worker in executor.provenance()["workers"]}
    assert told["a"] == ["pid[0] draws 0 to 39"]
    assert told["b"] == ["li[0] draws 0 to 39"]


def test_a_foreign_worker_that_joins_later_gets_no_units(tmp_path):
    client = stub("ab", join={"tcp://c:1": OTHER_NUMPY})
    store, executor, (_, whole) = marched(tmp_path / "study", client)
    assert whole
    refused = executor.provenance()["refused"]
    assert list(refused) == ["tcp://c:1"]
    assert (
        "got no units, because it computes with something else: numpy is 1.9"
        in refused["tcp://c:1"]
    )
    asked = [worker for worker, _ in client.made]
    assert 1 <= asked.count("tcp://c:1") <= 4  # those under way when it joined
    assert all(np.all(words == "finished") for words in statuses(store).values())


def test_a_fitting_worker_that_joins_later_gets_units(tmp_path):
    client = stub("a", join={"b": REPORT})
    marched(tmp_path / "study", client)
    assert {worker for worker, _ in client.made} == {"a", "b"}


def test_only_the_run_that_kills_is_blamed(tmp_path):
    """Units beside the deadly one die with it; alone, they do not."""
    client = stub(deadly=frozenset({13}))
    store, _, (_, whole) = marched(tmp_path / "study", client)
    assert whole
    for words in statuses(store).values():
        assert [i for i, word in enumerate(words) if word != "finished"] == [13]
        assert words[13] == "crashed"
    assert store.runs().causes[0, 0, 13] == marching.ENDED
    deadly = [unit for unit in client.killers if unit.law == "pid" and 13 in unit.draws]
    assert [unit.count for unit in deadly] == [8, 8, 4, 2, 1]  # again alone, then halved


def test_a_lost_scheduler_is_a_sentence_and_units_are_kept(tmp_path):
    client = stub(lost_after=3)
    with pytest.raises(StorageError, match="connection to the scheduler was lost"):
        marched(tmp_path / "study", client)
    there = Store(tmp_path / "study", about(small())).covered_draws()
    assert sum(int(mask.sum()) for mask in there.values()) == 3 * marching.FIRST


def test_an_interrupt_keeps_what_is_written_and_cancels_the_rest(tmp_path):
    client = stub()

    def tell(tally):
        if tally.made == 24:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        marched(tmp_path / "study", client, tell)
    there = Store(tmp_path / "study", about(small())).covered_draws()
    assert sum(int(mask.sum()) for mask in there.values()) == 24
    assert len(client.cancelled) == client.submitted - 3
    _, _, (tally, whole) = marched(tmp_path / "study", stub())
    assert whole
    assert tally.before == 24


@pytest.mark.parametrize("error", [CancelledError("lost"), OSError("Timed out")])
def test_a_scheduler_that_is_lost_while_workers_report_is_a_sentence(error):
    client = stub(lost_reporting=error)
    with pytest.raises(StorageError, match="connection to the scheduler was lost") as lost:
        cluster(client).check()
    assert lost.value.exit_code == 5


def test_a_scheduler_that_is_lost_before_it_lists_workers_is_a_sentence(monkeypatch):
    client = stub()
    monkeypatch.setattr(client, "scheduler_info", Mock(side_effect=OSError("closed")))
    with pytest.raises(StorageError, match="connection to the scheduler was lost"):
        cluster(client).check()
