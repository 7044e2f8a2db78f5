"""Starting from nothing: the shipped scenarios by name, `podusv init`, the wheel."""

import re
from pathlib import Path

import pytest
from command_samples import ROOT, commanded, write

from podusv_cli.cli import FIRST_STEPS
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.scenario import shipped
from podusv_cli.scenario.load import load, values
from podusv_cli.scenario.schema import schema_text
from podusv_cli.workflows.examples import examples, texts
from podusv_cli.workflows.init import FIRST, SCHEMA, starting_points

CONFIGS = ROOT / "configs"
TELLING = (
    "own_vessel",
    "mu_2017/figures_compare",
    "pod/vessels/otter",
    "studies/hull_and_sea",
    "files/mission",
)


@pytest.fixture
def podusv(tmp_path, monkeypatch, capsys):
    """The command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return commanded(monkeypatch, capsys)


# --- scenarios by name


def test_every_file_in_configs_has_a_name():
    paths = {f"podusv:{path.relative_to(CONFIGS).as_posix()}" for path in CONFIGS.rglob("*.yaml")}
    assert set(shipped.names()) == paths
    assert len(paths) > 20


def test_a_scenario_extends_a_shipped_one_from_anywhere(podusv):
    write("a.yaml", "extends: podusv:pod/kept.yaml\nname: kept\n")
    here, there = load("a.yaml"), load(CONFIGS / "pod/kept.yaml")
    own = here.scenario.model_copy(update={"description": there.scenario.description})
    assert own == there.scenario  # the other's description is not its own
    assert here.scenario.description == ""
    assert here.origins["controller.k_ze"].startswith("podusv:mu_2017/base.yaml:")
    assert podusv("validate", "podusv:mu_2017/corrected.yaml").out.startswith(
        "podusv:mu_2017/corrected.yaml: ok (corrected, adaptive_neural, "
    )


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("podusv:mu_2017/corected.yaml", "; did you mean 'podusv:mu_2017/corrected.yaml'?"),
        ("podusv:../pyproject.toml", "; did you mean 'podusv:pod/kept.yaml'?"),
        ("podusv:/etc/passwd/0123456789", ""),
        ("podusv:", "; did you mean 'podusv:demo.yaml'?"),
    ],
)
def test_a_name_that_podusv_does_not_have_is_a_line(podusv, name, hint):
    wrong = f"podusv has no scenario of this name{hint} (`podusv init` lists them)"
    assert podusv("validate", name) == (2, "", f"{name}: cannot be read: {wrong}\n")
    write("a.yaml", f'extends: "{name}"\n')
    place = f"a.yaml:1:10: extends: '{name}'"
    assert podusv("validate", "a.yaml") == (2, "", f"{place} cannot be read: {wrong}\n")


def test_shipped_files_name_each_other_relative_to_themselves():
    assert (
        shipped.relative_to("podusv:pod/kept.yaml", "../mu_2017/x.yaml") == "podusv:mu_2017/x.yaml"
    )
    assert shipped.relative_to("podusv:own.yaml", "x.yaml") == "podusv:x.yaml"
    assert shipped.relative_to("podusv:own.yaml", "podusv:b/x.yaml") == "podusv:b/x.yaml"
    assert shipped.relative_to("mine/own.yaml", "x.yaml") == "mine/x.yaml"
    assert shipped.relative_to("mine/own.yaml", "/x.yaml") == "/x.yaml"


def test_the_advice_of_a_comparison_names_a_shipped_scenario(podusv):
    said = podusv(
        "compare",
        "podusv:theory/sign.yaml",
        "--no-figures",
        "--set",
        "simulation.duration=1",
        "--out",
        "x",
    )
    assert said.code == 0
    assert "podusv verify podusv:theory/sign.yaml --set simulation.duration=1" in said.err


# --- init


def test_bare_podusv_says_what_to_do_first_in_about_eight_lines(podusv):
    said = podusv()
    assert said == (0, f"{FIRST_STEPS}\n", "")
    assert len(said.out.splitlines()) <= 9


def test_a_folder_s_old_name_still_names_its_scenarios(podusv):
    old, new = (
        load(f"podusv:{name}/corrected_compare.yaml").scenario for name in ("paper", "mu_2017")
    )
    assert values(old) == values(new)
    assert podusv("validate", "podusv:paper/corrected.yaml").code == 0
    assert "did you mean" in podusv("validate", "podusv:paper/corected.yaml").err


def test_init_lists_every_scenario_that_is_meant_to_be_run(podusv):
    points = starting_points()
    others = {name[7:-5] for name in shipped.names()} - set(points)
    layers = {
        name
        for name in others
        if name.startswith(("bench/", "bench_legs/", "bench_boats/", "bench_dp/"))
    }
    assert others - layers == {
        "fossen_2003/base",
        "lefeber_2003/base",
        "mu_2017/base",
        "mu_2017/claims",
        "mu_2017/ablation_laws",
        "theory/base",
        "trials/base",
    }
    assert list(points)[: len(FIRST)] == [*FIRST]
    assert list(points)[len(FIRST) :] == sorted(set(points) - set(FIRST))
    first, rest = podusv("init").out.split("\n", 1)
    assert first.startswith("to begin with: mu_2017/corrected (a run), own_vessel (a hull of your")
    assert all(f" {name} (" in first for name in FIRST)
    assert " ".join(rest.split()) == " ".join(
        [
            *(f"{name} {text}" for name, text in (points | examples()).items()),
            "copy one to edit: podusv init NAME",
        ]
    )


NUMBERS = ("two", "three", "four", "five", "six")
DESCRIBED = {
    r"\bpods?\b": lambda scenario, _: scenario.actuator.kind == "pod",
    r"\bcalm water\b": lambda scenario, _: scenario.disturbance.kind == "none",
    r"\bsea state (\d)\b": lambda scenario, state: (
        scenario.disturbance == load(CONFIGS / f"sea/state_{state}.yaml").scenario.disturbance
    ),
    rf"^({'|'.join(NUMBERS)}) laws\b": lambda scenario, number: (
        len(scenario.controllers) == NUMBERS.index(number) + 2
    ),
}


@pytest.mark.parametrize("words", DESCRIBED)
def test_a_scenario_has_what_its_description_names(words):
    """A later base replaces what an earlier one was named for, and nothing says so."""
    found = {name: re.search(words, text.lower()) for name, text in starting_points().items()}
    named = {name: one for name, one in found.items() if one}
    assert len(named) > 3
    for name, one in named.items():
        scenario = load(CONFIGS / f"{name}.yaml").scenario
        assert DESCRIBED[words](scenario, one[one.re.groups]), name


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in TELLING))
        for name in starting_points()
    ],
)
def test_a_copy_anywhere_is_the_same_scenario(podusv, name):
    said = podusv("init", name, "--out", f"deep/er/{name}.yaml")
    assert said.code == 0, said.err
    copy = Path("deep/er") / f"{name}.yaml"
    assert load(copy).scenario == load(CONFIGS / f"{name}.yaml").scenario
    assert load(copy).scenario == load(f"podusv:{name}.yaml").scenario
    text = copy.read_text()
    assert text.count("\n") == (CONFIGS / f"{name}.yaml").read_text().count("\n")
    (schema,) = re.findall(r"^# yaml-language-server: \$schema=(.*)$", text, re.MULTILINE)
    assert (copy.parent / schema).read_text() == schema_text(tuple(finding_kinds()))
    scenario = load(copy).scenario
    made_for = {
        "sweep run": scenario.sweep,
        "identify": scenario.identify,
        "compare": scenario.controllers,
    }
    command = next((words for words, section in made_for.items() if section), "run")
    for log in scenario.identify.logs if scenario.identify else ():
        assert f"wrote {copy.with_name(log.file)}" in said.out.splitlines()
        assert copy.with_name(log.file).read_text().startswith("time [s],north [m],east [m],")
    assert said.out.splitlines()[-1] == f"next: podusv {command} {copy}"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["own_vessel", "mu_2017/printed", "pod/vessels/otter"])
def test_a_copy_is_called_as_the_file(podusv, name):
    assert podusv("init", name).code == 0
    assert {path.name for path in Path().iterdir()} == {f"{name.split('/')[-1]}.yaml", SCHEMA}


def test_init_replaces_nothing(podusv):
    assert podusv("init", "mu_2017/corrected").code == 0
    write("corrected.yaml", "mine")
    said = podusv("init", "podusv:mu_2017/corrected.yaml")
    assert said == (5, "", "corrected.yaml exists; name another place with --out\n")
    assert Path("corrected.yaml").read_text() == "mine"
    assert podusv("init", "mu_2017/printed").code == 0  # beside the schema that is there
    write(SCHEMA, "{}")
    said = podusv("init", "mu_2017/figures")
    assert said == (5, "", f"{SCHEMA} exists and is no schema of podusv; move it, or use --out\n")
    assert not Path("figures.yaml").exists()


def test_an_unknown_starting_point_is_a_line_with_those_that_there_are(podusv):
    said = podusv("init", "mu_2017/corected")
    assert said.code == 2
    assert said.err.startswith(
        "unknown starting point 'mu_2017/corected'; did you mean 'mu_2017/corrected'? (allowed: "
    )
    assert re.search(r"(, \S+){4} and \d+ more, see podusv init\)$", said.err)
    assert said.err.count("\n") == 1
    assert not list(Path().iterdir())


def test_the_copy_is_edited_and_resolved_like_any_scenario(podusv):
    podusv("init", "mu_2017/corrected")
    text = Path("corrected.yaml").read_text()
    write("corrected.yaml", text.replace("surge_limit: 8.0", "surge_limit: 9.0"))
    changed, base = (
        values(load("corrected.yaml").scenario),
        values(load("podusv:mu_2017/corrected.yaml").scenario),
    )
    assert {key for key in base if changed[key] != base[key]} == {"actuator.surge_limit"}


# --- examples


def test_every_folder_with_a_readme_and_every_notebook_is_an_example():
    folders = {path.parent.name for path in (ROOT / "examples").glob("*/README.md")}
    notebooks = {path.stem for path in (ROOT / "examples").glob("*.ipynb")}
    assert set(examples()) == {f"example/{name}" for name in folders | notebooks}
    assert {"hardware_in_the_loop", "learned", "nmpc", "my_lab"} <= folders
    assert examples()["example/first_run"] == "A first run"


@pytest.mark.parametrize("name", examples())
def test_an_example_is_written_whole_and_named_in_every_line(podusv, name):
    said = podusv("init", name)
    assert (said.code, said.err) == (0, "")
    *lines, last = said.out.splitlines()
    names = [line.removeprefix("wrote ") for line in lines]
    assert names == list(texts(name))
    assert last in (f"next: read {names[0]}", f"next: jupyter notebook {names[0]}")
    written = {path.as_posix() for path in Path().rglob("*") if path.is_file()}
    assert written == {*names}
    for place in names:
        if not place.endswith(".md"):
            assert Path(place).read_text() == (ROOT / "examples" / place).read_text()


@pytest.mark.parametrize("page", [*(ROOT / "examples").glob("*/README.md")], ids=str)
def test_a_readme_elsewhere_names_pages_and_files_that_are_there(podusv, page):
    podusv("init", f"example/{page.parent.name}", "--out", "mine")
    text = Path("mine/README.md").read_text()
    assert not re.search(r"\]\((?!\w+://)", text)  # a link that only a checkout has
    for name in re.findall(r"\(?`podusv docs ([^`]+)`", text):
        assert podusv("docs", name).code == 0
    scripts = re.findall(r"^    (?:python|podusv run|podusv compare) (\w[\w/]*\.\w+)", text, re.M)
    assert all((Path("mine") / script).is_file() for script in scripts)
    assert scripts or page.parent.name == "my_lab"  # which has a Makefile


def test_an_example_replaces_nothing(podusv):
    for name, place in (("nmpc", "nmpc"), ("first_run", "first_run.ipynb")):
        assert podusv("init", f"example/{name}").code == 0
        said = podusv("init", f"example/{name}")
        assert said == (5, "", f"{place} exists; name another place with --out\n")
    assert podusv("init", "example/nmpc", "--out", "deep/er").code == 0
    assert {path.name for path in Path("deep/er").iterdir()} == {"README.md", "nmpc.py"}
    assert "did you mean 'example/nmpc'?" in podusv("init", "example/nmcp").err


def test_a_page_names_the_command_that_writes_an_example(podusv):
    assert "hardware in the loop (`podusv init example/hardware_in_the_loop`)" in podusv(
        "docs", "python"
    ).out.replace("\n", " ")
