"""Units made by a Dask cluster: the same bytes, whatever happens to workers; foreign ones refused."""

import pytest
from small_study import TEXT, made, small

from podusv_cli.study.cluster import connected
from podusv_cli.study.march import march
from podusv_cli.study.remote import Recipe
from podusv_cli.study.store import RUNS, Store

distributed = pytest.importorskip("distributed", reason="Dask is not installed: podusv[cluster]")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made(tmp_path_factory.mktemp("whole") / "study")


def content(store):
    return (store.folder / RUNS).read_bytes()


@pytest.mark.slow
def test_a_worker_that_is_killed_changes_no_byte(whole, tmp_path):
    store = Store(tmp_path / "study", small())
    store.open("now")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address=None,
        protocol="tcp://",
    ) as local:

        def tell(tally):
            if not killed and tally.made > 8:
                killed.append(next(iter(local.workers.values())).pid)
                import os

                os.kill(killed[0], 9)

        killed = []
        with connected(
            local.scheduler_address, Recipe(TEXT, "small.yaml"), store.seal, mixed=False
        ) as engine:
            tally, finished = march(store, tell, engine)
            print(engine.told())
    assert finished and killed
    store.write_runs()
    assert content(store) == content(whole)
