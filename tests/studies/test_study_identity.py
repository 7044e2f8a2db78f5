"""What a study's runs are of: other kernels can be read, another scenario is refused."""

import json
import pickle
import shutil
from textwrap import dedent

import h5py
import pytest
from small_study import TEXT, made, small, written

from podusv_cli.core.errors import ScenarioError, StorageError, UsageError
from podusv_cli.process.workers import Outcome
from podusv_cli.scenario.load import load_text
from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making import plan as plans
from podusv_cli.studies.making import store as stores
from podusv_cli.studies.making.check import unjudged_claims
from podusv_cli.studies.making.dispatch import ENDED, StudyDriver
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import RUNS, Store
from podusv_cli.studies.making.unit import crashed_unit
from podusv_cli.workflows import studies, sweep
from podusv_cli.workflows.merge import merge


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return placed(made(tmp_path_factory.mktemp("study") / "whole", draws=8), 8)


def placed(store, draws=40):
    """The folder of a study, with its scenario."""
    text = TEXT.replace("draws: 40", f"draws: {draws}")
    (store.folder / stores.SCENARIO).write_text(text)
    return store.folder


def test_a_plan_goes_to_another_process_after_its_kernels_were_asked_for():
    plan = small()
    identity = plan.identity
    assert pickle.loads(pickle.dumps(plan)).identity == identity


@pytest.fixture
def updated(monkeypatch):
    """From here on, podusv has other kernels."""
    return lambda: monkeypatch.setattr(plans, "kernels", lambda scenario: "another digest")


def test_claims_that_a_study_does_not_judge_are_named(tmp_path):
    config, warnings = tmp_path / "small.yaml", []
    request = sweep.Request(
        ("sweep.draws=4",), tmp_path / "s", workers=1, figures=False, warn=warnings.append
    )
    text = TEXT + "claims: {M: {says: a, source: b, expect: %s}}\n"
    config.write_text(text % "median(li.iae / pid.iae) < 1")
    with pytest.raises(ScenarioError, match=r"'median'; it belongs to sweep\.claims"):
        sweep.run(config, request, lambda tally: None)
    alone = (text % "li.iae < pid.iae").replace("  claims:\n    S1:", "  # S1:")
    config.write_text(alone)
    sweep.run(config, request, lambda tally: None)
    assert "claims (M) are about single runs" in warnings[0]
    assert "claims (M) are about" in unjudged_claims(load_text(alone, "small.yaml").scenario)
    for own in (text % "li.iae < pid.iae", alone.replace("seed: 7", "success: iae < 1")):
        judging = load_text(own, "small.yaml").scenario
        assert unjudged_claims(judging) == ""


def test_runs_of_other_kernels_are_read(whole, tmp_path, updated, podusv):
    before, table = (whole / RUNS).read_bytes(), tmp_path / "runs.csv"
    updated()
    folder = shutil.copytree(whole, tmp_path / "study")
    for command, *options in (("status",), ("export", "--out", table), ("report", "--no-figures")):
        assert podusv("sweep", command, folder, *options).code == 0
    assert {count for _, _, count in studies.status(folder).rows} == {8}
    assert len(table.read_text().splitlines()) == 1 + 2 * 8
    assert (folder / RUNS).read_bytes() == before


def test_runs_of_other_kernels_are_not_added_to(whole, updated):
    updated()
    with pytest.raises(UsageError, match=r"another study: pid\[0\] kernels: .*, not another dig"):
        sweep.run(whole, sweep.Request(figures=False), lambda tally: None)


@pytest.mark.long
def test_shards_of_other_kernels_are_named_and_not_missing(tmp_path, updated):
    one = placed(made(tmp_path / "one", part=(1, 2)))
    updated()
    two = placed(made(tmp_path / "two", part=(2, 2)))
    with pytest.raises(UsageError, match=r"two .*pid\[0\] kernels: .*leave it"):
        merge([one, two], tmp_path / "all", sweep.Request(figures=False))
    assert not (tmp_path / "all").exists()


@pytest.mark.long
def test_shards_that_agree_are_joined_with_the_kernels_that_they_have(tmp_path, updated):
    shards = [placed(made(tmp_path / f"{n}", part=(n, 2), draws=8), 8) for n in (1, 2)]
    made(tmp_path / "one", draws=8)
    updated()
    merge(shards, tmp_path / "all", sweep.Request(figures=False))
    assert (tmp_path / "all" / RUNS).read_bytes() == (tmp_path / "one" / RUNS).read_bytes()


@pytest.mark.long
def test_force_begins_a_study_anew_and_spares_what_is_no_study(whole, tmp_path):
    folder, config = tmp_path / "study", tmp_path / "small.yaml"
    config.write_text(TEXT)
    asked = {"out": folder, "workers": 1, "figures": False}
    other = ("sweep.draws=4", "sweep.seed=8")

    def run(*changes, force=False):
        request = sweep.Request(changes, force=force, **asked)
        return sweep.run(config, request, lambda tally: None)

    run("sweep.draws=6")
    with pytest.raises(UsageError, match=r"holds another study: .*begin anew with --force"):
        run(*other)
    (folder / "mine.txt").write_text("")
    with pytest.raises(UsageError, match=r"holds mine\.txt, which is not the study's"):
        run(*other, force=True)
    assert (folder / RUNS).exists()
    (folder / "mine.txt").unlink()
    run(*other, force=True)
    fresh = sweep.Request(other, tmp_path / "fresh", workers=1, figures=False)
    sweep.run(config, fresh, lambda tally: None)
    assert (folder / RUNS).read_bytes() == (tmp_path / "fresh" / RUNS).read_bytes()
    (tmp_path / "full").mkdir()
    (tmp_path / "full/mine.txt").write_text("")
    asked["out"] = tmp_path / "full"
    with pytest.raises(UsageError, match="is no study and not empty"):
        run(*other, force=True)
    assert (tmp_path / "full/mine.txt").exists()


def test_a_scenario_that_is_not_the_one_of_the_runs_is_refused(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "study")
    (folder / stores.SCENARIO).write_text(TEXT.replace("seed: 7", "seed: 8"))
    with pytest.raises(UsageError, match=r"not the scenario .*: sweep.seed: 8, not 7; restore"):
        studies.draw(folder, "pid", 0, 0, tmp_path / "one.yaml")


@pytest.mark.slow
@pytest.mark.parametrize("nth", range(1, 5))
def test_a_study_that_was_killed_while_its_draws_were_raised_goes_on(tmp_path, monkeypatch, nth):
    config = written(tmp_path / "small.yaml", ("draws: 40", "draws: 4"))
    folder, request = tmp_path / "study", sweep.Request(out=tmp_path / "study", figures=False)
    sweep.run(config, request, lambda tally: None)
    real, calls = stores.files.write_bytes, []

    def killed(path, content):
        calls.append(path)
        if len(calls) == nth:
            raise KeyboardInterrupt
        real(path, content)

    monkeypatch.setattr(stores.files, "write_bytes", killed)
    more = sweep.Request(("sweep.draws=6",), folder, figures=False)
    with pytest.raises(KeyboardInterrupt):
        sweep.run(folder, more, lambda tally: None)
    monkeypatch.undo()
    done = sweep.run(folder, sweep.Request(figures=False), lambda tally: None)
    asked = json.loads((folder / "study.json").read_text())["draws"]
    assert done.tally.wanted == done.results.wanted_runs == 2 * asked


def test_invalid_runs_are_told_before_the_first_run(tmp_path):
    config = written(
        tmp_path / "small.yaml", ("uniform: [0.7, 1.3]", "normal: {mean: 1, sigma: 0.7}")
    )
    told, units = [], tmp_path / "study/units"

    def warn(text):
        told.append((text, len(list(units.iterdir()))))

    request = sweep.Request(("sweep.draws=12",), units.parent, figures=False, warn=warn)
    done = sweep.run(config, request, lambda tally: None)
    runs = studies.open_store(done.folder).runs()
    count = sum(int(runs.broken(law).sum()) for law in ("pid", "li"))
    assert 0 < count < 24
    ((text, there),) = told
    assert text.startswith(f"invalid runs: {count} of 24 tried (")
    assert "; draw " in text
    assert there == 0


@pytest.mark.long
def test_laws_of_a_study_may_have_different_metrics(tmp_path):
    """Two trials and a law; a log is kept of each, and compared with the table."""
    text = """
    vessel: {preset: otter}
    actuator: {kind: pod, preset: otter}
    path: {kind: legs, points: [[0, 0], [60, 0], [60, 60]]}
    disturbance: {kind: none}
    controllers:
      zigzag: {kind: zigzag, execute: 0.5}
      circle: {kind: turning_circle, execute: 0.5}
      los: {kind: los_pid}
    simulation: {duration: 60.0, step: 0.05}
    sweep: {draws: 3, keep: {draws: [0]}, vary: {vessel.m: {times: {uniform: [0.9, 1.1]}}}}
    """
    (tmp_path / "a.yaml").write_text(dedent(text))
    request = sweep.Request(out=tmp_path / "out", workers=1, figures=False)
    done = sweep.run(tmp_path / "a.yaml", request, lambda tally: None)
    rows = done.results.summary.set_index(["law", "metric"]).index
    of_law = {law: {metric for one, metric in rows if one == law} for law in done.results.runs.laws}
    assert [law for law in of_law if "e_ct_rms" in of_law[law]] == ["los"]
    assert [law for law in of_law if "overshoot_1" in of_law[law]] == ["zigzag"]
    assert [law for law in of_law if "advance" in of_law[law]] == ["circle"]
    assert not done.missing
    assert not done.results.contradicted


def placed_in(path, dataset):
    """Where in runs.h5 the content of a dataset begins, and how long it is."""
    with h5py.File(path, "r") as file:
        return file[dataset].id.get_offset(), file[dataset].id.get_storage_size()


@pytest.mark.slow
@pytest.mark.parametrize(
    "dataset", ["drawn/vessel.m", "drawn/start.psi", "failed_run", "failed_cause", "law", "draw"]
)
def test_every_array_of_the_table_is_sealed(tmp_path, dataset):
    store = made(tmp_path / "study", draws=2)
    store.write(crashed_unit(Unit("pid", 0, 1, 1), store.about.measured, "it ended its process"))
    store.write_runs()
    table, (place, size) = store.folder / RUNS, placed_in(store.folder / RUNS, dataset)
    sound = bytearray(table.read_bytes())
    assert len(store.runs().causes) == 1
    for at in (place, place + size - 1):
        altered = sound.copy()
        altered[at] ^= 1
        table.write_bytes(altered)
        with pytest.raises(StorageError, match=r"its numbers were altered|damaged"):
            store.runs()
    table.write_bytes(sound)
    assert store.runs().causes == {(0, 0, 1): "it ended its process"}


def test_a_table_of_the_first_format_is_read(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "study")
    with h5py.File(folder / RUNS, "r+") as file:
        del file["sha256_rest"]
    assert "sha256_rest" not in studies.open_store(folder).runs().metrics
    assert studies.status(folder).rows[0][2] == 8


def test_a_run_that_ends_its_process_is_told_alike_by_every_engine(tmp_path):
    plan = small(draws=1)
    store = Store(tmp_path / "study", about(plan))
    store.open("now")
    for end in ("exit code -9", "the worker ended"):
        driver = StudyDriver(store, plan, lambda tally: None, float("inf"), (1, 1))
        (number, _, unit), *_ = driver
        driver.take_outcome(number, Outcome(failure=end, killed=True))
        (result,) = store.results()
        assert result.causes == (ENDED,)
        assert driver.tally.ended == {f"{unit.law}[0] draw 0": end}
        next(store.folder.glob("units/*")).unlink()


def told_as(folder, machine):
    """Have the sittings of a study tell another processor."""
    path = folder / "provenance.json"
    content = json.loads(path.read_text())
    for session in content["sittings"]:
        session["platform"]["processor"] = machine
    path.write_text(json.dumps(content))


@pytest.mark.slow
def test_runs_of_several_machines_are_told_before_more_are_added(tmp_path):
    config, warnings = written(tmp_path / "small.yaml"), []

    def run(draws):
        changes = (f"sweep.draws={draws}",)
        request = sweep.Request(changes, tmp_path / "s", figures=False, warn=warnings.append)
        sweep.run(config, request, lambda tally: None)

    run(2)
    run(3)
    assert not warnings
    told_as(tmp_path / "s", "an abacus")
    run(3)
    assert not warnings  # nothing is added
    run(4)
    (told,) = warnings
    assert "different machines or versions: an abacus (" in told


@pytest.mark.slow
def test_a_merge_tells_of_several_machines(tmp_path):
    config, warnings = written(tmp_path / "small.yaml", ("draws: 40", "draws: 4")), []
    shards = [tmp_path / f"{n}" for n in (1, 2)]
    for number, folder in enumerate(shards, 1):
        sweep.run(config, sweep.Request(out=folder, shard=(number, 2)), lambda tally: None)
    request = sweep.Request(figures=False, warn=warnings.append)
    merge(shards, tmp_path / "alike", request)
    assert not warnings
    told_as(shards[0], "an abacus")
    merge(shards, tmp_path / "all", request)
    (told,) = warnings
    assert "an abacus (" in told
