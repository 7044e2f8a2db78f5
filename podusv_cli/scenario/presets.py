"""What a scenario refers to and what it may leave out: vessel files, waypoints, its own name."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from podusv_cli.core.component import Component
from podusv_cli.scenario.annotations import sections
from podusv_cli.scenario.fields import PATTERNS_IN_WORDS, limits
from podusv_cli.scenario.model import Scenario
from podusv_cli.scenario.words import found, quoted, unknown
from podusv_cli.scenario.yaml_text import MAX_NODES, read, read_text, resolve
from podusv_cli.scenario.yaml_tree import Fault, Mark, Node, merge, overlay
from podusv_cli.vessels.vessel import COEFFICIENTS, Vessel

MAX_POINTS = MAX_NODES // 4  # a point is three values, and the resolved scenario has to be readable
MOST_FAULTS = 10  # in one file of points
HEADER = re.compile(r'\s*"?(?!nan|inf)[a-z]', re.IGNORECASE)
VESSELS, ACTUATORS = files("podusv_cli.vessels"), files("podusv_cli.actuators")


def _names_in(folder: Traversable) -> tuple[str, ...]:
    names = (Path(entry.name) for entry in folder.iterdir())
    return tuple(sorted(name.stem for name in names if name.suffix == ".yaml"))


@cache
def vessel_names() -> tuple[str, ...]:
    """Names of the vessels that podusv brings along, sorted."""
    return _names_in(VESSELS)


@cache
def pod_names() -> tuple[str, ...]:
    """Names of the sets of pods that podusv brings along, sorted."""
    return _names_in(ACTUATORS)


def vessel_file(name: str, faults: list[Fault]) -> Node | None:
    """The parameters of a vessel by its name, one of `vessel_names()`."""
    text = VESSELS.joinpath(f"{name}.yaml").read_text("utf-8")
    return read(text, f"vessel file {name}.yaml", faults, placed=False)


def vessel_text(name: str, key: str) -> str:
    """A text, such as `source`, from a vessel's file."""
    node = vessel_file(name, [])
    return str(node.get(key)) if node else ""


def pod_file(name: str, faults: list[Fault]) -> Node | None:
    """A set of pods by its name, one of `pod_names()`."""
    text = ACTUATORS.joinpath(f"{name}.yaml").read_text("utf-8")
    return read(text, f"pod file {name}.yaml", faults, placed=False)


def pod_text(name: str, key: str) -> str:
    """A text, such as `source`, from the file of a set of pods."""
    node = pod_file(name, [])
    return str(node.get(key)) if node else ""


def complete(root: Node, faults: list[Fault]) -> Node:
    """The tree with everything filled in that it takes from elsewhere."""
    for fill in (_without_removed, _name, _vessel, _nominal, _pods, _points, _controllers):
        root = fill(root, faults)
    return root


def _without_removed(root: Node, faults: list[Fault]) -> Node:
    """Entries of `controllers` and `claims` that are null are taken out of what is extended."""
    for section in ("controllers", "claims"):
        given = root.mapping.get(section)
        if given and given.mapping:
            kept = {k: e for k, e in given.mapping.items() if e.content is not None or e.faulty}
            root = root.with_entry(section, replace(given, content=kept))
    return root


def _name(root: Node, faults: list[Fault]) -> Node:
    """`name` is the file's name without suffix unless given."""
    if "name" in root.mapping:
        return root
    stem = Path(root.mark.source).stem
    pattern = limits(Scenario.model_fields["name"])["pattern"]
    usable = re.fullmatch(pattern, stem)
    if not usable:
        text = f"cannot be the file's name {quoted(stem)}; give one {PATTERNS_IN_WORDS[pattern]}"
        faults.append(Fault(root.mark, "name", text))
    return root.with_entry("name", Node(stem if usable else None, root.mark, faulty=not usable))


def _vessel(root: Node, faults: list[Fault]) -> Node:
    given = root.mapping.get("vessel")
    if given is None:
        given = Node({}, root.mark, faulty=root.faulty)
    if not isinstance(given.content, dict):
        return root
    return root.with_entry("vessel", _from_preset(given, "vessel", faults))


def _nominal(root: Node, faults: list[Fault]) -> Node:
    """`nominal` is the vessel unless given; with `preset` it starts from that, or from nothing."""
    vessel = root.mapping["vessel"]
    given = root.mapping.get("nominal")
    if given is None:
        return root.with_entry("nominal", vessel)
    if not isinstance(given.content, dict):
        return root
    if "preset" in given.content:
        return root.with_entry("nominal", _from_preset(given, "nominal", faults))
    whole = _sourced(merge(vessel, given))
    lost = not isinstance(vessel.content, dict)
    return root.with_entry("nominal", replace(whole, faulty=whole.faulty or lost))


def _from_preset(given: Node, key: str, faults: list[Fault]) -> Node:
    """The vessel's values over those of its preset, where it has one."""
    preset = given.mapping.get("preset")
    if preset is None or preset.content == "":
        return _whole(given, key, faults)
    if preset.content in vessel_names():
        base = vessel_file(str(preset.content), faults)
        assert base
        return _sourced(merge(base, given))
    if not preset.faulty:
        what = f"vessel {found(preset.content, preset.text)}"
        text = unknown(what, str(preset.content), vessel_names())
        faults.append(Fault(preset.mark, f"{key}.preset", text))
        given = given.with_entry("preset", replace(preset, content=None, faulty=True))
    return replace(given, faulty=True)


def _whole(given: Node, key: str, faults: list[Fault]) -> Node:
    """A vessel without preset; a fault where it lacks what no vessel can do without."""
    fields = Vessel.model_fields.items()
    lacking = [name for name, field in fields if field.is_required() and name not in given.mapping]
    if not lacking or given.faulty:
        return given
    text = f"missing (allowed: {', '.join(vessel_names())}); a vessel without one needs "
    faults.append(Fault(given.mark, f"{key}.preset", text + ", ".join(lacking)))
    return replace(given, faulty=True)


def _sourced(vessel: Node) -> Node:
    """The vessel with a `source` that names the numbers that are not its preset's.

    A source that is not the preset's own is left as it is.
    """
    preset, source = vessel.get("preset"), vessel.mapping.get("source")
    base = vessel_file(preset, []) if preset in vessel_names() else None
    if not base or not source or not str(source.content).startswith(_stem(base)):
        return vessel
    numbers = [name for name in COEFFICIENTS if name in Vessel.model_fields]
    changed = [name for name in numbers if name in vessel.mapping and _differs(vessel, base, name)]
    text = f"{_stem(base)}; {', '.join(changed)} changed by the scenario."
    told = text if changed else str(base.get("source"))
    return vessel.with_entry("source", replace(source, content=told))


def _stem(base: Node) -> str:
    return str(base.get("source")).removesuffix(".")


def _differs(vessel: Node, base: Node, name: str) -> bool:
    here, there = vessel.get(name), base.get(name)
    return bool(here != (Vessel.model_fields[name].default if there is None else there))


def _pods(root: Node, faults: list[Fault]) -> Node:
    """The pods of `actuator.preset`, where there is one, below what is given."""
    given = root.mapping.get("actuator")
    preset = given.mapping.get("preset") if given else None
    if not given or not preset or given.get("kind") != "pod" or preset.content == "":
        return root
    if preset.content not in pod_names():
        if preset.faulty:
            return root
        what = f"set of pods {found(preset.content, preset.text)}"
        faults.append(
            Fault(preset.mark, "actuator.preset", unknown(what, str(preset.content), pod_names()))
        )
        wrong = given.with_entry("preset", replace(preset, content=None, faulty=True))
        return root.with_entry("actuator", replace(wrong, faulty=True))
    base = pod_file(preset.content, faults)
    return root.with_entry("actuator", merge(base, given)) if base else root


def _points(root: Node, faults: list[Fault]) -> Node:
    """Waypoints from the CSV file that `path.file` names, in place of the name."""
    path = root.mapping.get("path")
    file = path.mapping.get("file") if path else None
    if not path or not file or path.get("kind") != "waypoints" or not isinstance(file.content, str):
        return root
    if path.get("points"):
        faults.append(Fault(file.mark, "path.file", "give either file or points, not both"))
        return root
    name = os.path.join(os.path.dirname(file.mark.source) if file.mark.line else "", file.content)
    before = len(faults)
    text = read_text(name, file.mark, "path.file", faults)
    rows = list(_rows(text or "", name, faults))
    points = Node(tuple(rows), Mark(name), faulty=len(faults) > before)
    rest = {key: entry for key, entry in path.mapping.items() if key != "file"}
    filled = replace(path, content=rest | {"points": points}, faulty=path.faulty or points.faulty)
    return root.with_entry("path", filled)


def _controllers(root: Node, faults: list[Fault]) -> Node:
    """Each of `controllers` over those keys of `controller` that its kind has too."""
    base, several = root.mapping.get("controller"), root.mapping.get("controllers")
    if not base or not several:
        return root
    models = sections(Scenario.model_fields["controller"].annotation)
    filled = {name: _like(base, own, models) for name, own in several.mapping.items()}
    return root.with_entry("controllers", replace(several, content=filled))


def _like(base: Node, own: Node, models: Mapping[str, type[Component]]) -> Node:
    model = models.get(str(own.get("kind") or base.get("kind")))
    if not model or not isinstance(own.content, dict):
        return own
    shared = {key: part for key, part in base.mapping.items() if key in model.model_fields}
    return overlay(replace(base, content=shared), own, lambda *_: False)


def _rows(text: str, name: str, faults: list[Fault]) -> Iterator[Node]:
    """A node for every line `x,y`; a first line of words is a header, # starts a comment."""
    lines = [line.partition("#")[0] for line in text.removeprefix("\ufeff").splitlines()]
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    if filled and all(HEADER.match(cell) for cell in filled[0][1].split(",")):
        del filled[0]
    if len(filled) > MAX_POINTS:
        faults.append(Fault(Mark(name), "", f"more than {MAX_POINTS:,} points"))
        return
    most = len(faults) + MOST_FAULTS
    for number, line in filled:
        row = _row(line, Mark(name, number, 1), faults)
        if len(faults) > most:
            return
        yield row


def _row(line: str, mark: Mark, faults: list[Fault]) -> Node:
    cells = [cell.strip().strip('"') for cell in line.split(",")]
    numbers = [resolve(cell) for cell in cells]
    wrong = [isinstance(n, (str, bool)) or n is None for n in numbers]
    # What the line holds is not told: the file may be one that only podusv was given to read.
    if len(numbers) != 2:
        text = f"must be two numbers x,y [m], found {len(numbers)} between commas"
        faults.append(Fault(mark, "", text))
    elif any(wrong):
        place = ("first", "second")[wrong.index(True)]
        faults.append(Fault(mark, "", f"must be two numbers x,y [m]; the {place} is no number"))
    pairs = zip(numbers, cells, strict=True)
    return Node(tuple(Node(number, mark, text=cell) for number, cell in pairs), mark)
