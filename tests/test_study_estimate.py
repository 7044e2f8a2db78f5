"""What a study is said to need: computed from given timings, and compared with its files."""

import os
import signal
from types import SimpleNamespace

import pytest
from small_study import small, written
from stub_cluster import invented

from podusv_cli.studies.study import estimate as estimating
from podusv_cli.studies.study.estimate import estimate, pilot
from podusv_cli.studies.study.store import RUNS, Store
from podusv_cli.studies.study.unit import Unit, make
from podusv_cli.workflows import sweep

PACES = {("pid", 0): 0.25, ("li", 0): 0.5}  # s a run
KEEP = "{failed: 3, worst: {iae: 2}, draws: [0]}"


def test_time_is_that_of_the_missing_runs_at_the_paces_of_their_laws():
    need = estimate(small(draws=100), PACES, {("pid", 0): 100, ("li", 0): 20}, 2)
    assert (need.runs, need.march) == (120, 35.0)
    assert need.in_words()[0].startswith("120 runs: about 18 s on 2 cores (292 ms of computing")
    assert need.kept == (0, 0)


def test_kept_logs_are_counted_without_and_with_failed_runs():
    few, many = (estimate(small(keep=KEEP, draws=n), PACES, {}, 1) for n in (4, 100))
    assert few.kept == (6, 8)  # no more than there are runs
    assert many.kept == (6, 12)
    plain = estimate(small(keep=KEEP, draws=100), PACES, {}, 1, figures=False)
    assert plain.after[1] < many.after[1]
    assert plain.disk[0] < many.disk[0] < many.disk[1]
    assert "then the report and 6 to 12 kept logs: about " in many.in_words()[1]


def bytes_in(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


@pytest.mark.slow
def test_the_disk_is_what_was_said_within_30_percent(tmp_path):
    config = written(
        tmp_path / "long.yaml", ("duration: 1.0", "duration: 60.0"),
        ("  claims:\n", "  keep: {draws: [0]}\n  claims:\n"),
    )  # fmt: skip
    request = sweep.Request(workers=1, figures=False, out=tmp_path / "study")
    done = sweep.run(config, request, lambda tally: None)
    need = estimate(done.results.plan, PACES, {}, 1, figures=False)
    assert need.kept == (2, 2)
    assert need.table == pytest.approx((done.folder / RUNS).stat().st_size, rel=0.3)
    assert need.disk[0] == pytest.approx(bytes_in(done.folder), rel=0.3)


def test_the_table_of_a_large_study_is_what_was_said(tmp_path):
    store = Store(tmp_path / "study", small(draws=2000))
    store.open("now")
    for law in store.plan.laws:
        store.write(invented(Unit(law, 0, 0, 2000), store.plan.metrics))
    store.write_runs()
    said = estimate(store.plan, PACES, {}, 1).table
    assert said == pytest.approx((store.folder / RUNS).stat().st_size, rel=0.05)


@pytest.mark.slow
def test_a_pilot_takes_some_runs_of_every_law_as_its_pace(monkeypatch):
    """The clock goes on by 0.05 s a run; then the runs of a law that take 0.2 s are enough."""
    spent = [0.0]

    def counted(plan, unit, **options):
        spent[0] += 0.05 * unit.count
        return make(plan, unit, **options)

    monkeypatch.setattr(estimating, "make", counted)
    monkeypatch.setattr(estimating.time, "process_time", lambda: spent[0])
    found = pilot(small())
    assert found == {("pid", 0): pytest.approx(0.05), ("li", 0): pytest.approx(0.05)}
    monkeypatch.setattr(estimating, "MOST_STEPS", 25)  # half of a run
    assert pilot(small())["pid", 0] == pytest.approx(0.1)
    monkeypatch.setattr(estimating, "MOST_PLACES", 2)  # one cell of each law
    grid = pilot(small(grid="{disturbance.scale: [0.5, 1, 2]}"))
    assert grid == dict.fromkeys(
        [(law, i) for law in ("pid", "li") for i in range(3)], pytest.approx(0.1)
    )


def test_the_first_runs_of_a_process_which_load_machine_code_are_not_timed(monkeypatch):
    spent = [0.0]

    def slow_at_first(plan, unit, **options):
        spent[0] += 0.05 * unit.count if spent[0] else 10.0
        return make(plan, unit, **options)

    monkeypatch.setattr(estimating, "make", slow_at_first)
    monkeypatch.setattr(estimating.time, "process_time", lambda: spent[0])
    assert pilot(small())["li", 0] == pytest.approx(0.05)


def test_a_law_that_ends_its_process_is_named(monkeypatch):
    def deadly(plan, unit, **options):
        if unit.law == "li":
            os.kill(os.getpid(), signal.SIGKILL)

    monkeypatch.setattr(estimating, "make", deadly)
    plan = small()
    need = estimate(plan, pilot(plan), {("pid", 0): 40, ("li", 0): 40}, 1)
    assert need.untimed == ("li",)
    assert "without li, which ended its process" in need.in_words()[0]


@pytest.mark.slow
def test_both_commands_tell_it(podusv, tmp_path):
    config = written(tmp_path / "small.yaml")
    said = podusv("validate", config)
    assert "80 runs: about " in said.out
    run = podusv("sweep", "run", config, "--out", tmp_path / "a", "--no-figures")
    assert run.err.startswith("80 runs: about ")
    quiet = podusv("sweep", "run", config, "--out", tmp_path / "b", "--no-figures", "--quiet")
    assert quiet.err == ""


def test_a_study_that_cannot_fit_is_refused_before_the_first_run(tmp_path, podusv, monkeypatch):
    config = written(tmp_path / "small.yaml")
    out, draws = tmp_path / "results/study", 1_000_000_000
    said = podusv("sweep", "run", config, "--out", out, "--draws", draws)
    assert said.code == 5
    assert "2,000,000,000 runs (sweep.draws: 1,000,000,000) were asked for" in said.err
    assert not out.exists()
    valid = podusv("validate", config, "--set", f"sweep.draws={draws}")
    assert (valid.code, valid.out) == (5, "")
    assert valid.err == said.err.replace(str(out), "results/small-sweep")
    free = SimpleNamespace(free=1e15)
    monkeypatch.setattr("podusv_cli.storage.run_folder.shutil.disk_usage", lambda path: free)
    monkeypatch.setattr("podusv_cli.studies.study.estimate.os.sysconf", lambda name: 100_000)
    said = podusv("sweep", "run", config, "--out", out, "--draws", draws)
    assert said.code == 5
    assert "its tables take 64 GB of memory or more, and this machine has 10 GB" in said.err
    assert not out.exists()
