"""What YAML and its readers are known to make of innocent text, in a whole scenario.

Single values and syntax: tests/test_scenario_source.py; single keys:
tests/test_scenario_checking.py.
"""

from __future__ import annotations

from itertools import pairwise

import pytest
from scenario_samples import SOUND, loaded, told

BOMB = "".join(f"{c}: &{c} [{', '.join([f'*{b}'] * 9)}]\n" for b, c in pairwise("abcdefghi"))
TRAPS = {
    "exponent without a point": (
        "simulation: {step: 1e-3}",
        [],
    ),
    "no": (
        "simulation: {compiled: no}",
        ["6:24: simulation.compiled: must be true or false, found 'no'; write false"],
    ),
    "sexagesimal": (
        "simulation: {duration: 1:30}",
        [
            "6:24: simulation.duration: must be a number above 0 [s], found '1:30'; write the "
            "number out, colons are not read as minutes"
        ],
    ),
    "octal": (
        "simulation: {duration: 017}",
        [
            "6:24: simulation.duration: must be a number above 0 [s], found '017'; numbers have "
            "no leading zeros"
        ],
    ),
    "given twice": (
        "path: {kind: line}",
        ["6:1: path: given twice; first on line 2"],
    ),
    "not a number": (
        "start: {x: .nan}",
        ["6:12: start.x: .nan is not a finite number"],
    ),
    "infinite": (
        "start: {x: -.inf}",
        ["6:12: start.x: -.inf is not a finite number"],
    ),
    "too large": (
        "start: {x: 1e999}",
        ["6:12: start.x: 1e999 is too large; numbers must be finite"],
    ),
    "true for one": (
        "start: {x: true}",
        ["6:12: start.x: must be a number [m], found true"],
    ),
    "quoted number": (
        "start: {x: '1.5'}",
        ["6:12: start.x: must be a number [m], found '1.5'; leave out the quotes"],
    ),
    "whole number for a float": (
        "start: {x: 3}",
        [],
    ),
    "float for a whole number": (
        "log: {every: 2.0}",
        ["6:14: log.every: must be a whole number not below 1 [steps], found 2.0; write 2"],
    ),
    "date": (
        "name: 2026-11-20",
        [],
    ),
    "merge key": (
        "start: {<<: {x: 1.0}}",
        ["6:9: start.<<: unknown key (allowed: x, y, psi, u, v, r)"],
    ),
    "alias without anchor": (
        "start: *here",
        ["6:8: start: alias *here; write the value out, or use extends"],
    ),
    "anchor": (
        "start: &here {x: 1.0}",
        ["6:8: start: anchor &here; scenarios have no anchors"],
    ),
    "tag of Python": (
        "start: !!python/object/apply:os.system [ls]",
        [
            "6:8: start: tag 'tag:yaml.org,2002:python/object/apply:os.system'; scenarios have "
            "no tags",
            "6:8: start: must be a mapping of keys: x, y, psi, u, v, r, found a list of 1",
        ],
    ),
    "tab": (
        "start:\n\tx: 1.0",
        ["7:1: a tab; use spaces"],
    ),
    "deep": (
        "start: " + "[" * 30_000,
        ["6:40: nested deeper than 32 levels"],
    ),
    "deep mappings": (
        "start: " + "{a: " * 30_000,
        ["6:136: nested deeper than 32 levels"],
    ),
    "impossible character": (
        'name: "\\UFFFFFFFF"',
        ["6:5: what follows is not valid YAML"],
    ),
    "half a character": (
        'name: "\\ud83d"',
        ["6:7: name: character U+D83D cannot stand in text"],
    ),
    "null character": (
        'name: "a\\0b"',
        ["6:7: name: character U+0000 cannot stand in text"],
    ),
    "bell": (
        "name: a\x07b",
        ["6:8: character U+0007 cannot stand in YAML"],
    ),
    "directive": (
        "%YAML 1.1.1.1",
        ["6:10: not valid YAML: expected a digit or ' ', but found '.'"],
    ),
    "two documents": (
        "---\nname: b",
        ["6:1: a second document starts here; write one a file"],
    ),
}


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_is_told_in_these_words(trap: str) -> None:
    text, says = TRAPS[trap]
    assert told(SOUND + text + "\n") == [f"a.yaml:{line}" for line in says]


def test_numbers_mean_what_they_look_like() -> None:
    scenario = loaded(SOUND + "simulation: {step: 1e-3}\nstart: {x: 3}\n").scenario
    assert scenario.simulation.step == 0.001
    assert scenario.start.x == 3.0


def test_aliases_of_aliases_do_not_grow() -> None:
    said = told(SOUND + "a: &a [x]\n" + BOMB)
    assert said[3] == "a.yaml:7:8: b[0]: alias *a; write the value out, or use extends"
    assert len(said) == 2 + 8 * (1 + 9)
