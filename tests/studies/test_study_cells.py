"""The cells of a study's grid, and what layers of a scenario make of its sweep."""

from __future__ import annotations

from pathlib import Path

from command_samples import ROOT
from test_sweep_checking import BASE, swept, vary

from podusv_cli.scenario.distributions import Distribution
from podusv_cli.scenario.load import load, load_text, tree_yaml
from podusv_cli.scenario.sweep import Quantity
from podusv_cli.studies.making.cells import cells
from podusv_cli.studies.making.check import sweep_faults


def test_cells_are_all_combinations_and_count_as_if_written_in_the_file() -> None:
    grid = "  grid: {vessel.m: [20.0, 30.0], path: [{kind: line}, {kind: circle, radius: 9.0}]}\n"
    made = cells(swept(grid), sweep_faults)
    assert [cell.index for cell in made] == [0, 1, 2, 3]
    assert made[3].label == 'vessel.m = 30.0, path = {"kind": "circle", "radius": 9.0}'
    assert dict(made[3].values) == {"vessel.m": 30.0, "path": {"kind": "circle", "radius": 9.0}}
    found = [(cell.scenario.vessel.m, cell.scenario.path.kind) for cell in made]
    assert found == [(20.0, "line"), (20.0, "circle"), (30.0, "line"), (30.0, "circle")]
    assert made[2].scenario.nominal.m == 30.0  # as if it stood in the file
    laws = "  grid: {controller.k_ze: [0.3], controllers.pid.K_Iu: [0.0]}\n"
    (one,) = cells(swept(laws))
    assert [law.k_ze for law in one.scenario.controllers.values()] == [0.3, 0.3]
    assert one.scenario.singles()["pid"].controller.K_Iu == 0.0
    assert [cell.label for cell in cells(swept("  {}\n"))] == [""]


def test_a_scenario_written_as_one_file_changes_like_the_given_one(tmp_path: Path) -> None:
    """Its cells are the same: what is filled in is not written, what is read from files is."""
    (tmp_path / "track.csv").write_text("x,y\n0,0\n9,3\n")
    path = "path: {kind: waypoints, file: track.csv}\n"
    grid = "vessel.m: [20.0], controller.k_ze: [0.3], vessel.preset: [paper, cybership2]"
    text = BASE.replace("path: {kind: line_circle}\n", path)
    (tmp_path / "a.yaml").write_text(f"{text}  grid: {{{grid}}}\n")
    given = load(tmp_path / "a.yaml", ["controllers.soft.k_psie=0.2", "path.speed=0.4"])
    kept = load_text(tree_yaml(given), "elsewhere/scenario.yaml")
    assert kept.scenario == given.scenario
    assert [cell.scenario for cell in cells(kept)] == [cell.scenario for cell in cells(given)]
    for file in ("mu_2017/corrected_compare", "pod/kept", "own_vessel"):
        given = load(ROOT / "configs" / f"{file}.yaml")
        assert load_text(tree_yaml(given), "scenario.yaml").scenario == given.scenario


def test_a_layer_above_replaces_distributions_and_takes_out_quantities() -> None:
    below = vary(
        "vessel.m: {times: {uniform: [1, 2]}}, start.x: {angle: all}, start.y: {seed: true}"
    )
    layers = [
        "sweep.vary.vessel.m.times.normal={sigma: 0.1}",
        "sweep.vary.start.x=null",
        "sweep.vary={start.y: {uniform: [0, 1]}}",
        "sweep.draws=7",
        "sweep.grid.disturbance.scale=[0.5, 2]",
    ]
    sweep = swept(below, layers).scenario.sweep
    assert sweep is not None
    assert list(sweep.vary) == ["vessel.m", "start.y"]
    assert sweep.vary["vessel.m"].times == Distribution.model_validate({"normal": {"sigma": 0.1}})
    assert sweep.vary["start.y"] == Quantity(uniform=(0.0, 1.0))
    assert (sweep.draws, sweep.grid) == (7, {"disturbance.scale": (0.5, 2)})
    assert swept(below, ["sweep=null"]).scenario.sweep is None


def test_a_grid_from_the_command_line_leaves_the_name_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(BASE + "  {draws: 2, vary: {start.x: {uniform: [0, 1]}}}\n", "utf-8")
    made = cells(load(file, ["sweep.grid={vessel.m: [20.0, 30.0]}"]))
    assert [cell.scenario.name for cell in made] == ["mine", "mine"]
    assert [cell.scenario.vessel.m for cell in made] == [20.0, 30.0]
