"""Scenarios from several sources: extends, --set, vessel files, waypoints; origins of values."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import pytest
from config_samples import SOUND, loaded, told

from podusv_cli.config.loading import load, load_text, values
from podusv_cli.config.references import MAX_POINTS, vessel_file, vessel_names
from podusv_cli.config.tree import plain
from podusv_cli.errors import ScenarioError
from podusv_cli.vessels.vessel import Vessel


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, so that messages show names as a user gives them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    return tmp_path


def write(name: str, text: str) -> None:
    Path(name).write_text(text, encoding="utf-8")


def findings(name: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as raised:
        load(name, overrides)
    return str(raised.value).splitlines()


# --- extends


def test_a_child_changes_single_keys_of_its_base(folder: Path) -> None:
    write("base.yaml", SOUND + "start: {x: 1, y: 2}\nsimulation: {step: 0.02}\n")
    write("sub/child.yaml", "extends: ../base.yaml\nstart: {y: 5}\ncontroller: {k_ze: 0.3}\n")
    got = load("sub/child.yaml")
    assert (got.scenario.start.x, got.scenario.start.y) == (1, 5)
    assert got.scenario.controller.kind == "pid"
    assert got.scenario.controller.k_ze == 0.3
    assert got.origins["start.x"] == "sub/../base.yaml:6:12"
    assert got.origins["start.y"] == "sub/child.yaml:2:12"
    assert got.origins["start.psi"] == "default"
    assert got.text == Path("sub/child.yaml").read_text()


def test_several_levels_and_lists_are_replaced_whole(folder: Path) -> None:
    law = "controller: {kind: dsc, network: {nodes: [5, 5, 5], low: [-2, -2, -2]}}\n"
    write("a.yaml", SOUND.replace("controller: {kind: pid}\n", law))
    write("b.yaml", "extends: a.yaml\ncontroller: {network: {nodes: [4, 3, 2]}}\n")
    write("c.yaml", "extends: b.yaml\ncontroller: {network: {high: [3, 3, 3]}}\n")
    network = load("c.yaml").scenario.controller.network
    assert (network.nodes, network.low, network.high) == ((4, 3, 2), (-2, -2, -2), (3, 3, 3))


def test_another_kind_replaces_the_section_and_the_same_kind_does_not(folder: Path) -> None:
    write("base.yaml", SOUND.replace("{kind: pid}", "{kind: dsc, k_ze: 0.4, T_u: 0.5}"))
    write("other.yaml", "extends: base.yaml\ncontroller: {kind: pid}\n")
    write("same.yaml", "extends: base.yaml\ncontroller: {kind: dsc, T_r: 0.7}\n")
    assert load("other.yaml").scenario.controller.k_ze == 0.1
    same = load("same.yaml").scenario.controller
    assert (same.k_ze, same.T_u, same.T_r) == (0.4, 0.5, 0.7)


def test_another_preset_replaces_the_vessel_with_its_changes(folder: Path) -> None:
    write("base.yaml", SOUND.replace("{preset: paper}", "{preset: paper, m: 30}"))
    write("other.yaml", "extends: base.yaml\nvessel: {preset: cybership2, beam: 0.3}\n")
    vessel = load("other.yaml").scenario.vessel
    assert (vessel.m, vessel.beam, vessel.N_vv) == (23.8, 0.3, 3.95645)


def test_null_is_a_value_and_does_not_fall_back_to_the_base(folder: Path) -> None:
    write("base.yaml", SOUND.replace("{kind: pid}", "{kind: dsc, network: {widths: [1, 1, 1]}}"))
    write("none.yaml", "extends: base.yaml\ncontroller: {network: {widths: null}}\n")
    assert load("none.yaml").scenario.controller.network.widths is None
    write("bad.yaml", "extends: base.yaml\ncontroller: {k_ze: null}\n")
    assert findings("bad.yaml") == [
        "bad.yaml:2:20: controller.k_ze: must be a number not below 0 [1/s], found null"
    ]


def test_a_fault_of_the_base_is_told_at_the_base(folder: Path) -> None:
    write("sub/base.yaml", SOUND + "log: {every: 0}\n")
    write("child.yaml", "extends: sub/base.yaml\nlgo: {}\n")
    lines = findings("child.yaml")
    assert [line.split(": ")[0] for line in lines] == ["child.yaml:2:1", "sub/base.yaml:6:14"]


def test_a_missing_base_is_told_at_the_key_and_alone(folder: Path) -> None:
    write("child.yaml", "description: x\nextends: nope.yaml\nlog: {evry: 1}\n")
    assert findings("child.yaml") == [
        "child.yaml:2:10: extends: 'nope.yaml' cannot be read: no such file or directory",
        "child.yaml:3:7: log.evry: unknown key; did you mean 'every'? (allowed: every)",
    ]


def test_a_base_that_is_no_yaml_is_told_once(folder: Path) -> None:
    write("base.yaml", "a: [1\n")
    write("child.yaml", "extends: base.yaml\n")
    assert findings("child.yaml") == ["base.yaml:1:4: the bracket opened here is never closed"]


def test_a_circle_is_told_at_the_key_that_closes_it(folder: Path) -> None:
    write("a.yaml", "extends: sub/b.yaml\n")
    write("sub/b.yaml", "extends: ../a.yaml\n")
    assert findings("a.yaml") == [
        "sub/b.yaml:1:10: extends: goes round in a circle: a.yaml -> sub/b.yaml -> sub/../a.yaml"
    ]
    write("self.yaml", "extends: self.yaml\n")
    assert findings("self.yaml") == [
        "self.yaml:1:10: extends: goes round in a circle: self.yaml -> self.yaml"
    ]


def test_extends_takes_one_file_name(folder: Path) -> None:
    write("a.yaml", "extends: [b.yaml, c.yaml]\n")
    assert findings("a.yaml") == ["a.yaml:1:10: extends: must be a file name, found a list of 2"]


# --- --set


def test_an_override_wins_and_is_told_as_origin() -> None:
    got = loaded(SOUND, ["start.x=1e-3", "controller.k_ze=2"])
    assert (got.scenario.start.x, got.scenario.controller.k_ze) == (1e-3, 2.0)
    assert got.origins["start.x"] == "--set start.x=1e-3"
    assert got.text == SOUND


def test_overrides_take_text_lists_and_mappings() -> None:
    got = loaded(
        SOUND,
        [
            "description=Why: a test #3, with *marks*",
            "controller={kind: dsc, network: {nodes: [4, 4, 4]}}",
            "controller.network.low=[-2, -2, -2]",
            "name='1e3'",
        ],
    ).scenario
    assert got.description == "Why: a test #3, with *marks*"
    assert got.name == "1e3"
    assert got.controller.network.nodes == (4, 4, 4)
    assert got.controller.network.low == (-2, -2, -2)


@pytest.mark.parametrize("turn", [1, -1])
def test_the_order_of_kind_and_gain_on_the_command_line_does_not_matter(turn: int) -> None:
    law = loaded(SOUND, ["controller.kind=dsc", "controller.k_ze=0.7"][::turn]).scenario.controller
    assert (law.kind, law.k_ze) == ("dsc", 0.7)


def test_the_last_of_two_equal_keys_wins() -> None:
    assert loaded(SOUND, ["start.x=1", "start.x=2"]).scenario.start.x == 2


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("vessel.m", "write it as --set section.key=value"),
        ("=3", "write it as --set section.key=value"),
        ("vessel..m=3", "write it as --set section.key=value"),
        ("", "write it as --set section.key=value"),
        ("start.z=1", "start.z: unknown key (allowed: x, y, psi, u, v, r)"),
        ("start.x=far", "start.x: must be a number [m], found 'far'"),
        ("start.x=", "start.x: must be a number [m], found nothing"),
        ("start.x=.nan", "start.x: .nan is not a finite number"),
        ("start.x.y=1", "start.x: must be a number [m], found a mapping of keys"),
        ("start.x=[1", "the bracket opened here is never closed"),
        ("log.every=0", "log.every: must be a whole number not below 1 [steps], found 0"),
        (
            "controller=dsc",
            "controller: must be a mapping of keys with kind adaptive_neural, backstepping, dsc or "
            "pid, found 'dsc'; write {kind: dsc}",
        ),
        (
            "vessel.preset=cybership",
            "vessel.preset: unknown vessel 'cybership'; did you mean 'cybership2'? "
            "(allowed: cybership2, paper, paper_nonlinear)",
        ),
        (
            "simulation.duration=1e-9",
            "simulation.duration: 1e-09 s is no whole number of steps of 0.01 s; try 0.01",
        ),
    ],
)  # fmt: skip
def test_a_wrong_override_is_told_as_given(override: str, says: str) -> None:
    assert told(SOUND, [override]) == [f"--set {override}: {says}"]


def test_a_wrong_override_does_not_hide_the_others() -> None:
    assert len(told(SOUND, ["a", "start.z=1", "start.x=.inf", "start.y=x"])) == 4


def test_an_override_is_always_on_one_line() -> None:
    assert told(SOUND, ["start.x=a\nb"]) == [
        r"--set 'start.x=a\nb': start.x: must be a number [m], found 'a\nb'"
    ]


# --- vessels


@pytest.mark.parametrize("name", vessel_names())
def test_a_preset_is_its_file(name: str) -> None:
    faults: list[object] = []
    node = vessel_file(name, faults)
    assert node is not None
    assert faults == []
    vessel = loaded(SOUND.replace("preset: paper", f"preset: {name}")).scenario.vessel
    assert vessel == Vessel(preset=name, **plain(node))


def test_a_vessel_can_change_some_values_of_its_preset() -> None:
    got = loaded(SOUND.replace("preset: paper", "preset: paper, X_u: -2"))
    assert (got.scenario.vessel.X_u, got.scenario.vessel.Y_v) == (-2.0, -0.8896)
    assert got.origins["vessel.X_u"] == "a.yaml:1:30"
    assert got.origins["vessel.Y_v"] == "vessel file paper.yaml"
    assert got.origins["vessel.N_vv"] == "default"


def test_the_nominal_vessel_is_the_vessel_with_its_changes() -> None:
    got = loaded(SOUND.replace("preset: paper", "preset: paper, m: 30"))
    assert got.scenario.nominal == got.scenario.vessel
    assert got.origins["nominal.m"] == got.origins["vessel.m"]


def test_a_nominal_vessel_without_preset_is_the_vessel_but_for_what_it_says() -> None:
    got = loaded(SOUND, ["vessel.m=30", "nominal.X_u=-1"]).scenario
    assert got.nominal == got.vessel.model_copy(update={"X_u": -1.0})


def test_a_nominal_vessel_with_preset_starts_from_it() -> None:
    got = loaded(SOUND, ["vessel.m=30", "nominal={preset: cybership2, X_u: -1}"]).scenario
    whole = loaded(SOUND.replace("paper", "cybership2")).scenario.vessel
    assert got.nominal == whole.model_copy(update={"X_u": -1.0})


def test_a_wrong_nominal_value_is_told_at_its_place() -> None:
    assert told(SOUND + "nominal: {X_u: 1, preset: x}\n") == [
        "a.yaml:6:16: nominal.X_u: must be a number not above 0 [kg/s], found 1",
        "a.yaml:6:27: nominal.preset: unknown vessel 'x' "
        "(allowed: cybership2, paper, paper_nonlinear)",
    ]


# --- sections that differ from their class's defaults


def test_one_key_of_a_disturbance_leaves_the_others_at_the_papers_values() -> None:
    text = SOUND.replace("{kind: none}", "{kind: harmonic, b_u: {mean: 0}}")
    b_u = loaded(text).scenario.disturbance.b_u
    assert (b_u.mean, b_u.sin, b_u.cos, b_u.cos_rate) == (0.0, 0.1, 0.3, 0.5)


# --- names


def test_the_name_is_that_of_the_file_unless_given() -> None:
    assert load_text(SOUND, "dir/my-run.v2.yaml").scenario.name == "my-run.v2"
    assert load_text(SOUND + "name: other\n", "dir/my-run.yaml").scenario.name == "other"


def test_a_file_name_that_is_no_name_is_told() -> None:
    with pytest.raises(ScenarioError) as raised:
        load_text(SOUND, "my run.yaml")
    assert str(raised.value) == (
        "my run.yaml: name: cannot be the file's name 'my run'; give one of letters, digits, '_', "
        "'.' and '-', starting with a letter or digit, at most 80 long"
    )


# --- waypoints


ROUTE = "path: {kind: waypoints, file: route.csv}\n"


def with_route(text: str = ROUTE) -> str:
    return SOUND.replace("path: {kind: line}\n", text)


def test_waypoints_come_from_a_file_beside_the_scenario(folder: Path) -> None:
    write("sub/route.csv", 'x, "y"\n# first leg\n0, 0\n\n10.5,-1e1  # bend\n"20",5\n')
    write("sub/a.yaml", with_route())
    got = load("sub/a.yaml")
    assert got.scenario.path.points == ((0.0, 0.0), (10.5, -10.0), (20.0, 5.0))
    assert got.scenario.path.file is None
    assert got.origins["path.points"] == "sub/route.csv"
    assert got.origins["path.file"] == "default"


def test_a_route_is_beside_the_file_that_names_it(folder: Path) -> None:
    write("sub/route.csv", "0,0\n1,1\n")
    write("sub/base.yaml", with_route())
    write("a.yaml", "extends: sub/base.yaml\n")
    assert len(load("a.yaml").scenario.path.points) == 2
    assert len(load("a.yaml", ["path.file=sub/route.csv"]).scenario.path.points) == 2


def test_a_file_saved_by_a_spreadsheet_is_read(folder: Path) -> None:
    Path("route.csv").write_bytes(b"\xef\xbb\xbfx,y\r\n0,0\r\n3,4\r\n")
    write("a.yaml", with_route())
    assert load("a.yaml").scenario.path.points == ((0.0, 0.0), (3.0, 4.0))


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("0,0\n1;1\n", ["route.csv:2:1: must be two numbers x,y [m], found '1;1'"]),
        ("0,0\n1,1,1\n2\n", [
            "route.csv:2:1: must be two numbers x,y [m], found '1,1,1'",
            "route.csv:3:1: must be two numbers x,y [m], found '2'",
        ]),
        ("nan,0\n1,1\n", ["route.csv:1:1: must be two numbers x,y [m], found 'nan,0'"]),
        ("0,0\n017,1\n", ["route.csv:2:1: must be two numbers x,y [m], found '017,1'"]),
        ("0,0\n1e999,1\n", ["route.csv:2:1: path.points[1][0]: must be a number, found 1e999"]),
        ("x,y\n0,0\n", ["a.yaml:2:7: path: needs at least two points, has 1"]),
        ("0,0\n0,0\n", ["a.yaml:2:7: path: two neighbouring points are the same"]),
        ("", ["a.yaml:2:7: path: needs at least two points, has 0"]),
    ],
)  # fmt: skip
def test_a_wrong_row_is_told_at_its_line(folder: Path, rows: str, says: list[str]) -> None:
    write("route.csv", rows)
    write("a.yaml", with_route())
    assert findings("a.yaml") == says


def test_faults_of_a_route_end_before_they_fill_the_screen(folder: Path) -> None:
    write("route.csv", "a;b\n" * 5000)
    write("a.yaml", with_route())
    assert len(findings("a.yaml")) < 20


def test_a_missing_route_is_told_at_the_key(folder: Path) -> None:
    write("a.yaml", with_route())
    assert findings("a.yaml") == [
        "a.yaml:2:31: path.file: 'route.csv' cannot be read: no such file or directory"
    ]


def test_points_and_file_together_are_told(folder: Path) -> None:
    write("route.csv", "0,0\n1,1\n")
    write(
        "a.yaml", with_route("path: {kind: waypoints, file: route.csv, points: [[0, 0], [1, 1]]}\n")
    )
    assert findings("a.yaml") == ["a.yaml:2:31: path.file: give either file or points, not both"]


def test_a_route_stays_short_enough_to_be_written_out(folder: Path) -> None:
    write("route.csv", "".join(f"{i},0\n" for i in range(MAX_POINTS + 1)))
    write("a.yaml", with_route())
    assert findings("a.yaml") == [f"route.csv: more than {MAX_POINTS:,} points"]


# --- files, origins, speed


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("nope.yaml", "nope.yaml: cannot be read: no such file or directory"),
        ("sub", "sub: cannot be read: is a directory"),
    ],
)
def test_a_file_that_cannot_be_read_is_a_finding(folder: Path, name: str, says: str) -> None:
    assert findings(name) == [says]


def test_every_value_has_an_origin() -> None:
    got = loaded()
    assert list(got.origins) == list(values(got.scenario))
    assert got.origins["name"] == "a.yaml"
    assert got.origins["controller.kind"] == "a.yaml:5:20"


def test_a_scenario_loads_in_the_blink_of_an_eye() -> None:
    loaded()

    def timed() -> float:
        began = perf_counter()
        loaded()
        return perf_counter() - began

    assert min(timed() for _ in range(5)) < 0.03


# --- several controllers


SEVERAL = SOUND.replace("{kind: pid}", "{kind: dsc, k_ze: 0.4, T_u: 0.5, network: {spread: 2}}")


def test_laws_to_compare_start_from_the_keys_that_they_share_with_the_controller() -> None:
    text = SEVERAL + "controllers: {slow: {kind: pid, K_Pu: 5}, fast: {k_ze: 2}}\n"
    got = loaded(text)
    slow, fast = got.scenario.controllers["slow"], got.scenario.controllers["fast"]
    assert (slow.kind, slow.k_ze, slow.K_Pu) == ("pid", 0.4, 5.0)
    assert (fast.kind, fast.k_ze, fast.T_u, fast.network.spread) == ("dsc", 2.0, 0.5, 2.0)
    assert got.origins["controllers.slow.k_ze"] == "a.yaml:5:32"
    assert got.origins["controllers.fast.k_ze"] == "a.yaml:6:59"


def test_a_fault_of_a_law_to_compare_is_told_without_its_kind() -> None:
    text = (
        SEVERAL + "controllers: {slow: {kind: pid, T_u: x, K_Pu: -1}, fast: {T_u: x}, other: 3}\n"
    )
    assert told(text) == [
        "a.yaml:6:33: controllers.slow.T_u: unknown key; did you mean 'T_d'? (allowed: k_ze, k_psie, "
        "standoff, hold_below, fold, rate, difference_step, first_difference, kind, K_Pu, K_Iu, K_Du, "
        "K_Pr, K_Ir, K_Dr, T_d, lag_start)",
        "a.yaml:6:47: controllers.slow.K_Pu: must be a number not below 0 [kg/s], found -1",
        "a.yaml:6:64: controllers.fast.T_u: must be a number above 0 [s], found 'x'",
        "a.yaml:6:75: controllers.other: must be a mapping of keys with kind adaptive_neural, "
        "backstepping, dsc or pid, found 3",
    ]


def test_a_fault_of_the_controller_is_told_once_however_many_laws_take_it_over() -> None:
    text = SEVERAL.replace("0.4", "-1") + "controllers: {a: {kind: pid}, b: {}, c: {}}\n"
    assert told(text) == [
        "a.yaml:5:32: controller.k_ze: must be a number not below 0 [1/s], found -1"
    ]


def test_faults_of_claims_are_told_at_their_item() -> None:
    claims = (
        "claims:\n- {id: C1, says: s, source: p, expect: e}\n- {id: 2, sayz: s, tolerance: 1}\n"
    )
    assert told(SOUND + claims) == [
        "a.yaml:8:3: claims[1].says: missing; must be text",
        "a.yaml:8:3: claims[1].source: missing; must be text",
        "a.yaml:8:3: claims[1].expect: missing; must be text",
        "a.yaml:8:8: claims[1].id: must be text, found 2",
        "a.yaml:8:11: claims[1].sayz: unknown key; did you mean 'says'? (allowed: id, says, source, "
        "expect, tolerance, remark)",
        "a.yaml:8:31: claims[1].tolerance: must be a number not below 0 and below 1, found 1",
    ]


def test_further_checks_are_told_at_the_place_of_the_key() -> None:
    claims = "claims:\n- {id: C1, says: s, source: p, expect: e}\n"
    with pytest.raises(ScenarioError) as raised:
        load_text(SOUND + claims, "a.yaml", checks=[lambda _: [("claims.0.expect", "no such run")]])
    assert str(raised.value) == "a.yaml:7:41: claims[0].expect: no such run"
