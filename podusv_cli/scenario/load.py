"""Loading scenario files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from operator import attrgetter
from typing import Any

from podusv_cli.core.component import BY_RULE
from podusv_cli.core.errors import ScenarioError, StorageError
from podusv_cli.core.plugins import Plugin, Plugins
from podusv_cli.engine.loop.plan import Plan
from podusv_cli.scenario import plugins
from podusv_cli.scenario.case import Case
from podusv_cli.scenario.conflicts import clashes, contradictions
from podusv_cli.scenario.keys import keys_of
from podusv_cli.scenario.kinds import merge_kept
from podusv_cli.scenario.layers import compose_layers, self_contained
from podusv_cli.scenario.messages import check
from podusv_cli.scenario.model import Scenario, scenario_class
from podusv_cli.scenario.named_files import fill_sections, with_contents, without_files
from podusv_cli.scenario.presets import complete, stands_in
from podusv_cli.scenario.resolved import plain_data, yaml_text
from podusv_cli.scenario.shipped import name_of
from podusv_cli.scenario.yaml_text import MAX_NODES, read_text
from podusv_cli.scenario.yaml_tree import (
    Fault,
    Mark,
    Node,
    Route,
    dotted_key,
    find,
    follow,
    merge,
    plain,
    route,
    without_misfits,
)

# Values; several times those of one file, since a scenario may extend files with long lists.
MOST_RESOLVED = 3 * MAX_NODES


# From a tree to the tree with its plug-ins in order, and these; see `plugins.load_plugins`.
Plugged = Callable[[Node, list[Fault]], tuple[Node, Plugins]]
LOOKED_AT: Plugged = partial(plugins.used_of, ())


@dataclass(frozen=True)
class Loaded:
    """A scenario, the plan of each of its runs, and the origins of its values.

    `text` is the scenario file as given. `root` is the tree of which the scenario is made, `filled`
    is this with presets, files and what stands for other values. `remarks` are sentences about
    values that were given to a section before it was given another kind, which does not take them,
    and about what of a route is left out or taken for granted.
    """

    scenario: Scenario
    filled: Node
    text: str
    root: Node
    remarks: tuple[str, ...] = ()

    @cached_property
    def origins(self) -> dict[str, str]:
        """Of every dotted key: "configs/a.yaml:12:5", "--set a.b=v", "default", `BY_RULE`, ..."""
        origins = {}
        for at, _ in _leaves(plain_data(self.scenario), ()):
            node = find(self.filled, at)
            origins[dotted_key(at)] = str(node.mark) if node else "default"
        return origins | {dotted_key(steps): BY_RULE for steps in self.scenario.keys_by_rule()}

    @cached_property
    def contradictions(self) -> list[tuple[str, str]]:
        """Key and message for every pair of values that contradict each other."""
        return contradictions(self.scenario)

    @cached_property
    def plans(self) -> dict[str, Plan]:
        """The plan of each law's run, by label; none can be made of values that contradict."""
        return {} if self.contradictions else self.scenario.plans()

    def plan(self, single: Scenario) -> Plan:
        """That of one run; its law may be a `controller` that is none of several `controllers`."""
        alike = (plan for plan in self.plans.values() if plan.loop.controller == single.controller)
        return next(alike, None) or single.plan()

    @cached_property
    def cases(self) -> dict[str, Case]:
        """The case of each law's run, by label; none where values contradict."""
        singles = self.scenario.singles()
        return {
            label: Case(singles[label], plan, self.scenario.identify)
            for label, plan in self.plans.items()
        }

    def case(self, single: Scenario) -> Case:
        """That of one run, with the plan that `plan` has for it."""
        return Case(single, self.plan(single), self.scenario.identify)

    @cached_property
    def clashes(self) -> list[tuple[str, str]]:
        """Key and message for every law of which two signals would have one name."""
        return list(clashes(self.scenario, self.plans))

    def pass_checks(self, faults: list[Fault], checks: Sequence[Check]) -> Loaded:
        """This scenario, if nothing is wrong. Raises ScenarioError with all that is.

        `faults` are those found so far; those of contradictions and `checks` are added, with
        places.
        """
        for key, text in chain(self.contradictions, *map(self._faults_by, checks)):
            steps = route(key) if isinstance(key, str) else key
            mark = follow(self.filled, steps)[-1].mark
            faults.append(Fault(mark, key if isinstance(key, str) else dotted_key(key), text))
        if faults:
            raise ScenarioError(_order_faults(faults, self.root.mark.source))
        return self

    def _faults_by(self, check: Check) -> tuple[tuple[str | Route, str], ...]:
        """What a check finds.

        It is remembered, since a study's only cell is checked as the scenario was.
        """
        if check not in self._faults_found:
            self._faults_found[check] = tuple(check(self))
        return self._faults_found[check]

    @cached_property
    def _faults_found(self) -> dict[Check, tuple[tuple[str | Route, str], ...]]:
        return {}

    def warn_of_remarks(self, warn: Callable[[str], object]) -> Loaded:
        """This, after a warning of each of its remarks."""
        for remark in self.remarks:
            warn(f"warning: {remark}")
        return self

    def merge_over(self, top: Node, checks: Sequence[Check] = ()) -> Scenario:
        """The scenario of the same tree with the tree `top` merged over it.

        Raises ScenarioError.
        """
        faults: list[Fault] = []
        root = merge(self.root, without_misfits(self.root, top, faults))
        root = merge_kept(root, keys_of(type(self.scenario)), [])
        scenario, filled = _build_scenario(root, self.scenario.plugged, faults, [])
        changed = replace(self, scenario=scenario, filled=filled, root=root)
        return changed.pass_checks(faults, (CLASHES, *checks)).scenario


# What is wrong with what is loaded: key and message. A key as its steps where names have dots.
Check = Callable[[Loaded], Sequence[tuple[str | Route, str]]]
CLASHES: Check = attrgetter("clashes")


def load(
    path: str | os.PathLike[str],
    overrides: Sequence[str] = (),
    checks: Sequence[Check] = (),
    files: Sequence[str] = (),
    plugged: Plugged = plugins.load_plugins,
) -> Loaded:
    """The scenario of a file, with overrides such as `vessel.m=24`.

    `checks` are made after the scenario's own. `files` are plug-ins (`--plugin`) beside the
    scenario's, and `plugged` takes in all of them. Raises ScenarioError with all faults, also if
    the file cannot be read.
    """
    faults: list[Fault] = []
    source = name_of(path)
    text = read_text(source, Mark(source), "", faults)
    if text is None:
        raise ScenarioError(_order_faults(faults, source))
    return load_text(text, source, overrides, checks, files, plugged)


def load_text(
    text: str,
    source: str,
    overrides: Sequence[str] = (),
    checks: Sequence[Check] = (),
    files: Sequence[str | Plugin] = (),
    plugged: Plugged = plugins.load_plugins,
    *,
    placed: bool = True,
) -> Loaded:
    """The scenario of a text; `source` names it in messages and is where its file names start.

    Messages give lines of the text only where `placed`. The other arguments are those of `load`.
    Raises ScenarioError with everything that is wrong.
    """
    faults: list[Fault] = []
    root = compose_layers(text, source, overrides, faults, placed=placed)
    if root is None:
        raise ScenarioError(_order_faults(faults, source))
    root, known, remarks = _resolve_plugins(root, plugged, files, source, faults)
    scenario, filled = _build_scenario(root, known, faults, remarks)
    loaded = Loaded(scenario, filled, text, root, tuple(remarks))
    return loaded.pass_checks(faults, (CLASHES, *checks))


def load_stored(
    text: str,
    source: str,
    overrides: Sequence[str] = (),
    checks: Sequence[Check] = (),
    files: Sequence[str | Plugin] = (),
    plugged: Plugged = LOOKED_AT,
) -> Loaded:
    """The scenario in the folder of a run, study or search; it refers to no file but its plug-ins.

    Unless `plugged` loads these, components are those of podusv and of installed packages. Raises
    StorageError where the text names another file, which is not read, or is no YAML mapping at all;
    ScenarioError where it is one that this podusv does not know.
    """
    faults: list[Fault] = []
    root = self_contained(text, source, overrides, faults, MOST_RESOLVED)
    _raise_damage(faults, source)
    if root is None or faults:
        raise ScenarioError(_order_faults(faults, source))
    root, known, remarks = _resolve_plugins(root, plugged, files, source, faults)
    # Only to find the names of files; the result is not used.
    fill_sections(root, keys_of(scenario_class(known)), faults, without_files)
    _raise_damage(faults, source)
    scenario, filled = _build_scenario(root, known, faults, remarks)
    # Without CLASHES: what a folder keeps passed that check when it was run.
    return Loaded(scenario, filled, text, root, tuple(remarks)).pass_checks(faults, checks)


def _raise_damage(faults: list[Fault], source: str) -> None:
    """Raise StorageError with the first fault in the file called `source`."""
    for fault in _order_faults([fault for fault in faults if fault.mark.source == source], source)[
        :1
    ]:
        raise StorageError(f"{fault} (the file is damaged, or podusv did not write it)")


def _resolve_plugins(
    root: Node, plugged: Plugged, files: Sequence[str | Plugin], source: str, faults: list[Fault]
) -> tuple[Node, Plugins, list[str]]:
    """The merged tree, its plug-ins, and remarks on what is dropped.

    The tree has what sections keep of a base of another kind. `files` are plug-ins of the command
    line. Raises ScenarioError where a plug-in is at fault: without it, nothing else can be said of
    the tree.
    """
    before, dropped = len(faults), list[str]()
    root, known = plugged(plugins.with_given(root, files), faults)
    if len(faults) > before:
        raise ScenarioError(_order_faults(faults, source))
    return merge_kept(root, keys_of(scenario_class(known)), dropped), known, dropped


def _build_scenario(
    root: Node, known: Plugins, faults: list[Fault], remarks: list[str]
) -> tuple[Scenario, Node]:
    """The scenario of a tree, and the tree with presets, files and defaults filled in.

    `known` are the plug-ins; `remarks` takes sentences as `complete` says. Raises ScenarioError.
    """
    top, source = keys_of(scenario_class(known)), root.mark.source
    root = complete(root, top, faults, remarks)
    scenario = check(root, top, faults)
    if scenario is None:
        raise ScenarioError(_order_faults(faults, source))
    if stands_in(root):  # the very same law says so, see `Scenario.open_choice`
        first = next(iter(scenario.controllers.values()))
        scenario = scenario.model_copy(update={"controller": first})
    return scenario, root


def _order_faults(faults: list[Fault], first: str) -> list[Fault]:
    """The faults file by file, the file called `first` ahead, in the order of lines.

    Those without a line come last: what is missing may be there under a wrong name.
    """
    sources = list(dict.fromkeys([first, *(fault.mark.source for fault in faults)]))

    def place(fault: Fault) -> tuple[int, bool, int, int]:
        mark = fault.mark
        return sources.index(mark.source), not mark.line, mark.line, mark.column

    return sorted(faults, key=place)


def values(scenario: Scenario) -> dict[str, Any]:
    """Every value of a scenario by its dotted key, in the order of the fields."""
    return {dotted_key(route): content for route, content in _leaves(plain_data(scenario), ())}


def _leaves(data: dict[str, Any], above: Route) -> Iterator[tuple[Route, Any]]:
    """Route and content of each value in nested dicts; `above` is the route of `data` itself.

    An empty dict is a value too.
    """
    for name, content in data.items():
        if isinstance(content, dict) and content:
            yield from _leaves(content, (*above, name))
        else:
            yield (*above, name), content


def tree_yaml(loaded: Loaded) -> str:
    """The scenario as one file that can be changed like the given one.

    It has all that the file extends and all that `--set` gave, and nothing that is filled in:
    `nominal` follows the vessel, and the laws follow `controller`, as before.
    """
    root = with_contents(loaded.root, keys_of(type(loaded.scenario)), [], [])
    return yaml_text({"name": loaded.scenario.name} | plain(root))
