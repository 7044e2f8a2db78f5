"""Hulls that are drawn jointly, a row of a table each, as `podusv identify` leaves them."""

import json
import shutil
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from command_samples import Command
from scenario_samples import write

import podusv
from podusv_cli.core.errors import ScenarioError, StorageError
from podusv_cli.doubt.check import doubt_faults
from podusv_cli.scenario.load import Loaded, load, load_stored, tree_yaml
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.sweep import Quantity
from podusv_cli.studies.making.check import singles, sweep_faults
from podusv_cli.studies.making.draws import draw_scenario, draws

NAMES = ("X_u", "Y_vdot", "N_r", "N_rv")
HULLS = np.array(
    [[-0.61, -11.3, -1.87, 0.0], [-0.93, -9.7, -1.41, 0.13], [-0.72, -10.9, -2.23, -0.21]]
)
TASK = """
vessel: {preset: cybership2}
path: {kind: line, speed: 0.17}
disturbance: {kind: none}
actuator: {kind: ideal}
controller: {kind: pid}
simulation: {duration: 2.3, step: 0.1}
sweep: {draws: 12, seed: 5, vary: {vessel: {identified: found}}}
"""


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found()
    write("task.yaml", TASK)


def found(names: Sequence[str] = NAMES, hulls: object = HULLS) -> None:
    """A folder as `podusv identify` leaves it, as far as draws read it."""
    Path("found").mkdir(exist_ok=True)
    write("found/manifest.json", "{}")
    lines = [",".join(map(str, row)) for row in np.array(hulls).tolist()]
    write("found/posterior.csv", "\n".join([",".join(names), *lines, ""]))


def study(*overrides: str) -> Loaded:
    return load("task.yaml", overrides)


def vary(loaded: Loaded) -> dict[str, Quantity]:
    assert loaded.scenario.sweep
    return loaded.scenario.sweep.vary


def hull(scenario: Scenario) -> list[float]:
    return [getattr(scenario.vessel, name) for name in NAMES]


def hulls(loaded: Loaded, first: int, count: int) -> list[list[float]]:
    (single,) = singles(loaded.scenario).values()
    sweep = loaded.scenario.sweep
    assert sweep
    return [hull(draw_scenario(single, sweep.vary, draw)) for draw in draws(sweep, first, count)]


def test_a_draw_is_one_row_whole_by_its_position_alone():
    """As numpy's own Philox has it: the row is the word's place among equal parts of (0, 1)."""
    key = int.from_bytes(
        sha256(json.dumps([5, "sweep", "vessel"]).encode()).digest()[:16], "little"
    )
    raw = [int(np.random.Philox(key=key).advance(i).random_raw()) for i in range(30)]
    rows = [int((word >> 12) / 2.0**52 * len(HULLS)) for word in raw]
    assert hulls(study(), 0, 30) == [HULLS[row].tolist() for row in rows]
    assert set(rows) == {0, 1, 2}
    assert hulls(study("sweep.draws=500"), 17, 4) == hulls(study(), 0, 30)[17:21]


def test_laws_are_told_the_scenario_s_own_hull():
    loaded = study("nominal={preset: cybership2, m: 27.5}")
    (single,) = singles(loaded.scenario).values()
    for draw in draws(loaded.scenario.sweep, 0, 6):
        world = draw_scenario(single, vary(loaded), draw)
        assert hull(world) != hull(single)
        assert world.nominal == single.nominal
        others = [v.model_dump(exclude={*NAMES}) for v in (world.vessel, single.vessel)]
        assert others[0] == others[1]


def test_with_keys_several_sections_get_the_same_row():
    loaded = study("sweep.vary={vessel: null, hull: {identified: found, keys: [vessel, nominal]}}")
    assert not sweep_faults(loaded)
    (single,) = singles(loaded.scenario).values()
    for draw in draws(loaded.scenario.sweep, 0, 6):
        world = draw_scenario(single, vary(loaded), draw)
        assert hull(world) == HULLS[draw["hull"]].tolist()
        assert hull(world) == [getattr(world.nominal, name) for name in NAMES]


def test_the_rows_are_in_what_is_kept():
    given = study()
    texts = resolved_yaml(given.scenario), tree_yaml(given)
    shutil.rmtree("found")
    for text in texts:
        assert load_stored(text, "task.yaml").scenario == given.scenario
    named = texts[0].replace("identified: null", "identified: found").replace("rows: ", "# rows: ")
    with pytest.raises(StorageError, match="identified: refers to another file"):
        load_stored(named, "task.yaml")


def test_a_study_is_complete_in_itself(podusv: Command, tmp_path: Path):
    podusv("sweep", "run", "task.yaml", "--out", "first", "--no-figures")
    shutil.rmtree("found")
    study = json.loads(Path("first/study.json").read_text())
    assert study["quantities"]["vessel"]["keys"] == [f"vessel.{name}" for name in NAMES]
    podusv("sweep", "run", "first", "--set", "sweep.draws=19", "--no-figures")
    found()
    podusv(
        "sweep", "run", "task.yaml", "--set", "sweep.draws=19", "--out", "second", "--no-figures"
    )
    assert Path("first/runs.h5").read_bytes() == Path("second/runs.h5").read_bytes()


def test_a_run_of_a_study_is_a_run_of_that_hull():
    result = podusv.sweep("task.yaml", out="study", figures=False)
    nominal = podusv.load("task.yaml").nominal.model_dump()
    for row in result.table.to_dict("records")[:4]:
        own = dict(zip(NAMES, HULLS[int(row["vessel"])].tolist(), strict=True))
        changes = {"vessel": {"preset": "cybership2", **own}, "nominal": nominal, "sweep": None}
        assert podusv.simulate("task.yaml", changes).metrics["iae"] == row["iae"]


def test_an_environment_begins_on_a_drawn_hull():
    """Half a second straight on, by hand: (m - X_udot) u' = tau_u + X_u u is all there is."""
    gym = pytest.importorskip("podusv.gym")
    env = gym.Env("task.yaml", limits=(2.0, 1.0), period=0.1)
    for seed in range(4):
        env.reset(seed=seed)
        (row,) = (draw["vessel"] for draw in draws(study().scenario.sweep, seed, 1))
        hull, u = study().scenario.vessel, 0.0
        for _ in range(5):
            seen, *_ = env.step(np.array([1.3, 0.0]))
        mass, damping = hull.m - hull.X_udot, [HULLS[row][0], hull.X_uu, hull.X_uuu]
        for _ in range(5000):
            u += 1e-4 * (1.3 + damping[0] * u + damping[1] * u * u + damping[2] * u**3) / mass
        assert seen[2] == pytest.approx(u, rel=1e-3)


NOT_ABOVE = "row 3 of 3: vessel.X_u = 0.72; must be a number not above 0 [kg/s]"
INDEFINITE = "row 2 of 2: vessel: the mass matrix is not positive definite"


@pytest.mark.parametrize(
    ("names", "hulls", "says"),
    [
        (("X_u", "X_q"), [[-1, -2], [-2, -3]], "unknown key 'vessel.X_q'"),
        (NAMES, HULLS * [[1], [1], [-1]], NOT_ABOVE),
        (("Y_vdot",), [[-10.0], [900.0]], INDEFINITE),
        (NAMES, HULLS[:1], "rows: has a single line of numbers; nothing can be drawn from it"),
        (("1", "2"), [[1, 2], [2, 3]], "`rows` has no first line that names the columns"),
        (("X_u", "X_u"), [[-1, -2], [-2, -3]], "line 1 of `rows` names 'X_u' twice"),
    ],
)
def test_what_is_wrong_with_the_hulls_is_one_sentence(names, hulls, says):
    found(names, hulls)
    with pytest.raises(ScenarioError) as caught:
        load("task.yaml", checks=(sweep_faults,))
    (sentence,) = str(caught.value).splitlines()
    assert says in sentence
    assert "sweep.vary.vessel: " in sentence


def test_what_is_wrong_with_the_folder_is_one_sentence():
    def told(*overrides: str) -> str:
        with pytest.raises(ScenarioError) as caught:
            load("task.yaml", overrides, (sweep_faults, doubt_faults))
        return str(caught.value)

    nowhere = told("sweep.vary.vessel.identified=nowhere")
    assert "the folder nowhere is not there, or not finished; podusv identify makes it" in nowhere
    assert "found 3" in told("sweep.vary.vessel.identified=3")
    assert "found seed and rows" in told("sweep.vary.vessel={identified: found, seed: true}")
    assert "unknown key 'hull.X_u'" in told("sweep.vary={vessel: null, hull: {identified: found}}")
    assert "vessel.X_u is drawn twice" in told("sweep.vary.vessel.X_u={uniform: [-2, -1]}")
    assert "is under grid, too" in told("sweep.grid.vessel.N_r=[-1, -2]")
    claims = "sweep.claims={c: {says: It ends., expect: fraction(finished) >= 0.5}}"
    of_study = told(claims, "doubt.vary={vessel: {identified: found}}")
    assert "doubt.vary.vessel: a study draws rows itself: write this under sweep.vary" in of_study
    Path("found/posterior.csv").unlink()
    assert "the folder found has no posterior.csv; podusv identify makes it, of a hull" in told()
