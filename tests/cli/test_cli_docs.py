"""`podusv docs`: pages without a checkout, and a search that finds what people look for."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest
from command_samples import ROOT, Command

from podusv_cli.scenario import shipped
from podusv_cli.scenario.model import scenario_class
from podusv_cli.scenario.plugins import kinds_of
from podusv_cli.workflows import docs

TRIALS = {"schedule", "stopping", "turning_circle", "zigzag"}  # kinds that follow no target
LAWS = [kind for kind in kinds_of(scenario_class(()), "controller") if kind not in TRIALS]
SHIPPED = [page for room in ("docs", "docs/laws", "results") for page in (ROOT / room).glob("*.md")]


def test_every_page_of_docs_and_results_is_listed_with_its_title(podusv: Command) -> None:
    assert {ROOT / f"{docs._place(name)}.md" for name in docs.names()} == {*SHIPPED}
    said = podusv("docs").out
    assert re.search(r"^  write_your_law +Write your own law$", said, re.M)


@pytest.mark.parametrize("name", docs.names())
def test_a_page_in_a_pipe_is_its_markdown_with_links_that_can_be_followed(
    name: str, podusv: Command
) -> None:
    said = podusv("docs", name)
    assert (said.code, said.err) == (0, "")
    headings = re.findall(r"^# .*$", (ROOT / f"{docs._place(name)}.md").read_text(), re.M)
    assert said.out.startswith(headings[0])
    for target in re.findall(r"`podusv docs ([^`]+)`", said.out):
        assert not docs.is_page(target) or docs.page(target).startswith("#"), target
    assert not re.search(r"\]\((?!\w+://)", said.out)  # a file of a checkout
    named = re.findall(r"\bconfigs/([\w/]+\.yaml)", said.out)
    assert not {f"podusv:{path}" for path in named} & {*shipped.names()}


def test_a_page_may_be_named_as_its_file_is(podusv: Command) -> None:
    assert podusv("docs", "docs/studies.md").out == podusv("docs", "studies").out


@pytest.mark.parametrize("law", LAWS)
def test_every_law_has_a_page_that_its_name_finds(law: str, podusv: Command) -> None:
    assert podusv("docs", law).out.startswith("# ")
    title, *_ = podusv("docs", law).out.splitlines()
    assert f"`{law}`" in title


def test_lists_of_pages_and_places_have_no_marks_of_markdown(podusv: Command) -> None:
    assert "`" not in podusv("docs").out
    for words in ("phase margin", "delay", "thrust lever", "anti-windup", "interval"):
        said = podusv("docs", *words.split()).out
        assert not re.search(r"`|\*\*|\\\||\]\(", said), words
    assert docs._plain(r"a [*b*](c.md) | `d` | **e** | \|f\| |") == "a b | d | e | |f|"


def test_a_comment_in_code_is_no_heading() -> None:
    text = "# Page\n```\n# a comment\n```\n## Heading\n"
    assert [part.heading for part in docs._sections("page", text)] == ["Page", "Heading"]


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("resume", "podusv docs studies  Resume a study"),
        ("Monte Carlo", "podusv docs studies  Studies: Monte Carlo over hulls, seas and starts"),
        ("sensor noise", "podusv docs measurements  Noise, bias and delay"),
        ("waypoints", "podusv docs "),
    ],
)
def test_words_lead_to_headings_that_have_them(words: str, first: str, podusv: Command) -> None:
    said = podusv("docs", *words.split())
    assert said.code == 0
    assert said.out.startswith(first)


def test_a_word_that_no_page_has_is_refused_with_the_nearest_page(podusv: Command) -> None:
    said = podusv("docs", "studeis")
    assert said.code == 2
    assert "no page is called 'studeis' or has all words of it; did you mean 'studies'?" in said.err
    said = podusv("docs", " ")
    assert said.code == 2
    assert "no page is called ' ' or has all words of it" in said.err


def spoken(module: ast.Module) -> Iterator[str]:
    """Every text of a module that is no docstring."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    told = {
        ast.get_docstring(node, clean=False)
        for node in ast.walk(module)
        if isinstance(node, documented)
    }
    constants = (node.value for node in ast.walk(module) if isinstance(node, ast.Constant))
    yield from (text for text in constants if isinstance(text, str) and text not in told)


@pytest.mark.long
def test_no_message_names_a_page_s_file_which_only_a_checkout_has() -> None:
    checkouts = re.compile(r"\b(?:docs|examples)/\w+\.\w+")
    package = ROOT / "podusv_cli"
    sources = [path for path in package.rglob("*.py") if "docs" not in path.parts]
    texts = {str(path): spoken(ast.parse(path.read_text())) for path in sources}
    texts |= {str(p): iter([p.read_text()]) for p in (package / "components").rglob("*.yaml")}
    named = [(path, text) for path, some in texts.items() for text in some]
    assert [(path, text) for path, text in named if checkouts.search(text)] == []
    assert [
        (path, word)
        for path, text in named
        for word in re.findall(r"podusv docs ([a-z_]+)\b", text)
        if not docs.is_page(word) and not path.endswith("cli/docs.py")
    ] == []
