"""The key `plugins`: from what a scenario names to the values that `scenario_class` takes."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path as File

from podusv_cli.components.vessels.vessel import VESSELS
from podusv_cli.core.errors import LawError, ScenarioError
from podusv_cli.core.foreign import in_folder
from podusv_cli.core.phrases import describe_found, did_you_mean, quote
from podusv_cli.core.plugins import Plugin, Plugins, from_file, installed_plugins
from podusv_cli.scenario.keys import keys_of
from podusv_cli.scenario.model import BASES, Scenario, scenario_class
from podusv_cli.scenario.presets import preset_names
from podusv_cli.scenario.shipped import is_shipped, relative_to
from podusv_cli.scenario.yaml_text import read_text
from podusv_cli.scenario.yaml_tree import Fault, Mark, Node

KEY = "plugins"
FOLDER = "plugins"  # of a run, where its plug-in files are


def with_given(root: Node, files: Sequence[str | Plugin]) -> Node:
    """The tree with files of the command line (`--plugin`) after those that it names itself.

    A plug-in among the files is taken as it is, whatever has become of its file.
    """
    if not files:
        return root
    entries = [_node_of(file) for file in files]
    own = root.mapping.get(KEY)
    listed = tuple(node for node, _ in _list_entries(own)) if own else ()
    return root.with_entry(KEY, Node((*listed, *entries), own.mark if own else entries[0].mark))


def on_hand(files: Sequence[str]) -> Plugins:
    """The plug-ins in these files of the command line, and all that are installed.

    Raises ScenarioError for a file that is none.
    """
    faults: list[Fault] = []
    plugins = from_files(files, faults)
    if faults:
        raise ScenarioError(faults)
    return plugins


def from_files(files: Sequence[str], faults: list[Fault]) -> Plugins:
    """The plug-ins in these files of the command line, and all that are installed."""
    given = (_file(_node_of(file), faults) for file in files)
    return (*(plugin for plugin in given if plugin), *installed_plugins())


def _node_of(file: str | Plugin) -> Node:
    return Node(file, Mark(f"--plugin {file}"), text=str(file))


def _list_entries(own: Node) -> list[tuple[Node, Node]]:
    """The name of each plug-in and what is required of it.

    `plugins` is a list, a mapping or one name.
    """
    if isinstance(own.content, dict):
        marks = ((name, node.key_mark or node.mark) for name, node in own.content.items())
        return [(Node(name, mark, text=name), own.content[name]) for name, mark in marks]
    several = own.content if isinstance(own.content, tuple) else (own,)
    return [(node, Node({}, node.mark)) for node in several]


def load_plugins(
    root: Node, faults: list[Fault], *, trusted: bool = False, own: bool = True
) -> tuple[Node, Plugins]:
    """The tree with plug-ins as they stand in resolved.yaml, and the plug-ins.

    There a file is named as in the run's folder, with its digest, and an installed package stands
    where the scenario uses a component of it. A plug-in that cannot be loaded is a fault.

    Loading a file executes it. So there is a fault for every file that is not `trusted` and is
    named in the folder of a run, study or search, at any depth, or by what a scenario in one
    extends. Without `own`, there is one for every file that the tree names.
    """
    given = root.mapping.get(KEY) or Node({}, root.mark)
    entries: dict[str, Node] = {}
    known: dict[str, Plugin] = {}
    for name, wanted in [] if given.faulty else _list_entries(given):
        allowed = trusted or (own and not _is_foreign(name.mark))
        if plugin := _plugin(name, wanted, faults, allowed):
            # Two files of one name get two names in the run's folder.
            place = next(n for n in _names(plugin) if known.setdefault(n, plugin) == plugin)
            entries[place] = _resolved_entry(plugin, name.mark, wanted)
    plugins = tuple(dict.fromkeys((*known.values(), *installed_plugins())))
    try:
        # Made for its error alone: two components may have one kind.
        scenario_class(plugins)
        entries = {p.name: _resolved_entry(p, given.mark) for p in _plugins_used(root)} | entries
    except LawError as error:
        faults.append(Fault(given.mark, KEY, str(error)))
    return (root.with_entry(KEY, replace(given, content=entries)) if entries else root), plugins


def of_files(trusted: bool) -> Callable[[Node, list[Fault]], tuple[Node, Plugins]]:
    """What loads plug-ins of scenarios on the command line, some of them `trusted` alone."""
    return partial(load_plugins, trusted=trusted)


def of_folder(trusted: bool) -> Callable[[Node, list[Fault]], tuple[Node, Plugins]]:
    """What loads plug-ins that the folder of a run, study or search keeps, where `trusted`."""
    return partial(load_plugins, trusted=trusted, own=False)


def without_own(known: Plugins) -> Callable[[Node, list[Fault]], tuple[Node, Plugins]]:
    """A function that takes in `known` plug-ins, and none of those that a tree names."""
    return lambda root, faults: (
        replace(root, content={k: e for k, e in root.mapping.items() if k != KEY}),
        known,
    )


def _is_foreign(mark: Mark) -> bool:
    """Whether a place, or a scenario by whose `extends` it is read, may be somebody else's."""
    sources = (mark.source, *mark.above)
    return any(in_folder(source) for source in sources if not is_shipped(source))


def _resolved_entry(plugin: Plugin, mark: Mark, given: Node | None = None) -> Node:
    """The plug-in's entry in resolved.yaml: what is required (`given`), version and digest."""
    entry = given or Node({}, mark)
    for name in ("version", "sha256"):
        text = getattr(plugin, name)
        entry = entry.with_entry(name, Node(text, mark, text=text))
    return entry


def _plugins_used(root: Node) -> Iterator[Plugin]:
    """The installed packages that have a component or a vessel which the scenario names."""
    vessels = {
        root.mapping[key].word("preset") for key in ("vessel", "nominal") if key in root.mapping
    }
    vessels -= {"", *preset_names(VESSELS)}
    named = [(section, node.word("kind")) for section, node in _components(root)]
    foreign = [
        (section, kind) for section, kind in named if kind not in kinds_of(Scenario, section)
    ]
    # Making a class for each package takes time, so only where a name is unknown.
    for plugin in installed_plugins() if foreign or vessels else ():
        if vessels & set(preset_names(VESSELS, (plugin,))) or any(
            kind in kinds_of(scenario_class((plugin,)), section) for section, kind in foreign
        ):
            yield plugin


def _names(plugin: Plugin) -> tuple[str, ...]:
    """What a file is called in a run's folder, and where another has that name; or a package."""
    if not plugin.text:
        return (plugin.name,)
    return f"{FOLDER}/{plugin.name}", f"{FOLDER}/{plugin.sha256[:8]}_{plugin.name}"


def _plugin(name: Node, wanted: Node, faults: list[Fault], trusted: bool) -> Plugin | None:
    """The plug-in that the scenario names, or None with a fault.

    `wanted` has what is required of it. A file of a scenario is executed only if `trusted`.
    """
    if isinstance(name.content, Plugin):
        return name.content
    if not isinstance(name.content, str):
        what = describe_found(name.content, name.text)
        text = f"must be a list of files like my_law.py and installed packages, found {what}"
        faults.append(Fault(name.mark, KEY, text))
        return None
    is_file = name.content.endswith(".py")
    # A name without a line is the user's own, from the command line.
    if is_file and name.mark.line and not trusted:
        path = relative_to(name.mark.source, name.content)
        text = (
            f"this would execute the plug-in file {path}; read it, then allow it with --trust "
            "(in Python: podusv.load(..., trust=True))"
        )
        faults.append(Fault(name.mark, KEY, text))
        return None
    plugin = _file(name, faults) if is_file else _package(name, faults)
    return plugin if plugin and _is_wanted(plugin, wanted, faults) else None


def _package(name: Node, faults: list[Fault]) -> Plugin | None:
    """The installed package of this name, or None and a fault."""
    packages = {plugin.name: plugin for plugin in installed_plugins()}
    if name.content not in packages:
        what = f"{quote(name.content)} is no file (these end in .py) and no installed package"
        hint = did_you_mean(name.content, packages)
        faults.append(Fault(name.mark, KEY, f"{what} with entry points of podusv{hint}"))
    return packages.get(name.content)


def _file(name: Node, faults: list[Fault]) -> Plugin | None:
    """The plug-in of a Python file, or None and a fault.

    A path in a YAML file is relative to that file; one of the command line is not.
    """
    path = relative_to(name.mark.source, name.content) if name.mark.line else name.content
    text = read_text(path, name.mark, KEY, faults)
    if text is None:
        return None
    try:
        return from_file(path, text)
    except LawError as error:
        faults.append(Fault(name.mark, KEY, f"{path} {error}"))
        return None


def _is_wanted(plugin: Plugin, wanted: Node, faults: list[Fault]) -> bool:
    """Whether a plug-in has the digest that `wanted` asks for, if any; else a fault."""
    sha256 = wanted.mapping.get("sha256")
    if sha256 is None or sha256.content in ("", plugin.sha256):
        return True
    text = f"{plugin.path or plugin} is not the one that was used; without sha256, any is taken"
    faults.append(Fault(sha256.mark, f"{KEY}.{plugin.name}.sha256", text))
    return False


def used_of(files: Sequence[str], root: Node, faults: list[Fault]) -> tuple[Node, Plugins]:
    """The tree of a finished run, and those of its plug-ins that are at hand.

    The files in its folder are not read, so that looking at it runs nobody's code. Those that the
    user names (`files`) and installed packages count where their digest is that of the run.
    """
    own = root.mapping.get(KEY)
    used = {entry.word("sha256") for entry in own.mapping.values()} if own else set()
    return root, tuple(plugin for plugin in from_files(files, faults) if plugin.sha256 in used)


def continue_with(command: str, folder: File) -> str:
    """The command line that goes on with a folder, which may have plug-in files of its own."""
    trust = " --trust" if (folder / FOLDER).is_dir() else ""
    return f"podusv {command} {shlex.quote(str(folder))}{trust}"


def _components(root: Node) -> Iterator[tuple[str, Node]]:
    """Section and node of every component that a scenario has."""
    for name in BASES:
        node = root.mapping.get(name)
        each = node.content if node and isinstance(node.content, tuple) else (node,)
        yield from ((name, content) for content in each if content)
    several = root.mapping.get("controllers")
    yield from (("controller", node) for node in (several.mapping.values() if several else ()))


def kinds_of(scenario: type[Scenario], section: str) -> Iterable[str]:
    """The kinds that a section may be of."""
    return keys_of(scenario).keys[section].kinds
