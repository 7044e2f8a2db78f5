"""What users write and call their folders, in a terminal, Markdown, CSV, LaTeX, HTML, JSON."""

import csv
import io
import json
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from command_samples import BASE, Command, commanded, write
from comparison_samples import FRAME, verdicts
from html_tree import tree
from page_samples import page

from podusv_cli.cli import progress, terminal
from podusv_cli.comparison import claims, report, table
from podusv_cli.core import escaping, json_text
from podusv_cli.expressions.verdict import as_markdown
from podusv_cli.pages.page import environment
from podusv_cli.storage import csv_files

TURNED, COLOUR = "\u202e", "\x1b[31m"  # letters from right to left from here on; red from here on
EVIL = f"=cmd|'/C x'!A0{COLOUR}{TURNED}\x9b1m\n# <script>[a](b)`*_\u200b"
NASTY = [chr(n) for n in (*range(32), *range(127, 160), 0x200B, 0x200E, 0x2028, 0x202E, 0x2066)]


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write("a.yaml", BASE)
    return commanded(monkeypatch, capsys)


def nasty(text: str) -> set[str]:
    """The letters in it that move a cursor or turn others around, but new lines."""
    return {*text} & {*NASTY} - {"\n"}


@pytest.mark.parametrize("form", ["visible", "csv", "latex", "markdown"])
def test_no_format_has_a_letter_that_does_not_show(form):
    for letter in [*NASTY, "\ud800", "\U000e0041"]:
        assert getattr(escaping, form)(f"a{letter}b").isprintable(), ascii(letter)


def test_text_of_any_language_is_left_as_it_is():
    for text in (
        "Kurs 5 m/s",
        "\u03b1 = 1\u202f\u00b0",
        "\u8239 \U0001f6a2",
        "\u05e1\u05d9\u05e8\u05d4",
    ):
        assert escaping.visible(text) == text
        assert escaping.markdown(text).split() == text.split()
        assert escaping.csv(text) == escaping.lines(text) == escaping.json(text) == text


def test_markdown_is_text_and_stays_in_its_line():
    assert escaping.markdown("a_b_c\n# d | <b> [e](f) ![g][h] *i* `j` &lt; \\ _k_ l_") == (
        "a_b_c # d | \\<b\\> [e\\](f) ![g\\][h] \\*i\\* \\`j\\` \\&lt; \\\\ \\_k\\_ l\\_"
    )
    assert escaping.markdown("2 * max(abs(a.tau_u)) in [0, 1]") == "2 * max(abs(a.tau_u)) in [0, 1]"
    assert escaping.markdown_cell("|x|") == "\\|x\\|"
    assert escaping.markdown_code("a < b |\n`c`") == "`a < b \\| 'c'`"


@pytest.mark.parametrize("sign", [*"=+-@", "\uff1d", "\t=", "\r="])
def test_a_cell_is_no_formula(sign):
    assert escaping.csv(f"{sign}1+1")[0] in "'\\"
    assert escaping.csv("1=1") == "1=1"


def test_html_is_text():
    made = environment("podusv_cli.comparison")
    shown = made.from_string("<p a='{{ text }}'>{{ text }}</p>")
    text = f"<b a='\"'>&\n{COLOUR}"
    (element,) = tree(shown.render(text=text)).all()
    assert (element.tag, element.raw) == ("p", "<b a='\"'>&\n\\x1b[31m")
    assert element.attributes == {"a": element.raw}


def test_json_says_the_same_without_the_letters():
    content = {"a": "".join(NASTY) + "\U000e0041\u8239", "b": [1, "\ud800"]}
    text = json_text.encode(content).decode()
    assert not nasty(text)
    assert "\u8239" in text
    assert json.loads(text) == content


def test_no_heading_and_no_cell_of_a_csv_file_is_a_formula():
    frame = pd.DataFrame({"=a": ["-b", "c,d"], EVIL: [1.5, np.inf], "e": [True, 2]})
    rows = [
        [escaping.csv("=a"), escaping.csv(EVIL), "e"],
        ["'-b", "1.5", "True"],
        ["c,d", "inf", "2"],
    ]
    assert list(csv.reader(io.StringIO(csv_files.text(frame)))) == rows
    content = [list(frame.columns), *frame.to_numpy().tolist()]
    assert list(csv.reader(io.StringIO(csv_files.lines(content)))) == rows


def test_the_tables_of_a_comparison_hold_no_label_that_is_more_than_text():
    frame = table.table({EVIL: FRAME.of("a"), "=b": FRAME.of("lost")})
    head = next(csv.reader(io.StringIO(table.as_csv(frame))))
    assert head[2:] == [escaping.csv(EVIL), "'=b", f"'=b/{escaping.visible(EVIL)}"]
    for text in (table.as_markdown(frame, {EVIL: EVIL}), table.as_latex(frame)):
        assert not nasty(text)
        assert "\n#" not in text
    assert "<script>" not in table.as_markdown(frame, {EVIL: EVIL})
    assert f"\n- {escaping.markdown('=cmd')}" in table.as_markdown(frame, {EVIL: "killed"})
    assert r"\textbackslash{}x1b" in table.as_latex(frame)


def test_the_verdicts_in_markdown_are_text():
    plain = verdicts()[0]
    odd = {name: f"{name} {EVIL}" for name in ("says", "source", "remark")}
    verdict = claims.RunsVerdict(
        "name", plain.claim.model_copy(update=odd), None, {EVIL: 1.0}, EVIL
    )
    text = as_markdown([verdict])
    assert not nasty(text)
    assert "<script>" not in text
    assert "\n#" not in text
    assert f"- name: {escaping.markdown(odd['remark'])}\n" in text
    row = text.splitlines()[2]
    assert row.replace("\\|", "").count("|") == 6


def test_every_text_of_the_report_is_text():
    odd = f"<script>{EVIL}"
    plain = page()
    text = page(
        title=odd,
        endings={odd: odd},
        differences={odd: {odd: odd}},
        table=replace(FRAME, columns=(odd, *FRAME.columns[1:])),
        figures=[report.Picture(odd, odd, b"<svg/>", odd)],
        provenance={odd: odd},
    )
    assert not nasty(text)
    assert len(tree(plain).all("script")) == len(tree(text).all("script"))


def made(podusv: Command, names: tuple[str, str]) -> tuple[str, str]:
    """Finished runs in folders of these names."""
    for name in names:
        said = podusv("run", "a.yaml", f"--out={name}", "--no-figures", "-q")
        assert said == (0, f"{name}\n", "")  # in a pipe a script gets the very name
    return names


@pytest.mark.slow
def test_no_command_lets_a_folders_name_through(podusv):
    one, other = made(podusv, (f"=a{COLOUR}\n{TURNED}", f"-b\x9b{TURNED}"))
    for words in (
        ("compare", "--figure", "errors", "--out", "x", one, f"./{other}"),
        ("compare", "--json", "--no-figures", "--out", "y", one, f"./{other}"),
        ("rerun", one),
        ("rerun", one, "--out", f"again{COLOUR}"),
        ("rerun", "--json", one),
        ("diff", one, "x"),
        ("diff", "--json", one, f"./{other}"),
        ("run", "a.yaml", f"--out={one}"),
        ("run", "--json", "--no-figures", "a.yaml", f"--out=c{COLOUR}"),
        ("run", f"{COLOUR}\n.yaml"),
        ("validate", f"{COLOUR}\n.yaml"),
        ("verify", f"{COLOUR}\n.yaml"),
        ("verify", one),
        ("plot", one, "--figure", "errors", "--out", "x"),
    ):
        said = podusv(*words)
        assert said.code in (0, 2, 3, 5), said
        assert not nasty(said.out + said.err), words
        assert "Traceback" not in said.err
    texts = ("comparison.csv", "comparison.md", "comparison.tex", "report.html", "provenance.json")
    for name in texts:
        assert not nasty(Path("x", name).read_text()), name
    assert podusv("run", "a.yaml", f"--out={one}").err.count("\n") == 1


def test_a_figure_with_such_a_name_is_one_that_browsers_read(podusv):
    names = made(podusv, (f"a{COLOUR}{TURNED}", "b"))
    said = podusv("plot", *names, "--figure", "trajectory", "--format", "svg", "--out", "x")
    assert (said.code, said.err) == (0, "")
    ElementTree.parse("x/trajectory.svg")
    assert not nasty(Path("x/trajectory.svg").read_text())


def test_whatever_prints_lines_prints_text(capsys):
    terminal.echo(EVIL, EVIL, err=True)
    terminal.echo(EVIL)
    terminal.echo_entry(EVIL, EVIL, facts=EVIL)
    terminal.echo_table([EVIL, EVIL, EVIL], [[EVIL, EVIL, EVIL]])
    terminal.warn_of_differences({EVIL: {EVIL: EVIL, "b": EVIL}})
    terminal.Warnings()(EVIL)
    for shown in capsys.readouterr():
        assert escaping.visible(EVIL)[:8] in shown
        assert not nasty(shown)
        assert "\n#" not in shown


def test_a_bar_shows_names_as_they_are(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "PATIENCE", -1.0)
    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress.progress_bars(wanted=True) as advance:
        assert advance is not None
        advance(f"[/red]{TURNED}{COLOUR}", 0.5)
    shown = sys.stderr.getvalue()  # type: ignore[attr-defined]
    assert "[/red]\\u202e\\x1b[31m" in shown
