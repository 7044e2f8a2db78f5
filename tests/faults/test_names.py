"""Names that try to leave, links in the way, names that are too long or too odd for a folder."""

import json
from pathlib import Path

import pytest
from command_samples import BASE, commanded, write
from scenario_samples import told

from podusv_cli.storage import manifest


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    """A command without figures, in a folder inside the test's own."""
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return commanded(monkeypatch, capsys)


LEAVING = ["../up", "/tmp/up", "a/b", "..", ".", ".hidden", "-rf", "--help", "a\\b", "a:b", "~"]
ODD = [
    "a b",
    "ship\u202e",
    "\u0130stanbul",
    "e\u0301",
    "\U0001f6a2",
    "a\u200bb",
    "\uff0e\uff0e",
    "",
]
NAMED = {
    "name": "name: {}",
    "label": "controllers: {{{}: {{kind: dsc}}}}",
    "claim": 'claims: {{{}: {{says: s, source: p, expect: "1 < 2"}}}}',
}


@pytest.mark.parametrize("where", NAMED)
def test_a_name_that_is_no_plain_word_is_told_in_a_line(where):
    for name in (*LEAVING, *ODD, "a" * 81, "a" * 300):
        (line,) = told(f"{BASE}{NAMED[where].format(json.dumps(name))}\n")
        assert line.isprintable()


@pytest.mark.parametrize("name", ["../up", "ship\u202e"], ids=ascii)
@pytest.mark.parametrize("where", [*NAMED, "assigned"])
def test_a_name_that_is_no_plain_word_is_refused(podusv, name, where):
    text = NAMED[where].format(json.dumps(name)) if where in NAMED else ""
    words = [] if where in NAMED else ["--set", f"name={name}"]
    said = podusv("compare", write("a.yaml", f"{BASE}{text}\n"), "--no-figures", *words)
    assert (said.code, said.out) == (2, "")
    assert said.err.count("\n") == 1
    assert said.err.rstrip("\n").isprintable()
    assert [path.name for path in Path().iterdir()] == ["a.yaml"]
    assert [path.name for path in Path("..").iterdir()] == ["work"]


@pytest.mark.parametrize("labels", [("A", "a"), ("CON", "x"), ("Stiff", "soft")])
def test_labels_cannot_differ_in_case_alone(podusv, labels):
    """On disks that do not tell cases apart they would share a folder."""
    runs = ", ".join(f"{label}: {{kind: dsc}}" for label in labels)
    said = podusv("compare", write("a.yaml", BASE + f"controllers: {{{runs}}}\n"), "--no-figures")
    assert said.code == 2
    assert f"controllers.{labels[0]}" in said.err


@pytest.mark.slow
def test_scenarios_whose_names_differ_in_case_alone_get_folders_of_their_own(podusv):
    write("Ship.yaml", BASE)
    write("other.yaml", BASE + "name: ship\n")
    said = podusv("compare", "Ship.yaml", "other.yaml", "--out", "x", "--no-figures", "-q")
    assert said.code == 0
    folders = [path.name for path in Path("x").iterdir() if path.is_dir()]
    assert len({name.casefold() for name in folders}) == len(folders) == 2


@pytest.mark.parametrize("target", ["elsewhere", "nowhere", "."])
@pytest.mark.parametrize("force", [[], ["--force"]])
def test_a_link_in_place_of_the_folder_is_left_alone(podusv, target, force):
    Path("elsewhere").mkdir()
    Path("elsewhere/kept").write_text("kept")
    Path("x").symlink_to(target)
    said = podusv("run", write("a.yaml", BASE), "--out", "x", "--no-figures", *force)
    assert said.code == 5
    assert said.err.count("\n") == 1
    assert Path("x").is_symlink()
    assert [path.name for path in Path("elsewhere").iterdir()] == ["kept"]


def test_out_may_begin_with_a_dash_and_hold_any_letters(podusv):
    config = write("a.yaml", BASE)
    for out in ("-x", "\u0130 \u202e\U0001f6a2", "e\u0301", "a'b\"c", "new\nline"):
        said = podusv("run", config, f"--out={out}", "--no-figures", "-q")
        assert said.code == 0, said.err
        assert manifest.check(Path(out)).status == "finished"


def test_a_scenario_may_begin_with_a_dash(podusv):
    write("-a.yaml", BASE + "name: a\n")
    assert podusv("run", "--out", "x", "--no-figures", "-q", "--", "-a.yaml").code == 0


@pytest.mark.parametrize("out", ["a" * 300, "a" * 255, "a/" * 3000])
def test_a_folder_that_cannot_be_is_one_line(podusv, out):
    said = podusv("run", write("a.yaml", BASE), "--out", out, "--no-figures")
    assert said.code in (2, 5)
    assert said.err.count("\n") == 1
    assert "Traceback" not in said.err
