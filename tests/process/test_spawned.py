"""Workers that begin empty, as on Windows and macOS: the bytes of those that are forked."""

import sys
import time
from functools import partial

import pytest
from plugin_parts import MORE
from plugin_samples import LAW, TWO
from small_study import TEXT

from podusv_cli.core.component import Component
from podusv_cli.engine.machine import compile as machine
from podusv_cli.process import workers
from podusv_cli.process.workers import run_all
from podusv_cli.scenario.load import load
from podusv_cli.scenario.model import Scenario
from podusv_cli.storage.run_folder import LOG
from podusv_cli.studies.counting.runs import Unit
from podusv_cli.studies.making.plan import plan
from podusv_cli.studies.making.store import RUNS
from podusv_cli.studies.making.unit import make, prepare
from podusv_cli.workflows import compare, sweep
from podusv_cli.workflows.request import Request

DAMAGED = "raise SystemExit('this is no business of a worker')\n"


@pytest.fixture
def spawned(monkeypatch):
    """Workers that begin empty."""
    monkeypatch.setattr(workers, "CREW", workers.Spawned)


@pytest.fixture
def config(tmp_path):
    """A comparison of laws of a file beside it, which has a metric and a figure, too."""
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws/my_law.py").write_text(LAW + MORE)
    (tmp_path / "mine.yaml").write_text(TWO)
    return tmp_path / "mine.yaml"


def words_of(module, tell):
    """Whether a worker has imported a module."""
    return module in sys.modules


def kind_of(thing, tell):
    """A thing's class, and where it is from."""
    return type(thing).__qualname__, type(thing).__module__


def close_over(number):
    """A job that no module has a name for."""
    return lambda tell: number**2


@pytest.mark.long
def test_a_worker_begins_empty_and_does_one_job_after_the_other(spawned):
    outcomes = run_all([partial(words_of, "podusv_cli.figures.page")] * 3, workers=1)
    assert [outcome.result for outcome in outcomes] == [False] * 3


def test_a_function_within_a_function_crosses(spawned):
    assert [o.result for o in run_all([close_over(3), close_over(4)], workers=2)] == [9, 16]


def test_a_worker_does_not_run_the_script_that_started_it(spawned, monkeypatch, tmp_path):
    (tmp_path / "script.py").write_text(DAMAGED)
    own = str(tmp_path / "script.py")
    monkeypatch.setattr(sys.modules["__main__"], "__file__", own, raising=False)
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None, raising=False)
    assert run_all([close_over(3)])[0].result == 9


@pytest.mark.long
def test_parts_of_a_file_cross_by_its_text_though_the_file_is_gone(spawned, config):
    scenario = load(config).scenario
    (config.parent / "laws/my_law.py").unlink()
    things = [scenario.controllers["soft"], scenario.plugged[0], scenario]
    laws, plugin, whole = run_all([partial(kind_of, thing) for thing in things], workers=1)
    module = type(scenario.controllers["soft"]).__module__
    assert issubclass(type(scenario.controllers["soft"]), Component)
    assert laws.result == ("CrossTrack", module)
    assert plugin.result == ("Plugin", "podusv_cli.core.plugins")
    assert whole.result[0] == Scenario.__qualname__


@pytest.mark.long
def test_a_comparison_has_the_bytes_of_forked_workers(config, monkeypatch):
    """Logs, figures and tables, with a law, a metric and a figure of a file."""
    made = {}
    for crew in (workers.Forked, workers.Spawned):
        monkeypatch.setattr(workers, "CREW", crew)
        request = Request(out=config.parent / crew.__name__, names=("gaps", "path"))
        made[crew] = compare.compare([config], request)
    forked, spawned = ({*folder_bytes(done.folder)} for done in made.values())
    assert forked == spawned
    assert {name for name, _ in forked} >= {f"soft/{LOG}", "figures/gaps.png"}
    assert not any(done.missing for done in made.values())


def folder_bytes(folder):
    """Name and content of the files of a comparison that no clock or place is in."""
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if path.suffix in (".h5", ".png", ".csv") and path.name != "metrics.csv":
            yield name, path.read_bytes()


STUDY = TEXT.replace(
    "controllers:\n", "plugins: [laws/my_law.py]\ncontrollers:\n  mine: {kind: cross_track}\n"
)


def make_unit(plan, unit, tell):
    """The metrics of a unit, and whether this process had to compile anything for it."""
    made = make(plan, unit)
    return {
        name: numbers.tolist() for name, numbers in made.metrics.items()
    }, "numba" in sys.modules


@pytest.mark.long
def test_workers_compile_nothing_that_this_process_compiled(spawned, config, monkeypatch):
    """One compilation a machine: of a law that nobody has compiled yet, each piece once."""
    config.write_text(STUDY)
    (config.parent / "laws/my_law.py").write_text(
        LAW.replace("PUSH = 1.0", f"PUSH = {time.time()}")
    )
    compiled, compile_piece = [], machine.Piece.compile

    def count(piece):
        compiled.append(piece.name)
        return compile_piece(piece)

    monkeypatch.setattr(machine.Piece, "compile", count)
    planned, unit = plan(load(config)), Unit("mine", 0, 0, 8)
    prepare(planned, "mine", 0)
    mine = [name for name in compiled if "CrossTrack" in name]
    assert mine
    assert len({*compiled}) == len(compiled)
    outcomes = run_all([partial(make_unit, planned, unit)] * 2, workers=2)
    here = make_unit(planned, unit, None)[0]
    assert [outcome.result for outcome in outcomes] == [(here, False)] * 2
    assert len([name for name in compiled if "CrossTrack" in name]) == len(mine)


@pytest.mark.long
def test_a_study_has_the_bytes_of_forked_workers(config, monkeypatch, tmp_path):
    config.write_text(STUDY)
    made = []
    for crew in (workers.Spawned, workers.Forked):
        monkeypatch.setattr(workers, "CREW", crew)
        asked = sweep.Request(
            ("sweep.draws=24",), out=tmp_path / crew.__name__, figures=False, workers=2
        )
        made.append((sweep.run(config, asked, lambda tally: None).folder / RUNS).read_bytes())
    assert made[0] == made[1]
