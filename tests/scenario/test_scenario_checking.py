"""Sentences about values: what must be, what was found, what was probably meant."""

import pytest
from conftest import kinds
from scenario_samples import SOUND, VESSEL_NAMES, told

from podusv_cli.components.vessels.vessel import Vessel
from podusv_cli.scenario.model import Scenario

KEYS = ", ".join(Scenario.model_fields)
VESSEL_KEYS = ", ".join(Vessel.model_fields)
ROOMS = ("paths", "controllers", "disturbances", "actuators")
PATHS, LAWS, SEAS, ACTUATORS = ([*kinds(room)] for room in ROOMS)
A_PATH, A_LAW, A_SEA, AN_ACTUATOR = (
    f"{', '.join(known[:-1])} or {known[-1]}" for known in (PATHS, LAWS, SEAS, ACTUATORS)
)
NUMBER = "step: must be a number above 0 [s], found"
TRUTH = "compiled: must be true or false, found"
CENTER = "must be a list of 3 numbers [m/s, m/s, rad/s]"
NETWORK = "    network:\n      "


@pytest.mark.parametrize("kind", ["{a: 1}", "[b]", "[]", "{}", "3", "true"])
@pytest.mark.parametrize(
    "section", ["path", "disturbance", "actuator", "controller", "measurement", "estimator"]
)
def test_a_kind_that_is_no_word_is_unknown(section, kind):
    lines = [line for line in SOUND.splitlines() if not line.startswith(section)]
    (line,) = told("\n".join([*lines, f"{section}: {{kind: {kind}}}", ""]))
    assert f"{section}.kind: " in line
    assert "allowed: " in line


@pytest.mark.parametrize("preset", ["{a: 1}", "[b]", "{}"])
def test_a_preset_that_is_no_word_is_unknown(preset):
    (line,) = told(SOUND.replace("preset: paper", f"preset: {preset}"))
    assert "vessel.preset: " in line


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("step: 017", f"8: {NUMBER} '017'; numbers have no leading zeros"),
        ("step: 1:30", f"8: {NUMBER} '1:30'; write the number out, colons are not read as minutes"),
        ("step: '0.5'", f"8: {NUMBER} '0.5'; leave out the quotes"),
        ("step: 0,5", f"8: {NUMBER} '0,5'; write a decimal point"),
        ("step: 35°", f"8: {NUMBER} '35°'; ° does not fit (units here: s, ms, us, ns, min, h)"),
        ("step: -5 ms", f"8: {NUMBER} -5 ms"),
        ("step: 1_0", f"8: {NUMBER} '1_0'; leave out the underscores"),
        ("step: 0x10", f"8: {NUMBER} '0x10'; write it in decimal"),
        ("step: nan", f"8: {NUMBER} 'nan'; numbers must be finite"),
        ("step: .inf", "8: step: .inf is not a finite number"),
        ("step: fast", f"8: {NUMBER} 'fast'"),
        ("step: true", f"8: {NUMBER} true"),
        ("step: -1e-3", f"8: {NUMBER} -1e-3"),
        ("step:", f"7: {NUMBER} nothing"),
        ("step: [0.1]", f"8: {NUMBER} a list of 1"),
        ("step: {}", f"8: {NUMBER} an empty mapping"),
        ("compiled: no", f"12: {TRUTH} 'no'; write false"),
        ("compiled: On", f"12: {TRUTH} 'On'; write true"),
        ("compiled: 'true'", f"12: {TRUTH} 'true'; write true"),
        ("compiled: maybe", f"12: {TRUTH} 'maybe'"),
        ("stp: 1", "2: stp: unknown key; did you mean 'step'? (allowed: step, duration, compiled)"),
        (
            "Step: 1",
            "2: Step: unknown key; did you mean 'step'? (allowed: step, duration, compiled)",
        ),
    ],
)
def test_a_wrong_value_is_one_sentence_at_its_place(text, says):
    column, says = says.split(": ", 1)
    assert told(f"{SOUND}simulation:\n {text}\n") == [f"a.yaml:7:{column}: simulation.{says}"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "log: {every: 1e3}",
            "14: log.every: must be a whole number not below 1 [steps], found 1e3; write 1000",
        ),
        (
            "metrics: {steady_fraction: 2}",
            "28: metrics.steady_fraction: must be a number above 0 and not above 1, found 2",
        ),
        ("start: {<<: {x: 1}}", "9: start.<<: unknown key (allowed: x, y, psi, u, v, r)"),
        ("start: 3", "8: start: must be a mapping of keys: x, y, psi, u, v, r, found 3"),
        (
            "name: a b",
            "7: name: must be text of letters, digits, '_', '.' and '-', starting with a letter or "
            "digit, at most 80 long, found 'a b'",
        ),
        ("description: 3", "14: description: must be text, found 3"),
        (
            "simulaton: 1",
            f"1: simulaton: unknown key; did you mean 'simulation'? (allowed: {KEYS})",
        ),
        ("K_Pu: 60", f"1: K_Pu: unknown key; did you mean 'controller.K_Pu'? (allowed: {KEYS})"),
        ("x: 1", f"1: x: unknown key; did you mean 'start.x' or 'path.x'? (allowed: {KEYS})"),
        ('"a\\nb": 1', rf"1: a\nb: unknown key (allowed: {KEYS})"),
        (
            "simulation: {duration: 0.015}",
            "24: simulation.duration: 0.015 s is no whole number of steps of 0.01 s; try 0.01",
        ),
    ],
)
def test_a_wrong_section_is_one_sentence_at_its_place(text, says):
    assert told(f"{SOUND}{text}\n") == [f"a.yaml:6:{says}"]


@pytest.mark.parametrize(
    ("key", "content", "says"),
    [
        ("control.period", "0.015", "control.period: 0.015 s is no whole number of steps of 0.01"),
        ("actuator.command.delay", "0.004", "actuator.command.delay: 0.004 s is no whole number"),
        ("controller", "{kind: zigzag, check_every: 0.015}", "controller.check_every: 0.015 s is"),
        (
            "controller",
            "{kind: adaptive_neural, rate: difference, difference_step: 0.04}",
            "controller.difference_step: 0.04 s is no whole number of control periods of 0.03 s",
        ),
        (
            "measurement",
            "{kind: sensors, heading: {period: 0.015}}",
            "measurement.heading.period: 0.015 s is no whole number of steps",
        ),
    ],
)
def test_a_period_that_does_not_fit_is_one_sentence_with_its_key(key, content, says):
    (line,) = told(
        SOUND + "control: {period: 0.03}\n" * ("control periods" in says), [f"{key}={content}"]
    )
    assert line.startswith(f"--set {key}={content}: {says}")


def test_a_law_among_several_is_wrong_once():
    several = "controllers:\n  zag: {kind: zigzag, check_every: 0.015}\n  pid: {kind: pid}"
    (line,) = told(SOUND.replace("controller: {kind: pid}", several))
    assert line.startswith("a.yaml:6:36: controllers.zag.check_every: 0.015 s is no whole")


@pytest.mark.parametrize(
    ("sound", "wrong", "says"),
    [
        (
            "{preset: paper}",
            "{preset: paper, X_u: 0.5}",
            "1:30: vessel.X_u: must be a number not above 0 [kg/s], found 0.5; it is "
            "negative here, as it is published with the force: -0.5?",
        ),
        (
            "{preset: paper}",
            "{preset: paper, X_udot: 100}",
            "1:9: vessel: the mass matrix is not positive definite: m11 = -76.2 kg, m22 = 33.8 kg, "
            "m33 = 2.76 kg m2, m23 = 0, m32 = 0 kg m; added masses are negative numbers",
        ),
        (
            "{preset: paper}",
            "{preset: papr}",
            "1:18: vessel.preset: unknown vessel 'papr'; did you mean 'paper'? "
            "(allowed: " + VESSEL_NAMES + ")",
        ),
        (
            "{preset: paper}",
            "{m: 3}",
            "1:9: vessel: missing: length, beam, I_z; or take them from a preset (allowed: "
            + VESSEL_NAMES
            + ")",
        ),
        (
            "{preset: paper}",
            "paper",
            "1:9: vessel: must be a mapping of keys: preset, source, validity, length, beam, m, "
            "..., found 'paper'",
        ),
        (
            "{kind: line}",
            "{kind: lin}",
            "2:14: path.kind: unknown kind 'lin'; did you mean 'line'? "
            f"(allowed: {', '.join(PATHS)})",
        ),
        (
            "{kind: line}",
            "{radius: 1}",
            f"2:7: path.kind: missing (allowed: {', '.join(PATHS)}); radius belongs to kind "
            "circle, legs_hold or stations",
        ),
        (
            "{kind: pid}",
            "{K_Pu: 60}",
            f"5:13: controller.kind: missing (allowed: {', '.join(LAWS)}); "
            "K_Pu belongs to kind pid",
        ),
        (
            "{kind: line}",
            "line",
            f"2:7: path: must be a mapping of keys with kind {A_PATH}, found 'line'; "
            "write {kind: line}",
        ),
        (
            "{kind: line}",
            "{kind: line, radius: 1}",
            "2:20: path.radius: unknown key; radius belongs to kind circle, legs_hold or stations "
            "(allowed: kind, x, y, course, speed)",
        ),
        ("{kind: line}", "{kind: waypoints}", "2:7: path: needs at least two points, has 0"),
        (
            "{kind: none}",
            "{kind: harmonic, b_u: {mean: x}}",
            "3:43: disturbance.b_u.mean: must be a number [N], found 'x'",
        ),
    ],
)
def test_a_wrong_component_is_one_sentence_at_its_place(sound, wrong, says):
    assert told(SOUND.replace(sound, wrong)) == [f"a.yaml:{says}"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "fold: jont",
            ["9: fold: must be printed, joint or none, found 'jont'; did you mean 'joint'?"],
        ),
        (
            "B_u: adaptve",
            [
                "8: B_u: must be adaptive or a number above 0 [1/s], found 'adaptve'; did you mean "
                "'adaptive'?"
            ],
        ),
        ("B_u: true", ["8: B_u: must be adaptive or a number above 0 [1/s], found true"]),
        (
            "network: {nodes: [3, 3.0, 1e1]}",
            [
                "24: network.nodes[1]: must be a whole number, found 3.0; write 3",
                "29: network.nodes[2]: must be a whole number, found 1e1; write 10",
            ],
        ),
        (
            "network: {nodes: 3, low: [1, 2], high: '1, 2, 3'}",
            [
                "20: network.nodes: must be a list of 3 whole numbers, found 3",
                "28: network.low: must be a list of 3 numbers [m/s, m/s, rad/s], found a list of 2",
                "42: network.high: must be a list of 3 numbers [m/s, m/s, rad/s], found '1, 2, 3'; "
                "write a list as [1, 2, 3]",
            ],
        ),
        (
            "network: {centers: [[1, 2], [1, 2, 3, 4], 5, [1, 2, x]]}",
            [
                f"23: network.centers[0]: {CENTER}, found a list of 2",
                f"31: network.centers[1]: {CENTER}, found a list of 4",
                f"45: network.centers[2]: {CENTER}, found 5",
                "55: network.centers[3][2]: must be a number [rad/s], found 'x'",
            ],
        ),
        (
            "network: {widths: [1, -1, 1]}",
            ["12: network: widths must be positive, got [1.0, -1.0, 1.0]"],
        ),
        (
            "network: {widths: 3}",
            ["21: network.widths: must be a list of 3 numbers or null [m/s, m/s, rad/s], found 3"],
        ),
    ],
)
def test_a_key_of_a_kind_is_told_without_the_kind(text, says):
    law = SOUND.replace(
        "controller: {kind: pid}", f"controller:\n  kind: adaptive_neural\n  {text}"
    )
    places = (says.split(": ", 1) for says in says)
    assert told(law) == [f"a.yaml:7:{column}: controller.{said}" for column, said in places]


def test_what_is_missing_is_told_at_the_file():
    assert told("description: nothing else\n") == [
        "a.yaml: vessel: missing: length, beam, m, I_z; or take them from a preset (allowed: "
        + VESSEL_NAMES
        + ")",
        f"a.yaml: path: missing; must be a mapping of keys with kind {A_PATH}",
        f"a.yaml: disturbance: missing; must be a mapping of keys with kind {A_SEA} or a list of "
        "these",
        f"a.yaml: actuator: missing; must be a mapping of keys with kind {AN_ACTUATOR}",
        f"a.yaml: controller: missing; must be a mapping of keys with kind {A_LAW}",
    ]


def test_all_faults_come_at_once_in_the_order_of_lines():
    text = (
        "log: {every: 0}\nlog: {}\n" + SOUND.replace("paper", "papr") + "start: {x: .nan, z: 1}\n"
    )
    places = [line.split(": ")[:2] for line in told(text)]
    assert places == [
        ["a.yaml:1:14", "log.every"],
        ["a.yaml:2:1", "log"],
        ["a.yaml:3:18", "vessel.preset"],
        ["a.yaml:8:12", "start.x"],
        ["a.yaml:8:18", "start.z"],
    ]


def test_a_fault_does_not_hide_others_in_the_same_section():
    text = SOUND.replace("{preset: paper}", "{preset: papr, m: -1, lenght: 3}")
    assert [line.split(": ")[1] for line in told(text)] == [
        "vessel.preset",
        "vessel.m",
        "vessel.lenght",
    ]


def test_a_value_that_both_vessels_have_is_told_once():
    assert len(told(SOUND + "nominal: {X_u: -1}\n", ["vessel.m=-1"])) == 1
