"""The documentation site: its reference has everything, it builds without a warning, it fits."""

from __future__ import annotations

import json
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from browser_samples import BROWSER, QUIET, WIDTHS
from command_samples import ROOT

import podusv
from podusv_cli.cli import COMMANDS
from podusv_cli.cli.exit_codes import MEANINGS
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.explain import signals
from podusv_cli.scenario.keys import SCENARIO
from podusv_cli.scenario.presets import preset_names, with_presets
from podusv_cli.scenario.shipped import file_of

LOOKED_AT = (
    "docs/index",
    "docs/reference/five_pictures",
    "docs/reference/gallery",
    "README",
    "docs/tutorial",
    "docs/metrics",
    "docs/model",
    "results/README",
    "docs/reference/scenario",
    "docs/reference/controllers",
    "docs/reference/signals",
    "docs/reference/figures",
    "docs/reference/python",
    "docs/reference/commands",
)


@pytest.fixture(scope="module")
def reference() -> Any:
    """The module docs/reference.py."""
    return SimpleNamespace(**runpy.run_path(str(ROOT / "docs/reference.py")))


def coded(text: str) -> set[str]:
    """First words in code of table rows and headings."""
    return set(re.findall(r"^(?:\| |#+ )`([^`]+)`", text, re.M))


NAMES: dict[str, Callable[[], set[str]]] = {
    "signals": lambda: {signal.name for signal in signals()},
    "metrics": lambda: set(METRICS),
    "findings": lambda: set(finding_kinds()),
    "figures": lambda: set(FIGURES),
}


@pytest.mark.parametrize("page", NAMES)
def test_a_page_of_the_reference_has_every_name(page: str, reference: Any) -> None:
    assert coded(reference.PAGES[page]()) == NAMES[page]()


@pytest.mark.long
def test_the_reference_has_every_key_kind_and_preset(reference: Any) -> None:
    shown = coded(reference.scenario_page())
    for section, key in SCENARIO.keys.items():
        assert section in shown
        for kind, inner in key.kinds.items():
            page = reference.kinds_page(section)
            assert {kind, *inner.keys} <= coded(page), kind
    for section, (_, presets) in with_presets().items():
        if section != "nominal":
            assert set(preset_names(presets)) <= coded(reference.vessels_page())


def test_every_command_and_exit_code_is_in_the_reference(reference: Any) -> None:
    shown = coded(reference.commands_page())
    assert {*(f"podusv {name}" for name in COMMANDS), "podusv sweep run"} <= shown
    rows = [f"| {number} | {meaning} |" for number, meaning in MEANINGS.items()]
    for text in (reference.exit_codes_page(), (ROOT / "docs/architecture.md").read_text()):
        assert re.findall(r"^\| \d+ \|.*$", text, re.M) == rows


def test_every_page_is_in_the_contents():
    listed = set(
        re.findall(r"^   (?:.* <)?/?([\w/]+)>?$", (ROOT / "docs/index.rst").read_text(), re.M)
    )
    rooms = ("*.md", "docs/*.md", "docs/laws/*.md", "results/*.md")
    pages = [page for room in rooms for page in ROOT.glob(room)]
    names = {page.relative_to(ROOT).with_suffix("").as_posix() for page in pages}
    assert {name.removeprefix("docs/") for name in names} <= listed


def test_the_gallery_shows_each_run_with_the_yaml_that_makes_it(reference: Any) -> None:
    page = reference.gallery_page()
    for shown in reference.GALLERY:
        keys = re.findall(r"^\w+:", Path(file_of(shown)).read_text(), re.M)
        assert keys
        assert all(f"\n{key}" in page for key in keys)
        assert re.search(rf"^    podusv (run|compare) {re.escape(shown)}$", page, re.M)
    assert page.count("![tracks of ") == len(reference.GALLERY)


def test_the_python_reference_has_every_public_name(reference: Any) -> None:
    page = reference.python_page()
    for name in podusv.__all__:
        assert re.search(rf"auto(function|class):: podusv\.{name}$", page, re.M)


def test_words_are_not_taken_for_markdown(reference: Any) -> None:
    assert reference.text("|a| * `b|c` <d> [e]") == r"\|a\| \* `b|c` \<d> \[e]"
    assert reference.code("|n|") == r"`\|n\|`"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as `make docs` does it."""
    pytest.importorskip("sphinx", reason="Sphinx is not installed: pip install '.[docs]'")
    place = tmp_path_factory.mktemp("site")
    build = ["sphinx", "--fail-on-warning", "--keep-going", "--quiet", "-c", "docs"]
    done = subprocess.run(
        [sys.executable, "-m", *build, "-d", f"{place}/trees", ".", f"{place}/html"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return place / "html"


class Loaded(HTMLParser):
    """Addresses that a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag in ("script", "img", "iframe"):
            self.found.append(given.get("src", ""))
        if tag == "link" and given.get("rel") in ("stylesheet", "preload", "icon"):
            self.found.append(given["href"])


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 30
    for page in pages:
        seen = Loaded()
        seen.feed(page.read_text())
        assert [address for address in seen.found if "//" in address] == [], page
    for style in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(https?:)?//", style.read_text()), style


@pytest.mark.slow
def test_equations_are_drawn_without_a_script(site: Path) -> None:
    for name in ("model", "laws/velocity_vector", "theory"):
        page = (site / f"docs/{name}.html").read_text()
        source = (ROOT / f"docs/{name}.md").read_text()
        assert page.count("<math") == len(re.findall(r"^ *\$\$$", source, re.M)) // 2
        assert "$$" not in page
        assert "mathjax" not in re.sub(r"(mathjax|tex2jax)_ignore", "", page).lower()
        accented = r"<munder(?:over)?>\s*<mover accent"  # an index below in place of beside
        assert not re.search(accented, page)


def found(site: Path, word: str) -> set[str]:
    """The pages that the site's search finds for a stem, in text or headings."""
    text = (site / "searchindex.js").read_text()
    index = json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))
    places = [index[kind].get(word, []) for kind in ("terms", "titleterms")]
    every = [place for some in places for place in (some if isinstance(some, list) else [some])]
    return {index["docnames"][place] for place in every}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stem", "page"),
    [("resum", "docs/studies"), ("mont", "docs/studies"), ("nois", "docs/measurements")],
)
def test_the_search_finds_what_people_look_for(site: Path, stem: str, page: str) -> None:
    assert page in found(site, stem)


MEASURE = """<pre id="told"></pre><script>
const told = {}; let left = 0;
for (const page of %s) for (const width of %s) {
  const frame = document.createElement("iframe"); left += 1;
  frame.style.width = width + "px"; frame.style.border = 0; frame.src = page + ".html";
  frame.onload = () => {
    const inside = frame.contentDocument.querySelector(".content");
    told[page + " " + width] = inside.scrollWidth - inside.clientWidth; left -= 1;
    if (!left) document.getElementById("told").textContent = JSON.stringify(told);
  };
  document.body.append(frame);
}</script>"""


@pytest.mark.slow
@pytest.mark.browser
@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_no_page_is_wider_than_its_window(site: Path, tmp_path: Path) -> None:
    assert BROWSER
    (site / "measure.html").write_text(MEASURE % (json.dumps(LOOKED_AT), json.dumps(WIDTHS)))
    command = [BROWSER, *QUIET, "--allow-file-access-from-files", f"--user-data-dir={tmp_path}"]
    done = subprocess.run(
        [*command, "--dump-dom", (site / "measure.html").as_uri()], capture_output=True, text=True
    )
    (told,) = re.findall(r'<pre id="told">(.*?)</pre>', done.stdout)
    beyond = json.loads(told)
    assert len(beyond) == len(LOOKED_AT) * len(WIDTHS)
    assert {place: pixels for place, pixels in beyond.items() if pixels > 0} == {}
