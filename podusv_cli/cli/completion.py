"""What a shell completes after an option or as an argument: keys, kinds, figures, names.

A shell asks at every Tab, so each function imports what it needs itself, and what it offers is kept
on disk until podusv or an installed plug-in changes. What installed packages and the files after
`--plugin` offer is completed too; a scenario's own plug-ins are not, since that would run them at
every Tab.
"""

from __future__ import annotations

import json
from contextlib import suppress
from functools import wraps
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from podusv_cli.core.plugins import Plugins

Offered = list[tuple[str, str]]


def complete_from_cache(
    known: Callable[[Plugins], Mapping[str, str]],
) -> Callable[[typer.Context, str], Offered]:
    """A completion function for typer, of a function that returns words and meanings.

    `known` gets the plug-ins at hand. Its words are cached on disk, but for those of plug-in files
    after `--plugin`.
    """

    @wraps(known, assigned=("__name__", "__doc__"), updated=())
    def complete(context: typer.Context, incomplete: str) -> Offered:
        """The words that begin with `incomplete`, from the file of words if it is of this state.

        Words of the plug-ins on the command line are asked anew each time, and never kept.
        """
        if context.params.get("plugin"):
            return _beginning(incomplete, known(_plugins(context) or ()))
        from podusv_cli.process.code_folder import write

        folder, state = _folder(), _state()
        place = folder and folder / f"{known.__name__}.json"
        # Where nothing was kept, or nothing that can be read, the words are made below.
        with suppress(OSError, ValueError, KeyError):
            there = json.loads(place.read_text("utf-8")) if place else {}
            if there["state"] == state:
                return _beginning(incomplete, there["known"])
        plugins = _plugins(context)
        words = dict(known(plugins or ()))
        with suppress(OSError):
            if place and plugins is not None:  # one that fails today may be loaded tomorrow
                write(place, json.dumps({"state": state, "known": words}).encode())
        return _beginning(incomplete, words)

    del complete.__wrapped__  # whose arguments are others than those that typer passes
    return complete


def _folder() -> Path | None:
    """Where words are kept; None where nothing can be."""
    import logging

    from podusv_cli.process.code_folder import code_folder

    before = logging.root.manager.disable
    logging.disable()  # a shell has no place for a message
    try:
        return code_folder("completion")
    finally:
        logging.disable(before)


def _state() -> str:
    """A digest of podusv's files, its scenarios and the installed plug-ins.

    The words that completion remembers hold as long as it stays the same. Files count by name and
    time, as reading them at every Tab would be slow.
    """
    import hashlib
    from pathlib import Path

    import podusv_cli
    from podusv_cli.core.plugins import installed_plugins
    from podusv_cli.scenario import shipped

    folders = (Path(podusv_cli.__file__).parent, shipped.folder())
    files = (
        path for folder in folders for end in ("py", "yaml") for path in folder.rglob(f"*.{end}")
    )
    times = [(str(path), path.stat().st_mtime_ns) for path in files]
    plugins = [(plugin.name, plugin.sha256) for plugin in installed_plugins()]
    return hashlib.sha256(repr((sorted(times), plugins)).encode()).hexdigest()


@complete_from_cache
def starting_points(plugins: Plugins) -> Mapping[str, str]:
    """Names that `podusv init` takes, with their meanings; no plug-in adds any."""
    from podusv_cli.workflows.examples import examples
    from podusv_cli.workflows.init import starting_points

    return starting_points() | examples()


def pages(incomplete: str) -> Offered:
    """Names of pages of `podusv docs` that begin with `incomplete`, with their titles."""
    from podusv_cli.workflows.docs import contents

    titles = {name: title for part in contents().values() for name, title in part.items()}
    return _beginning(incomplete, titles)


def parts(incomplete: str) -> Offered:
    """What `podusv new` writes."""
    from podusv_cli.workflows.new import PARTS

    return _beginning(incomplete, dict.fromkeys(PARTS, ""))


def keys(context: typer.Context, incomplete: str) -> Offered:
    """`controller.k_ze=` for `--set`; after the equals sign the words that the value may be.

    Where the scenario is already on the line, keys of the kinds that it has; nothing of it is
    executed.
    """
    from pathlib import Path

    # The scenario is `config`, or one of the `items` of a comparison. A word before an option
    # without its value is not yet an argument, and stands in `args`.
    named = [context.params.get("config"), *(context.params.get("items") or ()), *context.args]
    for name in filter(None, named):
        if name.startswith("podusv:") or Path(name).is_file():
            with suppress(Exception):  # there is no place for a message: the next file, or all keys
                return _beginning(incomplete, _keys_in(name, _plugins(context) or ()))
    return all_keys(context, incomplete)


def _keys_in(name: str, plugins: Plugins) -> Mapping[str, str]:
    """Those of a scenario's file, whose own plug-ins are left out."""
    from podusv_cli.scenario.explain import assignments_in
    from podusv_cli.scenario.load import load
    from podusv_cli.scenario.plugins import without_own

    return assignments_in(load(name, plugged=without_own(plugins)).scenario)


@complete_from_cache
def all_keys(plugins: Plugins) -> Mapping[str, str]:
    """The same for any scenario."""
    from podusv_cli.scenario.explain import assignments

    return assignments(plugins)


def exports(incomplete: str) -> Offered:
    """Formats of `podusv sweep export`."""
    return _beginning(incomplete, {"csv": "text", "parquet": "needs pyarrow"})


def laws(context: typer.Context, incomplete: str) -> Offered:
    """The laws that begin with `incomplete`, of the study named before on the command line."""
    from pathlib import Path

    try:
        about = json.loads((Path(context.params["study"]) / "study.json").read_text("utf-8"))
        return _beginning(incomplete, dict.fromkeys(map(str, about["laws"]), ""))
    except (KeyError, TypeError, OSError, ValueError):
        return []  # no study, or none that can be read: there is no place for a message


@complete_from_cache
def figures(plugins: Plugins) -> Mapping[str, str]:
    """Names of figures."""
    from podusv_cli.figures.drawing import figures_with

    return {name: sheet.caption for name, sheet in figures_with(plugins).items()}


@complete_from_cache
def metrics(plugins: Plugins) -> Mapping[str, str]:
    """Names of metrics."""
    from podusv_cli.metrics.table import metrics_with

    return {name: metric.meaning for name, metric in metrics_with(plugins).items()}


@complete_from_cache
def names(plugins: Plugins) -> Mapping[str, str]:
    """What `podusv explain` explains: keys, kinds, signals, presets, metrics, findings."""
    from podusv_cli.findings.finding import finding_kinds
    from podusv_cli.metrics.table import metrics_with
    from podusv_cli.scenario.explain import names

    meanings = dict.fromkeys(names(plugins), "")
    meanings |= {name: metric.meaning for name, metric in metrics_with(plugins).items()}
    return meanings | {name: finding.meaning for name, finding in finding_kinds(plugins).items()}


def _plugins(context: typer.Context) -> Plugins | None:
    """Those on the line and installed ones; None where one of them cannot be loaded.

    A shell has no place for a message; the command itself will tell.
    """
    from podusv_cli.core.errors import PodusvError
    from podusv_cli.scenario.model import scenario_class
    from podusv_cli.scenario.plugins import on_hand

    try:
        plugins = on_hand(context.params.get("plugin") or ())
        scenario_class(plugins)
    except PodusvError:
        return None
    return plugins


def _beginning(incomplete: str, known: Mapping[str, str]) -> Offered:
    return [item for item in known.items() if item[0].startswith(incomplete)]
