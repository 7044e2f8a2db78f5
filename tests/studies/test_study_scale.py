"""The driver of a study with thousands of units and 200 workers, none of which simulates."""

import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest
from small_study import small
from stub_cluster import REPORT, StubClient
from test_study_cluster import cluster, instant  # noqa: F401  # a fixture

from podusv_cli.studies.making.dispatch import AIM, dispatch
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import Store

WORKERS = [f"tcp://10.0.0.{number}:8786" for number in range(200)]


def marched(folder, draws):
    """A study whose units have 8 runs: the store, the stub, and what `march` said."""
    plan = small(draws=draws)
    client = StubClient(plan.metrics, dict.fromkeys(WORKERS, REPORT), seconds=AIM / 8)
    store = Store(folder, about(plan))
    store.open("now")
    return store, client, dispatch(store, plan, lambda tally: None, cluster(client))


@pytest.mark.slow
def test_units_and_calls_are_as_many_as_they_have_to_be(tmp_path):
    store, client, (tally, whole) = marched(tmp_path / "study", 2000)
    assert whole
    assert client.submitted == client.released == 500
    assert client.most == 400  # two for each of 200 workers
    assert client.looks <= 502  # once before each wait, here without a pause
    assert len(list((store.folder / "units").iterdir())) == 500
    assert tally.made == 4000


@pytest.mark.benchmark
def test_five_thousand_units_cost_little_time_and_memory(tmp_path):
    began = time.process_time()
    store, client, (tally, whole) = marched(tmp_path / "study", 20_000)
    driver = time.process_time() - began
    assert whole
    assert client.submitted == 5000
    began = time.perf_counter()
    store.covered_draws()
    scan = time.perf_counter() - began
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    march_time = client.seconds * tally.made  # processor time of all workers
    print(f"driver {driver:.1f} s of {march_time:.0f} s, peak {peak / 2**20:.0f} MB, {scan:.1f} s")
    assert driver <= 0.01 * march_time
    assert driver <= march_time / len(WORKERS)  # or the workers would wait for it
    assert peak <= 250 * 2**20
    assert scan <= 5.0


@pytest.mark.benchmark
def test_a_million_runs(tmp_path):
    script = Path(__file__).with_name("million_runs.py")
    megabytes, seconds = {}, {}
    for part in ("units", "runs", "report"):
        command = [sys.executable, script, tmp_path / "study", part]
        said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        megabytes[part], seconds[part] = map(float, said.split())
    print(f"memory {megabytes} MB, processor time {seconds} s")
    assert max(megabytes["units"], megabytes["runs"]) <= 250
    assert megabytes["report"] <= 300
    assert seconds["report"] <= 60


@pytest.mark.slow
def test_a_worker_loads_nothing_large_that_it_does_not_need():
    """They take 30 to 70 MB each, of 150 that a worker may have."""
    large = {"scipy.stats", "pandas", "matplotlib", "jinja2"}
    script = f"import sys, podusv_cli.studies.making.remote; print({large} & set(sys.modules))"
    command = [sys.executable, "-c", script]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "set()\n"
