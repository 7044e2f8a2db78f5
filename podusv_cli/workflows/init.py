"""`podusv init`: scenarios and examples that come with podusv as starting points of one's own."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.core.phrases import unknown_word
from podusv_cli.core.plugins import installed_plugins
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.scenario import shipped
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.schema import TITLE, schema_text
from podusv_cli.scenario.yaml_text import read
from podusv_cli.scenario.yaml_tree import Node
from podusv_cli.storage import files
from podusv_cli.workflows import docs, example_logs
from podusv_cli.workflows.examples import ROOM, examples, texts

SCHEMA = "podusv.schema.json"
# What to begin with, and what each shows.
FIRST = {
    "mu_2017/corrected": "a run",
    "own_vessel": "a hull of your own",
    "mu_2017/corrected_compare": "a comparison of laws",
    "studies/hull_and_sea": "a study",
    "identify/otter": "a hull from logs",
}
EDITOR_LINE = re.compile(r"^# yaml-language-server: .*$", re.MULTILINE)


@dataclass(frozen=True)
class Begun:
    """What was written, the file that comes first, and what to do with it.

    `schema` is that of a scenario; `others` are an example's other files or a scenario's logs.
    """

    first: Path
    next: str
    schema: Path | None = None
    others: tuple[Path, ...] = ()


@cache
def starting_points() -> dict[str, str]:
    """Every shipped scenario that is meant to be run, and its description; `FIRST` come first.

    A file without a description of its own is one that others extend.
    """
    nodes = {name: read(_text(name), name, []) for name in shipped.names()}
    described = {name: node.get("description") for name, node in nodes.items() if node}
    points = {_short(name): str(text) for name, text in described.items() if text}
    return {name: points[name] for name in dict.fromkeys((*FIRST, *points))}


def init(name: str, out: Path | None = None) -> Begun:
    """Copy a starting point: a scenario with the schema for editors beside it, or an example.

    A scenario's copy has the keys and comments of the shipped file and names the same shipped
    files. Raises UsageError for an unknown name, StorageError where a file exists.
    """
    short, known = _short(name), starting_points() | examples()
    if short not in known:
        raise UsageError(unknown_word(f"starting point {name!r}", short, known, "podusv init"))
    return (_example if short in examples() else _scenario)(short, out)


def _scenario(name: str, out: Path | None) -> Begun:
    """Copy a shipped scenario, with its schema and example logs, to `out` or the current folder."""
    source = f"{shipped.PREFIX}{name}.yaml"
    config = out or Path(f"{name}.yaml".rpartition("/")[2])
    schema = config.with_name(SCHEMA)
    files.check_places([config, schema])
    _check_free(config)
    _spare(schema)
    text = own_copy(source)
    # The copy is loaded where it will lie, before it is written.
    scenario = load_text(text, str(config)).scenario
    files.make_folder(config.parent)
    plugins = installed_plugins()
    known_to_editors = schema_text(tuple(finding_kinds(plugins)), plugins)
    files.write_all({config: text.encode(), schema: known_to_editors.encode()})
    logs = example_logs.write(config, scenario.identify) if scenario.identify else []
    command = shlex.join(["podusv", *_command(scenario), str(config)])
    return Begun(config, command, schema, tuple(logs))


def _example(name: str, out: Path | None) -> Begun:
    """Copy a folder or notebook; a README's links into a checkout become words."""
    given = texts(name)
    root = out or Path(Path(next(iter(given))).parts[0])
    _check_free(root)
    written = {
        str(root.joinpath(*Path(place).parts[1:])): _readable(text, place)
        for place, text in given.items()
    }
    first, *others = map(Path, written)
    files.check_places([first, *others])
    files.write_texts(Path(), written)
    reading = shlex.join(["jupyter", "notebook", str(first)])
    return Begun(first, f"read {first}" if others else reading, others=tuple(others))


def _readable(text: str, place: str) -> str:
    is_page = place.endswith(".md")
    return docs.reachable(text, f"{ROOM}/{Path(place).parent}") if is_page else text


def _check_free(path: Path) -> None:
    if path.exists():
        raise StorageError(f"{path} exists; name another place with --out")


def _command(scenario: Scenario) -> tuple[str, ...]:
    """What a scenario is made for: a study, a hull from logs, a comparison or a run."""
    if scenario.sweep:
        return ("sweep", "run")
    if scenario.identify:
        return ("identify",)
    return ("compare",) if scenario.controllers else ("run",)


def own_copy(source: str) -> str:
    """A shipped scenario's text that loads from anywhere: files that it names are named in full."""
    text = _text(source)
    lines = text.splitlines(keepends=True)
    node = read(text, source, [])
    # From the end, so that the places of earlier ones stay right.
    for scalar in reversed(_scalars(node) if node else []):
        whole = shipped.relative_to(source, str(scalar.content))
        if whole in shipped.all_files():
            row, start = scalar.mark.line - 1, scalar.mark.column - 1
            rest = lines[row][start:].replace(scalar.content, whole, 1)
            lines[row] = lines[row][:start] + rest
    return EDITOR_LINE.sub(f"# yaml-language-server: $schema={SCHEMA}", "".join(lines))


def _scalars(node: Node) -> list[Node]:
    """The values of a tree that are neither lists nor mappings, in the order of the text."""
    inner = node.content if isinstance(node.content, tuple) else tuple(node.mapping.values())
    if not inner and not isinstance(node.content, str):
        return []
    return [scalar for part in inner for scalar in _scalars(part)] if inner else [node]


def _text(name: str) -> str:
    return Path(shipped.file_of(name)).read_text("utf-8")


def _short(name: str) -> str:
    return name.removeprefix(shipped.PREFIX).removesuffix(".yaml")


def _spare(schema: Path) -> None:
    """StorageError where the schema's name belongs to a file that podusv did not write."""
    if schema.exists() and f'"title": "{TITLE}"' not in files.read_text(schema):
        raise StorageError(f"{schema} exists and is no schema of podusv; move it, or use --out")
