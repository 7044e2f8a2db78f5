"""A study of a law from a file: its folder has all that is needed, wherever it is looked at."""

import json
from contextlib import ExitStack

import numpy as np
import pytest
from plugin_samples import LAW
from small_study import TEXT
from test_study_dask import DASK, PATIENCE, background, until

from podusv_cli.core.errors import LawError, ScenarioError
from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making import remote
from podusv_cli.studies.making.joining import digests
from podusv_cli.studies.making.plan import digest
from podusv_cli.studies.making.remote import StudyText
from podusv_cli.studies.making.store import RUNS, SCENARIO
from podusv_cli.studies.making.unit import make
from podusv_cli.workflows import run as running
from podusv_cli.workflows import studies, sweep
from podusv_cli.workflows.merge import merge

MINE = "plugins: [laws/my_law.py]\ncontrollers:\n  mine: {kind: cross_track}\n"


def swept(config, folder, **options):
    request = sweep.Request(out=folder, workers=1, figures=False, **options)
    return sweep.run(config, request, lambda tally: None)


@pytest.fixture
def config(tmp_path):
    """A scenario with a law in a file beside it."""
    (tmp_path / "own/laws").mkdir(parents=True)
    (tmp_path / "own/laws/my_law.py").write_text(LAW)
    (tmp_path / "own/mine.yaml").write_text(TEXT.replace("controllers:\n", MINE))
    return tmp_path / "own/mine.yaml"


@pytest.mark.slow
def test_a_study_keeps_its_plugin(config, tmp_path, monkeypatch):
    study = swept(config, tmp_path / "study", overrides=["sweep.draws=8"]).folder
    first = (study / RUNS).read_bytes()
    config.parent.rename(tmp_path / "gone")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert sweep.report(study, sweep.Request(figures=False)).results.made_runs == 24
    assert sweep.run(
        study, sweep.Request(("sweep.draws=16",), figures=False, trust=True), lambda tally: None
    ).results
    assert (study / RUNS).read_bytes() != first
    drawn = studies.draw(study, "mine", 3, 0, None, trusted=True)
    alone = running.run(drawn, running.Request(figures=()))
    table = studies.open_store(study).runs()
    assert alone.metrics["iae"] == table.metric("mine", "iae")[0, 3]
    merged = merge([study], tmp_path / "merged", sweep.Request(figures=False))
    assert (merged.folder / RUNS).read_bytes() == (study / RUNS).read_bytes()


def test_a_mistake_in_a_law_leaves_no_folder_that_the_mended_law_does_not_fit(config, tmp_path):
    law = config.parent / "laws/my_law.py"
    law.write_text(LAW.replace("k.", "k.no_such_", 1))
    with pytest.raises(LawError, match="no_such_"):
        swept(config, tmp_path / "study")
    assert not (tmp_path / "study").exists()
    law.write_text(LAW)
    assert swept(config, tmp_path / "study", overrides=["sweep.draws=2"]).results.made_runs == 6


@pytest.mark.parametrize("name", ["law", "until", "sha256", "success"])
def test_no_metric_has_the_name_of_another_column(config, name):
    metric = (
        f'\nfrom podusv_cli.metrics.metric import Metric\nOWN = Metric("{name}", "m", "of mine")\n'
    )
    law = config.parent / "laws/my_law.py"
    law.write_text(LAW + metric)
    with pytest.raises(ScenarioError, match=f"plugins: metric {name}: the table of runs has"):
        swept(config, config.parent / "study")


@pytest.mark.long
def test_a_worker_needs_no_file_of_a_plugin(config, tmp_path, monkeypatch):
    """It gets the text, and makes the same bits."""
    study = swept(config, tmp_path / "study", overrides=["sweep.draws=8"]).folder
    text, unit = (study / SCENARIO).read_text(), Unit("mine", 0, 0, 4)
    plan = studies.read_plan(study, trusted=True)
    recipe = StudyText(text, tuple(plan.scenario.plugin_files().items()))
    ours = digests(make(plan, unit))
    study.rename(tmp_path / "gone")
    theirs = digests(make(remote._plan(recipe), unit))
    assert np.array_equal(ours, theirs)
    assert remote.report(recipe.text, recipe.plugins)["the study"] == digest(plan.identity)


@pytest.mark.slow
def test_workers_of_dask_in_another_folder(config, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    place, elsewhere = tmp_path / "scheduler.json", tmp_path / "elsewhere"
    elsewhere.mkdir()
    with ExitStack() as stack:
        stack.enter_context(
            background(
                *DASK,
                "scheduler",
                "--host",
                "127.0.0.1",
                "--port",
                "0",
                "--no-dashboard",
                "--scheduler-file",
                place,
            )
        )
        until(place.exists)
        address = json.loads(place.read_text())["address"]
        stack.enter_context(
            background(*DASK, "worker", address, "--nthreads", "1", "--no-dashboard", cwd=elsewhere)
        )
        with distributed.Client(address, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=PATIENCE)
        spread = swept(config, tmp_path / "spread", scheduler=address).folder
    alone = swept(config, tmp_path / "alone").folder
    assert (spread / RUNS).read_bytes() == (alone / RUNS).read_bytes()
