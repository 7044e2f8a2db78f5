"""Filling in what a scenario takes from elsewhere: presets, CSV files, its file's name."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from podusv_cli.components.vessels.vessel import COEFFICIENTS, VESSELS, Vessel
from podusv_cli.core.component import Component, Presets
from podusv_cli.core.phrases import describe_found, quote, unknown_word
from podusv_cli.core.plugins import Plugins
from podusv_cli.scenario.in_si import in_si
from podusv_cli.scenario.keys import SCENARIO, Key
from podusv_cli.scenario.kinds import over
from podusv_cli.scenario.named_files import ANY_FILE, with_contents
from podusv_cli.scenario.sections import NAME, NAME_IN_WORDS
from podusv_cli.scenario.shipped import PREFIX
from podusv_cli.scenario.yaml_text import read
from podusv_cli.scenario.yaml_tree import Fault, Node, Route, dotted_key, merge, without_misfits

# Sections whose entries have names of the user's. An entry that is null takes out an inherited one,
# and a section that is null all of them.
NAMED: tuple[Route, ...] = (
    ("controllers",),
    ("claims",),
    ("sweep", "vary"),
    ("sweep", "grid"),
    ("sweep", "claims"),
    ("tune", "space"),
    ("doubt", "vary"),
    ("identify", "columns"),
    ("identify", "priors"),
    ("identify", "noise"),
)
EMPTIED: tuple[Route, ...] = (*NAMED, ("sweep", "keep"))  # null is a section with nothing in it
BESIDE_NAMED = {named[:end] for named in NAMED for end in range(len(named) + 1)}


@cache
def _preset_files(presets: Presets, plugins: Plugins) -> dict[str, Traversable]:
    """The preset files of podusv and of plug-ins by name; podusv's own come first."""
    room = presets.package.rpartition(".")[2]
    packages = [presets.package, *(folder for plugin in plugins for folder in plugin.folders(room))]
    by_name: dict[str, Traversable] = {}
    for package in packages:
        for entry in files(package).iterdir():
            if entry.name.endswith(".yaml"):
                by_name.setdefault(entry.name.removesuffix(".yaml"), entry)
    return {name: by_name[name] for name in sorted(by_name)}


def preset_names(presets: Presets, plugins: Plugins = ()) -> tuple[str, ...]:
    """Names of the preset files, sorted."""
    return tuple(_preset_files(presets, plugins))


def preset_values(
    presets: Presets, name: str, faults: list[Fault], plugins: Plugins = ()
) -> Node | None:
    """The values of a preset by its name, one of `preset_names`; None if its file is no YAML.

    `presets` says which part's presets they are, `plugins` may bring more of them. What is wrong
    with the file is appended to `faults`.
    """
    text = _preset_files(presets, plugins)[name].read_text("utf-8")
    node, faulty = _tree(text, f"{presets.file} {name}.yaml")
    faults += faulty
    return node


@cache
def _tree(text: str, source: str) -> tuple[Node | None, tuple[Fault, ...]]:
    """The tree of a preset's text, and what is wrong with it; None where it is no YAML.

    `source` names the text in faults. A scenario asks for each preset several times; `@cache`
    parses it once.
    """
    # `placed=False`: `source` is no path that a user could open, so marks have no line in it.
    faults: list[Fault] = []
    return read(text, source, faults, placed=False), tuple(faults)


def preset_text(presets: Presets, name: str, key: str, plugins: Plugins = ()) -> str:
    """A text, such as `source`, from a preset's file."""
    node = preset_values(presets, name, [], plugins)
    return str(node.get(key)) if node else ""


def preset_about(presets: Presets, name: str, plugins: Plugins = ()) -> str:
    """What a preset is: the comment that its file begins with; "" where there is none."""
    first = _preset_files(presets, plugins)[name].read_text("utf-8").partition("\n")[0]
    return first.removeprefix("#").strip() if first.startswith("#") else ""


def with_presets(top: Key = SCENARIO) -> dict[str, tuple[type[Component], Presets]]:
    """Every class of components that has presets, and these, by `section.kind`.

    `top` is the scenario's key: with plug-ins, it has their kinds, too.
    """
    sections = [inner for key in top.keys.values() for inner in (key, *key.kinds.values())]
    # The nominal vessel is of the class of the vessel, whose presets are listed once.
    return {
        dotted_key(key.route): (key.section, key.section.presets)
        for key in sections
        if key.section and key.section.presets and key.path != ("nominal",)
    }


def complete(root: Node, top: Key, faults: list[Fault], remarks: list[str]) -> Node:
    """The tree in podusv's units, with presets, files, `name`, `nominal`, `controllers` filled in.

    `top` are the scenario's keys. `remarks` takes sentences about what of a file is left out.
    """
    plugins = top.scenario.plugged
    root = in_si(with_contents(_name(_without_null(root), faults), top, faults, remarks), top)
    root = _nominal(_vessel(root, plugins, faults), plugins, faults)
    return _controllers(_sections(root, top, faults), top)


def _sections(root: Node, top: Key, faults: list[Fault]) -> Node:
    """The tree with all sections of a kind that has presets completed from these."""
    for name, key in top.keys.items():
        given = root.mapping.get(name)
        kind = key.kinds.get(given.word("kind")) if given else None
        if given and kind and kind.model.presets:
            filled = _over_preset(given, name, kind.model.presets, top.scenario.plugged, faults)
            root = root.with_entry(name, filled)
    return root


def _without_null(root: Node, section: Route = ()) -> Node:
    """The tree without nulls that take something out.

    These are nulls for sections, and for entries that have names of the user. `section` leads to
    `root`. Other nulls stay, as values.
    """
    if section not in BESIDE_NAMED or not root.mapping:
        return root
    entries = {
        name: _without_null(entry, (*section, name))
        for name, entry in root.mapping.items()
        if entry.content is not None
        or entry.faulty
        or (section not in NAMED and (*section, name) not in EMPTIED)
    }
    return replace(root, content=entries)


def _name(root: Node, faults: list[Fault]) -> Node:
    """The tree with a `name`: where none is given, the file's name without suffix."""
    if "name" in root.mapping:
        return root
    stem = Path(root.mark.source.removeprefix(PREFIX)).stem
    usable = re.fullmatch(NAME, stem)
    if not usable:
        text = f"cannot be the file's name {quote(stem)}; give one {NAME_IN_WORDS}"
        faults.append(Fault(root.mark, "name", text))
    return root.with_entry("name", Node(stem if usable else None, root.mark, faulty=not usable))


def _vessel(root: Node, plugins: Plugins, faults: list[Fault]) -> Node:
    """The tree with the keys of the vessel's preset in `vessel`."""
    given = root.mapping.get("vessel")
    if given is None:
        given = Node({}, root.mark, faulty=root.faulty)
    if not isinstance(given.content, dict):
        return root
    return root.with_entry("vessel", _from_preset(given, "vessel", plugins, faults))


def _nominal(root: Node, plugins: Plugins, faults: list[Fault]) -> Node:
    """The tree with `nominal`: the vessel, with what is given over it.

    With `preset` it starts from that preset instead, or with an empty one from nothing.
    """
    vessel = root.mapping["vessel"]
    given = root.mapping.get("nominal")
    if given is None:
        return root.with_entry("nominal", vessel)
    if not isinstance(given.content, dict):
        return root
    if "preset" in given.content:
        return root.with_entry("nominal", _from_preset(given, "nominal", plugins, faults))
    whole = _with_source(merge(vessel, given), plugins)
    # The vessel has a message for that; its copy is not to have a second one.
    lost = not isinstance(vessel.content, dict)
    return root.with_entry("nominal", replace(whole, faulty=whole.faulty or lost))


def _from_preset(given: Node, key: str, plugins: Plugins, faults: list[Fault]) -> Node:
    """The vessel's values over those of its preset, where it has one; `key` is its section."""
    preset = given.mapping.get("preset")
    # An empty text says that the vessel has no preset.
    if preset is None or preset.content == "":
        return _check_required(given, key, plugins, faults)
    vessel = _over_preset(given, key, VESSELS, plugins, faults)
    return replace(vessel, faulty=True) if preset.faulty else _with_source(vessel, plugins)


def _check_required(given: Node, key: str, plugins: Plugins, faults: list[Fault]) -> Node:
    """The vessel as given, marked faulty if it lacks required keys.

    `key` is its section, `vessel` or `nominal`; the fault is appended to `faults`.
    """
    fields = Vessel.model_fields.items()
    lacking = [name for name, field in fields if field.is_required() and name not in given.mapping]
    if not lacking or given.faulty:
        return given
    known = ", ".join([*preset_names(VESSELS, plugins), ANY_FILE])
    text = f"missing: {', '.join(lacking)}; or take them from a preset (allowed: {known})"
    faults.append(Fault(given.mark, key, text))
    return replace(given, faulty=True)


def _with_source(vessel: Node, plugins: Plugins) -> Node:
    """The vessel with a `source` that names the numbers that are not its preset's.

    A source that is not the preset's own is left as it is.
    """
    name, source = vessel.word("preset"), vessel.mapping.get("source")
    known = name in preset_names(VESSELS, plugins)
    base = preset_values(VESSELS, name, [], plugins) if known else None
    stem = str(base.get("source")).removesuffix(".") if base else ""
    # A source in the scenario's own words stays as it is.
    if not base or not source or not str(source.content).startswith(stem):
        return vessel
    fields = Vessel.model_fields.items()
    # What the preset gives, and the model's defaults for what it leaves out.
    usual = {name: field.default for name, field in fields if name in COEFFICIENTS}
    usual |= {name: base.get(name) for name in usual if base.get(name) is not None}
    changed = [n for n in usual if n in vessel.mapping and vessel.get(n) != usual[n]]
    text = f"{stem}; {', '.join(changed)} changed by the scenario."
    source_text = text if changed else str(base.get("source"))
    return vessel.with_entry("source", replace(source, content=source_text))


def _over_preset(
    given: Node, key: str, presets: Presets, plugins: Plugins, faults: list[Fault]
) -> Node:
    """What is given over the values of its preset, where it names one; `key` is the section.

    A preset that is unknown makes the section faulty.
    """
    preset, names = given.mapping.get("preset"), preset_names(presets, plugins)
    if preset is None or preset.content == "" or preset.faulty:
        return given
    if preset.content in names:
        base = preset_values(presets, str(preset.content), faults, plugins)
        return merge(base, without_misfits(base, given, faults, (key,))) if base else given
    what = f"{presets.noun} {describe_found(preset.content, preset.text)}"
    text = unknown_word(what, str(preset.content), [*names, ANY_FILE])
    faults.append(Fault(preset.mark, f"{key}.preset", text))
    wrong = given.with_entry("preset", replace(preset, content=None, faulty=True))
    return replace(wrong, faulty=True)


def _controllers(root: Node, top: Key) -> Node:
    """Each of `controllers` over those keys of `controller` that its kind has too.

    Without `controller`, the first of `controllers` stands there; see `stands_in`.
    """
    base, several = root.mapping.get("controller"), root.mapping.get("controllers")
    if not several or not several.mapping:
        return root
    if not base:
        return root.with_entry("controller", next(iter(several.mapping.values())))
    law = top.keys["controller"]
    filled = {name: over(base, own, law) for name, own in several.mapping.items()}
    return root.with_entry("controllers", replace(several, content=filled))


def stands_in(root: Node) -> bool:
    """Whether the `controller` of a complete tree is the first of `controllers`, not given."""
    several = root.mapping.get("controllers")
    laws = several.mapping.values() if several else ()
    return any(law is root.mapping.get("controller") for law in laws)
