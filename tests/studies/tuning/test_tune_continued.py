"""A search that was interrupted, killed or given a larger budget goes on as if nothing was."""

from __future__ import annotations

import json
import os
from types import MappingProxyType

import pytest
from tune_samples import contents, planned, searched, toy, tuned

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.studies.making.record import about
from podusv_cli.studies.making.store import RUNS, UNITS, Store
from podusv_cli.studies.tuning import folder as place
from podusv_cli.studies.tuning import sampler, trials
from podusv_cli.studies.tuning.plan import VALIDATE
from podusv_cli.studies.tuning.trials import FINISHED, GainTrial
from podusv_cli.studies.tuning.validation import FOLDER, _clear_other_runs, contestants
from podusv_cli.workflows import tune as workflow

MOST = 40  # calls after which a process is killed at the latest
ONCE = "tune.repeats=1"
CALLS = ("replace", "mkdir", "unlink", "rmdir", "open")


def killed(work, nth):
    """Do some work in a process that ends at the nth call that changes a folder; whether it did."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    left = [nth]

    def ends(real):
        def call(*given, **more):
            left[0] -= 1
            if left[0] <= 0:
                os._exit(9)
            return real(*given, **more)

        return call

    for name in CALLS:
        setattr(os, name, ends(getattr(os, name)))
    try:
        work()
    finally:
        os._exit(0)


def at_every_call(work):
    """Kill the work at its first call, begin again and kill it at its second, until it is done."""
    for nth in range(1, MOST):
        if not killed(work, nth):
            assert nth > 2, "no call was watched"
            return
    pytest.fail(f"more than {MOST} calls")


def opened(out, plan, texts=MappingProxyType({})):
    """Begin a search in a folder, or continue it."""
    place.write(out, plan, place.read_known(out, plan), "now", texts)


@pytest.mark.slow
def test_a_search_opens_again_wherever_it_was_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(sampler, "version", lambda: "1")
    small, large = planned(tmp_path), planned(tmp_path, "tune.budget=80")
    out = tmp_path / "out"
    for plan in (small, large):
        text = {place.SCENARIO: f"budget: {plan.tune.budget}\n"}
        at_every_call(lambda plan=plan, text=text: opened(out, plan, text))
        opened(out, plan, text)
        assert (out / place.SCENARIO).read_text() == text[place.SCENARIO]
        assert {path.name for path in out.iterdir()} == {place.TUNE, place.SCENARIO, trials.FOLDER}


def test_a_folder_without_its_scenario_says_how_to_go_on(tmp_path, monkeypatch):
    monkeypatch.setattr(sampler, "version", lambda: "1")
    opened(tmp_path / "out", planned(tmp_path))
    (tmp_path / "out" / place.SCENARIO).unlink(missing_ok=True)
    with pytest.raises(UsageError, match="podusv tune CONFIG --out"):
        place.check(tmp_path / "out")


@pytest.mark.long
def test_force_begins_a_search_anew_and_spares_what_is_no_search(tmp_path, optuna):
    def run(train, *, force):
        changes = ("tune.budget=8", "tune.batch=2", "tune.repeats=1", f"tune.train={train}")
        request = workflow.Request(changes, tmp_path / "out", workers=1, figures=False, force=force)
        return workflow.tune(toy(tmp_path), request, lambda tally, text: None)

    run(4, force=False)
    with pytest.raises(UsageError, match="begin anew with --force"):
        run(2, force=False)
    (tmp_path / "out/mine.txt").write_text("")
    with pytest.raises(UsageError, match=r"mine\.txt"):
        run(2, force=True)
    assert (tmp_path / "out" / place.TUNED).exists()
    (tmp_path / "out/mine.txt").unlink()
    anew = contents(run(2, force=True).folder)
    again = workflow.Request(workers=1, figures=False, trust=True, force=True)
    workflow.tune(tmp_path / "out", again, lambda tally, text: None)
    assert anew == contents(tmp_path / "out")
    (tmp_path / "out").rename(tmp_path / "before")
    assert anew == contents(run(2, force=False).folder)


def validation(folder, gain):
    """The store of the fresh draws for a gain that was found."""
    found = GainTrial(0, 0, {"gain": gain}, 4, FINISHED, 1.0, (), 1.0, 0.0)
    plan = planned(folder)
    made = plan.variant(contestants(plan, {"toy": [[found]]}), VALIDATE, 12)
    return Store(folder / FOLDER, about(made))


@pytest.mark.long
def test_runs_of_other_gains_are_replaced_wherever_that_was_killed(tmp_path):
    earlier, later = validation(tmp_path, 2.0), validation(tmp_path, 3.0)
    earlier.open("now")
    for name in (RUNS, f"{UNITS}/toy-0-0-8.unit"):
        (earlier.folder / name).write_bytes(b"of other gains")

    def begin():
        _clear_other_runs(later)
        later.open("later")

    at_every_call(begin)
    begin()
    assert {path.name for path in later.folder.iterdir()} == {"study.json", UNITS}
    assert not list((later.folder / UNITS).iterdir())


@pytest.fixture
def optuna():
    return pytest.importorskip("optuna", reason="the search needs Optuna: podusv[tune]")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A search in one go."""
    pytest.importorskip("optuna", reason="the search needs Optuna: podusv[tune]")
    return tuned(tmp_path_factory.mktemp("whole"), ONCE, workers=2)


@pytest.mark.slow
def test_a_search_in_parts_equals_one_in_one_go(whole, tmp_path):
    """Interrupted in the search, then in the validation; with other workers."""

    def stop(after):
        def tell(tally, text):
            if tally.made >= after:
                raise KeyboardInterrupt

        return tell

    for after in (20, 50):
        with pytest.raises(KeyboardInterrupt, match="continue with: podusv tune"):
            tuned(tmp_path / "part", ONCE, tell=stop(after))
    kept = trials.read(tmp_path / "part" / "out", "toy-0")
    assert 0 < sum(trial.runs for trial in kept) < 64

    def fresh(tally, text):
        if "fresh" in text and tally.made >= 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tuned(tmp_path / "part", ONCE, tell=fresh)
    part = workflow.tune(
        tmp_path / "part" / "out", workflow.Request(figures=False, trust=True), lambda *_: None
    )
    assert contents(part.folder) == contents(whole.folder)


@pytest.mark.slow
def test_a_larger_budget_continues_as_if_it_had_been_asked_for_at_once(whole, tmp_path):
    """The last trial of the smaller budget is cut, and the larger one finds other gains."""
    first = tuned(tmp_path / "parts", "tune.budget=34", ONCE).results.winner("toy")
    parts = tuned(tmp_path / "parts", ONCE)
    assert first.gains != whole.results.winner("toy").gains
    assert contents(parts.folder) == contents(whole.folder)
    assert parts.results.runs_spent == {"toy": 64}


@pytest.mark.slow
def test_what_is_kept_is_not_simulated_again(optuna, tmp_path):
    (first,) = searched(tmp_path, "tune.repeats=1")
    (again,) = searched(tmp_path, "tune.repeats=1", engine=lambda units, done: not list(units))
    assert again.trials == first.trials


def test_another_search_in_the_folder_is_refused_with_what_differs(tmp_path, monkeypatch):
    monkeypatch.setattr(sampler, "version", lambda: "1")
    opened(tmp_path / "out", planned(tmp_path))
    with pytest.raises(UsageError, match=r"holds another search: tune.train: 4, not 5"):
        opened(tmp_path / "out", planned(tmp_path, "tune.train=5"))
    monkeypatch.setattr(sampler, "version", lambda: "2")
    with pytest.raises(UsageError, match=r"holds another search: optuna: 1, not 2"):
        opened(tmp_path / "out", planned(tmp_path))


@pytest.mark.parametrize(
    ("fewer", "told"),
    [
        ("tune.budget=40", r"has budget: 64 \(runs\); ask for as many or more"),
        ("tune.repeats=1", r"has repeats: 2 \(searches\)"),
        ("tune.validate=11", r"has validate: 12 \(fresh draws\)"),
    ],
)
def test_less_would_throw_runs_away_and_is_refused(tmp_path, monkeypatch, fewer, told):
    monkeypatch.setattr(sampler, "version", lambda: "1")
    for _ in range(2):
        opened(tmp_path / "out", planned(tmp_path))
    with pytest.raises(UsageError, match=told):
        opened(tmp_path / "out", planned(tmp_path, fewer))


@pytest.mark.slow
def test_trials_of_other_gains_than_are_asked_for_are_not_thrown_away(optuna, tmp_path):
    (first,) = searched(tmp_path, "tune.repeats=1", "tune.budget=32")
    path = tmp_path / trials.FOLDER / "toy-0.json"
    other = path.read_text().replace(str(first.trials[1].gains["gain"]), "7.125")
    path.write_text(other)
    with pytest.raises(StorageError, match="batch 0 of toy-0 has other gains than this machine"):
        searched(tmp_path, "tune.repeats=1", "tune.budget=64")
    assert path.read_text() == other


TRIAL = GainTrial(0, 0, {"gain": 2.0}, 4, FINISHED, 0.5, (0.1, float("inf")), float("inf"), 0.25)
SHAPES = {
    "gains": (None, 3, "x", [1]),
    "runs": (None, "4", [], -1, 1.5),
    "status": ("done", None),
    "value": ("x", []),
    "excesses": (None, "ab", {}, [None, "x"]),
    "first": ({},),
    "number": (-1,),
    "failures": (None,),
    "batch": ("0", True),
}


@pytest.mark.parametrize(("key", "shapes"), SHAPES.items())
def test_a_trial_of_another_shape_is_a_damaged_file(tmp_path, key, shapes):
    (tmp_path / trials.FOLDER).mkdir()
    trials.write(tmp_path, "toy-0", [TRIAL, TRIAL])
    assert trials.read(tmp_path, "toy-0") == [TRIAL, TRIAL]
    file = tmp_path / trials.FOLDER / "toy-0.json"
    sound = json.loads(file.read_text())
    for shape in shapes:
        told = {**sound, "trials": [sound["trials"][0], {**sound["trials"][1], key: shape}]}
        file.write_text(json.dumps(told))
        with pytest.raises(StorageError, match=rf"toy-0\.json: damaged, .* \(trials\.1\.{key}"):
            trials.read(tmp_path, "toy-0")
