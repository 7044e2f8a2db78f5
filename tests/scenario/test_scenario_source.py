"""YAML texts to trees: what every scalar means, and where every fault stands."""

import math
from itertools import pairwise

import pytest

from podusv_cli.scenario import yaml_text
from podusv_cli.scenario.yaml_text import MAX_BYTES, MAX_DEPTH, MAX_NODES, read, read_text, resolve
from podusv_cli.scenario.yaml_tree import Fault, Mark, plain


def faults_of(text: str) -> list[str]:
    faults: list[Fault] = []
    read(text, "a.yaml", faults)
    return [f"{fault.mark}: {fault.key}: {fault.text}".replace(": : ", ": ") for fault in faults]


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("1e-3", 0.001),
        ("1E5", 1e5),
        ("1e-05", 1e-05),
        ("1.0e+16", 1e16),
        (".5", 0.5),
        ("5.", 5.0),
        ("-0.0", -0.0),
        ("+2.5", 2.5),
        ("2", 2),
        ("-7", -7),
        ("0", 0),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("no", "no"),
        ("yes", "yes"),
        ("on", "on"),
        ("off", "off"),
        ("y", "y"),
        ("017", "017"),
        ("00.5", "00.5"),
        ("1:30", "1:30"),
        ("1_000", "1_000"),
        ("0x1F", "0x1F"),
        ("nan", "nan"),
        ("inf", "inf"),
        ("2026-11-20", "2026-11-20"),
        ("1.2.3", "1.2.3"),
        ("e5", "e5"),
        (".", "."),
        ("-", "-"),
        ("1e", "1e"),
    ],
)
def test_a_plain_scalar_means_what_yaml_1_2_says_and_nothing_else(text, meaning):
    found = resolve(text)
    assert (type(found), repr(found)) == (type(meaning), repr(meaning))


def test_a_whole_number_of_any_length_stays_exact_or_becomes_infinite():
    assert resolve("9" * 300) == int("9" * 300)
    assert resolve("9" * 5000) == math.inf


def test_text_in_quotes_and_blocks_stays_text():
    node = read('a: "1"\nb: \'true\'\nc: "null"\nd: |\n  1\ne: >-\n  2\n  3\n', "a.yaml", [])
    assert node is not None
    assert plain(node) == {"a": "1", "b": "true", "c": "null", "d": "1\n", "e": "2 3"}


def test_every_key_and_value_knows_its_line_and_column():
    node = read("# first line\na: 1\nb:\n  c: [10, 20]\n", "dir/a.yaml", [])
    assert node is not None
    inner = node.mapping["b"].mapping["c"]
    assert str(node.mapping["a"].key_mark) == "dir/a.yaml:2:1"
    assert str(node.mapping["a"].mark) == "dir/a.yaml:2:4"
    assert (str(inner.key_mark), str(inner.mark)) == ("dir/a.yaml:4:3", "dir/a.yaml:4:6")
    assert str(inner.content[1].mark) == "dir/a.yaml:4:11"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a: 1\nb: 2\na: 3\n", "a.yaml:3:1: a: given twice; first on line 1"),
        ("s:\n  a: 1\n  a: 1\n", "a.yaml:3:3: s.a: given twice; first on line 2"),
        ("{a: 1, a}", "a.yaml:1:8: a: given twice; first on line 1"),
        ("1: a\n", "a.yaml:1:1: keys are words, found 1"),
        ("true: a\n", "a.yaml:1:1: keys are words, found true"),
        ("?\n: a\n", "a.yaml:1:2: keys are words, found nothing"),
        (": a\n", "a.yaml:1:1: a colon without a key before it"),
        ("? [a, b]\n: 1\n", "a.yaml:1:3: keys are words, found a list of 2"),
        ("a: .nan\n", "a.yaml:1:4: a: .nan is not a finite number"),
        ("a: [1, -.INF]\n", "a.yaml:1:8: a[1]: -.INF is not a finite number"),
        ("a: 1e999\n", "a.yaml:1:4: a: 1e999 is too large; numbers must be finite"),
        ("a: *b\n", "a.yaml:1:4: a: alias *b; write the value out, or use extends"),
        ("a: &b 1\n", "a.yaml:1:4: a: anchor &b; scenarios have no anchors"),
        ("a: !!str 1\n", "a.yaml:1:4: a: tag 'tag:yaml.org,2002:str'; scenarios have no tags"),
        ("a: !x {}\n", "a.yaml:1:4: a: tag '!x'; scenarios have no tags"),
        ("a: 1\n---\nb: 2\n", "a.yaml:2:1: a second document starts here; write one a file"),
        ("", "a.yaml: is empty"),
        ("# nothing\n", "a.yaml: is empty"),
        ("\ufeffa: 1\n", "a.yaml:1:1: starts with a byte order mark; save as UTF-8 without BOM"),
        ("a: 1\nb: \x07\n", "a.yaml:2:4: character U+0007 cannot stand in YAML"),
        ('a: "\\0"\n', "a.yaml:1:4: a: character U+0000 cannot stand in text"),
        ('a: "\\ud800"\n', "a.yaml:1:4: a: character U+D800 cannot stand in text"),
        ('a: "\\U99999999"\n', "a.yaml:1:2: what follows is not valid YAML"),
        ("%YAML 1.1.1.1\n", "a.yaml:1:10: not valid YAML: expected a digit or ' ', but found '.'"),
        ("%YAML " + "9" * 5000 + ".1\n---\na: 1\n", "a.yaml:1:1: what follows is not valid YAML"),
        ("a:\n\tb: 1\n", "a.yaml:2:1: a tab; use spaces"),
        ("a: 1\t# x\n", "a.yaml:1:5: a tab; use spaces"),
        (
            "a: @b\n",
            "a.yaml:1:4: found character '@' that cannot start any token; put the value in quotes",
        ),
        ("a: 'b\nc: 1\n", "a.yaml:1:4: the text in quotes that starts here never ends"),
        ("a: [1, 2\n", "a.yaml:1:4: the bracket opened here is never closed"),
        ("a: [1,\n", "a.yaml:2:1: the file ends in the middle of a list or mapping"),
        (
            "a:\n  b: 1\n c: 2\n",
            "a.yaml:3:2: does not line up with the lines above; check the indentation",
        ),
        (
            "a:1\nb: 2\n",
            "a.yaml:2:2: a colon where no key can be; check the indentation, the space after every "
            "colon, and quote text with a colon in it",
        ),
        ("a: ]\n", "a.yaml:1:4: not valid YAML: expected the node content, but found ']'"),
        ("a: 1\n...\nb: 2\n", "a.yaml:3:1: text after the end of the document"),
    ],
)
def test_a_fault_is_one_sentence_at_its_place(text, told):
    assert faults_of(text) == [told]


def test_all_faults_are_told_together_up_to_where_reading_stops():
    told = faults_of("a: .inf\na: 1\n2: 3\nb: *x\nc: [1\n")
    places = [line.split(": ")[0] for line in told]
    assert places == ["a.yaml:1:4", "a.yaml:2:1", "a.yaml:3:1", "a.yaml:4:4", "a.yaml:5:4"]


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
def test_nesting_stops_at_the_limit_whatever_its_depth(opening):
    told = faults_of(opening * 30_000)
    assert [line.partition(": ")[2] for line in told] == [f"nested deeper than {MAX_DEPTH} levels"]


def test_aliases_of_aliases_do_not_grow():
    bomb = "".join(f"{c}: &{c} [{', '.join([f'*{b}'] * 9)}]\n" for b, c in pairwise("abcdefghi"))
    told = faults_of("a: &a [x]\n" + bomb)
    assert told[2] == "a.yaml:2:8: b[0]: alias *a; write the value out, or use extends"
    assert len(told) == 1 + 8 * (1 + 9)


def test_values_are_counted():
    row = "[" + "1," * (MAX_NODES - 4) + "1]"  # with the mapping, its key and the list
    assert faults_of(f"a: {row}") == []
    assert faults_of(f"a: [{row}]") == [f"a.yaml:1:{2 * MAX_NODES - 2}: more than 20,000 values"]


def test_without_places_marks_are_the_source_alone():
    faults: list[Fault] = []
    read("a: .nan\nb: [\n", "--set x=1", faults, placed=False)
    assert [str(fault.mark) for fault in faults] == ["--set x=1", "--set x=1"]


def test_files_that_cannot_be_read_say_why(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "latin.yaml").write_bytes("a: 1\nbé: 2\n".encode("latin-1"))
    (tmp_path / "wide.yaml").write_bytes("a: 1\n".encode("utf-16"))
    (tmp_path / "large.yaml").write_bytes(b"#" * (MAX_BYTES + 1))
    faults: list[Fault] = []
    for name in ("missing.yaml", "folder", "latin.yaml", "wide.yaml", "large.yaml"):
        assert read_text(name, Mark(name), "", faults) is None
    assert [f"{fault.mark}: {fault.text}" for fault in faults] == [
        "missing.yaml: cannot be read: no such file or directory",
        "folder: cannot be read: is a directory",
        "latin.yaml:2:2: byte 0xe9 is no UTF-8; save the file as UTF-8",
        "wide.yaml:1:1: byte 0xff is no UTF-8; save the file as UTF-8",
        "large.yaml: is larger than 1,000,000 bytes",
    ]


def test_a_file_at_the_size_limit_is_read(tmp_path):
    path = tmp_path / "full.yaml"
    path.write_bytes(b"#" * yaml_text.MAX_BYTES)
    assert read_text(str(path), Mark(str(path)), "", []) == "#" * MAX_BYTES
