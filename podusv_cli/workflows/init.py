"""`podusv init`: the scenarios that come with podusv as starting points of one's own."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from podusv_cli.core.errors import StorageError, UsageError
from podusv_cli.core.phrases import unknown
from podusv_cli.core.plugins import installed
from podusv_cli.findings.finding import finding_kinds
from podusv_cli.scenario import shipped
from podusv_cli.scenario.layers import extended_files
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.schema import TITLE, schema_text
from podusv_cli.scenario.yaml_text import read
from podusv_cli.storage import files
from podusv_cli.workflows import example_logs

SCHEMA = "podusv.schema.json"
# What to begin with, and what each shows.
FIRST = {
    "mu_2017/corrected": "a run", "own_vessel": "a hull of your own",
    "mu_2017/corrected_compare": "a comparison of laws", "studies/hull_and_sea": "a study",
    "identify/otter": "a hull from logs",
}  # fmt: skip
EDITOR_LINE = re.compile(r"^# yaml-language-server: .*$", re.MULTILINE)


@dataclass(frozen=True)
class Begun:
    """A scenario file that was written, what is beside it, and the words of its command."""

    config: Path
    schema: Path
    command: tuple[str, ...]
    logs: tuple[Path, ...] = ()


def starting_points() -> dict[str, str]:
    """Every shipped scenario that is meant to be run, and its description; `FIRST` come first.

    A file without a description of its own is one that others extend.
    """
    nodes = {name: read(_text(name), name, []) for name in shipped.names()}
    described = {name: node.get("description") for name, node in nodes.items() if node}
    points = {_short(name): str(text) for name, text in described.items() if text}
    return {name: points[name] for name in dict.fromkeys((*FIRST, *points))}


def init(name: str, out: Path | None = None) -> Begun:
    """Copy a starting point, and write the schema for editors beside it.

    The copy has the keys and comments of the shipped file and extends the same shipped files.
    Raises UsageError for an unknown name, StorageError where the file exists.
    """
    known = starting_points()
    if _short(name) not in known:
        raise UsageError(unknown(f"starting point {name!r}", _short(name), known, "podusv init"))
    source = f"{shipped.PREFIX}{_short(name)}.yaml"
    config = out or Path(f"{_short(name)}.yaml".rpartition("/")[2])
    schema = config.with_name(SCHEMA)
    files.check_places([config, schema])
    if config.exists():
        raise StorageError(f"{config} exists; name another file with --out")
    _spare(schema)
    text = own_copy(source)
    scenario = load_text(text, str(config)).scenario
    files.make_folder(config.parent)
    plugins = installed()
    known_to_editors = schema_text(tuple(finding_kinds(plugins)), plugins)
    files.write_all({config: text.encode(), schema: known_to_editors.encode()})
    logs = example_logs.write(config, scenario.identify) if scenario.identify else []
    return Begun(config, schema, _command(scenario), tuple(logs))


def _command(scenario: Scenario) -> tuple[str, ...]:
    """What a scenario is made for: a study, a hull from logs, a comparison or a run."""
    if scenario.sweep:
        return ("sweep", "run")
    if scenario.identify:
        return ("identify",)
    return ("compare",) if scenario.controllers else ("run",)


def own_copy(source: str) -> str:
    """A shipped scenario's text as a file anywhere: what it extends is named in full."""
    text = _text(source)
    lines = text.splitlines(keepends=True)
    node = read(text, source, [])
    for name in reversed(extended_files(node) if node else ()):
        row, start = name.mark.line - 1, name.mark.column - 1
        rest = lines[row][start + len(name.content) :]
        lines[row] = lines[row][:start] + shipped.relative_to(source, name.content) + rest
    return EDITOR_LINE.sub(f"# yaml-language-server: $schema={SCHEMA}", "".join(lines))


def _text(name: str) -> str:
    return Path(shipped.file_of(name)).read_text("utf-8")


def _short(name: str) -> str:
    return name.removeprefix(shipped.PREFIX).removesuffix(".yaml")


def _spare(schema: Path) -> None:
    """StorageError where the schema's name belongs to a file that podusv did not write."""
    if schema.exists() and f'"title": "{TITLE}"' not in files.read_text(schema):
        raise StorageError(f"{schema} exists and is no schema of podusv; move it, or use --out")
