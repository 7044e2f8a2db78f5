"""One scenario from several sources: `extends` below, `--set` on top."""

import re
from pathlib import Path

import pytest
from conftest import kinds
from scenario_samples import SOUND, VESSEL_NAMES, findings, loaded, told, write

import podusv
from podusv_cli.scenario.load import load, load_text, tree_yaml
from podusv_cli.scenario.resolved import resolved_yaml
from podusv_cli.scenario.sweep import Keep

*OTHERS, LAST = kinds("controllers")
A_LAW = f"{', '.join(OTHERS)} or {LAST}"


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    """Messages show file names as a user gives them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()


def test_a_child_changes_single_keys_of_its_base():
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


def test_a_description_tells_of_its_own_file_alone():
    """What a base says of its sea may be false of a child's."""
    write("base.yaml", SOUND + "description: In calm water.\nname: base\n")
    write("child.yaml", "extends: base.yaml\nstart: {y: 5}\n")
    write("told.yaml", "extends: child.yaml\ndescription: In wind.\n")
    said = {name: load(f"{name}.yaml").scenario.description for name in ("base", "child", "told")}
    assert said == {"base": "In calm water.", "child": "", "told": "In wind."}


def test_several_levels_and_lists_are_replaced_whole():
    law = "controller: {kind: dsc, network: {nodes: [5, 5, 5], low: [-2, -2, -2]}}\n"
    write("a.yaml", SOUND.replace("controller: {kind: pid}\n", law))
    write("b.yaml", "extends: a.yaml\ncontroller: {network: {nodes: [4, 3, 2]}}\n")
    write("c.yaml", "extends: b.yaml\ncontroller: {network: {high: [3, 3, 3]}}\n")
    network = load("c.yaml").scenario.controller.network
    assert (network.nodes, network.low, network.high) == ((4, 3, 2), (-2, -2, -2), (3, 3, 3))


def test_another_kind_keeps_what_it_takes_and_tells_what_it_does_not():
    write("base.yaml", SOUND.replace("{kind: pid}", "{kind: dsc, k_ze: 0.4, T_u: 0.5}"))
    write("other.yaml", "extends: base.yaml\ncontroller: {kind: pid}\n")
    write("same.yaml", "extends: base.yaml\ncontroller: {kind: dsc, T_r: 0.7}\n")
    other = load("other.yaml")
    assert other.scenario.controller.k_ze == 0.4
    assert other.remarks == (
        "other.yaml:2:20: controller: kind pid in place of dsc, which loses T_u: 0.5",
    )
    same = load("same.yaml").scenario.controller
    assert (same.k_ze, same.T_u, same.T_r) == (0.4, 0.5, 0.7)


STEERED = """
vessel: {preset: wamv}
start: {x: -10.0, y: -5.0}
path: {kind: line, course: 0.3, speed: 1.3}
disturbance: {kind: none}
actuator: {kind: saturated, surge_limit: 800.0, yaw_limit: 370.0}
controller: {kind: velocity_vector, U: 2.5, N_m: 370.0, T_v: 1.7, k_r: 3.0}
simulation: {duration: 100.0}
"""
TO = "controller.kind=momentum_vector"


def several_ways(tmp_path):
    """The same change of the law's kind, by every way there is."""
    write("boat.yaml", STEERED)
    write("over.yaml", "extends: boat.yaml\ncontroller: {kind: momentum_vector}\n")
    write("several.yaml", STEERED + "controllers: {new: {kind: momentum_vector}}\n")
    first, second = (
        "controllers: {new: {kind: pid}}\n",
        "controllers: {new: {kind: momentum_vector}}\n",
    )
    write("named.yaml", STEERED + first)
    write("renamed.yaml", f"extends: named.yaml\n{second}")
    yield load("boat.yaml", [TO]).scenario.controller
    yield load("over.yaml").scenario.controller
    yield load("several.yaml").scenario.controllers["new"]
    yield load("renamed.yaml").scenario.controllers["new"]
    yield load_text(tree_yaml(load("boat.yaml", [TO])), "kept.yaml").scenario.controller
    yield podusv.load("boat.yaml", {"controller.kind": "momentum_vector"}).controller
    yield podusv.load(
        podusv.load("boat.yaml"), {"controller": {"kind": "momentum_vector"}}
    ).controller


@pytest.mark.filterwarnings("ignore:.*in place of velocity_vector")
def test_it_keeps_the_same_whichever_way_the_kind_is_changed(tmp_path):
    found = [*several_ways(tmp_path)]
    assert all(law == found[0] for law in found)
    assert (found[0].kind, found[0].U, found[0].N_m, found[0].T_v) == (
        "momentum_vector",
        2.5,
        370.0,
        1.7,
    )
    # A file with every value has the old law's gains by rule as numbers of its own.
    whole = load_text(resolved_yaml(load("boat.yaml").scenario), "all.yaml", [TO]).scenario
    assert (whole.controller.U, whole.controller.N_m, whole.controller.T_v) == (2.5, 370.0, 1.7)


def test_a_boat_whose_law_changes_its_kind_still_comes_to_its_target():
    """With U and N_m of a model ship it is left behind by a target at 1.3 m/s."""
    write("boat.yaml", STEERED)
    with pytest.warns(UserWarning, match=r"which loses k_r: 3.0$") as told:
        kept = podusv.simulate("boat.yaml", {"controller.kind": "momentum_vector"})
    with pytest.warns(UserWarning, match=r"which loses k_r: 3.0$") as told_anew:
        podusv.load("boat.yaml", {"controller.kind": "momentum_vector"})
    # Not a line of podusv's own, however deep within it the warning is made.
    assert {warning.filename for warning in (*told, *told_anew)} == {__file__}
    model_ship = {"controller.U": 1.25, "controller.N_m": 2.5}
    lost = podusv.simulate("boat.yaml", {"controller": {"kind": "momentum_vector"}, **model_ship})
    assert kept.metrics["z_e_steady"] < 1e-3 < 10.0 < lost.metrics["z_e_steady"]


def test_a_law_that_is_written_out_says_which_numbers_another_kind_keeps_of_it():
    """They may have come from the old law's rules; T_v is 1.25 by momentum_vector's own."""
    free = "controller: {kind: velocity_vector, omega_u: 9.0}"
    write("free.yaml", re.sub("controller: .*", free, STEERED))
    new, wholly = "controller.kind=momentum_vector", load("free.yaml").scenario
    own = load("free.yaml", [new])
    assert own.remarks == ()
    write("written.yaml", resolved_yaml(wholly))
    kept = load("written.yaml", [new])
    assert kept.scenario.controller.T_v == wholly.controller.T_v != own.scenario.controller.T_v
    (told,) = (one for one in kept.remarks if "keeps" in one)
    assert f"keeps omega_u: 9.0, omega_v: {wholly.controller.omega_v}, " in told
    assert f" T_v: {wholly.controller.T_v}, which may have been defaults of velocity_v" in told
    assert told.endswith("; null takes those of momentum_vector")
    listed = re.findall(r"(\w+): [\d.]+", told.partition(" keeps ")[2])
    asked = load("written.yaml", [new, *(f"controller.{n}=null" for n in listed if n != "omega_u")])
    assert asked.scenario.controller == own.scenario.controller


def test_a_path_of_another_kind_keeps_course_and_speed():
    write("path.yaml", STEERED.replace("kind: line", "kind: sinusoid, amplitude: 4.0"))
    for changes in (["path.kind=line"], ["path={kind: line}"]):
        loaded = load("path.yaml", changes)
        assert (loaded.scenario.path.course, loaded.scenario.path.speed) == (0.3, 1.3)
        assert (
            "path: kind line in place of sinusoid, which loses amplitude: 4.0" in loaded.remarks[0]
        )


def test_a_key_of_the_same_name_and_another_unit_or_type_is_another_key():
    law = "controller: {kind: cascade, k_u: 9.0, k_r: 4.0}"
    write("unit.yaml", re.sub("controller: .*", law, STEERED))
    loaded = load("unit.yaml", ["controller.kind=velocity_vector"])  # 1/s, and there kg/s
    plain = load("unit.yaml", ["controller={kind: velocity_vector, U: 2.5}"]).scenario.controller
    law = loaded.scenario.controller
    assert (law.k_u, law.k_r) == (plain.k_u, plain.k_r)
    assert 9.0 != law.k_u != 4.0 != law.k_r
    assert "which loses k_u: 9.0, k_r: 4.0" in loaded.remarks[0]


def test_a_disturbance_keeps_nothing_of_another_kind():
    """A current flows to its direction, and wind comes from it."""
    write("sea.yaml", STEERED.replace("kind: none", "kind: current, speed: 0.2, direction: 1.0"))
    loaded = load("sea.yaml", ["disturbance={kind: wind, speed: 5.0}"])
    assert loaded.scenario.disturbance.direction == 0.0
    assert loaded.remarks == ()


COMMANDS = ("run", "compare", "validate", "verify", "margins", "export")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_says_what_a_change_of_kind_loses(podusv, command):
    write("boat.yaml", STEERED.replace("duration: 100.0", "duration: 1.0"))
    # A law is compiled anew for every export; this one is refused as its folder is there already.
    more = {
        "export": ("--no-fmu", "--to", "."),
        "run": ("--no-figures",),
        "compare": ("--no-figures",),
    }
    said = podusv(
        command, "boat.yaml", "--set", TO, *more.get(command, ()), "--set", "control.period=0.1"
    )
    assert (
        f"warning: --set {TO}: controller: kind momentum_vector in place of" in said.out + said.err
    )
    assert "velocity_vector, which loses k_r: 3.0" in " ".join((said.out + said.err).split())


def test_another_preset_replaces_the_vessel_with_its_changes():
    write("base.yaml", SOUND.replace("{preset: paper}", "{preset: paper, m: 30}"))
    write("other.yaml", "extends: base.yaml\nvessel: {preset: cybership2, beam: 0.3}\n")
    vessel = load("other.yaml").scenario.vessel
    assert (vessel.m, vessel.beam, vessel.N_vv) == (23.8, 0.3, 3.95645)


def test_null_is_a_value_and_does_not_fall_back_to_the_base():
    write("base.yaml", SOUND.replace("{kind: pid}", "{kind: dsc, network: {widths: [1, 1, 1]}}"))
    write("none.yaml", "extends: base.yaml\ncontroller: {network: {widths: null}}\n")
    assert load("none.yaml").scenario.controller.network.widths is None
    write("bad.yaml", "extends: base.yaml\ncontroller: {k_ze: null}\n")
    (said,) = findings("bad.yaml")
    assert said.startswith("bad.yaml:2:20: controller.k_ze: ")
    assert said.endswith("found null")


def test_a_fault_of_the_base_is_told_at_the_base():
    write("sub/base.yaml", SOUND + "log: {every: 0}\n")
    write("child.yaml", "extends: sub/base.yaml\nlgo: {}\n")
    lines = findings("child.yaml")
    assert [line.split(": ")[0] for line in lines] == ["child.yaml:2:1", "sub/base.yaml:6:14"]


def test_a_missing_base_is_told_at_the_key_and_alone():
    write("child.yaml", "description: x\nextends: nope.yaml\nlog: {evry: 1}\n")
    missing, unknown = findings("child.yaml")
    assert missing.startswith("child.yaml:2:10: extends: 'nope.yaml' ")
    assert missing.endswith(str(Path.cwd()))
    assert unknown.startswith("child.yaml:3:7: log.evry: ")


def test_a_base_that_is_no_yaml_is_told_once():
    write("base.yaml", "a: [1\n")
    write("child.yaml", "extends: base.yaml\n")
    assert findings("child.yaml") == ["base.yaml:1:4: the bracket opened here is never closed"]


def test_a_circle_is_told_at_the_key_that_closes_it():
    write("a.yaml", "extends: sub/b.yaml\n")
    write("sub/b.yaml", "extends: ../a.yaml\n")
    assert findings("a.yaml") == [
        "sub/b.yaml:1:10: extends: goes round in a circle: a.yaml -> sub/b.yaml -> sub/../a.yaml"
    ]
    write("self.yaml", "extends: self.yaml\n")
    assert findings("self.yaml") == [
        "self.yaml:1:10: extends: goes round in a circle: self.yaml -> self.yaml"
    ]


def test_of_several_bases_the_later_goes_over_the_earlier():
    write("first.yaml", SOUND + "description: first\nname: first\n")
    write("second.yaml", "description: second\nstart: {x: 7.0}\n")
    write("a.yaml", "extends: [first.yaml, second.yaml]\nstart: {y: 8.0}\n")
    scenario = load("a.yaml").scenario
    assert (scenario.name, scenario.description) == ("first", "")
    assert (scenario.start.x, scenario.start.y) == (7.0, 8.0)


def test_what_two_bases_share_goes_over_the_first_of_them():
    write("shared.yaml", SOUND + "start: {x: 1.0}\nname: shared\n")
    write("first.yaml", "extends: shared.yaml\nstart: {x: 2.0, y: 3.0}\n")
    write("second.yaml", "extends: shared.yaml\nname: second\n")
    write("a.yaml", "extends: [first.yaml, second.yaml]\n")
    got = load("a.yaml").scenario
    assert (got.start.x, got.start.y, got.name) == (1.0, 3.0, "second")


def test_each_of_several_bases_is_a_file_name():
    write("a.yaml", "extends: [none.yaml, 3]\n")
    assert findings("a.yaml") == [
        "a.yaml:1:11: extends: 'none.yaml' cannot be read: no such file or directory; "
        f"looked in {Path.cwd()}",
        "a.yaml:1:22: extends: must be a file name, found 3",
    ]


def test_null_takes_out_an_inherited_run_or_claim():
    runs = "controllers: {a: {kind: pid}, b: {kind: dsc}}\n"
    claims = "claims: {c: {says: x, source: y, expect: a.iae < b.iae}}\n"
    write("base.yaml", SOUND + runs + claims)
    write("a.yaml", "extends: base.yaml\ncontrollers: {b: null}\nclaims: {c: null}\n")
    scenario = load("a.yaml").scenario
    assert list(scenario.controllers) == ["a"]
    assert not scenario.claims


def test_an_override_wins_and_is_told_as_origin():
    got = loaded(SOUND, ["start.x=1e-3", "controller.k_ze=2"])
    assert (got.scenario.start.x, got.scenario.controller.k_ze) == (1e-3, 2.0)
    assert got.origins["start.x"] == "--set start.x=1e-3"
    assert got.text == SOUND


def test_overrides_take_text_lists_and_mappings():
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
def test_the_order_of_kind_and_gain_on_the_command_line_does_not_matter(turn):
    law = loaded(SOUND, ["controller.kind=dsc", "controller.k_ze=0.7"][::turn]).scenario.controller
    assert (law.kind, law.k_ze) == ("dsc", 0.7)


def test_the_last_of_two_equal_keys_wins():
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
        ("controllers={a:", "a brace is never closed; in a shell, put the whole value in quotes"),
        ("start.x=[1", "the bracket opened here is never closed"),
        ("log.every=0", "log.every: must be a whole number not below 1 [steps], found 0"),
        (
            "controller=dsc",
            f"controller: must be a mapping of keys with kind {A_LAW}, found 'dsc'; write "
            "{kind: dsc}",
        ),
        (
            "vessel.preset=cybership",
            "vessel.preset: unknown vessel 'cybership'; did you mean 'cybership2'? "
            "(allowed: " + VESSEL_NAMES + ")",
        ),
        (
            "simulation.duration=1e-9",
            "simulation.duration: 1e-09 s is no whole number of steps of 0.01 s; try 0.01",
        ),
    ],
)
def test_a_wrong_override_is_told_as_given(override, says):
    assert told(SOUND, [override]) == [f"--set {override}: {says}"]


def test_a_wrong_override_does_not_hide_the_others():
    assert len(told(SOUND, ["a", "start.z=1", "start.x=.inf", "start.y=x"])) == 4


def test_an_override_is_always_on_one_line():
    assert told(SOUND, ["start.x=a\nb"]) == [
        r"--set 'start.x=a\nb': start.x: must be a number [m], found 'a\nb'"
    ]


PODS = SOUND.replace("{kind: ideal}", "{kind: pod, preset: cybership2_pod}")


@pytest.mark.parametrize("kind", ["kind: harmonic, ", ""])
def test_a_mapping_of_kinds_is_told_to_be_a_list(kind):
    given = f"{{{kind}current: {{speed: 1}}, wind: {{speed: 2}}}}"
    said = told(SOUND.replace("{kind: none}", given))
    hint = "for several kinds write a list: disturbance: [{kind: current, ...}, {kind: wind, ...}]"
    assert said
    assert all(line.endswith(hint) for line in said)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("measurement: {kind: sensors, gnss: {}}", "unknown key; did you mean 'position'?"),
        ("measurement: {kind: sensors, compass: {}}", "unknown key; did you mean 'heading'?"),
        (
            "measurement: {kind: sensors, position: {rate: 5}}",
            "unknown key; did you mean 'period'?",
        ),
        ("measurement: {kind: sensors, position: null}", "found null; it cannot be left out"),
        (
            "measurement: {kind: sensors, position: {noise: -1}}",
            "must be a number not below 0 [m],",
        ),
        ("measurement: {kind: sensors, yaw_rate: {bias: -1}}", "not below 0 [rad/s],"),
        ("actuator: {kind: saturated, delay: 1}", "unknown key; did you mean 'command.delay'?"),
        ("actuator: {kind: saturated, failure: {time: 1, pod: 0}}", "pod belongs to kind pod"),
    ],
)
def test_other_words_and_places_are_told_with_podusv_s_own(text, says):
    (line,) = told(
        SOUND.replace(
            "actuator: {kind: ideal}\n", "" if "actuator" in text else "actuator: {kind: ideal}\n"
        )
        + text
        + "\n"
    )
    assert says in line


CLAIMED = "claims: {C1: {says: a, source: b, expect: pid.iae < 1}}\n"


def test_null_takes_out_all_inherited_entries():
    write("base.yaml", SOUND + CLAIMED + "sweep: {vary: {vessel.m: {uniform: [20, 30]}}}\n")
    write("a.yaml", "extends: base.yaml\nclaims: null\nsweep: {vary: null}\n")
    scenario = load("a.yaml").scenario
    assert (scenario.claims, scenario.sweep.vary) == ({}, {})
    assert load("base.yaml", ["claims=null"]).scenario.claims == {}
    assert list(load("base.yaml").scenario.claims) == ["C1"]
    kept = load("base.yaml", ["sweep.keep.failed=3", "sweep.keep.worst.iae=2"])
    assert kept.scenario.sweep.keep.failed == 3
    write("kept.yaml", tree_yaml(kept))
    assert load("kept.yaml", ["sweep.keep=null"]).scenario.sweep.keep == Keep()


def test_another_preset_of_pods_keeps_the_kind_and_nothing_else():
    text = PODS.replace("kind: pod,", "kind: pod, priority: surge,")
    write("base.yaml", text)
    actuator = load("base.yaml", ["actuator.preset=revolt"]).scenario.actuator
    assert (actuator.kind, actuator.priority, len(actuator.pods)) == ("pod", "yaw", 3)
    (line,) = told(text, ["actuator.preset=revol"])
    assert "'revol'; did you mean 'revolt'?" in line


def test_a_chain_of_bases_may_be_long():
    for i in range(300):
        write(f"{i}.yaml", f"extends: {i + 1}.yaml\n")
    write("300.yaml", SOUND)
    assert findings("0.yaml") == []


def test_a_setting_is_nested_no_deeper_than_a_file():
    deep = ".".join(["a"] * 5000)
    assert told(SOUND, [f"{deep}=1"]) == [f"--set {deep}=1: nested deeper than 32 levels"]


def test_a_setting_may_name_a_place_that_no_list_has():
    digits = "1" * 5000
    for key in (f"controller.{digits}", f"silence.{digits}", f"{digits}.{digits}"):
        (said,) = told(SOUND + "silence: [saturated]\n", [f"{key}=1"])
        assert said.startswith(f"--set {key}=1: ")


# --- places of lists


def test_an_item_of_a_list_can_be_set_by_its_place_also_where_a_preset_brings_the_list():
    sets = ("actuator.pods.1.n_lag=0.5", "actuator.pods.0={angle_lag: 0.2, n_lag: 0.3}")
    one, two = loaded(PODS, sets).scenario.actuator.pods
    assert (one.n_lag, one.angle_lag, one.T_nn) == (0.3, 0.2, 3.65034e-3)
    assert (two.n_lag, two.angle_lag, two.y) == (0.5, 0.1, 0.078)
    assert told(PODS, ["actuator.pods.1.T_nn=-1"]) == [
        "--set actuator.pods.1.T_nn=-1: actuator.pods[1].T_nn: must be a number or null above 0 "
        "[N s2], found -1"
    ]


def test_a_place_that_a_list_does_not_have_is_no_item():
    (line,) = told(PODS, ["actuator.pods.2.n_lag=0.5"])
    place = "--set actuator.pods.2.n_lag=0.5: actuator.pods[2]"
    assert line.startswith(f"{place}: the list has 2 entries, actuator.pods[0] to actuator.pods[1]")


PARTS = "{kind: current}, {kind: wind, speed: 1}, {kind: waves, height: 0.1, period: 2}"
SEA = SOUND.replace("{kind: none}", f"[{PARTS}]")
ENTRIES = "the list has 3 entries, disturbance[0] to disturbance[2] (current, wind, waves)"


@pytest.mark.parametrize("key", ["disturbance[2].seed", "disturbance.2.seed"])
def test_both_forms_of_a_place_may_be_set(key):
    seeds = [part.seed for part in loaded(SEA, [f"{key}=7"]).scenario.disturbance]
    assert seeds == [1, 1, 7]


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("disturbance[3].seed=2", "disturbance[3]"),
        ("disturbance.3.kind=none", "disturbance[3]"),
        ("disturbance.-1.seed=2", "disturbance.-1"),
        ("disturbance.waves.seed=2", "disturbance.waves"),
        ("disturbance.seed=2", "disturbance.seed"),
    ],
)
def test_what_a_list_does_not_have_is_told_with_what_it_has(override, key):
    assert told(SEA, [override]) == [f"--set {override}: {key}: {ENTRIES}; name one of these"]


def test_a_file_above_names_places_of_a_list_that_it_extends():
    write("base.yaml", SEA)
    write("a.yaml", "extends: base.yaml\ndisturbance: {'3': {seed: 2}}\n")
    assert findings("a.yaml") == [f"a.yaml:2:15: disturbance[3]: {ENTRIES}; name one of these"]
    write("a.yaml", "extends: base.yaml\ndisturbance: {kind: none}\n")
    assert load("a.yaml").scenario.disturbance.kind == "none"


def test_a_list_of_numbers_tells_its_places():
    points = SOUND.replace("{kind: line}", "{kind: waypoints, points: [[0, 0], [1, 1]]}")
    assert loaded(points, ["path.points[1][0]=5"]).scenario.path.points == ((0, 0), (5, 1))
    (line,) = told(points, ["path.points[1].2=5"])
    assert "path.points[1][2]: the list has 2 entries, path.points[1][0] to" in line


@pytest.mark.parametrize("form", ["disturbance[2].seed", "disturbance.2.seed"])
def test_both_forms_name_the_same_quantity(form):
    text = f"{SEA}sweep: {{vary: {{'{form}': {{seed: true}}}}}}\n"
    (name,) = loaded(text).scenario.sweep.vary
    assert name == "disturbance[2].seed"
    assert loaded(text, ["sweep.vary.disturbance.2.seed=null"]).scenario.sweep.vary == {}
    (twice,) = told(text.replace("true}}", "true}, 'disturbance[2].seed': {seed: true}}"))[:1]
    assert "given twice" in twice
