"""Files in, scenarios out: origins, laws to compare, claims, further checks, how much work."""

import re
from pathlib import Path

import pytest
from conftest import kinds
from counting import counted
from scenario_samples import SOUND, loaded, told

from podusv_cli.components.controllers.pid import Pid
from podusv_cli.core.errors import ScenarioError
from podusv_cli.scenario.load import Loaded, load, load_text, values

*OTHERS, LAST = kinds("controllers")
A_LAW = f"{', '.join(OTHERS)} or {LAST}"


def test_every_value_has_an_origin():
    got = loaded()
    assert list(got.origins) == list(values(got.scenario))
    assert got.origins["name"] == "a.yaml"
    assert got.origins["controller.kind"] == "a.yaml:5:20"


def test_loading_a_scenario_is_little_work():
    loaded()  # tables are made once
    _, calls = counted(loaded)
    assert calls < 40_000  # 18 136; some 10 ms


SEVERAL = SOUND.replace("{kind: pid}", "{kind: dsc, k_ze: 0.4, T_u: 0.5, network: {spread: 2}}")


def test_laws_to_compare_start_from_the_keys_that_they_share_with_the_controller():
    text = SEVERAL + "controllers: {slow: {kind: pid, K_Pu: 5}, fast: {k_ze: 2}}\n"
    got = loaded(text)
    slow, fast = got.scenario.controllers["slow"], got.scenario.controllers["fast"]
    assert (slow.kind, slow.k_ze, slow.K_Pu) == ("pid", 0.4, 5.0)
    assert (fast.kind, fast.k_ze, fast.T_u, fast.network.spread) == ("dsc", 2.0, 0.5, 2.0)
    assert got.origins["controllers.slow.k_ze"] == "a.yaml:5:31"
    assert got.origins["controllers.fast.k_ze"] == "a.yaml:6:56"


def test_a_fault_of_a_law_to_compare_is_told_without_its_kind():
    text = (
        SEVERAL + "controllers: {slow: {kind: pid, T_u: x, K_Pu: -1}, fast: {T_u: x}, other: 3}\n"
    )
    assert told(text) == [
        "a.yaml:6:33: controllers.slow.T_u: unknown key; T_u belongs to kind dsc "
        f"(allowed: {', '.join(Pid.model_fields)})",
        "a.yaml:6:47: controllers.slow.K_Pu: must be a number not below 0 [kg/s], found -1",
        "a.yaml:6:64: controllers.fast.T_u: must be a number above 0 [s], found 'x'",
        f"a.yaml:6:75: controllers.other: must be a mapping of keys with kind {A_LAW}, found 3",
    ]


def test_a_fault_of_the_controller_is_told_once_however_many_laws_take_it_over():
    text = SEVERAL.replace("0.4", "-1") + "controllers: {a: {kind: pid}, b: {}, c: {}}\n"
    assert told(text) == [
        "a.yaml:5:31: controller.k_ze: must be a number not below 0 [1/s], found -1"
    ]


def test_faults_of_claims_are_told_at_their_name():
    sound = "claims:\n C1: {says: s, source: p, expect: e}\n"
    assert told(SOUND + sound + " C2: {sayz: s, source: 2, tolerance: 1}\n") == [
        "a.yaml:8:6: claims.C2.says: missing; must be text",
        "a.yaml:8:6: claims.C2.expect: missing; must be text",
        "a.yaml:8:7: claims.C2.sayz: unknown key; did you mean 'says'? "
        "(allowed: says, source, expect, given, tolerance, untestable, remark)",
        "a.yaml:8:24: claims.C2.source: must be text, found 2",
        "a.yaml:8:38: claims.C2.tolerance: must be a number not below 0 and below 1, found 1",
    ]


def test_further_checks_are_told_at_the_place_of_the_key():
    claims = "claims:\n  C1: {says: s, source: p, expect: e}\n"

    def look(loaded: Loaded) -> list[tuple[str, str]]:
        return [(f"claims.{name}.expect", "no such run") for name in loaded.scenario.claims]

    with pytest.raises(ScenarioError) as raised:
        load_text(SOUND + claims, "a.yaml", checks=[look])
    assert str(raised.value) == "a.yaml:7:36: claims.C1.expect: no such run"


MISTAKES = {
    "path: {kind: line, course: 0,3}\n": "keys are words, found 3; write a decimal point: 0.3",
    "path: {kind: line, course: 0,05}\n": "keys are words, found '05'; write a decimal point: 0.05",
    "path: {kind: line, course: -1,5, x: 2}\n": "found 5; write a decimal point: -1.5",
    "path: {kind: line, course:0,3}\n": "write a blank after the colon: course: 0 (allowed: ",
    "description: {gain} of a law\n": "put a text that begins with a bracket or a brace in quotes",
    "description: [gain] of a law\n": "put a text that begins with a bracket or a brace in quotes",
    "description: {gain}\n": "found a mapping of keys; put text with braces in quotes",
}


@pytest.mark.parametrize("line", MISTAKES)
def test_a_comma_for_a_point_and_braces_without_quotes_are_named(line):
    faults = told(f"{SOUND}{line}" if "path" not in line else re.sub("path: .*\n", line, SOUND))
    assert MISTAKES[line] in faults[0]


def test_a_comma_for_a_point_is_named_without_a_blank_before_the_number():
    faults = told(re.sub("path: .*\n", "path: {kind: line, course:-1,5}\n", SOUND))
    assert [one.endswith("found 5; write a decimal point: -1.5") for one in faults] == [False, True]


def test_a_key_that_is_a_number_is_no_decimal_comma():
    fault = told(SOUND + "claims: {a: x, 5: y}\n")[-1]
    assert fault.endswith("keys are words, found 5")


def test_a_misspelled_section_is_told_before_what_it_leaves_missing():
    first, *rest = told(SOUND.replace("controller:", "contoller:"))
    assert "contoller: unknown key; did you mean 'controller'?" in first
    assert any("controller: missing" in one for one in rest)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("base", "base.yaml"),
        ("bsae.yaml", "base.yaml"),
        ("sub/mine", "sub/mine.yml"),
        ("mu_2017/corrected", "podusv:mu_2017/corrected.yaml"),
        ("mu_2017/corrected.yaml", "podusv:mu_2017/corrected.yaml"),
        ("zzz/q", ""),
    ],
)
def test_a_file_of_nearly_that_name_is_proposed(tmp_path, monkeypatch, name, meant):
    monkeypatch.chdir(tmp_path)
    Path("sub").mkdir()
    for file in ("base.yaml", "sub/mine.yml"):
        Path(file).write_text(SOUND)
    with pytest.raises(ScenarioError) as caught:
        load(name)
    (fault,) = caught.value.lines()
    hint = f"; did you mean '{meant}'?" if meant else ""
    assert fault == f"{name}: cannot be read: no such file or directory{hint}"
