"""Links between pages lead somewhere, and commands that pages show exist with their options."""

from __future__ import annotations

import json
import re
import runpy
import shlex
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

import pytest
import yaml
from command_samples import ROOT, commanded

import podusv
import podusv_cli
from podusv_cli.components.measurements.sensors import Sensors
from podusv_cli.figures.drawing import FIGURES
from podusv_cli.metrics.table import METRICS
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.model import PER_RUN, scenario_class
from podusv_cli.scenario.plugins import kinds_of

PAGES = [
    path.relative_to(ROOT).as_posix()
    for room in ("", "docs/", "docs/laws/", "results/")
    for path in sorted(ROOT.glob(f"{room}*.md"))
]
EXAMPLES = [path.relative_to(ROOT).as_posix() for path in sorted(ROOT.glob("examples/*/*.md"))]
LAW_FIGURES = runpy.run_path(str(ROOT / "examples/law_figures.py"))
GALLERY = runpy.run_path(str(ROOT / "examples/figure_gallery.py"))
Refused = Callable[[str], str]


def text_of(page: str) -> str:
    return (ROOT / page).read_text()


def anchors(page: Path) -> set[str]:
    """What `#...` may name on a page, as GitHub forms it from the headings."""
    prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    titles = re.findall(r"^#+ (.*)$", prose, re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def links(text: str) -> list[str]:
    """Targets of links and images, but for addresses in the web."""
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    return [target for target in targets if "://" not in target]


def dead_links(page: str) -> Iterator[str]:
    for target in links(text_of(page)):
        path, _, anchor = target.partition("#")
        file = (ROOT / page).parent / path if path else ROOT / page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            yield target


def commands(text: str) -> list[str]:
    """Every `podusv ...` of code blocks and inline code."""
    text = text.replace("\\\n", " ")
    fenced = "\n".join(re.findall(r"^```\w*\n(.*?)^```", text, re.M | re.S))
    indented = "\n".join(re.findall(r"^    (.*)$", text, re.M))
    typed = re.findall(r"^(?:\$ )?(?:\.venv/bin/)?podusv (.*)$", f"{fenced}\n{indented}", re.M)
    inline = re.findall(r"`podusv ([^`]*)`", text)
    return [" ".join(one.split()) for one in typed + inline]


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Why the command line does not take these words; empty if it does.

    With `--help` it looks for the command and its options, and no further.
    """
    podusv = commanded(monkeypatch, capsys)

    def why(words: str) -> str:
        typed = shlex.split(words, comments=True)
        if not typed or typed[0] == "...":  # any command
            return ""
        said = podusv(*typed, "--help")
        return "" if said.code == 0 else said.err

    return why


@pytest.mark.parametrize("page", PAGES + EXAMPLES)
def test_every_link_leads_somewhere(page: str) -> None:
    assert list(dead_links(page)) == []


@pytest.mark.parametrize("page", PAGES + EXAMPLES)
def test_every_command_shown_exists_with_its_options(page: str, refused: Refused) -> None:
    found = {words: refused(words) for words in commands(text_of(page))}
    assert {words: why for words, why in found.items() if why} == {}


def test_dead_links_and_wrong_commands_are_noticed(refused: Refused) -> None:
    assert links("see [a](b.md#c) and ![d](e.png), [f](https://g)") == ["b.md#c", "e.png"]
    text = (
        "podusv is\n    podusv run a.yaml\n```sh\n$ podusv plot x --figre y\n```\n`podusv verfy z`"
    )
    shown = ["plot x --figre y", "run a.yaml", "verfy z"]
    assert commands(text) == shown
    assert "No such option" in refused(shown[0])
    assert refused(shown[1]) == ""
    assert "No such command" in refused(shown[2])


def rows(page: str) -> list[list[str]]:
    """The cells of every table row whose first cell is code, with `|` in cells unescaped."""
    lines = re.findall(r"^\| `.*$", text_of(page), re.M)
    cells = [re.split(r"(?<!\\)\|", line)[1:-1] for line in lines]
    return [[cell.strip().replace(r"\|", "|") for cell in row] for row in cells]


def test_every_metric_is_documented_with_its_unit_and_definition() -> None:
    shared = [(re.findall(r"`\w+`", row[0]), *row[1:]) for row in rows("docs/margins.md")]
    margins = [[name, *rest] for names, *rest in shared if len(rest) == 2 for name in names]
    documented = [*rows("docs/metrics.md"), *margins]
    assert {tuple(row[:2]) for row in documented} == {
        (f"`{m.name}`", m.unit) for m in METRICS.values()
    }
    assert len(documented) == len(METRICS)
    assert all(row[2] for row in documented)
    counting = {row[0][1:-1] for row in documented if "with the standoff" in row[-1]}
    assert counting == {m.name for m in METRICS.values() if m.counts_standoff}


def test_every_figure_is_documented_with_the_signals_that_it_needs() -> None:
    documented = {row[0][1:-1]: row[2] for row in rows("docs/figures.md")}
    assert list(documented) == list(FIGURES)
    for name, sheet in FIGURES.items():
        assert documented[name] == ", ".join(f"`{signal}`" for signal in sheet.signals)


def test_the_gallery_has_every_figure_with_the_command_that_draws_it() -> None:
    page = text_of("docs/figures.md")
    assert list(GALLERY["SHOWN"]) == list(FIGURES)
    for name in FIGURES:
        assert (ROOT / f"docs/images/figures/{name}.png").stat().st_size < 80_000
        assert f"](images/figures/{name}.png)\n\n    {GALLERY['command'](name)}\n" in page


@pytest.mark.parametrize(
    ("section", "pages"),
    [
        ("controller", "*"),
        ("path", "*"),
        ("disturbance", "sea"),
        ("actuator", "actuators"),
        ("estimator", "estimators"),
        ("measurement", "measurements"),
    ],
)
def test_every_kind_has_its_place_on_a_page(section: str, pages: str) -> None:
    text = "".join(page.read_text() for page in (ROOT / "docs").rglob(f"{pages}.md"))
    kinds = kinds_of(scenario_class(()), section)
    missing = [kind for kind in kinds if not re.search(rf"(`|kind: ){kind}\b", text)]
    assert not missing, f"no {section} of these kinds on docs/{pages}.md: {missing}"


def test_the_citation_names_this_version() -> None:
    citation = yaml.safe_load(text_of("CITATION.cff"))
    assert citation["version"] == podusv_cli.__version__
    assert citation["authors"] == [{"name": "podusv contributors"}]
    assert date.fromisoformat(citation["date-released"]).year >= 2026


DEFAULTS = {  # the scenario whose laws have the numbers of a page's section on defaults
    "velocity_vector": "laws/rivals",
    "momentum_vector": "laws/rivals",
    "hand_position": "laws/rivals",
    "sliding_mode": "laws/rivals",
    "los_pid": "laws/rivals",
    "alos": "laws/rivals",
    "adaptive_neural": "laws/rivals",
    "pid": "laws/rivals",
    "cascade": "lefeber_2003/circle",
    "los_backstepping": "fossen_2003/course",
    "mss": "laws/autopilots",
}


@pytest.mark.parametrize("law", DEFAULTS)
def test_the_defaults_on_a_laws_page_are_those_that_a_run_has(law: str) -> None:
    section = text_of(f"docs/laws/{law}.md").partition("## Defaults\n")[2].partition("\n## ")[0]
    told = {name: float(number) for name, number in re.findall(r"`(\w+)` ([\d.]*\d)", section)}
    singles = podusv.load(f"podusv:{DEFAULTS[law]}.yaml").singles().values()
    (controller, *_) = (one.controller for one in singles if one.controller.kind == law)
    assert len(told) > 3
    assert told == {name: getattr(controller, name) for name in told}


def test_a_law_page_shows_its_picture_below_sixty_kilobytes() -> None:
    pages = {path.stem: path.read_text() for path in (ROOT / "docs/laws").glob("*.md")}
    drawn = {path.stem: path.stat().st_size for path in (ROOT / "docs/images/laws").glob("*.png")}
    assert set(drawn) == set(LAW_FIGURES["SHOWN"]) == set(pages) - {"gains", "observer"}
    assert all(f"](../images/laws/{law}.png)" in pages[law] for law in drawn)
    assert max(drawn.values()) < 60_000
    for law, (shown, _) in LAW_FIGURES["SHOWN"].items():
        assert f"`podusv compare podusv:{shown}.yaml`" in pages[law]


@pytest.mark.parametrize("page", PAGES)
def test_every_yaml_block_is_yaml(page: str) -> None:
    for text in re.findall(r"^```yaml\n(.*?)^```", text_of(page), re.M | re.S):
        assert isinstance(yaml.safe_load(text), dict)


def test_every_option_of_the_errata_exists(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    podusv = commanded(monkeypatch, capsys)
    errata = text_of("results/errata.md")
    options = re.findall(r"\| option, (.*) \|$", errata, re.M)
    names = [name for words in options for name in re.findall(r"`([\w.]+)`", words)]
    assert len(names) > 8
    for name in names:
        assert podusv("explain", name).code == 0, name


FOLDERS = r"(?:podusv_cli|tests|configs|docs|benchmarks|results/pod|results/mu_2017|examples)"


def missing(text: str) -> Iterator[str]:
    """Files of the repository and targets of make that a page names and that are not there."""
    for path in re.findall(rf"`({FOLDERS}/[\w./-]+)`", text):
        if "NAME" not in path and not (ROOT / path).exists():
            yield path
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M))
    for words in re.findall(r"`make ([a-z -]+)`", text):
        yield from (word for word in words.split() if word not in targets)


@pytest.mark.parametrize("page", [page for page in PAGES if page != "CHANGELOG.md"])
def test_files_and_targets_that_a_page_names_exist(page: str) -> None:
    assert list(missing(text_of(page))) == []


def test_a_file_or_target_that_is_not_there_is_noticed() -> None:
    assert list(missing("`tests/none.py`, `make nothing`, `make test`")) == [
        "tests/none.py",
        "nothing",
    ]


# --- the pages about the sea and sensors say what the code and the shipped scenarios do

SEA, MEASUREMENTS = ((ROOT / "docs" / name).read_text() for name in ("sea.md", "measurements.md"))


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_the_example_of_a_list_is_a_scenario_whose_loads_all_act():
    (block,) = re.findall(r"```yaml\n(.*?)```", SEA, re.S)
    scenario = load_text(block, "a.yaml").scenario
    kinds = [part.kind for part in scenario.disturbance]
    assert kinds == ["harmonic", "current", "wind", "waves"]
    again = load_text(block, "a.yaml", ["disturbance[3].seed=2"]).scenario.disturbance
    assert [part.seed for part in again[1:]] == [1, 1, 2]
    (line,) = re.findall(r"`(disturbance\[3\].seed: .*?)` below `vary:`", SEA)
    study = f"{block}sweep:\n  draws: 2\n  vary:\n    {line}\n"
    assert load_text(study, "a.yaml").scenario.sweep.vary["disturbance[3].seed"].seed


@pytest.mark.parametrize("state", range(2, 7))
def test_the_table_of_sea_states_is_that_of_the_shipped_scenarios(state):
    (row,) = (cells(line) for line in SEA.splitlines() if line.startswith(f"| {state} |"))
    text = (ROOT / "configs" / "sea" / f"state_{state}.yaml").read_text()
    parts = {part["kind"]: part for part in yaml.safe_load(text)["disturbance"]}
    model = [parts["waves"]["height"], parts["waves"]["period"], parts["wind"]["speed"]]
    assert [float(cell) for cell in row[4:7]] == model
    assert "on the ship waves of {} m and {} s and a wind of {} m/s".format(*row[1:4]) in text


def test_the_sensors_that_are_on_by_default_are_documented():
    found = [cells(line) for line in MEASUREMENTS.splitlines() if line.startswith("| `")]
    documented = {row[0].strip("`"): (float(row[2]), float(row[3])) for row in found}
    sensors = Sensors().instruments()
    assert documented == {name: (one.period, one.noise) for name, (one, _) in sensors.items()}


# --- the notebooks in examples/

NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
every_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
MOST_RUNS = 4


def notebook_cells(path: Path) -> list[dict[str, Any]]:
    """The cells of a notebook."""
    return json.loads(path.read_text())["cells"]


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} == {"first_run", "monte_carlo", "own_law"}


@every_notebook
def test_a_notebook_has_no_outputs(path):
    assert json.loads(path.read_text())["nbformat"] == 4
    code = [cell for cell in notebook_cells(path) if cell["cell_type"] == "code"]
    assert code
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)


@pytest.mark.slow  # simulates all that the notebooks show
@every_notebook
def test_the_cells_of_a_notebook_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = ["".join(cell["source"]) for cell in notebook_cells(path) if cell["cell_type"] == "code"]
    text = "\n".join(code).replace("RUNS = 200", f"RUNS = {MOST_RUNS}")
    names: dict[str, Any] = {}
    exec(compile(text, str(path), "exec"), names)  # noqa: S102
    if "run" in names:
        assert names["run"].status == "finished"
        assert "<img " in names["run"]._repr_html_()
    if "many" in names:
        assert list(names["many"]["status"]) == ["finished"] * MOST_RUNS


def test_every_section_that_can_be_drawn_in_is_named() -> None:
    (sentence,) = re.findall(
        r"The sections (.*) can be drawn in", (ROOT / "docs" / "studies.md").read_text()
    )
    assert re.findall(r"`(\w+)`", sentence) == list(PER_RUN)
