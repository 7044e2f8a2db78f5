"""The key `sweep`: mistakes are told at their place, cells are made, invalid runs are counted."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from command_samples import Command
from small_study import TEXT

from podusv_cli.core.errors import ScenarioError
from podusv_cli.scenario.address import ValueRefused
from podusv_cli.scenario.explain import explain
from podusv_cli.scenario.load import Loaded, load_text
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.sweep import Quantity
from podusv_cli.scenario.yaml_tree import DISTRIBUTIONS, QUANTITY
from podusv_cli.studies.making.cells import MOST, cells
from podusv_cli.studies.making.check import singles, sweep_faults
from podusv_cli.studies.making.draws import draw_scenario, draws
from podusv_cli.studies.making.invalid import invalid_runs

ROOT = Path(__file__).parents[2]
BASE = """\
vessel: {preset: paper_nonlinear}
path: {kind: line_circle}
disturbance: {kind: harmonic}
actuator: {kind: saturated, surge_limit: 8.0, yaw_limit: 2.5}
controller: {kind: adaptive_neural}
controllers: {soft: {}, pid: {kind: pid}}
sweep:
"""


def swept(text: str, overrides: Sequence[str] = ()) -> Loaded:
    return load_text(BASE + text, "a.yaml", overrides, [sweep_faults])


def told(text: str, overrides: Sequence[str] = ()) -> list[str]:
    """What is wrong with a sweep, a line each; its first line is line 8."""
    try:
        cells(swept(text, overrides), sweep_faults)
    except ScenarioError as error:
        return str(error).splitlines()
    return []


def vary(text: str) -> str:
    return f"  vary: {{{text}}}\n"


# What is written under `vary`, with @ where the fault is, and what is said.
IN_VARY = [
    ("vessel.mm: @{angle: all}", "unknown key 'vessel.mm'; did you mean 'vessel.m'?"),
    ("vesel.m: @{angle: all}", "unknown key 'vesel.m'; did you mean 'vessel.m'?"),
    (
        "hull: @{times: {uniform: [1, 2]}}",
        "'hull'; a quantity with a name of your own needs `keys`",
    ),
    (
        "actuator.command.delay: @{angle: all}",
        "write this section first, as in actuator.command: {",
    ),
    ("actuator.command.wait: @{angle: all}", "unknown key 'actuator.command.wait'"),
    ("vessel: @{angle: all}", "vessel is no number but a section"),
    ("path.points: @{angle: all}", "unknown key 'path.points'"),
    ("vessel.source: @{choice: [me]}", "vessel.source is no number but \"The paper's"),
    ("vessel.preset: @{choice: [paper]}", "cannot change vessel.preset; list its values under"),
    ("disturbance.kind: @{choice: [none]}", "cannot change disturbance.kind"),
    ("simulation.step: @{uniform: [0.01, 0.02]}", "simulation is the same for all runs of a cell"),
    ("controllers.pid.K_Pu: @{angle: all}", "controllers is the same for all runs of a cell"),
    ("actuator: @{angle: all}", "actuator is no number but a section"),
    ("controller.network: @{angle: all}", "is no key of pid; name the laws that have it, soft, in"),
    ("path.reading: @{times: {uniform: [1, 2]}}", "times needs a number, and path.reading is one"),
    ("path.reading: @{uniform: [1, 2]}", "uniform needs a number"),
    ("path.reading: @{choice: [velocity, fast]}", "path.reading = fast; must be literal,"),
    ("vessel.m: @{choice: [20, heavy]}", "vessel.m = heavy; must be a number above 0 [kg]"),
    ("vessel.m: @{choice: [20, '\u202e']}", r"vessel.m = \u202e; must be a number above 0 [kg]"),
    ("vessel.m: @{uniform: [-3, -2]}", "must be a number above 0 [kg]"),
    ("vessel.m: @{times: {choice: [1, big]}}", "times: needs numbers, choice has 'big'"),
    ("vessel.m: @{choice: []}", "choice: is empty"),
    ("vessel.m: @{uniform: [2, 1]}", "uniform: 2 is not below 1"),
    ("vessel.m: {uniform: @[1]}", "vessel.m.uniform: must be a list of 2 numbers"),
    ("vessel.m: {normal: {sigma: @0}}", "sweep.vary.vessel.m.normal.sigma: must be a number above"),
    ("vessel.m: {normal: @{sigma: 1, within: [8, 9]}}", "within: [8.0, 9.0] excludes all but"),
    ("vessel.m: {@unifrom: [1, 2]}", "unknown key; did you mean 'uniform'?"),
    ("vessel.m: @{}", "must have one of uniform, normal, lognormal"),
    ("vessel.m: @{seed: true, angle: all}", "found angle and seed"),
    ("vessel.m: @3", "must be a mapping of keys: uniform, normal"),
    (
        "vessel.m: @{seed: true}",
        "vessel.m cannot be drawn as a seed, since it is not a whole number",
    ),
    ("a: @{keys: [vessel.m, start.x], angle: all}, start.x: {angle: all}", "drawn twice, by start"),
    ("a: @{keys: [start.x, start.x], angle: all}", "start.x is drawn twice"),
    ('a: @{keys: [""], angle: all}', "unknown key ''"),
    ("law: @{keys: [start.x], angle: all}", "law is another column of the table of runs"),
    ("success: @{keys: [start.x], angle: all}", "name the quantity success_drawn"),
    ("iae: @{keys: [start.x], angle: all}", "iae is another column of the table of runs"),
    ('"": @{keys: [start.x], angle: all}', "the name of a quantity with `keys` is at most 64"),
    (".: @{keys: [start.x], angle: all}", "the name of a quantity with `keys` is at most 64"),
    ("/law: @{keys: [start.x], angle: all}", "the name of a quantity with `keys` is at most 64"),
    ("x/y: @{keys: [start.x], angle: all}", "the name of a quantity with `keys` is at most 64"),
    ("start.y: @{keys: [start.x], angle: all}", "the name of a quantity with `keys` is at most"),
]
ELSEWHERE = [
    ("laws: [soft, @pidd]", "sweep.laws[1]: unknown law 'pidd'; did you mean 'pid'?"),
    ("laws: [pid, @pid]", "sweep.laws[1]: pid is named twice"),
    ("draws: @0", "sweep.draws: must be a whole number not below 1"),
    ("level: @1", "sweep.level: must be a number above 0.5 and below 1"),
    ("level: @0.5", "sweep.level: must be a number above 0.5 and below 1"),
    ("seed: @-1", "sweep.seed: must be a whole number not below 0"),
    ("design: @latin", "sweep.design: must be random or sobol"),
    ("keep: {worst: {iaee: @1}}", "keep.worst.iaee: unknown metric 'iaee'; did you mean 'iae"),
    ("keep: {worst: {law_ns: @1}}", "keep.worst.law_ns: unknown metric"),
    ("keep: {draws: [0, @1000]}", "sweep.keep.draws[1]: there is no draw 1000; they are 0 to 999"),
    ("success: @finishd", "sweep.success: unknown property 'finishd'; did you mean 'finished'?"),
    ("claims: {S1: {says: a, source: b, expect: @share(a.iae < 1) > 0}}", "unknown law 'a'"),
    ("claims: {1S: @{says: a, source: b, expect: failures(pid) < 1}}", "a claim's name is at"),
    ("grid: {@start.x: []}", "sweep.grid.start.x: is empty"),
    ("grid: {@sweep.draws: [1]}", "sweep.grid.sweep.draws: cannot differ between cells"),
    ("grid: {start.x: @1}", "sweep.grid.start.x: must be a list"),
    ("grid: {start.x: [1, @north]}", "start.x: must be a number [m], found 'north'"),
    ("grid: {strat.x: [@1]}", "unknown key; did you mean 'start'?"),
    ("tune: @3", "sweep.tune: unknown key"),
]


def at_mark(text: str) -> tuple[str, str]:
    """The text without @, and what a message about that place starts with."""
    column = text.index("@") + 1
    return text.replace("@", ""), f"a.yaml:8:{column}: "


@pytest.mark.parametrize(("text", "words"), IN_VARY)
def test_a_mistake_in_vary_is_told_at_its_place(text: str, words: str) -> None:
    text, place = at_mark(vary(text))
    (line,) = told(text)[:1]
    assert line.startswith(f"{place}sweep.vary.")
    assert words in line


@pytest.mark.parametrize(("text", "words"), ELSEWHERE)
def test_a_mistake_is_told_at_its_place(text: str, words: str) -> None:
    text, place = at_mark(f"  {text}\n")
    place = place if "tune" not in text and "strat" not in text else "a.yaml:8:"
    (line,) = told(text)[:1]
    assert line.startswith(place)
    assert words in line


def test_a_mistake_in_one_cell_names_the_cell() -> None:
    (line,) = told(
        vary("path.amplitude: {uniform: [0, 1]}") + "  grid: {path.kind: [line_circle, line]}\n"
    )
    assert line.endswith("unknown key 'path.amplitude' (in the cell path.kind = line)")


def test_a_grid_has_a_limit() -> None:
    numbers = f"[{', '.join(['1'] * 40)}]"
    (line,) = told(f"  grid: {{start.x: {numbers}, start.y: {numbers}}}\n")
    assert line == f"a.yaml:8:3: sweep.grid: has 1,600 combinations, at most {MOST:,} are allowed"


def test_a_key_is_drawn_or_in_the_grid() -> None:
    (line,) = told(vary("start.x: {angle: all}") + "  grid: {start.x: [1]}\n")
    assert "start.x is under grid, too" in line


@pytest.mark.parametrize(
    "text",
    [
        "{}\n",
        vary("vessel.m: {times: {normal: {mean: 1, sigma: 5}}}"),  # some draws can be taken
        vary("path.reading: {choice: [velocity, sine]}"),
        vary("controller.k_ze: {uniform: [0.1, 0.2]}"),
        vary("controller.K_Pu: {times: {choice: [1, 2]}}") + "  laws: [pid]\n",
        vary("nominal.m: {plus: {integers: [-1, 1]}}"),
    ],
)
def test_what_is_sound_is_taken(text: str) -> None:
    assert told("  draws: 3\n" + text if text[0] == " " else f"  {text}") == []


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("controller.rate", "{choice: [analytic, difference]}"),
        ("controller.difference_step", "{choice: [0.01, 0.02]}"),
        ("'controller.network.nodes[0]'", "{integers: [2, 4]}"),
    ],
)
def test_what_changes_the_structure_of_the_loop_belongs_in_the_grid(key: str, values: str) -> None:
    text = BASE.replace("{kind: adaptive_neural}", "{kind: adaptive_neural, rate: difference}")
    text = text.replace(", rate: difference", "" if key.endswith("rate") else ", rate: difference")
    with pytest.raises(ScenarioError, match="changes how the loop is put together or sampled"):
        load_text(f"{text}  laws: [soft]\n{vary(f'{key}: {values}')}", "a.yaml", (), [sweep_faults])


def test_only_who_asks_for_the_study_is_told_of_keys() -> None:
    """`run`, `compare`, `plot` and `verify` ignore the sweep."""
    scenario = load_text(BASE + vary("vessel.mm: {angle: all}"), "a.yaml").scenario
    for single in (*scenario.singles().values(), scenario.alone()):
        assert single.sweep is None
        assert "sweep" not in resolved_yaml(single)


def test_the_loader_knows_all_ways_to_draw() -> None:
    assert {*Quantity.model_fields} == QUANTITY
    assert QUANTITY - {"keys"} == DISTRIBUTIONS


INVALID = [
    vary("vessel.m: {times: {normal: {mean: 1, sigma: 1}}}, start.x: {angle: all}"),
    vary("vessel.x_g: {plus: {normal: {sigma: 0.5}}}"),  # the mass matrix, no range
    vary("disturbance.b_u.sin_rate: {plus: {normal: {sigma: 0.2}}}, vessel.m: {choice: [1, 2.5]}"),
    vary("disturbance.b_r.sin_phase: {normal: {sigma: 1e6}}"),
    vary("d: {keys: [vessel.X_u, vessel.N_r, actuator.surge_limit], plus: {normal: {sigma: 3}}}"),
    vary("controller.k_psie: {normal: {mean: 1e-3, sigma: 0.01}}"),
    vary("start.x: {uniform: [-1, 1]}"),
]


@pytest.mark.parametrize("text", INVALID)
def test_all_draws_that_a_run_could_not_take_are_counted(text: str) -> None:
    loaded = swept("  draws: 60\n" + text)
    sweep = loaded.scenario.sweep
    assert sweep is not None
    laws = list(singles(loaded.scenario).values())
    reasons: list[tuple[int, str]] = []
    for i, draw in enumerate(draws(sweep, 0, 60)):
        for law in laws:
            try:
                draw_scenario(law, sweep.vary, draw)
            except ValueRefused as error:
                reasons.append((i, str(error)))
    found = invalid_runs(laws, sweep)
    assert (found.count, found.tried, found.wanted) == (len(reasons), 60 * len(laws), found.tried)
    assert (0 < found.count < found.tried) == (text != INVALID[-1])
    if reasons:
        assert (found.first, found.reason) == reasons[0]


@pytest.mark.parametrize("design", ["random", "sobol"])
def test_a_study_of_many_laws_and_cells_is_tried_over_many_draws(design: str) -> None:
    """One mass in 200 is below zero; of 20 draws in 100 cells, 90 % of the seeds find none."""
    range_ = "{uniform: [-1.0, 199.0]}"
    loaded = swept(f"  draws: 1000\n  design: {design}\n" + vary(f"vessel.m: {range_}"))
    sweep = loaded.scenario.sweep
    assert sweep is not None
    found = invalid_runs(list(singles(loaded.scenario).values()) * 50, sweep)
    assert (found.tried, found.wanted) == (2000, 100_000)
    masses = [float(draw["vessel.m"]) for draw in draws(sweep, 0, 1000)]
    assert found.count == 2 * sum(m <= 0 for m in masses) > 0


def test_laws_that_are_tried_in_turn_meet_both_halves_of_a_quantity() -> None:
    """The light hull has no mass left in a quarter of all draws; it is tried in about 64.

    Every fourth of scipy's Sobol' points is in the same half of a quantity.
    """
    text = "  draws: 256\n  design: sobol\n" + vary("vessel.m: {plus: {uniform: [-20, 20]}}")
    heavy, light = (
        load_text(BASE + text, "a.yaml", [f"vessel.m={m}"]).scenario.singles()["pid"]
        for m in (100, 10)
    )
    sweep = swept(text).scenario.sweep
    assert sweep is not None
    assert 6 < invalid_runs([heavy, heavy, heavy, light], sweep, 256).count < 27


@pytest.mark.slow
def test_validate_tells_the_size_of_the_study(podusv: Command, tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    grid = "  draws: 1500\n  grid: {disturbance.scale: [0.5, 1, 2]}\n"
    file.write_text(BASE + grid + vary("vessel.m: {times: {normal: {mean: 1, sigma: 1}}}"))
    done = podusv("validate", str(file))
    assert done.code == 0
    assert "runs of the study: 9,000 (laws: 2, cells: 3, draws: 1,500)\n" in done.out
    share = r"invalid runs: \d+ of 1,500 tried \(1\d\.\d\d%\), of 9,000; draw \d+: "
    share += "sweep.vary.vessel.m: "
    assert re.search(share + r"vessel.m = -\d.*; must be a number above 0 \[kg\]", done.out)
    file.write_text(BASE + vary("vessel.mm: {angle: all}"))
    assert podusv("validate", str(file)).code == 2


def test_explain_and_the_messages_name_what_a_quantity_may_be() -> None:
    rows = {row.key: row for row in explain("sweep.vary")}
    assert rows["sweep.vary"].meaning.startswith("what is drawn, by key")
    assert rows["sweep.vary.NAME.uniform"].meaning.startswith("[low, high]")
    assert explain("sweep.vary.vessel.m.normal.sigma")[0].meaning.startswith("its standard")
    assert explain("sweep.vary.actuator.pods[0].x")[0].type == "keys"
    (row,) = explain("sweep.level")
    assert (row.range, row.default) == ("> 0.5, < 1", "0.95")


def test_a_quantity_of_one_of_several_disturbances():
    """It is drawn, checked against its range, and leaves the others as they are."""
    several = BASE.replace("{kind: harmonic}", "[{kind: step}, {kind: current, speed: 0.5}]")
    sweep = '  draws: 5\n  vary: {flow: {keys: ["disturbance[1].speed"], uniform: [%s, %s]}}\n'
    scenario = load_text(several + sweep % (0.1, 1), "a.yaml", checks=[sweep_faults]).scenario
    each = [
        draw_scenario(scenario, scenario.sweep.vary, draw) for draw in draws(scenario.sweep, 0, 5)
    ]
    speeds = [run.disturbance[1].speed for run in each]
    assert len(set(speeds)) == 5
    assert all(0.1 < speed < 1.0 for speed in speeds)
    assert {run.disturbance[0] for run in each} == {scenario.disturbance[0]}
    with pytest.raises(ScenarioError, match=re.escape("disturbance[1].speed")):
        load_text(several + sweep % (-2, -1), "a.yaml", checks=[sweep_faults])
    other = sweep.replace("disturbance[1]", "disturbance.1")
    same = load_text(several + other % (0.1, 1), "a.yaml", checks=[sweep_faults]).scenario
    assert same.sweep == scenario.sweep


def test_a_seed_that_is_drawn_as_another_number_is_told_how_to_draw_it():
    several = BASE.replace("{kind: harmonic}", "{kind: current, speed: 0.5}")
    text = several + "  vary: {disturbance.seed: {uniform: [1, 10]}}\n"
    with pytest.raises(ScenarioError) as error:
        load_text(text, "a.yaml", checks=[sweep_faults])
    says = "uniform draws others; write seed: true or integers: [low, high]"
    assert f"disturbance.seed is a whole number, and {says}" in str(error.value)


@pytest.mark.parametrize(
    "key", ["disturbance[2].speed", "disturbance.2.speed", "disturbance.speed"]
)
def test_what_a_list_of_disturbances_does_not_have_is_told_with_what_it_has(key):
    several = BASE.replace("{kind: harmonic}", "[{kind: step}, {kind: current, speed: 0.5}]")
    text = f"{several}  vary: {{'{key}': {{uniform: [0, 1]}}}}\n"
    with pytest.raises(ScenarioError) as error:
        load_text(text, "a.yaml", checks=[sweep_faults])
    says = "the list has 2 entries, disturbance[0] to disturbance[1] (step, current)"
    assert says in str(error.value)


TRIAL = "controllers={pid: null, li: null, turn: {kind: zigzag}}"
TIMES = {
    "controller.execute: {uniform: [0.3, 0.5]}": "controller.execute: 0.300174 s is no whole",
    "controller.execute: {choice: [0.3, 0.35]}": "controller.execute: 0.35 s is no whole number",
    "actuator.command.delay: {choice: [0.1, 0.13]}": "delay: 0.13 s is no whole number of steps",
    "measurement.position.period: {choice: [0.1, 0.25]}": "position.period: 0.25 s is no whole",
}


@pytest.mark.parametrize("drawn", TIMES)
def test_a_drawn_time_has_to_fit_the_steps_as_a_given_one(drawn):
    """Where all draws are off the grid of steps, or one of the values to choose from is."""
    around = ["actuator.command.delay=0.1", "measurement.kind=sensors", "estimator.kind=ekf"]
    with pytest.raises(ScenarioError) as told:
        load_text(
            TEXT,
            "a.yaml",
            [TRIAL, "sweep.claims=null", *around, f"sweep.vary={{{drawn}}}"],
            [sweep_faults],
        )
    assert TIMES[drawn] in str(told.value)


def test_what_contradicts_itself_without_a_draw_is_said_once():
    with pytest.raises(ScenarioError) as told:
        load_text(TEXT, "a.yaml", ["control.period=0.123"], [sweep_faults])
    assert str(told.value).count("0.123 s is no whole number of steps") == 1


# Beside N_rdot = -20 the mass matrix needs the added mass of sway.
HEAVY = ["vessel.Y_rdot=-50", "vessel.N_vdot=-50", "vessel.Y_vdot=-400", "vessel.N_rdot=-20"]
BOTH = "vessel.Y_vdot: {choice: [0, -400]}, vessel.N_rdot: {choice: [-300, -20]}"


def test_a_value_that_only_the_other_quantity_s_values_hide_is_told_at_the_one_to_blame():
    """Of two lists side by side each pair is sound: 0 with -300, -400 with -20."""
    (line,) = told(vary(f"{BOTH}, start.y: {{uniform: [0, 1]}}"), HEAVY)
    assert "sweep.vary.vessel.Y_vdot: " in line
    assert "with vessel.Y_vdot = 0" in line
    sound = "vessel.Y_vdot: {choice: [-300, -400]}, vessel.N_rdot: {choice: [-300, -20]}"
    assert told(vary(sound), HEAVY) == []
