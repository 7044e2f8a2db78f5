"""`podusv runs`: what is below a folder, by small files, whatever is in them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from command_samples import Command

import podusv as podusv_python
from podusv_cli.workflows import runs

SWEEP = {"draws": 2, "seed": 1, "vary": {"start.x": {"uniform": [-6.0, -4.0]}}}
SHORT = {"simulation.duration": 1.0}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs of other masses, a study and a damaged run in folders of their own."""
    source, made = "podusv:own_vessel.yaml", tmp_path_factory.mktemp("made")
    for mass in (50.0, 60.0, 70.0):
        changes, out = {**SHORT, "vessel.m": mass}, made / f"m/{mass:g}"
        podusv_python.run(source, changes, out=out, figures=False)
    podusv_python.sweep(source, {**SHORT, "sweep": SWEEP}, out=made / "s", figures=False)
    (made / "m/70/manifest.json").write_text("{")
    return made


@pytest.fixture
def results(podusv: Command, made: Path) -> Path:
    """These, for a test to change."""
    return shutil.copytree(made, Path("r"))


def listed(podusv: Command, *words: str) -> list[list[str]]:
    said = podusv("runs", "r", *words)
    assert (said.code, said.err) == (0, "")
    return [line.split() for line in said.out.splitlines()[1:]]


def test_a_line_each_the_latest_first_with_what_it_is(podusv: Command, results: Path) -> None:
    told = json.loads(podusv("runs", "r", "--json").out)["runs"]
    kinds = {run["folder"]: (run["kind"], run["status"], run["laws"]) for run in told}
    assert kinds == {
        "r/s": ("study", "finished", ["pid"]),
        "r/m/60": ("run", "finished", ["pid"]),
        "r/m/50": ("run", "finished", ["pid"]),
        "r/m/70": ("run", "damaged", []),
    }
    assert told[0]["folder"] == "r/s"
    origin = json.loads(Path("r/m/60/provenance.json").read_text())
    assert (told[1]["seconds"], told[1]["started"]) == (origin["duration_s"], origin["started"])
    assert told[1]["metrics"]["iae"] == podusv_python.open_run("r/m/60").metrics["iae"]


def test_runs_are_chosen_by_their_scenario_and_sorted_by_a_metric(
    podusv: Command, results: Path
) -> None:
    found = runs.runs(results, ["vessel.m=60"])
    assert [str(one.folder) for one in found] == ["r/s", "r/m/60"]
    energies = [run.metrics["energy"] for run in runs.runs(results, [], "energy")[:2]]
    assert energies == sorted(energies)
    rows = listed(podusv, "--sort", "energy", "--where", "controller.kind=pid")
    assert [float(row[-2]) for row in rows] == pytest.approx(energies, rel=1e-4)


def test_numbers_of_where_are_those_of_scenarios(results: Path) -> None:
    assert len(runs.runs(results, ["simulation.duration=1e0"])) == 3


DAMAGE = {
    "metrics.json": ['{"metrics": {"iae": "x"}}', '{"metrics": []}', "[]", "{", '{"name": 1}'],
    "manifest.json": ["null", '{"status": 3}'],
    "provenance.json": ['{"duration_s": "long"}', '{"sittings": [1]}', '{"started": null}'],
}


@pytest.mark.parametrize(
    ("name", "text"), [(n, text) for n, each in DAMAGE.items() for text in each]
)
def test_a_damaged_file_is_told_as_such(name: str, text: str, podusv: Command) -> None:
    podusv_python.run("podusv:own_vessel.yaml", SHORT, out="r/m", figures=False)
    Path("r/m", name).write_text(text)
    (row,) = listed(podusv)
    assert "damaged" in row


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("nowhere",), "nowhere is no folder; name the folder of your results: podusv runs"),
        (("r", "--sort", "enrgy"), "unknown metric 'enrgy'; did you mean 'energy'?"),
        (("r", "--where", "vessel.mm=1"), "unknown key 'vessel.mm'; did you mean 'vessel.m'?"),
        (("r", "--where", "vessel.m"), "write key=value"),
        (("r", "--where", "vessel.m=["), "write key=value"),
        (("r/s", "--sort", "iae"), "only runs have metrics"),
    ],
)
def test_what_cannot_be_is_a_sentence(
    words: tuple[str, ...], why: str, podusv: Command, results: Path
) -> None:
    said = podusv("runs", *words)
    assert said.code == 2
    assert why in " ".join(said.err.split())


def test_nothing_is_executed_and_no_link_followed(podusv: Command, results: Path) -> None:
    (results / "m/50/resolved.yaml").write_text("!!python/object/apply:os.mkdir [hacked]\n")
    (results / "loop").symlink_to(results.resolve())
    assert len(listed(podusv)) == 4
    assert len(runs.runs(results, ["vessel.m=60"])) == 2
    assert not Path("hacked").exists()


def test_a_run_says_that_claims_are_for_compare(podusv):
    claims = "claims: {good: {says: It is., expect: pid.iae >= 0}}\n"
    Path("c.yaml").write_text(f"extends: a.yaml\n{claims}")
    said = podusv("run", "c.yaml", "--no-figures")
    assert "1 claim is not judged by one run; `podusv compare` judges them" in said.err
    assert "claim" not in podusv("run", "a.yaml", "--no-figures").err
