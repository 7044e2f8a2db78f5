"""podusv from Python: scenarios from dictionaries, runs, comparisons, what notebooks show."""

import ast
import doctest
import hashlib
import inspect
import json
import math
import re
import sys
import traceback
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray
from command_samples import BASE, ROOT, write
from matplotlib.figure import Figure
from process_samples import python

import podusv
from podusv_cli import interface
from podusv_cli.core.errors import ScenarioError, StorageError, UsageError
from podusv_cli.engine.running import batch
from podusv_cli.interface import functions, scenarios, session, studies
from podusv_cli.metrics.table import CLOCKED
from podusv_cli.scenario.load import load as load_file

SHORT: dict[str, Any] = {
    "vessel": {"preset": "paper_nonlinear"},
    "path": {"kind": "line"},
    "disturbance": {"kind": "none"},
    "actuator": {"kind": "saturated"},
    "start": {"x": -5.0, "y": -2.0, "u": 0.3},
    "simulation": {"duration": 1.0},
    "controller": {"kind": "pid", "K_Pu": 100.0},
    "silence": ["saturated", "never-settles"],
}
TWO = {**SHORT, "controllers": {"stiff": {"K_Pu": 200.0}, "soft": {"K_Pu": 5.0}}}
CLAIM = {"says": "s", "source": "p", "expect": "stiff.iae > 0"}


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


# --- the names


def test_the_package_has_the_names_of_the_interface_and_its_stub():
    assert podusv.__all__ == interface.__all__
    assert all(getattr(podusv, name) is getattr(interface, name) for name in podusv.__all__)
    assert set(podusv.__all__) < set(dir(podusv))
    stub = ast.parse((ROOT / "podusv/__init__.pyi").read_text())
    named = [
        part.asname for node in stub.body if isinstance(node, ast.ImportFrom) for part in node.names
    ]
    assert named == podusv.__all__
    with pytest.raises(AttributeError, match="has no attribute 'simulat'"):
        _ = podusv.simulat  # type: ignore[attr-defined]


def test_importing_the_package_imports_nothing_else():
    script = "import sys; before = {*sys.modules}; import podusv; print({*sys.modules} - before)"
    assert ast.literal_eval(python("-c", script).stdout) == {"podusv", "podusv_cli"}


def test_the_package_is_a_command_too():
    assert python("-m", "podusv", "--version").stdout == f"podusv {podusv.__version__}\n"


@pytest.mark.parametrize(
    "module", [scenarios, pytest.param(functions, marks=pytest.mark.long), session, studies]
)
def test_the_examples_in_the_docstrings_run(module):
    found = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert found.failed == 0
    assert found.attempted >= 5


def test_every_public_name_is_typed_and_has_an_example_or_is_a_result():
    for name in podusv.__all__:
        thing = getattr(podusv, name)
        assert inspect.getdoc(thing)
        assert ">>> " in thing.__doc__ or isinstance(thing, type)
        if inspect.isfunction(thing):
            signature = inspect.signature(thing)
            parts = [part.annotation for part in signature.parameters.values()]
            assert inspect.Signature.empty not in (*parts, signature.return_annotation)


# --- scenarios


def test_a_dictionary_is_as_short_as_the_file():
    write("scenario.yaml", BASE)
    assert podusv.Scenario(SHORT) == podusv.Scenario(**SHORT) == podusv.load(SHORT)
    assert podusv.load(SHORT) == podusv.load("scenario.yaml") == podusv.load(Path("scenario.yaml"))
    whole = load_file("scenario.yaml").scenario
    assert podusv.load(SHORT).model_dump() == whole.model_dump()
    assert podusv.load(podusv.load(SHORT)) == podusv.load(SHORT)


def test_sections_may_be_parts_of_podusv_and_numbers_those_of_numpy():
    scenario = podusv.load(SHORT)
    again = podusv.Scenario(
        {
            **SHORT,
            "controller": scenario.controller,
            "start": {"x": np.float64(-5), "y": np.int64(-2), "u": 0.3},
        }
    )
    assert again == scenario
    points = np.array([[0.0, 0.0], [10.0, 1.0], [18.0, 6.0]])
    path = podusv.Scenario(SHORT, path={"kind": "waypoints", "points": points}).path
    assert path.points == ((0.0, 0.0), (10.0, 1.0), (18.0, 6.0))  # type: ignore[attr-defined]


def test_changes_are_what_set_is_on_the_command_line():
    write("a.yaml", BASE)
    changes = {"vessel.m": 30.0, "path": {"kind": "circle", "radius": 9.0}, "description": "true"}
    there = load_file(
        "a.yaml", ["vessel.m=30", "path.kind=circle", "path.radius=9", 'description="true"']
    )
    assert podusv.load("a.yaml", changes).model_dump() == there.scenario.model_dump()
    kept = podusv.load(podusv.load(SHORT), {"vessel.m": 30.0})
    assert (kept.vessel.m, kept.nominal.m) == (30.0, 23.8)  # as the docstring says


@pytest.mark.parametrize(
    ("sections", "text"),
    [
        ({**SHORT, "strat": {}}, "scenario: strat: unknown key; did you mean 'start'?"),
        ({**SHORT, "start": {"x": math.nan}}, "scenario: start.x: .nan is not a finite number"),
        ({**SHORT, "start": {"x": "5"}}, "scenario: start.x: must be a number [m], found '5'; "),
        ({**SHORT, "extends": "podusv:x.yaml"}, "scenario: extends: 'podusv:x.yaml' cannot be"),
    ],
)
def test_a_faulty_dictionary_is_a_line_without_a_place(sections, text):
    for make in (podusv.Scenario, podusv.load):
        with pytest.raises(ScenarioError, match=re.escape(text)):
            make(sections)


def test_what_cannot_stand_in_a_scenario_is_named():
    with pytest.raises(UsageError, match="a complex cannot stand in a scenario"):
        podusv.Scenario({**SHORT, "start": {"x": 1j}})
    with pytest.raises(ScenarioError, match=r"^--set start\.z=1: start\.z: "):
        podusv.load(SHORT, {"start.z": 1})


# --- runs


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A run in a folder."""
    return podusv.run(SHORT, out=tmp_path_factory.mktemp("kept") / "run", figures=False)


def test_an_unknown_metric_of_a_run_is_a_sentence(kept):
    metrics = kept.metrics
    with pytest.raises(KeyError, match=r"unknown metric 'ia' of this run; did you mean 'iae'\?"):
        metrics["ia"]
    assert metrics["iae"] == metrics.loc["iae"] == kept.numbers["iae"]
    assert list(metrics[["iae", "ise"]]) == [kept.numbers["iae"], kept.numbers["ise"]]


def test_a_run_in_memory_has_the_log_and_metrics_of_the_one_in_a_folder(kept):
    run = podusv.simulate(SHORT)
    assert not list(Path().iterdir())
    assert (run.folder, run.status, run.message) == (None, "finished", "")
    xarray.testing.assert_identical(run.log, kept.log)
    pd.testing.assert_series_equal(run.metrics, kept.metrics.drop([*CLOCKED, "law_operations"]))
    assert run.scenario == kept.scenario == podusv.load(SHORT)
    assert podusv.open_run(str(kept.folder)).metrics.equals(kept.metrics)


@pytest.mark.parametrize(
    "finding", ["text", 5, {"code": "a"}, {"code": 1, "where": "", "text": ""}]
)
def test_a_finding_that_is_none_is_a_damaged_file(tmp_path, finding):
    run = podusv.run(SHORT, out=tmp_path / "run", figures=False)
    path = run.folder / "metrics.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "warnings": [finding]}))
    manifest = run.folder / "manifest.json"
    listed = json.loads(manifest.read_text())
    content = path.read_bytes()
    digest = hashlib.sha256(content).hexdigest()
    listed["files"]["metrics.json"] = {"sha256": digest, "bytes": len(content)}
    manifest.write_text(json.dumps(listed))
    with pytest.raises(StorageError, match=r"metrics\.json: damaged, .*\(warnings\.0"):
        podusv.open_run(run.folder)


def test_the_log_is_that_of_the_file(kept):
    assert kept.folder
    with xarray.open_dataset(kept.folder / "log.h5") as there:
        xarray.testing.assert_equal(kept.log, there)
        for name in kept.log:
            assert kept.log[name].units == there[name].units
            assert kept.log[name].long_name == there[name].long_name
    assert list(kept.log.coords) == ["time"]


def test_a_signal_is_an_array_and_an_unknown_one_is_told(kept):
    assert kept["z_e"].shape == (101,)
    with pytest.raises(KeyError, match="did you mean 'z_e'"):
        kept["ze"]


def test_a_run_that_diverges_is_a_run_and_its_warnings_are_there():
    run = podusv.simulate("podusv:mu_2017/printed_from_zero.yaml", {"simulation.duration": 1.0})
    assert run.status == "diverged"
    assert run.message.startswith("diverged at t = 0.08 s")
    kept = np.trapezoid(run["z_e"], run["time"])  # up to the last row that was computed
    assert run.metrics["iae"] == pytest.approx(kept, rel=1e-12)
    assert any("warning[" in line for line in run.warnings)
    assert "diverged at t = 0.08 s" in run._repr_html_()
    assert "&lt;podusv run" in run._repr_html_()


def test_without_xarray_a_sentence_says_what_to_do(kept, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(
        ImportError, match=r"xarray is not installed: pip install 'podusv\[python\]'"
    ):
        _ = podusv.simulate(SHORT).log


def test_a_figure_shows_in_a_notebook(kept):
    figure = kept.plot("errors")
    assert isinstance(figure, Figure)
    png = figure._repr_png_()  # type: ignore[attr-defined]
    assert png.startswith(b"\x89PNG")
    with pytest.raises(UsageError, match=r"'error'.*'errors'"):
        kept.plot("error")
    with pytest.raises(UsageError, match=r"figure 'pods' shows .* and pid logged none of these"):
        kept.plot("pods")


def test_signals_are_drawn_over_time_one_a_panel(kept):
    axes = kept.plot("psi", "u").axes
    assert [axis.get_ylabel() for axis in axes] == [r"$\psi$ [rad]", "$u$ [m/s]"]
    (line,) = axes[1].get_lines()
    np.testing.assert_array_equal(line.get_ydata()[-1], kept["u"][-1])
    with pytest.raises(UsageError, match=r"'pssi'.*'psi'"):
        kept.plot("psi", "pssi")


def test_an_animation_is_a_page_with_the_run_s_positions(kept, tmp_path):
    played = kept.play()
    played.save(tmp_path / "chase.html")
    page = (tmp_path / "chase.html").read_text()
    (told,) = re.findall(r'<script type="application/json" id="chase-data">(.*?)</script>', page)
    assert json.loads(told)["runs"][0]["x"][-1] == pytest.approx(kept["x"][-1], abs=1e-3)
    assert 'type="range"' in page
    assert played._repr_html_().startswith('<iframe srcdoc="&lt;!doctype html&gt;')


# --- errors


def frames(error: BaseException) -> list[str]:
    return [Path(frame.filename).name for frame in traceback.extract_tb(error.__traceback__)]


def test_an_error_has_no_frames_of_podusv_but_its_border(kept):
    for wrong in (
        lambda: podusv.load({**SHORT, "strat": {}}),
        lambda: podusv.simulate_many(SHORT, {"start.z": [1.0]}),
        lambda: podusv.open_run("nowhere"),
        lambda: kept.plot("error"),
    ):
        with pytest.raises(podusv.PodusvError) as told:
            wrong()
        assert set(frames(told.value)) == {"test_interface.py", "border.py"}
        assert told.value.__cause__ is None
        assert told.value.__suppress_context__


def test_a_bug_and_an_interrupt_keep_their_frames(monkeypatch):
    for raised in (KeyboardInterrupt(), ZeroDivisionError()):

        def broken(*given, raised=raised):
            raise raised

        monkeypatch.setattr(functions, "_single", broken)
        with pytest.raises(type(raised)) as told:
            podusv.simulate(SHORT)
        assert "functions.py" in frames(told.value)


# --- comparisons


def test_a_comparison_has_table_claims_runs_and_figures():
    done = podusv.compare(TWO, {"claims": {"C1": CLAIM}}, out="both", figures=False)
    assert list(done.table) == list(done.runs) == ["stiff", "soft"]
    assert done.table.loc["iae", "stiff"] == done["stiff"].metrics["iae"]
    assert done.claims.loc["C1", "verdict"] == "reproduced"
    assert (done.failed, done.report) == ({}, done.folder / "report.html")
    assert done["soft"].folder == Path("both/soft")
    assert isinstance(done.plot("errors"), Figure)
    page = done._repr_html_()
    assert "stiff" in page
    assert page.count("<img ") == 1
    with pytest.raises(
        UsageError, match=r"both is a comparison; open one of its runs: both/stiff, b"
    ):
        podusv.open_run("both")
    assert podusv.open_run("both/soft").metrics["iae"] == done["soft"].metrics["iae"]


def test_scenarios_runs_and_folders_are_compared(kept):
    other = podusv.load(SHORT, {"controller.K_Pu": 5.0, "name": "soft"})
    done = podusv.compare([kept, other], figures=False)
    with pytest.raises(KeyError, match="unknown run 'nobody'"):
        done["nobody"]
    assert list(done.table) == ["run", "soft"]
    assert done["run"].folder == kept.folder
    assert done.folder.parent == Path("results/run-soft")
    again = podusv.compare([str(kept.folder), done.folder / "soft"], figures=False)
    assert again.table.loc["iae"].tolist() == done.table.loc["iae"].tolist()
    with pytest.raises(UsageError, match=r"^start\.x: "):
        podusv.compare(kept, {"start.x": 1.0})


def test_many_runs_are_the_rows_of_a_table():
    masses = np.array([20.0, 25.0])
    many = podusv.simulate_many(SHORT, {"vessel.m": masses}, workers=1)
    assert list(many["vessel.m"]) == [20.0, 25.0]
    assert set(many["status"]) == {"finished"}
    nominal = {"nominal": {"preset": "paper_nonlinear"}}
    for row, mass in enumerate(masses):
        alone = podusv.simulate({**SHORT, **nominal}, {"vessel.m": mass})
        assert many.loc[row, "iae"] == alone.metrics["iae"]


def test_verify_is_a_table_of_numbers():
    found = podusv.verify(SHORT, tolerance=1e-9)
    assert list(found) == ["value", "order", "relative_error", "converged"]
    assert found.loc[("pid", "iae"), "value"] == podusv.simulate(SHORT).metrics["iae"]
    assert not found["converged"].all()
    assert found["converged"].equals(found["relative_error"] <= 1e-9)


@pytest.mark.long
def test_the_example_in_the_documentation_runs(capsys):
    known: dict[str, Any] = {}
    for code in re.findall(
        r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(), re.DOTALL
    ):
        exec(code.replace('"draws": 200', '"draws": 2'), known)  # noqa: S102
    out = capsys.readouterr().out
    assert re.search(r"^soft +\d+\.\d+$", out, re.MULTILINE)
    assert len(known["study"].table) == 2


def test_the_documentation_names_all_that_there_is():
    text = (ROOT / "docs/python.md").read_text()
    for name in podusv.__all__:
        assert f"`{name}" in text
    for result in (podusv.Run, podusv.Comparison):
        public = {name for name in (*vars(result), *result.__dataclass_fields__) if name[0] != "_"}
        assert {name for name in public if f"`{name}" not in text} <= {
            "label",
            "recording",
            "numbers",
            "about",
            "given",
            "past",
        }


LAWS = BASE.replace(
    "controller: {kind: pid, K_Pu: 100.0}", "controllers: {soft: {kind: pid}, b: {kind: pid}}"
)


def test_a_scenario_without_a_chosen_law_is_not_run_as_the_first():
    assert LAWS != BASE
    for scenario in (
        podusv.load(write("laws.yaml", LAWS)),
        podusv.load("laws.yaml", {"name": "x"}),
    ):
        for again in (scenario, podusv.load(scenario, {"simulation.step": 0.02})):
            for use in (podusv.simulate, podusv.run, lambda one: podusv.simulate_many(one, {})):
                with pytest.raises(UsageError, match=r"several controllers.*singles\(\)\['soft'\]"):
                    use(again)
        assert podusv.simulate(scenario.singles()["b"]).status == "finished"
    chosen = write("chosen.yaml", LAWS + "controller: {kind: pid}\n")
    assert podusv.simulate(podusv.load(chosen)).label == "pid"


# --- podusv.simulate_many

REFUSED: list[tuple[Any, str]] = [
    ({"vessel.m": [20.0, -3.0]}, "row 1: vessel.m = -3; must be a number above 0 [kg]"),
    ({"start.x": [np.nan]}, "row 0: start.x = nan; must be a number [m]"),
    ({"vessel.m": ["20"]}, "vessel.m = 20; must be a number above 0 [kg]; leave out the quotes"),
    ({"controller.rate": ["exact"]}, "row 0: controller.rate = exact; must be analytic or diff"),
    ({"vessel.mass": [20.0]}, "vessel.mass: unknown key; did you mean 'vessel.m'? (allowed: "),
    ({"vesel.m": [20.0]}, "vesel.m: unknown key; did you mean 'vessel.m'? (allowed: "),
    ({"vessel..m": [20.0]}, "vessel..m: unknown key; did you mean 'vessel.m'?"),
    ({"": [20.0]}, ": unknown key"),
    ({"vessel": [20.0]}, "vessel: is a section; name one of the keys in it"),
    ({"simulation.step": [0.01]}, "simulation.step: simulation is the same in all runs of a batch"),
    ({"controller.kind": ["pid"]}, "controller.kind: is the same in all runs of a batch"),
    ({"vessel.m": 20.0}, "vessel.m: must be a list or array with one value a run, found 20.0"),
    ({"vessel.m": "heavy"}, "must be a list or array with one value a run, found 'heavy'"),
    ({"vessel.m": np.ones((2, 2))}, "one value a run, found an array of shape (2, 2)"),
    ({"vessel.m": [20.0], "start.x": [1.0, 2.0]}, "their lengths are {'vessel.m': 1, 'start.x'"),
    ({}, "no parameters: give a key and its values, as {'vessel.m': [20.0, 25.0]}"),
    (
        {"controller.anti_windup": ["none", "auxiliary"]},
        "row 1: controller.anti_windup = auxiliary changes how the loop is put together, and row 0 "
        "has controller.anti_windup = none; make a batch for each",
    ),
]


@pytest.mark.parametrize(("parameters", "text"), REFUSED)
def test_parameters_that_cannot_be_are_a_sentence(parameters: Any, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text)) as told:
        podusv.simulate_many(SHORT, parameters)
    assert "\n" not in str(told.value)


def test_a_negative_number_of_workers_is_a_sentence() -> None:
    with pytest.raises(ValueError, match=r"^workers = -1: must be 0 \(one a core\) or more$"):
        podusv.simulate_many(SHORT, {"vessel.m": [20.0]}, workers=-1)


def test_words_and_whole_numbers_give_what_each_run_gives_alone() -> None:
    scenario = podusv.load(
        SHORT,
        {"disturbance": {"kind": "current", "speed": 0.1, "speed_std": 0.05, "time_constant": 5.0}},
    )
    rows = {
        "controller.reference": ["path", "virtual_controls", "path"],
        "disturbance.seed": np.array([1.0, 2.0, 9.0]),
    }
    many = podusv.simulate_many(scenario, rows)
    assert list(many["controller.reference"]) == rows["controller.reference"]
    for row in range(3):
        own = {"controller.reference": rows["controller.reference"][row]}
        alone = podusv.simulate(scenario, {**own, "disturbance.seed": int(many.iloc[row, 1])})
        assert many.loc[row, "iae"] == alone.metrics["iae"]
    assert many["iae"].nunique() == 3


def test_a_table_may_be_the_parameters() -> None:
    table = pd.DataFrame({"vessel.m": [20, 25], "start.x": [-5.0, -6.0]})
    many = podusv.simulate_many(SHORT, table)
    pd.testing.assert_frame_equal(many[list(table)], table)


def test_whether_runs_march_side_by_side_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    real = batch.simulate_many

    def noted(*loops: Any, side_by_side: bool | None, **options: Any) -> batch.Batch:
        asked.append(side_by_side)
        return real(*loops, side_by_side=False, **options)

    monkeypatch.setattr(batch, "simulate_many", noted)
    for wanted in (None, True, False):
        podusv.simulate_many(SHORT, {"vessel.m": [20.0]}, side_by_side=wanted)
    podusv.simulate_many(SHORT, {"vessel.m": [20.0]})
    assert asked == [None, True, False, None]


WAVES = {**SHORT, "disturbance": {"kind": "waves", "height": 0.05, "period": 1.5}}


@pytest.mark.parametrize("given", [[0, 1], [1, 0], [0, 0, 2], [1, 2, 0]])
def test_numbers_that_change_how_the_loop_is_put_together_are_refused_as_a_study_does(given):
    """Waves without spreading come from one direction, and have another kernel."""
    with pytest.raises(ValueError, match=r"spreading = \d changes how the loop is put together"):
        podusv.simulate_many(WAVES, {"disturbance.spreading": given})
    drawn = {"draws": 4, "vary": {"disturbance.spreading": {"integers": [0, 2]}}}
    with pytest.raises(ScenarioError, match="changes how the loop is put together"):
        podusv.sweep(WAVES, {"sweep": drawn}, out="study", figures=False)


def test_numbers_that_leave_it_as_it_is_are_run():
    runs = podusv.simulate_many(WAVES, {"disturbance.spreading": [1, 2]})
    assert set(runs["status"]) == {"finished"}
